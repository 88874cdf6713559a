#!/usr/bin/env bash
# sdmgen fit: the verdict with its reasons, wrong shapes that are refused, the mirror image of a shape.
# Tests: fit_contrast.c fit_mirror.c fit_verdict.c offset.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive

# A right fit: the list of checks as text and as JSON.
expect 0 - sdmgen phantom --shape torus -O edge=0.5 --spacing 0.4 -o torus.nii --label torus-label.nii --quiet
expect 0 - sdmgen fit --shape torus -O edge=0.5 torus.nii --quiet --rotation 0.05,0.05,0 --spacing 0.4 --eps 1e-3 -o torus.json
has '^verdict: (passed|doubtful)$'
has '^  (passed|      ) .*residuals [-0-9.e+]+ [<>]= '
has '^  (passed|      ) .*no shape [-0-9.e+]+ [<>]= '
has '^  next pose    passed    every other start, rotation and value of one parameter leads back to this surface$'
grep -Eq '(passed|doubtful|FAILED) +-0(,|:|$)' out && bad 'a negative zero'
cp torus.json out
has '"verdict": *\{"grade": *"(passed|doubtful)", *"checks": *\[\{"name": *"no shape", *"grade": *"passed"'
has '"trusted": *true'
grep -q '"mirror"' out && bad 'a torus has no mirror image'

# The rotation of a torus about its axis is open: the deviations leave it out, and so does the comparison with the truth.
expect 0 - sdmgen phantom --shape torus -O edge=0.5 --spacing 0.4 --rotation 0,0,1 -o turned.nii --truth turned.json --quiet
torus='sdmgen fit --shape torus -O edge=0.5 --quiet --rotation 0.05,0.05,0 --spacing 0.4 --eps 1e-3'
expect 0 - $torus turned.nii --truth turned.json -o fit.json
has '^  rotation .* \+- 0\.0[0-9]* 0\.0[0-9]* open rad$'
has '^  not determined by the data: rotation about the axis .*; the \+- of the pose leaves it out$'
has '^  pose         off the truth by 0\.[0-9]+ mm at the centre of the shape and 0(\.[0-9]+)? degrees between the open axis and the true one$'
# the true pose upside down, by half a turn about y of the frame: the errors stay
upright=$(sed -n 's/^  pose  *\(off the truth by [0-9.]* mm\) .* \([0-9.]*\) degrees between .*/\1 \2/p' out)
sed 's/"rotation_rad": *\[[^]]*\]/"rotation_rad": [-1.506160, 2.757007, 0]/' turned.json >over.json
cmp -s turned.json over.json && bad 'the pose of the truth was not found'
expect 0 - $torus turned.nii --truth over.json
over=$(sed -n 's/^  pose  *\(off the truth by [0-9.]* mm\) .* \([0-9.]*\) degrees between .*; the true pose was turned by 180 degrees first, .*/\1 \2/p' out)
[ -n "$upright" ] && [ "$over" = "$upright" ] || bad "errors of the pose upside down: '$over', not '$upright'"
cp fit.json out
has '"rotation_sd_determined_rad": *\[0\.0'

# Exchanged values of the tissues are told before the fit where the start shows them, and else are the only cause that is named.
expect 4 '^sdmgen: error: turned.nii: the values of the inside and the outside are exchanged: at the start the image is 201\.[0-9] within the shape and 1250 around it, .*: exchange --inside and --outside; --force fits nevertheless$' \
    $torus turned.nii --inside 1300,270 --outside 40,170
grep -q '^verdict' out && bad 'a fit with values that the start shows to be exchanged'
$torus turned.nii --inside 40,170 --outside 1300,270 --start-centre 1,0,0 --max-iterations 1 >out 2>err
has '^verdict: ' # it was fitted
grep -q exchanged out err && bad "right values are told to be exchanged: $(cat err)"
# many rotations: told at once, too, because this image cannot be stated right; with --force a notice
expect 4 'error: turned.nii: the values of the inside and the outside are exchanged: at the start .*--force fits nevertheless$' \
    sdmgen fit --shape torus -O edge=0.5 turned.nii --quiet --inside 1300,270 --outside 40,170 --start-axis 0,0,1 --turns 1 --max-iterations 1
