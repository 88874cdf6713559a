#!/usr/bin/env bash
# sdmgen fit with a trained model: network, exact maps of the same shape, polishing, ranges, an interrupt.
# Tests: fit_source.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive
model=../files-of-trained/run/model.sdm
present $model

# Removes lines of progress from stderr; they appear only when the machine is slow.
sdmgen() { sdmgen_without '^sdmgen: (search|fit|polish) [0-9]+ %' "$@"; }
# pose KEY I: element I (from 1) of the array KEY of the pose.
pose() { sed -n "s/.*\"$1\": \\[\\([^]]*\\)\\].*/\\1/p" out | head -n 1 | tr -d ' ' | cut -d, -f"$2"; }

# The small network is accurate enough to fit the pose alone, to a tolerance; its voxels are too large to tell the side.
expect 0 - sdmgen phantom --shape cochlea -O edge=0.5 --spacing 0.5 --rotation 0,0,0.1 --translation 2,0,1 -o ct.nii
start='--rotation 0,0,0 --start-centre 2.3,0.3,2'
coarse='--tolerance 0.1 --mirror no'
# a notice tells that the parameters keep their defaults; with -p there is none
kept='^sdmgen: --keep parameters without -p: the parameters keep their default values$'
expect 0 "$kept" sdmgen fit $model ct.nii $start --keep parameters -o coarse.nrrd
has '^verdict: doubtful$' # coarse voxels widen the values inside
has '^  in short +the data may differ from the shape as the lines below say'
has '^  inside       doubtful'
if grep -q -- '--rotation gives one start' out; then bad "advice on the start beside a fit that is only doubtful"; fi
expect 0 "$kept" sdmgen fit $model ct.nii $start $coarse --keep parameters -o fit.nrrd -o fit.ply -o fit.json --json
[ "$(json trusted)" = true ] || bad "not trusted: $(cat out)"
[ "$(json maps_network)" -gt 0 ] && [ "$(json maps_exact)" = 0 ] || bad 'maps must be the network'"'"'s'
[ "$(json a)" = 0 ] || bad 'the sd of a parameter that is kept must be 0' # json prints parameters_sd, the last key of that name
near "$(pose translation_mm 1)" 2 0.3
near "$(pose translation_mm 3)" 1 0.3
present fit.nrrd fit.ply fit.json
sdmgen info fit.nrrd | grep -Eq 'network: cochlea' || bad 'the file must say that the network made the map'

# In a table each case may have its own model; its path starts from the folder of the table.
mkdir cohort
printf 'id,image,model,keep,tolerance\na,../ct.nii,../%s,parameters,0.1\n' $model >cohort/cases.csv
expect 0 - sdmgen fit $start --mirror no --cases cohort/cases.csv -o cohort/out -q
[ "$(sed 's/.*\("translation_mm": [^]]*\).*/\1/' cohort/out/a/fit.json)" = "$(sed 's/.*\("translation_mm": [^]]*\).*/\1/' fit.json)" ] ||
    bad "the fit of a table differs: $(cat cohort/out/a/log.txt)"

# Exact maps of the model's shape on its grid, and the same fit started with the network. The tissues are stated, as the image holds no air: where maps are coarse, a second
# tissue outside may take a part of the bone, and the likelihood then has two maxima.
tissues='--inside 40,170 --outside 1300,270'
expect 0 "$kept" sdmgen fit $model ct.nii $start $coarse $tissues --keep parameters --exact -o exact.nrrd --json
[ "$(json maps_network)" = 0 ] && [ "$(json maps_exact)" -gt 0 ] || bad 'maps must be exact'
for i in 1 2 3; do exact[i]=$(pose translation_mm $i); done
expect 0 "$kept" sdmgen fit $model ct.nii $start $coarse $tissues --keep parameters --polish -o polished.nrrd --json
[ "$(json maps_network)" -gt 0 ] && [ "$(json maps_exact)" -gt 0 ] || bad 'maps must be of both kinds'
for i in 1 2 3; do near "$(pose translation_mm $i)" "${exact[i]}" 0.02; done
for file in exact polished; do
    sdmgen info $file.nrrd | grep -Eq 'exact: cochlea' || bad "$file.nrrd must be an exact map"
done

# Ranges: the network's, or the shape's.
expect 5 "parameter 'a' = 5.5 mm, allowed 2 .. 5 mm; --policy clamp .*the shape itself does not allow the value" sdmgen fit $model ct.nii $start -p a=5.5 -o no.nrrd
sdmgen fit $model ct.nii $start -p a=5.5 --keep parameters --policy clamp --json >out 2>err # may fail, but must pass the check of ranges
[ "$(json start_clamped)" = true ] || bad 'a start that was moved must be marked'
grep -q 'the start parameters were clamped to their range: ' err || bad "no notice of the start: $(cat err)"
expect 5 "shape 'cochlea': parameter 'a' = 50 mm, allowed 2 .. 5 mm\$" sdmgen fit $model ct.nii $start -p a=50 --policy exact -o no.nrrd

