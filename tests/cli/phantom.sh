#!/usr/bin/env bash
# sdmgen phantom: image, labels, truth; mistakes; no partial files.
# Tests: cmd_phantom.c phantom_setup.c phantom_summary.c phantom_surface.c phantom_truth.c
. "$(dirname "$0")/common.sh"

# values FILE: all float32 values of a .npy file, one per line.
values() { tail -c +129 "$1" | od -An -v -t f4 -w4 | tr -d ' '; }
# is_json FILE: fails unless Python's parser accepts it (skipped without python3).
is_json() { ! command -v python3 >/dev/null || python3 -m json.tool "$1" >/dev/null || bad "$1 is not JSON: $(head -c 300 "$1")"; }
small='--shape ellipsoid --spacing 0.5'

expect 0 - sdmgen phantom $small -p rx=3 -o ct.nii -o ct.nii.gz -o ct.nrrd -o ct.mha -o ct.npy --label label.nrrd \
    --truth truth.json --json
present ct.nii ct.nii.gz ct.nrrd ct.mha ct.npy label.nrrd truth.json
is_json truth.json
is_json out
cmp -s out truth.json || bad 'stdout and --truth must agree'
[ "$(json rx)" = 3 ] || bad "rx is $(json rx)"
[ "$(json cut)" = false ] || bad 'the grid must hold the shape'
inside=$(json inside_voxels)
near "$inside" 603 40 # volume 4/3 pi 3 3 2 over a voxel's 0.5^3
has '"rotation_rad": \[0, 0, 0\], "translation_mm": \[0, 0, 0\]'
for file in ct.nii ct.nii.gz ct.nrrd ct.mha; do
    expect 0 - sdmgen info $file
    has 'int16'
done
expect 0 - sdmgen info label.nrrd
has 'uint8'

# The line on stdout.
expect 0 - sdmgen phantom $small -o told.nii --label told_label.nii --truth told.json --white-noise
has '^told.nii: ellipsoid, 21 x 17 x 13 voxels of 0.5 x 0.5 x 0.5 mm, [0-9]+ of them inside; values inside 40, outside 1300 \(texture 80 and 225\), noise 150 \(white\), blur 0.15 x 0.15 x 0.15 mm; labels in told_label.nii; truth in told.json$'
expect 0 - sdmgen phantom $small --label told_label.nii
has '^told_label.nii: ellipsoid, 21 x 17 x 13 voxels of 0.5 x 0.5 x 0.5 mm, [0-9]+ of them inside$'
expect 0 - sdmgen phantom $small -o told.nii -q
[ ! -s out ] || bad '-q must be quiet'

# Without texture and noise the image is known: 40 at the centre, 1300 in the corner.
quiet_tissue='--inside 40,0 --outside 1300,0 --noise 0'
expect 0 - sdmgen phantom $small --size 21,21,21 $quiet_tissue -o flat.npy
near "$(values flat.npy | sed -n 4631p)" 40 0.01
near "$(values flat.npy | sed -n 1p)" 1300 0.01
expect 0 'have the same mean' sdmgen phantom $small --size 21,21,21 --inside 7,0 --outside 7,0 --noise 50 --white-noise -o noise.npy
values noise.npy | awk '{ n++; s += $1; q += ($1 - 7) ^ 2 } END { m = s / n - 7; v = sqrt(q / n); exit !(m < 3 && m > -3 && v > 48 && v < 52) }' ||
    bad 'white noise of 50 HU'

# The same seed gives the same bits for any number of threads; another seed gives other bits.
expect 0 - sdmgen phantom $small -p rx=3 --threads 1 -o one.npy
cmp -s one.npy ct.npy || bad 'one thread must give the same image'
expect 0 - sdmgen phantom $small -p rx=3 --seed 2 -o two.npy
! cmp -s two.npy ct.npy || bad 'another seed must give another image'

# The pose: rotation and translation move the shape as specified, also in a rotated image.
expect 0 'warning: the surface leaves the grid .* reaches beyond -y \(3.5 mm\), \+y \(3.5 mm\), ' sdmgen phantom $small $quiet_tissue --rotation 0,0,1.5707963267948966 --translation 100,0,0 \
    --size 21,3,3 --origin 95,-0.5,-0.5 -o turned.npy