grep -q '^verdict' out && bad 'a fit of many rotations with values that the image shows to be exchanged'
sdmgen fit --shape torus -O edge=0.5 turned.nii --spacing 0.4 --inside 1300,270 --outside 40,170 --start-axis 0,0,1 --turns 1 --max-iterations 1 --force >out 2>err
grep -q '^sdmgen: the values of the inside and the outside are exchanged: at the start .*: exchange --inside and --outside, if the shape lies near the start; if the fit is refused, no other start is searched$' err ||
    bad "no notice of exchanged values: $(cat err)"
# a start so far beside the shape that it shows nothing: the border of the image tells
sdmgen fit --shape torus -O edge=0.5 turned.nii --spacing 0.4 --inside 1300,270 --outside 40,170 --start-centre 0,0,4 --max-iterations 1 --turns 1 >out 2>err
grep -q '^sdmgen: [0-9]* % of the border of the image (mean 1[23][0-9.]*) is nearer to the value of the inside, 1300, than to those outside, 40' err || bad "no notice of the border: $(cat err)"
sdmgen fit --shape torus -O edge=0.5 turned.nii --spacing 0.4 --inside 40,170 --outside 1300,270 --start-centre 0,0,4 --max-iterations 1 --turns 1 >out 2>err
grep -q 'border of the image' err && bad "a notice of the border with the right values: $(cat err)"
# a dark shape in a bright layer, around which the image is dark again: right values are fitted, although the start lies in the layer
awk 'BEGIN { printf "NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 40 36 34\nspace directions: (0.4,0,0) (0,0.4,0) (0,0,0.4)\nspace origin: (-7.8,-7,-6.6)\nencoding: raw\n\n"
    for (k = 0; k < 34; k++) for (j = 0; j < 36; j++) for (i = 0; i < 40; i++) {
        x = 0.4 * i - 7.8; y = 0.4 * j - 7; z = 0.4 * k - 6.6
        dark = x * x / 12.25 + y * y / 6.25 + z * z / 4 < 1 || x * x / 27 + y * y / 17.6 + z * z / 13.7 > 1
        printf "%c", (dark ? 20 : 100) + (7 * i + 13 * j + 29 * k) % 9 } }' >layer.nrrd
layer='sdmgen fit --shape ellipsoid -O edge=0.8 -p rx=1 -p ry=1 -p rz=1 layer.nrrd --spacing 0.4 --start-centre 0,0,2.85 --start-axis 0,0,1 --turns 1 --margin 4 --max-iterations 1'
$layer --inside 24,3 --outside 104,3 >out 2>err
grep -q 'exchanged: at the start .*, if the shape lies near the start' err || bad "the start does not look exchanged: $(cat err)"
has '^verdict: '
# so clearly exchanged at the start, a refused fit searches no other start
${layer% --max-iterations 1} --inside 24,3 --outside 104,3 --json >out 2>err
has '"trusted": *false'
has '"restarts": *0,'
expect 4 '^sdmgen: error: turned.nii: the values of the inside and the outside are exchanged: .*: exchange --inside and --outside$' \
    $torus turned.nii --inside 1300,270 --outside 40,170 --force
has '^  given values doubtful  [0-9.]+, need at most 3$'
grep -q 'other values than those of this kind of image' out && bad 'another cause beside exchanged values'
grep -q -- '--rotation gives one start' out && bad 'advice on the start beside exchanged values'
expect 0 - sdmgen phantom --shape cochlea -O edge=0.6 --spacing 0.4 --random-pose 10,0.3 --seed 1 -o thin.nii --quiet
expect 4 '^sdmgen: error: thin.nii: the values of the inside and the outside are exchanged: [^;]*$' \
    sdmgen fit --shape cochlea -O edge=0.6 thin.nii --quiet --rotation 0,0,0 --spacing 0.4 --max-iterations 5 --mirror no --inside 1300,270 --outside 40,170 --force
# the right values beside the shape: another cause
expect 4 '^sdmgen: error: thin.nii: ' sdmgen fit --shape cochlea -O edge=0.6 thin.nii --quiet --rotation 3,0,0 --start-centre 6,6,0 --spacing 0.4 --max-iterations 5 --mirror no
grep -q exchanged err && bad "exchanged values are named for a wrong start: $(cat err)"

