#!/usr/bin/env bash
# Runs in a bare Debian system (see packages.sh): installs the packages from this folder, trains a small network, writes a level set,
# builds and runs a program that uses the installed library, and runs a script in Python: with the package, and, after the packages are
# gone, with the wheel in a virtual environment that has nothing but it and Debian's NumPy, PyTorch and matplotlib.
set -euo pipefail
cd "$(dirname "$0")"
export DEBIAN_FRONTEND=noninteractive
apt-get install -y -qq --no-install-recommends ./*.deb >/dev/null
dpkg --verify $(dpkg-query -W -f '${Package}\n' '*sdmgen*')
sdmgen train tiny.yaml --out run --quiet
sdmgen generate run/model.sdm -o map.vdb -o map.npy
sdmgen verify map.vdb
cmake -S . -B build >/dev/null
cmake --build build >/dev/null
build/consume run/model.sdm
apt-get install -y -qq --no-install-recommends python3-torch python3-matplotlib python3-venv >/dev/null

# first_network PYTHON MINUTES: runs the example and looks for its files
first_network() {
    local file
    "$1" first_network.py "$2"
    for file in box/model.sdm box.stl first_network.png; do
        [ "$(stat -c %s "$file")" -gt 1000 ] || { echo "$file is missing or empty" >&2 && exit 1; }
    done
    rm -r box box.stl first_network.png
}
first_network python3 0.2
apt-get purge -y -qq '*sdmgen*' >/dev/null
[ ! -e /usr/share/sdmgen ] || { echo "the packages leave /usr/share/sdmgen behind" >&2 && exit 1; }
python3 -m venv --system-site-packages venv
venv/bin/pip install --quiet --no-index --no-deps ./*.whl
first_network venv/bin/python 0.2
