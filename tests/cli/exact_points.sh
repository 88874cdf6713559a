#!/usr/bin/env bash
# sdmgen exact --points: columns, input and output formats, mistakes with line numbers, no partial files.
# Tests: points_file.c points_unit.c points_table.c
. "$(dirname "$0")/common.sh"

# row FILE N COLUMNS: these columns of line N, rounded to six decimals, without the sign of zero.
row() { sed -n "$2p" "$1" | cut -d, -f "$3" | awk -F, '{ for (i = 1; i <= NF; i++) printf "%s%g", (i == 1 ? "" : ","), int($i * 1e6 + ($i < 0 ? -0.5 : 0.5)) / 1e6 + 0 }'; }

# A cube of edge 2 around the origin.
cat >cube.off <<'EOF'
OFF
8 12 0
-1 -1 -1
1 -1 -1
-1 1 -1
1 1 -1
-1 -1 1
1 -1 1
-1 1 1
1 1 1
3 0 2 1
3 1 2 3
3 4 5 6
3 5 7 6
3 0 1 4
3 1 5 4
3 2 6 3
3 3 6 7
3 0 4 2
3 2 4 6
3 1 3 5
3 3 7 5
EOF
# A byte order mark, a header, comments, blanks and Windows line ends; points in front of a face, inside, beyond an edge.
printf '\xef\xbb\xbfx,y,z\r\n# a comment\n 3 , 0.25,0.125\r\n\n0.5,0.125,0\n4,5,0.5' >p.csv
expect 0 - sdmgen exact --mesh cube.off --points p.csv -o d.csv -o d.npy --columns distance,gradient,closest,triangle --quiet
present d.csv d.npy
[ "$(sed -n 1p d.csv)" = 'x,y,z,distance,gradient_x,gradient_y,gradient_z,closest_x,closest_y,closest_z,triangle' ] || bad "header $(sed -n 1p d.csv)"
[ "$(row d.csv 2 1-10)" = '3,0.25,0.125,2,1,0,0,1,0.25,0.125' ] || bad "row 1: $(row d.csv 2 1-10)"
[ "$(row d.csv 3 1-5)" = '0.5,0.125,0,-0.5,1' ] || bad "row 2: $(row d.csv 3 1-5)"
[ "$(row d.csv 4 4,8-10)" = '5,1,1,0.5' ] || bad "row 3: $(row d.csv 4 4,8-10)"
# What was written is read again: other columns than x, y and z are passed over.
expect 0 - sdmgen exact --mesh cube.off --points d.csv -o again.csv --quiet
[ "$(cut -d, -f 1-4 d.csv)" = "$(cat again.csv)" ] || bad "read again: $(xargs <again.csv)"
[ "$(wc -l <d.csv)" -eq 4 ] || bad "$(wc -l <d.csv) lines"
head -c 128 d.npy | tr -d '\0' | grep -a -q "'<f8', 'fortran_order': False, 'shape': (3, 8)" || bad "header of d.npy"
[ "$(od -An -v -t f8 -w64 -j $(($(wc -c <d.npy) - 192)) d.npy | awk '{ printf "%.6f ", $1 }')" = '2.000000 -0.500000 5.000000 ' ] || bad 'values of d.npy'

# Points in m and in um beside a shape in mm; as close together, but away from the origin, they are no mistake.
printf '0.0015,0,0\n0,0.0005,0\n0,0,-0.001\n' >m.csv
expect 0 'warning: m.csv: the points measure 0.00187 mm across, the shape 3.46 mm: are they in m\? lengths are mm$' \
    sdmgen exact --mesh cube.off --points m.csv -o no-unit.csv --quiet
