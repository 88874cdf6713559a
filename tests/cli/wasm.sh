#!/usr/bin/env bash
# The runtime as WebAssembly: built, installed, used by examples/wasm in Node.js and compared with the same program built for this machine
# (third argument). Skipped if a tool is missing.
baseline=$3
. "$(dirname "$0")/common.sh"

skip() {
    echo "skipped: $1" >&2
    exit 77
}
command -v node >/dev/null || skip "no node (Debian: nodejs)"
clang=$(command -v clang-14 || command -v clang) || skip "no clang (Debian: clang-14)"
printf '#include <math.h>\n#include <stdio.h>\nint main(int n, char **a) { return printf("%%s", a[0]) + (int)sin(n); }\n' >try.c
"$clang" --target=wasm32-wasi -msimd128 -o try.wasm try.c 2>log ||
    skip "no WebAssembly by $clang (Debian: lld-14 wasi-libc libclang-rt-14-dev-wasm32): $(head -n 1 log)"

here=$PWD
{ (cd "$source_folder" && cmake --preset wasm -B "$here/build") && cmake --build build --parallel 2 &&
    cmake --install build --prefix "$here/prefix"; } >log 2>&1 || bad "build: $(tail -n 5 log)"
# The command shown in examples/wasm/README.md, with folders of this test.
line=$(grep '^cmake -S examples/wasm -B build/map ' "$source_folder/examples/wasm/README.md")
line=${line/build\/map/'"$here/example"'}
line=${line/'$PWD/build/wasm/prefix'/'$here/prefix'}
(cd "$source_folder" && eval "$line") >log 2>&1 || bad "configure the example: $(tail -n 5 log)"
cmake --build example >log 2>&1 || bad "build the example: $(tail -n 5 log)"
present example/map.wasm
[ "$failures" -eq 0 ] || finish

map() { node --no-warnings "$source_folder/examples/wasm/run.mjs" example/map.wasm "$@"; }

# far_apart A B: the largest difference of two maps in mm.
far_apart() {
    paste <(od -An -v -j128 -w4 -tf4 "$1") <(od -An -v -j128 -w4 -tf4 "$2") |
        awk 'NF != 2 { bad = 1 } { d = $1 - $2; if (d < 0) d = -d; if (!(d <= max)) max = d } END { print bad || !NR ? "" : max + 0 }'
}

expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" shape.name=ellipsoid "shape.ranges.rx=[2, 4]" --out run --quiet
model=run/model.sdm
# The network: the same bits on every instruction set.
expect 0 - sdmgen generate $model -p rx=2.6 -p rz=3.1 -o native.npy
expect 0 - map $model wasm.npy rx=2.6 rz=3.1
has '^ellipsoid by the network: 16 x 14 x 12 voxels in [0-9.]+ ms$'
present wasm.npy
cmp native.npy wasm.npy || bad "another map by the network, $(far_apart native.npy wasm.npy) mm away"
# Outside of the network's range the exact engine: sine and cosine of another C library may differ in the last bit.
expect 0 - "$baseline" $model native.npy rx=4.6
expect 0 - map $model wasm.npy rx=4.6
has '^ellipsoid by the exact engine: '
near "$(far_apart native.npy wasm.npy)" 0 1e-5
expect 1 '^map: .*missing\.sdm: cannot open' map missing.sdm none.npy
expect 1 "^map: .*'rx' = 5\.1 mm, allowed 1 \.\. 5 mm" map $model none.npy rx=5.1
head -c 1000 $model >damaged.sdm
expect 1 '^map: .*damaged\.sdm: truncated' map damaged.sdm none.npy
absent none.npy
finish
