/* The loops of spline_kernels.h, compiled once for each instruction set. Before inclusion, define
   TABLE, the name of the spline_table. */
#include <math.h>
#include <string.h>

#include "spline_kernels.h"

typedef float four __attribute__((vector_size(16)));
typedef float four_u __attribute__((vector_size(16), aligned(4)));

static inline four load(const float *p) { return *(const four_u *)p; }

/* The sums of a, b, c and d, each (x0 + x1) + (x2 + x3). */
static inline four sums(four a, four b, four c, four d)
{
    const four ab = __builtin_shufflevector(a, b, 0, 2, 4, 6) +
                    __builtin_shufflevector(a, b, 1, 3, 5, 7),
               cd = __builtin_shufflevector(c, d, 0, 2, 4, 6) +
                    __builtin_shufflevector(c, d, 1, 3, 5, 7);
    return __builtin_shufflevector(ab, cd, 0, 2, 4, 6) +
           __builtin_shufflevector(ab, cd, 1, 3, 5, 7);
}

static inline float sum(four a) { return (a[0] + a[1]) + (a[2] + a[3]); }

static inline four mix(const four *row, const float *w)
{
    return (w[0] * row[0] + w[1] * row[1]) + (w[2] * row[2] + w[3] * row[3]);
}

static void expand(size_t n, const int32_t *cell, const float (*weight)[4], const float *row,
                   float *out)
{
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        four product[4];
        for (size_t k = 0; k < 4; k++) product[k] = load(weight[i + k]) * load(row + cell[i + k]);
        *(four_u *)(out + i) = sums(product[0], product[1], product[2], product[3]);
    }
    for (; i < n; i++) out[i] = sum(load(weight[i]) * load(row + cell[i]));
}

static inline void combine_loop(size_t n, const float *restrict a, const float *restrict b,
                                const float *restrict c, const float *restrict d, const float *w,
                                float *restrict out)
{
    const float p = w[0], q = w[1], r = w[2], s = w[3];
    for (size_t i = 0; i < n; i++) out[i] = (p * a[i] + q * b[i]) + (r * c[i] + s * d[i]);
}

static void combine(size_t n, const float *const row[4], const float weight[4], float *out)
{
    combine_loop(n, row[0], row[1], row[2], row[3], weight, out);
}

/* Planes of coefficients, interpolated along y too, are kept while z needs them: plane p in slot
   p % 4. */
static void block(const spline_block *b, float *out)
{
    float kept[4][64];
    int32_t plane[4] = {-1, -1, -1, -1};
    for (int k = 0; k < 8; k++, out += 64) {
        for (int32_t p = b->cell[1][k]; p < b->cell[1][k] + 4; p++) {
            if (plane[p & 3] == p) continue;
            plane[p & 3] = p;
            for (int j = 0; j < 8; j++) {
                const float *row = b->rows + (size_t)(p - b->first[1]) * b->plane +
                                   (size_t)(b->cell[0][j] - b->first[0]) * b->line;
                combine_loop(8, row, row + b->line, row + 2 * b->line, row + 3 * b->line,
                             b->weight[0][j], kept[p & 3] + 8 * j);
            }
        }
        const int32_t p = b->cell[1][k];
        combine_loop(64, kept[p & 3], kept[(p + 1) & 3], kept[(p + 2) & 3], kept[(p + 3) & 3],
                     b->weight[1][k], out);
    }
}

static inline float larger(float a, float b) { return a > b ? a : b; }
static inline float smaller(float a, float b) { return a < b ? a : b; }
_Static_assert(SPLINE_WINDOW == 5, "the loops name the planes or rows of a window");

static void differences(const float *const plane[SPLINE_WINDOW], size_t n, size_t step,
                        float *restrict most)
{
    const float *a = plane[0], *b = plane[1], *c = plane[2], *d = plane[3], *e = plane[4];
    for (size_t i = 0; i < n; i++) {
        const float ab = larger(fabsf(a[i + step] - a[i]), fabsf(b[i + step] - b[i])),
                    cd = larger(fabsf(c[i + step] - c[i]), fabsf(d[i + step] - d[i]));
        most[i] = larger(larger(ab, cd), fabsf(e[i + step] - e[i]));
    }
}

