#!/usr/bin/env bash
# sdmgen fit: a phantom is recovered, every kind of target and output, fits that must fail, mistakes.
# Tests: fit_truth.c shell_word.c cmd_fit.c crop.c fit_compare.c fit_files.c fit_json.c fit_labels.c fit_mismatch.c fit_next.c fit_options.c fit_picture.c fit_refusal.c fit_remedy.c fit_repeat.c fit_report.c fit_result.c
# fit_start.c fit_target.c progress_bar.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive

# Removes lines of progress from stderr, which appear only when the machine is slow, and the notice about the tissues, which all fits to
# images give here.
sdmgen() { sdmgen_without '^sdmgen: (search|fit|polish) [0-9]+ %|of which the default is fluid in bone' "$@"; }

# values FILE: all float32 values of a .npy file, one per line.
values() { tail -c +129 "$1" | od -An -v -t f4 -w4 | tr -d ' '; }
# is_json FILE: fails unless Python's parser accepts it (skipped without python3).
is_json() { ! command -v python3 >/dev/null || python3 -m json.tool "$1" >/dev/null || bad "$1 is not JSON: $(head -c 300 "$1")"; }
# param NAME: the estimate of a parameter. spread NAME: its standard deviation.
param() { sed -n "s/.*\"parameters\": {[^}]*\"$1\": \\([^,}]*\\).*/\\1/p" out; }
spread() { sed -n "s/.*\"parameters_sd\": {[^}]*\"$1\": \\([^,}]*\\).*/\\1/p" out; }
# within NAME TRUTH TIMES: fails unless abs(estimate - TRUTH) <= TIMES * sd.
within() { near "$(param "$1")" "$2" "$(awk -v s="$(spread "$1")" -v t="$3" 'BEGIN { print (s > 0 ? t * s : -1) }')"; }
# pose KEY I: element I (from 1) of the array KEY of the pose.
pose() { sed -n "s/.*\"$1\": \\[\\([^]]*\\)\\].*/\\1/p" out | head -n 1 | tr -d ' ' | cut -d, -f"$2"; }

shape='--shape ellipsoid -O edge=0.6'
fit="$shape --eps 1e-4"
truth='-p rx=3.5 -p ry=2.5 -p rz=2'
turned='--rotation 0.1,-0.2,0.3 --translation 20,-30,10'
near_truth='--rotation 0,0,0 --start-centre 20.3,-30.2,9.9 --spacing 0.35'
expect 0 - sdmgen phantom $shape $truth $turned --spacing 0.4 -o ct.nii.gz --label label.nrrd --truth truth.json

# The phantom is recovered within the standard deviations, and every file can be read.
vdb=
sdmgen exact $shape -o probe.vdb -q 2>err && vdb='-o fit.vdb' # fails in a build without OpenVDB
expect 0 - sdmgen fit $fit --exact ct.nii.gz $near_truth --reference label.nrrd $vdb -o fit.stl -o fit.ply \
    -o fit.nii.gz -o fit.nrrd -o fit.npy -o fit.png -o fit.svg -o fit.pdf -o fit.json --label-out fitted.nrrd --json --threads 1
cp out first.json
is_json out
is_json fit.json
cmp -s out fit.json || bad 'stdout and -o fit.json must agree'
[ "$(json trusted)" = true ] && [ "$(json converged)" = true ] || bad "not trusted: $(cat out)"
# the command of the JSON repeats the fit; the checksum is that of the file
mkdir again && (cd again && ln -s ../ct.nii.gz ../label.nrrd . && sed -n 's/.*"command": "sdmgen \([^"]*\)", "inputs".*/\1/p' ../out >command)
expect 0 - eval "(cd again && \"$program\" $(cat again/command) >out 2>err)"
[ "$(sed -n 's/.*\("parameters": {[^}]*}\).*/\1/p' again/out)" = "$(sed -n 's/.*\("parameters": {[^}]*}\).*/\1/p' first.json)" ] ||
    bad "the command does not repeat the fit: $(cat again/command again/err)"
