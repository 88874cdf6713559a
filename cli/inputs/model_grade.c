/* Prints the verdict of the training on a model, and warns of models that are poor or cut shapes.
 */
#include "model_grade.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/verdict.h"

/* Largest fraction of the shapes that the grid of a good model cuts (docs/network.md). */
#define CUT_MAX 0.05

void cli_warn_quality(const char *path, const sdm_model_info *m)
{
    const sdm_model_quality *q = &m->quality;
    const bool poor = !strcmp(q->grade, "poor"), cut = q->cut > CUT_MAX;
    char shapes[120] = "";
    if (cut)
        snprintf(shapes, sizeof shapes,
                 "its grid cuts %.0f %% of the shapes of its family, whose maps end open (train "
                 "with grid: auto)",
                 100 * q->cut);
    if (poor || cut)
        cli_warn("%s: %s%s%s", path,
                 poor ? "the training graded this model poor (sdmgen info)" : "",
                 poor && cut ? "; " : "", shapes);
}

bool cli_warn_thin_model(const char *path, const sdm_model_info *m, const sdm_grid *g)
{
    const double thick = m->quality.thickness_mm,
                 voxel = fmax(sdm_grid_coarsest(&m->grid), sdm_grid_coarsest(g));
    const bool thin = sdm_too_thin(thick, voxel);
    sdm_text text = {0};
    if (thin) cli_add_thin(thick, voxel, &text);
    if (thin) cli_warn("%s: a part of its shapes is %s", path, text.failed ? "thin" : text.data);
    sdm_text_dispose(&text);
    return thin;
}

void cli_warn_derivatives(const char *path, const sdm_model *m)
{
    sdm_error why;
    if (sdm_model_check_use(m, SDM_USE_DERIVATIVE, &why) == SDM_E_QUALITY)
        cli_warn("%s: %s", path, why.text);
}

void cli_print_quality(const sdm_model_info *m)
{
    const sdm_model_quality *q = &m->quality;
    char few[SDM_GRADE_FEW];
    if (!*q->grade) {
        cli_print("verdict      not stored: trained by an earlier version\n");
        return;
    }
    cli_print("verdict      %s%s; the grid cuts %.3g %% of the held-out shapes\n", q->grade,
              sdm_grade_few(m->accuracy.samples, few), 100 * q->cut);
    if (!isnan(q->between_mm))
        cli_print(
            "             between the voxels exact maps, interpolated linearly, miss the surface "
            "by %.5f mm RMS\n",
            q->between_mm);
    if (!isnan(q->thickness_mm))
        cli_print("             the thinnest part of a few held-out shapes is %.2g mm thick; "
                  "at the ends of the ranges it may be thinner\n",
                  q->thickness_mm);
    if (!isnan(q->volume_error))
        cli_print("             volumes of maps are off by %.3g %%\n", 100 * q->volume_error);
    if (!isnan(q->surface_volume_error))
        cli_print("             volumes of their surfaces (.stl) are off by %.3g %%\n",
                  100 * q->surface_volume_error);
    if (!isnan(q->derivative_error))
        cli_print("             derivatives of maps near the surface are off by %.3g %% for the "
                  "worst parameter\n",
                  100 * q->derivative_error);
    // the lines `not for` tell larger errors, of each parameter
    if (!isnan(q->volume_derivative_error) && !strstr(q->unfit, "derivatives of the volume by"))
        cli_print(
            "             derivatives of volumes are off by %.3g %% for the worst parameter (%% of "
            "the derivative, or of 5 %% of the volume over the range if that is larger)\n",
            100 * q->volume_derivative_error);
}
