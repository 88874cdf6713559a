/* The uses that a model is good enough for, by the figures that its training measured. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/volume_cause.h"
#include "sdm/model.h"

/* Digits after the point with which 100 * error is seen to exceed 100 * bad. */
static int digits_over(double error, double bad)
{
    int n = error < 0.1;
    while (n < 6 && rint(100 * error * pow(10, n)) <= 100 * bad * pow(10, n)) n++;
    return n;
}

/* What is known of the parameter with the largest error. */
typedef struct worst_param {
    char name[64];     /* "the worst parameter" where it is not known */
    const char *lines; /* else the first line of `unfit` about these derivatives; NULL: none */
} worst_param;

/* The parameter whose derivatives have this error: the first of the line of `unfit` that begins
 * with `begin`, if its error there is the same; an error of the derivative's own size is not. */
static worst_param find_worst(const char *unfit, const char *begin, double error)
{
    worst_param worst = {.name = "the worst parameter", .lines = strstr(unfit, begin)};
    const char *name = worst.lines ? worst.lines + strlen(begin) : NULL,
               *end = name ? strstr(name, ": off by ") : NULL;
    char same[48];
    if (!end) return worst;
    if (error > 10)
        snprintf(same, sizeof same, ": off by over 1000 %%");
    else
        snprintf(same, sizeof same, ": off by %.0f %%", 100 * error);
    const size_t n = strlen(same);
    if (strncmp(end, same, n) || !strncmp(end + n, " of their own", strlen(" of their own")))
        return worst;
    snprintf(worst.name, sizeof worst.name, "%.*s", (int)(end - name), name);
    worst.lines = NULL;
    return worst;
}

static sdm_status check_grade(const sdm_model_quality *q, sdm_error *err)
{
    if (!q->grade[0]) return sdm_fail(err, SDM_E_UNSUPPORTED, "the model has no grade");
    return strcmp(q->grade, "poor")
               ? SDM_OK
               : sdm_fail(err, SDM_E_QUALITY, "the training graded this model poor");
}

static sdm_status check_distances(const sdm_model_info *m, sdm_error *err)
{
    const double *h = m->grid.spacing, voxel = fmin(h[0], fmin(h[1], h[2])),
                 error = m->quality.far_error_mm;
    if (isnan(error))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "the training did not measure distances far from the surface");
    if (error <= voxel) return SDM_OK;
    return sdm_fail(
        err, SDM_E_QUALITY,
        "distances of its maps farther than %.3g mm from the surface are wrong by up "
        "to %.2g mm; nearer ones have an RMS error of %.2g mm; all of exact maps are right",
        m->accuracy.near_mm, error, m->accuracy.rmse_near_mm);
}

sdm_status sdm_model_check_use(const sdm_model *m, sdm_model_use use, sdm_error *err)
{
    if (!m || (int)use < SDM_USE_SURFACE || use > SDM_USE_SURFACE_VOLUME)
        return sdm_fail(err, SDM_E_ARG, "model: a model and a use of it are needed");
    const sdm_model_info *info = sdm_model_get_info(m);
    const sdm_model_quality *q = &info->quality;
    if (use == SDM_USE_SURFACE) return check_grade(q, err);
    if (use == SDM_USE_DISTANCE) return check_distances(info, err);
    static const char slopes[] = "; exact maps have right ones (sdmgen exact --jacobian), unless "
                                 "a parameter changes the triangles of the shape",
                      volume_slopes[] = "; take differences of volumes of the mesh (exact "
                                        "--measure): those of maps swing as faces cross planes of "
                                        "voxels";
    const bool network = !sdm_voxels_explain_volume(q->surface_volume_error, q->volume_error);
    const struct {
        const char *name;  // of the figure
        const char *lines; // how its lines in `unfit` begin, which name parameters; NULL: none do
        double error, bad;
        const char *remedy;
    } figures[] =
        {[SDM_USE_VOLUME] = {"volumes of its maps", NULL, q->volume_error, SDM_VOLUME_BAD,
                             "; those of exact maps are right"},
         [SDM_USE_SURFACE_VOLUME] = {"volumes inside the surfaces of its maps", NULL,
                                     q->surface_volume_error, SDM_VOLUME_BAD,
                                     network
                                         ? ": the network errs, more than voxels cut off"
                                         : ": they cut edges and thin walls between the voxels"},
         [SDM_USE_DERIVATIVE] = {"derivatives of its maps", "derivatives of maps by ",
                                 q->derivative_error, SDM_DERIVATIVE_BAD, slopes},
         [SDM_USE_VOLUME_DERIVATIVE] = {"derivatives of volumes of its maps",
                                        "derivatives of the volume by ", q->volume_derivative_error,
                                        SDM_DERIVATIVE_BAD, volume_slopes}},
      *f = &figures[use];
    if (isnan(f->error))
        return sdm_fail(err, SDM_E_UNSUPPORTED, "the training did not measure the errors of %s",
                        f->name);
    if (f->error <= f->bad) return SDM_OK;
    char percent[32] = "over 1000";
    if (!f->lines || f->error <= 10)
        snprintf(percent, sizeof percent, "%.*f", digits_over(f->error, f->bad), 100 * f->error);
    worst_param worst = {.name = ""};
    if (f->lines) worst = find_worst(q->unfit, f->lines, f->error);
    return sdm_fail(err, SDM_E_QUALITY, "%s are off by %s %%%s%s, more than %g %%%s%s%.*s", f->name,
                    percent, f->lines ? " for " : "", worst.name, 100 * f->bad, f->remedy,
                    worst.lines ? "; in the words of the training: " : "",
                    worst.lines ? (int)strcspn(worst.lines, "\n") : 0,
                    worst.lines ? worst.lines : "");
}