# A wrong shape is refused, from an image and from labels; the reason and the file are named.
wrong='sdmgen fit --shape capsule -O edge=0.5 --rotation 0,0,0 --spacing 0.4 --eps 1e-3 --quiet'
expect 4 '^sdmgen: error: torus.nii: ' $wrong torus.nii
has 'NOT TO BE TRUSTED'
has '^verdict: failed$'
has '^  --rotation gives one start: without it the fit tries 60 rotations$'
expect 4 '^sdmgen: error: torus-label.nii: ' $wrong torus-label.nii --label 1
has '^  (empty|missing)  +FAILED '
expect 2 '--beside does nothing in a fit to labels' $wrong torus-label.nii --label 1 --beside 1

# Points with errors on another shape: each neighbourhood is off by less than errors that its points share explain, but not by their own.
for square in 0.7 1; do
    expect 0 - sdmgen phantom --shape ellipsoid -p rx=4 -p ry=3.2 -p rz=2.5 -O e1=$square -O e2=$square --spacing 0.4 --seed 3 -o any.nii \
        --surface square.csv --surface-noise 0.08 --quiet
    expect 0 - sdmgen fit --shape ellipsoid square.csv --rotation 0,0,0 --quiet
    if [ $square = 1 ]; then
        has '^  (passed|      ) .*residuals [-0-9.e+]+ [<>]= '
    else
        has '^  residuals    doubtful  3\.[0-9]+, need at most 2\.[12][0-9]*: neighbouring points scatter by 0\.08[0-9]* mm, all points by 0\.1[0-9]* mm about the'
    fi
done

# Links of another thickness, which no parameter changes: nearly all of the surface lies inside or outside of the shape's.
expect 0 - sdmgen phantom --shape linkage -O edge=0.5 -p q1=0.2 -p q2=0.4 --spacing 0.4 --seed 3 -o arm.nii --label arm-label.nii --surface arm.csv \
    --surface-points 800 --surface-noise 0.05 --quiet
arm='sdmgen fit --shape linkage -O edge=0.5 --rotation 0,0,0 --translation 0,0,0 --keep pose --quiet'
expect 0 - $arm arm.csv
has '^  (passed|      ) .*offset [-0-9.e+]+ [<>]= '
expect 4 '^sdmgen: error: arm.csv: the surface of the points lies 0\.1[0-9] mm inside of .*: a wall or another size that is no parameter is thinner' \
    $arm arm.csv -O radius=1 -O tip=0.7
expect 0 - $arm arm.csv -O radius=1 -O tip=0.7 --tolerance 0.2
has '^  offset       doubtful '
expect 4 '^sdmgen: error: arm-label.nii: the surface of the labels lies 0\.1[0-9] mm inside of ' \
    $arm arm-label.nii --label 1 --spacing 0.4 -O radius=1 -O tip=0.7

# Maps too coarse for the point spread: the advised voxel passes its own check, where the image is as sharp as its voxels, too.
blurs=0
if is_long; then blurs='0 0.22'; fi # as sharp as its voxels, and nearly so
for blur in $blurs; do
    expect 0 - sdmgen phantom --shape ellipsoid -p rx=4.5 -p ry=3.5 -p rz=3 --spacing 0.5 --blur $blur --seed 2 -o sharp.nii --quiet
    sharp='sdmgen fit --shape ellipsoid sharp.nii --rotation 0,0,0 --quiet --spacing'
    $sharp 0.8 >out 2>err
    has '^  map voxels   doubtful  0\.8, need at most 0\.375: .* beside the point spread .* exact maps with voxels of 0\.3 mm .*, 0\.8 times the limit, show it$'
    expect 0 - $sharp 0.3
    has '^  (passed|      ) .*map voxels [-0-9.e+]+ [<>]= '
done

# Maps too coarse for the teeth of a gear: so does the voxel that they ask for. Single maps show now more and now less of the teeth.
gear='--plugin ../../plugins/gear/gear.so --shape gear'
expect 0 - sdmgen phantom $gear --spacing 0.3 -o gear.nii --label gear-label.nii --quiet
gear="sdmgen fit $gear gear-label.nii --label 1 --rotation 0,0,0 --translation 0,0,0 --keep pose --keep angle --quiet --spacing"
$gear 0.6 >out 2>err
has '^  map voxels   doubtful  0\.6, .* beside the details of the shape: '
$gear "$(sed -n 's/^  map voxels .*voxels of \([0-9.]*\) mm.*/\1/p' out)" >out 2>err
has '^  (passed|      ) .*map voxels [-0-9.e+]+ [<>]= '