# Along x the rotated ellipsoid extends 3 mm (ry) to both sides of 100: 12 voxels, two of them halves.
values turned.npy | sed -n '85,105p' | awk '{ s += (1300 - $1) / 1260 } END { exit !(s > 11.5 && s < 12.5) }' || bad 'the turned ellipsoid'
expect 0 - sdmgen phantom $small --frame 0,0,0.5 --json
has '"direction": \[0\.87758256[0-9]*, -0\.4794255[0-9]*, 0, 0\.4794255'
expect 0 - sdmgen phantom $small --random-pose 10,2 --random-params -p ry=2 --json
cp out random.json
[ "$(json ry)" = 2 ] || bad 'a parameter that is given must stay'
! grep -q '"rx": 4' out || bad 'rx must be random'
expect 0 - sdmgen phantom $small --random-pose 10,2 --random-params -p ry=2 --json
cmp -s out random.json || bad 'the same seed must give the same truth'
awk -F'[][,]' '{ for (i = 1; i <= NF; i++) if ($i ~ /rotation_rad/) { a = $(i + 1) ^ 2 + $(i + 2) ^ 2 + $(i + 3) ^ 2; exit !(a > 0 && a < 0.1746 ^ 2) } exit 1 }' out ||
    bad 'a turn of at most 10 degrees'

# A field of view that cuts the shape: 21 voxels along x from -5 mm, of which --crop keeps those below 2 mm. With a given size it is shifted
# instead.
expect 0 'leaves the field of view' sdmgen phantom $small --crop 0.25,0,0 --json
[ "$(json cut)" = true ] || bad 'the shape must be cut'
has '"size": \[14, '
expect 0 'leaves the field of view' sdmgen phantom $small --crop=0,0,-0.5 --size 20,20,20 --json
has '"size": \[20, 20, 20\]'
expect 2 '--air does nothing without --air-cells' sdmgen phantom $small --air -900,10 -o none.npy
expect 2 '--white-noise does nothing with --noise 0' sdmgen phantom $small --white-noise --noise 0 -o none.npy
absent none.npy
expect 0 - sdmgen phantom $small --size 30,30,30 --air-cells 0.5,1,0.5 --air -900,10 -o air.npy --json
has '"air_share": 0.5, "air_mm": 1, "air_clear_mm": 0.5'
values air.npy | awk '$1 < -500 { n++ } END { exit !(n > 100) }' || bad 'no air'
expect 0 'values do not fit in int16' sdmgen phantom $small --outside 40000,0 -o clipped.nii
expect 0 - sdmgen phantom $small --outside 40000,0 --type float32 -o unclipped.nii
expect 0 - sdmgen info unclipped.nii
has 'float32'

