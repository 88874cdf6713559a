/* Evaluates the parts of a template network in patches of voxels. */
#include "template_rows.h"

#include <math.h>
#include <string.h>

/* Voxels of a block along x, y, z. */
static const size_t BLOCK[3] = {4, 4, 4};
enum { BLOCK_VOXELS = 4 * 4 * 4 };

size_t sdm_template_row_floats(const sdm_grid *grid)
{
    const size_t n = (size_t)grid->n[0] > BLOCK_VOXELS ? (size_t)grid->n[0] : BLOCK_VOXELS;
    return (n + 3 * SDM_TEMPLATE_LANES) / SDM_TEMPLATE_LANES * SDM_TEMPLATE_LANES;
}

static size_t station_count(const template_network *k)
{
    return k->stations[0] * k->stations[1] * k->stations[2];
}

static void carve_row(const sdm_grid *grid, void *memory, size_t *at, template_row *r)
{
    const size_t bytes = sdm_template_row_floats(grid) * sizeof(float);
    float **const fields[] = {
        &r->u[0],      &r->u[1],      &r->u[2],      &r->metric[0], &r->metric[1], &r->metric[2],
        &r->metric[3], &r->metric[4], &r->metric[5], &r->f,         &r->g[0],      &r->g[1],
        &r->g[2],      &r->far_f,     &r->far_g[0],  &r->far_g[1],  &r->far_g[2],  &r->value};
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++)
        *fields[i] = sdm_template_take(memory, at, bytes);
}

void *sdm_template_take(void *memory, size_t *at, size_t bytes)
{
    void *p = memory ? (uint8_t *)memory + *at : NULL;
    *at += (bytes + 63) / 64 * 64;
    return p;
}

size_t sdm_template_carve(const sdm_model *m, bool slopes, size_t correction_maps,
                          size_t correction_scratch, void *memory, template_work *w)
{
    const template_network *k = m->network;
    const size_t n = station_count(k);
    size_t at = 0;
    *w = (template_work){.model = m, .k = k, .grid = &m->info.grid};
    w->g = sdm_template_take(memory, &at, k->n_numbers * sizeof *w->g);
    w->dg = sdm_template_take(memory, &at,
                              (slopes ? m->info.n_params * k->n_numbers : 0) * sizeof *w->dg);
    w->phi = sdm_template_take(memory, &at, sdm_template_numbers_scratch(m) * sizeof *w->phi);
    w->pose = sdm_template_take(memory, &at, k->n_parts * sizeof *w->pose);
    for (size_t c = 0; c < k->n_parts; c++) {
        if (k->parts[c].n_modes == 0) continue;
        warp_scratch *s = &w->warp[c];
        s->control = sdm_template_take(
            memory, &at, 4 * sdm_lattice_count(&k->parts[c].warp) * sizeof *s->control);
        s->points = sdm_template_take(memory, &at, 4 * n * sizeof *s->points);
        s->metric = sdm_template_take(memory, &at, 8 * n * sizeof *s->metric);
        s->plane =
            sdm_template_take(memory, &at, 12 * k->stations[0] * k->stations[1] * sizeof *s->plane);
        s->line = sdm_template_take(memory, &at, 12 * k->stations[0] * sizeof *s->line);
        if (slopes) s->station = sdm_template_take(memory, &at, n * sizeof *s->station);
    }
    for (int a = 0; a < 3; a++) w->blocks[a] = ((size_t)w->grid->n[a] + BLOCK[a] - 1) / BLOCK[a];
    for (size_t c = 0; c < k->n_parts; c++) w->by_lines |= k->parts[c].n_modes > 0;
    const size_t blocks = w->by_lines ? 0 : w->blocks[0] * w->blocks[1] * w->blocks[2];
    w->centre = sdm_template_take(memory, &at, 4 * k->n_parts * blocks * sizeof *w->centre);
    w->value = sdm_template_take(memory, &at, sdm_template_row_floats(w->grid) * sizeof *w->value);
    w->part = sdm_template_take(memory, &at, k->n_parts * sizeof *w->part);
    for (int a = 0; a < 3; a++)
        w->offset[a] = sdm_template_take(memory, &at, BLOCK_VOXELS * sizeof *w->offset[a]);
    if (k->correction) {
        w->correction = sdm_template_take(
            memory, &at,
            correction_maps * sdm_grid_count(&k->correction->info.grid) * sizeof *w->correction);
        w->correction_scratch = sdm_template_take(memory, &at, correction_scratch);
        w->correction_at = k->correction_lattice;
        w->correction_at.map = w->correction;
    }
    carve_row(w->grid, memory, &at, &w->row);
    return at;
}

