/* The covariance caused by steps of labels that err together.

   Pieces i and j with the standard deviations s_i and s_j err with the covariance k_ij s_i s_j,
   where k falls from 1 for the same part of a voxel to 0 at DIFFERENT. This triangle has no
   negative Fourier coefficient, so the matrix is positive semidefinite (Bochner).

   The caller has counted the pieces as independent. Of n pieces that match, the mean then has the
   variance s^2 / n, and s^2 (1 - 1 / n) is missing. The sum keeps the variances of all other
   errors, such as that of the place of the axis. */
#include "matching_steps.h"

#include <math.h>

// difference of the places, in voxels, from which on two pieces err independently
#define DIFFERENT 0.15

static double likeness(const fit_matching_step *a, const fit_matching_step *b)
{
    const double apart = a->place - b->place;
    return fmax(1 - fabs(apart - floor(apart + 0.5)) / DIFFERENT, 0);
}

// sd that independent pieces leave out: 0 where no other piece matches
static double missing_sd(const fit_matching_step *list, size_t count, size_t i)
{
    double all = 0;
    for (size_t j = 0; j < count; j++) all += likeness(&list[i], &list[j]) * list[j].weight;
    return list[i].sd * sqrt(fmax(1 - list[i].weight / all, 0));
}

void sdm_fit_matching_steps(const fit_matching_step *list, size_t count, size_t n, double *work,
                            double *out)
{
    double *sum = work, *missing = work + n;
    for (size_t i = 0; i < count; i++) missing[i] = missing_sd(list, count, i);
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < n; k++) sum[k] = 0;
        for (size_t j = 0; j < count; j++) {
            const double k_ij = likeness(&list[i], &list[j]);
            if (!(k_ij > 0)) continue;
            for (size_t k = 0; k < n; k++) sum[k] += k_ij * missing[j] * list[j].score[k];
        }
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) out[a * n + b] += missing[i] * list[i].score[a] * sum[b];
    }
}
