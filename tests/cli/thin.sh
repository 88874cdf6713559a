#!/usr/bin/env bash
# Necks and walls that are thinner than a voxel, walls that meet or cross within the ranges, lengths in metres: each is told in one line.
# Tests: grid_cut.c output.c report_survey.c tell_grid.c part_audit.c survey_fold.c survey_scale.c cmd_exact.c
. "$(dirname "$0")/common.sh"
[ $emulated = no ] || { finish && exit 0; } # an emulated program cannot load the file that cc builds

# Square rings about z, each a radius and a height, from the bottom to the top: a bar with a neck, or a bottle whose rings go down again inside.
cat >rings.c <<'C'
#include <sdm/shape.h>
#ifndef WALL_MIN
#define WALL_MIN 2
#endif
#ifndef WALL_MAX
#define WALL_MAX 3
#endif
#ifndef NECK
#define NECK 5, 8, 6
#endif
#ifndef BOTTOM
#define BOTTOM p[1]
#endif
#ifdef ROOF
#define RINGS {20, -30}, {20, -10}, {p[0], -8}, {p[0], 8}, {26, 8}, {4, 20}
enum { N = 6 };
#elif defined BAR
#define RINGS {20, -30}, {20, -10}, {p[0], -8}, {p[0], 8}, {20, 10}, {20, 30}
enum { N = 6 };
#else
#define RINGS                                                                                                                                    \
    {20, -30}, {20, 10}, {p[0], 15}, {p[0], 30}, {p[0] - p[1], 30}, {p[0] - p[1], 15 - p[1]}, {20 - p[1], 10 - p[1]}, {20 - p[1], BOTTOM - 30}
enum { N = 8 };
#endif
static const sdm_param PARAMS[] = {{"neck", "mm", NECK, "half the width of the neck"},
                                   {"wall", "mm", WALL_MIN, WALL_MAX, 2.5, "thickness of the wall"}};
static uint32_t *face(uint32_t *t, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    t[0] = t[3] = a, t[1] = b, t[2] = t[4] = c, t[5] = d;
    return t + 6;
}
static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options, const double *p, sdm_mesh_out *out)
{
    const double ring[N][2] = {RINGS};
    const int failed = host->reserve(host, out, 4 * N, 8 * (N - 1) + 4);
    (void)self, (void)options;
    if (failed) return failed;
    uint32_t *t = face(out->tri, 3, 2, 1, 0);
    for (uint32_t i = 0; i < N; i++)
        for (uint32_t k = 0; k < 4; k++) {
            double *v = out->vert + 3 * (4 * i + k);
            v[0] = k == 0 || k == 3 ? ring[i][0] : -ring[i][0], v[1] = k < 2 ? ring[i][0] : -ring[i][0], v[2] = ring[i][1];
            if (i + 1 < N) t = face(t, 4 * i + k, 4 * i + (k + 1) % 4, 4 * i + 4 + (k + 1) % 4, 4 * i + 4 + k);
        }
    face(t, 4 * N - 4, 4 * N - 3, 4 * N - 2, 4 * N - 1);
    return 0;
}
#ifdef BAR
enum { N_PARAMS = 1 };
#else
enum { N_PARAMS = 2 };
#endif
static const sdm_shape SHAPE = {
    .abi = SDM_SHAPE_ABI, .size = sizeof(sdm_shape), .name = "rings", .summary = "test", .params = PARAMS, .n_params = N_PARAMS, .mesh = mesh};
const sdm_shape *sdm_plugin_shape(uint32_t index) { return index == 0 ? &SHAPE : 0; }
C
build() { # NAME OPTION...: builds NAME.so
    local name=$1
    shift
    cc -shared -fPIC -I"$source_folder/framework/include" "$@" rings.c -o "$name.so" || bad "$name.so was not built"
}

# A bar whose neck passes between the voxel centres: most of the bar is thick, and its surface falls into two pieces.
build bar -DBAR -DNECK=0.2,8,0.2
grid='--spacing 1 --origin -25.5,-25.5,-35 --size 52,52,71'
expect 0 - sdmgen shapes check --plugin ./bar.so --samples 8
has '^fine: '
expect 0 'the surface is torn: at [0-9]+ of the [0-9]+ voxels on it no voxel is inside .*: give a smaller --spacing|give a smaller --spacing$' \
    sdmgen exact --shape rings --plugin ./bar.so $grid -o torn.nrrd --quiet
