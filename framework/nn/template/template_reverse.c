/* The product of an adjoint with the Jacobian of a template network, in reverse mode: adjoints of
   the blocks are carried back to frames, warps and parameters. No allocation. */
#include <string.h>

#include "sdm/internal/mat3.h"
#include "template_adjoints.h"

enum { VOXELS = SDM_TEMPLATE_BLOCK_VOXELS };

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

// Scratch memory of the correction: of its map, later of its product with an adjoint.
static size_t correction_bytes(const template_network *k)
{
    if (!k->correction) return 0;
    const sdm_model_kind *kind = k->correction->kind;
    return larger(kind->scratch_bytes(k->correction, 1, 1), kind->vjp_scratch_bytes(k->correction));
}

static size_t take_parts(const sdm_model *m, void *memory, size_t at, reverse_work *s)
{
    const template_network *k = m->network;
    size_t control = 0, stations = 0;
    s->part = sdm_template_take(memory, &at, k->n_parts * sizeof *s->part);
    for (size_t c = 0; c < k->n_parts; c++) {
        part_adjoint a = {.points = NULL};
        if (k->parts[c].n_modes) {
            control = larger(control, 4 * sdm_lattice_count(&k->parts[c].warp));
            stations = s->stations;
            a.points = sdm_template_take(memory, &at, 4 * stations * sizeof *a.points);
            a.station = sdm_template_take(memory, &at, 8 * stations * sizeof *a.station);
            a.corner = sdm_template_take(memory, &at, 4 * s->corners * sizeof *a.corner);
        }
        if (memory) s->part[c] = a;
    }
    s->control = sdm_template_take(memory, &at, control * sizeof *s->control);
    s->station = sdm_template_take(memory, &at, stations * sizeof *s->station);
    s->sample = sdm_template_take(memory, &at, SAMPLE_SIZE * stations * sizeof *s->sample);
    s->dm = sdm_template_take(memory, &at, k->n_parts * sizeof *s->dm);
    s->db = sdm_template_take(memory, &at, k->n_parts * sizeof *s->db);
    return at;
}

static size_t reverse_carve(const sdm_model *m, void *memory, reverse_work *s)
{
    const template_network *k = m->network;
    size_t at = sdm_template_carve(m, true, 1, correction_bytes(k), memory, &s->w);
    s->stations = k->stations[0] * k->stations[1] * k->stations[2];
    s->corners = (k->stations[0] - 2) * (k->stations[1] - 2) * (k->stations[2] - 2);
    at = take_parts(m, memory, at, s);
    const size_t nodes = k->correction ? sdm_grid_count(&k->correction->info.grid) : 0;
    s->correction = sdm_template_take(memory, &at, nodes * sizeof *s->correction);
    s->correction_gradient = sdm_template_take(
        memory, &at, (nodes ? m->info.n_params : 0) * sizeof *s->correction_gradient);
    sdm_template_take_slope_rows(k, memory, &at, &s->rows, &s->far);
    float **const of_block[] = {&s->given, &s->exact, &s->interpolated, &s->value};
    for (size_t i = 0; i < sizeof of_block / sizeof *of_block; i++)
        *of_block[i] = sdm_template_take(memory, &at, VOXELS * sizeof(float));
    for (int i = 0; i < 9; i++) {
        s->slope[i] = sdm_template_take(memory, &at, VOXELS * sizeof *s->slope[i]);
        s->row[i] = sdm_template_take(memory, &at, VOXELS * sizeof *s->row[i]);
    }
    s->nearest = sdm_template_take(memory, &at, VOXELS);
    return at;
}

// Sets all adjoints to 0, after sdm_template_begin().
static void clear(reverse_work *s)
{
    const template_network *k = s->w.k;
    for (size_t c = 0; c < k->n_parts; c++) {
        const part_adjoint a = s->part[c];
        s->part[c] = (part_adjoint){.points = a.points, .station = a.station, .corner = a.corner};
        if (!k->parts[c].n_modes) continue;
        memset(a.points, 0, 4 * s->stations * sizeof *a.points);
        memset(a.station, 0, 8 * s->stations * sizeof *a.station);
        memset(a.corner, 0, 4 * s->corners * sizeof *a.corner);
    }
    if (k->correction)
        memset(s->correction, 0, sdm_grid_count(&k->correction->info.grid) * sizeof *s->correction);
}

/* Parts: from adjoints of indices and stations to those of the inverse of the frame's matrix, of
   the shift (see warp_motion) and of the control points. */

