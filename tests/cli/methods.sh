#!/usr/bin/env bash
# sdmgen exact --method: every method with every type of output; error bounds and notices.
# Tests: method_table.c
. "$(dirname "$0")/common.sh"

floats() { od -An -v -t f4 -w4 -j "$2" "$1" | tr -d ' '; }

# Coarse triangles keep the naive method fast; the grid reaches far enough for the octree to interpolate.
grid=(-O edge=1 --size '60,60,30' --spacing '0.25,0.25,0.2')
voxels=$((60 * 60 * 30))
values() { floats "$1" $(($(wc -c <"$1") - voxels * 4)); }

expect 0 - sdmgen help exact
expect 0 - sdmgen exact --shape torus "${grid[@]}" --quiet -o exact.npy --json
near "$(json error_bound_mm)" 0 0
sign=$(json inside_voxels)
[ "$sign" -gt 0 ] || bad 'the torus has no inside'
values exact.npy >exact.txt

for method in exact naive cells octree edt; do
    expect 0 - sdmgen exact --shape torus "${grid[@]}" --method $method --quiet -o $method.npy --json --threads 1
    [ "$(json method)" = $method ] || bad "method $(json method) instead of $method"
    [ "$(json inside_voxels)" = "$sign" ] || bad "$method: $(json inside_voxels) voxels inside, not $sign"
    bound=$(json error_bound_mm) hash=$(json values_crc64)
    case $method in
    edt) awk -v b="$bound" 'BEGIN { exit !(b > 0.1 && b < 0.5) }' || bad "$method: bound $bound" ;;
    octree) near "$bound" 0.01 1e-9 ;;
    *) near "$bound" 0 0 ;;
    esac
    values $method.npy | paste -d ' ' - exact.txt | awk -v bound="$bound" '
        { e = $1 - $2; if (e < 0) e = -e; if (e > bound + 2e-6) { print "voxel", NR, $1, $2; wrong = 1 } }
        END { exit wrong || NR != '$voxels' }' || bad "$method: farther from exact than its bound $bound"
    expect 0 - sdmgen exact --shape torus "${grid[@]}" --method $method --quiet --json --threads 3
    [ "$(json values_crc64)" = "$hash" ] || bad "$method: the values depend on the number of threads"
done
cmp -s exact.npy edt.npy && bad 'edt gives the exact map: is the method used?'
cmp -s exact.npy octree.npy && bad 'octree gives the exact map: is the method used?'

# Approximate methods report their error in one line.
expect 0 '^sdmgen: method edt is approximate: the distance is off by at most [0-9.]+ mm \(distance to [0-9]+ points' \
    sdmgen exact --shape torus "${grid[@]}" --method edt -o e.nrrd
expect 0 '^sdmgen: method octree is approximate: the distance is off by at most 0\.01 mm \([0-9]+ exact samples for [0-9]+ voxels' \
    sdmgen exact --shape torus "${grid[@]}" --method octree -o o.nrrd
expect 0 - sdmgen exact --shape torus "${grid[@]}" --method cells -o c.nrrd

# --tolerance of the octree; files name the method that made the map.
expect 0 'off by at most 0\.002 mm' sdmgen exact --shape torus "${grid[@]}" --method octree --tolerance 0.002 -o o.nrrd --json
near "$(json error_bound_mm)" 0.002 1e-9
expect 2 'tolerance belongs to --method octree, not edt' sdmgen exact --shape torus --method edt --tolerance 0.1 -o x.npy
expect 2 'tolerance belongs to --method octree, not exact' sdmgen exact --shape torus --tolerance 0.1 -o x.npy
expect 2 "tolerance '0'" sdmgen exact --shape torus --method octree --tolerance 0 -o x.npy
expect 2 'certify belongs to --method exact, not edt' sdmgen exact --shape torus --method edt --certify -o x.npy
grep -aq '; octree: torus' o.nrrd || bad 'o.nrrd does not name octree'
grep -aq '; exact: torus' o.nrrd && bad 'o.nrrd calls the map of octree exact'

# Every type of output.
for method in naive cells octree edt; do
    expect 0 - sdmgen exact --shape torus "${grid[@]}" --method $method --quiet -o $method.nii.gz -o $method.mha -o $method.ply -o $method.png
    present $method.nii.gz $method.mha $method.ply $method.png
done

# Mistakes in arguments.
expect 2 "^sdmgen: error: --method 'fast': need one of exact\|naive\|cells\|octree\|edt" sdmgen exact --shape torus --method fast -o x.npy
expect 2 'no line of voxel centres of the 4 x 4 x 4 grid' \
    sdmgen exact --shape torus --size 4,4,4 --spacing 1 --origin 500,500,500 --method edt --quiet -o x.npy
expect 2 'crossings needs a closed mesh' bash -c 'printf "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n" >open.off
    "$0" exact --mesh open.off --sign crossings --method cells --quiet -o x.npy' "$program"
absent x.npy
finish
