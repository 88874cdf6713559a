#!/usr/bin/env bash
# sdmgen fit: which options apply to which kind of target, against the table in docs/fitting-reference.md.
# Tests: fit_grid.c fit_applies.c fit_size.c fit_labels.c fit_target.c option_names.c
. "$(dirname "$0")/common.sh"
shape='--shape ellipsoid -O edge=0.6 -p rx=3 -p ry=2 -p rz=2'
expect 0 - sdmgen phantom $shape --spacing 0.8 -o image.nii --label labels.nii --quiet
printf 'x,y,z\n3,0,0\n0,2,0\n0,0,2\n-3,0,0\n' >points.csv
sdmgen mesh $shape -o mesh.ply --quiet >out

targets=('image.nii' 'image.nii --image-model labels' 'labels.nii --label 1' 'labels.nii --label 1 --image-model labels' 'points.csv' 'mesh.ply')
declare -A value=([--region]=-9,-9,-9,9,9,9 [--margin]=1.2 [--least-inside]=0.5 [--image-model labels]= [--inside]=40,170 [--outside]=1300,270
    [--air]=-880,150 [--cavity]=3 [--tissue-places]=1 [--blur]=0.4 [--keep blur]= [--l-ref]=0.2 [--keep appearance]= [--point-sd]=0.1
    [--beside]=0.5 [--find]= [--open-end]=)

# Every cell of the table. The fit ends at a missing file of start points, after its options were checked.
rows=0
while IFS='|' read -r _ options yes_no; do
    mapfile -t cells < <(tr '|' '\n' <<<"$yes_no" | tr -d ' ' | grep -E '^(yes|no)$')
    cells+=("${cells[4]}") # one column for meshes and points
    while read -r option; do
        rows=$((rows + 1))
        [ -n "${value[$option]+there}" ] || bad "no value for $option"
        for i in "${!targets[@]}"; do
            given="$option ${value[$option]}"
            [[ ${targets[i]} != *"$option"* ]] || given='' # the target has the option already
            if [ "${cells[i]} $option" = 'yes --find' ]; then
                expect 2 '^sdmgen: error: fit: --find searches for the start: leave --start-points out' \
                    sdmgen fit $shape ${targets[i]} --find --start-points missing.csv
            elif [ "${cells[i]}" = yes ]; then
                expect 1 'missing.csv: ' sdmgen fit $shape ${targets[i]} $given --start-points missing.csv
            else
                expect 2 "^sdmgen: error: fit: $option does nothing in a fit to [a-z]+( with --image-model labels)?; of the options .* apply: --" \
                    sdmgen fit $shape ${targets[i]} $given --start-points missing.csv
            fi
        done
    done < <(grep -o '`--[^`]*`' <<<"$options" | tr -d '`')
done < <(sed -n '/^| option | image |/,/^$/p' "$source_folder/docs/fitting-reference.md" | tail -n +3 | grep '^|')
[ "$rows" -eq "${#value[@]}" ] || bad "$rows options in docs/fitting-reference.md, ${#value[@]} here"
expect 2 'these apply: --keep appearance, --point-sd$' sdmgen fit $shape points.csv --cavity 2
# --ras is about points and about coordinates of the command line
expect 2 '--ras .*does nothing in a fit to image' sdmgen fit $shape image.nii --ras --start-points missing.csv
expect 1 'missing.csv: ' sdmgen fit $shape points.csv --ras --start-points missing.csv

# an image in metres
sdmgen phantom $shape --spacing 0.8 -o image.mha --quiet
sed 's/^ElementSpacing = .*/ElementSpacing = 0.0008 0.0008 0.0008/' image.mha >metres.mha
sdmgen fit $shape metres.mha --rotation 0,0,0 --max-iterations 1 --quiet >out 2>err && bad 'an image in metres is accepted'
grep -q 'error: metres.mha: the image measures 0.0[0-9]* mm across, its voxels 0.0008 mm, the start shape [0-9.]* mm: are they in m? lengths are mm; --force fits nevertheless' err ||
    bad "image in metres: $(cat err)"
# without values of the tissues a notice says which are taken; labels and images in each other's place
sdmgen fit $shape image.nii --rotation 0,0,0 --max-iterations 1 >out 2>err
grep -q 'image measures' err && bad "image in millimetres: $(cat err)"
grep -q -- '--inside and --outside are not given: the fit starts from inside 40 +- 170, outside 1300 +- 270' err || bad "tissues: $(cat err)"
sdmgen fit $shape image.nii --rotation 0,0,0 --max-iterations 1 --inside 40,170 >out 2>err
grep -q -- '--outside is not given' err || bad "one tissue: $(cat err)"
sdmgen fit $shape image.nii --rotation 0,0,0 --max-iterations 1 --inside 40,170 --outside 1300,200 >out 2>err
grep -q 'not given: the fit' err && bad "given tissues: $(cat err)"
# labels of 0 and 1 are no image, unless values of tissues say so
expect 2 'labels.nii holds only the values 0 and 1, as labels do: --label 1 fits to them; --inside and --outside fit to them as to an image$' \
    sdmgen fit $shape labels.nii --rotation 0,0,0
