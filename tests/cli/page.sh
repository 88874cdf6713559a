#!/usr/bin/env bash
# Pages of models, runs and fits: their files, their text, and the page itself in chromium (page.mjs), where the model must give the same map as
# the program for the same kernels (third argument). The part in the browser is skipped without chromium or Node.js; fourth argument: whether
# this build has the runtime for pages.
# Tests: cmd_report.c page_errors.c page_figures.c page_fit.c page_history.c page_report.c page_still.c page_write.c input_checksum.c
baseline=$3
runtime=$4
. "$(dirname "$0")/common.sh"

expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" shape.name=ellipsoid "shape.ranges.rx=[2, 4]" --out run --quiet \
    --report run/page.html
model=run/model.sdm

# Mistakes, each with one message and no file.
expect 2 'need one output: -o FILE\.html' sdmgen report $model --no-model
expect 2 'need one output: -o FILE\.html' sdmgen report $model --no-model -o page.pdf
expect 2 'need one output: -o FILE\.html' sdmgen report $model --no-model -o a.html -o b.html
expect 1 'missing\.sdm: cannot open' sdmgen report missing.sdm --no-model -o page.html
mkdir empty
expect 1 'empty: no model\.sdm in this folder' sdmgen report empty --no-model -o page.html
echo '{}' >fit.json
expect 3 'fit\.json: no member "image": it is no result of a fit' sdmgen report fit.json --no-model -o page.html
echo '{' >fit.json
expect 3 'fit\.json' sdmgen report fit.json --no-model -o page.html
expect 2 "report 'page\.pdf'.*must end in \.html" sdmgen train "$source_folder/tests/cli/tiny.yaml" --out other --report page.pdf
head -c 1000 $model >damaged.sdm
expect 3 'damaged\.sdm: truncated' sdmgen report damaged.sdm --no-model -o page.html
cp $model model.html
expect 2 "would overwrite the input" sdmgen report model.html --no-model -o model.html
absent page.html page.pdf a.html

# figures FILE: the figures of a page, as JSON, in `out`.
figures() { sed -n 's/.*<script type="application\/json" id="figures">\(.*\)<\/script>$/\1/p' "$1" >out; }

# A page of pictures alone: small, without the runtime, with the figures of the model and of the training.
expect 0 - sdmgen report run --no-model -o still.html
[ "$(stat -c %s still.html)" -lt 300000 ] || bad "still.html: $(stat -c %s still.html) bytes"
figures still.html
has '"shape": *"ellipsoid"'
has '"live": *false'
has '"history": *\[\{"phase"'
has '"max": *4,'
expect 0 - sdmgen info $model --json
cp out info
rmse=$(json rmse_mm)
figures still.html
[ "$(json rmse_mm)" = "$rmse" ] || bad "error in the page $(json rmse_mm), of the model $rmse"
expect 0 - sdmgen generate $model --json -o map.nrrd
volume=$(json volume_mm3)
# the histogram of the errors has the voxels of 16 shapes, and the root mean square that eval measures there
sdmgen eval $model --samples 16 --json >out
rmse=$(json rmse_mm)
figures still.html
histogram=$(sed -n 's/.*"first_edge_mm": *\([^,]*\), "bins_per_decade": *8, "voxels": *\[\([^]]*\)\].*/\1, \2/p' out)
awk -v text="$histogram" -v rmse="$rmse" 'BEGIN {
    n = split(text, part, ", *")
    for (i = 2; i <= n; i++) { sum += part[i]; squares += part[i] * (part[1] * 10 ^ ((i - 2.5) / 8)) ^ 2 }
    ratio = sum ? sqrt(squares / sum) / rmse : 0; exit !(n == 41 && sum == 16 * 16 * 14 * 12 && ratio > 0.9 && ratio < 1.1) }' ||
    bad "histogram $histogram, root mean square error $rmse"
expect 0 - sdmgen report $model --no-model -o of_model.html
figures of_model.html
! grep -q '"history"' out || bad 'a page of a model without its run has a history'

