#!/usr/bin/env bash
# sdmgen exact: values against closed forms, every type of output, bad meshes, no partial files.
# Tests: cmd_exact.c json_describe.c json_values.c output.c report_audit.c grid_cut.c like_grid.c box_grid.c
. "$(dirname "$0")/common.sh"

# floats FILE SKIP: the float32 values after SKIP bytes, one per line.
floats() { od -An -v -t f4 -w4 -j "$2" "$1" | tr -d ' '; }

# A cube with edge 4 centred at the origin, and a grid of 7 x 7 x 7 voxels of 1 mm.
cat >cube.off <<'END'
OFF
8 12 0
-2 -2 -2
2 -2 -2
2 2 -2
-2 2 -2
-2 -2 2
2 -2 2
2 2 2
-2 2 2
3 0 2 1
3 0 3 2
3 4 5 6
3 4 6 7
3 0 1 5
3 0 5 4
3 1 2 6
3 1 6 5
3 2 3 7
3 2 7 6
3 3 0 4
3 3 4 7
END
grid=(--size '7,7,7' --spacing 1 --origin '-3,-3,-3')
for method in exact naive; do
    expect 0 - sdmgen exact --mesh cube.off "${grid[@]}" --method $method --quiet -o $method.npy --json
    near "$(json voxels)" 343 0
    near "$(json triangles)" 12 0
    near "$(json min_mm)" -2 1e-6
    near "$(json max_mm)" "$(awk 'BEGIN { print sqrt(3) }')" 1e-6
    for key in ms_build ms_query ms_total threads sign_method union; do [ -n "$(json $key)" ] || bad "no $key"; done
    # .npy: the header has a multiple of 64 bytes, 343 values follow. The distance to a box in closed form; z is the slowest axis.
    floats $method.npy $(($(wc -c <$method.npy) - 343 * 4)) | awk '
        { x = (NR - 1) % 7 - 3; y = int((NR - 1) / 7) % 7 - 3; z = int((NR - 1) / 49) - 3
          a = (x < 0 ? -x : x) - 2; b = (y < 0 ? -y : y) - 2; c = (z < 0 ? -z : z) - 2
          m = a; if (b > m) m = b; if (c > m) m = c
          d = m > 0 ? sqrt((a > 0) * a * a + (b > 0) * b * b + (c > 0) * c * c) : m
          if ($1 - d > 1e-6 || d - $1 > 1e-6) { print "voxel", NR, $1, d; wrong = 1 } }
        END { exit wrong || NR != 343 }' || bad "$method: values differ from the closed form of a box"
done
cmp -s exact.npy naive.npy || echo 'exact and naive differ in the last bits (allowed)'

# Stopped while the first of two files is written: the second is not begun.
stopped_at 'overlaps itself' exact --shape cochlea --size 256,256,256 --spacing 0.05 -o first.nrrd -o second.nrrd
grep -q '^sdmgen: error: interrupted$' err || bad "not interrupted: $(cat err)"
absent second.nrrd

# The same bits for any number of threads.
expect 0 - sdmgen exact --shape cochlea --size 24,20,20 --spacing 0.5 --json --quiet --threads 1
one=$(json values_crc64)
expect 0 - sdmgen exact --shape cochlea --size 24,20,20 --spacing 0.5 --json --quiet --threads 3
[ "$one" = "$(json values_crc64)" ] || bad 'the values depend on the number of threads'
near "$(json threads)" 3 0

# A grid that cuts the shape is told with its faces, also with --quiet; the volume needs no counting.
expect 0 'warning: the surface leaves the grid and ends open there; it reaches beyond -x \(1 mm\), \+x \(1 mm\); ' sdmgen exact --shape ellipsoid \
    -p rx=3 -p ry=2 -p rz=2 --size 17,25,25 --spacing 0.25 --quiet --json
expect 0 - sdmgen exact --shape ellipsoid -p rx=3 -p ry=2 -p rz=2 --spacing 0.25 --json --quiet
volume=$(json volume_mm3)
expect 0 - sdmgen mesh --shape ellipsoid -p rx=3 -p ry=2 -p rz=2 --json --quiet
near "$(json volume_mm3)" "$volume" 0.1
expect 2 '--sign does nothing with --method naive' sdmgen exact --shape torus --method naive --sign winding --json

# The default grid: 64 voxels along the longest edge of the mesh, and no surface outside.
expect 0 - sdmgen exact --shape torus --json --quiet
has '"size": \[[0-9]+, [0-9]+, [0-9]+\]'
out_size=$(sed -n 's/.*"size": \[\([0-9, ]*\)\].*/\1/p' out | tr ',' '\n' | sort -n | tail -n 1)
near "$out_size" 64 0
awk -v max="$(json max_mm)" -v min="$(json min_mm)" 'BEGIN { exit !(min < 0 && max > 0) }' || bad 'the fitted grid misses the torus'

