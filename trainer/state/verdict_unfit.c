/* Writes the uses for which a trained model is not accurate enough, one line of text for each. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/verdict.h"

/* The lines so far. */
typedef struct unfit_lines {
    char *text;
    size_t size;
} unfit_lines;

static void add(unfit_lines *l, const char *format, ...) SDM_PRINTF(2, 3);

/* Adds one line; one for which there is no room is left out. */
static void add(unfit_lines *l, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(l->text + l->size, SDM_MODEL_UNFIT - l->size, format, arguments);
    va_end(arguments);
    if (n > 0 && l->size + (size_t)n + 2 <= SDM_MODEL_UNFIT) {
        l->size += (size_t)n;
        l->text[l->size++] = '\n';
    }
    l->text[l->size] = '\0';
}

/* text[16] = a relative error in per cent with two digits, from 10 % on a whole number. Returns
 * text. */
static const char *percent(double error, char text[16])
{
    snprintf(text, 16, error >= 0.1 ? "%.0f" : "%.2g", 100 * error);
    return text;
}

/* Parts that the maps lack, or cut. */
static void add_parts(const sdm_verdict *v, unfit_lines *l)
{
    char text[16];
    const double spacing = sdm_verdict_spacing(v);
    if (v->inside_out > 0) add(l, "the parts that are inside out, which are missing");
    if (v->open > 0)
        add(l, "the places of open or badly oriented edges of the meshes: inside and outside are "
               "a guess there");
    // the line of the grade tells of more, unless parts are inside out
    if (v->cut > 0 && (v->cut <= SDM_CUT_POOR || v->inside_out > 0))
        add(l, "the %.2g %% of the shapes that the grid cuts", fmin(99, 100 * v->cut));
    if (sdm_verdict_errs_far(v))
        add(l, "distances far from the surface: wrong by up to %.2g mm", v->far_largest_mm);
    if (v->volume_error > SDM_VOLUME_BAD)
        add(l, "volumes of maps: off by %s %%", percent(v->volume_error, text));
    if (sdm_hopelessly_thin(v->thickness_mm, v->coarse_mm))
        add(l,
            "its thinnest part: it is %.2g mm thick in a few held-out shapes, which no grid of the "
            "whole shape shows: is one of its lengths in another unit than mm?",
            v->thickness_mm);
    else if (sdm_verdict_lacks_part(v))
        add(l,
            "its thinnest part and volumes of surfaces (.stl): it is %.2g mm thick in a few "
            "held-out shapes, too thin for "
            "voxels of %.3g mm, and will be missing or broken; grid.spacing %.2g shows it",
            v->thickness_mm, v->coarse_mm, spacing);
    else if (sdm_verdict_voxels_cut(v) && spacing < v->coarse_mm)
        add(l,
            "volumes of surfaces (.stl): off by %s %%, voxels of %.3g mm cut edges and thin parts; "
            "about %.0f %% (root mean square of the shapes) with generate --spacing %.2g",
            percent(v->surface_volume_error, text), v->coarse_mm, 100 * SDM_VOLUME_AIM, spacing);
    else if (sdm_verdict_surfaces_off(v))
        add(l, "volumes of surfaces (.stl): off by %s %%", percent(v->surface_volume_error, text));
    const double finer = sdm_verdict_fit_spacing(v),
                 blurs = SDM_GRID_FIT_ADVISED * SDM_GRID_FIT_DATA; // voxels by the blur
    if (finer > 0 && !sdm_verdict_lacks_part(v))
        add(l,
            "fits by the network alone: the thinnest part, %.2g mm in a few held-out shapes, has "
            "%.1f voxels across it, and %.2g or more are safe; use sdmgen fit --exact --spacing "
            "%.2g (an image with a blur below %.2g mm: %.2g times its blur)",
            v->thickness_mm, floor(10 * v->thickness_mm / v->coarse_mm + 1e-9) / 10,
            SDM_GRID_FIT_VOXELS / SDM_GRID_FIT_ADVISED, finer, finer / blurs, blurs);
}

/* Of the distances at the voxels themselves the network has all of the error. */
static void add_derivatives(const sdm_verdict *v, unfit_lines *l)
{
    char cause[SDM_VERDICT_LIST + 80] = "";
    if (v->volume_causes[0])
        snprintf(cause, sizeof cause,
                 "; exact maps on voxels of %.3g mm err by %s; take differences of meshes",
                 v->coarse_mm, v->volume_causes);
    if (v->derivatives_bad[0])
        add(l, "derivatives of maps by %s; the network causes it: sdmgen exact --jacobian is exact",
            v->derivatives_bad);
    if (v->volume_derivatives_bad[0])
        add(l, "derivatives of the volume by %s%s", v->volume_derivatives_bad, cause);
    if (v->volume_derivatives_small[0])
        add(l, "derivatives of the volume by %s; take differences of meshes",
            v->volume_derivatives_small);
}

void sdm_verdict_unfit(const sdm_verdict *v, char text[SDM_MODEL_UNFIT])
{
    unfit_lines l = {.text = text};
    *text = '\0';
    add_parts(v, &l);
    add_derivatives(v, &l);
    if (v->triangles_by[0])
        add(&l,
            "derivatives of exact maps (exact --jacobian, fit --exact or --polish) where the "
            "triangles change with %s: vertices do not correspond there",
            v->triangles_by);
}