sdmgen exact --shape rings --plugin ./bar.so $grid -o torn.stl --quiet 2>err || bad "exact of a bar with a thin neck: $(cat err)"
grep -Eq '^sdmgen: warning: torn.stl: the surface has 2 pieces, the shape 1: a neck or a wall is thinner than a voxel of 1 mm and is torn' err || bad "pieces are not told: $(cat err)"
# level sets are computed in blocks: the same figures
sdmgen exact --shape rings --plugin ./bar.so $grid -o torn.vdb --quiet 2>in_blocks || bad "exact of a level set with a thin neck: $(cat in_blocks)"
[ "$(grep 'is torn: at' in_blocks)" = "$(grep 'is torn: at' err)" ] || bad "torn in blocks: $(cat in_blocks) instead of $(cat err)"
expect 0 - sdmgen exact --shape rings --plugin ./bar.so $grid -p neck=8 -o whole.stl --quiet

# The edges of a roof end between voxel centres, too: nothing is torn.
build roof -DBAR -DROOF
eaves='--spacing 1 --origin -29.3,-29.3,-35.1 --size 60,60,60'
for file in roof.nrrd roof.vdb; do
    expect 0 - sdmgen exact --shape rings --plugin ./roof.so $eaves -o $file --quiet
    if grep -q 'is torn' err; then bad "$file: the edges of a roof are told: $(cat err)"; fi
done

# Walls that lie on each other at an end of the range, and walls that cross in the neck, which is little of the surface.
build right
expect 0 - sdmgen shapes check --plugin ./right.so --samples 8
has '^fine: '
build none -DWALL_MIN=0
expect 4 mend sdmgen shapes check --plugin ./none.so --samples 8
has '^warning +walls lie on each other at neck=5 wall=0 \(in [0-9]+ of 13 shapes\): no grid shows it; let the range of its thickness begin higher'
expect 0 - sdmgen shapes test none.so
# A bottom without thickness, whose inner and outer triangles differ; with voxels no spacing is advised.
build bottom -DBOTTOM=0
printf 'shape: {name: rings}\ngrid: {size: [36, 36, 56], spacing: 1.2, centre: [0, 0, 0]}\ntrain: {minutes: 0.1}\n' >bottom.yaml
expect 4 mend sdmgen shapes check bottom.yaml --plugin ./bottom.so --samples 8
has '^warning +walls lie on each other at neck=6 wall=2.5 \(in all 13 shapes\): no grid shows it'
if grep -q 'too thin for voxels' out; then bad "a spacing for walls that lie on each other: $(cat out)"; fi
build crossed -DWALL_MAX=6
expect 4 mend sdmgen shapes check --plugin ./crossed.so --samples 8
has '^warning +walls pass through each other in .* to neck=5 wall=6 [0-9.]+ % of the surface turns over, at about neck=5\.[0-9]+ wall=5'

# The range of one parameter in metres, and the lengths of one part.
build metres -DNECK=0.005,0.008,0.006
expect 4 mend sdmgen shapes check --plugin ./metres.so --samples 8
has "^warning +the parameter 'neck' ranges from 0.005 to 0.008 mm, which moves no vertex of a shape of 60 mm by more than 0.00[0-9]+ mm: are these m \(times 1000\)\?$"
expect 0 - sdmgen shapes test metres.so
has "^doubtful units +'neck' ranges from 0.005 to 0.008 mm in a shape of 60 mm: are these m\?"
printf 'shape: {name: rings}\ngrid: auto\ntrain: {minutes: 0.1}\n' >metres.yaml
sdmgen config metres.yaml --plugin ./metres.so >out 2>err || bad "config of a range in metres: $(cat err)"
grep -q "warning: the parameter 'neck' ranges from 0.005" err || bad "config says nothing of a range in metres: $(cat err)"
finish
