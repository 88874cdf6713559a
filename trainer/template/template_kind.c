/* The `template` network in the trainer: it is designed from meshes alone; if it has one part that
   is not rigid, a `pod` network learns the correction from exact maps. */
#include "template_kind.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "data/trilinear.h"
#include "data/workbench.h"
#include "design.h"
#include "pod/pod_kind.h"
#include "sdm/internal/checksum.h"
#include "sdm/memory.h"
#include "state/progress.h"
#include "template_parts.h"

/* Voxels between two nodes of the correction's grid. */
static const double CORRECTION_SPACING = 2;

/* t->design. */
typedef struct template_state {
    template_design design;
    bool corrected;
    sdm_grid grid;   /* of the correction, in the template's frame */
    size_t n_voxels; /* of this grid */
    double *nodes;   /* [n_voxels][3] its voxels */
    parameters none; /* weights of a network without a correction */
} template_state;

static const template_state *state_of(const trainer *t) { return t->design; }

/* out[n_voxels] = the correction that exact[nz][ny][nx], the exact map at p, asks for: exact minus
   carried template, at the points to which the nodes are carried. */
static sdm_status correction_of(const void *user, const double *p, const float *exact, float *out,
                                sdm_error *err)
{
    const template_state *s = user;
    const sdm_model *m = s->design.model;
    const sdm_grid *g = s->design.grid;
    float *map = NULL;
    double *x = NULL;
    void *scratch = NULL;
    const size_t n = sdm_grid_count(g);
    sdm_status status = SDM_ALLOC(&map, n, "correction", err);
    if (!status) status = SDM_ALLOC(&x, 3 * s->n_voxels, "correction", err);
    if (!status) status = sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "correction", err);
    if (!status) {
        sdm_model_forward(m, p, 1, map, scratch);
        for (size_t i = 0; i < n; i++) map[i] = exact[i] - map[i];
        status = sdm_template_carry(m, p, s->nodes, s->n_voxels, x, err);
    }
    for (size_t i = 0; i < s->n_voxels && !status; i++) {
        // outside of the grid the nearest point of the grid
        double index[3];
        sdm_grid_index(g, x + 3 * i, index);
        for (int a = 0; a < 3; a++) index[a] = fmin(fmax(index[a], 0), (double)g->n[a] - 1);
        out[i] = (float)trainer_trilinear(g, map, index);
    }
    sdm_free(scratch);
    sdm_free(x);
    sdm_free(map);
    return status;
}

/* The grid of the correction: the lattice `far` with its own spacing. */
static sdm_status correction_grid(template_state *s, sdm_error *err)
{
    const sdm_template_part *p = &s->design.parts[0];
    const double spacing = CORRECTION_SPACING * p->near.spacing;
    s->grid = (sdm_grid){.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int a = 0; a < 3; a++) {
        const double length = p->far.spacing * (p->far.n[a] - 1.0);
        s->grid.n[a] = (int64_t)ceil(length / spacing) + 1;
        s->grid.spacing[a] = spacing;
        s->grid.origin[a] =
            p->far.origin[a] + 0.5 * (length - spacing * (double)(s->grid.n[a] - 1));
    }
    s->n_voxels = sdm_grid_count(&s->grid);
    const sdm_status status = SDM_ALLOC(&s->nodes, 3 * s->n_voxels, "correction", err);
    for (size_t i = 0; i < s->n_voxels && !status; i++) {
        const size_t nx = (size_t)s->grid.n[0], ny = (size_t)s->grid.n[1];
        const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
        sdm_grid_world(&s->grid, index, s->nodes + 3 * i);
    }
    return status;
}

static const char *frame_name(sdm_template_frame f)
{
    return f == SDM_FRAME_RIGID ? "rigid" : f == SDM_FRAME_AFFINE ? "affine" : "still";
}

static void report_design(trainer *t, const template_state *s)
{
    const template_design *d = &s->design;
    size_t rigid = 0, affine = 0, still = 0, joints = 0, modes = 0;
    for (size_t c = 0; c < d->n_parts; c++) {
        const sdm_template_part *p = &d->parts[c];
        modes += p->n_modes;
        joints += p->n_modes > 0;
        rigid += !p->n_modes && p->frame == SDM_FRAME_RIGID;
        affine += !p->n_modes && p->frame == SDM_FRAME_AFFINE;
        still += !p->n_modes && p->frame == SDM_FRAME_NONE;
    }
    if (d->n_parts == 1 && modes)
        trainer_message(t,
                        "template: one part (%s frame) with a warp of %zu modes; polynomials of "
                        "degree %zu; error of the warp %.2g mm, of the amplitudes %.2g mm",
                        frame_name(d->parts[0].frame), modes, d->degree, d->warp_error_mm,
                        d->motion_error_mm);
    else {
        // parts that move together are one piece, one that bends is several
        char of[96] = "parts";
        if (d->n_parts != d->family.n_components)
            snprintf(of, sizeof of, "moving pieces of the %zu parts of the mesh",
                     d->family.n_components);
        trainer_message(t,
                        "template: %zu %s (%zu rigid, %zu affine, %zu still, %zu with warps of "
                        "%zu modes); polynomials of degree %zu; error of the frames %.2g mm, of "
                        "the warps %.2g mm",
                        d->n_parts, of, rigid, affine, still, joints, modes, d->degree,
                        d->motion_error_mm, d->warp_error_mm);
    }
}

