/* The thickness of the thinnest part of the shapes of a family. */
#include <math.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/internal/threads.h"
#include "shape_family.h"

/* *mm = the thickness of the thinnest part of the shape at p; NaN: not known, or walls lie on each
 * other. */
static sdm_status thickness_at(const sdm_instance *shape, const double *p, double *mm)
{
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    *mm = NAN;
    sdm_status s = sdm_instance_mesh(shape, p, &mesh, NULL);
    if (!s) s = sdm_part_audit_make(&mesh, SDM_AUDIT_WALLS, NULL, &audit, NULL);
    if (!s) *mm = sdm_part_audit_thickness(&audit);
    for (size_t i = 0; i < audit.n && !s; i++)
        if (sdm_survey_part_is_flat(&audit, i)) *mm = NAN;
    sdm_part_audit_dispose(&audit);
    sdm_mesh_dispose(&mesh);
    return s;
}

/* p[n_params] = shape `index` of a survey of the family. */
static void survey_shape(const shape_family *f, size_t index, double *p)
{
    const size_t n = f->shape->n_params;
    if (index > f->n_corners)
        sdm_family_sample(f, index - 1 - f->n_corners, p);
    else if (index)
        sdm_family_corner(f, index - 1, p);
    else
        for (size_t k = 0; k < n; k++)
            p[k] = fmin(fmax(f->shape->params[k].def, f->min[k]), f->max[k]);
}

sdm_status sdm_shape_thickness_ends(const sdm_instance *shape, const double (*range)[2],
                                    const sdm_distribution *distribution, size_t samples,
                                    uint64_t seed, int n_threads, double *mm, sdm_error *err)
{
    shape_family f;
    double least = INFINITY;
    bool memory = false;
    *mm = NAN;
    const sdm_status s = sdm_family_set(&f, shape, range, distribution, seed, err);
    if (s) return s;
    const size_t all = 1 + f.n_corners + samples,
                 most = sdm_survey_samples(shape, all); // fewer of large meshes
    const int64_t n = (int64_t)(most < all ? most : all);
#pragma omp parallel for schedule(dynamic) num_threads(sdm_threads(n_threads)) reduction(min       \
                                                                                         : least)
    for (int64_t i = 0; i < n; i++) {
        double p[SHAPE_PARAMS_MAX], own;
        survey_shape(&f, (size_t)i, p);
        const sdm_status failed = thickness_at(shape, p, &own);
        if (own < least) least = own;
        if (failed == SDM_E_NOMEM)
#pragma omp atomic write
            memory = true;
    }
    if (memory) return sdm_fail(err, SDM_E_NOMEM, "out of memory for the thickness of the shapes");
    if (least < INFINITY) *mm = least;
    return SDM_OK;
}

sdm_status sdm_shape_thickness(const sdm_instance *shape, const double (*range)[2], size_t samples,
                               uint64_t seed, double *mm, sdm_error *err)
{
    if (!shape || !mm) return sdm_fail(err, SDM_E_ARG, "a thickness needs a shape and a result");
    *mm = NAN;
    shape_family f;
    sdm_mesh mesh = {0};
    double p[SHAPE_PARAMS_MAX];
    sdm_status s = sdm_family_set(&f, shape, range, NULL, seed, err);
    for (size_t i = 0; i < samples && !s; i++) {
        sdm_part_audit audit = {0};
        sdm_family_sample(&f, i, p);
        s = sdm_instance_mesh(shape, p, &mesh, err);
        if (!s) s = sdm_part_audit_make(&mesh, SDM_AUDIT_WALLS, NULL, &audit, err);
        if (!s)
            *mm = fmin(
                *mm, sdm_part_audit_thickness(&audit)); // of NaN and a number fmin() is the number
        sdm_part_audit_dispose(&audit);
    }
    sdm_mesh_dispose(&mesh);
    return s;
}
