#!/usr/bin/env bash
# The gallery, with tiny networks: docs/gallery/make.sh --fast writes all pages, and each runs in chromium without a complaint, with the maps
# of the program. Third argument: baseline_map; fourth: whether this build has the runtime for pages.
# Tests: page_report.c
baseline=$3
runtime=$4
. "$(dirname "$0")/common.sh"
make=$source_folder/docs/gallery/make.sh

expect 2 'usage: make\.sh \[--fast\] \[FOLDER\]' "$make" --slow
expect 1 'no program none: build it' env SDMGEN=none "$make" --fast pages
if [ "$runtime" != ON ]; then
    finish
    echo 'skipped: no WebAssembly in this build' >&2
    exit 77
fi
SDMGEN=$program "$make" --fast pages >out 2>err || bad "make.sh: $(tail -n 3 err)"
for name in cochlea linkage statistical gear index; do
    present pages/$name.html
    grep -q "/$name\.html$" out || bad "make.sh does not name $name.html"
done
[ "$(grep -c '<li><a href="[a-z]*\.html">.*error [0-9.]* mm' pages/index.html)" -eq 4 ] || bad 'not four pages in the index'
# finished models are kept
SDMGEN=$program "$make" --fast pages >out 2>err || bad "make.sh again: $(tail -n 3 err)"
! grep -q 'held out' out || bad 'make.sh trains again'
[ "$failures" -eq 0 ] || finish

chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome)
if [ -z "$chromium" ] || ! command -v node >/dev/null; then
    echo 'skipped: no chromium or no node' >&2
    exit 77
fi
"$baseline" pages/runs/linkage/model.sdm linkage.npy q1=0.5 >/dev/null
"$baseline" pages/runs/statistical/model.sdm statistical.npy m1=0.5 >/dev/null
"$baseline" pages/runs/cochlea/model.sdm cochlea.npy a=3.5 >/dev/null
sdmgen exact --shape cochlea -p a=3.5 --measure --depth 10 --json -o cochlea.nrrd >cochlea.json
node --no-warnings "$source_folder/tests/cli/gallery.mjs" "$chromium" || bad 'the gallery in the browser: see above'
finish