void sdm_template_plane(const template_network *k, const float *points, const float *metric,
                        size_t z, float *plane)
{
    const size_t n = k->stations[0] * k->stations[1], cell = z / k->step, phase = z % k->step;
    const float *p = points + 4 * n * cell, *g = metric + 8 * n * (cell + 1);
    float w[4];
    for (int a = 0; a < 4; a++) w[a] = k->expansion.cubic[a][phase];
    const float t = k->expansion.linear[phase];
    float *out = plane, *out_metric = plane + 4 * n;
    for (size_t i = 0; i < 4 * n; i++)
        out[i] = w[0] * p[i] + w[1] * p[4 * n + i] + w[2] * p[8 * n + i] + w[3] * p[12 * n + i];
    for (size_t i = 0; i < 8 * n; i++) out_metric[i] = g[i] + t * (g[8 * n + i] - g[i]);
}

void sdm_template_line(const template_network *k, const float *plane, size_t y, float *line)
{
    const size_t n = k->stations[0], cell = y / k->step, phase = y % k->step;
    const float *p = plane + 4 * n * cell, *g = plane + 4 * n * k->stations[1] + 8 * n * (cell + 1);
    float w[4];
    for (int a = 0; a < 4; a++) w[a] = k->expansion.cubic[a][phase];
    const float t = k->expansion.linear[phase];
    float *out = line, *out_metric = line + 4 * n;
    for (size_t i = 0; i < 4 * n; i++)
        out[i] = w[0] * p[i] + w[1] * p[4 * n + i] + w[2] * p[8 * n + i] + w[3] * p[12 * n + i];
    for (size_t i = 0; i < 8 * n; i++) out_metric[i] = g[i] + t * (g[8 * n + i] - g[i]);
}

// from[3], by[3][3] of an affine_part
static void affine_index(const template_work *w, size_t c, double u[3], double by[3][3])
{
    const part_pose *pose = &w->pose[c];
    const sdm_lattice *l = &w->k->parts[c].near;
    const sdm_grid *g = w->grid;
    const double *m = pose->inverse;
    double x[3];
    for (int i = 0; i < 3; i++) x[i] = g->origin[i] - pose->b[i];
    for (int i = 0; i < 3; i++) {
        u[i] = (m[3 * i] * x[0] + m[3 * i + 1] * x[1] + m[3 * i + 2] * x[2] - l->origin[i]) /
               l->spacing;
        for (int a = 0; a < 3; a++)
            by[a][i] = (m[3 * i] * g->dir[a] + m[3 * i + 1] * g->dir[3 + a] +
                        m[3 * i + 2] * g->dir[6 + a]) *
                       g->spacing[a] / l->spacing;
    }
}

static void affine_run(const template_work *w, size_t c, const template_patch *p, bool rigid)
{
    const affine_part *part = &w->part[c];
    const bool whole = !w->by_lines && p->count == BLOCK_VOXELS;
    for (int i = 0; i < 3; i++) {
        float *u = w->row.u[i];
        const float first =
            (float)(part->from[i] + part->by[0][i] * (double)p->at[0] +
                    part->by[1][i] * (double)p->at[1] + part->by[2][i] * (double)p->at[2]);
        const float bx = (float)part->by[0][i], by = (float)part->by[1][i],
                    bz = (float)part->by[2][i];
        for (size_t v = 0; v < BLOCK_VOXELS && whole; v++)
            u[v] = first + (bx * w->offset[0][v] + (by * w->offset[1][v] + bz * w->offset[2][v]));
        for (size_t z = 0; z < p->n[2] && !whole; z++)
            for (size_t y = 0; y < p->n[1]; y++, u += p->n[0])
                for (size_t x = 0; x < p->n[0]; x++)
                    u[x] = first + (bx * (float)x + (by * (float)y + bz * (float)z));
    }
    if (rigid) return;
    float metric[6];
    sdm_template_metric(w->pose[c].inverse, metric);
    for (int a = 0; a < 6; a++)
        for (size_t i = 0; i < p->count; i++) w->row.metric[a][i] = metric[a];
}

bool sdm_template_is_rigid(const template_network *k, size_t c)
{
    for (int p = (int)c; p >= 0; p = k->parts[p].parent)
        if (k->parts[p].frame == SDM_FRAME_AFFINE || k->parts[p].n_modes) return false;
    return true;
}

