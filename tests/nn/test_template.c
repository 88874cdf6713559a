/* Maps of the template network against its definition: frames, warps, the minimum over the parts,
 * culling, grids of all kinds, the same bits for all instruction sets.
 * Tests: template_build.c template_forward.c template_kernels_avx2.c
 * template_kernels_avx512.c template_kernels_generic.c template_native.c template_pose.c
 * template_blocks.c template_corners.c template_far.c template_run.c template_warp.c
 * template_work.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "sdm/internal/processor.h"
#include "sdm/internal/rng.h"
#include "template_toy.h"

static const double ORIGIN[3] = {0, 0, 0};

static void set_numbers(toy *t, size_t first, size_t n, double scale)
{
    for (size_t i = first; i < first + n; i++)
        t->numbers[i] = (number){scale * sdm_rng_normal(3, 1, i),
                                 {scale * sdm_rng_normal(3, 2, i), scale * sdm_rng_normal(3, 3, i)},
                                 {scale * sdm_rng_normal(3, 4, i), 0}};
}

// Planes that rigid and affine frames carry one upon another: every voxel is exact.
static toy planes(const sdm_grid *grid)
{
    toy t = toy_new(grid);
    const sdm_lattice near = lattice(ORIGIN, 4, 0.5), far = lattice(ORIGIN, 40, 8);
    const body o[4] = {{PLANE, {0, 0, 1}, {0, 0, 1}, 0},
                       {PLANE, {0, 2, 1}, {0, 0.6, 0.8}, 0},
                       {PLANE, {3, 0, 1}, {0.6, 0, -0.8}, 0},
                       {PLANE, {0, -2, 0}, {0, -1, 0}, 0}};
    toy_add(&t, &o[0], -1, SDM_FRAME_RIGID, &near, &far);
    toy_add(&t, &o[1], 0, SDM_FRAME_RIGID, &near, &far);
    toy_add(&t, &o[2], 1, SDM_FRAME_AFFINE, &near, &far);
    toy_add(&t, &o[3], 0, SDM_FRAME_NONE, &near, &far);
    set_numbers(&t, 0, t.spec.n_numbers, 0.15);
    return t;
}

static void random_params(uint64_t i, double p[P])
{
    p[0] = -1 + 3 * sdm_rng_uniform(5, 0, i);
    p[1] = 2 + 4 * sdm_rng_uniform(5, 1, i);
}

// Voxels at a distance of at least `from` differ from the reference by at most tolerance (1 + d);
// three voxels away from the surface, where blocks are interpolated, by twice as much.
static void check_map_from(toy *t, int first_mode, double from, double tolerance)
{
    const double *edge = t->info.grid.spacing, far = 3 * fmax(edge[0], fmax(edge[1], edge[2]));
    sdm_model *m = toy_open(t);
    const size_t n = sdm_grid_count(&t->info.grid);
    for (uint64_t i = 0; i < 3; i++) {
        double p[P];
        random_params(i, p);
        float *map = toy_map(m, p, 1);
        for (size_t v = 0; v < n; v++) {
            const double truth = toy_reference(t, p, first_mode, v);
            const double allowed = tolerance * (1 + fabs(truth)) * (fabs(truth) > far ? 2 : 1);
            if (truth >= from && !(fabs((double)map[v] - truth) <= allowed))
                fail_msg("voxel %zu: %g instead of %g", v, (double)map[v], truth);
        }
        sdm_free(map);
    }
    sdm_model_free(m);
    toy_dispose(t);
}

static void check_map(toy *t, int first_mode, double tolerance)
{
    check_map_from(t, first_mode, -INFINITY, tolerance);
}

static void frames_carry_planes(void **state)
{
    (void)state;
    for (int g = 0; g < GRIDS; g++) {
        const sdm_grid grid = toy_grid(g);
        toy t = planes(&grid);
        check_map(&t, 0, 5e-6);
    }
}

// A sphere that becomes an ellipsoid. The quadric is interpolated without an error.
static void affine_frame_makes_ellipsoid(void **state)
{
    (void)state;
    for (int g = 0; g < GRIDS; g++) {
        const sdm_grid grid = toy_grid(g);
        toy t = toy_new(&grid);
        const body o = {QUADRIC, {0.2, 0.1, -0.3}, {0}, 2};
        const sdm_lattice near = lattice(ORIGIN, 4, 0.5), far = lattice(ORIGIN, 40, 2);
        toy_add(&t, &o, -1, SDM_FRAME_AFFINE, &near, &far);
        set_numbers(&t, 0, t.spec.n_numbers, 0.08);
        check_map(&t, 0, 2e-5);
    }
}

// Near an ellipsoid with half-axes 3, 2 and 1.5 the map is the distance to first order.
static void distance_near_ellipsoid(void **state)
{
    (void)state;
    const sdm_grid grid = sdm_grid_centred((const int64_t[]){41, 33, 29}, 0.2, ORIGIN);
    toy t = toy_new(&grid);
    const body o = {CAPSULE, {0, 0, 0}, {0, 0, 1e-6}, 2};
    const sdm_lattice near = lattice(ORIGIN, 4, 0.2), far = lattice(ORIGIN, 40, 2);
    sdm_template_part *part = toy_add(&t, &o, -1, SDM_FRAME_AFFINE, &near, &far);
    memset(part->pivot, 0, sizeof part->pivot);
    t.numbers[6].constant = 0.5, t.numbers[8].constant = -0.25;
    sdm_model *m = toy_open(&t);
    float *map = toy_map(m, (const double[P]){0, 3}, 1);
    size_t n = 0;
    for (size_t v = 0; v < sdm_grid_count(&grid); v++) {
        static const double half[3] = {3, 2, 1.5};
        double x[3], s[3], low = -2.25, high = 60, sum = 0;
        voxel_world(&grid, v, x);
        // the nearest point s = (a^2 x / (a^2 + k)): bisection for k with |s / a| = 1
        for (int i = 0; i < 100; i++) {
            const double k = 0.5 * (low + high);
            sum = 0;
            for (int a = 0; a < 3; a++) {
                s[a] = half[a] * half[a] * x[a] / (half[a] * half[a] + k);
                sum += s[a] * s[a] / (half[a] * half[a]);
            }
            if (sum > 1)
                low = k;
            else
                high = k;
        }
        const double truth = copysign(hypot(hypot(x[0] - s[0], x[1] - s[1]), x[2] - s[2]), low);
        if (!(fabs(sum - 1) < 1e-9 && fabs(truth) < 0.6)) continue;
        n++;
        if (!(fabs((double)map[v] - truth) < 0.002 + 0.5 * truth * truth))
            fail_msg("voxel %zu: %g instead of %g", v, (double)map[v], truth);
    }
    assert_true(n > 2000);
    sdm_free(map);
    sdm_model_free(m);
    toy_dispose(&t);
}

// An affine displacement field is an affine frame.
static void affine_warp_is_affine_frame(void **state)
{
    (void)state;
    for (int g = 0; g < GRIDS; g++) {
        const sdm_grid grid = toy_grid(g);
        const body o = {QUADRIC, {0.2, 0.1, -0.3}, {0}, 2};
        const sdm_lattice near = lattice(ORIGIN, 16, 0.5), far = lattice(ORIGIN, 60, 3),
                          warp = lattice(ORIGIN, 60, 6);
        toy frame = toy_new(&grid), field = toy_new(&grid);
        sdm_template_part *part = toy_add(&frame, &o, -1, SDM_FRAME_AFFINE, &near, &far);
        memset(part->pivot, 0, sizeof part->pivot);
        double u[9];
        for (int i = 0; i < 3; i++)
            mode_value(0, (const double[]){i == 0, i == 1, i == 2}, 0, u + 3 * i);
        const double stretch[6] = {u[0], u[4], u[8], u[5], u[2], u[1]};
        for (size_t i = 0; i < 6; i++)
            frame.numbers[6 + i] = (number){stretch[i], {2 * stretch[i], 0}, {0}};
        toy_add(&field, &o, -1, SDM_FRAME_NONE, &near, &far);
        toy_warp(&field, 0, 0, 1, &warp);
        field.numbers[0] = (number){1, {2, 0}, {0}};
        sdm_model *a = toy_open(&frame), *b = toy_open(&field);
        const double p[P] = {1.7, 4};
        float *x = toy_map(a, p, 1), *y = toy_map(b, p, 1);
        for (size_t v = 0; v < sdm_grid_count(&grid); v++) {
            // the warp is interpolated some three voxels away from the surface
            const float tolerance = fabsf(x[v]) < 2.5f * 0.5f ? 2e-5f : 5e-2f;
            if (!(fabsf(x[v] - y[v]) < tolerance * (1 + fabsf(x[v]))))
                fail_msg("voxel %zu: %g and %g", v, (double)x[v], (double)y[v]);
        }
        sdm_free(x), sdm_free(y);
        sdm_model_free(a), sdm_model_free(b);
        toy_dispose(&frame), toy_dispose(&field);
    }
}

// A bent and twisted sphere, on a frame that turns.
static toy bent(const sdm_grid *grid)
{
    toy t = toy_new(grid);
    const body o = {QUADRIC, {0.2, 0.1, -0.3}, {0}, 2};
    const sdm_lattice near = lattice(ORIGIN, 4, 0.5), far = lattice(ORIGIN, 40, 2),
                      warp = lattice(ORIGIN, 40, 4);
    toy_add(&t, &o, -1, SDM_FRAME_RIGID, &near, &far);
    toy_warp(&t, 0, 0, MODES, &warp);
    set_numbers(&t, 0, 6, 0.15);
    for (size_t m = 0; m < MODES; m++)
        t.numbers[6 + m] = (number){0.5, {0.6, -0.4}, {0, m ? 0 : 0.3}};
    return t;
}

static void warp_is_its_inverse(void **state)
{
    (void)state;
    for (int g = 0; g < GRIDS; g++) {
        const sdm_grid grid = toy_grid(g);
        toy t = bent(&grid);
        // between stations the metric is linear: its error is of second order
        check_map(&t, 0, 8e-3);
    }
}

// More than 512 stations along an axis.
static void warp_of_long_grid(void **state)
{
    (void)state;
    const sdm_grid grid = sdm_grid_centred((const int64_t[]){3, 2, 1100}, 0.2, ORIGIN);
    toy t = toy_new(&grid);
    const body o = {QUADRIC, {2, 0, 0}, {0}, 2};
    const sdm_lattice near = lattice(ORIGIN, 4, 0.5), far = lattice(ORIGIN, 130, 4),
                      warp = lattice(ORIGIN, 130, 10);
    toy_add(&t, &o, -1, SDM_FRAME_NONE, &near, &far);
    toy_warp(&t, 0, 1, 1, &warp);
    t.numbers[0].constant = 0.1;
    check_map(&t, 1, 2e-5);
}

// A part with a warp beside parts without.
static void warp_beside_rigid_parts(void **state)
{
    (void)state;
    const sdm_grid grid = toy_grid(1);
    toy t = bent(&grid);
    const sdm_lattice near = lattice(ORIGIN, 4, 0.5), far = lattice(ORIGIN, 40, 8);
    const body o[2] = {{PLANE, {0, 0, 1}, {0, 0, -1}, 0}, {PLANE, {1.5, 0, 0}, {-1, 0, 0}, 0}};
    toy_add(&t, &o[0], -1, SDM_FRAME_NONE, &near, &far);
    toy_add(&t, &o[1], 0, SDM_FRAME_RIGID, &near, &far);
    check_map(&t, 0, 8e-3);
}

/* Far from a part the map is interpolated between the corners of blocks: a capsule that a rigid
   frame carries, with a warp or without. `near` reaches as far as the trainer
   makes it. */