sdmgen fit $shape labels.nii --rotation 0,0,0 --max-iterations 1 --inside 1,0.1 --outside 0,0.1 >out 2>err
grep -q 'labels.nii holds only 2 different values, 0 to 1: if it is a label map, give --label with the value of the shape, e.g. --label 1$' err ||
    bad "labels as an image: $(cat err)"
grep -q '^sdmgen: error: labels.nii: .*; if the file is a label map, give --label$' err || bad "labels as an image, at the end: $(cat err)"
expect 3 "image.nii: no voxel has the label '31000' .*if it is an image, leave --label out" sdmgen fit $shape image.nii --label 31000
sdmgen phantom $shape --spacing 0.3 -o fine.nii --quiet
expect 2 'fine.nii: the voxels with this label lie scattered, and the file holds over 1000 different values, or fractions: it is an image; leave --label out' \
    sdmgen fit $shape fine.nii --label "$(sdmgen info fine.nii --json | sed 's/.*"max": *\([-0-9]*\).*/\1/')" --rotation 0,0,0

# a mesh in metres or micrometres
sed 's/\([0-9.-]\{1,\}\)/\1e-3/g; 1s/.*/x,y,z/' points.csv >metres.csv
sed 's/\([0-9.-]\{1,\}\)/\1e3/g; 1s/.*/x,y,z/' points.csv >micro.csv
sdmgen fit $shape metres.csv --rotation 0,0,0 --max-iterations 1 --quiet >out 2>err && bad 'points in metres are accepted'
grep -q 'error: metres.csv: the points measure 0.00[0-9]* mm across, the start shape [0-9.]* mm: are they in m? or is it another shape? lengths are mm; --force fits nevertheless' err || bad "metres: $(cat err)"
sdmgen fit $shape metres.csv --rotation 0,0,0 --max-iterations 1 --quiet --force >out 2>err
grep -q 'warning: metres.csv: the points measure' err || bad "metres with --force: $(cat err)"
expect 2 'error: micro.csv: .* are they in um\?' sdmgen fit $shape micro.csv --rotation 0,0,0 --quiet
grep -q 'are they in um?' err || bad "micrometres: $(cat err)"
sdmgen fit $shape points.csv --rotation 0,0,0 --max-iterations 1 --quiet >out 2>err
grep -q 'lengths are mm' err && bad "millimetres: $(cat err)"
# degrees where radians are wanted, and fewer points than unknowns
expect 2 "--rotation '0,0,90': need three numbers X,Y,Z in radians, .* \(90 degrees are 1.5708\)" sdmgen fit $shape points.csv --rotation 0,0,90
expect 4 'points.csv: [0-4] points on the surface cannot determine [6-9] unknowns' sdmgen fit $shape points.csv --rotation 0,0,0 --quiet
# options have the names of the command line
sdmgen fit $shape image.nii --rotation 0,0,0 --spacing 0.8 --max-iterations 1 --quiet >out 2>err
grep -q -- '(--max-iterations)' err || bad "no option in: $(cat err)"
# a reference that is no label map, and a margin that shows nothing beside the surface
expect 0 - sdmgen exact $shape --spacing 0.4 -o map.nii --quiet
sdmgen fit $shape image.nii --rotation 0,0,0 --spacing 0.8 --max-iterations 1 --quiet --reference map.nii --margin 0.1 >out 2>err
grep -q 'warning: map.nii holds over [0-9]* different values, or fractions: --reference needs labels' err || bad "an image as reference: $(cat err)"
grep -q 'warning: --margin 0.1 mm is less than 1.5 voxels of' err || bad "a small margin: $(cat err)"
expect 2 'error: map.nii is a signed distance map, no image: fit the surface' sdmgen fit $shape map.nii --rotation 0,0,0 --max-iterations 1
grep -qE 'sdm_fit_(opts|source)' out err && bad "names of C: $(cat out err)"
# exact maps follow the thinnest part; --spacing decides, and points need no voxels
thin='--plugin ../../plugins/faulty/faulty.so --shape faulty -O fault=wall -p size=1.8 --rotation 0,0,0 --translation 0,0,0 --keep pose'
sdmgen phantom ${thin% --rotation*} --spacing 0.4 -o wall.nii --quiet >out 2>err || bad "wall: $(cat err)"
sdmgen fit $thin wall.nii --max-iterations 1 >out 2>err
has '^  maps .* by the exact engine, voxels of 0\.0[0-9]* mm, because the thinnest part is 0\.1 mm thick$'
sdmgen fit $thin wall.nii --max-iterations 1 --spacing 0.2 >out 2>err
has '^  maps .* by the exact engine, voxels of 0\.2 mm$'
has '^  map voxels .*: the voxels of the maps are coarse beside the thinnest part of the shape: .*--exact --spacing'
sdmgen fit $thin points.csv --max-iterations 1 >out 2>err
has '^  maps .* by the exact engine$'
finish
