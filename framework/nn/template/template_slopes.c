/* Derivatives of the maps of a template network by the parameters, in forward mode. No
   allocation. */
#include <math.h>
#include <string.h>

#include "template_derivative.h"

enum { BLOCK = SDM_TEMPLATE_STEP, VOXELS = SDM_TEMPLATE_BLOCK_VOXELS };

/* Derivatives of the value of a voxel: by its index u[3], and by the metric. */
typedef struct value_slope {
    float u[3], metric[6];
} value_slope;

// Derivatives of the value of part c in voxel i of w->row, after sdm_template_run().
static value_slope slope_of_value(const template_work *w, size_t c, size_t i)
{
    const template_row *r = &w->row;
    float u[3], metric[6];
    for (int a = 0; a < 3; a++) u[a] = r->u[a][i];
    for (int a = 0; a < 6; a++) metric[a] = r->metric[a][i];
    point_slope p;
    sdm_template_point_slope(w, c, u, metric, &p);
    value_slope out;
    for (int a = 0; a < 3; a++) out.u[a] = p.factor * p.df[a] + p.f * p.by_u[a] + p.dr[a];
    for (int a = 0; a < 6; a++) out.metric[a] = p.f * p.by_metric[a];
    return out;
}

/* Scratch memory of the derivatives along D directions. */
typedef struct slopes_work {
    template_work w;
    size_t n;               /* D */
    double *dg;             /* [D][N] */
    double (*dm)[9];        /* [D][n_parts] */
    double (*db)[3];        /* [D][n_parts] */
    float *control;         /* control displacements of the warp of the first part */
    float *points, *metric; /* [D][stations][4], [D][stations][8] */
    warp_lines *lines;      /* [warps][D] */
    point_slope *station;   /* [stations] of one part */
    float *sample;          /* [stations][8] derivatives of its samples */
    float *corner;          /* [warps][D][corners][4] */
    float *row[9];          /* [64] du, d metric */
    value_slope *slope;     /* [64] */
    float *value;           /* [64] the map, or a derivative */
    uint8_t *nearest;       /* [64] part with the smallest value */
} slopes_work;

// Number of corners of blocks.
static size_t count_corners(const template_work *w)
{
    return (w->blocks[0] + 1) * (w->blocks[1] + 1) * (w->blocks[2] + 1);
}

static size_t slopes_carve(const sdm_model *m, size_t n, size_t correction_scratch, void *memory,
                           slopes_work *s)
{
    const template_network *k = m->network;
    size_t at = sdm_template_carve(m, true, 1 + n, correction_scratch, memory, &s->w);
    s->n = n;
    s->dg = sdm_template_take(memory, &at, n * k->n_numbers * sizeof *s->dg);
    s->dm = sdm_template_take(memory, &at, n * k->n_parts * sizeof *s->dm);
    s->db = sdm_template_take(memory, &at, n * k->n_parts * sizeof *s->db);
    size_t control = 0, stations = k->stations[0] * k->stations[1] * k->stations[2], warps = 0;
    for (size_t c = 0; c < k->n_parts; c++) {
        const size_t count = sdm_lattice_count(&k->parts[c].warp);
        if (k->parts[c].n_modes && count > control) control = count;
        warps += k->parts[c].n_modes > 0;
    }
    s->control = sdm_template_take(memory, &at, 4 * control * sizeof *s->control);
    s->points = sdm_template_take(memory, &at, warps * n * 4 * stations * sizeof *s->points);
    s->metric = sdm_template_take(memory, &at, warps * n * 8 * stations * sizeof *s->metric);
    s->lines = sdm_template_take(memory, &at, warps * n * sizeof *s->lines);
    for (size_t i = 0; i < warps * n; i++) {
        warp_lines l = {.points = s->points + 4 * i * stations,
                        .metric = s->metric + 8 * i * stations};
        sdm_template_take_lines(k, memory, &at, &l);
        if (memory) s->lines[i] = l;
    }
    const size_t each = warps ? stations : 0;
    s->station = sdm_template_take(memory, &at, each * sizeof *s->station);
    s->sample = sdm_template_take(memory, &at, SAMPLE_SIZE * each * sizeof *s->sample);
    s->corner =
        sdm_template_take(memory, &at, warps * n * 4 * count_corners(&s->w) * sizeof *s->corner);
    for (int i = 0; i < 9; i++)
        s->row[i] = sdm_template_take(memory, &at, VOXELS * sizeof *s->row[i]);
    s->slope = sdm_template_take(memory, &at, VOXELS * sizeof *s->slope);
    s->value = sdm_template_take(memory, &at, VOXELS * sizeof *s->value);
    s->nearest = sdm_template_take(memory, &at, VOXELS);
    return at;
}