// True if the index is within the lattice `near`.
static bool is_near(const float *const *u, const float end[3], size_t i)
{
    return (u[0][i] >= 0) & (u[0][i] <= end[0]) & (u[1][i] >= 0) & (u[1][i] <= end[1]) &
           (u[2][i] >= 0) & (u[2][i] <= end[2]);
}

// Looks up elements from .. to - 1 of row.u. The kernel writes a few elements beyond.
static void lookup_range(const template_row *r, const template_level *l, size_t from, size_t to)
{
    const float *const u[3] = {r->u[0] + from, r->u[1] + from, r->u[2] + from};
    float *const g[3] = {r->g[0] + from, r->g[1] + from, r->g[2] + from};
    if (to > from) sdm_template_kernels()->lookup(l, to - from, u, r->f + from, g);
}

// Distance and gradient of the template of part c at row.u: from the lattice `near`, and from `far`
// for points outside of it.
static void lookup(const template_work *w, size_t c, size_t n)
{
    const template_row *r = &w->row;
    const template_level *near = &w->k->near[c], *far = &w->k->far[c];
    const float *const u[3] = {r->u[0], r->u[1], r->u[2]};
    float end[3];
    for (int a = 0; a < 3; a++) end[a] = (float)(near->n[a] - 1);
    // the run of points within `near`: first .. last - 1
    size_t first = 0, last = n;
    while (first < n && !is_near(u, end, first)) first++;
    while (last > first && !is_near(u, end, last - 1)) last--;
    bool one_run = true;
    for (size_t i = first; i < last && one_run; i++) one_run = is_near(u, end, i);
    if (one_run) {
        // from left to right, because each call writes beyond its end
        lookup_range(r, far, 0, first);
        lookup_range(r, near, first, last);
        lookup_range(r, far, last, n);
        return;
    }
    lookup_range(r, near, 0, n);
    sdm_template_kernels()->lookup(far, n, u, r->far_f, r->far_g);
    for (size_t i = 0; i < n; i++) {
        if (is_near(u, end, i)) continue;
        r->f[i] = r->far_f[i];
        for (int a = 0; a < 3; a++) r->g[a][i] = r->far_g[a][i];
    }
}

// Looks up a patch of a part without a warp that lies wholly within or wholly beyond the lattice
// `near`; false if it does not.
static bool lookup_whole(const template_work *w, size_t c, const template_patch *p)
{
    const affine_part *part = &w->part[c];
    const template_level *near = &w->k->near[c];
    bool inside = true, outside = false;
    for (int i = 0; i < 3; i++) {
        double low = part->from[i], high;
        for (int a = 0; a < 3; a++) low += part->by[a][i] * (double)p->at[a];
        high = low;
        for (int a = 0; a < 3; a++) {
            const double reach = part->by[a][i] * (double)(p->n[a] - 1);
            low += reach < 0 ? reach : 0;
            high += reach > 0 ? reach : 0;
        }
        // the indices in the row are rounded to floats
        const double end = near->n[i] - 1, rounding = 1e-4;
        inside &= low >= rounding && high <= end - rounding;
        outside |= high < -rounding || low > end + rounding;
    }
    if (!inside && !outside) return false;
    lookup_range(&w->row, inside ? near : &w->k->far[c], 0, p->count);
    return true;
}

void sdm_template_run(template_work *w, size_t c, const template_patch *p)
{
    template_row *r = &w->row;
    const template_network *k = w->k;
    const template_table *t = sdm_template_kernels();
    const bool rigid = k->parts[c].n_modes == 0 && w->part[c].rigid;
    if (k->parts[c].n_modes) {
        const warp_scratch *s = &w->warp[c];
        float *const to[9] = {r->u[0],      r->u[1],      r->u[2],      r->metric[0], r->metric[1],
                              r->metric[2], r->metric[3], r->metric[4], r->metric[5]};
        sdm_template_line(k, s->plane, p->at[1], s->line);
        t->expand(&k->expansion, (p->count + k->step - 1) / k->step, s->line,
                  s->line + 4 * k->stations[0], 9, to);
    } else {
        affine_run(w, c, p, rigid);
    }
    if (k->parts[c].n_modes || !lookup_whole(w, c, p)) lookup(w, c, p->count);
    if (rigid)
        memcpy(r->value, r->f, p->count * sizeof *r->value);
    else
        t->normalise(p->count, r->f, (const float *const *)r->g, (const float *const *)r->metric,
                     r->value);
    if (w->correction_at.map && c == 0)
        t->correct(&w->correction_at, p->count, (const float *const *)r->u, r->value);
}