static void blocks_far_away_are_interpolated(void **state)
{
    (void)state;
    const sdm_grid grid = sdm_grid_centred((const int64_t[]){38, 33, 42}, 0.2, ORIGIN);
    for (int warped = 0; warped < 2; warped++) {
        toy t = toy_new(&grid);
        const body o = {CAPSULE, {-0.4, 0, 0}, {0.4, 0.1, 0}, 0.7};
        const sdm_lattice near = lattice(ORIGIN, warped ? 1.7 : 2.3, 0.2),
                          far = lattice(ORIGIN, 12, 0.4), warp = lattice(ORIGIN, 20, 2);
        toy_add(&t, &o, -1, SDM_FRAME_RIGID, &near, &far);
        if (warped) toy_warp(&t, 0, 0, MODES, &warp);
        set_numbers(&t, 0, 6, 0.1);
        for (size_t m = 0; m < MODES && warped; m++)
            t.numbers[6 + m] = (number){0.1, {0.1, -0.1}, {0}};
        check_map_from(&t, 0, 0, 5e-3); // the axis of the capsule is an edge of the map
    }
}

// A capsule with a warp on a grid; the amplitudes depend on the parameters.
static toy warped_capsule(const sdm_grid *grid, double radius)
{
    toy t = toy_new(grid);
    const body o = {CAPSULE, {-1.4, 0.1, 0}, {1.5, -0.2, 0.3}, radius};
    const sdm_lattice near = lattice(ORIGIN, 4, 0.1), far = lattice(ORIGIN, 12, 0.4),
                      warp = lattice(ORIGIN, 20, 2);
    toy_add(&t, &o, -1, SDM_FRAME_RIGID, &near, &far);
    toy_warp(&t, 0, 0, MODES, &warp);
    for (size_t m = 0; m < MODES; m++) t.numbers[6 + m] = (number){0.1, {0.1, -0.1}, {0}};
    return t;
}

