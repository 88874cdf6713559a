#!/usr/bin/env bash
# sdmgen info and verify on images: files of the program, files assembled here, and files that are refused.
# Tests: cmd_info.c cmd_verify.c report_image.c
. "$(dirname "$0")/common.sh"

# A tetrahedron with three faces that meet at right angles at the origin.
printf 'OFF\n4 4 0\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n' >t.off
expect 0 - sdmgen exact --mesh t.off --size '9,10,11' --spacing 0.5 --origin '-2,-2.25,-2.5' --quiet \
    -o m.nii -o m.nii.gz -o m.nrrd -o m.mha --json
deepest=$(json min_mm)
for file in m.nii m.nii.gz m.nrrd m.mha; do
    expect 0 - sdmgen info $file
    has "^$file: image of float32 voxels\$"
    has '^grid +9 x 10 x 11 voxels \(990\) of 0.5 x 0.5 x 0.5 mm$'
    has '^origin +-2 -2.25 -2.5 '
    has 'x along 1 0 0$'
    expect 0 - sdmgen info $file --json
    near "$(json min)" "$deepest" 1e-6
    [ "$(json type)" = image ] && [ "$(json placed)" = true ] && [ "$(json voxel_type)" = float32 ] || bad "$(cat out)"
    expect 0 - sdmgen verify $file
    has 'complete: 9 x 10 x 11 float32 voxels'
done
expect 0 - sdmgen verify m.nrrd
has 'the checksum of the compressed data is right'
expect 0 - sdmgen verify m.mha --json
[ "$(json ok)" = true ] && [ "$(json checksum)" = false ] || bad "$(cat out)"

# A segmentation with two layers whose axis comes first, in RAS.
{
    printf 'NRRD0005\ntype: uchar\ndimension: 4\nspace: RAS\nsizes: 2 1 2 1\nspace directions: none (1,0,0) (0,2,0) (0,0,3)\n'
    printf 'encoding: raw\nspace origin: (5,6,7)\nSegment0_ID:=a\nSegment0_Name:=first\nSegment1_ID:=b\nSegment1_Name:=second\n\n\001\002\003\004'
} >s.seg.nrrd
expect 0 - sdmgen info s.seg.nrrd
has 'uint8 voxels, 2 layers$'
has '^origin +-5 -6 7 '
has "'second' \(b\): value 1 in layer 1"
has '^values +1 \.\. 4$'

# Large volumes have digits, no exponent: a cube of 200 mm.
{
    printf 'OFF\n8 12 0\n'
    for z in 0 200; do for y in 0 200; do for x in 0 200; do echo $x $y $z; done; done; done
    printf '3 %s\n' '0 2 3' '0 3 1' '4 5 7' '4 7 6' '0 1 5' '0 5 4' '2 6 7' '2 7 3' '0 4 6' '0 6 2' '1 3 7' '1 7 5'
} >large.off
expect 0 - sdmgen mesh --mesh large.off --audit
has '^volume +8000000 mm\^3, '
has '^area +240000 mm\^2$'
has '^  1 .* 8000000 +0 0 0 \.\. 200 200 200$'
expect 0 - sdmgen exact --mesh large.off --spacing 8 --size 32,32,32 --origin -26,-26,-26 -o large.nrrd
expect 0 - sdmgen info large.nrrd
has '^volume +[78][0-9]{6} mm\^3 inside the surface$'

# Damaged, unsupported and missing files.
head -c 300 m.nii.gz >cut.nii.gz
expect 3 'cut\.nii\.gz: the compressed data are cut off' sdmgen info cut.nii.gz
expect 3 'cut\.nii\.gz' sdmgen verify cut.nii.gz --json
[ ! -s out ] || bad "a report of a damaged file: $(cat out)"
sed 's/LOCAL/..\/m.raw/' m.mha >away.mha
expect 1 'another folder' sdmgen info away.mha
expect 1 'none\.nrrd: cannot open' sdmgen verify none.nrrd
# several files: a line each, each failure with its error, the highest exit code
expect 0 - sdmgen verify m.nrrd m.mha
[ "$(grep -c '^m\.\(nrrd\|mha\): complete: ' out)" -eq 2 ] || bad "not a line for each of two files: $(cat out)"
sdmgen verify none.nrrd m.nrrd cut.nii.gz none.nrrd >out 2>err
code=$?
[ $code -eq 3 ] || bad "exit code $code instead of the highest of 1, 0, 3 and 1: $(cat err)"
has '^m\.nrrd: complete: '
[ "$(wc -l <out) $(grep -c 'none\.nrrd: cannot open' err) $(grep -c 'cut\.nii\.gz' err)" = '1 2 1' ] || bad "files and failures: $(cat out err)"
grep -q '^sdmgen: error: verify: 3 of 4 files are not right$' err || bad "no sum of the failures: $(cat err)"
expect 0 - sdmgen exact --shape torus -o map.npy
for command in info verify; do
    expect 3 'map\.npy: not a model file .*; its name is neither that of a level set \(\.vdb\) nor of an image \(\.nii ' sdmgen $command map.npy
done
expect 0 - sdmgen exact --shape torus --size 12,10,8 --quiet -o plain.nii
expect 2 '--samples does nothing for plain.nii' sdmgen verify plain.nii --samples 5
finish
