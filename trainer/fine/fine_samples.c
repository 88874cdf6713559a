/* Samples for the fine level from exact maps that are thrown away. */
#include "fine_samples.h"

#include <math.h>

#include "data/streams.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/near.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/sampling.h"
#include "sdm/memory.h"
#include "state/progress.h"

/* Shapes that are made whatever the time. */
enum { LEAST_SHAPES = 16 };

/* The memory of a thread. */
typedef struct bench {
    sdm_grid fine;
    float *map, *halved, *exact; /* by the network; between its voxels; exact, on the fine grid */
    void *scratch;
    sdm_mesh mesh;
} bench;

static sdm_status bench_create(bench *b, const sdm_model *m, sdm_error *err)
{
    const sdm_grid *g = &sdm_model_get_info(m)->grid;
    *b = (bench){.fine = sdm_fine_grid(g)};
    const size_t voxels = sdm_grid_count(&b->fine);
    sdm_status s = SDM_ALLOC(&b->map, sdm_grid_count(g), "maps of the fine level", err);
    if (!s) s = SDM_ALLOC(&b->halved, voxels, "maps of the fine level", err);
    if (!s) s = SDM_ALLOC(&b->exact, voxels, "maps of the fine level", err);
    return s ? s
             : sdm_alloc(&b->scratch, sdm_model_scratch_bytes_threads(m, 1, 1), 1,
                         "maps of the fine level", err);
}

static void bench_dispose(bench *b)
{
    sdm_mesh_dispose(&b->mesh);
    sdm_free(b->scratch);
    sdm_free(b->exact);
    sdm_free(b->halved);
    sdm_free(b->map);
}

static sdm_status exact_map(bench *b, const sdm_instance *shape, const double *p, sdm_error *err)
{
    const sdm_exact_opts opts = {.n_threads = 1};
    sdm_exact *engine = NULL;
    sdm_status s = sdm_instance_mesh(shape, p, &b->mesh, err);
    if (!s) s = sdm_exact_create(&b->mesh, &opts, &engine, err);
    if (!s) s = sdm_exact_map(engine, &b->fine, b->exact, err);
    sdm_exact_free(engine);
    return s ? sdm_fail_in(err, s, "shape '%s'", sdm_instance_shape(shape)->name) : SDM_OK;
}

/* Adds the changes wanted on all new voxels to sums[4]: squares, then counts. */
static void measure(const bench *b, double near_mm, double sums[4])
{
    const int64_t *n = b->fine.n;
    size_t i = 0;
    for (int64_t z = 0; z < n[2]; z++)
        for (int64_t y = 0; y < n[1]; y++)
            for (int64_t x = 0; x < n[0]; x++, i++) {
                if (!((x | y | z) & 1)) continue;
                const double e = (double)b->exact[i] - b->halved[i];
                const bool near = fabs((double)b->exact[i]) <= near_mm;
                sums[0] += e * e, sums[2] += 1;
                if (near) sums[1] += e * e, sums[3] += 1;
            }
}

/* Fills sample i from a cell. */
static void fill_sample(const bench *b, const sdm_grid *g, float threshold, uint32_t cell,
                        fine_samples *out, size_t i)
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1], fx = 2 * nx - 1, fy = 2 * ny - 1;
    const size_t at = (2 * (cell / nx / ny) * fy + 2 * (cell / nx % ny)) * fx + 2 * (cell % nx);
    sdm_fine_inputs(g, threshold, b->map, cell, out->x + i * SDM_FINE_INPUTS, &out->gate[i]);
    for (size_t q = 1; q < SDM_FINE_OUTPUTS; q++) {
        const size_t v = at + (q / 4 * fy + q / 2 % 2) * fx + q % 2;
        out->y[i * SDM_FINE_OUTPUTS + q] = (b->exact[v] - b->halved[v]) / sdm_fine_unit(g);
    }
}

