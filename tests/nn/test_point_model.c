/* Point networks as models: maps against plain double arithmetic, derivatives against differences,
 * and damaged model files.
 * Tests: point_forward.c point_layout.c point_open.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "model_faults.h"
#include "sdm/internal/container.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/point_network.h"
#include "sdm/internal/rng.h"

enum { P = 3, U = P + 3, NX = 9, NY = 7, NZ = 5, VOXELS = NX * NY * NZ };

// A small random network on a rotated grid with anisotropic voxels.
typedef struct toy {
    sdm_model_param params[P];
    sdm_model_info info;
    sdm_point_spec spec;
    float *weights;
} toy;

static void toy_make(toy *t, bool imnet, bool half, int activation)
{
    *t = (toy){0};
    for (int i = 0; i < P; i++) {
        snprintf(t->params[i].name, sizeof t->params[i].name, "p%d", i);
        snprintf(t->params[i].unit, sizeof t->params[i].unit, "mm");
        t->params[i].min = -1.0 - i, t->params[i].max = 2.0 + i, t->params[i].def = 0.5;
    }
    t->info = (sdm_model_info){
        .n_params = P, .params = t->params, .shape = "toy", .seed = 77, .config = "seed: 77\n"};
    t->info.grid = sdm_grid_centred((const int64_t[]){NX, NY, NZ}, 0.2, (const double[]){1, 2, 3});
    t->info.grid.spacing[1] = 0.3;
    const double turned[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    memcpy(t->info.grid.dir, turned, sizeof turned);
    t->info.accuracy.rmse_mm = 0.25;
    t->spec = (sdm_point_spec){.info = &t->info, .kind = imnet ? "imnet" : "deepsdf", .half = half};
    t->spec.arch = (sdm_point_arch){.n_params = P,
                                    .depth = 3,
                                    .width = {imnet ? 140 : 70, 70, imnet ? 35 : 70},
                                    .skip = imnet ? 6 : 2,
                                    .activation = activation,
                                    .tanh_output = !imnet,
                                    .centre = {1, 2, 3},
                                    .radius = 1.5,
                                    .scale = 4};
    const size_t n = sdm_point_count(&t->spec.arch);
    assert_int_equal(SDM_ALLOC(&t->weights, n, "toy", NULL), SDM_OK);
    for (size_t i = 0; i < n; i++) t->weights[i] = (float)(0.12 * sdm_rng_normal(11, 1, i));
    t->spec.weights = t->weights;
}

static sdm_model *toy_open(const toy *t)
{
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e = {0};
    if (sdm_point_build(&t->spec, &bytes, &size, &e)) fail_msg("%s", e.text);
    if (sdm_model_open_memory("toy", bytes, size, &m, &e)) fail_msg("%s", e.text);
    sdm_free(bytes);
    return m;
}

static double activate(int kind, double x)
{
    return kind == 0   ? x / (1 + exp(-x))
           : kind == 1 ? tanh(x)
           : x > 0     ? x
           : kind == 2 ? 0
                       : 0.02 * x;
}

// The network as sdm/point_network.h defines it, in double, at one voxel.
static double reference(const toy *t, const double *p, size_t voxel)
{
    const sdm_point_arch *a = &t->spec.arch;
    const sdm_grid *g = &t->info.grid;
    const double index[3] = {(double)(voxel % NX), (double)(voxel / NX % NY),
                             (double)(voxel / NX / NY)};
    double u[U], h[256], next[256];
    for (int i = 0; i < P; i++)
        u[i] = 2 * (p[i] - t->params[i].min) / (t->params[i].max - t->params[i].min) - 1;
    for (int r = 0; r < 3; r++) {
        double world = g->origin[r];
        for (int c = 0; c < 3; c++) world += g->dir[3 * r + c] * g->spacing[c] * index[c];
        u[P + r] = (world - a->centre[r]) / a->radius;
    }
    const float *w = t->weights;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t before = l ? a->width[l - 1] : 0,
                     k = before + (l == 0 || a->skip >> l & 1 ? U : 0);
        for (size_t o = 0; o < a->width[l]; o++) {
            double s = w[a->width[l] * k + o];
            for (size_t i = 0; i < k; i++) s += w[o * k + i] * (i < before ? h[i] : u[i - before]);
            next[o] = activate(a->activation, s);
        }
        memcpy(h, next, sizeof h);
        w += a->width[l] * (k + 1);
    }
    const size_t last = a->width[a->depth - 1];
    double s = w[last];
    for (size_t i = 0; i < last; i++) s += w[i] * h[i];
    return a->scale * (a->tanh_output ? tanh(s) : s);
}

static void random_params(uint64_t index, double *p)
{
    for (int i = 0; i < P; i++)
        p[i] = -1.0 - i + (3.0 + 2 * i) * sdm_rng_uniform(5, 5, index * P + (uint64_t)i);
}

static void forward_is_the_definition(void **state)
{
    (void)state;
    for (int mode = 0; mode < 16; mode++) {
        toy t;
        toy_make(&t, mode & 1, mode & 2, mode / 4);
        sdm_model *m = toy_open(&t);
        assert_true(sdm_model_is_threaded(m));
        enum { N = 2 };
        double p[N * P];
        float maps[N * VOXELS], shared[N * VOXELS];
        void *scratch;
        for (uint64_t i = 0; i < N; i++) random_params(i, p + i * P);
        assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, N), 1, "scratch", NULL), 0);
        sdm_model_forward(m, p, N, maps, scratch);
        sdm_free(scratch);
        double size = 0, error = 0;
        for (size_t i = 0; i < N; i++)
            for (size_t v = 0; v < VOXELS; v++) {
                const double truth = reference(&t, p + i * P, v);
                size = fmax(size, fabs(truth));
                error = fmax(error, fabs(truth - (double)maps[i * VOXELS + v]));
            }
        assert_true(size > 0.05 && error < (mode & 2 ? 4e-3 : 1e-5) * size);
        for (int threads = 2; threads <= 3; threads++) { // Several threads give the same bits.
            assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes_threads(m, N, threads), 1,
                                       "scratch", NULL),
                             0);
            sdm_model_forward_threads(m, p, N, shared, scratch, threads);
            assert_memory_equal(shared, maps, sizeof maps);
            sdm_free(scratch);
        }
        sdm_model_free(m);
        sdm_free(t.weights);
    }
}

// A single hidden layer: no weights between hidden layers.
static void one_layer_works(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, false, true, 0);
    t.spec.arch.depth = 1;
    t.spec.arch.skip = 0;
    sdm_model *m = toy_open(&t);
    const double p[P] = {0.5, 0.5, 0.5};
    float map[VOXELS];
    void *scratch;
    assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "scratch", NULL), 0);
    sdm_model_forward(m, p, 1, map, scratch);
    for (size_t v = 0; v < VOXELS; v++)
        assert_true(fabs(reference(&t, p, v) - (double)map[v]) < 1e-5);
    sdm_free(scratch);
    sdm_model_free(m);
    sdm_free(t.weights);
}

static void jacobian_is_the_slope(void **state)
{
    (void)state;
    // SiLU and tanh only: the derivative of ReLU jumps at its kinks.
    for (int mode = 0; mode < 4; mode++) {
        toy t;
        toy_make(&t, mode & 1, false, mode / 2);
        sdm_model *m = toy_open(&t);
        void *scratch;
        float map[VOXELS], value[VOXELS], jacobian[P * VOXELS], shared[P * VOXELS];
        double p[P];
        assert_int_equal(
            sdm_alloc(&scratch, sdm_model_jacobian_scratch_bytes_threads(m, 3), 1, "scratch", NULL),
            0);
        for (uint64_t trial = 0; trial < 2; trial++) {
            random_params(trial, p);
            // scratch memory of the Jacobian is enough for a map
            sdm_model_forward(m, p, 1, map, scratch);
            sdm_model_jacobian_threads(m, p, value, shared, scratch, 3);
            sdm_model_jacobian(m, p, value, jacobian, scratch);
            assert_memory_equal(shared, jacobian, sizeof jacobian);
            for (size_t v = 0; v < VOXELS; v++) assert_true(fabsf(map[v] - value[v]) < 1e-5f);
            for (int i = 0; i < P; i++) {
                const double h = 1e-5, at = p[i];
                for (size_t v = 0; v < VOXELS; v++) {
                    p[i] = at + h;
                    const double up = reference(&t, p, v);
                    p[i] = at - h;
                    const double slope = (up - reference(&t, p, v)) / (2 * h);
                    p[i] = at;
                    assert_true(fabs(slope - (double)jacobian[(size_t)i * VOXELS + v]) <
                                1e-5 * (1 + fabs(slope)));
                }
            }
        }
        sdm_free(scratch);
        sdm_model_free(m);
        sdm_free(t.weights);
    }
}

static void file_keeps_everything(void **state)
{
    (void)state;
    toy t;
    for (int imnet = 0; imnet < 2; imnet++) {
        toy_make(&t, imnet, true, 0);
        sdm_model *m = toy_open(&t);
        const sdm_model_info *i = sdm_model_get_info(m);
        assert_string_equal(i->kind, imnet ? "imnet" : "deepsdf");
        assert_string_equal(i->shape, "toy");
        assert_memory_equal(&i->grid, &t.info.grid, sizeof i->grid);
        assert_true(i->accuracy.rmse_mm == 0.25 && i->seed == 77 && i->weight_bytes > 0);
        sdm_model_free(m);
        sdm_free(t.weights);
    }
    toy_make(&t, true, true, 0);
    t.spec.kind = "pod";
    uint8_t *bytes;
    size_t size;
    sdm_error e;
    assert_int_equal(sdm_point_build(&t.spec, &bytes, &size, &e), SDM_E_ARG);
    assert_string_equal(e.text,
                        "'pod' is no kind of point network; there are 'deepsdf' and 'imnet'");
    sdm_free(t.weights);
}

static void damage_is_refused(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, false, true, 2);
    uint8_t *bytes;
    size_t size;
    assert_int_equal(sdm_point_build(&t.spec, &bytes, &size, NULL), SDM_OK);
    for (size_t n = 0; n < size; n += n < 300 ? 1 : 211) expect_damaged(bytes, n, "truncation", n);
    for (size_t i = 0; i < size; i += i < 300 ? 1 : 101)
        for (int bit = 0; bit < 8; bit++) {
            bytes[i] ^= (uint8_t)(1 << bit);
            expect_damaged(bytes, size, "flipped bit", i);
            bytes[i] ^= (uint8_t)(1 << bit);
        }
    sdm_free(bytes);
    sdm_free(t.weights);
}

// Right checksums, but sections that contradict each other.
static void hostile_sections(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, false, false, 2);
    uint8_t *bytes, *changed;
    size_t size, changed_size, n;
    assert_int_equal(sdm_point_build(&t.spec, &bytes, &size, NULL), SDM_OK);
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    uint64_t checksum;
    assert_int_equal(sdm_container_parse(bytes, size, sections, names, &n, &checksum, NULL),
                     SDM_OK);
    assert_int_equal(n, 4);
    const sdm_section meta = sections[0];
    assert_string_equal(names[0], "meta");
    for (size_t i = 0; i < n; i++) sections[i].name = names[i];

    // Each case changes one line of the architecture.
    static const char *const lines[][2] = {
        {"point.depth=3", "point.depth=0"},   {"point.depth=3", "point.depth=4"},
        {"point.depth=3", "point.depth=2"},   {"point.width=70", "point.width=71"},
        {"point.width=70", "point.width=00"}, {"point.input=0", "point.input=1"},
        {"point.input=1", "point.input=0"},   {"point.activation=2", "point.activation=4"},
        {"point.half=0", "point.half=1"},     {"point.radius=1.5", "point.radius=-.5"},
        {"point.scale=4", "point.scale=0"},   {"kind=deepsdf", "kind=deepsdg"}};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        char text[4096];
        assert_true(meta.size < sizeof text && strlen(lines[i][0]) == strlen(lines[i][1]));
        memcpy(text, meta.data, meta.size);
        text[meta.size] = 0;
        char *at = strstr(text, lines[i][0]);
        assert_non_null(at);
        memcpy(at, lines[i][1], strlen(lines[i][1]));
        sections[0].data = text;
        assert_int_equal(sdm_container_build(sections, n, &changed, &changed_size, NULL), SDM_OK);
        expect_damaged(changed, changed_size, lines[i][1], i);
        sdm_free(changed);
    }
    sections[0] = meta;
    sections[0].name = names[0];
    // Sections that are missing, too short or too long.
    for (size_t i = 0; i < n; i++) {
        sdm_section left[4];
        size_t kept = 0;
        for (size_t k = 0; k < n; k++)
            if (k != i) left[kept++] = sections[k];
        assert_int_equal(sdm_container_build(left, kept, &changed, &changed_size, NULL), SDM_OK);
        expect_damaged(changed, changed_size, "missing section", i);
        sdm_free(changed);
        if (strncmp(names[i], "point.", 6) != 0) continue;
        sections[i].size -= 4;
        assert_int_equal(sdm_container_build(sections, n, &changed, &changed_size, NULL), SDM_OK);
        expect_damaged(changed, changed_size, "short section", i);
        sdm_free(changed);
        sections[i].size += 4;
    }
    sdm_free(bytes);
    sdm_free(t.weights);
}

static sdm_status build(const void *spec, uint8_t **bytes, size_t *size, sdm_error *err)
{
    return sdm_point_build(spec, bytes, size, err);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, false, false, 0);
    sdm_model_free(open_with_failing_allocations(build, &t.spec, 3, 4));
    sdm_free(t.weights);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forward_is_the_definition), cmocka_unit_test(one_layer_works),
        cmocka_unit_test(jacobian_is_the_slope),     cmocka_unit_test(file_keeps_everything),
        cmocka_unit_test(damage_is_refused),         cmocka_unit_test(hostile_sections),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