# Coarse maps also widen the values inside: `in short` names the maps, not the data.
expect 0 - sdmgen phantom --shape torus -O edge=0.5 --spacing 0.3 -o ring.nii --quiet
expect 0 - sdmgen fit --shape torus -O edge=0.5 ring.nii --rotation 0,0,0 --quiet --spacing 0.6
has '^  inside       doubtful '
has '^  map voxels   doubtful '
has '^  in short     the maps are too coarse, or this is another shape: fit with finer maps before you use the values$'

# The side of an ear is found; the wrong one is refused.
expect 0 - sdmgen phantom --shape cochlea -O edge=0.8 -O ear=left --spacing 0.5 --seed 5 -o left.nii --quiet
ear='sdmgen fit --shape cochlea -O edge=0.8 left.nii --quiet --rotation 0,0,0 --spacing 0.5 --eps 1e-3'
expect 0 - $ear --json
has '"mirror": *\{"option": *"ear", *"value": *"left", *"better_by": *[1-9]'
expect 0 - $ear -O ear=left
has '^  (passed|      ) .*mirror image [-0-9.e+]+ [<>]= '
expect 4 '^sdmgen: error: left.nii: ' $ear -O ear=right --json
has '"name": *"mirror image", *"grade": *"failed"'
has "the mirror image of the shape fits better, by [0-9.]+ .*the other value of the option 'ear' is right"
expect 4 '^sdmgen: error: left.nii: ' $ear -O ear=right --mirror no --json
grep -q '"mirror' out && bad '--mirror no fits no mirror image'

# A point spread that reaches beyond the samples: no voxel lies deep outside, and mixed ones tell the noise there.
expect 0 - sdmgen phantom --shape capsule --seed 5 --random-params --inside 1500,0 --outside -1000,0 --spacing 0.5 --blur 0.6 --noise 60 -o wide.nrrd -q
expect 0 - sdmgen fit --shape capsule wide.nrrd --rotation 0,0,0 --inside 1500,50 --outside -1000,50 --blur 0.6 --margin 0.9 -q
for check in beside residuals outside; do has "^  (passed|      ) .*$check [0-9.e+-]+ <= "; done

# Blur nearly as wide as the tube: a fainter inside and a thicker tube explain the image as well, and the given value decides.
expect 0 - sdmgen phantom --shape torus -O edge=0.5 --random-params --random-pose 5,0.3 --spacing 0.4 --blur 0.8 --seed 6 -o faint.nrrd --truth faint.json -q
expect 0 - sdmgen fit --shape torus -O edge=0.5 faint.nrrd --rotation 0,0,0 --margin 3 --truth faint.json -q
has '^  minor .* off by [01]\.[0-9] sd'
expect 4 '^sdmgen: error: faint.nrrd: .*the blur hides the background within the margin: give a margin of four times the point spread' \
    sdmgen fit --shape torus -O edge=0.5 faint.nrrd --rotation 0,0,0 --margin 0.6 -q

# An ellipsoid that covers a torus and its hole: half of what lies deep inside is not labelled, which is no noise.
cat >hole.yaml <<'END'
experiment: {title: a torus fitted by an ellipsoid, seed: 6, pictures: no}
fit: {phantoms: 1, off_mm: 0.5, off_deg: 10, voxel: 0.3, range: 0.6, eps: 1e-4}
grid: {spacing: 0.3}
methods:
  - {name: right, fit: exact, labels: yes, set: {shape.name: torus}}
  - {name: wrong, fit: exact, labels: yes, shows: right, set: {shape.name: ellipsoid}}
END
expect 0 - sdmgen experiment hole.yaml --out hole -q
grep -q '^1,true,' hole/right/fits.csv || bad "right fit: $(tail -n 1 hole/right/fits.csv)"
grep -q '^1,false,.*of the volume of the shape is empty in the labels' hole/wrong/fits.csv || bad "wrong fit: $(tail -n 1 hole/wrong/fits.csv)"