// number of parts with a warp before part c: where its derivatives are stored
static size_t warp_number(const template_network *k, size_t c)
{
    size_t n = 0;
    for (size_t i = 0; i < c; i++) n += k->parts[i].n_modes > 0;
    return n;
}

// The correction's derivative along direction d.
static template_correction change_of_correction(const slopes_work *s, size_t d)
{
    const template_network *k = s->w.k;
    template_correction change = k->correction_lattice;
    change.map = s->w.correction + (1 + d) * sdm_grid_count(&k->correction->info.grid);
    return change;
}

// Derivatives of the stations and corners of part c, which has a warp, along direction d.
static void warp_slopes(slopes_work *s, size_t c, size_t d)
{
    const template_work *w = &s->w;
    const template_network *k = w->k;
    const sdm_template_part *part = &k->parts[c];
    const size_t stations = k->stations[0] * k->stations[1] * k->stations[2],
                 at = warp_number(k, c) * s->n + d, pose = d * k->n_parts + c;
    float *points = s->points + 4 * at * stations, *metric = s->metric + 8 * at * stations;
    sdm_template_control(part, s->dg + d * k->n_numbers + part->amplitudes, s->control);
    sdm_template_invert_slope(k, part, &w->pose[c], w->grid, &w->warp[c], s->control, s->dm[pose],
                              s->db[pose], points, metric);
    station_motion motion = {.points = points, .metric = metric};
    if (w->correction && c == 0) motion.change = change_of_correction(s, d);
    sdm_template_corner_slopes(w, c, s->station, &motion, s->sample,
                               s->corner + 4 * at * count_corners(w));
    sdm_template_prefilter(k, points);
    s->lines[at].plane_of = s->lines[at].line_of = SIZE_MAX;
}

// Derivatives of frames and warps along direction[D][P], after sdm_template_begin().
static void slopes_begin(slopes_work *s, const double *direction)
{
    const template_network *k = s->w.k;
    const size_t n_params = s->w.model->info.n_params, N = k->n_numbers;
    for (size_t d = 0; d < s->n; d++) {
        double *dg = s->dg + d * N;
        for (size_t i = 0; i < N; i++) {
            dg[i] = 0;
            for (size_t p = 0; p < n_params; p++)
                dg[i] += direction[d * n_params + p] * s->w.dg[p * N + i];
        }
        sdm_template_frames_slope(k, s->w.g, dg, s->w.pose, s->dm + d * k->n_parts,
                                  s->db + d * k->n_parts);
    }
    for (size_t c = 0; c < k->n_parts; c++) {
        if (k->parts[c].n_modes == 0) continue;
        sdm_template_station_slopes(&s->w, c, s->station);
        for (size_t d = 0; d < s->n; d++) warp_slopes(s, c, d);
    }
}

