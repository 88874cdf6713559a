#!/usr/bin/env bash
# sdmgen bench exact: results of the built-in methods and of other programs (replaced by scripts with known answers), and messages about
# missing programs.
# Tests: bench_case.c bench_compare.c bench_own.c bench_peers.c bench_points.c bench_programs.c bench_report.c cmd_bench.c
. "$(dirname "$0")/common.sh"

mkdir tmp peers none
export TMPDIR=$PWD/tmp

# row NAME KEY: the value of KEY in the JSON row of method NAME in `out`.
row() { grep -o "{\"name\": \"$1\", [^}]*}" out | sed -n "s/.*\"$2\": \\(\"[^\"]*\"\\|[^,}]*\\).*/\\1/p" | tr -d '"'; }
above() { awk -v a="$1" -v b="$2" 'BEGIN { exit !(a != "" && a > b) }' || bad "$1 is not above $2"; }
no_figures() { [ "$(row "$1" done)" = false ] && row "$1" note | grep -Eq -- "$2" || bad "$1: not '$2' but: $(row "$1" note)"; }

box=(--shape torus --size '14,12,10' --spacing 0.6 --origin '-4,-3.5,-2.8')

# Built-in methods: the exact one agrees with its oracle (naive) on a mesh without overlap.
expect 0 - sdmgen bench exact "${box[@]}" --peers none --repeat 1 --json --threads 2
near "$(json voxels)" 1680 0
[ "$(json union)" = false ] || bad 'the torus overlaps itself'
for name in exact 'exact, 2 threads' naive; do
    [ "$(row "$name" done)" = true ] || bad "no figures of $name"
    above "$(row "$name" ms_total)" 0
    near "$(row "$name" max_error_mm)" 0 1e-5
    near "$(row "$name" wrong_signs)" 0 0
    near "$(row "$name" judged_signs)" 1680 0
    near "$(row "$name" compared)" 1680 0
done
near "$(row exact times_exact)" 1 0
grep -q vtk out && bad '--peers none runs others'

# A mesh that overlaps itself: distances are compared outside only, but every method must find the inside.
expect 0 - sdmgen bench exact --shape cochlea --size '20,20,20' --spacing 0.5 --peers none --repeat 1 --share 0.1 --json
[ "$(json union)" = true ] || bad 'the cochlea does not overlap itself'
above "$(row exact judged_signs)" "$(row exact compared)"
near "$(row naive share)" 0.1 0.03
near "$(row naive max_error_mm)" 0 1e-5