# train --report writes the same page, with the runtime where this build has it.
if [ "$runtime" = ON ]; then sdmgen report run -o again.html; else sdmgen report run --no-model -o again.html; fi
cmp run/page.html again.html || bad 'train --report: another page'

# A fit: the page of --report and that of its result are the same; model and image are found beside the result, too.
sdmgen phantom --shape ellipsoid -p rx=2.7 -p ry=2.4 -p rz=3.1 --random-pose 5,0.3 --spacing 0.3 --seed 3 -o "ct's.nii.gz" >/dev/null
sdmgen fit $model "ct's.nii.gz" --rotation 0,0,0 --force --report fitted.html -o fit.json >/dev/null 2>&1
if [ "$runtime" = ON ]; then sdmgen report fit.json -o again.html; else sdmgen report fit.json --no-model -o again.html; fi
figures fitted.html
tr -d '\n' <out >fitted
figures again.html
tr -d '\n' <out | cmp - fitted || bad 'fit --report: other figures'
has '"fit": *\{"made_by"'
has '"image": *\{"size"'
mkdir away
cp fit.json "ct's.nii.gz" away
cp $model away/model.sdm
cd away || exit 1
expect 0 - sdmgen report fit.json --no-model -o page.html
[ ! -s err ] || bad "files beside the result: $(cat err)"
rm "ct's.nii.gz"
expect 0 "its image 'ct's\.nii\.gz' is gone: the page shows none" sdmgen report fit.json --no-model -o page.html
figures page.html
! grep -q '"image": *{' out || bad 'an image that is gone is in the page'
cp "$source_folder/tests/golden/pod_i8.sdm" model.sdm # whole, but another one
expect 3 'its model model\.sdm has changed since the fit, or is another file' sdmgen report fit.json --no-model -o page.html
cp ../$model model.sdm
printf x >>model.sdm
expect 3 'its model model\.sdm has changed since the fit, or is another file.*--changed-files takes it' sdmgen report fit.json --no-model -o page.html
sdmgen report fit.json --changed-files --no-model -o page.html >out 2>err && bad 'a damaged model makes a page'
grep -q 'model\.sdm has changed since the fit' err || bad "no word about a model that has changed: $(cat err)"
rm model.sdm
expect 1 "its model 'run/model\.sdm' is gone: put it there, or into the folder of this file" sdmgen report fit.json --no-model -o page.html
cd ..
sed 's/"model": *"[^"]*", *//' fit.json >exact.json
expect 1 'a fit without a model \(--shape\) has no page' sdmgen report exact.json --no-model -o page.html
sed 's/"rx": /"qx": /' fit.json >other.json
expect 3 "no value of the model's parameter 'rx'" sdmgen report other.json --no-model -o page.html
# A result opens no file whose checksum it does not state: neither another image than that of the fit, nor one without a checksum.
mkdir private
sdmgen phantom --shape ellipsoid -p rx=2.2 -p ry=2.4 -p rz=2.1 --spacing 0.3 --seed 4 -o private/scan.nii.gz >/dev/null
sed "s|ct's.nii.gz|$PWD/private/scan.nii.gz|g" fit.json >stranger.json
expect 0 'private/scan\.nii\.gz has changed since the fit, or is another file.*the page shows none \(--changed-files shows it\)' \
    sdmgen report stranger.json --no-model -o page.html
