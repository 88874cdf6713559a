#!/usr/bin/env bash
# sdmgen generate --check, --max-error, --gradient, --jacobian: error figures, replacement of a bad map by the exact one, and how the
# outputs report it.
# Tests: check.c cmd_generate.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
model=../files-of-trained/run/model.sdm
present $model
grid=(--size 16,14,12 --spacing 0.9)

# Error figures as text and as JSON.
expect 0 - sdmgen generate $model --check
has '^error near the surface: max [0-9.]+, q95 [0-9.]+, RMSE [0-9.]+, mean [0-9.]+, bias [-0-9.e]+ mm \(1000 voxels\)$'
expect 0 - sdmgen generate $model --check --json
awk -v a="$(json mean_mm)" -v b="$(json rmse_mm)" -v c="$(json q95_mm)" -v d="$(json max_mm)" \
    'BEGIN { exit !(0 < a && a < b && b < c && c < d) }' || bad "figures: $(cat out)"
max=$(json max_mm) mean=$(json mean_mm)
near "$(json points)" 1000 0
near "$(json exact)" 0 0
hash=$(json values_crc64)
expect 0 - sdmgen generate $model --json
[ "$hash" = "$(json values_crc64)" ] || bad 'a check changes the map'
has '"exact_by_error": 0'
grep -q '"check"' out && bad 'a check that nobody asked for'

# An error bound: a map within it is kept, else the exact map replaces it, which stderr and the file state.
expect 0 - sdmgen generate $model --max-error "$(awk -v m="$max" 'BEGIN { print 1.01 * m }')" --json
[ "$hash" = "$(json values_crc64)" ] || bad 'a map within the bound was replaced'
expect 0 - sdmgen generate $model --max-error "$(awk -v m="$mean" 'BEGIN { print 1.01 * m }')" --error-of mean --json
[ "$hash" = "$(json values_crc64)" ] || bad 'a map within the bound of its mean was replaced'
origin=$(sed -n 's/.*"origin": \[\([^]]*\)\].*/\1/p' out | tr -d ' ')
tight=$(awk -v m="$max" 'BEGIN { print 0.99 * m }')
expect 0 "^sdmgen: error of the network near the surface \(max\) .* above $tight mm: computed by the exact engine" \
    sdmgen generate $model --max-error "$tight" --json -o b.nii -o b.mha -o b.nrrd -o b.npy
near "$(json exact)" 1 0
near "$(json exact_by_error)" 1 0
near "$(json max_mm)" "$max" 0
exact=$(json values_crc64)
[ "$hash" != "$exact" ] || bad 'the bad map was kept'
head -c 500 b.nii | tr '\0' '\n' | grep -q 'exact (network over the bound): cochlea' || bad 'b.nii does not say why it is exact'
grep -aq 'Comment = .*exact (network over the bound): cochlea' b.mha || bad 'b.mha does not say why it is exact'
grep -aq 'content: .*exact (network over the bound): cochlea' b.nrrd || bad 'b.nrrd does not say why it is exact'
expect 0 'overlaps itself' sdmgen exact --shape cochlea "${grid[@]}" "--origin=$origin" -o e.npy --json
[ "$exact" = "$(json values_crc64)" ] || bad 'not the map of the exact engine'
cmp -s b.npy e.npy || bad 'not the file of the exact engine'
expect 4 'error near the surface .* demanded at most 1e-06 mm' \
    sdmgen generate $model -p a=7 --policy clamp --max-error 1e-6 -o never.npy
absent never.npy

# Several rows of parameters: each is judged by its own error, and the summary counts all.
printf 'a\n3\n4.4\n' >rows.csv
expect 0 - sdmgen generate $model --params rows.csv --check
has '^row 1 \(line 2\): error near the surface: max'
has '^row 2 \(line 3\): error near the surface: max'
expect 0 - sdmgen generate $model --params rows.csv --check --json
has '"check": \{"maps": 2'
near "$(json points)" 2000 0

# Parameters outside of the range: every policy is reported in every output.
expect 0 'clamped to it' sdmgen generate $model -p a=5.000000000000001 --policy clamp --json -o c.nii -o c.mha -o c.nrrd
near "$(json clamped)" 1 0
for file in c.nii c.mha c.nrrd; do
    head -c 600 $file | tr '\0' '\n' | grep -aq 'network (clamped): cochlea a=5 ' || bad "$file does not say that it is clamped"
done
for policy in refuse clamp exact; do
    for value in nan inf -inf; do
        expect 5 "parameter 'a' = $value mm, allowed 2 .. 5 mm\$" sdmgen generate $model -p "a=$value" --policy $policy -o never.npy
    done
    [ $policy = clamp ] || expect 5 "'a' = 1e\+300" sdmgen generate $model -p a=1e300 --policy $policy -o never.npy
