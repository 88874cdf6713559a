#!/usr/bin/env bash
# --measure and --depth of exact, generate, fit and shapes: values, standard deviations, JSON, mistakes.
# Tests: fit_measures.c measures.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive
model=../files-of-trained/run/model.sdm
present $model

# Removes lines of progress from stderr; they appear only when the machine is slow.
sdmgen() { sdmgen_without '^sdmgen: (search|fit|polish|generate) [0-9]+ %' "$@"; }
# measure NAME KEY [DEPTH]: the value of KEY of a measure in the JSON in `out`.
measure() { tr '{' '\n' <out | grep -F "\"name\": \"$1\"" | grep -F "${3:+\"depth_mm\": $3,}" | sed -n "s/.*\"$2\": \"*\\([^,}\"]*\\).*/\\1/p" | head -n 1; }

# exact: a torus has 5 measures by formulas, within the error of its mesh; text and JSON agree
expect 0 - sdmgen exact --shape torus -p major=3.5 -p minor=0.8 -O edge=0.1 --measure
has '^measures$'
has '^  volume +44\.[0-9]+ mm\^3$'
has '^  extent_z +1\.[56][0-9]* mm$'
expect 0 - sdmgen exact --shape torus -p major=3.5 -p minor=0.8 -O edge=0.1 --measure --json
near "$(measure volume value)" "$(awk 'BEGIN { print 2 * 3.14159265 ^ 2 * 3.5 * 0.64 }')" 0.3
near "$(measure area value)" "$(awk 'BEGIN { print 4 * 3.14159265 ^ 2 * 3.5 * 0.8 }')" 0.4
near "$(measure extent_x value)" 8.6 0.02
[ "$(measure volume unit)" = 'mm^3' ] || bad "unit $(measure volume unit)"
[ -z "$(measure volume sd)" ] || bad 'no standard deviation without a fit'
expect 0 - sdmgen exact --shape torus --json
[ -z "$(measure volume value)" ] || bad 'no measures without --measure'
# of a plug-in, whose file holds the names
plugin=../../plugins/good/octahedron.so
for command in exact 'exact --json' 'exact --isolate'; do
    expect 0 - sdmgen $command --shape octahedron --plugin $plugin -p radius=2 --measure -q
    if [ "$command" = 'exact --json' ]; then near "$(measure edge value)" 2.828427 1e-5; else has '^  edge +2\.8284 mm$'; fi
done
expect 0 - sdmgen exact --shape cochlea --measure --depth 0,10,90 -q
has '^  diameter_a +8\.2'
has '^  frequency +20677 Hz at 0 mm$'
has '^  insertion_angle +none deg at 90 mm   \(beyond the end\)$'
expect 0 - sdmgen exact --shape cochlea --measure --depth 10,90 --json -q
near "$(measure insertion_angle value 10)" 114.7 0.1
[ "$(measure frequency value 90)" = null ] || bad 'beyond the end the frequency must be null'

# shapes describes them
expect 0 - sdmgen shapes cochlea
has '^  diameter_a +mm +A: '
has '^  volume +mm\^3 '
expect 0 - sdmgen shapes torus --json
has '"measures": \[\{"name": "volume", "unit": "mm\^3", "of_depth": false, '

# generate
expect 0 - sdmgen generate $model -p a=4 --measure
has '^volume of the map [0-9.e+]+ mm\^3( \(root mean square error [0-9.]+ %\))?; of the exact mesh:$'
has '^  diameter_a +7\.'
expect 0 - sdmgen generate $model -p a=4 --measure --depth 5 --json
expected=$(measure length_wall value)
expect 0 - sdmgen exact --shape cochlea -p a=4 --measure --json -q
near "$(measure length_wall value)" "$expected" 1e-9

# fit: the deviations of a ball-like shape are those of its half axes
shape='--shape ellipsoid -O edge=0.6'
expect 0 - sdmgen phantom $shape -p rx=3.5 -p ry=2.5 -p rz=2 --rotation 0.1,-0.2,0.3 --spacing 0.4 -o ct.nii.gz
fit="fit $shape ct.nii.gz --rotation 0,0,0 --start-centre 0.2,0,0 --spacing 0.35 --eps 1e-4 -q"
expect 0 - sdmgen $fit --measure
has '^  extent_x +[67]\.[0-9]+ \+- 0\.[0-9]+ +mm$'
has '^  volume +[67][0-9]\.[0-9]+ \+- [0-9.]+ +mm\^3$'
expect 0 - sdmgen $fit --measure --json -o fit.json
cmp -s out fit.json || bad 'stdout and -o fit.json must agree'
near "$(measure extent_x sd)" "$(awk -v s="$(sed -n 's/.*"parameters_sd": {"rx": \([^,]*\),.*/\1/p' out)" 'BEGIN { print 2 * s }')" 0.01
[ "$(measure volume not_determined)" = false ] || bad 'the volume is determined'
volume=$(measure volume value)
awk -v v="$volume" -v s="$(measure volume sd)" 'BEGIN { t = 4 / 3 * 3.14159265 * 3.5 * 2.5 * 2 * 0.97; exit !(v - t < 4 * s + 2 && t - v < 4 * s + 2) }' ||
    bad "volume $volume +- $(measure volume sd)"
expect 0 - sdmgen $fit --keep parameters -p rx=3.5 -p ry=2.5 -p rz=2 --measure
has '^  extent_x +[67](\.[0-9]+)? mm$' # no deviation where the parameters were kept

# mistakes, before any work
expect 2 '^sdmgen: error: --depth belongs to --measure$' sdmgen exact --shape cochlea --depth 3 --json
expect 2 '^sdmgen: error: --depth belongs to --measure$' sdmgen $fit --depth 3
expect 2 "shape 'ellipsoid' has no measure of a depth" sdmgen $fit --measure --depth 3
for list in 3,x , -1 3, 1e999 nan; do
    expect 2 "--depth '$list': need depths in mm, 0 or more, as in 10,20.5" sdmgen exact --shape cochlea --measure "--depth=$list"
done
expect 2 'more than 64 depths' sdmgen exact --shape cochlea --measure --depth "$(seq -s , 65)"
expect 0 - sdmgen mesh --shape torus -o torus.ply
expect 2 'belong to --shape; sdmgen mesh --audit measures a mesh file' sdmgen exact --mesh torus.ply --measure
expect 2 '--measure does not go with --points' sdmgen exact --shape torus --measure --points torus.ply
expect 2 'it does not go with --params' sdmgen generate $model --measure --params rows.csv
expect 3 'measure .diameter_a.: the diameters need three quarters of a turn' sdmgen exact --shape cochlea -O theta=4 --measure
# Measures alone need no map, and no voxels; a map of the same shape is warned of.
rod=(--shape linkage -O links=1 -O length=24 -O radius=0.15 -O tip=0.15 -O base=0.1)
expect 0 - sdmgen exact "${rod[@]}" --measure -q
has '^  volume +1\.[0-9]+ mm\^3$'
if grep -q 'warning' err; then bad "a warning of voxels without a map: $(cat err)"; fi
expect 0 'warning: .* too thin for voxels of' sdmgen exact "${rod[@]}" --measure -o rod.npy -q

finish
