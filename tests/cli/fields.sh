#!/usr/bin/env bash
# sdmgen generate on other grids than the model's: size, spacing, origin, direction, bands without whole maps, grids that leave the box.
# Tests: bench_field.c cmd_generate.c model_grid.c
. "$(dirname "$0")/common.sh"
model=../files-of-trained/run/model.sdm
present $model

# crc OPTION...: the checksum of the values of the map
crc() {
    expect 0 - sdmgen generate $model -p a=4.2 "$@" --json
    json values_crc64
}

# The model's own grid, however it is asked for, has the same values; every second voxel of a finer grid is one of it.
own=$(crc)
[ "$own" = "$(crc --size 16,14,12)" ] || bad 'size of the model: other values'
[ "$own" = "$(crc --spacing 0.9)" ] || bad 'spacing of the model: other values'
expect 0 'derivatives of its maps are off' sdmgen generate $model -p a=4.2 --spacing 0.45 -o fine.nrrd -o fine.npy --jacobian j.npy --gradient g.npy --json
has '"size": \[31, 27, 23\]'
present fine.nrrd fine.npy j.npy g.npy
[ "$(wc -c <j.npy)" -ge $((4 * 31 * 27 * 23 * 4)) ] || bad 'j.npy is too small'
[ "$(crc --spacing 0.45)" = "$(crc --spacing 0.45 --threads 1)" ] || bad 'the values depend on the number of threads'
[ "$own" != "$(crc --spacing 0.45)" ] || bad 'a finer grid has the values of the model'
expect 0 'the surface leaves the grid' sdmgen generate $model --size 9,8,7 --spacing 0.3,0.2,0.1 --origin 0,0,1 --direction 0,1,0,-1,0,0,0,0,1 -o turned.nrrd --json
has '"size": \[9, 8, 7\], "spacing": \[0.3, 0.2, 0.1\], "origin": \[0, 0, 1\]'
grep -aq 'space directions: (0,-0.3' turned.nrrd || bad 'the direction is not in the file'
expect 0 - sdmgen generate $model -p a=4.2 --spacing 0.45 --check
has 'error near the surface'
expect 0 'computed by the exact engine' sdmgen generate $model -p a=4.2 --spacing 0.45 --max-error 1e-6 -o e.npy

# Level sets come from bands; with another output besides, from whole maps. Both are the same.
if sdmgen generate $model -p a=4.2 --spacing 0.1 -o band.vdb --quiet 2>err; then
    expect 0 - sdmgen verify band.vdb
    sdmgen generate $model -p a=4.2 --spacing 0.1 -o whole.vdb -o whole.npy --quiet
    hash_of() { sdmgen info "$1" | grep sdm_hash; }
    [ "$(hash_of band.vdb)" = "$(hash_of whole.vdb)" ] || bad 'a band gives another level set than the map'
    expect 0 - sdmgen generate $model -p a=4.2 --size 100,100,100 -o cube.vdb --quiet # the band stays in the box
    expect 2 'a level set needs voxels of one size' sdmgen generate $model --spacing 0.1,0.1,0.2 -o x.vdb
    expect 2 'need a larger one' sdmgen generate $model --spacing 1e-6 -o x.vdb
fi
# Cubes that cover the box of the model leave it: the size that fits is told, and it does.
expect 5 'makes cubes that cover the box of the model \(--size 20,17,14 --spacing 0\.71052 stays in it\): the grid leaves' sdmgen generate $model --size 20,20,20 -o x.npy
expect 0 - sdmgen generate $model --size 20,17,14 --spacing 0.71052 -q -o cubes.npy

# Points: the values of the grid, gradients, derivatives.
printf 'x,y,z\n-6,-5.2,-4.4\n0.1,0.2,0.3\n' >points.csv
expect 0 'stated error, RMSE .*sdmgen exact --points computes exact distances' sdmgen generate $model -p a=4.2 --points points.csv --columns distance,gradient -o at.csv -o at.npy
[ "$(head -n 1 at.csv)" = x,y,z,distance,gradient_x,gradient_y,gradient_z ] || bad 'points: wrong header'
[ "$(wc -l <at.csv)" -eq 3 ] || bad 'points: wrong number of rows'
# the derivatives of this network are poor: points say so as maps do
sdmgen generate $model -p a=4.2 --points points.csv -o distances.csv --jacobian slopes.npy 2>err || bad "points with derivatives: $(cat err)"
grep '^sdmgen: warning: .*derivatives of its maps are off' err >of_points
sdmgen generate $model -p a=4.2 -o j.npy --jacobian j.npy.npy 2>err || bad 'a map with derivatives'
grep '^sdmgen: warning: .*derivatives of its maps are off' err >of_maps && cmp of_points of_maps || bad 'derivatives at points: no warning, or another one than that of maps'
sdmgen generate $model -p a=4.2 --points points.csv --columns slopes,distance -o by.csv 2>err || bad "slopes: $(cat err)"
grep -q '^sdmgen: warning: .*derivatives of its maps are off' err || bad "slopes: no warning: $(cat err)"
[ "$(head -n 1 by.csv)" = x,y,z,d_a,d_alpha,d_b,d_phi,distance ] || bad "slopes: header $(head -n 1 by.csv)"
[ "$(od -An -v -t f4 -w16 -j $(($(wc -c <slopes.npy) - 32)) slopes.npy | awk '{ printf "%.5f,%.5f,%.5f,%.5f ", $1, $2, $3, $4 }')" = \
    "$(sed 1d by.csv | awk -F, '{ printf "%.5f,%.5f,%.5f,%.5f ", $4, $5, $6, $7 }')" ] || bad "slopes: $(xargs <by.csv)"