# Mistakes are named before any file is made.
expect 2 'shape NAME is needed' sdmgen phantom -o x.nii
expect 2 'an output is needed' sdmgen phantom $small
expect 2 "output 'x.vdb': its name must end in .nii .nii.gz .nrrd .mha .npy" sdmgen phantom $small -o x.vdb
expect 2 "label 'x.npy': its name must end in" sdmgen phantom $small -o x.nii --label x.npy
expect 2 "truth 'x.txt': its name must end in .json" sdmgen phantom $small -o x.nii --truth x.txt
expect 2 "'x.nii' is given twice" sdmgen phantom $small -o x.nii --label x.nii
expect 1 'nowhere' sdmgen phantom $small -o x.nii --truth nowhere/x.json
expect 1 'nowhere' sdmgen phantom $small -o x.nii --label nowhere/x.nii
expect 2 "inside '40': need two numbers" sdmgen phantom $small -o x.nii --inside 40
expect 2 "inside '40,1,2': need two numbers" sdmgen phantom $small -o x.nii --inside 40,1,2
expect 2 'texture of the tissue inside is -1' sdmgen phantom $small -o x.nii --inside 40,-1
expect 2 "blur '-1': need one number or three" sdmgen phantom $small -o x.nii --blur=-1
expect 2 'blur along y is 33 mm, need 0 to 32' sdmgen phantom $small -o x.nii --blur 1,33,1
expect 2 "noise 'nan': need a number" sdmgen phantom $small -o x.nii --noise nan
expect 2 'share of air cells is 2, need 0 to 1' sdmgen phantom $small -o x.nii --air-cells 2,1,1
expect 2 'random-pose: a rotation of 181 degrees' sdmgen phantom $small -o x.nii --random-pose 181,0
expect 2 'crop and --origin exclude each other' sdmgen phantom $small -o x.nii --crop 0,0,0.5 --origin 0,0,0
expect 2 "crop '0,0,1'" sdmgen phantom $small -o x.nii --crop 0,0,1
expect 2 "type 'float': need one of int16\|float32" sdmgen phantom $small -o x.nii --type float
expect 5 'rx.* 9' sdmgen phantom $small -p rx=9 -o x.nii --label l.nii --truth t.json
expect 5 'rx.* nan' sdmgen phantom $small -p rx=nan -o x.nii
expect 2 "did you mean 'ellipsoid'" sdmgen phantom --shape elipsoid -o x.nii
# The surface in its pose: a mesh, or points, whose noise has the stated standard deviation; nothing else is made.
expect 0 - sdmgen phantom $small --translation 5,0,0 --surface moved.stl --quiet
expect 0 - sdmgen mesh --mesh moved.stl --json
[ "$(json closed)" = true ] || bad 'the surface of a phantom is open'
expect 0 - sdmgen phantom $small --translation 5,0,0 --rotation 0,0,0.5 --surface even.csv --surface-points 3000 --quiet
expect 0 - sdmgen phantom $small --translation 5,0,0 --rotation 0,0,0.5 --surface even.npy --surface-points 3000 --quiet
expect 0 - sdmgen phantom $small --translation 5,0,0 --rotation 0,0,0.5 --surface noisy.csv --surface-points 3000 --surface-noise 0.2 --seed 7 --quiet
[ "$(wc -l <noisy.csv)" = 3001 ] || bad 'number of points'
# shellcheck disable=SC2046
near $(paste -d, even.csv noisy.csv | awk -F, 'NR > 1 { for (i = 1; i < 4; i++) { d = $(i + 3) - $i; s += d * d; n++ } } END { print sqrt(s / n) }') 0.2 0.01
# shellcheck disable=SC2046
near $(awk -F, 'NR > 1 { s += $1; n++ } END { print s / n }' even.csv) 5 0.02
[ "$(stat -c %s even.npy)" -gt 72000 ] || bad 'points as an array'
expect 2 'surface-noise does nothing without --surface FILE.csv' sdmgen phantom $small --surface x.stl --surface-noise 1
expect 2 '--noise does nothing without an image, -o FILE' sdmgen phantom $small --label x.nii --noise 10
expect 2 'surface-points does nothing without --surface FILE.csv' sdmgen phantom $small --label x.nii --surface-points 9
expect 2 "surface 'x.txt': its name must end in .ply .stl" sdmgen phantom $small --surface x.txt

# --like: the grid of another image, turned axes included.
expect 0 - sdmgen phantom $small --frame 0.3,0.2,0 -o frame.nrrd --quiet
expect 0 - sdmgen phantom --shape ellipsoid --like frame.nrrd -o same.nrrd --quiet
for file in frame same; do # to 12 digits: the axes are normalised when they are read
    head -n 12 $file.nrrd | grep -aE '^(sizes|space)' | sed -E 's/([0-9]\.[0-9]{12})[0-9]*/\1/g' >$file.txt
done
[ -s same.txt ] && cmp frame.txt same.txt || bad 'another image on the same grid'
expect 0 'the surface leaves the grid' sdmgen phantom --shape ellipsoid --like frame.nrrd --translation 3,0,0 -o far.nrrd
expect 2 'like and --frame exclude each other' sdmgen phantom --shape ellipsoid --like frame.nrrd --frame 0,0,1 -o x.nii
expect 2 'like and --crop exclude each other' sdmgen phantom --shape ellipsoid --like frame.nrrd --crop 0,0,0.5 -o x.nii
# Images that show hardly any shape, or none; parts that are too thin for the voxels.
expect 0 'warning: part 1 of 1 .* is [0-9.]+ mm thick, too thin for voxels of 3 mm' sdmgen phantom --shape torus --spacing 3 -o thin.nii -q
expect 0 - sdmgen phantom --shape torus --spacing 0.8 -o thick.nii -q
expect 0 - sdmgen phantom --shape torus --spacing 3 --surface thin.stl -q # no voxels
expect 0 'warning: only [0-9]+ voxels are inside the shape' sdmgen phantom --shape ellipsoid --spacing 2 -o few.nii -q
expect 0 'warning: --inside and --outside have the same mean' sdmgen phantom --shape ellipsoid --spacing 1 --inside 9,1 --outside 9,2 -o none.nii -q
# Work of long duration stops on SIGTERM.
# --foreground: without it timeout sends the signal twice, and a second one stops the program at once, without a message
expect 130 'stopped on request|interrupted' timeout --foreground --preserve-status -s TERM 1 "$program" phantom --shape ellipsoid --spacing 0.03 --supersample 16 -o x.nii
absent x.nii x.vdb x.npy x.txt l.nii t.json nowhere
finish
