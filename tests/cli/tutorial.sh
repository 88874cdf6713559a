#!/usr/bin/env bash
# docs/tutorial.md and docs/recipes.md word by word: writes their files and runs their commands in their order in a fresh folder, with the installed package. A block
# "```LANGUAGE FILE" is the content of a file, a block "```sh" holds commands; all others are not run.
# Tests: cmd_fit.c cmd_phantom.c shapes_new.c
. "$(dirname "$0")/common.sh"
page=$source_folder/docs/tutorial.md
PREFIX=$(realpath ../files-of-consume/prefix)
export PREFIX PATH=$PREFIX/bin:$PATH

# script PAGE: the page as one script
script()
{
    awk '
    /^```/ && open { if (open == "file") print "END_OF_FILE"; open = ""; next }
    /^```sh$/ { open = "sh"; next }
    /^```[a-z]+ [^ ]+$/ { open = "file"; print "mkdir -p \"$(dirname " $2 ")\"; cat >" $2 " <<\"END_OF_FILE\""; next }
    /^```/ { open = "other"; next }
    open == "sh" || open == "file" { print }' "$1"
}
script "$page" >script
n=$(grep -c '^sdmgen ' script)
[ "$n" -ge 12 ] || bad "only $n commands of sdmgen found in the tutorial"
sdmgen shapes --help | grep -q 'check NAME' || sed -i '/^sdmgen shapes check /d' script # a program without this subcommand
sed -i 's/^  minutes: 1$/  minutes: 0.4/' script # less than half of the time suffices for all that follows
grep -q '^  minutes: 0\.4$' script || bad 'the tutorial does not train for one minute'
mkdir work
(cd work && bash -eux ../script) >out 2>err || bad "$(tail -n 25 err)
its last output: $(tail -n 15 out)"
cp out log

# what the page says about the results
present work/mug.png work/mug.stl work/mug.nrrd work/runs/mug/model.sdm work/runs/mug/slices.png work/big.{vdb,nii.gz,stl} work/fit.{png,stl,json}
sed -n '/^wall 6 mm/,$p' log >out
has '^wall 9 mm: [0-9]+ cm\^3, [0-9.]+ cm\^3 more per mm; in the handle -[345]\.[0-9] mm$'
truth=$(grep -oE '"wall": [0-9.]+' work/truth.json | cut -d' ' -f2)
near "$truth" 8.521 0.001
grep -E '^  wall .* [+]- ' log | awk '{ print $2 }' >walls # of the image and the labels with exact maps, of the image with coarse maps
near "$(sed -n 1p walls)" "$truth" 0.05
near "$(sed -n 2p walls)" "$truth" 0.3
near "$(sed -n 3p walls)" 8.0 0.3
grep -Eq '^exit code 4$' log || bad "the fit with coarse maps is not refused"
grep -Eq 'are coarse beside the (thickness of the shape|details of the shape|point spread of the image): try exact maps' log || bad "the fit with coarse maps does not tell that they are"
rmse=$(sdmgen eval work/runs/mug/model.sdm --samples 20 --naive 0 --json --quiet --plugin work/mug/build/mug.so | grep -oE '"rmse_mm": *[0-9.e-]+' | grep -oE '[0-9.e-]+$')
awk -v e="$rmse" 'BEGIN { exit !(e > 0 && e < 0.3) }' || bad "the root mean square error is '$rmse' mm"

# the recipes go on in the same folder
script "$source_folder/docs/recipes.md" >recipes
n=$(grep -c '^sdmgen ' recipes)
[ "$n" -ge 18 ] || bad "only $n commands of sdmgen found in the recipes"
(cd work && bash -eux ../recipes) >out 2>err || bad "$(tail -n 25 err)
its last output: $(tail -n 15 out)"
present work/nine.png work/map.{nii.gz,vdb,stl,seg.nrrd,png,npy} work/compare/compare.png work/exact.nrrd work/{fine,like}.n* work/at{,-exact}.csv \
    work/by-network.npy work/exactly.npy work/shape0{1,2}.stl work/{image,labels,points}.json
has '^fine: '
has '^at radius=38 height=85 wall=8 reach=28, against the exact map$'
work/own/build/own work/mug/build/mug.so jug 2>err && bad 'own/own finds the shape jug'
grep -qx "own: unknown shape 'jug'; the shapes are mug" err || bad "the message of own/own about an unknown shape: $(cat err)"
[ "$(grep -c '^  wall .* truth 8.5212, off by [0-3]' out)" = 3 ] || bad "not three fits that find the wall"
if python3 -c 'import numpy' 2>/dev/null; then # the same volumes and derivatives as the C program
    # after a training on a busy machine the C program says first that the model is not for derivatives of volumes
    (cd work && PYTHONPATH=$PREFIX/lib/python3/dist-packages python3 use.py >use.txt && use/build/use runs/mug/model.sdm | sed '1{/^derivatives of volumes of its maps are off by /d}' | cmp - use.txt) || bad "C and Python differ"
fi
finish