// A rod thinner than two voxels passes between the corners of blocks: within three voxels of its
// surface no voxel is interpolated.
static void thin_parts_are_not_interpolated(void **state)
{
    (void)state;
    const sdm_grid grid = sdm_grid_centred((const int64_t[]){24, 22, 20}, 0.2, ORIGIN);
    toy t = warped_capsule(&grid, 0.15);
    sdm_model *m = toy_open(&t);
    for (uint64_t i = 0; i < 4; i++) {
        double p[P];
        random_params(i, p);
        float *map = toy_map(m, p, 1);
        for (size_t v = 0; v < sdm_grid_count(&grid); v++) {
            const double truth = toy_reference(&t, p, 0, v);
            // the axis of the rod is an edge of the map
            if (!(truth > -0.05 && truth < 2.5 * 0.2)) continue;
            if (!(fabs((double)map[v] - truth) < 0.012))
                fail_msg("voxel %zu: %g instead of %g", v, (double)map[v], truth);
        }
        sdm_free(map);
    }
    sdm_model_free(m);
    toy_dispose(&t);
}

// While blocks become interpolated, values change in proportion to the parameters.
static void interpolation_begins_without_a_jump(void **state)
{
    (void)state;
    const sdm_grid grid = sdm_grid_centred((const int64_t[]){24, 22, 20}, 0.2, ORIGIN);
    toy t = warped_capsule(&grid, 0.5);
    for (size_t a = 0; a < 3; a++) t.numbers[3 + a] = (number){0, {0.6, 0}, {0}};
    sdm_model *m = toy_open(&t);
    const double step = 1e-3, first[P] = {0.1, 4};
    float *before = toy_map(m, first, 1);
    for (int i = 1; i <= 200; i++) {
        float *after = toy_map(m, (const double[P]){first[0] + step * i, first[1]}, 1);
        for (size_t v = 0; v < sdm_grid_count(&grid); v++)
            if (!(fabs((double)(after[v] - before[v])) < 1.2 * step))
                fail_msg("step %d, voxel %zu: %g after %g", i, v, (double)after[v],
                         (double)before[v]);
        sdm_free(before);
        before = after;
    }
    sdm_free(before);
    sdm_model_free(m);
    toy_dispose(&t);
}

