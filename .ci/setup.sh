# shellcheck shell=bash
# Shared by ./run and ./run-tests (sourced, bash): installs what is missing and builds.

# what a bare Debian 12 lacks; boost and imath are asked for by OpenVDB's own CMake files
packages=(gcc g++ cmake ninja-build pkg-config libyaml-dev zlib1g-dev libcairo2-dev libopenvdb-dev libboost-iostreams-dev libcmocka-dev libhdf5-dev python3-h5py
    clang-14 lld-14 wasi-libc libclang-rt-14-dev-wasm32) # the last four for the pages of sdmgen report

say() { printf '\n== %s\n' "$*"; }

# Names of the packages above that dpkg does not have.
missing_packages() {
    local name
    for name in "${packages[@]}"; do
        # one line for each architecture of the package
        dpkg-query -W -f '${db:Status-Status}\n' "$name" 2>/dev/null | grep -qx installed || printf '%s ' "$name"
    done
}

install_packages() {
    if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
        say "not a Debian system: taking for granted what these Debian packages hold: ${packages[*]}"
        return
    fi
    local missing as_root=()
    missing=$(missing_packages)
    if [ -z "$missing" ]; then return; fi
    say "installing: $missing"
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null; then
            echo "as root, run: apt-get install --no-install-recommends $missing" >&2
            exit 1
        fi
        as_root=(sudo)
    fi
    "${as_root[@]}" apt-get update -qq
    # shellcheck disable=SC2086 # a list of names
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
}

# configure PRESET [OPTION...]: makes build/PRESET ready.
configure() {
    local preset=$1 generator=()
    shift
    [ -f "build/$preset/CMakeCache.txt" ] || generator=(-G Ninja)
    cmake --preset "$preset" "${generator[@]}" "$@" >"$(log_of configure "$preset")" 2>&1 || fail_with "$(log_of configure "$preset")"
}

# build PRESET [TARGET]: configures build/PRESET and builds it.
build() {
    configure "$1"
    cmake --build --preset "$1" --target "${2:-all}"
}

log_of() { mkdir -p "build/$2" && echo "build/$2/$1.log"; }

fail_with() {
    cat "$1" >&2
    exit 1
}
