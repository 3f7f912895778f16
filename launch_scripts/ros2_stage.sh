#!/usr/bin/env bash
# The tests with the real ROS 2 tools, in a terminal in which ROS 2 Jazzy is sourced:
#
#   launch_scripts/ros2_stage.sh [PYTEST OPTIONS]
#
# Builds both packages into .ros2/ with the Python and the libraries of that ROS 2, beside .venv and
# without it, and runs test/ros2 on what was built.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v ros2 >/dev/null || { echo "no ros2 on PATH: source ROS 2 Jazzy first" >&2; exit 2; }

mkdir -p .ros2
touch .ros2/COLCON_IGNORE
# Without it colcon limits the load, and make then compiles one file at a time.
export MAKEFLAGS=${MAKEFLAGS:--j$(nproc)}
colcon --log-base .ros2/log build --build-base .ros2/build --install-base .ros2/install \
  --base-paths . msg_config --cmake-args -DBUILD_TESTING=OFF >.ros2/build.log 2>&1 ||
  { tail -n 40 .ros2/build.log >&2; exit 1; }
set +u # colcon's scripts read variables that may not be set
. .ros2/install/setup.sh
set -u

# Each file of tests starts its own rig; with pytest-xdist they run side by side.
python3 -c 'import xdist' 2>/dev/null && set -- --numprocesses=2 --dist=loadfile "$@"
# -P: what was built is tested, not the folder beside it.
python3 -c 'import sys, numpy, scipy; print("Python", sys.version.split()[0], "numpy",
            numpy.__version__, "scipy", scipy.__version__)'
exec python3 -P -m pytest -p no:cacheprovider --timeout=300 "$@" test/ros2