/* Errors of a template without a correction, mm, root mean square. */
typedef struct design_error {
    double near; /* in voxels within a voxel of the surface */
    double all;
} design_error;

/* Compares a template without a correction with exact maps of a few random shapes. */
static sdm_status check_design(const trainer *t, const template_design *design, design_error *e,
                               sdm_error *err)
{
    enum { SHAPES = 8 };
    const dataset *d = &t->data;
    const sdm_model *m = design->model;
    const size_t n = sdm_grid_count(d->grid);
    const double near = d->grid->spacing[0];
    workbench w = {0};
    float *map = NULL;
    void *scratch = NULL;
    double sum = 0, count = 0, all = 0, p[SDM_POD_MAX_PARAMS];
    sdm_status status = trainer_workbench_create(&w, d, err);
    if (!status) status = SDM_ALLOC(&map, n, "template", err);
    if (!status) status = sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "template", err);
    for (size_t i = 0; i < SHAPES && !status; i++) {
        trainer_family_params(&design->family, TRAINER_FAMILY_UNUSED + i, p);
        if ((status = trainer_workbench_exact(&w, d, p, err))) break;
        sdm_model_forward(m, p, 1, map, scratch);
        for (size_t v = 0; v < n; v++) {
            const double difference = (double)map[v] - (double)w.exact[v];
            all += difference * difference / ((double)n * SHAPES);
            if (fabs((double)w.exact[v]) <= near) sum += difference * difference, count++;
        }
    }
    *e = (design_error){sqrt(sum / fmax(count, 1)), sqrt(all)};
    sdm_free(scratch);
    sdm_free(map);
    trainer_workbench_dispose(&w);
    return status;
}

/* Designs the shape as rigid pieces and joints, too, and takes this design if it is the better one:
   the error near the surface counts fully, that of all voxels a tenth. */
static sdm_status try_pieces(const trainer *t, template_design *d, design_error *e, sdm_error *err)
{
    template_design other = {.family = d->family, .grid = d->grid, .split = true};
    design_error its = {INFINITY, INFINITY};
    other.family.base = (sdm_mesh){0};
    other.family.place = other.family.component = NULL;
    sdm_status status = trainer_template_design(&other, err);
    if (!status && other.model) status = check_design(t, &other, &its, err);
    const bool better = !status && hypot(its.near, 0.1 * its.all) < hypot(e->near, 0.1 * e->all);
    if (better) {
        const template_design worse = *d;
        *d = other, *e = its;
        other = worse;
    }
    trainer_template_design_dispose(&other);
    return status;
}

static family family_of(const trainer *t)
{
    const dataset *d = &t->data;
    return (family){.shape = t->shape,
                    .n_params = d->n_params,
                    .min = d->min,
                    .max = d->max,
                    .distribution = d->distribution,
                    .seed = t->config->seed,
                    .until = t->design_until,
                    .n_threads = t->n_threads};
}

sdm_status trainer_template_look(const trainer *t, bool *bends, sdm_error *err)
{
    const family f = family_of(t);
    return trainer_template_bends(&f, TRAINER_RIGID * trainer_dataset_voxel(&t->data), bends, err);
}

sdm_status trainer_template_look_parts(const trainer *t, bool *divides, sdm_error *err)
{
    const family f = family_of(t);
    return trainer_template_divides(&f, TRAINER_RIGID * trainer_dataset_voxel(&t->data), divides,
                                    err);
}

