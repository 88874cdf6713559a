#!/usr/bin/env bash
# No output overwrites an input or another output, whatever the names of the files.
# Tests: files.c generate_files.c
. "$(dirname "$0")/common.sh"
small='--shape ellipsoid --spacing 0.5'

expect 0 - sdmgen mesh --shape ellipsoid -o m.stl
expect 0 - sdmgen phantom $small -o in.nrrd --label lab.nrrd
mkdir folder && ln -s ../in.nrrd folder/link.nrrd && ln -s . folder/here
before=$(cksum m.stl in.nrrd lab.nrrd)

# Outputs that are inputs.
over="would overwrite the input '(m\.stl|\.\./files-of-files/m\.stl|in\.nrrd|folder/link\.nrrd|lab\.nrrd)'"
expect 2 "$over" sdmgen exact --mesh m.stl -o m.stl
expect 2 "$over" sdmgen exact --mesh ../files-of-files/m.stl --spacing 1 -o d.npy -o "$PWD/m.stl"
expect 2 "$over" sdmgen fit --shape ellipsoid in.nrrd -o ./in.nrrd
expect 2 "$over" sdmgen fit --shape ellipsoid folder/link.nrrd -o in.nrrd
expect 2 "$over" sdmgen fit --shape ellipsoid in.nrrd --reference lab.nrrd -o lab.nrrd
expect 2 "$over" sdmgen fit --shape ellipsoid in.nrrd --reference lab.nrrd --label-out folder/../lab.nrrd
expect 2 "would overwrite the input 'm.stl'" sdmgen mesh --shape statistical -O mean=m.stl -O deviations=none.npy -o m.stl

# Two outputs that are the same file, existing or new.
twice="is given twice, also as '"
expect 2 "'\./q\.npy' $twice" sdmgen exact --shape torus -o q.npy --closest ./q.npy
expect 2 "'folder/here/q\.npy' $twice" sdmgen exact --shape torus -o folder/q.npy --closest folder/here/q.npy
expect 2 "'\./p\.nrrd' $twice" sdmgen phantom $small -o p.nrrd --label ./p.nrrd
expect 2 "'\./t\.json' $twice" sdmgen fit --shape ellipsoid in.nrrd -o t.json -o ./t.json
expect 2 "'\./o\.nrrd' $twice" sdmgen fit --shape ellipsoid in.nrrd -o o.nrrd --label-out ./o.nrrd
[ "$before" = "$(cksum m.stl in.nrrd lab.nrrd)" ] || bad 'an input was overwritten'
absent q.npy folder/q.npy d.npy p.nrrd t.json o.nrrd

# The same name in another folder is another file, and an older result may be replaced.
expect 0 - sdmgen exact --shape torus -o q.npy --closest folder/q.npy
expect 0 - sdmgen exact --shape torus -o q.npy --closest folder/q.npy
present q.npy folder/q.npy
expect 1 'none/q\.npy' sdmgen exact --shape torus -o none/q.npy
finish
