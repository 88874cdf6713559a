#!/usr/bin/env bash
# sdmgen fit: a refused fit names its likely cause: a start away from the data, points in another frame, exchanged values.
# Tests: fit_astray.c fit_finer.c fit_usable.c cause.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive
negate() { awk -F, 'NR == 1 { print; next } { printf "%g,%g,%s\n", -$1, -$2, $3 }' "$1"; }

# A start away from the labels: how far it is, and where they are.
capsule='sdmgen fit --shape capsule -O edge=0.5 --rotation 0,0,0 --quiet'
expect 0 - sdmgen phantom --shape capsule -O edge=0.5 --translation 20,10,5 --spacing 0.5 -o c.nii --label c-label.nii --surface c.csv --surface-points 300 --quiet
expect 2 'no voxel of the image lies near .*; the fit began [0-9.]* mm from the middle of the labels, which is at .* mm \(LPS\): without --start-centre it begins there$' \
    $capsule c-label.nii --label 1 --start-centre 50,10,5
# A start in another frame.
expect 2 'with x and y of the other sign the start is near it: one of both is RAS, the other LPS: --ras converts --start-centre$' \
    $capsule c-label.nii --label 1 --start-centre -20,-10,5
negate c.csv >c-ras.csv
expect 4 'the fit began 44\.[0-9]* mm from the middle of the points; with x and y of the other sign the start is near it: one of both is RAS, the other LPS$' \
    $capsule c-ras.csv --start-centre 20,10,5
grep -q 'start-centre X,Y,Z' err && bad "a second advice on the start: $(cat err)"

# Points of another frame turn the shape by half a turn; the neighbourhood that is farthest off is named.
expect 0 - sdmgen phantom --shape cochlea -O edge=0.6 --rotation 1.57,0,0 --spacing 0.5 -o ear.nii --surface ear.csv --surface-points 500 --quiet
negate ear.csv >ear-ras.csv
expect 4 '; with x and y of the other sign most points lie within 0\.[0-9]* mm of the shape at the start, not 0\.[0-9]* mm: either the start is turned by half a turn about z \(leave --rotation out, or --rotation [-0-9.,]* turns it back\), or the points are RAS \(--ras converts them\)$' \
    sdmgen fit --shape cochlea -O edge=0.6 ear-ras.csv --rotation 1.57,0,0 --mirror no --max-iterations 10 --quiet
has "^  residuals    .*, most at \([-0-9., ]*\) mm, in the shape's frame \([-0-9., ]*\), where the data show (more|less) than the shape"
# Where the parameters at the start are far off, a second fit tells it.
expect 0 - sdmgen phantom --shape cochlea -O edge=1 -p a=3 -p b=0.1 --spacing 1 -o small.nii --surface small.csv --surface-points 400 --quiet
negate small.csv >small-ras.csv
expect 4 '; with x and y of the other sign the fit lies on the points \((they scatter by (0\.0[0-9]*|[0-9.]*e-[0-9]*) mm about it, not by 0\.[0-9]* mm|log-likelihood [-0-9.e+]*, not [-0-9.e+]*)\): either the start is turned by half a turn about z \(leave --rotation out, or --rotation 0,0,3\.142 turns it back\), or the points are RAS \(--ras converts them\)$' \
    sdmgen fit --shape cochlea -O edge=1 small-ras.csv --rotation 0,0,0 --mirror no --quiet
expect 0 - sdmgen fit --shape cochlea -O edge=1 small-ras.csv --rotation 0,0,0 --mirror no --quiet --ras
# A start that is turned by half a turn about z looks the same: the advised rotation turns it back. Away from the z axis only RAS explains it.
expect 4 'either the start is turned by half a turn about z .*--rotation 0,0,-0\.0416 turns it back\)' \
    sdmgen fit --shape cochlea -O edge=1 small.csv --rotation 0,0,3.1 --mirror no --quiet
expect 4 'either the start is turned by half a turn about z \(--rotation 0,0,-0\.0416 turns it back\)' \
    sdmgen fit --shape cochlea -O edge=1 -p a=3 -p b=0.1 small.csv --rotation 0,0,3.1 --translation 0,0,0 --mirror no --quiet