/* Designs the network: from meshes, with a look at a few exact maps. */
static sdm_status make_design(const trainer *t, template_state *s, sdm_error *err)
{
    s->design.grid = &t->config->grid;
    s->design.family = family_of(t);
    design_error e = {0};
    sdm_status status = trainer_template_design(&s->design, err);
    if (status) return status;
    if ((status = check_design(t, &s->design, &e, err))) return status;
    if (s->design.parts[0].n_modes && (status = try_pieces(t, &s->design, &e, err))) return status;
    if (e.near > t->config->grid.spacing[0])
        return sdm_fail(
            err, SDM_E_UNSUPPORTED,
            "carried along, the template misses the surface by %.2g mm (%.1f voxels): "
            "parts of the mesh fold or turn too far for one warp; use network.kind: pod",
            e.near, e.near / t->config->grid.spacing[0]);
    s->design.family.until = 0;
    s->corrected = s->design.n_parts == 1 &&
                   (s->design.parts[0].n_modes || s->design.parts[0].frame == SDM_FRAME_AFFINE);
    return s->corrected ? correction_grid(s, err) : SDM_OK;
}

static sdm_status template_prepare(trainer *t, sdm_error *err)
{
    dataset *d = &t->data;
    template_state *s = t->design;
    if (!s) {
        sdm_status status = SDM_ALLOC(&s, 1, "template", err);
        t->design = s;
        if (!status) status = make_design(t, s, err);
        if (status) return status;
    }
    // a design that is taken over refers to the run that made it
    s->design.grid = &t->config->grid;
    s->design.family.min = d->min;
    s->design.family.max = d->max;
    s->design.family.distribution = d->distribution;
    report_design(t, s);
    d->only_holdout = !s->corrected;
    if (!s->corrected) return SDM_OK;
    d->target = (map_target){.grid = &s->grid, .make = correction_of, .user = s};
    return SDM_OK;
}

static size_t template_block(const sdm_config *c) { return trainer_kind_pod.block(c); }

static size_t template_levels(const sdm_config *c) { return trainer_kind_pod.levels(c); }

static void template_shares(trainer *t, size_t *share) { trainer_kind_pod.shares(t, share); }

static sdm_status template_begin(trainer *t, sdm_error *err)
{
    return state_of(t)->corrected ? trainer_kind_pod.begin(t, err) : SDM_OK;
}

static sdm_status template_samples_taken(trainer *t, const size_t *slots, size_t n, sdm_error *err)
{
    return state_of(t)->corrected ? trainer_kind_pod.samples_taken(t, slots, n, err) : SDM_OK;
}

static sdm_status template_run(trainer *t, bool resumed, sdm_error *err)
{
    return state_of(t)->corrected ? trainer_kind_pod.run(t, resumed, err) : SDM_OK;
}

static parameters *template_weights(trainer *t)
{
    template_state *s = t->design;
    return s->corrected ? trainer_kind_pod.weights(t) : &s->none;
}

static uint64_t template_fingerprint(const trainer *t)
{
    const template_state *s = state_of(t);
    const uint64_t design = sdm_model_get_info(s->design.model)->checksum;
    return sdm_crc64(s->corrected ? trainer_kind_pod.fingerprint(t) : 0, &design, sizeof design);
}

static sdm_status template_build(const trainer *t, const sdm_model_info *info, uint8_t **bytes,
                                 size_t *size, sdm_error *err)
{
    const template_state *s = state_of(t);
    sdm_template_spec spec = trainer_template_spec(&s->design);
    uint8_t *correction = NULL;
    sdm_status status = SDM_OK;
    spec.info = info;
    if (s->corrected) {
        sdm_model_info inner = *info;
        inner.grid = s->grid;
        inner.config = NULL;
        inner.n_options = 0;
        status = trainer_kind_pod.build(t, &inner, &correction, &spec.correction_size, err);
        spec.correction = correction;
    }
    if (!status) status = sdm_template_build(&spec, bytes, size, err);
    sdm_free(correction);
    return status;
}

static sdm_status template_parts(const trainer *t, error_measures *out, sdm_error *err)
{
    const template_state *s = state_of(t);
    out->motion_mm = s->design.motion_error_mm;
    out->warp_mm = s->design.warp_error_mm;
    out->corrects = true;
    return s->corrected ? trainer_kind_pod.parts(t, out, err) : SDM_OK;
}

static void template_dispose(trainer *t)
{
    template_state *s = t->design;
    trainer_kind_pod.dispose(t);
    if (!s) return;
    trainer_template_design_dispose(&s->design);
    sdm_free(s->nodes);
    sdm_free(s);
    t->design = NULL;
}

const train_kind trainer_kind_template = {.prepare = template_prepare,
                                          .block = template_block,
                                          .levels = template_levels,
                                          .shares = template_shares,
                                          .begin = template_begin,
                                          .samples_taken = template_samples_taken,
                                          .run = template_run,
                                          .weights = template_weights,
                                          .fingerprint = template_fingerprint,
                                          .build = template_build,
                                          .parts = template_parts,
                                          .dispose = template_dispose};