// Points are carried forward by the same frame and warp.
static void carry_is_inverse_of_map(void **state)
{
    (void)state;
    const sdm_grid grid = toy_grid(0);
    toy t = bent(&grid);
    sdm_model *m = toy_open(&t);
    for (uint64_t i = 0; i < 20; i++) {
        double p[P], y[3], x[3], back[3];
        random_params(i, p);
        for (uint64_t a = 0; a < 3; a++) y[a] = 2 * sdm_rng_normal(8, a, i);
        assert_int_equal(sdm_template_carry(m, p, y, 1, x, NULL), SDM_OK);
        toy_carry_back(&t, p, 0, x, back);
        toy_unwarp(&t, p, 0, 0, back);
        for (int a = 0; a < 3; a++) assert_true(fabs(back[a] - y[a]) < 1e-5);
    }
    sdm_model_free(m);
    toy_dispose(&t);
}

// Beyond the lattice `far` the template is that of the nearest point of the lattice.
static void template_ends_at_far(void **state)
{
    (void)state;
    const sdm_grid grid = toy_grid(1);
    toy t = toy_new(&grid);
    const body o = {PLANE, {0, 0, 1}, {0.48, 0.64, 0.6}, 0};
    const sdm_lattice near = lattice(ORIGIN, 1, 0.5), far = lattice(ORIGIN, 2, 1);
    toy_add(&t, &o, -1, SDM_FRAME_RIGID, &near, &far);
    set_numbers(&t, 0, 6, 0.2);
    sdm_model *m = toy_open(&t);
    const double p[P] = {0.4, 5};
    float *map = toy_map(m, p, 1);
    size_t outside = 0;
    for (size_t v = 0; v < sdm_grid_count(&grid); v++) {
        double x[3], y[3], at[3], g[3];
        voxel_world(&grid, v, x);
        toy_carry_back(&t, p, 0, x, y);
        for (int a = 0; a < 3; a++)
            at[a] = fmin(fmax(y[a], far.origin[a]), far.origin[a] + far.spacing * (far.n[a] - 1.0));
        outside += memcmp(at, y, sizeof y) != 0;
        assert_true(fabs((double)map[v] - body_distance(&o, at, g)) < 1e-5);
    }
    assert_true(outside > 100);
    sdm_free(map);
    sdm_model_free(m);
    toy_dispose(&t);
}

