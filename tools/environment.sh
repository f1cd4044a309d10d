# Sourced by run, build.sh and the Makefile: takes out of the environment what another ROS has put in.
# A Jazzy that is sourced stays where the virtual environment was made for it.
#
# Usage: . tools/environment.sh ROS     (ROS as in setup.sh)

if [[ $1 == wheels || ${ROS_DISTRO:-} != jazzy ]]; then
    unset PYTHONPATH AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH ROS_DISTRO ROS_VERSION
    unset ROS_PYTHON_VERSION _ROS_WHEELS_BOOTSTRAP_COMPLETE # with which the wheels find their libraries
    libraries=
    while IFS= read -r -d : folder; do # libraries of CUDA and the like stay
        [[ -z $folder || -e $folder/librcl.so ]] || libraries+=${libraries:+:}$folder
    done <<<"${LD_LIBRARY_PATH:-}:"
    if [[ -n $libraries ]]; then
        export LD_LIBRARY_PATH=$libraries
    else
        unset LD_LIBRARY_PATH
    fi
    unset libraries folder
fi
