#!/usr/bin/env bash
# A shape outside of the source tree: the plug-in of examples/gear and its configuration, from the list of shapes to the maps of a network.
# Tests: config_shape.c setup.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
config=$source_folder/examples/gear/gear.yaml
plugin=../../plugins/gear/gear.so
small=(grid.size='[12, 12, 6]' grid.spacing=0.9 network='{depth: 1, width: 16, modes: 16, degree: 2, input_degree: 2}'
    data='{static: 2, start: 24, online: 16, holdout: 4}' train='{steps: 20, batch: 8}')

expect 0 - sdmgen shapes gear -O teeth=20 --plugin $plugin
has '^  angle +rad +-0\.15708 \.\. 0\.15708'
expect 0 - sdmgen config "$config" --plugin $plugin
has 'no mistakes$'
expect 0 - sdmgen mesh --shape gear -p angle=0.1 --audit --plugin $plugin
has '^closed +yes'
has '^self-intersections +0$'
expect 5 "shape 'gear': parameter 'angle' = 0\.2 rad, allowed " sdmgen mesh --shape gear -O teeth=20 -p angle=0.2 --audit --plugin $plugin
expect 2 "option 'teeth' is 3, need 6 \.\. 100" sdmgen mesh --shape gear -O teeth=3 --audit --plugin $plugin

expect 2 "unknown shape 'gear'; .* --plugin FILE" sdmgen config "$config"
# A plug-in that does not hold the shape of the configuration is told.
expect 0 "^sdmgen: shape 'cochlea' of .* is not from --plugin, which holds gear: it is from the program\$" \
    sdmgen config "$source_folder/tests/cli/tiny.yaml" --plugin $plugin
expect 0 - sdmgen train "$config" "${small[@]}" --plugin $plugin --out run --quiet
has '(^  not for)? +its thinnest part and volumes of surfaces \(\.stl\): it is [0-9.]+ mm thick in a few held-out shapes, too thin for voxels of 0\.9 mm, and will be missing or broken; grid\.spacing 0\.5[0-9]* shows it'
has '^  verdict     .*lower grid\.spacing from 0\.9 to 0\.5'
# the whole report names one spacing
spacings=$(grep -oE 'grid\.spacing (from 0\.9 to )?[0-9.]*[0-9]|grid\.spacing=[0-9.]+' out | sed 's/.*[ =]//' | sort -u)
[ "$(echo "$spacings" | wc -l)" -eq 1 ] || bad "several spacings, $spacings: $(cat out)"
has '^  (next|better) +sdmgen train .*gear\.yaml .*=[0-9.]+( network\.kind=(pod|template))? --plugin .*\.so --out run-2 --compare run/model.sdm$|^  (next|better) +sdmgen train .*grid=\{spacing: [0-9.]+\}.* --plugin .*\.so --out run-2 --compare run/model.sdm$'
expect 0 - sdmgen generate run/model.sdm -p angle=0.1 -o map.npy
expect 0 'warning: gear\.stl: the surface encloses .* than the shape, .*: voxels of 0\.9 mm cut its edges and thin parts; about 1 % for this shape with --spacing 0\.[0-9]+$' sdmgen generate run/model.sdm -o gear.stl --plugin $plugin
present map.npy
# without the shape the error that the training has measured is told
expect 0 'warning: alone\.stl: the training found volumes of such surfaces off by [0-9.]+ % \(root mean square\); --plugin ' sdmgen generate run/model.sdm -o alone.stl
# measures are those of the shape itself
expect 3 "^sdmgen: error: --measure needs the exact shape: .*'gear', which is not known here: load its plug-in \(--plugin FILE\)" sdmgen generate run/model.sdm --measure
expect 3 "^sdmgen: error: --measure needs the exact shape: .*'gear', which is not known here: load its plug-in \(--plugin FILE\)" sdmgen fit run/model.sdm map.npy --measure
# a fit without the plug-in says that the check of the network is missing; this poor network may be refused
sdmgen phantom --shape gear --plugin $plugin --surface points.csv --surface-points 400 -o scan.nii --quiet || bad 'no points of a gear'
sdmgen fit run/model.sdm points.csv --rotation 0,0,0 --quiet >out 2>err
has "^  network bias not tested: the exact shape 'gear' is not known here, .*; load its plug-in \(--plugin FILE\)$"
sdmgen fit run/model.sdm points.csv --rotation 0,0,0 --quiet --plugin $plugin >out 2>err
[ "$(grep -c 'not tested' out)" -eq 0 ] || bad "the check is there with the plug-in: $(cat out)"
expect 0 - sdmgen generate run/model.sdm -p angle=0.1 --measure --plugin $plugin
has '^  volume +[0-9.]+ mm\^3$'
expect 0 - sdmgen eval run/model.sdm --samples 2 --naive 0 --json --quiet --plugin $plugin
awk -v e="$(json mse_mm2)" 'BEGIN { exit !(e > 0 && e < 1) }' || bad "the mean square error is $(json mse_mm2) mm^2"
finish
