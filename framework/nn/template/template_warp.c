/* The warp of a part: displacements by cubic B-splines, and the inverse of the warp at the
   stations. */
#include <math.h>
#include <string.h>

#include "sdm/internal/mat3.h"
#include "template_internal.h"

typedef float quad __attribute__((vector_size(16)));

static quad quad_at(const float *p)
{
    quad q;
    memcpy(&q, p, sizeof q);
    return q;
}

void sdm_template_control(const sdm_template_part *part, const double *a, float *control)
{
    // first the three elements of all nodes one after the other, as in the modes
    const size_t n = sdm_lattice_count(&part->warp);
    memset(control, 0, 4 * n * sizeof *control);
    for (size_t m = 0; m < part->n_modes; m++) {
        const float f = (float)a[m], *mode = part->modes + 3 * n * m;
        if (f == 0) continue;
        for (size_t i = 0; i < 3 * n; i++) control[i] += f * mode[i];
    }
    for (size_t i = n; i-- > 0;) {
        const float *from = control + 3 * i, node[4] = {from[0], from[1], from[2], 0};
        memcpy(control + 4 * i, node, sizeof node);
    }
}

// Weights of the four control points around a coordinate, and their first and second derivatives.
// Returns the index of the first control point.
static size_t spline_weights(double u, uint32_t n, double spacing, float w[4], float d[4],
                             float dd[4])
{
    const bool inside = u >= 1 && u <= (double)n - 2;
    u = u > 1 ? u : 1;
    u = u < (double)n - 2 ? u : (double)n - 2;
    size_t i = (size_t)u;
    if (i > n - 3u) i = n - 3u;
    const double t = u - (double)i, s = 1 - t;
    const double f = inside ? 1 / spacing : 0, ff = f * f; // beyond the lattice: constant
    w[0] = (float)(s * s * s / 6), w[3] = (float)(t * t * t / 6);
    w[1] = (float)((3 * t * t * t - 6 * t * t + 4) / 6);
    w[2] = (float)((3 * s * s * s - 6 * s * s + 4) / 6);
    d[0] = (float)(-f * s * s / 2), d[3] = (float)(f * t * t / 2);
    d[1] = (float)(f * (1.5 * t * t - 2 * t)), d[2] = (float)(-f * (1.5 * s * s - 2 * s));
    dd[0] = (float)(ff * s), dd[3] = (float)(ff * t);
    dd[1] = (float)(ff * (3 * t - 2)), dd[2] = (float)(ff * (3 * s - 2));
    return i - 1;
}

static quad sum_of_four(const float w[4], const quad q[4])
{
    return w[0] * q[0] + w[1] * q[1] + (w[2] * q[2] + w[3] * q[3]);
}

void sdm_template_displacement(const sdm_lattice *l, const float *control, const double y[3],
                               double u[3], double *du, double (*ddu)[9])
{
    float w[3][3][4]; // [axis][derivative]
    size_t at[3];
    for (int a = 0; a < 3; a++)
        at[a] = spline_weights((y[a] - l->origin[a]) / l->spacing, l->n[a], l->spacing, w[a][0],
                               w[a][1], w[a][2]);
    // sums[derivatives by x][by y]: of total order <= 2, along x, then y, then z
    quad z[3][3][4];
    const int order = ddu ? 2 : du ? 1 : 0;
    for (size_t k = 0; k < 4; k++) {
        quad yy[3][4];
        for (size_t j = 0; j < 4; j++) {
            const float *c = control + 4 * (((at[2] + k) * l->n[1] + at[1] + j) * l->n[0] + at[0]);
            const quad q[4] = {quad_at(c), quad_at(c + 4), quad_at(c + 8), quad_at(c + 12)};
            for (int a = 0; a <= order; a++) yy[a][j] = sum_of_four(w[0][a], q);
        }
        for (int a = 0; a <= order; a++)
            for (int b = 0; a + b <= order; b++) z[a][b][k] = sum_of_four(w[1][b], yy[a]);
    }
    quad sum[3][3][3];
    for (int a = 0; a <= order; a++)
        for (int b = 0; a + b <= order; b++)
            for (int c = 0; a + b + c <= order; c++) sum[a][b][c] = sum_of_four(w[2][c], z[a][b]);
    for (int i = 0; i < 3; i++) {
        u[i] = (double)sum[0][0][0][i];
        if (du)
            du[3 * i] = (double)sum[1][0][0][i], du[3 * i + 1] = (double)sum[0][1][0][i],
                   du[3 * i + 2] = (double)sum[0][0][1][i];
        for (int p = 0; p < 3 && ddu; p++)
            for (int q = 0; q < 3; q++)
                ddu[p][3 * i + q] =
                    (double)sum[(p == 0) + (q == 0)][(p == 1) + (q == 1)][(p == 2) + (q == 2)][i];
    }
}