static void steps(const float *const plane[SPLINE_WINDOW], size_t n, float *restrict most)
{
    const float *a = plane[0], *b = plane[1], *c = plane[2], *d = plane[3], *e = plane[4];
    for (size_t i = 0; i < n; i++)
        most[i] = larger(larger(fabsf(b[i] - a[i]), fabsf(c[i] - b[i])),
                         larger(fabsf(d[i] - c[i]), fabsf(e[i] - d[i])));
}

static void largest(const float *const plane[SPLINE_WINDOW], size_t n, float *restrict most)
{
    const float *a = plane[0], *b = plane[1], *c = plane[2], *d = plane[3], *e = plane[4];
    for (size_t i = 0; i < n; i++)
        most[i] = larger(larger(larger(a[i], b[i]), larger(c[i], d[i])), e[i]);
}

static void extremes(const float *const plane[SPLINE_WINDOW], size_t n, float *restrict low,
                     float *restrict high)
{
    const float *a = plane[0], *b = plane[1], *c = plane[2], *d = plane[3], *e = plane[4];
    for (size_t i = 0; i < n; i++) {
        const float p = smaller(smaller(smaller(a[i], b[i]), smaller(c[i], d[i])), e[i]),
                    q = larger(larger(larger(a[i], b[i]), larger(c[i], d[i])), e[i]);
        low[i] = smaller(p, low[i]);
        high[i] = larger(q, high[i]);
    }
}

static int cut(float width, float *values)
{
    int32_t low = -1, high = -1; // all bits: all values so far
    for (int i = 0; i < 512; i++) {
        const float v = values[i], above = v > -width ? v : -width;
        low &= -(int32_t)(v <= -width);
        high &= -(int32_t)(v >= width);
        values[i] = above < width ? above : width;
    }
    return low ? SPLINE_ALL_LOW : high ? SPLINE_ALL_HIGH : SPLINE_BETWEEN;
}

static void solve(float *restrict c, size_t n, size_t step, size_t width, const float *factor)
{
    const size_t last = n - 1;
    for (size_t w = 0; w < width; w++) {
        const float end = c[last * step + w] - c[(last - 1) * step + w];
        c[w] -= c[step + w];
        c[last * step + w] = end;
    }
    for (size_t i = 1; i < last; i++) {
        const float *restrict before = c + (i - 1) * step, f = factor[i];
        float *restrict at = c + i * step;
        for (size_t w = 0; w < width; w++) at[w] = (6 * at[w] - before[w]) * f;
    }
    const float closing = 1 / (1 + factor[last - 1]);
    for (size_t w = 0; w < width; w++) {
        float *at = c + last * step + w;
        at[0] = (at[0] + at[-(ptrdiff_t)step]) * closing;
    }
    for (size_t i = last; i-- > 0;) {
        const float *restrict next = c + (i + 1) * step, f = factor[i];
        float *restrict at = c + i * step;
        for (size_t w = 0; w < width; w++) at[w] -= f * next[w];
    }
}

/* Transposes four vectors. */
static inline void transpose(four r[4])
{
    const four a = __builtin_shufflevector(r[0], r[1], 0, 4, 1, 5),
               b = __builtin_shufflevector(r[2], r[3], 0, 4, 1, 5),
               c = __builtin_shufflevector(r[0], r[1], 2, 6, 3, 7),
               d = __builtin_shufflevector(r[2], r[3], 2, 6, 3, 7);
    r[0] = __builtin_shufflevector(a, b, 0, 1, 4, 5);
    r[1] = __builtin_shufflevector(a, b, 2, 3, 6, 7);
    r[2] = __builtin_shufflevector(c, d, 0, 1, 4, 5);
    r[3] = __builtin_shufflevector(c, d, 2, 3, 6, 7);
}

