/* Principal components of aligned shapes. */
#include <math.h>
#include <string.h>

#include "numerics/linalg.h"
#include "sdm/internal/ssm_build.h"
#include "sdm/memory.h"

/* gram[n][n] = products of the deviations, divided by n - 1. */
static void gram_matrix(size_t n, size_t size, const double *x, double *gram)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            double sum = 0;
            for (size_t k = 0; k < size; k++) sum += x[size * i + k] * x[size * j + k];
            gram[n * i + j] = gram[n * j + i] = sum / (double)(n - 1);
        }
}

/* Row i of modes = the sum of the deviations with the weights of eigenvector i: its square is the
 * eigenvalue. */
static void fill_modes(size_t n, size_t size, const double *x, const double *vectors, sdm_ssm *out)
{
    const double scale = 1 / sqrt((double)(n - 1));
    for (size_t i = 0; i < out->n_modes; i++)
        for (size_t j = 0; j < n; j++) {
            const double weight = scale * vectors[n * i + j];
            for (size_t k = 0; k < size; k++) out->modes[size * i + k] += weight * x[size * j + k];
        }
}

sdm_status sdm_ssm_components(size_t n, size_t n_vert, double *vert, const double *mean,
                              sdm_ssm *out, sdm_error *err)
{
    const size_t size = 3 * n_vert;
    double *gram = NULL, *values = NULL;
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < size; k++) vert[size * i + k] -= mean[k];
    sdm_status s = SDM_ALLOC(&gram, n * n, "Gram matrix", err);
    if (!s) s = SDM_ALLOC(&values, n, "variances", err);
    if (s) goto done;
    gram_matrix(n, size, vert, gram);
    s = trainer_eigen_symmetric(n, gram, values, err);
    if (s) goto done;
    while (out->n_modes + 1 < n && values[out->n_modes] > 1e-10 * values[0]) out->n_modes++;
    double extent = 0;
    for (size_t k = 0; k < size; k++) extent += mean[k] * mean[k];
    if (!(values[0] > 1e-20 * extent)) out->n_modes = 0;
    if (out->n_modes == 0) {
        s = sdm_fail(err, SDM_E_ARG, "all shapes are equal: there is nothing to learn");
        goto done;
    }
    s = SDM_ALLOC(&out->mean, size, "mean shape", err);
    if (!s) s = SDM_ALLOC(&out->modes, out->n_modes * size, "modes", err);
    if (!s) s = SDM_ALLOC(&out->variance, out->n_modes, "variances", err);
    if (s) goto done;
    out->n_vert = n_vert;
    memcpy(out->mean, mean, size * sizeof *mean);
    memcpy(out->variance, values, out->n_modes * sizeof *values);
    for (size_t i = 0; i < out->n_modes; i++) out->total += values[i];
    fill_modes(n, size, vert, gram, out);
done:
    sdm_free(values);
    sdm_free(gram);
    if (s) sdm_ssm_dispose(out);
    return s;
}
