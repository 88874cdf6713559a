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
    const float *mode[SDM_TEMPLATE_MAX_MODES];
    float f[SDM_TEMPLATE_MAX_MODES];
    size_t used = 0, m = 0;
    for (size_t i = 0; i < part->n_modes; i++) {
        if ((float)a[i] == 0) continue;
        f[used] = (float)a[i];
        mode[used++] = part->modes + 3 * n * i;
    }
    memset(control, 0, 4 * n * sizeof *control);
    for (; m + 4 <= used; m += 4) { // four modes for one pass over the sums
        const float *const *v = mode + m, *w = f + m;
        for (size_t i = 0; i < 3 * n; i++)
            control[i] =
                control[i] + w[0] * v[0][i] + w[1] * v[1][i] + w[2] * v[2][i] + w[3] * v[3][i];
    }
    for (; m < used; m++)
        for (size_t i = 0; i < 3 * n; i++) control[i] += f[m] * mode[m][i];
    for (size_t i = n; i-- > 0;) {
        const float *from = control + 3 * i, node[4] = {from[0], from[1], from[2], 0};
        memcpy(control + 4 * i, node, sizeof node);
    }
}

void sdm_template_control_back(const sdm_template_part *part, float *control, double *a)
{
    enum { SUMS = 16 }; // side by side, so that the compiler vectorises
    const size_t n = 3 * sdm_lattice_count(&part->warp);
    for (size_t i = 0; i < n; i++) control[i] = control[4 * (i / 3) + i % 3]; // as in the modes
    for (size_t m = 0; m < part->n_modes; m++) {
        const float *mode = part->modes + n * m;
        float sum[SUMS] = {0};
        size_t i = 0;
        for (; i + SUMS <= n; i += SUMS)
            for (size_t l = 0; l < SUMS; l++) sum[l] += control[i + l] * mode[i + l];
        a[m] = 0;
        for (; i < n; i++) a[m] += (double)(control[i] * mode[i]);
        for (size_t l = 0; l < SUMS; l++) a[m] += (double)sum[l];
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

template_warp sdm_template_warp_of(const sdm_template_part *part, const float *control)
{
    const sdm_lattice *l = &part->warp;
    return (template_warp){.control = control,
                           .n = {(int32_t)l->n[0], (int32_t)l->n[1], (int32_t)l->n[2]},
                           .origin = {l->origin[0], l->origin[1], l->origin[2]},
                           .spacing = l->spacing};
}

void sdm_template_station_world(const sdm_grid *grid, size_t x, size_t y, size_t z, double out[3])
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

void sdm_template_metric_slope_back(const double b[9], const double slope[6], double db[9])
{
    for (int c = 0; c < 6; c++) {
        const int i = 3 * ROW[c], j = 3 * COLUMN[c];
        for (int e = 0; e < 3; e++) {
            db[i + e] += slope[c] * b[j + e];
            db[j + e] += slope[c] * b[i + e];
        }
    }
}

void sdm_template_inverse_slope(const part_pose *pose, const double dm[9], double out[9])
{
    double a[9];
    m3_product(pose->inverse, dm, a);
    m3_product(a, pose->inverse, out);
    for (int i = 0; i < 9; i++) out[i] = -out[i];
}

// sdm_template_spline() for several arrays of samples, `gap` floats apart.
static void splines(float *v, size_t n, size_t stride, size_t width, size_t arrays, size_t gap)
{
    // (c[i-1] + 4 c[i] + c[i+1]) / 6 = v[i], c[0] = v[0], c[n-1] = v[n-1]: Thomas algorithm. Its
    // factors reach their limit, 2 - sqrt(3), within a few steps.
    enum { FACTORS = 32 };
    float factor[FACTORS] = {0};
    for (size_t i = 1; i < FACTORS; i++) factor[i] = 1 / (4 - factor[i - 1]);
    for (size_t i = 1; i + 1 < n; i++) {
        const float f = factor[i < FACTORS ? i : FACTORS - 1];
        for (size_t a = 0; a < arrays; a++) {
            float *to = v + i * stride + a * gap;
            const float *before = to - stride;
            for (size_t c = 0; c < width; c++) to[c] = (6 * to[c] - before[c]) * f;
        }
    }
    for (size_t i = n - 2; i > 0; i--) {
        const float f = factor[i < FACTORS ? i : FACTORS - 1];
        for (size_t a = 0; a < arrays; a++) {
            float *to = v + i * stride + a * gap;
            const float *after = to + stride;
            for (size_t c = 0; c < width; c++) to[c] -= f * after[c];
        }
    }
}

void sdm_template_spline(float *v, size_t n, size_t stride, size_t width)
{
    splines(v, n, stride, width, 1, 0);
}

void sdm_template_prefilter(const template_network *k, float *points)
{
    const size_t nx = k->stations[0], ny = k->stations[1], nz = k->stations[2], line = 4 * nx,
                 plane = line * ny;
    for (size_t z = 0; z < nz; z++) {
        splines(points + plane * z, nx, 4, 4, ny,
                line); // independent sums overlap in the processor
        splines(points + plane * z, ny, line, line, 1, 0);
    }
    splines(points, nz, plane, plane, 1, 0);
}

// Both ends of n samples: v[0] += f v[1] and v[n-1] += f v[n-2], or the other way round (inwards).
static void add_at_ends(float *v, size_t n, size_t stride, size_t width, bool inwards, float f)
{
    float *const end[2] = {v, v + (n - 1) * stride}, *const next[2] = {v + stride, end[1] - stride};
    for (int e = 0; e < 2; e++)
        for (size_t c = 0; c < width; c++)
            if (inwards)
                next[e][c] += f * end[e][c];
            else
                end[e][c] += f * next[e][c];
}

static void add_at_all_ends(const template_network *k, float *points, bool inwards, float f)
{
    const size_t nx = k->stations[0], ny = k->stations[1], nz = k->stations[2], line = 4 * nx,
                 plane = line * ny;
    for (size_t row = 0; row < ny * nz; row++)
        add_at_ends(points + line * row, nx, 4, 4, inwards, f);
    for (size_t z = 0; z < nz; z++) add_at_ends(points + plane * z, ny, line, line, inwards, f);
    add_at_ends(points, nz, plane, plane, inwards, f);
}

void sdm_template_prefilter_back(const template_network *k, float *points)
{
    // Along an axis, with the symmetric matrix T of the inner samples, the coefficients are
    // T^-1 (6 v - ends) within and v at the ends. The transpose is 6 T^-1 within; its values next
    // to the ends, divided by 6, are subtracted from the ends. sdm_template_prefilter() computes 6
    // T^-1 if it is given what it will subtract.
    add_at_all_ends(k, points, true, 1.0f / 6);
    sdm_template_prefilter(k, points);
    add_at_all_ends(k, points, false, -1.0f / 6);
}

// q[3] = the point of the frame, without the warp, of a station.
static void station_in_frame(const part_pose *pose, const sdm_grid *grid, size_t x, size_t y,
                             size_t z, double q[3])
{
    double world[3];
    sdm_template_station_world(grid, x, y, z, world);
    for (int c = 0; c < 3; c++) world[c] -= pose->b[c];
    m3_apply(pose->inverse, world, q);
}

void sdm_template_invert(const template_network *k, const sdm_template_part *part,
                         const part_pose *pose, const sdm_grid *grid, const warp_scratch *w)
{
    const size_t *n = k->stations;
    const template_table *kernels = sdm_template_kernels();
    const template_warp warp = sdm_template_warp_of(part, w->control);
    const sdm_lattice *near = &part->near;
    template_stations s = {.n = n[0],
                           .origin = {near->origin[0], near->origin[1], near->origin[2]},
                           .spacing = near->spacing,
                           .line = n[0],
                           .plane = n[0] * n[1]};
    memcpy(s.frame, pose->inverse, sizeof s.frame);
    for (size_t z = 0; z < n[2]; z++)
        for (size_t y = 0; y < n[1]; y += s.n_lines) {
            const bool in_turn = y < 2 || z < 2;
            const size_t at = z * s.plane + y * s.line, left = z < 2 ? n[1] - y : 2 - y;
            s.n_lines = !in_turn ? 1 : left < 4 ? left : 4;
            for (size_t l = 0; l < s.n_lines; l++) {
                double first[3], second[3];
                station_in_frame(pose, grid, 0, y + l, z, first);
                station_in_frame(pose, grid, 1, y + l, z, second);
                for (int c = 0; c < 3; c++)
                    s.first[c][l] = first[c], s.step[c][l] = second[c] - first[c];
            }
            s.points = w->points + 4 * at;
            s.metric = w->metric + 8 * at;
            s.station = w->station ? w->station + at : NULL;
            (in_turn ? kernels->invert_in_turn : kernels->invert_line)(&warp, &s);
        }
}