# Every type of output, selected by the ending.
expect 0 'warning: o.ply: the surface encloses 51 mm\^3, 20 % less than the shape, 64 mm\^3: voxels of 1 mm cut its edges' sdmgen exact --mesh cube.off "${grid[@]}" --quiet -o o.nii -o o.nii.gz -o o.nrrd -o o.mha -o o.ply -o o.stl -o o.obj \
    -o o.off -o o.png -o o.svg -o o.PDF
present o.nii o.nii.gz o.nrrd o.mha o.ply o.stl o.obj o.off o.png o.svg o.PDF
[ "$(head -c 4 o.PDF)" = %PDF ] || bad 'o.PDF is no PDF'
grep -q '>cube.off: exact</text>' o.svg || bad 'o.svg has no title'
expect 0 - sdmgen info o.ply
has '^closed +yes'
expect 0 - sdmgen info o.off --json
near "$(json volume_mm3)" 64 16
if sdmgen exact --mesh cube.off --quiet -o probe.vdb 2>err; then
    expect 0 - sdmgen exact --shape torus --quiet -o t.vdb -o t2.vdb --half
    expect 0 - sdmgen verify t.vdb
    expect 0 - sdmgen info t.vdb
    has 'torus'
    expect 0 '^sdmgen: warning: part 1 of 1 .* is 2 mm thick, too thin for voxels of 4 mm: .* spacing of at most 0.[0-9]+ mm|spacing of at most 1 mm' sdmgen exact --shape torus --size 12,12,12 --spacing 3,3,4 --quiet --dense -o d.vdb
    expect 0 - sdmgen verify d.vdb
    # a band that leaves the grid: computed by the exact engine, estimated by other methods
    ball='--shape ellipsoid -p rx=2 -p ry=2 -p rz=2 --size 20,20,20 --spacing 0.25 --band 6 -o b.vdb'
    expect 0 - sdmgen exact $ball
    expect 0 '^sdmgen: b.vdb: the band leaves the grid; the distances of [0-9]+ voxels beyond it are estimated' sdmgen exact $ball --method naive
    expect 2 'dense' sdmgen exact --shape torus --size 12,12,12 --spacing 3,3,4 --quiet -o u.vdb
    absent u.vdb
    cp t.vdb cut.vdb
    truncate -s -200 cut.vdb
    expect 3 'cut\.vdb' sdmgen verify cut.vdb
else
    grep -q 'built without OpenVDB' err || bad "a .vdb fails: $(cat err)"
fi

# Mistakes: one line on stderr, the right exit code, no file.
expect 2 'either --shape NAME or --mesh FILE' sdmgen exact -o x.npy
expect 2 'either --shape NAME or --mesh FILE' sdmgen exact --shape torus --mesh cube.off -o x.npy
printf 'v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n' >point.obj
expect 2 'the surface is the single point \(1, 2, 3\).*give --spacing and --size' sdmgen exact --mesh point.obj -o x.npy
expect 2 'belong to --shape' sdmgen exact --mesh cube.off -p a=1 -o x.npy
expect 2 'an output is needed' sdmgen exact --shape torus
expect 2 "output 'x.xyz': its name must end in" sdmgen exact --shape torus -o x.xyz
expect 5 'nan' sdmgen exact --shape cochlea -p a=nan -o x.npy
expect 1 'nowhere' sdmgen exact --mesh cube.off -o nowhere/x.npy
expect 1 'missing\.ply' sdmgen exact --mesh missing.ply -o x.npy
echo 'ply' >broken.ply
expect 3 'broken\.ply' sdmgen exact --mesh broken.ply -o x.npy
head -c 200 o.stl >broken.stl
expect 3 'broken\.stl' sdmgen exact --mesh broken.stl -o x.npy
expect 3 'unknown\.txt' bash -c 'cp cube.off unknown.txt; "$0" exact --mesh unknown.txt -o x.npy' "$program"
sed 's/^2 2 2$/2 2 nan/' cube.off >nan.off
expect 3 'nan\.off|finite' sdmgen exact --mesh nan.off -o x.npy
head -n 19 cube.off | sed 's/^8 12 0/8 9 0/' >open.off
expect 2 'crossings' sdmgen exact --mesh open.off --sign crossings --quiet -o x.npy
# A mesh in the plane x = 1 with an extent of about 1e-55 mm.
awk 'BEGIN { for (i = 0; i < 120; i++) printf "v 1 %de-57 %de-57\n", i * 37 % 101, i * 53 % 97
             for (i = 1; i < 120; i += 3) print "f", i, i + 1, i + 2 }' >thin.obj
sdmgen exact --mesh thin.obj --size 4,4,4 --spacing 1 --origin 0,0,0 --quiet -o thin.npy 2>err || bad "thin.obj: $(cat err)"
# Under the address sanitizer a failing allocation ends the program, so this test is skipped.
grep -q __asan_init "$program" ||
    expect 1 'no memory for a map of 60000 x 60000 x 60000 voxels: it needs 8\.64e\+05 GB, and [0-9.]+ GB are free; a larger --spacing or a smaller --size makes fewer; the same box with --spacing [0-9]+ needs [0-9.]+ GB' \
        sdmgen exact --mesh cube.off --size 60000,60000,60000 --spacing 1 -o x.npy