// weights[2][4] = those of the four control points around a coordinate and their derivatives.
// Returns the index of the first control point.
static size_t first_weights(double u, uint32_t n, float per_mm, float (*weights)[4])
{
    const bool inside = u >= 1 && u <= (double)n - 2;
    u = u > 1 ? u : 1;
    u = u < (double)n - 2 ? u : (double)n - 2;
    size_t i = (size_t)u;
    if (i > n - 3u) i = n - 3u;
    const float t = (float)(u - (double)i), f = inside ? per_mm : 0;
    const float a = 1.0f / 6, b = 2.0f / 3;
    const quad w = (quad){a, b, a, 0} +
                   t * ((quad){-0.5f, 0, 0.5f, 0} +
                        t * ((quad){0.5f, -1, 0.5f, 0} + t * (quad){-a, 0.5f, -0.5f, a})),
               d = (quad){-0.5f, 0, 0.5f, 0} +
                   t * ((quad){1, -2, 1, 0} + t * (quad){-0.5f, 1.5f, -1.5f, 0.5f});
    const quad slope = f * d;
    memcpy(weights[0], &w, sizeof w);
    memcpy(weights[1], &slope, sizeof slope);
    return i - 1;
}

/* Where a point lies among the control points of a warp. */
typedef struct warp_place {
    size_t first;           /* float of the first of the 4 x 4 x 4 control points */
    float weights[3][2][4]; /* along x, y, z, and their derivatives */
} warp_place;

static inline void find_place(const sdm_lattice *l, const double y[3], warp_place *p)
{
    const double per_mm = 1 / l->spacing;
    size_t at[3];
    for (int a = 0; a < 3; a++)
        at[a] =
            first_weights((y[a] - l->origin[a]) * per_mm, l->n[a], (float)per_mm, p->weights[a]);
    p->first = 4 * (at[0] + l->n[0] * (at[1] + l->n[1] * at[2]));
}

// The same as sdm_template_displacement() without second derivatives, faster.
static inline void displacement(const sdm_lattice *l, const float *control, const warp_place *p,
                                double u[3], double du[9])
{
    const size_t line = 4 * (size_t)l->n[0], plane = line * l->n[1];
    float sum[4][4];
    sdm_template_kernels()->displace(control + p->first, line, plane,
                                     (const float(*)[2][4])p->weights, sum);
    for (int i = 0; i < 3; i++) {
        u[i] = (double)sum[0][i];
        for (int a = 0; a < 3; a++) du[3 * i + a] = (double)sum[1 + a][i];
    }
}

// out[9] = (I + du)^-1. A warp that folds (determinant near 0) is treated as the identity.
static void inverse_of_warp(const double du[9], double out[9])
{
    double a[9];
    for (int i = 0; i < 9; i++) a[i] = du[i] + (i % 4 == 0);
    const double det = m3_adjugate(a, out), factor = 1 / det;
    for (int i = 0; i < 9; i++) out[i] = det > 1e-2 ? out[i] * factor : (double)(i % 4 == 0);
}

// Solves y + U(y) = q by Newton's method from y. Stops when the next step would change y by about
// the square of the last step. inverse[9] = (I + dU)^-1 at the last point of evaluation.
static void newton(const sdm_lattice *l, const float *control, const double q[3], double y[3],
                   double inverse[9])
{
    enum { ITERATIONS = 12 };
    const double stop = 0.005 * l->spacing, longest = 0.5 * l->spacing;
    for (int n = 0; n < ITERATIONS; n++) {
        double u[3], du[9], f[3], d[3];
        warp_place place;
        find_place(l, y, &place);
        displacement(l, control, &place, u, du);
        inverse_of_warp(du, inverse);
        for (int i = 0; i < 3; i++) f[i] = q[i] - y[i] - u[i];
        m3_apply(inverse, f, d);
        const double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        const double scale = length > longest ? longest / length : 1;
        for (int i = 0; i < 3; i++) y[i] += scale * d[i];
        if (length < stop) return;
    }
}

// Position of a station in the world.
static void station_world(const sdm_grid *grid, size_t x, size_t y, size_t z, double out[3])
{
    const double step = SDM_TEMPLATE_STEP,
                 index[3] = {step * ((double)x - 1), step * ((double)y - 1),
                             step * ((double)z - 1)};
    sdm_grid_world(grid, index, out);
}

// Row and column of the elements xx, yy, zz, yz, xz, xy.
static const int ROW[6] = {0, 1, 2, 1, 0, 0}, COLUMN[6] = {0, 1, 2, 2, 2, 1};

void sdm_template_metric(const double b[9], float metric[6])
{
    for (int c = 0; c < 6; c++) {
        const double *i = b + 3 * ROW[c], *j = b + 3 * COLUMN[c];
        metric[c] = (float)(i[0] * j[0] + i[1] * j[1] + i[2] * j[2]);
    }
}

