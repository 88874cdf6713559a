/* Which options of `sdmgen fit` apply to which kind of input: an option that would do nothing is
 * refused. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"

/* Kinds of input. LABELLED: with --image-model labels, in place of partial volume. */
enum {
    IMAGE = 1,
    IMAGE_LABELLED = 2,
    LABELS = 4,
    LABELS_LABELLED = 8,
    POINTS = 16,
    VOLUMES = IMAGE | IMAGE_LABELLED | LABELS | LABELS_LABELLED,
    IMAGES = IMAGE | IMAGE_LABELLED
};

static bool keeps(const cli_fit_args *a, const char *what)
{
    for (size_t i = 0; i < a->keep.n; i++)
        if (!strcmp(a->keep.items[i], what)) return true;
    return false;
}

sdm_status cli_fit_check_options(const cli_fit *f, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    const bool labelled = !strcmp(a->image_model, "labels");
    // images state their frame; --ras is about coordinates of the command line and of points
    const bool places =
        !isnan(a->start_centre[0]) || !isnan(a->start_axis[0]) || !isnan(a->region[0]);
    // the table of docs/fitting-reference.md says the same
    const struct {
        const char *option;
        unsigned kinds;
        bool given;
    } rows[] = {{"--find", VOLUMES, a->find},
                {"--region", VOLUMES, !isnan(a->region[0])},
                {"--margin", VOLUMES, !isnan(a->margin)},
                {"--least-inside", VOLUMES, !isnan(a->least_inside)},
                {"--image-model labels", VOLUMES, labelled},
                {"--beside", IMAGES, !isnan(a->beside)},
                {"--inside", IMAGES, !isnan(a->inside[0])},
                {"--outside", IMAGES, !isnan(a->outside[0])},
                {"--air", IMAGES, !isnan(a->air[0])},
                {"--cavity", IMAGES, !isnan(a->cavity)},
                {"--open-end", VOLUMES, a->open_end},
                {"--tissue-places", IMAGE, !isnan(a->tissue_field)},
                {"--blur", IMAGE | LABELS, !isnan(a->blur)},
                {"--keep blur", IMAGE | LABELS, keeps(a, "blur")},
                {"--l-ref", IMAGE_LABELLED | LABELS_LABELLED, !isnan(a->l_ref)},
                {"--keep appearance", IMAGES | POINTS, keeps(a, "appearance")},
                {"--point-sd", POINTS, !isnan(a->point_sd)},
                {"--ras without --start-centre, --start-axis or --region",
                 places ? POINTS | VOLUMES : POINTS, a->ras}};
    const size_t n = sizeof rows / sizeof *rows;
    const bool points = f->target.kind == SDM_FIT_POINTS, image = f->target.kind == SDM_FIT_IMAGE;
    const unsigned kind = points     ? POINTS
                          : image    ? labelled ? IMAGE_LABELLED : IMAGE
                          : labelled ? LABELS_LABELLED
                                     : LABELS;
    for (size_t i = 0; i < n; i++) {
        if (!rows[i].given || (rows[i].kinds & kind)) continue;
        char list[256] = "";
        for (size_t k = 0; k < n; k++)
            if ((rows[k].kinds & kind) && !strchr(rows[k].option, ','))
                snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", *list ? ", " : "",
                         rows[k].option);
        return sdm_fail(err, SDM_E_ARG,
                        "fit: %s does nothing in a fit to %s%s; of the options about the target "
                        "these apply: %s",
                        rows[i].option, cli_fit_kind(f),
                        !points && labelled ? " with --image-model labels" : "", list);
    }
    return SDM_OK;
}
