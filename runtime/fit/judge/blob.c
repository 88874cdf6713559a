/* The ellipsoid of equal moments on the map of the shape, blurred in the same way, at the samples.
 */
#include "blob.h"

#include <math.h>
#include <string.h>

#include "fit/data/blur.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/threads.h"

/* Ellipsoid in the shape's frame: (x - centre)^T inverse (x - centre) = 1. */
typedef struct ellipsoid {
    double centre[3], inverse[9];
} ellipsoid;

static void voxel_centre(const sdm_grid *g, size_t v, double x[3])
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    sdm_grid_world(
        g, (const double[3]){(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)}, x);
}

// centre and covariance of the inside of the map; the ellipsoid of this covariance is scaled to the
// volume of the shape
static ellipsoid ellipsoid_of(const fit_maps *m)
{
    ellipsoid e = {0};
    double n = 0, covariance[9] = {0}, x[3];
    for (size_t v = 0; v < m->n_voxels; v++) {
        if (!(m->distance[v] < 0)) continue;
        voxel_centre(&m->grid, v, x);
        n++;
        for (int a = 0; a < 3; a++) e.centre[a] += x[a];
    }
    for (int a = 0; a < 3; a++) e.centre[a] /= n;
    for (size_t v = 0; v < m->n_voxels; v++) {
        if (!(m->distance[v] < 0)) continue;
        voxel_centre(&m->grid, v, x);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                covariance[3 * a + b] += (x[a] - e.centre[a]) * (x[b] - e.centre[b]) / n;
    }
    const double *h = m->grid.spacing, volume = n * h[0] * h[1] * h[2];
    const double det = m3_inverse(covariance, e.inverse);
    // volume 4/3 pi sqrt(det(s covariance)) = that of the shape
    const double s = pow(volume / (4.0 / 3 * 3.14159265358979324) / sqrt(det), 2.0 / 3);
    for (int i = 0; i < 9; i++) e.inverse[i] /= s;
    return e;
}

// signed distance to first order, (k^2 - 1) / |gradient of k^2|, which is exact at the surface
static double ellipsoid_distance(const ellipsoid *e, const double x[3])
{
    double y[3], square = 0, slope = 0;
    for (int a = 0; a < 3; a++) {
        y[a] = 0;
        for (int b = 0; b < 3; b++) y[a] += e->inverse[3 * a + b] * (x[b] - e->centre[b]);
        square += y[a] * (x[a] - e->centre[a]);
        slope += y[a] * y[a];
    }
    return (square - 1) / fmax(2 * sqrt(slope), 1e-12);
}

sdm_status sdm_fit_against_blob(const fit_problem *p, double *gain, double *alike, sdm_error *err)
{
    const fit_maps *m = &p->maps;
    const ellipsoid e = ellipsoid_of(m);
    double *share = NULL, *spare = NULL, shape = 0, blob = 0, both = 0;
    sdm_status s = SDM_ALLOC(&share, m->n_voxels, "rival of the fit", err);
    if (!s) s = SDM_ALLOC(&spare, m->n_voxels, "rival of the fit", err);
    for (size_t v = 0; v < m->n_voxels && !s; v++) {
        double x[3];
        voxel_centre(&m->grid, v, x);
        const double d = ellipsoid_distance(&e, x);
        share[v] = 0.5 * erfc(d / m->min_blur * 0.70710678118654752);
        shape += m->distance[v] < 0, blob += d < 0, both += m->distance[v] < 0 && d < 0;
    }
    if (!s) {
        const double rest = p->state.blur * p->state.blur - m->min_blur * m->min_blur;
        sdm_fit_blur(&m->grid, 1, fmax(rest, 0), true, sdm_threads(p->opts->n_threads), &share,
                     &spare);
        const fit_field f = {.grid = &m->grid, .packed = share, .n_fields = 1};
        *gain = p->information.log_likelihood;
        for (size_t i = 0; i < p->samples.n; i++) {
            fit_likelihood l;
            sdm_fit_likelihood(
                &p->observation, (double)p->samples.value[i], fit_sample_weights(&p->samples, i),
                sdm_fit_field_at(&f, &p->state, p->samples.world + 3 * i), false, &l);
            *gain -= l.log_likelihood;
        }
        *alike = 2 * both / fmax(shape + blob, 1);
    }
    sdm_free(share);
    sdm_free(spare);
    return s;
}