bool sdm_template_next(template_work *w, template_patch *p)
{
    const template_network *k = w->k;
    const size_t n[3] = {(size_t)w->grid->n[0], (size_t)w->grid->n[1], (size_t)w->grid->n[2]};
    const size_t size[3] = {w->by_lines ? n[0] : BLOCK[0], w->by_lines ? 1 : BLOCK[1],
                            w->by_lines ? 1 : BLOCK[2]};
    if (p->count == 0) {
        memset(p, 0, sizeof *p);
    } else {
        int a = 0;
        while (a < 3 && (p->at[a] += size[a]) >= n[a]) p->at[a++] = 0;
        if (a == 3) return false;
    }
    p->count = 1;
    for (int a = 0; a < 3; a++) {
        p->n[a] = n[a] - p->at[a] < size[a] ? n[a] - p->at[a] : size[a];
        p->count *= p->n[a];
    }
    if (!w->by_lines) {
        p->block = (p->at[2] / BLOCK[2] * w->blocks[1] + p->at[1] / BLOCK[1]) * w->blocks[0] +
                   p->at[0] / BLOCK[0];
    } else if (p->at[1] == 0) {
        for (size_t c = 0; c < k->n_parts; c++)
            if (k->parts[c].n_modes)
                sdm_template_plane(k, w->warp[c].points, w->warp[c].metric, p->at[2],
                                   w->warp[c].plane);
    }
    return true;
}

/* Blocks. */

// Half of the diagonal of a block, mm.
static double block_radius(const sdm_grid *grid)
{
    double sum = 0;
    for (int a = 0; a < 3; a++) {
        const double half = 0.5 * ((double)BLOCK[a] - 1) * grid->spacing[a];
        sum += half * half;
    }
    return sqrt(sum);
}

// Bound on how fast the distance to part c changes, mm per mm: 1 for rigid parts. For others the
// product of the largest singular values of m and m^-1, bounded by Frobenius norms.
static double slope_bound(const template_work *w, size_t c)
{
    double forward = 0, back = 0;
    if (sdm_template_is_rigid(w->k, c)) return 1;
    for (int i = 0; i < 9; i++) {
        forward += w->pose[c].m[i] * w->pose[c].m[i];
        back += w->pose[c].inverse[i] * w->pose[c].inverse[i];
    }
    return sqrt(forward * back);
}

// w->centre of part c in the row (y, z) of blocks: distance at the centre, and its gradient by the
// indices of the grid.
static void row_centres(template_work *w, size_t c, size_t y, size_t z)
{
    const size_t nx = w->blocks[0], n_parts = w->k->n_parts, at[3] = {0, y, z};
    const affine_part *part = &w->part[c];
    const double *from = part->from, (*by)[3] = (const double(*)[3])part->by;
    float metric[6], *out = w->centre + 4 * ((z * w->blocks[1] + y) * nx * n_parts + c);
    sdm_template_metric(w->pose[c].inverse, metric);
    for (int i = 0; i < 3; i++) {
        double first = from[i];
        for (int a = 0; a < 3; a++)
            first += by[a][i] * ((double)(at[a] * BLOCK[a]) + 0.5 * ((double)BLOCK[a] - 1));
        for (size_t x = 0; x < nx; x++)
            w->row.u[i][x] = (float)(first + by[0][i] * (double)(x * BLOCK[0]));
    }
    for (int a = 0; a < 6; a++)
        for (size_t x = 0; x < nx; x++) w->row.metric[a][x] = metric[a];
    lookup(w, c, nx);
    sdm_template_kernels()->normalise(nx, w->row.f, (const float *const *)w->row.g,
                                      (const float *const *)w->row.metric, w->row.value);
    const double h = w->k->parts[c].near.spacing;
    for (size_t x = 0; x < nx; x++, out += 4 * n_parts) {
        out[0] = w->row.value[x];
        for (int a = 0; a < 3; a++)
            out[1 + a] = (float)(h * by[a][0]) * w->row.g[0][x] +
                         (float)(h * by[a][1]) * w->row.g[1][x] +
                         (float)(h * by[a][2]) * w->row.g[2][x];
    }
}

static void all_centres(template_work *w)
{
    for (size_t z = 0; z < w->blocks[2]; z++)
        for (size_t y = 0; y < w->blocks[1]; y++)
            for (size_t c = 0; c < w->k->n_parts; c++) row_centres(w, c, y, z);
}

