/* Derivatives of the distance to a part at the points of w->row, by where they lie in the template
   and by the metric. */
#include <string.h>

#include "template_derivative.h"

enum { LOOKUP_ROWS = 16, ALL_ROWS = LOOKUP_ROWS + 13 };

// field[29] = the addresses of the rows of *r; the first 16 are those that a lookup fills
static void list_rows(template_slope_rows *r, float **field[ALL_ROWS])
{
    size_t n = 0;
    field[n++] = &r->f;
    for (int a = 0; a < 3; a++) {
        field[n++] = &r->g[a];
        field[n++] = &r->df[a];
        for (int b = 0; b < 3; b++) field[n++] = &r->dg[a][b];
    }
    field[n++] = &r->factor;
    for (int a = 0; a < 3; a++) {
        field[n++] = &r->by_u[a];
        field[n++] = &r->dr[a];
    }
    for (int a = 0; a < 6; a++) field[n++] = &r->by_metric[a];
}

void sdm_template_take_slope_rows(const template_network *k, void *memory, size_t *at,
                                  template_slope_rows *rows, template_slope_rows *far)
{
    float **field[ALL_ROWS];
    const size_t bytes = sdm_template_row_bytes(k);
    list_rows(rows, field);
    for (size_t i = 0; i < ALL_ROWS; i++) *field[i] = sdm_template_take(memory, at, bytes);
    list_rows(far, field);
    for (size_t i = 0; i < LOOKUP_ROWS; i++) *field[i] = sdm_template_take(memory, at, bytes);
}

// f, g, df, dg of *near, from both lattices; *far: memory
static void lookup(const template_work *w, size_t c, size_t n, template_slope_rows *near,
                   template_slope_rows *far)
{
    const template_network *k = w->k;
    const template_table *t = sdm_template_kernels();
    const float *const *u = (const float *const *)w->row.u;
    const size_t within = sdm_template_count_near(w, c, n);
    if (within == 0 || within == n) {
        t->lookup_slopes(within ? &k->near[c] : &k->far[c], n, u, near);
        return;
    }
    t->lookup_slopes(&k->near[c], n, u, near);
    t->lookup_slopes(&k->far[c], n, u, far);
    float **to[ALL_ROWS], **from[ALL_ROWS];
    list_rows(near, to);
    list_rows(far, from);
    for (size_t i = 0; i < n; i++) {
        if (sdm_template_is_near(w, c, i)) continue;
        for (size_t row = 0; row < LOOKUP_ROWS; row++) (*to[row])[i] = (*from[row])[i];
    }
}

void sdm_template_slope_rows(const template_work *w, size_t c, size_t n, template_slope_rows *rows,
                             template_slope_rows *far)
{
    const template_table *t = sdm_template_kernels();
    lookup(w, c, n, rows, far);
    if (!w->part[c].rigid) t->factor_slopes(n, (const float *const *)w->row.metric, rows);
    if (w->correction && c == 0)
        t->correct_slopes(&w->correction_at, n, (const float *const *)w->row.u, rows->dr);
    else
        for (int a = 0; a < 3; a++) memset(rows->dr[a], 0, n * sizeof *rows->dr[a]);
}

void sdm_template_block_slopes(template_work *w, size_t c, const template_block *b, bool valued,
                               template_slope_rows *rows, template_slope_rows *far,
                               float *const slope[9])
{
    const template_slope_rows *r = rows;
    const bool rigid = w->part[c].rigid;
    if (w->loaded != c) {
        if (valued)
            sdm_template_run(w, c, b);
        else
            sdm_template_points(w, c, b);
    }
    sdm_template_slope_rows(w, c, SDM_TEMPLATE_BLOCK_VOXELS, rows, far);
    for (int a = 0; a < 3; a++)
        for (size_t v = 0; v < SDM_TEMPLATE_BLOCK_VOXELS; v++)
            slope[a][v] = rigid
                              ? r->df[a][v] + r->dr[a][v]
                              : r->factor[v] * r->df[a][v] + r->f[v] * r->by_u[a][v] + r->dr[a][v];
    for (int a = 0; a < 6 && !rigid; a++)
        for (size_t v = 0; v < SDM_TEMPLATE_BLOCK_VOXELS; v++)
            slope[3 + a][v] = r->f[v] * r->by_metric[a][v];
}
