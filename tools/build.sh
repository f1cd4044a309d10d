#!/usr/bin/env bash
# Builds packages of the workspace with colcon. Called by the Makefile.
#
# Usage: tools/build.sh ROS [--missing] PACKAGE...     (ROS as in setup.sh)
#   --missing  leaves out the packages that ROS itself has: interfaces that the wheels lack
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

ros=$1
shift
venv=$PWD/.venv

. tools/environment.sh "$ros"
if [[ $ros == wheels ]]; then
    export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv
elif [[ ${ROS_DISTRO:-} != jazzy ]]; then
    set +u # the script reads unset variables
    . /opt/ros/jazzy/setup.bash
    set -u
fi
export VIRTUAL_ENV=$venv PATH=$venv/bin:$PATH
# colcon itself calls `setup.py install`, of which setuptools warns at every build.
unset PYTHONDONTWRITEBYTECODE # compile once, at the build
unset MAKEFLAGS # colcon chooses the number of jobs
export PYTHONWARNINGS="ignore:setup.py install is deprecated,ignore:easy_install command is deprecated"

# Whether ROS has a package; what this workspace built of it does not count.
in_ros() {
    local prefix prefixes
    IFS=: read -ra prefixes <<<"$AMENT_PREFIX_PATH"
    for prefix in "${prefixes[@]}"; do
        [[ $prefix == "$PWD"/install* || ! -e $prefix/share/ament_index/resource_index/packages/$1 ]] ||
            return 0
    done
    return 1
}

packages=("$@")
if [[ $1 == --missing ]]; then
    packages=()
    for package in "${@:2}"; do
        in_ros "$package" || packages+=("$package")
    done
    ((${#packages[@]})) || exit 0
fi

colcon build --base-paths src src/ros_interfaces/*/ --packages-select "${packages[@]}"