// True if the distance to part c is at least value[] in all voxels of a block, by a lower bound. It
// lies above its tangent at the centre minus the sag; the interpolation may add the slack.
static bool is_behind(const template_work *w, size_t c, const template_patch *p, double radius,
                      const float *value)
{
    const sdm_template_part *part = &w->k->parts[c];
    const float *centre = w->centre + 4 * (p->block * w->k->n_parts + c);
    const double slack = 0.1 * w->grid->spacing[0];
    float base = centre[0], slope[3] = {centre[1], centre[2], centre[3]};
    if (!(base > 0)) return false;
    if (w->part[c].rigid && radius <= part->sag_reach) {
        base -=
            (float)(1.05 * ((double)base >= part->far_from ? part->far_sag : part->sag) + slack);
    } else {
        base -= (float)(1.05 * w->part[c].slope * radius + slack);
        memset(slope, 0, sizeof slope);
    }
    for (int a = 0; a < 3; a++) base -= slope[a] * 0.5f * (float)(BLOCK[a] - 1);
    if (p->count == BLOCK_VOXELS) {
        int32_t count = 0; // of the type of the comparisons, so that the loop is vectorised
        for (size_t v = 0; v < BLOCK_VOXELS; v++)
            count += base + (slope[0] * w->offset[0][v] +
                             (slope[1] * w->offset[1][v] + slope[2] * w->offset[2][v])) >
                     value[v];
        return count == BLOCK_VOXELS;
    }
    bool behind = true;
    for (size_t z = 0; z < p->n[2]; z++)
        for (size_t y = 0; y < p->n[1]; y++, value += p->n[0])
            for (size_t x = 0; x < p->n[0]; x++)
                behind &= base + slope[0] * (float)x + slope[1] * (float)y + slope[2] * (float)z >
                          value[x];
    return behind;
}

// The part that is the nearest at the centre of a block.
static size_t nearest_part(const template_work *w, const template_patch *p)
{
    const float *centre = w->centre + 4 * p->block * w->k->n_parts;
    size_t n = 0;
    for (size_t c = 1; c < w->k->n_parts; c++)
        if (centre[4 * c] < centre[4 * n]) n = c;
    return n;
}

void sdm_template_values(template_work *w, const template_patch *p, float *value, uint8_t *nearest)
{
    const size_t n_parts = w->k->n_parts;
    const bool culled = !w->by_lines && n_parts > 1;
    const size_t first = culled ? nearest_part(w, p) : 0;
    const double radius = culled ? block_radius(w->grid) : 0;
    sdm_template_run(w, first, p);
    memcpy(value, w->row.value, p->count * sizeof *value);
    if (nearest) memset(nearest, (int)first, p->count);
    for (size_t c = 0; c < n_parts; c++) {
        if (c == first || (culled && is_behind(w, c, p, radius, value))) continue;
        sdm_template_run(w, c, p);
        for (size_t i = 0; i < p->count && nearest; i++)
            if (w->row.value[i] < value[i]) nearest[i] = (uint8_t)c;
        for (size_t i = 0; i < p->count; i++)
            value[i] = w->row.value[i] < value[i] ? w->row.value[i] : value[i];
    }
}

void sdm_template_begin(template_work *w, const double *p, bool slopes)
{
    const template_network *k = w->k;
    sdm_template_numbers(w->model, p, w->phi, w->g, slopes ? w->dg : NULL);
    sdm_template_frames(k, w->g, w->pose);
    for (size_t c = 0; c < k->n_parts; c++) {
        const sdm_template_part *part = &k->parts[c];
        if (part->n_modes == 0) continue;
        sdm_template_control(part, w->g + part->amplitudes, w->warp[c].control);
        sdm_template_invert(k, part, &w->pose[c], w->grid, &w->warp[c]);
    }
    for (size_t c = 0; c < k->n_parts; c++) {
        if (k->parts[c].n_modes) continue;
        affine_index(w, c, w->part[c].from, w->part[c].by);
        w->part[c].rigid = sdm_template_is_rigid(k, c);
        w->part[c].slope = slope_bound(w, c);
    }
    for (size_t v = 0; v < BLOCK_VOXELS; v++) {
        w->offset[0][v] = (float)(v % BLOCK[0]);
        w->offset[1][v] = (float)(v / BLOCK[0] % BLOCK[1]);
        w->offset[2][v] = (float)(v / BLOCK[0] / BLOCK[1]);
    }
    if (!w->by_lines && k->n_parts > 1) all_centres(w);
}
