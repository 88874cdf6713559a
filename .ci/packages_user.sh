#!/usr/bin/env bash
# Runs in a bare Debian system (see packages.sh): installs the packages from this folder, trains a small network, writes a level set,
# and builds and runs a program that uses the installed library.
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
python3 packages_user.py
apt-get purge -y -qq '*sdmgen*' >/dev/null
[ ! -e /usr/share/sdmgen ] || { echo "the packages leave /usr/share/sdmgen behind" >&2 && exit 1; }