figures page.html
! grep -q '"image": *{' out || bad 'a file that the fit did not read is in the page'
expect 0 'private/scan\.nii\.gz has changed since the fit$' sdmgen report stranger.json --changed-files --no-model -o page.html
figures page.html
has '"image": *\{"size"'
sed 's/"inputs"/"outputs"/' fit.json >unstated.json
expect 3 'model\.sdm has changed since the fit, or is another file' sdmgen report unstated.json --no-model -o page.html
# the file of the fit in another place, which the result names; an empty name; a device
cp "ct's.nii.gz" private/same.nii.gz
sed "s|ct's.nii.gz|$PWD/private/same.nii.gz|g" fit.json >moved.json
expect 0 - sdmgen report moved.json --no-model -o page.html
[ ! -s err ] || bad "the same image elsewhere: $(cat err)"
figures page.html
has '"image": *\{"size"'
sed "s|\"image\": *\"ct's.nii.gz\"|\"image\": \"/dev/zero\"|" fit.json >device.json
expect 0 "its image '/dev/zero' is gone" sdmgen report device.json --changed-files --no-model -o page.html
# voxels in a second file count as part of the image
sdmgen phantom --shape ellipsoid --spacing 0.3 --seed 5 -o private/ct.mha >/dev/null
start=$(($(grep -abm1 '^ElementDataFile' private/ct.mha | cut -d: -f1)))
{ head -c "$start" private/ct.mha && echo 'ElementDataFile = ct.raw'; } >private/ct.mhd
tail -c "+$((start + 1))" private/ct.mha | sed 1d >private/ct.raw
sdmgen fit $model private/ct.mhd --rotation 0,0,0 --force -o detached.json >/dev/null 2>&1
expect 0 - sdmgen report detached.json --no-model -o page.html
[ ! -s err ] || bad "an image of two files: $(cat err)"
figures page.html
has '"image": *\{"size"'
sdmgen phantom --shape ellipsoid --spacing 0.3 --seed 6 -o private/ct.mha >/dev/null
tail -c "+$((start + 1))" private/ct.mha | sed 1d >private/ct.raw
expect 0 'private/ct\.mhd has changed since the fit, or is another file' sdmgen report detached.json --no-model -o page.html
# texts of a result cannot become code
sed 's/"converged": /"doubt": "<\/script><script>alert(1)<\/script>\\u0007<!--", "converged": /' fit.json >hostile.json
expect 0 - sdmgen report hostile.json --no-model -o hostile.html
[ "$(grep -c '<script>alert' hostile.html)" -eq 0 ] || bad 'a text of a fit is code in the page'

# Lines that the trainer does not write do no harm; a name cannot end the element that holds it.
{ echo '{"phase": "</script><script>alert(1)</script>", "step": 1}' && echo '{"phase": "fit", "step": </script>' && echo; } >>run/metrics.jsonl
expect 0 - sdmgen report run --no-model -o still.html
[ "$(grep -c alert still.html)" -eq 0 ] || bad 'a phase that the trainer does not write is in the page'
# the name of the shape in the model file, with the checksums of its sections left alone, is refused
sed 's/ellipsoid/<\/script>/' $model >named.sdm
expect 3 'named\.sdm: ' sdmgen report named.sdm --no-model -o named.html

if [ "$runtime" != ON ]; then
    expect 1 'built without WebAssembly.*--no-model' sdmgen report $model -o live.html
    finish
    echo 'skipped: no WebAssembly in this build' >&2
    exit 77
fi
expect 0 - sdmgen report run -o live.html
bytes=$(($(stat -c %s live.html) - ($(stat -c %s $model) + 2) / 3 * 4))
[ $bytes -lt 300000 ] || bad "live.html: $bytes bytes without the model"
[ "$failures" -eq 0 ] || finish

chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome)
if [ -z "$chromium" ] || ! command -v node >/dev/null; then
    echo 'skipped: no chromium or no node' >&2
    exit 77
fi
# maps by the network, with the kernels that WebAssembly has, and beyond the trained range by the exact engine
"$baseline" $model native.npy rx=2.6 rz=3.1 >/dev/null
"$baseline" $model beyond.npy rx=4.6 >/dev/null
sdmgen exact --shape ellipsoid -p rx=4.6 --measure --json -o beyond.nrrd >beyond.json
node --no-warnings "$source_folder/tests/cli/page.mjs" "$chromium" || bad 'the page in the browser: see above'
node --no-warnings "$source_folder/tests/cli/page_times.mjs" "$chromium" live.html || bad 'the times of the page: see above'
if firefox=$(command -v firefox-esr || command -v firefox); then
    node "$source_folder/tests/cli/firefox.mjs" "$firefox" || bad 'the page in Firefox: see above'
else
    echo 'not tested in Firefox: firefox-esr is not installed'
fi
finish
