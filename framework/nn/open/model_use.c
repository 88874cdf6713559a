/* The uses that a model is good enough for, by the figures that its training measured. */
#include <math.h>
#include <string.h>

#include "sdm/model.h"

sdm_status sdm_model_check_use(const sdm_model *m, sdm_model_use use, sdm_error *err)
{
    if (!m || (int)use < SDM_USE_SURFACE || use > SDM_USE_VOLUME_DERIVATIVE)
        return sdm_fail(err, SDM_E_ARG, "model: a model and a use of it are needed");
    const sdm_model_quality *q = &sdm_model_get_info(m)->quality;
    if (use == SDM_USE_SURFACE) {
        if (!q->grade[0]) return sdm_fail(err, SDM_E_UNSUPPORTED, "the model has no grade");
        return strcmp(q->grade, "poor")
                   ? SDM_OK
                   : sdm_fail(err, SDM_E_QUALITY, "the training graded this model poor");
    }
    const struct {
        const char *name, *worst;
        double error, bad;
    } figures[] = {[SDM_USE_VOLUME] = {"volumes", "", q->volume_error, SDM_VOLUME_BAD},
                   [SDM_USE_DERIVATIVE] = {"derivatives", " for the worst parameter",
                                           q->derivative_error, SDM_DERIVATIVE_BAD},
                   [SDM_USE_VOLUME_DERIVATIVE] = {"derivatives of volumes",
                                                  " for the worst parameter",
                                                  q->volume_derivative_error, SDM_DERIVATIVE_BAD}},
      *f = &figures[use];
    if (isnan(f->error))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "the training did not measure the errors of %s of the model's maps",
                        f->name);
    if (f->error <= f->bad) return SDM_OK;
    return sdm_fail(err, SDM_E_QUALITY,
                    "%s of its maps are off by %.*f %%%s, more than %g %%: exact maps have right "
                    "ones%s",
                    f->name, f->error < 0.1, 100 * f->error, f->worst, 100 * f->bad,
                    use == SDM_USE_VOLUME ? "" : ", unless the parameters change the triangles");
}
