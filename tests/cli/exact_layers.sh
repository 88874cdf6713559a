#!/usr/bin/env bash
# sdmgen exact --closest --normal --triangle --jacobian: shapes and values of the arrays, mistakes, no partial files.
# Tests: exact_layers.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes

# numbers FILE COUNT TYPE: the last COUNT values of the file, one per line.
numbers() { od -An -v -t "$3" -w4 -j $(($(wc -c <"$1") - 4 * $2)) "$1" | tr -d ' '; }
header() { head -c 128 "$1" | tr -d '\0' | grep -a -o "{.*}"; }

# A pyramid: base 4 x 4 at z = 0 made of two triangles, sides inclined by 45 degrees, apex at z = 2.
cat >pyramid.off <<'END'
OFF
5 6 0
-2 -2 0
2 -2 0
2 2 0
-2 2 0
0 0 2
3 0 2 1
3 0 3 2
3 0 1 4
3 1 2 4
3 2 3 4
3 3 0 4
END
# A column of voxels: below the base, next to its diagonal, and above the side of triangle 3 (towards +x).
expect 0 - sdmgen exact --mesh pyramid.off --size 1,1,3 --spacing 1 --origin '1,-0.5,-3' --quiet -o d.npy \
    --closest c.npy --normal n.npy --triangle t.npy
present d.npy c.npy n.npy t.npy
[ "$(header c.npy)" = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 1, 1, 3), }" ] || bad "c.npy: $(header c.npy)"
[ "$(header t.npy)" = "{'descr': '<u4', 'fortran_order': False, 'shape': (3, 1, 1), }" ] || bad "t.npy: $(header t.npy)"
[ "$(numbers d.npy 3 f4 | xargs)" = '3 2 1' ] || bad "distances: $(numbers d.npy 3 f4 | xargs)"
[ "$(numbers t.npy 3 u4 | xargs)" = '0 0 0' ] || bad "triangles: $(numbers t.npy 3 u4 | xargs)"
numbers c.npy 9 f4 | awk '{ w = NR % 3 == 1 ? 1 : NR % 3 == 2 ? -0.5 : 0; if ($1 - w > 1e-6 || w - $1 > 1e-6) exit 1 }' ||
    bad "closest points: $(numbers c.npy 9 f4 | xargs)"
numbers n.npy 9 f4 | awk '{ w = NR % 3 == 0 ? -1 : 0; if ($1 - w > 1e-6 || w - $1 > 1e-6) exit 1 }' ||
    bad "normals: $(numbers n.npy 9 f4 | xargs)"
expect 0 - sdmgen exact --mesh pyramid.off --size 1,1,1 --spacing 1 --origin '3,0.1,2' --quiet --normal n.npy --triangle t.npy
[ "$(numbers t.npy 1 u4)" = 3 ] || bad "triangle towards +x: $(numbers t.npy 1 u4)"
numbers n.npy 3 f4 | awk '{ w = NR == 2 ? 0 : sqrt(0.5); if ($1 - w > 1e-6 || w - $1 > 1e-6) exit 1 }' ||
    bad "normal towards +x: $(numbers n.npy 3 f4 | xargs)"

# Triangle numbers are those of the mesh file, also when surface inside of the union is removed: add a second pyramid, 1 mm higher.
awk 'NR == 2 { print "10 12 0"; next } { print } NR > 2 && NR < 8 { v[NR] = $1 " " $2 " " $3 + 1 }
     NR == 7 { for (i = 3; i < 8; i++) print v[i] } NR > 7 { t[NR] = "3 " $2 + 5 " " $3 + 5 " " $4 + 5 }
     END { for (i = 8; i < 14; i++) print t[i] }' pyramid.off >two.off
expect 0 - sdmgen exact --mesh two.off --size 1,1,1 --spacing 1 --origin '3,0.1,3' --quiet --triangle t.npy
[ "$(numbers t.npy 1 u4)" = 9 ] || bad "triangle of the second pyramid: $(numbers t.npy 1 u4)"

# Torus: d = hypot(r - major, z) - minor.
expect 0 'leaves the grid' sdmgen exact --shape torus -O edge=0.05 --size 9,8,7 --spacing 1 --quiet --json --jacobian j.npy
[ "$(header j.npy)" = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 7, 8, 9), }" ] || bad "j.npy: $(header j.npy)"
numbers j.npy 1008 f4 | awk 'NR > 504 && ($1 < -1.001 || $1 > -0.999) || $1 < -1.001 || $1 > 1.001 { print NR, $1; exit 1 }' ||
    bad 'derivatives of the torus'
one=$(json values_crc64)
expect 0 'leaves the grid' sdmgen exact --shape torus -O edge=0.05 --size 9,8,7 --spacing 1 --quiet --json
[ "$one" = "$(json values_crc64)" ] || bad 'the map differs when layers are written with it'
cp j.npy kept.npy
expect 0 'leaves the grid' sdmgen exact --shape torus -O edge=0.05 --size 9,8,7 --spacing 1 --quiet --jacobian j.npy --threads 3
cmp -s j.npy kept.npy || bad 'the derivatives depend on the number of threads'

# Mistakes: one line on stderr, the right exit code, no file.
expect 2 "must end in .npy" sdmgen exact --shape torus --normal x.nrrd
expect 2 'jacobian needs --shape' sdmgen exact --mesh pyramid.off --jacobian x.npy
expect 2 'closest needs --method exact' sdmgen exact --shape torus --method naive --closest x.npy
expect 2 "'x.npy' is given twice" sdmgen exact --shape torus --normal x.npy --closest x.npy
expect 2 "'x.npy' is given twice" sdmgen exact --shape torus --normal x.npy -o x.npy
expect 1 'nowhere' sdmgen exact --shape torus --triangle nowhere/x.npy
expect 2 'needs a value' sdmgen exact --shape torus --triangle
absent x.npy x.nrrd nowhere
finish