awk -F, 'NR == 1 { print; next } { printf "%g,%g,%s\n", -$1 - 1, -$2, $3 }' ear.csv >aside.csv
expect 4 'most points lie within 0\.[0-9]* mm of the shape at the start, not [0-9.]* mm: are they RAS\? --ras converts them$' \
    sdmgen fit --shape cochlea -O edge=0.6 aside.csv --rotation 1.57,0,0 --translation 1,0,0 --mirror no --max-iterations 40 --quiet

# A parameter at the end of its range is a cause, too; the texts say what is counted, and points have no material.
awk 'BEGIN { print "x,y,z"; for (i = 0; i < 40; i++) for (j = 0; j < 20; j++) { a = i * 0.15708; b = j * 0.314159; r = 3 + 1.65 * cos(b); print r * cos(a) "," r * sin(a) "," 1.65 * sin(b) } }' >thick.csv
expect 4 'where the data show more than the shape, as in nearly all places that deviate: another shape lies there.*; the data may want minor to be more than 1\.5, the largest value of its range; a wrong start' \
    sdmgen fit --shape torus thick.csv --rotation 0,0,0 --quiet
has '^  bounds       doubtful .* \(minor\): the data may want minor to be more than 1\.5, the largest value of its range$'
has '^  missing      FAILED .*: points lie outside of the shape: the space between them and its surface is as large as 1[0-9.]* % of its volume, allowed 5 %'
has '^  (passed|      ) .*empty [0-9.e-]+ <= 0\.05'

# Maps that are too coarse for the shape are the reason: no advice on the start, but the command that goes on with finer ones.
expect 0 - sdmgen phantom --shape torus -p minor=0.6 --spacing 0.3 -o thin.nii --label thin-label.nii --quiet
expect 4 'error: thin-label.nii: the voxels of the maps are coarse beside ' \
    sdmgen fit --shape torus thin-label.nii --label 1 --rotation 0,0,0 --spacing 1 --quiet
grep -q -- '--rotation gives one start' out && bad 'advice on the start beside coarse maps'
grep -q 'a wrong start' err && bad 'a wrong start is named beside coarse maps'
has '^finer maps from here; [0-9.]+ times as many voxels, up to [0-9.e+]+ (s|minutes) if the machine is as busy as in this fit:$'
eval "$(sed -n 's/^  sdmgen fit/expect 0 - sdmgen fit/p' out)"
has '^verdict: (passed|doubtful)$'

# Without --spacing the fit goes on by itself: labels pass with maps of up to 1.5 times their voxels, and the true radius lies within three deviations.
expect 0 - sdmgen phantom --shape capsule -p radius=0.6 -p length=1 --spacing 0.11 -o small.nii --label small-label.nii --truth small.json --quiet
small='sdmgen fit --shape capsule -p radius=0.7 -p length=1.2 --label 1 --rotation 0,0,0 --keep pose --quiet'
${small% --quiet} small-label.nii --margin 0.3 --truth small.json >out 2>err || bad "a fit that goes on with finer maps: $(cat err)"
has '^verdict: passed$'
has '^  maps .*, voxels of 0\.13[0-9]* mm, because those of 0\.1[78][0-9]* mm at first were coarse beside the voxels of the labels$'
has '^  radius .* truth 0\.6, off by [0-2]\.[0-9] sd$'
grep -Eq '^sdmgen: fit 0 %  going on with finer maps \(voxels of 0\.13 mm\)$' err || bad "no line on finer maps: $(cat err)"
grep -q 'finer maps from here' out && bad 'the command of a fit that went on by itself'
# Maps that would be too large are left to the user, and the fit says so.
expect 0 - sdmgen phantom --shape capsule -p radius=0.6 -p length=1 --spacing 0.05 -o fine.nii --label fine-label.nii --quiet
expect 0 - $small fine-label.nii --margin 0.3
has '^  map voxels   doubtful .* coarse beside the voxels of the labels'
has '^finer maps from here; [0-9.]+ times as many voxels, [0-9.]+ million in all \(more than the 2\.1 million that a fit takes by itself\), up to [0-9.e+]+ (s|minutes) if the machine is as busy as in this fit:$'
has '^  maps .*, voxels of 0\.1[78][0-9]* mm$'