// The transpose of motion_of() in template_slopes.c.
static void affine_back(reverse_work *s, size_t c)
{
    const template_work *w = &s->w;
    const part_pose *pose = &w->pose[c];
    part_adjoint *part = &s->part[c];
    const double per_mm = 1 / w->k->parts[c].near.spacing;
    for (int i = 0; i < 3; i++) {
        part->warp.shift[i] = -part->from[i] * per_mm;
        for (int j = 0; j < 3; j++) {
            double sum = part->from[i] * (w->grid->origin[j] - pose->b[j]);
            for (int a = 0; a < 3; a++)
                sum += part->by[a][i] * w->grid->dir[3 * j + a] * w->grid->spacing[a];
            part->warp.inverse[3 * i + j] = sum * per_mm;
        }
    }
    if (!w->part[c].rigid)
        sdm_template_metric_slope_back(pose->inverse, part->metric, part->warp.inverse);
}

static void warp_back(reverse_work *s, size_t c)
{
    const template_work *w = &s->w;
    const template_network *k = w->k;
    part_adjoint *part = &s->part[c];
    const station_adjoint to = {.points = part->points,
                                .metric = part->station,
                                .change = w->correction && c == 0 ? s->correction : NULL};
    sdm_template_prefilter_back(k, part->points);
    sdm_template_station_slopes(w, c, &s->rows, &s->far, s->station);
    sdm_template_corner_slopes_back(w, c, s->station, part->corner, s->sample, &to);
    part->warp.control = s->control;
    memset(s->control, 0, 4 * sdm_lattice_count(&k->parts[c].warp) * sizeof *s->control);
    sdm_template_invert_back(k, &k->parts[c], &w->pose[c], w->grid, &w->warp[c], part->points,
                             part->station, &part->warp);
}

/* From the adjoints of frames, warps and correction to the gradient by the parameters. */

static double dot(const double *a, const double *b, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

// Adds to gradient[P] what follows from the amplitudes of part c.
static void add_amplitudes(const reverse_work *s, size_t c, double *gradient)
{
    const template_work *w = &s->w;
    const sdm_template_part *part = &w->k->parts[c];
    double adjoint[SDM_TEMPLATE_MAX_MODES];
    sdm_template_control_back(part, s->part[c].warp.control, adjoint);
    for (size_t p = 0; p < w->model->info.n_params; p++)
        gradient[p] += dot(w->dg + p * w->k->n_numbers + part->amplitudes, adjoint, part->n_modes);
}

// Adds to gradient[P] what follows from the frames.
static void add_frames(const reverse_work *s, double *gradient)
{
    const template_work *w = &s->w;
    const template_network *k = w->k;
    for (size_t p = 0; p < w->model->info.n_params; p++) {
        sdm_template_frames_slope(k, w->g, w->dg + p * k->n_numbers, w->pose, s->dm, s->db);
        for (size_t c = 0; c < k->n_parts; c++) {
            double inverse[9], shift[3];
            sdm_template_inverse_slope(&w->pose[c], s->dm[c], inverse);
            m3_apply(w->pose[c].inverse, s->db[c], shift);
            gradient[p] +=
                dot(inverse, s->part[c].warp.inverse, 9) + dot(shift, s->part[c].warp.shift, 3);
        }
    }
}

static void add_correction(const reverse_work *s, const double *params, double *gradient)
{
    const sdm_model *correction = s->w.k->correction;
    correction->kind->vjp(correction, params, s->correction, s->correction_gradient,
                          s->w.correction_scratch);
    for (size_t p = 0; p < s->w.model->info.n_params; p++) gradient[p] += s->correction_gradient[p];
}

size_t sdm_template_vjp_scratch_bytes(const sdm_model *m)
{
    reverse_work s;
    return reverse_carve(m, NULL, &s);
}

void sdm_template_vjp(const sdm_model *m, const double *params, const float *adjoint,
                      double *gradient, void *scratch)
{
    const template_network *k = m->network;
    reverse_work s;
    reverse_carve(m, scratch, &s);
    s.adjoint = adjoint;
    if (k->correction)
        k->correction->kind->forward(k->correction, params, 1, s.w.correction,
                                     s.w.correction_scratch, 1);
    sdm_template_begin(&s.w, params, true);
    clear(&s);
    sdm_template_blocks_back(&s);
    memset(gradient, 0, m->info.n_params * sizeof *gradient);
    for (size_t c = 0; c < k->n_parts; c++) {
        if (k->parts[c].n_modes) {
            warp_back(&s, c);
            add_amplitudes(&s, c, gradient);
        } else {
            affine_back(&s, c);
        }
    }
    add_frames(&s, gradient);
    if (k->correction) add_correction(&s, params, gradient);
}