# Other programs: their arguments and the checks of their answers. The naive method gives the correct values.
expect 0 'leaves the grid' sdmgen exact "${box[@]}" --method naive --quiet -o right.npy
expect 0 'leaves the grid' sdmgen exact --shape torus --size '14,12,10' --spacing 0.6 --origin '-3.9,-3.5,-2.8' --quiet -o shifted.npy
expect 0 'leaves the grid' sdmgen exact --shape torus --size '5,5,5' --spacing 1 --quiet -o small.npy
floats() { od -An -v -t f4 -w4 -j $header "$1"; }
header=$(($(wc -c <right.npy) - 1680 * 4))
{
    head -c $header right.npy
    printf '%b' "$(od -An -v -t u1 -w4 -j $header right.npy | # the sign is the highest bit of the last byte
        awk '{ printf "\\x%02x\\x%02x\\x%02x\\x%02x", $1, $2, $3, ($4 + 128) % 256 }')" || true
} >turned.npy 2>/dev/null
[ "$(wc -c <turned.npy)" -eq "$(wc -c <right.npy)" ] || bad 'the turned values are damaged'
# peer NAME LINE...: writes a program that runs these lines of shell; its argument $1 is the mesh, ${14} the file of values.
peer() {
    { echo '#!/bin/bash' && printf '%s\n' "${@:2}"; } >"peers/sdmgen-peer-$1"
    chmod +x "peers/sdmgen-peer-$1"
}
answer='echo "{\"prepare_ms\": 2, \"map_ms\": 5, \"share\": 0.25, \"peak_kb\": 2048, \"band\": false, \"version\": \"V 1\", \"note\": \"n\"}"'
peer right "echo \"\$@\" >$PWD/asked" "cp \"\$1\" $PWD/asked.ply" 'echo a warning >&2' "cp $PWD/right.npy \${14}" "$answer"
peer shifted "cp $PWD/shifted.npy \${14}" "$answer"
peer turned "cp $PWD/turned.npy \${14}" "$answer"
peer small "cp $PWD/small.npy \${14}" "$answer"
peer empty "$answer"
peer silent 'exit 3'
peer killed 'kill -9 $$'
peer babble 'echo cannot load a library' 'exit 127'
peer failed "cp $PWD/right.npy \${14}" "$answer" 'exit 1'
peer missing 'echo "{\"error\": \"Library X is missing: install libx\"}"'
echo '#!/bin/bash' >peers/sdmgen-peer-locked
expect 0 - sdmgen bench exact "${box[@]}" --peers peers --repeat 4 --share 0.5 --json
read -r -a asked <asked
[ "${#asked[@]}" -eq 14 ] || bad "asked with ${#asked[@]} arguments"
[ "${asked[*]:1:12}" = '14 12 10 -4 -3.5 -2.8 0.6 0.6 0.6 0.5 0 4' ] || bad "asked: ${asked[*]}"
near "$(row right ms_prepare)" 2 0
near "$(row right ms_map)" 20 1e-9
near "$(row right memory_mb)" 2 0
near "$(row right max_error_mm)" 0 1e-5
near "$(row right compared)" 1680 0
near "$(row right wrong_signs)" 0 0
row right note | grep -q '^V 1: n$' || bad "note: $(row right note)"
# Moving the grid by 0.1 mm changes a distance by at most as much.
near "$(row shifted max_error_mm)" 0.09 0.01001
above "$(row shifted mean_error_mm)" 0.01
near "$(row turned wrong_signs)" 1680 0
near "$(row turned compared)" 0 0
[ "$(row turned max_error_mm)" = null ] || bad 'an error where nothing is compared'
no_figures small 'another size'
no_figures empty 'values\.npy'
no_figures silent 'no result, exit code 3'
no_figures killed 'no result, exit code -1'
no_figures babble 'no result, exit code 127: cannot load a library'
no_figures failed 'no result, exit code 1'
no_figures missing '^Library X is missing: install libx$'
no_figures locked 'cannot be started|no result'
for name in vtk:python3-vtk9 cgal:libcgal-dev embree:libembree-dev openvdb:libopenvdb-dev; do
    no_figures "${name%:*}" "not built: install ${name#*:} and configure with -DSDM_PEERS=ON"
done
[ -z "$(ls tmp)" ] || bad "left in TMPDIR: $(ls tmp)"
expect 0 - sdmgen bench exact "${box[@]}" --peers peers --repeat 1 --band 2 --share 0.01
[ "$(cut -d ' ' -f 11,12 asked)" = '0.01 1.2' ] || bad "asked for the band: $(cat asked)"
has '^  right \(25 %\) +2\.00 +20\.00 +22\.00 '
has '^  right .*; whole map$'
has '^  missing +Library X is missing'
has '^Wrong signs: by the winding number'
expect 0 - sdmgen bench exact "${box[@]}" --peers none --repeat 1 --band 2 --json
inside_band=$(floats right.npy | awk '{ n += $1 <= 1.2 && $1 >= -1.2 } END { print n }')
above 1600 "$inside_band"
near "$(row exact compared)" "$inside_band" 0
near "$(row naive judged_signs)" "$inside_band" 0
expect 0 - sdmgen info asked.ply
has '^closed +yes'

# The programs of this build: exact ones agree, and missing ones are named.
expect 0 - sdmgen bench exact "${box[@]}" --repeat 1 --json
for name in vtk cgal embree openvdb itk scipy; do
    [ -n "$(row $name note)" ] || bad "$name: no note"
    [ "$(row $name done)" = true ] || { no_figures $name 'install|modules' && continue; }
    above "$(row $name ms_total)" 0
    case $name in
    vtk | cgal | embree) limit=2e-5 ;;
    *) limit=0.6 ;; # approximate methods: one voxel
    esac
    near "$(row $name max_error_mm)" 0 $limit
    above "$(row $name compared)" 1500
