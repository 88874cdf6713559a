/* Toy template networks whose maps have derivatives without jumps, for tests of derivatives.
 * Include cmocka.h first. */
#ifndef SDM_TEST_TEMPLATE_TOYS_H
#define SDM_TEST_TEMPLATE_TOYS_H

#include "sdm/internal/rng.h"
#include "template_toy.h"

static const double ORIGIN[3] = {0, 0, 0};

static inline void set_numbers(toy *t, size_t first, size_t n, double scale)
{
    for (size_t i = first; i < first + n; i++)
        t->numbers[i] = (number){scale * sdm_rng_normal(3, 1, i),
                                 {scale * sdm_rng_normal(3, 2, i), scale * sdm_rng_normal(3, 3, i)},
                                 {scale * sdm_rng_normal(3, 4, i), 0}};
}

/* 0: a chain of planes; 1: a sphere that becomes an ellipsoid; 2: a bent sphere on a frame that
   turns; 3: the same beside two planes, which it carries; 4: a bent sphere on a frame that turns
   and stretches. Templates without an error of interpolation have derivatives without jumps. */
enum { TOYS = 5 };
// The metric of a warp belongs to a point up to a two-hundredth of the spacing of its lattice away.
static const double TOLERANCE[TOYS] = {1e-3, 1e-3, 2e-3, 2e-3, 4e-3};

static inline toy make(int which, const sdm_grid *grid)
{
    toy t = toy_new(grid);
    const sdm_lattice near = lattice(ORIGIN, which < 2 ? 4 : 16, 0.5), far = lattice(ORIGIN, 40, 2),
                      warp = lattice(ORIGIN, 40, 4);
    const body planes[3] = {{PLANE, {0, 0, 1}, {0, 0, 1}, 0},
                            {PLANE, {0, 2, 1}, {0, 0.6, 0.8}, 0},
                            {PLANE, {3, 0, 1}, {0.6, 0, -0.8}, 0}},
               ball = {QUADRIC, {0.2, 0.1, -0.3}, {0}, 2};
    if (which == 0) {
        toy_add(&t, &planes[0], -1, SDM_FRAME_RIGID, &near, &far);
        toy_add(&t, &planes[1], 0, SDM_FRAME_RIGID, &near, &far);
        toy_add(&t, &planes[2], 1, SDM_FRAME_AFFINE, &near, &far);
        set_numbers(&t, 0, t.spec.n_numbers, 0.15);
    } else {
        toy_add(&t, &ball, -1, which == 1 || which == 4 ? SDM_FRAME_AFFINE : SDM_FRAME_RIGID, &near,
                &far);
        set_numbers(&t, 0, t.spec.n_numbers, 0.08);
    }
    if (which >= 2) {
        toy_warp(&t, 0, 0, MODES, &warp);
        for (size_t m = 0; m < MODES; m++)
            t.numbers[t.parts[0].amplitudes + m] = (number){0.5, {0.6, -0.4}, {0, m ? 0 : 0.3}};
    }
    if (which == 3) {
        toy_add(&t, &planes[0], -1, SDM_FRAME_RIGID, &near, &far);
        toy_add(&t, &planes[2], 0, SDM_FRAME_NONE, &near, &far);
        set_numbers(&t, t.parts[1].numbers, 6, 0.1);
    }
    return t;
}

typedef struct slopes {
    size_t voxels;
    float *map, *jacobian;
} slopes;

static inline slopes slopes_of(const sdm_model *m, const double *p)
{
    slopes s = {.voxels = sdm_grid_count(&sdm_model_get_info(m)->grid)};
    void *scratch = NULL;
    const size_t bytes = sdm_model_jacobian_scratch_bytes(m);
    assert_int_equal(SDM_ALLOC(&s.map, s.voxels, "map", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&s.jacobian, P * s.voxels, "jacobian", NULL), SDM_OK);
    assert_int_equal(sdm_alloc(&scratch, bytes, 1, "scratch", NULL), SDM_OK);
    memset(scratch, 0xa5, bytes);
    memset(s.jacobian, 0xa5, P * s.voxels * sizeof *s.jacobian);
    sdm_model_jacobian(m, p, s.map, s.jacobian, scratch);
    sdm_free(scratch);
    return s;
}

static inline void slopes_dispose(slopes *s)
{
    sdm_free(s->map);
    sdm_free(s->jacobian);
}

// Number of the part that is the nearest at voxel v.
static inline size_t nearest(const toy *t, const double *p, size_t v)
{
    double x[3], least = INFINITY;
    size_t best = 0;
    voxel_world(&t->info.grid, v, x);
    for (size_t c = 0; c < t->spec.n_parts; c++) {
        const double d = toy_distance(t, p, c, 0, x);
        if (d < least) least = d, best = c;
    }
    return best;
}

/* The correction r = y . LINEAR (1 + x_0), a pod network of one block and one mode. */
static const double LINEAR[3] = {0.2, -0.1, 0.3};
enum { NODES = 9 };

static inline uint8_t *correction_build(const toy *t, size_t *size)
{
    enum { VOXELS = NODES * NODES * NODES };
    sdm_model_info info = t->info;
    info.params = t->params;
    info.grid = sdm_grid_centred((const int64_t[]){NODES, NODES, NODES}, 3, ORIGIN);
    float mean[VOXELS], head[3] = {0};
    uint8_t exponents[3 * P], *bytes = NULL;
    for (size_t v = 0; v < VOXELS; v++) {
        double y[3];
        voxel_world(&info.grid, v, y);
        mean[v] = (float)dot3(LINEAR, y);
    }
    sdm_poly_table(P, 1, exponents);
    for (size_t i = 1; i < 3; i++)
        if (exponents[i * P]) head[i] = (float)(1 / sqrt(3));
    sdm_pod_spec spec = {.info = &info, .type = SDM_POD_F32};
    spec.arch = (sdm_pod_arch){.n_params = P,
                               .degree = 1,
                               .input_degree = 1,
                               .width = 1,
                               .block = NODES,
                               .n_terms = 3,
                               .n_inputs = P,
                               .n_latent = 3,
                               .n_coefficients = 1,
                               .n_voxels = VOXELS,
                               .levels = sdm_pod_count(&info.grid, NODES, 1)};
    sdm_pod_block block[1];
    sdm_pod_blocks(&info.grid, NODES, &spec.arch.levels, block);
    block[0].rank = 1;
    sdm_pod_number(&spec.arch.levels, block);
    spec.blocks = block;
    spec.weights = (sdm_pod_weights){.head = head, .mean = mean, .basis = mean};
    sdm_error e = {0};
    if (sdm_pod_build(&spec, &bytes, size, &e)) fail_msg("%s", e.text);
    return bytes;
}

#endif
