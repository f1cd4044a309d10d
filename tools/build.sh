#!/usr/bin/env bash
# Builds packages of the workspace with colcon. Called by the Makefile.
#
# Usage: tools/build.sh ROS PACKAGE...     (ROS as in setup.sh)
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
export PYTHONWARNINGS="ignore:setup.py install is deprecated,ignore:easy_install command is deprecated"

colcon build --base-paths src --packages-select "$@"