# Labels of another body beyond the margin are counted, and the nearest is named: 30 voxels of the first row, up to x = (29 - 29.5) 0.4 mm.
expect 0 - sdmgen phantom --shape torus -O edge=0.5 --size 60,60,24 --spacing 0.4 -o wide.nii --label wide-label.nii -q
head -c 30 /dev/zero | tr '\0' '\1' | dd of=wide-label.nii bs=1 seek=352 conv=notrunc status=none
expect 0 - sdmgen fit --shape torus -O edge=0.5 wide-label.nii --label 1 --rotation 0,0,0 -q
has '^  far labels   30 labelled voxels, 3.5 % of them, lie farther outside than --margin \(1.5 mm\), .*; the nearest is 9 mm away, at -0.2, -11.8, -4.6 mm$'
has '^  missing      doubtful .*: 30 voxels far from the surface'
expect 0 - sdmgen fit --shape torus -O edge=0.5 torus-label.nii --label 1 --rotation 0,0,0 -q
grep -q '^  far labels' out && bad "labels of one body: $(cat out)"

# Half of a surface determines all values of an ellipsoid: each can be used.
expect 0 - sdmgen phantom --shape ellipsoid -p rx=4 -p ry=3.2 -p rz=2.5 --spacing 0.5 --seed 3 -o e.nii --surface e.csv --surface-noise 0.05 \
    --surface-points 1500 -q
awk -F, 'NR == 1 || $1 < 0.5' e.csv >half.csv
expect 0 - sdmgen fit --shape ellipsoid half.csv --rotation 0,0,0 --start-centre 0,0,0 -o half.json -q
has '^  covered      doubtful '
has '^  in short +the data show a part of the shape: the line `use` names '
has '^  use +all values, each with its \+-$'
tr -d '\n ' <half.json | grep -q '"in_short":"thedatashowapartoftheshape:.*"usable":\["rx","ry","rz"\]' || bad "half.json: $(head -c 2000 half.json)"

# The same half of an object that differs smoothly from the shape: no line says that its values can be used.
expect 0 - sdmgen phantom --shape ellipsoid -p rx=4 -p ry=3.2 -p rz=2.5 -O e1=0.9 --spacing 0.5 --seed 3 -o e.nii --surface e.csv --surface-noise 0.02 \
    --surface-points 3000 -q
awk -F, 'NR == 1 || $1 > 0' e.csv >half.csv
expect 0 - sdmgen fit --shape ellipsoid half.csv --rotation 0,0,0 --start-centre 0,0,0 -o half.json -q
has '^  residuals    doubtful  [23]\.[0-9]+, need at most 2\.2[0-9]: neighbouring points scatter by 0\.02[0-9]* mm, all points by 0\.03[0-9]* mm about'
has '^  covered      doubtful '
grep -Eq '^  use |line .use. names' out && bad "values of another shape: $(cat out)"
grep -q '"usable"' half.json && bad "half.json: $(head -c 2000 half.json)"

# A standard deviation that the points of this object contradict: their scatter is three times as large. Outliers contradict none.
given='--rotation 0,0,0 -q --keep appearance --point-sd'
expect 4 'e.csv: the points scatter by 0\.03[0-9]* mm about the surface, but 0\.012 mm are given as their standard deviation: another shape' \
    sdmgen fit --shape ellipsoid e.csv $given 0.012
expect 0 - sdmgen phantom --shape ellipsoid -p rx=4 -p ry=3.2 -p rz=2.5 --spacing 0.5 --seed 3 -o e.nii --surface e.csv --surface-noise 0.02 \
    --surface-points 1500 -q
awk -F, -v OFS=, 'NR % 33 == 2 { $1 += 0.4 } { print }' e.csv >outliers.csv
expect 0 - sdmgen fit --shape ellipsoid outliers.csv $given 0.02
has '^  residuals    doubtful  [0-9.]+, need at most 1\.[0-9]+: the points scatter by 0\.0[34][0-9]* mm about the surface, but 0\.02 mm are given '

# Forty points have no neighbours: nothing tests them but a standard deviation that is known.
expect 0 - sdmgen phantom --shape capsule -p radius=1.2 -p length=5 --spacing 0.5 -o few.nii --surface few.csv --surface-points 40 --surface-noise 0.05 -q
few='sdmgen fit --shape capsule few.csv --rotation 0,0,0 -q'
expect 0 - $few
has '^  in short +the points are too few to test the fit'
has '^  residuals +doubtful +the points lie too far apart .* \(--point-sd\), keep it \(--keep appearance\)$'
expect 0 - $few --point-sd 0.05 --keep appearance
has '^verdict: passed$'
expect 0 - $few --point-sd 0.02 --keep appearance
has '^  residuals +doubtful .*: the points scatter by 0\.0[0-9]+ mm about the surface, but 0\.02 mm are given as their standard deviation: another shape, or their standard deviation is larger$'
finish