/* The first of four rows or columns from i on; at the end the last four of all n. */
static inline size_t four_from(size_t i, size_t n) { return i + 4 <= n ? i : n - 4; }

/* to[column][row] = from[row][column]; rows of `from` are from_step floats apart, rows of `to` are
   to_step floats apart. */
static void transpose_matrix(const float *from, size_t from_step, size_t n_rows, size_t n_columns,
                             float *to, size_t to_step)
{
    if (n_rows < 4 || n_columns < 4) {
        for (size_t row = 0; row < n_rows; row++)
            for (size_t i = 0; i < n_columns; i++)
                to[i * to_step + row] = from[row * from_step + i];
        return;
    }
    for (size_t i = 0; i < n_rows; i += 4)
        for (size_t j = 0; j < n_columns; j += 4) {
            const size_t row = four_from(i, n_rows), column = four_from(j, n_columns);
            four r[4];
            for (size_t k = 0; k < 4; k++) r[k] = load(from + (row + k) * from_step + column);
            transpose(r);
            for (size_t k = 0; k < 4; k++) *(four_u *)(to + (column + k) * to_step + row) = r[k];
        }
}

typedef float lanes __attribute__((vector_size(64)));
_Static_assert(SPLINE_LINES == 32, "the rows are two vectors");

/* solve() for SPLINE_LINES lines, neighbours in memory: the elements of the step before stay in
   registers, and the two vectors wait for them at the same time. */
static void solve_rows(lanes (*c)[2], size_t n, const float *factor)
{
    const size_t last = n - 1;
    const float closing = 1 / (1 + factor[last - 1]);
    const lanes end[2] = {c[last][0] - c[last - 1][0], c[last][1] - c[last - 1][1]};
    lanes a = c[0][0] -= c[1][0], b = c[0][1] -= c[1][1];
    for (size_t i = 1; i < last; i++) {
        c[i][0] = a = (6 * c[i][0] - a) * factor[i];
        c[i][1] = b = (6 * c[i][1] - b) * factor[i];
    }
    c[last][0] = a = (end[0] + a) * closing;
    c[last][1] = b = (end[1] + b) * closing;
    for (size_t i = last; i-- > 0;) {
        c[i][0] = a = c[i][0] - factor[i] * a;
        c[i][1] = b = c[i][1] - factor[i] * b;
    }
}

static void fit_rows(const float *values, size_t n, size_t from, const float *factor, float *c,
                     size_t to, float *memory)
{
    transpose_matrix(values, from, SPLINE_LINES, n, memory, SPLINE_LINES);
    solve_rows((lanes(*)[2])memory, n, factor);
    transpose_matrix(memory, SPLINE_LINES, n, SPLINE_LINES, c, to);
}

/* The spline at a point with the weights of the four coefficients along x, y and z. */
static inline float value_at(const float *c, size_t line, size_t plane, four x, four y, four z)
{
    four column[4];
    for (size_t k = 0; k < 4; k++) {
        const float *row = c + k * plane;
        column[k] = y * sums(x * load(row), x * load(row + line), x * load(row + 2 * line),
                             x * load(row + 3 * line));
    }
    return sum(z * sums(column[0], column[1], column[2], column[3]));
}

static float value(const float *c, size_t line, size_t plane, const float (*weight)[4])
{
    return value_at(c, line, plane, load(weight[0]), load(weight[1]), load(weight[2]));
}

static void run(const float *c, const size_t step[3], size_t n, const spline_run *r, float *out)
{
    const size_t line = step[1], plane = step[2];
    for (size_t i = 0; i < n; i++)
        out[i] = value_at(c + r->at[i], line, plane, load(r->weight[0][i]), load(r->weight[1][i]),
                          load(r->weight[2][i]));
}

/* sdm_spline_place() and sdm_spline_weights() of SPLINE_RUN indices along an axis of n voxels.
   nodes[i] grows by 1 at a voxel of the map, beyond[i] outside of the box. Counted in steps, an
   index is below 2^53 and its whole part is exact as double. */
