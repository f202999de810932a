#!/bin/sh
# Build the messages of ROS 2 that come in no wheel, for real nodes:  build.sh ENVIRONMENT
# Needs CMake and a C++ compiler.
set -e
venv=$(cd "$1" && pwd)
mkdir -p "$venv/build"
export AMENT_PREFIX_PATH="$venv" LD_LIBRARY_PATH="$venv/lib" PATH="$venv/bin:$PATH"
for package in "$(dirname "$0")"/*/package.xml; do
    from=$(dirname "$package")
    to=$venv/build/$(basename "$from")
    {
        cmake -S "$from" -B "$to" -DCMAKE_PREFIX_PATH="$venv" -DCMAKE_INSTALL_PREFIX="$venv" -DBUILD_TESTING=OFF \
            -DPython3_EXECUTABLE="$venv/bin/python"
        cmake --build "$to"
        cmake --install "$to"
    } > "$to.log"
done