absent x.npy x.xyz nowhere
for quiet in '' --quiet; do # a warning remains
    # shellcheck disable=SC2086
    expect 0 '^sdmgen: warning: the mesh is open: [0-9]+ boundary edges' sdmgen exact --mesh open.off "${grid[@]}" -o open.npy $quiet
done

# --like: the grid of an image or of a model.
sdmgen exact --mesh cube.off --size 12,11,10 --spacing 0.5 --origin=-2.75,-2.5,-2.25 --quiet -o grid.nrrd
expect 0 - sdmgen exact --mesh cube.off --like grid.nrrd --quiet -o like.nrrd
expect 0 - sdmgen exact --mesh cube.off --size 12,11,10 --spacing 0.5 --origin=-2.75,-2.5,-2.25 --quiet -o given.nrrd
cmp given.nrrd like.nrrd || bad 'the grid of --like'
model=$source_folder/tests/golden/pod_i8.sdm
expect 0 - sdmgen generate "$model" --quiet -o of_model.nrrd
expect 0 - sdmgen exact --shape capsule --like "$model" --quiet -o of_shape.nrrd
head -n 12 of_model.nrrd | grep -aE '^(sizes|space)' >a.txt
head -n 12 of_shape.nrrd | grep -aE '^(sizes|space)' >b.txt
[ -s a.txt ] && cmp a.txt b.txt || bad 'the grid of a model'
expect 2 'like and --spacing exclude each other' sdmgen exact --mesh cube.off --like grid.nrrd --spacing 1 -o x.npy
expect 2 "like 'cube.off': its name must end in .sdm" sdmgen exact --mesh cube.off --like cube.off -o x.npy
expect 1 'nix.nrrd' sdmgen exact --mesh cube.off --like nix.nrrd -o x.npy
expect 2 "would overwrite the input 'grid.nrrd'" sdmgen exact --mesh cube.off --like grid.nrrd -o grid.nrrd
expect 2 '--like is an option of maps' sdmgen exact --mesh cube.off --points points.csv --like grid.nrrd -o x.csv
sdmgen exact --mesh cube.off --size 9,9,9 --spacing 9 --quiet -o wide.nrrd 2>/dev/null
expect 5 'other points need --outside bound or exact' sdmgen generate "$model" --like wide.nrrd -o x.npy

# Faces on planes of voxel centres along z: a notice, a warning where voxels are counted.
between=(--spacing 0.25 --size 32,32,33 --origin='-4.1,-4.1,-4')
expect 0 '^sdmgen: flat faces lie exactly on planes of voxel centres along z: .* off by 6\.2 % of the volume; with --origin -4\.1,-4\.1,-4\.[0-9]+ they lie between' sdmgen exact --mesh cube.off "${between[@]}" -o x.npy
expect 0 '^sdmgen: warning: flat faces' sdmgen exact --mesh cube.off "${between[@]}" --quiet -o x.seg.nrrd
sdmgen exact --mesh cube.off "${between[@]:0:4}" --origin "$(grep -oE 'origin -[-0-9.,]+' err | cut -c8-)" -o x.seg.nrrd 2>err || bad 'the origin proposed'
if grep -q planes err; then bad "the origin proposed has faces on planes: $(cat err)"; fi

# A grid beside the shape: a warning, which --quiet does not hide; probes and slices may lie there. A slice cuts every shape.
expect 0 '^sdmgen: warning: no voxel of the grid is inside the surface: .* It reaches from \(-[0-9., -]+\) to \([0-9., ]+\) mm, the grid from \(900, 0, 0\) to \(901\.5, 1\.5, 1\.5\) mm$' sdmgen exact --mesh cube.off --origin 900,0,0 --size 4,4,4 --spacing 0.5 --quiet -o x.npy
expect 0 - sdmgen exact --mesh cube.off --origin 900,0,0 --size 1,4,4 --spacing 0.5 --quiet -o x.npy
expect 0 - sdmgen exact --mesh cube.off --origin -4,-4,0 --size 17,17,1 --spacing 0.5 --quiet -o x.npy
expect 3 '`sdmgen mesh --mesh FILE --audit` checks it' sdmgen verify cube.off

# --certify: signs compared with crossings along y and z.
sdmgen exact --mesh cube.off "${grid[@]}" --json --certify >out 2>err || bad 'signs of a cube'
grep -q '343 of 343 voxels compared with crossings along y and z, all agree' err || bad "signs: $(cat err)"
near "$(json sign_checked)" 1 0
near "$(json sign_agreed)" 1 0
expect 0 'the mesh is open' sdmgen exact --mesh open.off "${grid[@]}" --json --certify --quiet
[ "$(json sign_compared)" = 'crossings along y and z and the boundary' ] || bad 'what the signs were compared with'
near "$(json sign_agreed)" 1 0
expect 0 'the mesh is open' sdmgen exact --mesh open.off "${grid[@]}" --json --quiet
[ -z "$(json sign_checked)" ] || bad 'a certificate nobody asked for'
expect 2 'certify belongs to --method exact' sdmgen exact --mesh cube.off "${grid[@]}" --json --certify --method naive
finish
