#!/usr/bin/env bash
# Debian packages: builds them, checks them with lintian, and uses them in a bare Debian system in a folder of its own.
#   .ci/packages.sh            build, lintian, installation in the bare system, programs that use the library, there also the wheel
#   .ci/packages.sh --twice    also: a second build in another folder, time zone and language gives the same files, bit by bit
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. .ci/setup.sh
packages+=(debhelper dh-python dpkg-dev lintian mmdebstrap python3 python3-setuptools python3-wheel)
install_packages
work=$(mktemp -d "${TMPDIR:-/tmp}/sdmgen-packages.XXXXXX")
trap 'rm -rf "$work"' EXIT

# build_packages FOLDER [NAME=VALUE ...]: builds the packages of the committed files in FOLDER/sdmgen with these environment variables;
# the packages are left in FOLDER
build_packages() {
    local folder=$1
    shift
    mkdir -p "$folder/sdmgen"
    git archive HEAD | tar -x -C "$folder/sdmgen"
    (cd "$folder/sdmgen" && env "$@" DEB_BUILD_OPTIONS="nocheck parallel=$(nproc)" dpkg-buildpackage -b -us -uc >../build.log 2>&1) ||
        { tail -n 30 "$folder/build.log" >&2 && return 1; }
}

say "building the packages"
build_packages "$work/first"
say "checking the packages"
lintian --fail-on warning --tag-display-limit 0 "$work"/first/*.changes

if [ "${1:-}" = --twice ]; then
    say "building the packages again, elsewhere"
    build_packages "$work/second/deeper/place" TZ=Pacific/Kiritimati LC_ALL=C.UTF-8 LANGUAGE=de
    for file in "$work"/first/*.deb; do cmp "$file" "$work/second/deeper/place/$(basename "$file")"; done
fi

say "building the wheel"
libraries=("$work"/first/sdmgen/debian/tmp/usr/lib/*/libsdmgen.so)
cp -r "$work/first/sdmgen/python" "$work/wheel"
(cd "$work/wheel" && SDMGEN_LIBRARY=${libraries[0]} /usr/bin/python3 -c "from setuptools import build_meta as b; b.build_wheel('..')" >../wheel.log 2>&1) ||
    { cat "$work/wheel.log" >&2 && exit 1; }

say "using the packages and the wheel in a bare system"
mkdir "$work/repository"
(cd "$work/first" && cp ./*.deb sdmgen/examples/consume/* sdmgen/tests/cli/tiny.yaml sdmgen/.ci/packages_user.sh sdmgen/examples/python/first_network.py ../*.whl "$work/repository")
mmdebstrap --quiet --variant=apt --include=gcc,libc6-dev,cmake,make \
    --customize-hook="copy-in $work/repository /opt" --customize-hook='chroot "$1" bash /opt/repository/packages_user.sh' \
    bookworm /dev/null
say "the packages and the wheel are fine"