void sdm_template_metric_slope(const double b[9], const double db[9], float slope[6])
{
    for (int c = 0; c < 6; c++) {
        const int i = 3 * ROW[c], j = 3 * COLUMN[c];
        double sum = 0;
        for (int e = 0; e < 3; e++) sum += db[i + e] * b[j + e] + b[i + e] * db[j + e];
        slope[c] = (float)sum;
    }
}

void sdm_template_inverse_slope(const part_pose *pose, const double dm[9], double out[9])
{
    double a[9];
    m3_product(pose->inverse, dm, a);
    m3_product(a, pose->inverse, out);
    for (int i = 0; i < 9; i++) out[i] = -out[i];
}

void sdm_template_spline(float *v, size_t n, size_t stride, size_t width)
{
    // (c[i-1] + 4 c[i] + c[i+1]) / 6 = v[i], c[0] = v[0], c[n-1] = v[n-1]: Thomas algorithm. Its
    // factors reach their limit, 2 - sqrt(3), within a few steps.
    enum { FACTORS = 32 };
    float factor[FACTORS] = {0};
    for (size_t i = 1; i < FACTORS; i++) factor[i] = 1 / (4 - factor[i - 1]);
    for (size_t i = 1; i + 1 < n; i++) {
        const float f = factor[i < FACTORS ? i : FACTORS - 1];
        float *to = v + i * stride;
        const float *before = to - stride;
        for (size_t c = 0; c < width; c++) to[c] = (6 * to[c] - before[c]) * f;
    }
    for (size_t i = n - 2; i > 0; i--) {
        const float f = factor[i < FACTORS ? i : FACTORS - 1];
        float *to = v + i * stride;
        const float *after = to + stride;
        for (size_t c = 0; c < width; c++) to[c] -= f * after[c];
    }
}

void sdm_template_prefilter(const template_network *k, float *points)
{
    const size_t nx = k->stations[0], ny = k->stations[1], nz = k->stations[2], line = 4 * nx,
                 plane = line * ny;
    for (size_t i = 0; i < ny * nz; i++) sdm_template_spline(points + line * i, nx, 4, 4);
    for (size_t z = 0; z < nz; z++) sdm_template_spline(points + plane * z, ny, line, line);
    sdm_template_spline(points, nz, plane, plane);
}

// y[3] = a start for the station `at`, from the lines of stations before it along y and z: what
// makes its second differences along y and z together vanish. It does not wait for the station
// before it on the same line.
static void predict(const warp_scratch *w, const sdm_lattice *near, size_t at, size_t line,
                    size_t plane, double y[3])
{
    const float *p = w->points + 4 * at;
    for (size_t c = 0; c < 3; c++) {
        double before[3]; // along z, combined along y
        for (size_t k = 0; k < 3; k++) {
            const float *from = p + c - 4 * k * plane;
            before[k] = 2 * (double)*(from - 4 * line) - (double)*(from - 8 * line);
            if (k > 0) before[k] -= (double)*from;
        }
        y[c] = (before[0] - 2 * before[1] + before[2]) * near->spacing + near->origin[c];
    }
}

// Stores a station.
static void set_station(const part_pose *pose, const sdm_lattice *near, const warp_scratch *w,
                        size_t at, const double y[3], const double inverse[9])
{
    const double per_index = 1 / near->spacing;
    double b[9];
    for (int c = 0; c < 3; c++)
        w->points[4 * at + (size_t)c] = (float)((y[c] - near->origin[c]) * per_index);
    w->points[4 * at + 3] = 0;
    m3_product(inverse, pose->inverse, b);
    sdm_template_metric(b, w->metric + 8 * at);
    w->metric[8 * at + 6] = w->metric[8 * at + 7] = 0;
    if (!w->station) return;
    memcpy(w->station[at].y, y, 3 * sizeof *y);
    memcpy(w->station[at].inverse, inverse, 9 * sizeof *inverse);
}

// q[3] = the point of the frame, without the warp, of a station.
static void station_in_frame(const part_pose *pose, const sdm_grid *grid, size_t x, size_t y,
                             size_t z, double q[3])
{
    double world[3];
    station_world(grid, x, y, z, world);
    for (int c = 0; c < 3; c++) world[c] -= pose->b[c];
    m3_apply(pose->inverse, world, q);
}

