#!/usr/bin/env bash
# docs/command-line.md, keys of the JSON: every key that a command prints is in the row of the command or in that of the common objects.
# Tests: json_values.c report_image.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive
page=$source_folder/docs/command-line.md
sed -n '/^## Keys of the JSON$/,/^<!-- begin/p' "$page" | grep '^| ' >rows

# words NAME: the words in backticks of the row NAME and of the rows "NAME: ...".
words() { awk -F ' [|] ' -v name="| $1" '{ sub(/ \(\[[^|]*\)$/, "", $1) } $1 == name || index($1, name ": ") == 1 { print $2 }' rows | grep -oE '`[^`]+`' | grep -oE '[A-Za-z_0-9]+' | sort -u; }

# documented ROW COMMAND...: all keys of the JSON that COMMAND prints are in ROW; names of parameters and options are no keys.
documented() {
    local row=$1
    shift
    "$@" >out 2>err || bad "$*: exit code $? ($(cat err))"
    [ -n "$(words "$row")" ] || bad "no row '$row'"
    { words "$row" && words 'all'; } | sort -u >known
    sed -E 's/"(parameters|parameters_sd|options|at|figures)": *\{[^}]*\}/"\1": 0/g' out | grep -oE '"[A-Za-z_0-9]+": ' | tr -d '": ' | sort -u >printed
    [ "$(wc -l <printed)" -ge 3 ] || bad "$*: few keys: $(cat out)"
    [ -z "$(comm -13 known printed)" ] || bad "not in the row '$row' of docs/command-line.md: $(comm -13 known printed | tr '\n' ' ')"
}

model=$source_folder/tests/golden/pod_f32.sdm
documented exact sdmgen exact --shape torus --size 12,12,8 --certify --measure --json -o map.nrrd
volume=$(json volume_mm3)
documented 'info of an image' sdmgen info map.nrrd --json
near "$(json volume_mm3)" "$volume" 1e-9
sdmgen info map.nrrd >out
has "^volume +$(printf '%.6g' "$volume" | sed 's/\./\\./') mm\^3 inside the surface$"
documented 'mesh, info of a mesh' sdmgen mesh --shape torus --json -o torus.ply
documented 'mesh, info of a mesh' sdmgen info torus.ply --json
documented 'info of a model' sdmgen info "$model" --json
documented shapes sdmgen shapes --json
documented 'shapes NAME' sdmgen shapes cochlea --json
documented 'shapes new' sdmgen shapes new knob --json
documented 'shapes check' sdmgen shapes check torus --samples 4 --json
documented generate sdmgen generate "$model" --measure --json
documented dataset sdmgen dataset "$source_folder/tests/cli/tiny.yaml" data.static=1 -o shards --maps 1 --json -q
documented 'train --plan' sdmgen train "$source_folder/tests/cli/tiny.yaml" --plan --json -q
documented verify sdmgen verify map.nrrd --json
documented phantom sdmgen phantom --shape ellipsoid -O edge=0.6 -p rx=3 -p ry=2 -p rz=2 --spacing 0.8 -o ct.nii --label label.nii --json
sdmgen info ct.nii --json | grep -q volume_mm3 && bad 'an image of a scanner has a volume'
# the labels 0 and 1 of a segmentation are no distances: its volume is that of its voxels
sdmgen exact --shape ellipsoid -p rx=3 -p ry=2 -p rz=1.5 --spacing 0.21 -o part.seg.nrrd -q
sdmgen info part.seg.nrrd >out
grep -q 'inside the surface' out && bad "labels as distances: $(cat out)"
near "$(sed -n 's/.*, its voxels have \(.*\) mm^3$/\1/p' out)" 37.7 1
documented fit sdmgen fit --shape ellipsoid -O edge=0.6 -p rx=3 -p ry=2 -p rz=2 label.nii --label 1 --rotation 0,0,0 --spacing 0.8 --measure --json
sdmgen phantom --shape cochlea --spacing 0.6 -o ear.nii -q
documented fit sdmgen fit --shape cochlea -O ear=right ear.nii --open-end --keep parameters --rotation 0,0,0 --spacing 0.6 --json
[ "$(json beyond_open_end)" -gt 50 ] || bad "no voxels beyond the open end: $(cat out)"
sdmgen fit --shape cochlea -O ear=right ear.nii --open-end --keep parameters --rotation 0,0,0 --spacing 0.6 -q >out 2>err
has '^image: [0-9]+ voxels near the shape, [0-9]+ left out beyond the open end, '
expect 2 'ear.nii: --open-end: the shape states no open end, as cochlea and duct do and plug-ins may .*; leave it out$' sdmgen fit --shape ellipsoid ear.nii --open-end --rotation 0,0,0 --start-centre 0,0,0 --inside 40,170 --outside 1300,270
printf 'id,image,label\na,label.nii,1\n' >cohort.csv
documented 'fit --cases' sdmgen fit --shape ellipsoid -O edge=0.6 -p rx=3 -p ry=2 -p rz=2 --rotation 0,0,0 --spacing 0.8 --cases cohort.csv -o cohort --json
documented collect sdmgen collect cohort --json
for rx in 2 3 4; do sdmgen mesh --shape ellipsoid -O edge=1 -p rx=$rx -o m$rx.ply -q; done
mkdir meshes && mv m?.ply meshes
documented 'import ssm, info of a shape model' sdmgen import ssm meshes -o model.ssm --json
documented 'import ssm, info of a shape model' sdmgen info model.ssm --json
documented 'bench exact' sdmgen bench exact --shape torus --size 12,12,12 --repeat 1 --json
documented train sdmgen train "$source_folder/tests/cli/tiny.yaml" train.steps=20 --out run --json --quiet
documented eval sdmgen eval run/model.sdm --samples 2 --naive 0 --json
documented generate sdmgen generate run/model.sdm --check --json
documented verify sdmgen verify run/model.sdm --samples 2 --json
finish
