/* Derivatives of the maps of a template network by the parameters, in forward mode. No
   allocation. */
#include <math.h>
#include <string.h>

#include "sdm/internal/mat3.h"
#include "template_derivative.h"

enum { BLOCK = SDM_TEMPLATE_STEP, VOXELS = SDM_TEMPLATE_BLOCK_VOXELS };

/* How a part without a warp moves in a direction: the derivative of the index at a voxel is an
   affine function of the voxel's index. */
typedef struct affine_motion {
    double from[3], by[3][3];
    float metric[6]; /* derivative of the metric */
} affine_motion;

/* Scratch memory of the derivatives along D directions. */
typedef struct slopes_work {
    template_work w;
    size_t n;                      /* D */
    double *dg;                    /* [D][N] */
    double (*dm)[9];               /* [D][n_parts] */
    double (*db)[3];               /* [D][n_parts] */
    affine_motion *affine;         /* [D][n_parts], of parts without a warp */
    warp_motion *warp;             /* [D] of one part */
    float *control;                /* [D] control displacements of the warp of one part */
    size_t control_size;           /* floats of one */
    float *points, *metric;        /* [D][stations][4], [D][stations][8] */
    warp_lines *lines;             /* [warps][D] */
    point_slope *station;          /* [stations] of one part */
    float *sample;                 /* [stations][8] derivatives of its samples */
    float *corner;                 /* [warps][D][corners][4] */
    template_slope_rows rows, far; /* of a block, or of a row of stations */
    float *slope[9];  /* [64] derivatives of the value by u and metric; 0: another part's */
    float *row[9];    /* [64] du, d metric */
    float *value;     /* [64] the map, or a derivative */
    uint8_t *nearest; /* [64] part with the smallest value */
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
    s->affine = sdm_template_take(memory, &at, n * k->n_parts * sizeof *s->affine);
    size_t control = 0, stations = k->stations[0] * k->stations[1] * k->stations[2], warps = 0;
    for (size_t c = 0; c < k->n_parts; c++) {
        const size_t count = sdm_lattice_count(&k->parts[c].warp);
        if (k->parts[c].n_modes && count > control) control = count;
        warps += k->parts[c].n_modes > 0;
    }
    s->control_size = 4 * control;
    s->control = sdm_template_take(memory, &at, n * s->control_size * sizeof *s->control);
    s->warp = sdm_template_take(memory, &at, (warps ? n : 0) * sizeof *s->warp);
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
    sdm_template_take_slope_rows(k, memory, &at, &s->rows, &s->far);
    for (int i = 0; i < 9; i++) {
        s->slope[i] = sdm_template_take(memory, &at, VOXELS * sizeof *s->slope[i]);
        s->row[i] = sdm_template_take(memory, &at, VOXELS * sizeof *s->row[i]);
    }
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

// Derivatives of the stations and corners of part c, which has a warp, along all directions.
static void warp_slopes(slopes_work *s, size_t c)
{
    const template_work *w = &s->w;
    const template_network *k = w->k;
    const sdm_template_part *part = &k->parts[c];
    const part_pose *pose = &w->pose[c];
    const size_t stations = k->stations[0] * k->stations[1] * k->stations[2],
                 first = warp_number(k, c) * s->n;
    sdm_template_station_slopes(w, c, &s->rows, &s->far, s->station);
    for (size_t d = 0; d < s->n; d++) {
        float *control = s->control + d * s->control_size;
        const double *dm = s->dm[d * k->n_parts + c];
        warp_motion *motion = &s->warp[d];
        *motion = (warp_motion){.control = control,
                                .points = s->points + 4 * (first + d) * stations,
                                .metric = s->metric + 8 * (first + d) * stations};
        for (int i = 0; i < 9; i++) motion->turns |= dm[i] != 0;
        sdm_template_inverse_slope(pose, dm, motion->inverse);
        m3_apply(pose->inverse, s->db[d * k->n_parts + c], motion->shift);
        sdm_template_control(part, s->dg + d * k->n_numbers + part->amplitudes, control);
    }
    sdm_template_invert_slopes(k, part, pose, w->grid, &w->warp[c], s->n, s->warp);
    for (size_t d = 0; d < s->n; d++) {
        const warp_motion *motion = &s->warp[d];
        station_motion change = {.points = motion->points, .metric = motion->metric};
        if (w->correction && c == 0) change.change = change_of_correction(s, d);
        sdm_template_corner_slopes(w, c, s->station, &change, s->sample,
                                   s->corner + 4 * (first + d) * count_corners(w));
        sdm_template_prefilter(k, motion->points);
        s->lines[first + d].plane_of = s->lines[first + d].line_of = SIZE_MAX;
    }
}

// How part c, which has no warp, moves along direction d.
static affine_motion motion_of(const slopes_work *s, size_t c, size_t d)
{
    const template_network *k = s->w.k;
    const part_pose *pose = &s->w.pose[c];
    const sdm_grid *grid = s->w.grid;
    const double per_mm = 1 / k->parts[c].near.spacing;
    affine_motion motion;
    double moved[9], x[3], shift[3];
    // q = m^-1 (x - b): dq = d(m^-1) (x - b) - m^-1 db
    sdm_template_inverse_slope(pose, s->dm[d * k->n_parts + c], moved);
    m3_apply(pose->inverse, s->db[d * k->n_parts + c], shift);
    for (int i = 0; i < 3; i++) x[i] = grid->origin[i] - pose->b[i];
    m3_apply(moved, x, motion.from);
    for (int i = 0; i < 3; i++) motion.from[i] = (motion.from[i] - shift[i]) * per_mm;
    for (int a = 0; a < 3; a++) {
        for (int i = 0; i < 3; i++) x[i] = grid->dir[3 * i + a] * grid->spacing[a] * per_mm;
        m3_apply(moved, x, motion.by[a]);
    }
    sdm_template_metric_slope(pose->inverse, moved, motion.metric);
    return motion;
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
        if (k->parts[c].n_modes)
            warp_slopes(s, c);
        else
            for (size_t d = 0; d < s->n; d++) s->affine[d * k->n_parts + c] = motion_of(s, c, d);
    }
}

