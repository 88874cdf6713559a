/* Makes the phantoms of an experiment: random shapes in random poses, with start poses at a given
 * distance from the true pose. */
#include <math.h>
#include <string.h>

#include "experiment_phantom.h"
#include "report/terminal.h"
#include "sdm/fit.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "sdm/phantom.h"

/* Streams of the random numbers: for the seeds of the phantoms, and for the directions of the start
 * poses. */
enum { STREAM_SEED = 910, STREAM_START = 911 };
#define TRANSLATION_MAX_MM 10.0 /* largest translation of a true pose */

static const double PI = 3.14159265358979323846;

static uint64_t phantom_seed(uint64_t seed, size_t index)
{
    uint32_t bits[4];
    sdm_rng_block(seed, STREAM_SEED, index, bits);
    return (uint64_t)bits[0] << 32 | bits[1];
}

/* v = a vector of the given length, its direction uniform on the sphere; first: index of the first
 * of three random numbers. */
static void random_vector(uint64_t seed, uint64_t first, double length, double v[3])
{
    double sum = 0;
    for (uint64_t i = 0; i < 3; i++) {
        v[i] = sdm_rng_normal(seed, STREAM_START, first + i);
        sum += v[i] * v[i];
    }
    for (int i = 0; i < 3; i++) v[i] *= length / sqrt(sum);
}

/* Returns the true pose, rotated by fit.off_deg about `middle` and translated by off_mm, both in
 * random directions. */
static sdm_pose perturb_pose(const sdm_experiment *e, double off_mm, uint64_t seed,
                             const sdm_pose *truth, const double middle[3])
{
    sdm_pose off = {{0, 0, 0}, {0, 0, 0}};
    double shift[3], turned[3];
    random_vector(seed, 0, e->fit.off_deg * PI / 180, off.rotation);
    random_vector(seed, 3, off_mm, shift);
    sdm_pose_apply(&off, middle, turned);
    for (int i = 0; i < 3; i++) off.translation[i] = middle[i] - turned[i] + shift[i];
    return sdm_pose_compose(&off, truth);
}

/* min .. max = bounding box of the shape in its true pose. */
static sdm_status find_box(const cli_experiment_job *job, const cli_experiment_phantom *p,
                           double min[3], double max[3], sdm_error *err)
{
    sdm_mesh mesh = {0};
    const sdm_status s = sdm_instance_mesh(job->shape, p->truth, &mesh, err);
    sdm_box box = SDM_BOX_EMPTY;
    for (size_t v = 0; v < mesh.n_vert && !s; v++)
        sdm_pose_apply(&p->pose, mesh.vert + 3 * v, mesh.vert + 3 * v);
    if (!s) sdm_box_add_mesh(&box, &mesh);
    for (int i = 0; i < 3; i++) min[i] = box.min[i], max[i] = box.max[i];
    sdm_mesh_dispose(&mesh);
    return s;
}

/* Makes a grid around the box. The grid contains all voxels that a fit uses, from its start pose to
 * its end. */
static sdm_status make_grid(const sdm_experiment *e, double off_mm, const double min[3],
                            const double max[3], sdm_grid *out, sdm_error *err)
{
    const double pad = sdm_fit_defaults().margin + off_mm;
    double middle[3];
    int64_t n[3];
    for (int i = 0; i < 3; i++) {
        const double voxels = ceil((max[i] - min[i] + 2 * pad) / e->fit.voxel);
        if (!(voxels < 4096))
            return sdm_fail(
                err, SDM_E_ARG,
                "fit.voxel: %g mm makes images of %.3g voxels along %c; use larger voxels",
                e->fit.voxel, voxels, "xyz"[i]);
        n[i] = 1 + (int64_t)voxels;
        middle[i] = 0.5 * (min[i] + max[i]);
    }
    *out = sdm_grid_centred(n, e->fit.voxel, middle);
    return sdm_grid_check(out, err);
}

/* The scanner of a method. */
static sdm_phantom_opts scanner(const cli_experiment_run *run, const sdm_experiment_method *m,
                                uint64_t seed)
{
    sdm_phantom_opts o = sdm_phantom_defaults();
    o.seed = seed;
    o.n_threads = (int)run->args->threads;
    o.cancelled = cli_interrupted;
    o.noise *= m->noise;
    o.inside.sd *= m->noise, o.outside.sd *= m->noise;
    for (int a = 0; a < 3; a++) o.blur[a] *= m->blur;
    o.inside.mean = o.outside.mean + m->contrast * (o.inside.mean - o.outside.mean);
    if (m->wrong == SDM_EXPERIMENT_ABSENT) o.inside = o.outside;
    return o;
}

/* Reverses every row of the image. */
static void mirror_image(const sdm_grid *g, float *values)
{
    for (size_t row = 0; row < (size_t)(g->n[1] * g->n[2]); row++, values += g->n[0])
        for (int64_t i = 0, k = g->n[0] - 1; i < k; i++, k--) {
            const float x = values[i];
            values[i] = values[k], values[k] = x;
        }
}

sdm_status cli_experiment_phantom_make(const cli_experiment_run *run, const cli_experiment_job *job,
                                       const sdm_experiment_method *method, size_t index,
                                       cli_experiment_phantom *out, sdm_error *err)
{
    const sdm_experiment *e = run->e;
    const cli_map_maker *m = &job->maker;
    const uint64_t seed = phantom_seed(e->experiment.seed, index);
    const sdm_phantom_opts opts = scanner(run, method, seed);
    double min[3], max[3], middle[3], off_mm = e->fit.off_mm;
    cli_maker_params(m, e->experiment.seed, index, out->truth);
    for (size_t i = 0; i < m->n_params; i++) {
        out->start[i] = 0.5 * (m->min[i] + m->max[i]);
        out->truth[i] = out->start[i] + e->fit.range * (out->truth[i] - out->start[i]);
    }
    out->contrast = opts.inside.mean - opts.outside.mean;
    out->pose = sdm_phantom_random_pose(PI, TRANSLATION_MAX_MM, seed);
    sdm_status s = find_box(job, out, min, max, err);
    if (s) return s;
    for (int i = 0; i < 3; i++) middle[i] = 0.5 * (min[i] + max[i]);
    if (method->wrong == SDM_EXPERIMENT_MOVED)
        for (int i = 0; i < 3; i++) off_mm = fmax(off_mm, max[i] - min[i]);
    out->start_pose = perturb_pose(e, off_mm, seed, &out->pose, middle);
    s = make_grid(e, off_mm, min, max, &out->grid, err);
    const size_t n = s ? 0 : sdm_grid_count(&out->grid);
    if (!s) s = SDM_ALLOC(&out->values, n, "image", err);
    if (!s) s = SDM_ALLOC(&out->label, n, "labels", err);
    if (!s)
        s = sdm_phantom_make(job->shape, out->truth, &out->pose, &opts, &out->grid, out->values,
                             out->label, err);
    for (size_t i = 0; i < n && !s && method->labels; i++) out->values[i] = out->label[i];
    if (!s && method->wrong == SDM_EXPERIMENT_MIRRORED) mirror_image(&out->grid, out->values);
    return s;
}

void cli_experiment_phantom_dispose(cli_experiment_phantom *p)
{
    sdm_free(p->values);
    sdm_free(p->label);
    memset(p, 0, sizeof *p);
}
