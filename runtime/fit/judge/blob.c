/* The ellipsoid of equal moments, at the samples: seen through the point spread of the fit, or its
 * distance. */
#include "blob.h"

#include <math.h>
#include <string.h>

#include "finding.h"
#include "fit/data/blur.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/threads.h"

// A shape that has this Dice coefficient with its blob cannot be told from one: no comparison.
#define BLOB_ALIKE 0.9

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

// Dice coefficient of the shape and the ellipsoid on the map
static double likeness(const fit_maps *m, const ellipsoid *e)
{
    double shape = 0, blob = 0, both = 0, x[3];
    for (size_t v = 0; v < m->n_voxels; v++) {
        voxel_centre(&m->grid, v, x);
        const bool in = m->distance[v] < 0, in_blob = ellipsoid_distance(e, x) < 0;
        shape += in, blob += in_blob, both += in && in_blob;
    }
    return 2 * both / fmax(shape + blob, 1);
}

// field[samples.n] = share of the ellipsoid at the samples, through the point spread of the fit
static sdm_status shares_at(const fit_problem *p, const ellipsoid *e, double *field, sdm_error *err)
{
    const fit_maps *m = &p->maps;
    double *share = NULL, *spare = NULL, x[3];
    sdm_status s = SDM_ALLOC(&share, m->n_voxels, "rival of the fit", err);
    if (!s) s = SDM_ALLOC(&spare, m->n_voxels, "rival of the fit", err);
    for (size_t v = 0; v < m->n_voxels && !s; v++) {
        voxel_centre(&m->grid, v, x);
        share[v] = 0.5 * erfc(ellipsoid_distance(e, x) / m->min_blur * 0.70710678118654752);
    }
    if (!s) {
        const double rest = p->state.blur * p->state.blur - m->min_blur * m->min_blur;
        sdm_fit_blur(&m->grid, 1, fmax(rest, 0), true, sdm_threads(p->opts->n_threads), &share,
                     &spare);
        const fit_field f = {.grid = &m->grid, .packed = share, .n_fields = 1};
        for (size_t i = 0; i < p->samples.n; i++)
            field[i] = sdm_fit_field_at(&f, &p->state, p->samples.world + 3 * i);
    }
    sdm_free(share);
    sdm_free(spare);
    return s;
}

// log-likelihood of the samples at these fields, with the tissues of the fit
static double log_likelihood_at(const fit_problem *p, const double *field)
{
    double sum = 0;
    fit_likelihood l;
    for (size_t i = 0; i < p->samples.n; i++) {
        sdm_fit_likelihood(&p->observation, (double)p->samples.value[i],
                           fit_sample_weights(&p->samples, i), field[i], false, &l);
        sum += l.log_likelihood;
    }
    return sum;
}

sdm_status sdm_fit_check_blob(const fit_problem *p, double factor, sdm_fit_verdict *v,
                              sdm_error *err)
{
    const ellipsoid e = ellipsoid_of(&p->maps);
    if (likeness(&p->maps, &e) > BLOB_ALIKE) return SDM_OK;
    fit_problem blob = *p;
    fit_standing own, rival;
    double x[3];
    blob.samples.field = NULL;
    sdm_status s = SDM_ALLOC(&blob.samples.field, p->samples.n, "rival of the fit", err);
    if (!s && p->maps.share) s = shares_at(p, &e, blob.samples.field, err);
    for (size_t i = 0; i < p->samples.n && !s && !p->maps.share; i++) {
        sdm_fit_to_shape(&p->state, p->samples.world + 3 * i, x);
        blob.samples.field[i] = ellipsoid_distance(&e, x);
    }
    if (!s) blob.information.log_likelihood = log_likelihood_at(p, blob.samples.field);
    if (!s) s = sdm_fit_stand(p, factor, &own, err);
    if (!s) s = sdm_fit_stand(&blob, factor, &rival, err);
    sdm_free(blob.samples.field);
    if (s) return s;
    const double gain = sdm_fit_gain(&own, &rival);
    if (isnan(gain)) return SDM_OK;
    sdm_fit_judge_add(
        v, SDM_FIT_CHECK_BLOB, gain > SDM_FIT_PREFERRED, SDM_FIT_FAILED, gain, SDM_FIT_PREFERRED,
        "a blob of the same size in its place explains the data as well as the shape does");
    return SDM_OK;
}