cp first.json out
has '"file": "ct.nii.gz", "crc64": "[0-9a-f]{16}"'
within rx 3.5 4
within ry 2.5 4
within rz 2 4
near "$(pose translation_mm 1)" 20 0.1
near "$(pose translation_mm 2)" -30 0.1
near "$(pose translation_mm 3)" 10 0.1
near "$(pose rotation_rad 3)" 0.3 0.15
awk -v d="$(json dice)" 'BEGIN { exit !(d > 0.97 && d <= 1) }' || bad "Dice $(json dice)"
awk -v m="$(json surface_mean_mm)" -v q="$(json surface_q95_mm)" -v h="$(json surface_hausdorff_mm)" \
    'BEGIN { exit !(m > 0 && m < q && q < h && h < 0.4) }' || bad 'distances of the surfaces'
has '"not_determined": \[\]'
[ "$(json map_voxel_mm)" = 0.35 ] || bad "maps of $(json map_voxel_mm) mm"
[ "$(json maps_network)" = 0 ] && [ "$(json maps_exact)" -gt 3 ] || bad 'maps must be exact'
present ${vdb#-o } fit.stl fit.ply fit.nii.gz fit.nrrd fit.npy fit.png fit.svg fit.pdf fit.json fitted.nrrd
for file in fit.nii.gz fit.nrrd fitted.nrrd; do
    expect 0 - sdmgen info $file
    grep -Fqx "$(sdmgen info ct.nii.gz | grep '^grid')" out || bad "$file is not on the grid of the image"
done
[ "$(head -c 8 fit.png | od -An -t x1 | tr -d ' ')" = 89504e470d0a1a0a ] || bad 'fit.png is no PNG'
[ "$(head -c 4 fit.pdf)" = %PDF ] || bad 'fit.pdf is no PDF'
grep -qE '>ct.nii.gz: (passed|doubtful|failed)[^<]*<' fit.svg || bad 'fit.svg has no title with the verdict'
expect 0 - sdmgen info fit.stl --json
near "$(json volume_mm3)" 73.3 4 # 4/3 pi 3.5 2.5 2
if [ -n "$vdb" ]; then
    expect 0 - sdmgen info fit.vdb
    has 'checkLevelSet passed'
    has 'sdm_source.*exact'
fi
# The fitted map is negative exactly inside of the fitted label, which is close to the truth.
inside=$(values fit.npy | awk '$1 < 0 { n++ } END { print n }')
near "$inside" "$(sed -n 's/.*"inside_voxels": \([0-9]*\).*/\1/p' truth.json)" 40

# Any number of threads gives the same output, except for times, the number of threads and the command.
expect 0 - sdmgen fit $fit --exact ct.nii.gz $near_truth --reference label.nrrd --json --threads 2
strip() { sed -E 's/"command": "[^"]*"//; s/"(seconds[a-z_]*|threads)": [^,}]*//g' "$1"; }
[ "$(strip out)" = "$(strip first.json)" ] || bad 'two threads must give the same result'

# The report as text, with the truth of the test image beside the estimate.
expect 0 - sdmgen fit $fit ct.nii.gz $near_truth --reference label.nrrd --truth truth.json
has '^ellipsoid fitted to ct.nii.gz$'
has 'rx +3\.[0-9]+ \+- 0\.0'
has 'reference: Dice 0.9'
has 'converged after'
has '^  rx .* \+- .* mm +truth 3\.5, off by [0-9.]+ sd$'
has '^  pose         off the truth by 0\.[01][0-9]* mm at the centre of the shape and [0-9](\.[0-9]+)? degrees, [0-2](\.[0-9]+)? sd$'
has '^  map voxels   doubtful  0\.35, need at most 0\.3: .*coarse beside the point spread of the image: .*with voxels of 0\.24 mm \(--exact --spacing\), 0\.8 times the limit, show it'
# the command that goes on from here with finer maps
has '^finer maps from here; [0-9.]+ times as many voxels, up to [0-9.e+]+ (s|minutes) if the machine is as busy as in this fit:$'
eval "$(sed -n 's/^  sdmgen fit ct/expect 0 - sdmgen fit ct/p' out)"
has '^  (passed|      ) .*map voxels [-0-9.e+]+ [<>]= '
# another truth; the truth of another shape, and a file without parameters, are refused
printf '{"parameters": {"rx": 3.5}, "pose": {"rotation_rad": [0.1, -0.2, 0.3], "translation_mm": [20, -30, 11]}}' >shifted.json
expect 0 - sdmgen fit $fit ct.nii.gz $near_truth --truth shifted.json --json
near "$(json centre_mm)" 1 0.15
# half a turn about its own x axis leaves the ellipsoid where it is
printf '{"parameters": {"rx": 3.5}, "pose": {"rotation_rad": [-2.99276, -0.454213, -0.302808], "translation_mm": [20, -30, 10]}}' >turned.json
sdmgen fit $fit ct.nii.gz $near_truth --truth turned.json >out 2>err
has 'at the centre of the shape and [0-9](\.[0-9]+)? degrees, [0-2](\.[0-9]+)? sd; the true pose was turned by 180 degrees first, which leaves the surface as it is$'
printf '{"parameters": {"rx": 3.5}, "pose": {"rotation_rad": [0.1, -0.2]}}' >pose.json
expect 3 'pose\.json: .pose. needs .rotation_rad. and .translation_mm., three numbers each' sdmgen fit $fit ct.nii.gz $near_truth --truth pose.json
expect 2 'truth\.json: the truth of another shape than .torus.: ellipsoid' sdmgen fit --shape torus ct.nii.gz $near_truth --truth truth.json
echo '{"shape": "ellipsoid"}' >empty.json
expect 3 'empty\.json: no object .parameters. with a parameter of .ellipsoid.' sdmgen fit $fit ct.nii.gz $near_truth --truth empty.json
echo '{"shape": "ellipsoid", "parameters": {"rx": 3.5, "laenge": 2}}' >odd.json
expect 2 "odd\.json: 'ellipsoid' has no parameter 'laenge'\$" sdmgen fit $fit ct.nii.gz $near_truth --truth odd.json
expect 0 - sdmgen fit $fit ct.nii.gz $near_truth --blur 0.3 --keep blur
has 'point spread 0.3 mm'
! grep -q 'are coarse' out || bad 'maps of 0.35 mm are fine beside a point spread of 0.3 mm'

expect 0 - sdmgen fit $fit ct.nii.gz $near_truth -p rx=3.4 --keep rx
has '^  rx                  3\.4 mm$'

# Other starts: axis and turns, pairs of points, none; RAS coordinates.
expect 0 - sdmgen fit $fit ct.nii.gz --start-centre=-20,30,10 --start-axis=0.2,-0.1,1 --ras --turns 4 --spacing 0.5 --json
within rx 3.5 4
printf 'shape_x,shape_y,shape_z,x,y,z\n1,0,0,21,-30,10\n0,1,0,20,-29,10\n0,0,1,20,-30,11\n' >pairs.csv
expect 0 - sdmgen fit $fit ct.nii.gz --start-points pairs.csv --spacing 0.5 --json
within rx 3.5 4
# A shape much smaller than the default, in a random pose: the right turn is found, although another one fits better while the size is still
# wrong.
expect 0 - sdmgen phantom --shape cochlea -O edge=0.6 --random-params --random-pose 20,1 --spacing 0.4 --seed 111 -o small.nii --label small-label.nii --quiet
expect 0 - sdmgen fit --shape cochlea -O edge=0.6 small.nii --spacing 0.5 --start-centre 0.6,1,1.3 --start-axis 0,0,1 --eps 1e-3 --mirror no \
    --reference small-label.nii --json
awk -v d="$(json dice)" 'BEGIN { exit !(d > 0.95) }' || bad "another turn was found: Dice $(json dice)"
expect 0 'no start centre is given.*20.*-30.*10' sdmgen fit $fit ct.nii.gz --turns-sphere 3 --spacing 0.5 --json
awk -v d="$(json evidence)" 'BEGIN { exit !(d > 0) }' || bad "evidence $(json evidence)"

sdmgen fit $fit label.nrrd --label 1 --spacing 0.8 --max-iterations 1 >out 2>err
grep -Eq '^sdmgen: no start rotation is given: 60 rotations are tried about the middle of the labels, 20, -30, ' err || bad "no word about the rotations: $(cat err)"

# Unknowns that are kept do not change. First a prior so narrow that the image has no influence: estimates stay at the middle of the ranges.
sdmgen fit $fit ct.nii.gz $near_truth --prior-sd 0.0001 --json >out 2>err
has '"not_determined": \["rx", "ry", "rz"\]'
expect 0 - sdmgen fit $fit $truth ct.nii.gz $turned --keep parameters --keep blur --blur 0.3 --spacing 0.5 --json
[ "$(param rx)" = 3.5 ] && [ "$(json blur_mm)" = 0.3 ] || bad 'kept values changed'

# Labels, meshes, points: the start position is found automatically.
expect 0 - sdmgen fit $fit label.nrrd --label 1 --rotation 0,0,0 --spacing 0.5 -o label.png --json
[ "$(json kind)" = labels ] || bad "kind $(json kind)"
near "$(param rx)" 3.5 0.25
near "$(pose translation_mm 2)" -30 0.1
awk -v d="$(json dice)" 'BEGIN { exit !(d > 0.9) }' || bad "Dice with the labels $(json dice)"
rx=$(param rx)
# The same labels as two values, and as named segments.
sdmgen phantom $shape $truth $turned --spacing 0.4 --label label.nii -q
voxels=$(($(wc -c <label.nii) - 352))
{
    head -c $((352 + voxels / 2)) label.nii
    tail -c +$((353 + voxels / 2)) label.nii | tr '\001' '\002'
} >two.nii
for labels in '--label 1 --label 77' '--label 77 --label 1'; do
    expect 3 "two.nii: no voxel has the label '77'; its labels are 1 2$" sdmgen fit $fit two.nii $labels
done
expect 0 'two.nii: no label is chosen, so the labels 1 2 count as one' \
    sdmgen fit $fit two.nii --label 1 --label 2 --reference two.nii --rotation 0,0,0 --spacing 0.5 --json
near "$(param rx)" "$rx" 0.001
# A wall of one voxel between two compartments: closing joins them.
plane=$(sed -n 's/.*"size": \[\([0-9]*\), \([0-9]*\),.*/\1 \2/p' truth.json | awk '{ print $1 * $2 }')
middle=$((voxels / plane / 2))
{
    head -c $((352 + plane * middle)) label.nii
    head -c "$plane" /dev/zero
    tail -c +$((353 + plane * (middle + 1))) label.nii
} >walled.nii
whole=$(json voxels_reference)
expect 4 "walled.nii: (9|1[0-9])[0-9.]* % of the volume of the shape is empty in the labels" sdmgen fit $fit walled.nii --label 1 --rotation 0,0,0 --spacing 0.5 --json
expect 0 - sdmgen fit $fit walled.nii --label 1 --rotation 0,0,0 --spacing 0.5 --tolerance 0.2 --json
awk -v n="$(json voxels_reference)" -v w="$whole" 'BEGIN { exit !(n < w - 100) }' || bad "wall of $(json voxels_reference) and $whole voxels"
expect 0 - sdmgen fit $fit walled.nii --label 1 --label-close 0.4 --reference walled.nii --rotation 0,0,0 --spacing 0.5 --json
near "$(json voxels_reference)" "$whole" 40
near "$(param rx)" "$rx" 0.06
[ "$(json label_close_mm)" = 0.4 ] || bad "label_close_mm $(json label_close_mm)"
expect 2 'label-close needs labels: give --label or --reference' sdmgen fit $fit ct.nii.gz $near_truth --label-close 0.4
expect 2 'closing by a ball of 1e.08 mm: too wide for voxels of 0.4' sdmgen fit $fit walled.nii --label 1 --label-close 1e8 --rotation 0,0,0
list() { sed -n "s/.*\"$1\": \[\([^]]*\)\].*/\1/p" truth.json | tr -d ' '; }
{
    printf 'NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: %s\n' "$(list size | tr , ' ')"
    printf 'space directions: (0.4,0,0) (0,0.4,0) (0,0,0.4)\nencoding: raw\nspace origin: (%s)\n' "$(list origin)"
    printf 'Segment%s\n' '0_ID:=a' '0_Name:=fluid' '0_LabelValue:=1' '0_Layer:=0' '1_ID:=b' '1_Name:=rest' '1_LabelValue:=2' '1_Layer:=0'
    echo
    tail -c +353 label.nii | tr '\000' '\002'
} >named.seg.nrrd
size=$(wc -c <label.nii)
{ head -c $(((size + 352) / 2)) label.nii; head -c $((size - (size + 352) / 2)) /dev/zero; } >half.nii # half of the labels: Dice 0.67
expect 0 "^sdmgen: --reference half.nii: Dice 0[.][3-6][0-9], although the fit has passed" sdmgen fit $fit named.seg.nrrd --label fluid --rotation 0,0,0 --spacing 0.5 --json --reference half.nii
near "$(param rx)" "$rx" 0.001
expect 2 "named.seg.nrrd is a segmentation of 2 segments: select those of the shape, e.g. --label 'fluid'" sdmgen fit $fit named.seg.nrrd
expect 2 'named.seg.nrrd: .*fluid' sdmgen fit $fit named.seg.nrrd --label fluit
expect 0 - sdmgen fit $fit fit.stl --rotation 0,0,0 --spacing 0.35 -o mesh.png -o mesh.off --label-out mesh.nrrd --json
[ "$(json kind)" = points ] || bad "kind $(json kind)"
near "$(param rz)" 2 0.1
near "$(pose translation_mm 1)" 20 0.1
present label.png mesh.png mesh.off mesh.nrrd
{
    echo x,y,z
    sdmgen mesh $shape -p rx=3 -p ry=3.5 -q -o points.obj >/dev/null && sed -n 's/^v \([^ ]*\) \([^ ]*\) \([^ ]*\)$/\1,\2,\3/p' points.obj
} >points.csv
expect 0 - sdmgen fit $fit points.csv --rotation 0,0,0 -p rx=3.2 -p ry=3.2 --spacing 0.35 --json
near "$(param rx)" 3 0.05
near "$(param ry)" 3.5 0.05
# points without errors determine all parameters
grep -q '"not_determined": \[\]' out || bad "not determined: $(grep -o '"not_determined": [^]]*' out)"
cp out xyz.json
# a reference and a truth that lie elsewhere
sdmgen fit $fit points.csv --rotation 0,0,0 -p rx=3.2 -p ry=3.2 --reference label.nrrd --truth truth.json -q >out 2>err
grep -q 'warning: --reference label.nrrd: its labels do not overlap the fitted shape, and their middle lies 37.[0-9]* mm off: are they in another frame' err ||
    bad "no word about the reference: $(cat err)"
grep -q 'warning: --truth truth.json: its pose is 37.[0-9]* mm off the fitted one, more than the [0-9.]* mm that the shape measures' err ||
    bad "no word about the truth: $(cat err)"
# What made a fit fail: a narrow prior; points on a part of the surface, with their middle as the start
expect 4 'points.csv: .*; --prior-sd 0.01 holds rx, ry, rz near the middle of the range, whatever the data show: a wider one \(default 1\) lets them decide$' \
    sdmgen fit $fit points.csv --rotation 0,0,0 --prior-sd 0.01 -q
awk -F, 'NR == 1 || $1 > 1' points.csv >cap.csv
expect 4 'cap.csv: .*; if the points show only a part of the shape, their middle, where the fit began, is not its own: --start-centre X,Y,Z says where the middle of the whole shape is, about; a wrong start ends like this' \
    sdmgen fit --shape torus -O edge=1 cap.csv --rotation 0,0,0 -q
awk -F, '{ print $3 "," $1 "," $2 }' points.csv >zxy.csv # the header names the columns
expect 0 - sdmgen fit $fit zxy.csv --rotation 0,0,0 -p rx=3.2 -p ry=3.2 --spacing 0.35 --json
[ "$(param rx)" = "$(sed -n 's/.*"parameters": {[^}]*"rx": \([^,}]*\).*/\1/p' xyz.json)" ] || bad 'another order of the columns'

# Fits that fail: exit code 4, one line on stderr, no files; the partial result is shown and marked as failed.
calm='--inside 1300,225 --outside 1300,225'
expect 0 'have the same mean' sdmgen phantom $shape $truth $turned --spacing 0.5 --inside 7,0 --outside 7,0 --noise 0 -o constant.nii
expect 4 'constant.nii: the image shows nothing: every voxel is 7' sdmgen fit $fit constant.nii $near_truth -o no.stl --json
[ ! -s out ] || bad 'a constant image has no result'
expect 0 'have the same mean' sdmgen phantom $shape $truth $turned --spacing 0.5 $calm -o empty.nii
expect 4 'empty.nii: the image shows no such shape|empty.nii: .*(not converged|left the image)' sdmgen fit $fit empty.nii $near_truth -o no.stl -o no.json -o no.png
expect 0 - sdmgen phantom $shape $truth $turned --spacing 0.5 --inside 1300,225 --outside 40,80 -o bright.nii
expect 4 'bright.nii: no values of the tissues were given, and the default ones do not suit this image: at the start .* but the inside has the default value 40 and the outside 1300: give the values of this image with --inside and --outside' sdmgen fit $fit bright.nii $near_truth -o no.stl --label-out no.nrrd
expect 0 - sdmgen fit $fit bright.nii $near_truth --inside 1300,250 --outside 40,150 --json
within rx 3.5 4
expect 4 'not converged after 1 iterations.*; --max-iterations 1 ended it too early to judge the fit.*; no file was written' sdmgen fit $fit ct.nii.gz $near_truth --max-iterations 1 -o no.stl ${vdb:+-o no.vdb}
has 'NOT TO BE TRUSTED'
has 'NOT CONVERGED'
has '^more iterations from here:$'
eval "$(sed -n 's/^  sdmgen fit ct/expect 0 - sdmgen fit ct/p' out)"
present no.stl # the command keeps the files that are to be written
rm -f no.stl no.vdb
expect 4 'not converged' sdmgen fit $fit ct.nii.gz $near_truth --max-iterations 1 -o forced.json --json --force
[ "$(json trusted)" = false ] || bad 'a fit that failed must be marked'
present forced.json
expect 0 'leaves the field of view' sdmgen phantom $shape $truth --spacing 0.4 --crop 0.65,0,0 -o cut.nii
expect 4 'cut.nii: ' sdmgen fit $fit $truth cut.nii --rotation 0,0,0 --translation 0,0,0 --spacing 0.5 -o no.stl

# The reference label counts only inside of the field of view: half of the shape has no more voxels than the image shows.
expect 0 'leaves the field of view' sdmgen phantom $shape $truth $turned --spacing 0.4 --crop 0.3,0,0 -o part.nii --label part.nrrd --json
seen=$(json inside_voxels)
expect 0 - sdmgen fit $fit part.nii $near_truth --reference label.nii --reference-label 1 --json
near "$(json voxels_reference)" "$seen" 5
awk -v d="$(json dice)" -v s="$(json inside_share)" 'BEGIN { exit !(d > 0.9 && s < 0.85) }' || bad "Dice $(json dice), $(json inside_share) in the image"

# NaN voxels: some are left out, which is reported; an image of NaN only, or with infinite values, is bad input.
expect 0 - sdmgen phantom $shape $truth $turned --spacing 0.4 --type float32 -o float.nii
voxels=$(($(wc -c <float.nii) / 4 - 88))
words() { for ((i = 0; i < $2; i++)); do printf "$1"; done; } # little-endian floats
{
    head -c 352 float.nii
    words '\0\0\300\177' 50
    tail -c +553 float.nii
} >some.nii
expect 0 '50 voxels are NaN and were ignored' sdmgen fit $fit some.nii $near_truth --margin 9 --json
[ "$(json nan)" = 50 ] || bad "$(json nan) voxels are NaN"
{
    head -c 352 float.nii
    words '\0\0\300\177' "$voxels"
} >none.nii
expect 3 "none.nii: all $voxels voxels of the image are NaN" sdmgen fit $fit none.nii $near_truth -o no.stl
{
    head -c 352 float.nii
    words '\0\0\200\177' "$voxels"
} >infinite.nii
expect 3 'infinite.nii: ' sdmgen fit $fit infinite.nii $near_truth -o no.stl

# Bad input.
head -c 500 float.nii >short.nii
expect 3 'short.nii' sdmgen fit $fit short.nii $near_truth -o no.stl
expect 3 "label.nrrd: no voxel has the label '7'" sdmgen fit $fit label.nrrd --label 7 -o no.stl
printf 'x,y,z\n0,0,0\n1,0,0\n' >two.csv
expect 3 'two.csv: 2 points, need 3' sdmgen fit $fit two.csv -o no.stl
printf '' >nothing.csv
expect 3 'nothing.csv: no points' sdmgen fit $fit nothing.csv -o no.stl
printf 'x,y\n0,0\n1,0\n2,2\n' >flat.csv
expect 3 'flat.csv:1: the header \(x,y\) must name one column each x, y and z, in mm; without a header a line is x,y,z' sdmgen fit $fit flat.csv -o no.stl
printf 'shape_x,shape_y,shape_z,x,y,z\n0,0,0,1,1,1\n0,0,0,2,2,2\n' >same.csv
expect 3 'same.csv: ' sdmgen fit $fit ct.nii.gz --start-points same.csv -o no.stl
expect 1 'nowhere.nii' sdmgen fit $fit nowhere.nii -o no.stl

# Mistakes are named before any work.
expect 2 'usage: sdmgen fit MODEL IMAGE' sdmgen fit
expect 2 'a MODEL and an IMAGE are needed' sdmgen fit ct.nii.gz -o no.stl
expect 2 'either MODEL or --shape' sdmgen fit $fit model.sdm ct.nii.gz -o no.stl
expect 2 "--mirror no does nothing: the shape 'ellipsoid' has no option for its mirror image$" sdmgen fit $fit ct.nii.gz --mirror no
expect 2 "image 'ct.dcm': its name must end in" sdmgen fit $fit ct.dcm -o no.stl
expect 2 "output 'no.txt': its name must end in" sdmgen fit $fit ct.nii.gz -o no.txt
expect 2 "'no.abc': its name must end in .* or .pdf; or in .json, for the result$" sdmgen fit $fit ct.nii.gz -o no.abc
expect 2 "'no.stl' is given twice" sdmgen fit $fit ct.nii.gz -o no.stl -o no.stl
expect 2 "'no.nii' is given twice" sdmgen fit $fit ct.nii.gz -o no.nii --label-out no.nii
expect 2 "label-out 'no.npy': its name must end in" sdmgen fit $fit ct.nii.gz --label-out no.npy
expect 2 'polish follows the fit of a network' sdmgen fit $fit ct.nii.gz --polish
expect 2 'one of --rotation, --start-axis' sdmgen fit $fit ct.nii.gz --rotation 0,0,0 --start-axis 0,0,1
expect 2 'one of --translation, --start-centre' sdmgen fit $fit ct.nii.gz --translation 0,0,0 --start-centre 0,0,0
expect 2 'one of --turns and --turns-sphere' sdmgen fit $fit ct.nii.gz --turns 3 --turns-sphere 3
expect 2 'reference-label needs --reference FILE' sdmgen fit $fit ct.nii.gz --reference-label 1
expect 2 "keep 'rxx', did you mean 'rx'\?: need one of" sdmgen fit $fit ct.nii.gz --keep rxx
expect 2 "keep 'shape': need one of .*, or the name of a parameter of 'ellipsoid'" sdmgen fit $fit ct.nii.gz --keep shape
expect 2 'leave nothing to fit' sdmgen fit $fit ct.nii.gz --keep parameters --keep pose
expect 2 'standard deviations above 0' sdmgen fit $fit ct.nii.gz --inside 40,0
expect 2 "region '1,2,3': need six numbers" sdmgen fit $fit ct.nii.gz --region 1,2,3
expect 2 "label 'fluid': need a whole number" sdmgen fit $fit label.nrrd --label fluid
expect 2 'label applies to volumes' sdmgen fit $fit fit.stl --label 1
expect 2 'no voxel of the image lies near the shape' sdmgen fit $fit ct.nii.gz --rotation 0,0,0 --start-centre 90,0,0 -o no.stl
expect 2 'no voxel of the image lies near .*its middle at 90, ' sdmgen fit --shape cochlea ct.nii.gz --rotation 0,0,0 --start-centre 90,0,0 -o no.stl
expect 2 'all [0-9]+ voxels of the image near the shape .*cavity' sdmgen fit $fit ct.nii.gz $near_truth --inside 600,2000 --outside 2600,10 --cavity 0.5 -o no.stl
expect 0 '--cavity 4 left nothing out: the widest space like the inside holds a ball of [0-9.]+ mm$' sdmgen fit $fit ct.nii.gz $near_truth --cavity 4
gzip -dc ct.nii.gz >moved.nii && printf '\0\0\240\101' | dd of=moved.nii bs=1 seek=268 conv=notrunc 2>err # x of qform: 20 mm
expect 0 'moved.nii: sform and qform place voxels up to [0-9.]+ mm apart; sform is used$' sdmgen fit $fit moved.nii $near_truth
expect 2 "did you mean 'rx'" sdmgen fit $fit ct.nii.gz -p rc=3
expect 5 "parameter 'rx' = 9 mm, allowed [0-9.]+ \.\. [0-9.]+ mm\$" sdmgen fit $fit ct.nii.gz -p rx=9 -o no.stl
expect 0 'start parameters were clamped to their range' sdmgen fit $fit ct.nii.gz $near_truth -p rx=9 --policy clamp --json
[ "$(json start_clamped)" = true ] || bad 'a start that was moved must be marked'
absent no.stl no.vdb no.json no.png no.nrrd no.nii no.txt no.npy
finish