sed 's/\([0-9.]*[1-9]\)/\1e6/g' m.csv >um.csv
expect 0 'warning: um.csv: .*: are they in um\? lengths are mm$' sdmgen exact --mesh cube.off --points um.csv -o no-unit.csv --quiet
printf '0.004,0,0\n0,0.003,0\n0,0,-0.003\n' >model.csv
expect 0 "warning: model.csv: .*, the model's grid 18.9 mm: are they in m\\?" \
    sdmgen generate "$source_folder/tests/golden/pod_f32.sdm" --points model.csv -o no-unit.csv --quiet
sed 's/^0/1/' m.csv >close.csv
expect 0 - sdmgen exact --mesh cube.off --points close.csv -o no-unit.csv --quiet

# The columns in another order; points from an array and from the vertices of a mesh.
expect 0 - sdmgen exact --mesh cube.off --points p.csv -o xyz.npy --columns closest --quiet
expect 0 - sdmgen exact --mesh cube.off --points xyz.npy -o on.csv --columns triangle,distance --quiet
[ "$(sed -n 1p on.csv)" = 'x,y,z,triangle,distance' ] || bad "header $(sed -n 1p on.csv)"
sed 1d on.csv | awk -F, '{ if ($5 > 1e-15 || $5 < -1e-15) exit 1 }' || bad "not on the surface: $(xargs <on.csv)"
expect 0 - sdmgen exact --mesh cube.off --points cube.off -o on.csv --quiet
sed 1d on.csv | awk -F, '{ if ($4 > 1e-15 || $4 < -1e-15) exit 1 }' || bad "vertices not on the surface: $(xargs <on.csv)"
# An array that is not [n][3].
expect 3 'd.npy: array with 2 dimensions, the second of 8; need \[n\]\[3\]' sdmgen exact --mesh cube.off --points d.npy -o no.csv