/* What the threads share. */
typedef struct sample_job {
    const trainer *t;
    const sdm_model *m;
    const sdm_fine *f;
    float threshold;
    size_t first, per_shape;
    fine_samples *out;
    double (*sums)[4]; /* [shapes] of measure() */
} sample_job;

static sdm_status sample_shape(const sample_job *j, bench *b, size_t shape, sdm_error *err)
{
    const dataset *d = &j->t->data;
    const sdm_grid *g = &sdm_model_get_info(j->m)->grid;
    double p[SDM_POD_MAX_PARAMS];
    uint32_t *cells = NULL;
    size_t n = 0;
    if (trainer_cancelled(j->t)) return sdm_fail(err, SDM_E_CANCELLED, "stopped on request");
    sdm_sample_params(d->seed, STREAM_FINE, j->first + shape, d->min, d->max, d->distribution,
                      d->n_params, p);
    sdm_status s = exact_map(b, d->shape, p, err);
    if (s) return s;
    sdm_model_forward_threads(j->m, p, 1, b->map, b->scratch, 1);
    s = sdm_fine_map(j->f, g, 0, b->map, 1, b->halved, err);
    if (!s) s = sdm_fine_cells(g, j->threshold, b->map, &cells, &n, err);
    if (!s) measure(b, sdm_grid_near(g), j->sums[shape]);
    for (size_t i = 0; i < j->per_shape && n && !s; i++) {
        const size_t to = shape * j->per_shape + i;
        const double u =
            sdm_rng_uniform(d->seed, STREAM_FINE + 1, (j->first + shape) * j->per_shape + i);
        const size_t cell = (size_t)(((double)i + u) / (double)j->per_shape * (double)n);
        fill_sample(b, g, j->threshold, cells[cell < n ? cell : n - 1], j->out, to);
    }
    sdm_free(cells);
    return s;
}

sdm_status trainer_fine_samples(const trainer *t, const sdm_model *m, const sdm_fine *f,
                                float threshold, size_t first, size_t n_shapes, size_t per_shape,
                                double until, fine_samples *out, sdm_error *err)
{
    const size_t n = n_shapes * per_shape;
    sample_job j = {.t = t,
                    .m = m,
                    .f = f,
                    .threshold = threshold,
                    .first = first,
                    .per_shape = per_shape,
                    .out = out};
    *out = (fine_samples){.n = n};
    sdm_status s = SDM_ALLOC(&out->x, n * SDM_FINE_INPUTS, "samples of the fine level", err);
    if (!s) s = SDM_ALLOC(&out->gate, n, "samples of the fine level", err);
    if (!s) s = SDM_ALLOC(&out->y, n * SDM_FINE_OUTPUTS, "samples of the fine level", err);
    if (!s) s = SDM_ALLOC(&j.sums, n_shapes, "samples of the fine level", err);
    if (s) return s;
    size_t end = n_shapes; // of the shapes whose samples count
#pragma omp parallel num_threads(t->n_threads)
    {
        bench b;
        sdm_error mine = {0};
        sdm_status my = bench_create(&b, m, &mine);
#pragma omp for schedule(dynamic)
        for (size_t i = 0; i < n_shapes; i++) {
            if (i >= LEAST_SHAPES && trainer_seconds(t) > until) {
#pragma omp critical(sdm_fine_samples)
                end = i < end ? i : end;
            } else if (!my) {
                my = sample_shape(&j, &b, i, &mine);
            }
        }
        bench_dispose(&b);
#pragma omp critical(sdm_fine_samples)
        if (my && !s) {
            s = my;
            if (err) *err = mine;
        }
    }
    out->n = end * per_shape;
    for (size_t i = 0; i < end && !s; i++)
        for (int k = 0; k < 2; k++) {
            out->square[k] += j.sums[i][k];
            out->count[k] += j.sums[i][2 + k];
        }
    sdm_free(j.sums);
    return s;
}

void trainer_fine_samples_dispose(fine_samples *s)
{
    sdm_free(s->y);
    sdm_free(s->gate);
    sdm_free(s->x);
    *s = (fine_samples){0};
}