done
expect 0 'clamped to it' sdmgen generate $model -p a=1e300 --policy clamp --json
near "$(json clamped)" 1 0
# Within the range of the shape, but outside of the network's.
expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" shape.name=torus 'shape.ranges.major=[2.5,3.5]' train.steps=2 --out narrow --quiet
expect 5 "parameter 'major' = 3\.50000000000000[0-9]+ mm, allowed .* --policy clamp" sdmgen generate narrow/model.sdm -p major=3.5000000000000004 -o never.npy
expect 0 '^sdmgen: parameters outside the trained range, computed by the exact engine' \
    sdmgen generate narrow/model.sdm -p major=3.5000000000000004 --policy exact --json -o r.nii -o r.mha --check
near "$(json exact)" 1 0
near "$(json exact_by_error)" 0 0
has '"check": \{"maps": 0\}'
for file in r.nii r.mha; do
    head -c 600 $file | tr '\0' '\n' | grep -aq 'exact (out of the trained range): torus' || bad "$file does not say why it is exact"
done
if sdmgen generate $model -p a=7 --policy clamp -o c.vdb --check --quiet >out 2>err; then
    expect 0 - sdmgen info c.vdb
    has 'sdm_clamped: yes'
    has 'sdm_exact_reason: none'
    has 'sdm_check_max_mm: [0-9.]+'
fi
absent never.npy

# Gradient and Jacobian.
# the small network of the test has learned no derivatives, and says so
expect 0 'warning: .*model\.sdm: derivatives of its maps are off by (over )?[0-9]+ % for [a-z_0-9]+, more than 20 %' sdmgen generate $model --gradient g.npy --jacobian j.npy
present g.npy j.npy
head -c 128 g.npy | grep -aq "(3, 12, 14, 16)" || bad 'shape of g.npy'
head -c 128 j.npy | grep -aq "(4, 12, 14, 16)" || bad 'shape of j.npy'
expect 0 'derivatives of its maps are off' sdmgen generate $model --params rows.csv --gradient 'g%d.npy' --jacobian 'j%d.npy'
present g1.npy g2.npy j1.npy j2.npy
cmp -s g.npy g2.npy || bad 'row 2 has another gradient than the same parameters'
expect 0 'computed by the exact engine' sdmgen generate $model --max-error 1e-6 --jacobian je.npy
expect 0 'overlaps itself' sdmgen exact --shape cochlea "${grid[@]}" "--origin=$origin" --jacobian x.npy
cmp -s je.npy x.npy || bad 'not the derivatives of the exact engine'
expect 2 "gradient 'g.txt': its name must end in .npy" sdmgen generate $model --gradient g.txt
expect 2 'given twice' sdmgen generate $model --gradient g.npy -o g.npy
expect 1 'nowhere' sdmgen generate $model --jacobian nowhere/j.npy
expect 2 'max-error' sdmgen generate $model --max-error 0 -o never.npy
expect 2 'max-error' sdmgen generate $model --max-error nan -o never.npy

# A model whose shape is a plug-in that is not loaded: it gives maps, but they cannot be checked.
plugin=../../plugins/good/octahedron.so
if [ -e $plugin ]; then
    expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" shape.name=octahedron 'shape.ranges={radius: [1, 4]}' train.steps=2 --plugin $plugin --out away --quiet
    expect 0 - sdmgen generate away/model.sdm -o o.npy
    expect 3 "^sdmgen: error: --check needs the exact shape: .*'octahedron', which is not known here: load its plug-in \(--plugin FILE\)" \
        sdmgen generate away/model.sdm --check
    expect 3 '^sdmgen: error: --max-error needs the exact shape: ' sdmgen generate away/model.sdm --max-error 1 -o never.npy
    expect 0 - sdmgen generate away/model.sdm --check --plugin $plugin
fi
absent never.npy
# Options that would do nothing are refused.
for stat in mean max; do # also the default, given on purpose
    expect 2 'error-of does nothing without --max-error' sdmgen generate $model --error-of $stat -o x.nrrd
done
expect 2 'outside does nothing on the grid of the model' sdmgen generate $model --outside bound -o x.nrrd
for option in --half --dense '--band 4'; do
    # shellcheck disable=SC2086
    expect 2 "generate: ${option% 4} does nothing without an output -o FILE.vdb" sdmgen generate $model $option -o x.nrrd -o x.ply
    # shellcheck disable=SC2086
    expect 2 "exact: ${option% 4} does nothing without" sdmgen exact --shape torus $option -o x.nrrd
done
expect 2 'band does nothing with --dense' sdmgen exact --shape torus --dense --band 4 -o x.vdb
absent x.nrrd x.ply x.vdb
finish