// s->value = the derivative along direction d in the voxels of a block in which part c is the
// nearest, as far as it is computed exactly, after prepare_slopes().
static void exact_slope(slopes_work *s, size_t c, size_t d, const template_block *b)
{
    template_work *w = &s->w;
    const template_network *k = w->k;
    const template_table *t = sdm_template_kernels();
    if (w->part[c].warped) {
        sdm_template_expand(k, b, &s->lines[warp_number(k, c) * s->n + d], 9, s->row);
    } else {
        const affine_motion *motion = &s->affine[d * k->n_parts + c];
        sdm_template_affine(w, motion->from, motion->by, b, s->row);
        for (int a = 0; a < 6 && !w->part[c].rigid; a++)
            for (size_t v = 0; v < VOXELS; v++) s->row[3 + a][v] = motion->metric[a];
    }
    t->sum_products(w->part[c].rigid ? 3 : 9, (const float *const *)s->slope,
                    (const float *const *)s->row, s->value);
    if (w->correction && c == 0) {
        const template_correction change = change_of_correction(s, d);
        t->correct(&change, VOXELS, (const float *const *)w->row.u, s->value);
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

// s->slope = the derivatives of the value in the voxels of a block in which part c is the nearest;
// w->row = part c. blended: the values are wanted, too.
static void prepare_slopes(slopes_work *s, size_t c, const template_block *b, bool blended)
{
    sdm_template_block_slopes(&s->w, c, b, blended, &s->rows, &s->far, s->slope);
    const int n = s->w.part[c].rigid ? 3 : 9;
    for (size_t v = 0; v < VOXELS; v++)
        if (s->nearest[v] != c)
            for (int a = 0; a < n; a++) s->slope[a][v] = 0;
}

// Is part c the nearest in all voxels of a block?
static bool is_alone(const slopes_work *s, size_t c)
{
    unsigned others = 0;
    for (size_t v = 0; v < VOXELS; v++) others |= s->nearest[v] ^ (unsigned)c;
    return others == 0;
}

// Copies s->value to the voxels of a block in which part c is the nearest.
static void store_slope(const slopes_work *s, size_t c, const template_block *b, float *map)
{
    const size_t nx = (size_t)s->w.grid->n[0], ny = (size_t)s->w.grid->n[1];
    float *to = map + BLOCK * ((b->at[2] * ny + b->at[1]) * nx + b->at[0]);
    for (size_t z = 0; z < b->n[2]; z++)
        for (size_t y = 0; y < b->n[1]; y++)
            for (size_t x = 0, v = BLOCK * (BLOCK * z + y); x < b->n[0]; x++, v++)
                if (s->nearest[v] == c) to[(z * ny + y) * nx + x] = s->value[v];
}

// out[D] = the derivatives in the voxels of a block in which part c is the nearest.
static void block_slopes(slopes_work *s, size_t c, const template_block *b, float *const *out)
{
    template_work *w = &s->w;
    float far[VOXELS], change[VOXELS];
    const float share = w->part[c].warped ? sdm_template_far(w, c, b, far) : 0;
    if (share < 1) prepare_slopes(s, c, b, share > 0);
    const bool alone = is_alone(s, c);
    for (size_t d = 0; d < s->n; d++) {
        if (share == 1)
            far_slope(s, c, d, b, s->value);
        else
            exact_slope(s, c, d, b);
        if (share > 0 && share < 1) {
            far_slope(s, c, d, b, change);
            sdm_template_blend_slope(w, share, far, w->row.value, change, s->value);
        }
        if (alone)
            sdm_template_store(w, b, s->value, out[d]);
        else
            store_slope(s, c, b, out[d]);
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