void sdm_template_invert(const template_network *k, const sdm_template_part *part,
                         const part_pose *pose, const sdm_grid *grid, const warp_scratch *w)
{
    const size_t *n = k->stations, line = n[0], plane = n[0] * n[1];
    static const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    size_t at = 0;
    double row[3] = {0}, row_q[3] = {0}; // the first station of the line before
    for (size_t z = 0; z < n[2]; z++)
        for (size_t j = 0; j < n[1]; j++) {
            double first[3], second[3], y[3], inverse[9];
            station_in_frame(pose, grid, 0, j, z, first);
            station_in_frame(pose, grid, 1, j, z, second);
            memcpy(inverse, unit, sizeof unit);
            for (size_t i = 0; i < n[0]; i++, at++) {
                double q[3], step[3], move[3];
                for (int c = 0; c < 3; c++) {
                    step[c] = second[c] - first[c];
                    q[c] = first[c] + step[c] * (double)i;
                }
                if (j > 1 && z > 1) {
                    predict(w, &part->near, at, line, plane, y);
                } else if (i > 0) { // the station before it, moved to first order
                    m3_apply(inverse, step, move);
                    for (int c = 0; c < 3; c++) y[c] += move[c];
                } else {
                    for (int c = 0; c < 3; c++) y[c] = q[c] + (row[c] - row_q[c]);
                }
                newton(&part->warp, w->control, q, y, inverse);
                if (i == 0) memcpy(row, y, sizeof y), memcpy(row_q, q, sizeof q);
                set_station(pose, &part->near, w, at, y, inverse);
            }
        }
}

/* A station of which the derivatives are asked: the point x of the world, less the frame's b. */
typedef struct moving_station {
    double x[3], inverse[9], b[9], metric[9]; /* B and B B^T, see sdm_template_metric() */
    double bend[3][9];                        /* second derivatives of the warp at y */
    warp_place place;
} moving_station;

static void prepare_station(const sdm_template_part *part, const part_pose *pose,
                            const warp_scratch *w, const station *s, moving_station *out)
{
    double u[3], du[9], turned[9];
    memcpy(out->inverse, s->inverse, sizeof s->inverse);
    m3_product(s->inverse, pose->inverse, out->b);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) turned[3 * i + j] = out->b[3 * j + i];
    m3_product(out->b, turned, out->metric);
    sdm_template_displacement(&part->warp, w->control, s->y, u, du, out->bend);
    find_place(&part->warp, s->y, &out->place);
}

// The derivatives of a station.
static void move_station(const sdm_template_part *part, const moving_station *s,
                         const warp_motion *motion, float points[4], float metric[8])
{
    double dq[3] = {0}, u[3], du[9], f[3], dy[3], a[9], am[9];
    // q = m^-1 (x - b): dq = d(m^-1) (x - b) - m^-1 db
    if (motion->turns) m3_apply(motion->inverse, s->x, dq);
    // y + U(y) = q: (I + U') dy = dq - dU(y)
    displacement(&part->warp, motion->control, &s->place, u, du);
    for (int c = 0; c < 3; c++) f[c] = dq[c] - motion->shift[c] - u[c];
    m3_apply(s->inverse, f, dy);
    for (int c = 0; c < 3; c++) points[c] = (float)(dy[c] * (1 / part->near.spacing));
    points[3] = 0;
    // B = J^-1 m^-1, J = I + U': dB = -J^-1 dJ B + J^-1 d(m^-1), dJ = dU' + U'' dy.
    // The metric G = B B^T changes by H + H^T with H = dB B^T = -J^-1 dJ G + J^-1 d(m^-1) B^T.
    for (int e = 0; e < 9; e++)
        du[e] += s->bend[0][e] * dy[0] + s->bend[1][e] * dy[1] + s->bend[2][e] * dy[2];
    m3_product(s->inverse, du, a);
    m3_product(a, s->metric, am);
    if (motion->turns) {
        m3_product(s->inverse, motion->inverse, a);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                am[3 * i + j] -= a[3 * i] * s->b[3 * j] + a[3 * i + 1] * s->b[3 * j + 1] +
                                 a[3 * i + 2] * s->b[3 * j + 2];
    }
    for (int c = 0; c < 6; c++)
        metric[c] = (float)-(am[3 * ROW[c] + COLUMN[c]] + am[3 * COLUMN[c] + ROW[c]]);
    metric[6] = metric[7] = 0;
}

void sdm_template_invert_slopes(const template_network *k, const sdm_template_part *part,
                                const part_pose *pose, const sdm_grid *grid, const warp_scratch *w,
                                size_t n, const warp_motion *motion)
{
    size_t at = 0;
    for (size_t z = 0; z < k->stations[2]; z++)
        for (size_t y = 0; y < k->stations[1]; y++)
            for (size_t x = 0; x < k->stations[0]; x++, at++) {
                moving_station s;
                station_world(grid, x, y, z, s.x);
                for (int c = 0; c < 3; c++) s.x[c] -= pose->b[c];
                prepare_station(part, pose, w, &w->station[at], &s);
                for (size_t d = 0; d < n; d++)
                    move_station(part, &s, &motion[d], motion[d].points + 4 * at,
                                 motion[d].metric + 8 * at);
            }
}