# Slopes: the derivatives by the parameters, as central differences of distances have them, inside and outside.
printf 'x,y,z\n3,2,2.5\n1,0.5,0.25\n-0.3,-2,4\n' >at.csv
# differences SHAPE PARAMETER=VALUE...: compares the columns of slopes.csv behind the distance
differences() {
    local shape=$1 column=4 word other side moved
    shift
    for word in "$@"; do
        column=$((column + 1))
        for side in - +; do
            moved=("-p ${word%=*}=$(awk -v v="${word#*=}" "BEGIN { printf \"%.9f\", v $side 1e-5 }")")
            for other in "$@"; do [ "$other" = "$word" ] || moved+=("-p $other"); done
            # shellcheck disable=SC2068 # two words each
            expect 0 - sdmgen exact --shape $shape --points at.csv -o side$side.csv --quiet ${moved[@]}
        done
        [ "$(head -n 1 slopes.csv | cut -d, -f $column)" = "d_${word%=*}" ] || bad "$shape: header $(head -n 1 slopes.csv)"
        paste -d, slopes.csv side-.csv side+.csv | sed 1d | awk -F, -v c=$column -v n="$(head -n 1 slopes.csv | tr , '\n' | wc -l)" '
            { d = ($(n + 8) - $(n + 4)) / 2e-5 - $c; largest = $c * $c > largest ? $c * $c : largest }
            d > 1e-4 || d < -1e-4 { exit 1 } END { if (NR != 3 || largest < 0.04) exit 1 }' ||
            bad "$shape: column $column of $(xargs <slopes.csv), distances $(xargs <side-.csv), $(xargs <side+.csv)"
    done
}
expect 0 - sdmgen exact --shape capsule -p radius=1.5 -p length=4 --points at.csv -o slopes.csv --columns distance,slopes --jacobian slopes.npy --quiet
differences capsule radius=1.5 length=4
head -c 128 slopes.npy | tr -d '\0' | grep -a -q "'<f4', 'fortran_order': False, 'shape': (3, 2)" || bad 'header of slopes.npy'
[ "$(od -An -v -t f4 -w8 -j $(($(wc -c <slopes.npy) - 24)) slopes.npy | awk '{ printf "%.5f,%.5f ", $1, $2 }')" = \
    "$(sed 1d slopes.csv | awk -F, '{ printf "%.5f,%.5f ", $5, $6 }')" ] || bad 'values of slopes.npy'
expect 0 - sdmgen exact --shape ellipsoid -p rx=2.5 -p ry=2 -p rz=1.5 --points at.csv -o slopes.csv --columns distance,slopes --quiet
differences ellipsoid rx=2.5 ry=2 rz=1.5
expect 0 - sdmgen exact --shape ellipsoid --points at.csv --jacobian alone.npy --quiet
present alone.npy

# Mistakes.
printf 'x,y,z\n1,2,3\n1,2\n' >bad.csv
expect 3 'bad.csv:3: 2 values, a line needs three' sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf '1,2,3\n1,two,3\n' >bad.csv
expect 3 "bad.csv:2: 'two' is not a finite number" sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf '1,2,3\n1,nan,3\n' >bad.csv
expect 3 "bad.csv:2: 'nan' is not a finite number" sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf '1,2,3\n1,2,3,4\n' >bad.csv
expect 3 'bad.csv:2: 4 values, a line needs three' sdmgen exact --mesh cube.off --points bad.csv -o no.csv
# Decimal commas.
printf 'x,y,z\n0,5,1,5,2,5\n' >bad.csv
expect 3 'bad.csv:2: 6 values, .* a decimal number has a point: 0.5,1,2$' sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf 'x;y;z\n0,5;1;2\n' >bad.csv
expect 3 'bad.csv:1: the header .* a decimal number has a point: 0.5,1,2$' sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf '1,2,3\n0.5;1;2\n' >bad.csv
expect 3 "bad.csv:2: '0.5;1;2' is not .*; commas separate the values" sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf 'x,y,z\n# nothing\n' >bad.csv
expect 3 'bad.csv: no points' sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf 'u,v,w\n1,2,3\n' >bad.csv
expect 3 'bad.csv:1: the header \(u,v,w\) must name one column each x, y and z' sdmgen exact --mesh cube.off --points bad.csv -o no.csv
printf 'x,y,z,part\n1,2,3\n' >bad.csv
expect 3 'bad.csv:2: 3 values, the header names 4 columns' sdmgen exact --mesh cube.off --points bad.csv -o no.csv
expect 2 "name must end in .csv" sdmgen exact --mesh cube.off --points p.txt -o no.csv
expect 2 "output 'no.nii': with --points" sdmgen exact --mesh cube.off --points p.csv -o no.nii
expect 2 'an output is needed' sdmgen exact --mesh cube.off --points p.csv
expect 2 "unknown column 'normal', known are" sdmgen exact --mesh cube.off --points p.csv -o no.csv --columns distance,normal
expect 2 "'distance' is given twice" sdmgen exact --mesh cube.off --points p.csv -o no.csv --columns distance,distance
expect 2 'exact --points: --size is an option of maps$' sdmgen exact --mesh cube.off --points p.csv -o no.csv --size 4,4,4
expect 2 '^sdmgen: error: --jacobian needs --shape: a mesh file has no parameters' sdmgen exact --mesh cube.off --points p.csv -o no.csv --jacobian no.npy
expect 2 '^sdmgen: error: --columns slopes needs --shape: a mesh file' sdmgen exact --mesh cube.off --points p.csv -o no.csv --columns slopes
expect 2 "'no.csv': its name must end in .npy" sdmgen exact --shape capsule --points p.csv --jacobian no.csv
expect 2 'exact --points: --closest is an option of maps; --columns' sdmgen exact --mesh cube.off --points p.csv -o no.csv --closest c.npy
expect 2 '--columns belongs to --points' sdmgen exact --mesh cube.off -o no.npy --columns distance
expect 2 'would overwrite the input' sdmgen exact --mesh cube.off --points p.csv -o p.csv
absent no.csv no.nii no.npy
finish