// s->row = derivatives of u and metric of part c, which has no warp, in the voxels of a block.
static void affine_slope(const slopes_work *s, size_t c, size_t d, const template_block *block)
{
    const template_network *k = s->w.k;
    const part_pose *pose = &s->w.pose[c];
    const double *dm = s->dm[d * k->n_parts + c], *db = s->db[d * k->n_parts + c],
                 *b = pose->inverse;
    double moved[9];
    sdm_template_inverse_slope(pose, dm, moved);
    for (size_t line = 0; line < BLOCK * BLOCK; line++) {
        double du[2][3]; // at the first two voxels of the line
        for (int e = 0; e < 2; e++) {
            const double voxel[3] = {(double)(BLOCK * block->at[0]) + e,
                                     (double)(BLOCK * block->at[1] + line % BLOCK),
                                     (double)(BLOCK * block->at[2] + line / BLOCK)};
            double p[3];
            sdm_grid_world(s->w.grid, voxel, p);
            for (int i = 0; i < 3; i++) p[i] -= pose->b[i];
            for (int i = 0; i < 3; i++) {
                double sum = 0;
                for (int j = 0; j < 3; j++) sum += moved[3 * i + j] * p[j] - b[3 * i + j] * db[j];
                du[e][i] = sum / k->parts[c].near.spacing;
            }
        }
        for (int i = 0; i < 3; i++) {
            const float from = (float)du[0][i], by = (float)(du[1][i] - du[0][i]);
            for (size_t x = 0; x < BLOCK; x++) s->row[i][BLOCK * line + x] = from + by * (float)x;
        }
    }
    float metric[6];
    sdm_template_metric_slope(b, moved, metric);
    for (int i = 0; i < 6; i++)
        for (size_t v = 0; v < VOXELS; v++) s->row[3 + i][v] = metric[i];
}

// s->value = the derivative along direction d in the voxels of a block in which part c is the
// nearest, as far as it is computed exactly, after sdm_template_run().
static void exact_slope(slopes_work *s, size_t c, size_t d, const template_block *b)
{
    template_work *w = &s->w;
    const template_network *k = w->k;
    if (w->part[c].warped)
        sdm_template_expand(k, b, &s->lines[warp_number(k, c) * s->n + d], 9, s->row);
    else
        affine_slope(s, c, d, b);
    for (size_t v = 0; v < VOXELS; v++) {
        float sum = 0;
        for (int a = 0; a < 3 && s->nearest[v] == c; a++) sum += s->slope[v].u[a] * s->row[a][v];
        for (int a = 0; a < 6 && s->nearest[v] == c; a++)
            sum += s->slope[v].metric[a] * s->row[3 + a][v];
        s->value[v] = sum;
    }
    if (w->correction && c == 0) {
        const template_correction change = change_of_correction(s, d);
        sdm_template_kernels()->correct(&change, VOXELS, (const float *const *)w->row.u, s->value);
    }
}

// slope[64] = the derivative along direction d of the interpolated distances to part c in a block.
static void far_slope(const slopes_work *s, size_t c, size_t d, const template_block *b,
                      float *slope)
{
    const template_work *w = &s->w;
    const size_t at = warp_number(w->k, c) * s->n + d;
    const float *corner = s->corner + 4 * at * count_corners(w);
    sdm_template_interpolate(w, corner + 4 * sdm_template_corner_at(w, 0, b), slope);
}

// Evaluates the slopes of part c in the voxels of a block in which it is the nearest.
static void prepare_slopes(slopes_work *s, size_t c, const template_block *b)
{
    template_work *w = &s->w;
    if (w->loaded != c) sdm_template_run(w, c, b);
    if (w->part[c].rigid)
        for (int a = 0; a < 6; a++)
            for (size_t v = 0; v < VOXELS; v++) w->row.metric[a][v] = a < 3;
    for (size_t v = 0; v < VOXELS; v++)
        if (s->nearest[v] == c) s->slope[v] = slope_of_value(w, c, v);
}