// Capsules across the grid, some of them stretched, all with the same frames in both models.
static toy capsules(const sdm_grid *grid, size_t n)
{
    toy t = toy_new(grid);
    const sdm_lattice far = lattice(ORIGIN, 30, 1);
    for (size_t c = 0; c < n; c++) {
        body o = {CAPSULE, {0}, {0}, 0.8 + 0.1 * (double)c};
        double middle[3];
        for (uint64_t a = 0; a < 3; a++) {
            middle[a] = 2.5 * sdm_rng_normal(21, a, c);
            o.a[a] = middle[a] + sdm_rng_normal(22, a, c);
            o.b[a] = middle[a] + sdm_rng_normal(23, a, c);
        }
        const sdm_lattice near = lattice(middle, 4, 0.4);
        sdm_template_part *part =
            toy_add(&t, &o, -1, c % 3 == 2 ? SDM_FRAME_AFFINE : SDM_FRAME_RIGID, &near, &far);
        memcpy(part->pivot, middle, sizeof middle);
        set_numbers(&t, part->numbers, sdm_template_frame_numbers(part->frame), 0.2);
    }
    return t;
}

static void culling_keeps_all_bits(void **state)
{
    (void)state;
    enum { N = 6 };
    for (int g = 0; g < GRIDS; g++) {
        const sdm_grid grid = toy_grid(g);
        const size_t voxels = sdm_grid_count(&grid);
        toy t = capsules(&grid, N);
        sdm_model *all = toy_open(&t), *one[N];
        for (size_t c = 0; c < N; c++) {
            toy alone = t;
            alone.parts[0] = t.parts[c];
            alone.spec.n_parts = 1;
            one[c] = toy_open(&alone);
        }
        for (uint64_t i = 0; i < 10; i++) {
            double p[P];
            random_params(i, p);
            float *map = toy_map(all, p, 1), *least = NULL;
            for (size_t c = 0; c < N; c++) {
                float *part = toy_map(one[c], p, 1);
                for (size_t v = 0; v < voxels && c; v++)
                    least[v] = part[v] < least[v] ? part[v] : least[v];
                if (c)
                    sdm_free(part);
                else
                    least = part;
            }
            for (size_t v = 0; v < voxels; v++)
                if (map[v] != least[v])
                    fail_msg("grid %d, parameters %d, voxel %zu: %.9g instead of %.9g", g, (int)i,
                             v, (double)map[v], (double)least[v]);
            sdm_free(map), sdm_free(least);
        }
        for (size_t c = 0; c < N; c++) sdm_model_free(one[c]);
        sdm_model_free(all);
        toy_dispose(&t);
    }
}

