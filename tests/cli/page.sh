#!/usr/bin/env bash
# Pages of models and runs: their files, their text, and the page itself in chromium (page.mjs), where the model must give the same map as
# the program for the same kernels (third argument). The part in the browser is skipped without chromium or Node.js; fourth argument: whether
# this build has the runtime for pages.
# Tests: cmd_report.c page_figures.c page_history.c page_still.c page_write.c
baseline=$3
runtime=$4
. "$(dirname "$0")/common.sh"

expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" shape.name=ellipsoid "shape.ranges.rx=[2, 4]" --out run --quiet
model=run/model.sdm

# Mistakes, each with one message and no file.
expect 2 'need one output: -o FILE\.html' sdmgen report $model --no-model
expect 2 'need one output: -o FILE\.html' sdmgen report $model --no-model -o page.pdf
expect 2 'need one output: -o FILE\.html' sdmgen report $model --no-model -o a.html -o b.html
expect 1 'missing\.sdm: cannot open' sdmgen report missing.sdm --no-model -o page.html
mkdir empty
expect 1 'empty: no model\.sdm in this folder' sdmgen report empty --no-model -o page.html
echo '{}' >fit.json
expect 1 'fit\.json: there are no pages of fits yet' sdmgen report fit.json --no-model -o page.html
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
sdmgen generate $model -o surface.ply
expect 0 - sdmgen mesh --mesh surface.ply --json
volume=$(json volume_mm3)
figures still.html
near "$(json volume_mm3)" "$volume" 1e-3
expect 0 - sdmgen report $model --no-model -o of_model.html
figures of_model.html
! grep -q '"history"' out || bad 'a page of a model without its run has a history'

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
node --no-warnings "$source_folder/tests/cli/page.mjs" "$chromium" || bad 'the page in the browser: see above'
finish