// out[D] = the derivatives in the voxels of a block in which part c is the nearest.
static void block_slopes(slopes_work *s, size_t c, const template_block *b, float *const *out)
{
    template_work *w = &s->w;
    float far[VOXELS], change[VOXELS];
    const float share = w->part[c].warped ? sdm_template_far(w, c, b, far) : 0;
    if (share < 1) prepare_slopes(s, c, b);
    const size_t nx = (size_t)w->grid->n[0], ny = (size_t)w->grid->n[1],
                 first = BLOCK * ((b->at[2] * ny + b->at[1]) * nx + b->at[0]);
    for (size_t d = 0; d < s->n; d++) {
        if (share == 1)
            far_slope(s, c, d, b, s->value);
        else
            exact_slope(s, c, d, b);
        if (share > 0 && share < 1) {
            far_slope(s, c, d, b, change);
            sdm_template_blend_slope(w, share, far, w->row.value, change, s->value);
        }
        for (size_t z = 0; z < b->n[2]; z++)
            for (size_t y = 0; y < b->n[1]; y++)
                for (size_t x = 0, v = BLOCK * (BLOCK * z + y); x < b->n[0]; x++, v++)
                    if (s->nearest[v] == c) out[d][first + (z * ny + y) * nx + x] = s->value[v];
    }
}

// values = the map, out[D] = its derivatives
static void fill_slopes(slopes_work *s, float *values, float *const *out)
{
    template_work *w = &s->w;
    template_block b = sdm_template_first_block(w);
    do {
        sdm_template_values(w, &b, s->value, s->nearest);
        sdm_template_store(w, &b, s->value, values);
        for (size_t c = 0; c < w->k->n_parts; c++)
            if (memchr(s->nearest, (int)c, VOXELS)) block_slopes(s, c, &b, out);
    } while (sdm_template_next_block(w, &b));
}

// Bytes of scratch memory of the correction's Jacobian, or of its product with one direction.
static size_t correction_bytes(const template_network *k, bool jacobian)
{
    if (!k->correction) return 0;
    const sdm_model_kind *kind = k->correction->kind;
    return jacobian ? kind->jacobian_scratch_bytes(k->correction, 1)
                    : kind->jvp_scratch_bytes(k->correction, 1);
}

// values = the map, out[n] = its derivatives along direction[n][P]; jacobian: along all parameters
static void forward_mode(const sdm_model *m, const double *params, bool jacobian, size_t n,
                         const double *direction, float *values, float *const *out, void *scratch)
{
    const template_network *k = m->network;
    slopes_work s;
    slopes_carve(m, n, correction_bytes(k, jacobian), scratch, &s);
    if (k->correction) {
        const sdm_model_kind *kind = k->correction->kind;
        float *map = s.w.correction, *slopes = map + sdm_grid_count(&k->correction->info.grid);
        if (jacobian)
            kind->jacobian(k->correction, params, map, slopes, s.w.correction_scratch, 1);
        else
            kind->jvp(k->correction, params, direction, map, slopes, s.w.correction_scratch, 1);
    }
    sdm_template_begin(&s.w, params, true);
    slopes_begin(&s, direction);
    fill_slopes(&s, values, out);
}

size_t sdm_template_jacobian_scratch_bytes(const sdm_model *m, int n_threads)
{
    (void)n_threads;
    slopes_work s;
    return slopes_carve(m, m->info.n_params, correction_bytes(m->network, true), NULL, &s);
}

void sdm_template_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                           void *scratch, int n_threads)
{
    (void)n_threads;
    const size_t n = m->info.n_params, voxels = sdm_grid_count(&m->info.grid);
    double unit[SDM_POD_MAX_PARAMS * SDM_POD_MAX_PARAMS] = {0};
    float *out[SDM_POD_MAX_PARAMS];
    for (size_t i = 0; i < n; i++) unit[i * n + i] = 1, out[i] = jacobian + i * voxels;
    forward_mode(m, params, true, n, unit, values, out, scratch);
}

size_t sdm_template_jvp_scratch_bytes(const sdm_model *m, int n_threads)
{
    (void)n_threads;
    slopes_work s;
    return slopes_carve(m, 1, correction_bytes(m->network, false), NULL, &s);
}

void sdm_template_jvp(const sdm_model *m, const double *params, const double *direction,
                      float *values, float *tangent, void *scratch, int n_threads)
{
    (void)n_threads;
    forward_mode(m, params, false, 1, direction, values, &tangent, scratch);
}