# Maps pass but are nearly too coarse, and residuals are a little above their limit: the fit tries finer ones once by itself; with --spacing it prints the command.
# (The labels are those of a shape that is a little squarer than the ellipsoid.)
expect 0 - sdmgen phantom --shape ellipsoid -O e1=0.83 -O edge=0.2 -p rx=3 -p ry=2.5 -p rz=2 --spacing 0.2 -o square.nii --label square-label.nii --quiet
square='sdmgen fit --shape ellipsoid -p rx=3 -p ry=2.5 -p rz=2 square-label.nii --label 1 --rotation 0,0,0 --keep pose --margin 0.4'
$square >out 2>err || bad "a fit that tries finer maps: $(cat err)"
grep -Eq '^sdmgen: fit 0 %  going on with finer maps \(voxels of 0\.15 mm\)$' err || bad "no line on finer maps: $(cat err)"
has '^  maps .*, voxels of 0\.152 mm, because those of 0\.19 mm at first were nearly too coarse$'
grep -q 'finer maps from here' out && bad 'finer maps are advised after some that did not help'
expect 0 - $square --spacing 0.25 --quiet
has '^  in short     the maps are nearly too coarse, or the data differ from the shape as the lines below say: fit with finer maps'
has '^  (passed|      ) .*map voxels 0\.25 <= 0\.3(,|$)'
has '^finer maps from here \(the present ones are nearly too coarse, which may explain the doubt\); 2 times as many voxels, '
has '^  sdmgen fit .* --spacing=0\.2 '

# A point spread that is given and narrower than the maps show decides how fine they must be: 0.8 * 1.5 * 0.28 mm; else half a voxel of the image, 0.8 * 1.5 * 0.2 mm.
expect 0 - sdmgen phantom --shape ellipsoid -O edge=0.6 -p rx=3.5 -p ry=2.5 -p rz=2 --spacing 0.4 -o spread.nii --quiet
spread='sdmgen fit --shape ellipsoid -O edge=0.6 spread.nii --rotation 0,0,0 --spacing 0.6 --eps 1e-3 --quiet'
expect 0 - $spread --blur 0.28
has '^  map voxels   doubtful  0\.6, need at most 0\.42: .* coarse beside the point spread of the image: .* with voxels of 0\.34 mm '
expect 0 - $spread
has '^  map voxels   doubtful  0\.6, need at most 0\.3: .* contain an estimate of this error, which may be too small; exact maps with voxels of 0\.24 mm '
has '^  in short     the maps are too coarse to judge the shape: fit with finer ones before you use the values$'

# An interrupt says what it has stopped, and where.
expect 130 'spread.nii: the fit was stopped on request (before its first iteration|in the search, at start [0-9]+ of 60); no file was written$' \
    timeout --foreground --preserve-status -s TERM 1.5 "$program" fit --shape ellipsoid -O edge=0.1 spread.nii --spacing 0.15 --quiet -o none.json
[ -e none.json ] && bad 'a file of a fit that was stopped'

# Exchanged values of a thin shape beside its place: as much of both tissues lies within the start as around it.
expect 0 - sdmgen phantom --shape torus -O edge=0.5 --spacing 0.4 -o torus.nii --quiet
torus='sdmgen fit --shape torus -O edge=0.5 torus.nii --rotation 0,0,0 --spacing 0.4 --eps 1e-3 --quiet --start-centre 1.5,1,0.5'
expect 4 'the values of the inside and the outside are exchanged: a fit that exchanges them finds the shape in this image, .*: exchange --inside and --outside$' \
    $torus --inside 1300,270 --outside 40,170
# A small patch of points tells only the sum of two radii; the parts of the time have names.
awk 'BEGIN { print "x,y,z"; for (i = 0; i < 20; i++) for (j = 0; j < 20; j++) { u = 0.6 + 0.005 * i; t = -0.1 + 0.01 * j; s = sqrt(1 - u * u); e = 0.02 * cos(7 * i + 3 * j * j); print 4 * s * cos(t) + e "," 3.5 * s * sin(t) "," 3 * u + e } }' >patch.csv
sdmgen fit --shape ellipsoid -p rx=4 -p ry=3.5 -p rz=3 patch.csv --keep pose --keep ry --rotation 0,0,0 --translation 0,0,0 --quiet >out 2>err
has '^  rx and rz: only their sum is well determined \(correlation -0\.9[0-9]\)$'
has '^  time .* s: search of the start .* s; iterations .* s; verdict and rivals .* s; in them maps .* s$'
finish