# outside of the box they are those of the exact shape
printf 'x,y,z\n9,1,0.5\n-2,8,-6\n' >beyond.csv
sdmgen generate $model -p a=4.9 --outside exact --points beyond.csv --columns distance,slopes -o by_model.csv 2>err || bad "exact slopes: $(cat err)"
expect 0 - sdmgen exact --shape cochlea -p a=4.9 --points beyond.csv --columns distance,slopes -o by_shape.csv --quiet
paste -d, by_model.csv by_shape.csv | sed 1d | awk -F, '{ for (i = 4; i <= 8; i++) if (!($i - $(i + 8) < 1e-5 && $(i + 8) - $i < 1e-5)) exit 1 } END { if (NR != 2) exit 1 }' ||
    bad "exact slopes: $(xargs <by_model.csv), of the shape $(xargs <by_shape.csv)"
echo '0,0,100' >far.csv
# a file that is no table of points: nothing else is said before
printf 'x,y\n1,2\n' >two.csv
sdmgen generate $model -p a=4.2 --points two.csv -o no.csv >out 2>err && bad 'a table without z was read'
[ "$(grep -c . err)" = 1 ] && grep -q '^sdmgen: error: two.csv' err || bad "the message about two.csv: $(cat err)"
sdmgen generate $model -p a=4.2 --points far.csv -o far_bound.csv --outside bound >out 2>err || bad "a point far away: $(cat err)"
grep -q '1 of 1 points lie outside of the box of the network: their values are lower bounds' err || bad "a bound that is not told: $(cat err)"
[ "$(grep -c 'gradient is shorter' err)" -eq 0 ] || bad "a ridge beyond the box: $(cat err)"
expect 0 - sdmgen generate $model -p a=4.2 --points points.csv -o one.csv --outside bound --quiet
printf 'x,y,z\n0,0,0\n\n90,1,1\n' >far.csv
expect 5 'far\.csv:4: point 2 of 2 \(90, 1, 1\) mm lies outside of the box' sdmgen generate $model --points far.csv -o x.csv
expect 2 'distance, gradient and slopes only' sdmgen generate $model --points points.csv --columns triangle -o x.csv
expect 2 '--spacing is an option of maps' sdmgen generate $model --points points.csv --spacing 0.45 -o x.csv
expect 2 'an output is needed' sdmgen generate $model --points points.csv
expect 2 'belongs to --points' sdmgen generate $model --columns distance -o x.npy
absent x.csv

# In the middle of the tube the distance has a ridge; far outside it has none.
printf 'x,y,z\n1.35031,0.225817,1.42688\n-5.5,-4.5,-4\n' >middle.csv
sdmgen generate $model --points middle.csv -o middle.npy 2>err || bad 'points in the middle of the tube'
grep -q 'at 1 of 2 points the gradient is shorter than 0\.7: they lie about in the middle between two parts of the surface' err || bad "$(cat err)"
printf 'x,y,z\n-5.5,-4.5,-4\n' >outside.csv
sdmgen generate $model --points outside.csv -o outside.npy 2>err
grep -q 'shorter than' err && bad 'a point far outside is said to lie on a ridge'

# Grids that leave the box of the model.
expect 5 'the grid leaves the box.*bound or exact' sdmgen generate $model --size 30,30,30 -o x.npy
expect 0 - sdmgen generate $model --size 30,30,30 --outside bound -o bound.npy --quiet
expect 0 - sdmgen generate $model --size 30,30,30 --outside exact -o exact.npy --quiet
cmp -s bound.npy exact.npy && bad 'bound and exact are the same'
expect 0 "the stated error, RMSE .* is that at the voxels of the model's own grid; interpolation between them adds up to about [0-9.e-]+ mm RMS at the surface" \
    sdmgen generate $model -p a=4.2 --spacing 0.45 -o stated.npy
expect 0 'clamped to it' sdmgen generate $model -p a=7 --policy clamp --spacing 0.45 --json -o c.npy
expect 5 "parameter 'a' = 7" sdmgen generate $model -p a=7 --spacing 0.45 -o x.npy

# Times on another grid.
expect 0 - sdmgen bench network $model --size 40,36,32 --json
for key in ms_field_params ms_field_map ms_field_band field_band_blocks us_field_point us_field_single_point; do
    awk -v v="$(json $key)" 'BEGIN { exit !(v > 0) }' || bad "bench: no $key"
done
expect 0 - sdmgen bench network $model --size 40,36,32
has 'map of 40 x 36 x 32 +[0-9.]+ ms'

# Mistakes.
expect 2 'spacing' sdmgen generate $model --spacing 0 -o x.npy
expect 2 'spacing' sdmgen generate $model --spacing nan -o x.npy
expect 2 'not orthonormal' sdmgen generate $model --direction 1,0,0,0,1,0,0,0.1,1 -o x.npy
expect 2 'nine numbers' sdmgen generate $model --direction 1,0,0 -o x.npy
expect 2 'size' sdmgen generate $model --size 0,1,1 -o x.npy
expect 2 'one of refuse\|bound\|exact' sdmgen generate $model --outside far -o x.npy
absent x.npy x.vdb
finish