// Real distances: the error is that of the interpolation.
static void capsules_are_interpolated(void **state)
{
    (void)state;
    const sdm_grid grid = toy_grid(2);
    toy t = capsules(&grid, 4);
    sdm_model *m = toy_open(&t);
    double p[P], worst = 0;
    random_params(4, p);
    float *map = toy_map(m, p, 1);
    size_t n = 0;
    for (size_t v = 0; v < sdm_grid_count(&grid); v++) {
        const double truth = toy_reference(&t, p, 0, v);
        if (fabs(truth) > 0.2) continue;
        worst = fmax(worst, fabs((double)map[v] - truth)), n++;
    }
    assert_true(n > 10);
    if (!(worst < 0.02)) fail_msg("%g mm", worst);
    sdm_free(map);
    sdm_model_free(m);
    toy_dispose(&t);
}

// Batches, threads and instruction sets do not change a bit.
static void same_bits(void **state)
{
    (void)state;
    for (int which = 0; which < 3; which++) {
        const sdm_grid grid = toy_grid(1);
        toy t = which == 0 ? capsules(&grid, 5) : which == 1 ? bent(&grid) : planes(&grid);
        sdm_model *m = toy_open(&t);
        enum { N = 3 };
        double p[N * P];
        float *single[N], *maps = NULL;
        void *scratch = NULL;
        const size_t voxels = sdm_grid_count(&grid);
        for (uint64_t i = 0; i < N; i++) {
            random_params(i, p + i * P);
            single[i] = toy_map(m, p + i * P, 1);
        }
        assert_int_equal(SDM_ALLOC(&maps, N * voxels, "maps", NULL), SDM_OK);
        for (int threads = 1; threads <= 3; threads++)
            for (int level = 0; level < SDM_PROCESSOR_LEVELS; level++) {
                sdm_processor_select(level);
                assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes_threads(m, N, threads),
                                           1, "scratch", NULL),
                                 SDM_OK);
                sdm_model_forward_threads(m, p, N, maps, scratch, threads);
                for (size_t i = 0; i < N; i++)
                    assert_memory_equal(maps + i * voxels, single[i], voxels * sizeof *maps);
                sdm_free(scratch);
            }
        sdm_processor_select(-1);
        for (size_t i = 0; i < N; i++) sdm_free(single[i]);
        sdm_free(maps);
        sdm_model_free(m);
        toy_dispose(&t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(frames_carry_planes),
                                       cmocka_unit_test(affine_frame_makes_ellipsoid),
                                       cmocka_unit_test(distance_near_ellipsoid),
                                       cmocka_unit_test(affine_warp_is_affine_frame),
                                       cmocka_unit_test(warp_is_its_inverse),
                                       cmocka_unit_test(warp_of_long_grid),
                                       cmocka_unit_test(warp_beside_rigid_parts),
                                       cmocka_unit_test(blocks_far_away_are_interpolated),
                                       cmocka_unit_test(thin_parts_are_not_interpolated),
                                       cmocka_unit_test(interpolation_begins_without_a_jump),
                                       cmocka_unit_test(carry_is_inverse_of_map),
                                       cmocka_unit_test(template_ends_at_far),
                                       cmocka_unit_test(culling_keeps_all_bits),
                                       cmocka_unit_test(capsules_are_interpolated),
                                       cmocka_unit_test(same_bits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