done
# The grid passed to other programs has exactly the requested spacing, at any size.
expect 0 - sdmgen bench exact --shape torus --size '14,13,11' --spacing 0.047 --peers peers --repeat 1
[ "$(cut -d ' ' -f 8-10 asked)" = '0.047 0.047 0.047' ] || bad "asked: $(cat asked)"
# Half of the rows of voxels, the same rows for all methods.
expect 0 - sdmgen bench exact "${box[@]}" --repeat 1 --json --share 0.5
for name in naive vtk cgal embree; do
    [ "$(row $name done)" = true ] || continue
    near "$(row $name share)" 0.5 0.02
    near "$(row $name judged_signs)" 840 34
done

# --growth: 3 grids, then 3 meshes of a shape.
expect 0 - sdmgen bench exact --shape cochlea --size '8,8,8' --spacing 1.2 --peers none --repeat 1 --growth --json
[ "$(grep -o '"voxels": [0-9]*' out | tr -dc '0-9\n' | tr '\n' ' ')" = '8 64 512 512 512 512 ' ] || bad "growth: $(grep -o '"voxels": [0-9]*' out)"
grep -o '"triangles": [0-9]*' out | tr -dc '0-9\n' | awk 'NR > 4 && $1 < 3 * last { exit 1 } { last = $1 } END { exit NR != 6 }' ||
    bad "growth of the mesh: $(grep -o '"triangles": [0-9]*' out)"
expect 0 - sdmgen mesh --shape torus -o torus.ply
expect 0 - sdmgen bench exact --mesh torus.ply --size '8,8,8' --peers none --repeat 1 --growth
has '^  voxels +8 +64 +512$'
grep -q 'per triangle' out && bad 'a mesh file cannot be refined'

# Mistakes in arguments.
expect 2 "peers 'nowhere': no such folder" sdmgen bench exact "${box[@]}" --peers nowhere
expect 2 'either --shape NAME or --mesh FILE' sdmgen bench exact --shape torus --mesh torus.ply
expect 2 'edge belong to --shape' sdmgen bench exact --mesh torus.ply --edge 0.1
expect 2 'grid g1 has a size' sdmgen bench exact --grid g1 --size 5,5,5
expect 2 "share '0': need a number" sdmgen bench exact --share 0
expect 2 "unexpected argument 'x'" sdmgen bench exact x
expect 2 'edge' sdmgen bench exact --shape ellipsoid --edge 1e-9
[ -z "$(ls tmp)" ] || bad "left in TMPDIR: $(ls tmp)"
# Distances at points: figures for every row; many points at once are faster than brute force.
expect 0 - sdmgen bench points --shape torus --repeat 1 --threads 2 --peers none --json
for name in 'batch of 1000' 'batch of 100000' 'one by one' naive; do
    above "$(row "$name" us_random)" 0
    above "$(row "$name" us_near)" 0
done
above "$(row naive us_near)" "$(row 'batch of 100000' us_near)"
expect 0 - sdmgen bench points --shape torus --repeat 1 --peers none
has '^  one by one +[0-9]'
# Other programs at points: their arguments, their times, the difference from the exact distances.
rm peers/*
peer right "echo \"\$@\" >$PWD/asked" "\"$program\" exact --mesh \"\$1\" --points \"\$2\" --quiet -o \"\$4\"" "$answer"
peer small "cp $PWD/small.npy \"\$4\"" "$answer"
peer voxels 'echo "{\"error\": \"no distances at single points\"}"'
expect 0 - sdmgen bench points --shape torus --repeat 3 --peers peers --json
read -r -a asked <asked
[ "${#asked[@]}" -eq 4 ] && [ "${asked[2]}" = 3 ] || bad "asked: ${asked[*]}"
near "$(row right us_random)" 0.5 1e-9
near "$(row right us_near)" 0.5 1e-9
near "$(row right max_difference_mm)" 0 1e-12
row right note | grep -q '^V 1: n$' || bad "note: $(row right note)"
for name in small voxels embree; do [ "$(row $name us_near)" = null ] || bad "$name has figures"; done
row small note | grep -q 'not those of the points' || bad "note: $(row small note)"
row voxels note | grep -q 'no distances at single points' || bad "note: $(row voxels note)"
row embree note | grep -q 'libembree-dev' || bad "note: $(row embree note)"
expect 0 - sdmgen bench points --shape torus --repeat 1 --peers peers
has '^  right +0\.500 +0\.500 +x '
has '^  voxels: no distances at single points$'
[ -z "$(ls tmp)" ] || bad "left in TMPDIR: $(ls tmp)"
expect 2 "unexpected argument 'x'" sdmgen bench points x

finish