static void axis_places(int64_t n, const double *restrict index, int32_t *restrict cell,
                        float *restrict weight, double *restrict nodes, double *restrict beyond)
{
    const double last = (double)(n - 1);
    const int32_t most = n > 2 ? (int32_t)(n - 2) : 0;
    float t[SPLINE_RUN];
    for (size_t i = 0; i < SPLINE_RUN; i++) {
        const double low = index[i] > 0 ? index[i] : 0, in = low < last ? low : last,
                     out = (index[i] - in) * SPLINE_STEPS, steps = in * SPLINE_STEPS + 0.5;
        const int32_t voxel = (int32_t)(steps * (1 / SPLINE_STEPS)),
                      rest = (int32_t)(steps - (double)voxel * SPLINE_STEPS),
                      m = voxel < most ? voxel : most;
        cell[i] = m;
        t[i] = (float)rest * (float)(1 / SPLINE_STEPS) + (float)(voxel - m);
        nodes[i] += rest ? 0.0 : 1.0;
        beyond[i] += fabs(out) > 0.5 ? 1.0 : 0.0;
    }
    float w[4][SPLINE_RUN];
    for (size_t i = 0; i < SPLINE_RUN; i++) {
        float at[4];
        sdm_spline_weights(t[i], at);
        for (size_t k = 0; k < 4; k++) w[k][i] = at[k];
    }
    transpose_matrix(w[0], SPLINE_RUN, 4, SPLINE_RUN, weight, 4);
}

static void places(const spline_line *l, size_t first, size_t n, spline_run *r)
{
    double d[3][SPLINE_RUN], index[SPLINE_RUN], nodes[SPLINE_RUN] = {0}, beyond[SPLINE_RUN] = {0};
    int32_t cell[3][SPLINE_RUN];
    for (int a = 0; a < 3; a++)
        for (int32_t i = 0; i < SPLINE_RUN; i++)
            d[a][i] = ((l->origin[a] + l->along[a] * ((double)first + (double)i)) + l->across[a]) +
                      l->up[a] - l->frame.origin[a];
    for (int a = 0; a < 3; a++) {
        const double *to = l->frame.to_index + (size_t)3 * (size_t)a;
        for (size_t i = 0; i < SPLINE_RUN; i++)
            index[i] = to[0] * d[0][i] + to[1] * d[1][i] + to[2] * d[2][i];
        axis_places(l->n[a], index, cell[a], r->weight[a][0], nodes, beyond);
    }
    for (size_t i = 0; i < n; i++) {
        r->at[i] =
            (size_t)cell[0][i] + (size_t)cell[1][i] * l->step[1] + (size_t)cell[2][i] * l->step[2];
        r->apart[i] = nodes[i] == 3 || beyond[i] > 0;
    }
}

static void gradient(const float *c, size_t line, size_t plane, const float (*weight)[4],
                     const float (*slope)[4], float out[3])
{
    four row[4], by_z[4]; // interpolated along z, and its derivative by z
    for (size_t j = 0; j < 4; j++) {
        four column[4];
        for (size_t k = 0; k < 4; k++) column[k] = load(c + k * plane + j * line);
        row[j] = mix(column, weight[2]);
        by_z[j] = mix(column, slope[2]);
    }
    const four x = load(weight[0]);
    const four all = sums(load(slope[0]) * mix(row, weight[1]), x * mix(row, slope[1]),
                          x * mix(by_z, weight[1]), x);
    memcpy(out, &all, 3 * sizeof *out);
}

const spline_table TABLE = {.solve = solve,
                            .fit_rows = fit_rows,
                            .expand = expand,
                            .combine = combine,
                            .block = block,
                            .differences = differences,
                            .steps = steps,
                            .largest = largest,
                            .extremes = extremes,
                            .cut = cut,
                            .value = value,
                            .places = places,
                            .run = run,
                            .gradient = gradient};
