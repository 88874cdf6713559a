#!/bin/bash
# --isolate: what a plug-in does in its callbacks ends in one line and exit code 3; results have the same bits; no process is left.
# Tests: setup.c main.c isolated_worker.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
plugin=$(cd ../../plugins/faulty && pwd)/faulty.so
isolated=(--plugin "$plugin" --isolate)

# fault FAULT REASON [SECONDS]: the fault of mesh() is named with plug-in, callback and parameters
fault() {
    expect 3 "error: shape 'faulty' at size=2.5 reach=1.5: $2" \
        sdmgen exact --shape faulty -O fault="$1" "${isolated[@]}" --isolate-seconds "${3:-60}" --isolate-memory 0.2 -o ended.nrrd
    expect 0 - sdmgen exact --shape faulty -O fault="$1" -p size=1.5 --size 8,8,8 "${isolated[@]}" -q -o fine.nrrd
}
fault crash '.*/faulty\.so: mesh\(\): the plug-in used memory that is not its own'
fault exit '.*/faulty\.so: mesh\(\): the plug-in called exit\(0\)'
fault hang '.*/faulty\.so: mesh\(\): the plug-in did not come to an end within 1 s' 1
fault flood '.*/faulty\.so: mesh\(\): the plug-in needs more than 0\.2 GB of memory'
fault heap '.*/faulty\.so: mesh\(\): the plug-in called abort\(\), or damaged memory'
absent ended.nrrd

# a mesh that differs from call to call, which a map of one mesh does not show
expect 3 "shape 'faulty': mesh\\(\\) gives another mesh when it is called again" sdmgen exact --shape faulty -O fault=unlike "${isolated[@]}" -o ended.nrrd
absent ended.nrrd

# what it prints is a notice, and no part of the result
expect 0 "plug-in .*faulty\.so prints: a line for the user" sdmgen mesh --shape faulty -O fault=print "${isolated[@]}" --audit --json
[ "$(wc -l <out)" -eq 1 ] || bad "more than the result: $(cat out)"
expect 0 - sdmgen mesh --shape faulty -O fault=print "${isolated[@]}" -q -o print.ply

# a survey goes on after a crash
expect 3 "mend what is marked 'broken'" sdmgen shapes check faulty -O fault=crash "${isolated[@]}" --samples 4
has '^broken +no mesh in [4-8] of 9 shapes: .*faulty\.so: mesh\(\): the plug-in used memory'

# the same bits
for k in "" --isolate; do
    expect 0 - sdmgen exact --shape faulty -O fault=kink --plugin "$plugin" $k -o map$k.nrrd --jacobian jacobian$k.npy -q
    expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" 'shape={name: faulty}' 'grid={size: [16, 14, 14], spacing: 0.8, centre: [1, 0, 0]}' \
        --plugin "$plugin" $k --out run$k -q
done
for file in map%.nrrd jacobian%.npy run%/model.sdm; do
    cmp -s "${file/\%/}" "${file/\%/--isolate}" || bad "$file differs with --isolate"
done

# a worker ends with the program
has_children() { [ -n "$(cat "/proc/$1/task/$1/children")" ]; }
"$program" mesh --shape faulty -O fault=hang "${isolated[@]}" --isolate-seconds 100 -o x.ply 2>err &
pid=$!
await $pid has_children $pid
worker=$(cat /proc/$pid/task/$pid/children)
sleep 0.3
kill -KILL $pid
wait $pid 2>err
for _ in $(seq 100); do [ -d "/proc/${worker% }" ] && sleep 0.05 || break; done
absent "/proc/${worker% }" x.ply

expect 2 'isolate-seconds needs --isolate' sdmgen exact --shape torus --isolate-seconds 3 -o x.nrrd
expect 2 'isolate-memory' sdmgen exact --shape torus --isolate --isolate-memory 0 -o x.nrrd
expect 0 - sdmgen exact --shape torus --isolate -o x.nrrd
expect 3 'no_symbol/plugin.so: exports no function' sdmgen shapes --plugin ../../plugins/no_symbol/plugin.so --isolate
SDMGEN_PLUGIN_PATH=$(dirname "$plugin") expect 0 - sdmgen mesh --shape faulty --isolate -o path.ply
finish