# Points of an arm without its end: a kink of the likelihood leads plain steps to and fro until the iterations are over. Averaged derivatives end it.
cat >link.yaml <<'END'
shape: {name: linkage, options: {motion: planar, links: 2, edge: 0.5}}
grid: {voxels: 40}
network: {kind: template, depth: 1, width: 8}
data: {start: 24, online: 0, holdout: 2}
train: {steps: 4}
threads: 1
END
sdmgen train link.yaml --out link --quiet >out 2>err || bad "link.yaml: $(cat err)"
arm_without_its_end() { # SEED: writes upper-arm.csv
    sdmgen phantom --shape linkage -O links=2 -O edge=0.5 --random-params --seed "$1" --spacing 2 -o arm.nii --surface arm.csv \
        --surface-points 1500 --surface-noise 0.03 --quiet >out 2>err || bad "arm.csv: $(cat err)"
    awk -F, 'NR == 1 || $1 < 2' arm.csv >upper-arm.csv
}
arm_without_its_end 9
expect 0 - sdmgen fit link/model.sdm upper-arm.csv --rotation 0,0,0 --quiet
has '^  (passed|      ) .*convergence [0-9]+(,|$)'
# the network is no cause of what the data do not determine
has '^  q1 .* not determined: '
has '^  (passed|      ) .*network bias [-0-9.e+]+ [<>]= '
# the first joint is open; the second moves points, too, and its true value, -1.008, lies within two deviations
has '^  covered      doubtful .*: the data hardly determine q1: most of the part of the fitted surface that it moves has no points; keep a known value \(-p NAME=VALUE, --keep NAME\), or take points from there$'
near "$(sed -n 's/^  q2 *\([-0-9.]*\) .*/\1/p' out)" -1.008 0.08
# errors of the network may pass for data: a polish tells the values that can be used
has '^  in short +the data show a part of the shape; .*: --polish tells the values that can be used$'
grep -q '^  use ' out && bad "values to use by a network alone: $(cat out)"
expect 0 - sdmgen fit link/model.sdm upper-arm.csv --rotation 0,0,0 --polish -o upper-arm.json --quiet
has '^  in short +the data show a part of the shape: the line `use` names '
has '^  use +no parameter$'
tr -d '\n ' <upper-arm.json | grep -q '"usable":\[\]' || bad "upper-arm.json: $(head -c 2000 upper-arm.json)"

# Points of an arm of another thickness: voxels that pass their own check are no cause of residuals, and no other ones are advised.
sdmgen phantom --shape linkage -O links=2 -O edge=0.5 -O radius=1.05 -O tip=0.5 --spacing 1 -o arm.nii --surface thick-arm.csv --surface-points 1000 \
    --surface-noise 0.02 --quiet >out 2>err || bad "thick-arm.csv: $(cat err)"
sdmgen fit link/model.sdm thick-arm.csv --rotation 0,0,0 --quiet >out 2>err
has '^  (passed|      ) .*map voxels [-0-9.e+]+ [<>]= '
has '^  residuals    FAILED .*: another shape lies there'
grep -q 'voxels of the maps.*coarse' out && bad "coarse voxels beside a check of them that passes: $(cat out)"

# Steps that are too large for that: the fit goes on with exact distances, which tell the values that can be used.
arm_without_its_end 4
expect 0 - sdmgen fit link/model.sdm upper-arm.csv --rotation 0,0,0 --quiet
has '^  (passed|      ) .*convergence [0-9]+(,|$)'
has '^  maps +[1-9][0-9]* by the network, [1-9][0-9]* by the exact engine'
has '^  q1 .* not determined: '
has '^  in short +the data show a part of the shape: the line `use` names '
grep -q 'max-iterations\|known values' out && bad "advice that does not help: $(cat out)"

# An interrupt: no file is written.
"$program" fit $model ct.nii --turns-sphere 4096 --start-centre 2,0,2 -o no.nrrd -o no.json --quiet >out 2>err &
job=$!
sleep 3
kill -TERM $job
wait $job
code=$?
[ $code -eq 130 ] || bad "exit code $code instead of 130 after an interrupt: $(cat err)"
[ ! -s out ] || bad 'an interrupted fit has no result'

# Mistakes in arguments.
expect 2 'spacing applies to exact maps' sdmgen fit $model ct.nii $start --spacing 0.3
expect 2 'spacing applies to .* its own grid, which the exact maps of --polish take, too: ' sdmgen fit $model ct.nii $start --polish --spacing 0.3
expect 2 'O belongs to --shape' sdmgen fit $model ct.nii $start -O edge=0.5
expect 1 'nowhere.sdm' sdmgen fit nowhere.sdm ct.nii $start -o no.nrrd
expect 3 'ct.nii' sdmgen fit ct.nii ct.nii $start -o no.nrrd
expect 2 'usage: sdmgen fit|unexpected argument' sdmgen fit $model ct.nii ct.nii
absent no.nrrd no.json
finish
