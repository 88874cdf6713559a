/* The thickness of the thinnest part of the shapes of a family. */
#include <math.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "shape_family.h"

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
