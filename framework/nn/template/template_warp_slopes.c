/* How the stations of a warp move with its frame and its control points: derivatives of the inverse
   of the warp, in forward and in reverse mode. */
#include <string.h>

#include "sdm/internal/mat3.h"
#include "template_internal.h"

// Row and column of the elements xx, yy, zz, yz, xz, xy.
static const int ROW[6] = {0, 1, 2, 1, 0, 0}, COLUMN[6] = {0, 1, 2, 2, 2, 1};

/* A station of which the derivatives are asked: the point x of the world, less the frame's b. */
typedef struct moving_station {
    double x[3], inverse[9], b[9], metric[9]; /* B and B B^T, see sdm_template_metric() */
    double bend[3][9];                        /* second derivatives of the warp at y */
    template_place place;
} moving_station;

static void prepare_station(const sdm_template_part *part, const part_pose *pose,
                            const warp_scratch *w, const template_station *s, moving_station *out)
{
    double u[3], du[9], turned[9];
    memcpy(out->inverse, s->inverse, sizeof s->inverse);
    m3_product(s->inverse, pose->inverse, out->b);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) turned[3 * i + j] = out->b[3 * j + i];
    m3_product(out->b, turned, out->metric);
    sdm_template_displacement(&part->warp, w->control, s->y, u, du, out->bend);
    const template_warp warp = sdm_template_warp_of(part, w->control);
    sdm_template_kernels()->find_place(&warp, s->y, &out->place);
}

// The station x, y, z of the lattice of stations.
static moving_station moving_station_at(const template_network *k, const sdm_template_part *part,
                                        const part_pose *pose, const sdm_grid *grid,
                                        const warp_scratch *w, size_t x, size_t y, size_t z)
{
    const size_t at = (z * k->stations[1] + y) * k->stations[0] + x;
    moving_station s;
    sdm_template_station_world(grid, x, y, z, s.x);
    for (int c = 0; c < 3; c++) s.x[c] -= pose->b[c];
    prepare_station(part, pose, w, &w->station[at], &s);
    return s;
}

// The derivatives of a station.
static void move_station(const sdm_template_part *part, const moving_station *s,
                         const warp_motion *motion, float points[4], float metric[8])
{
    const template_warp warp = sdm_template_warp_of(part, motion->control);
    double dq[3] = {0}, du[9], f[3], dy[3], a[9], am[9];
    float sum[4][4];
    // q = m^-1 (x - b): dq = d(m^-1) (x - b) - m^-1 db
    if (motion->turns) m3_apply(motion->inverse, s->x, dq);
    // y + U(y) = q: (I + U') dy = dq - dU(y)
    sdm_template_kernels()->displace(&warp, &s->place, sum);
    for (int c = 0; c < 3; c++) f[c] = dq[c] - motion->shift[c] - (double)sum[0][c];
    m3_apply(s->inverse, f, dy);
    for (int c = 0; c < 3; c++) points[c] = (float)(dy[c] * (1 / part->near.spacing));
    points[3] = 0;
    // B = J^-1 m^-1, J = I + U': dB = -J^-1 dJ B + J^-1 d(m^-1), dJ = dU' + U'' dy.
    // The metric G = B B^T changes by H + H^T with H = dB B^T = -J^-1 dJ G + J^-1 d(m^-1) B^T.
    for (int e = 0; e < 9; e++)
        du[e] = (double)sum[1 + e % 3][e / 3] +
                (s->bend[0][e] * dy[0] + s->bend[1][e] * dy[1] + s->bend[2][e] * dy[2]);
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
                const moving_station s = moving_station_at(k, part, pose, grid, w, x, y, z);
                for (size_t d = 0; d < n; d++)
                    move_station(part, &s, &motion[d], motion[d].points + 4 * at,
                                 motion[d].metric + 8 * at);
            }
}

/* Reverse mode: the transpose of move_station(). */

// out = m^T x
static void apply_transpose(const double m[9], const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++) out[i] = m[i] * x[0] + m[3 + i] * x[1] + m[6 + i] * x[2];
}

// out = a^T b, the product of the transpose of a with b
static void product_of_transpose(const double a[9], const double b[9], double out[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[3 * i + j] = a[i] * b[j] + a[3 + i] * b[3 + j] + a[6 + i] * b[6 + j];
}

// The adjoint of am of move_station().
static void metric_back(const float metric[8], double am[9])
{
    memset(am, 0, 9 * sizeof *am);
    for (int c = 0; c < 6; c++) {
        am[3 * ROW[c] + COLUMN[c]] -= (double)metric[c];
        am[3 * COLUMN[c] + ROW[c]] -= (double)metric[c];
    }
}

// Adds the adjoints that follow from those of a station's point and metric.
static void move_station_back(const sdm_template_part *part, const moving_station *s,
                              const float points[4], const float metric[8], warp_adjoint *adjoint)
{
    double am[9], a[9], du[9], dy[3], f[3], turn[9];
    float sum[4][4] = {{0}};
    metric_back(metric, am);
    // am = J^-1 du G - J^-1 d(m^-1) B^T
    m3_product(am, s->metric, a);
    product_of_transpose(s->inverse, a, du);
    m3_product(am, s->b, a);
    product_of_transpose(s->inverse, a, turn);
    // du = dU' + U'' dy, dy = J^-1 f
    for (int c = 0; c < 3; c++) {
        dy[c] = (double)points[c] * (1 / part->near.spacing);
        for (int e = 0; e < 9; e++) dy[c] += s->bend[c][e] * du[e];
    }
    apply_transpose(s->inverse, dy, f);
    for (int e = 0; e < 9; e++) sum[1 + e % 3][e / 3] = (float)du[e];
    // f = d(m^-1) (x - b) - shift - dU
    for (int c = 0; c < 3; c++) {
        sum[0][c] = (float)-f[c];
        adjoint->shift[c] -= f[c];
        for (int e = 0; e < 3; e++) adjoint->inverse[3 * c + e] += f[c] * s->x[e] - turn[3 * c + e];
    }
    const template_warp warp = sdm_template_warp_of(part, NULL);
    sdm_template_kernels()->displace_back(&warp, &s->place, (const float(*)[4])sum,
                                          adjoint->control);
}

static bool is_zero(const float *v, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (v[i] != 0) return false;
    return true;
}

void sdm_template_invert_back(const template_network *k, const sdm_template_part *part,
                              const part_pose *pose, const sdm_grid *grid, const warp_scratch *w,
                              const float *points, const float *metric, warp_adjoint *adjoint)
{
    size_t at = 0;
    for (size_t z = 0; z < k->stations[2]; z++)
        for (size_t y = 0; y < k->stations[1]; y++)
            for (size_t x = 0; x < k->stations[0]; x++, at++) {
                if (is_zero(points + 4 * at, 3) && is_zero(metric + 8 * at, 6)) continue;
                const moving_station s = moving_station_at(k, part, pose, grid, w, x, y, z);
                move_station_back(part, &s, points + 4 * at, metric + 8 * at, adjoint);
            }
}
