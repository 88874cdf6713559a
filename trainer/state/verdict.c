/* The words and the JSON of a verdict. */
#include "sdm/internal/verdict.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/volume_cause.h"

const char *sdm_cause_name(sdm_cause cause)
{
    static const char *const names[] = {"bases",    "network", "maps", "rounding",
                                        "template", "far",     "grid"};
    return (size_t)cause < SDM_CAUSES ? names[cause] : "unknown";
}

const char *sdm_cause_text(sdm_cause cause)
{
    static const char *const texts[] = {
        "error of the best coefficients of the bases, on training maps",
        "further error of the network on training maps",
        "further error on held-out maps, which the training has not seen",
        "rounding of the weights in the model file",
        "error of the template near the surface",
        "its error elsewhere: far away, in overlaps of parts, in stretched parts",
        "distance of the exact maps, interpolated between voxels, at the exact surface"};
    return (size_t)cause < SDM_CAUSES ? texts[cause] : "unknown";
}

const char *sdm_grade_name(sdm_grade grade)
{
    return grade == SDM_GRADE_GOOD ? "good" : grade == SDM_GRADE_USABLE ? "usable" : "poor";
}

const char *sdm_grade_few(int64_t heldout, char *text)
{
    *text = '\0';
    if (heldout > 0 && heldout < SDM_HELDOUT_FEW)
        snprintf(text, SDM_GRADE_FEW, " (from %d %s only)", (int)heldout,
                 heldout == 1 ? "shape" : "shapes");
    return text;
}

bool sdm_verdict_lacks_part(const sdm_verdict *v)
{
    return sdm_too_thin(v->thickness_mm, v->coarse_mm);
}

bool sdm_verdict_surfaces_off(const sdm_verdict *v)
{
    return v->surface_volume_error > SDM_VOLUME_BAD;
}

bool sdm_verdict_voxels_cut(const sdm_verdict *v)
{
    return sdm_verdict_surfaces_off(v) &&
           sdm_voxels_explain_volume(v->surface_volume_error, v->volume_error);
}

bool sdm_verdict_broken(const sdm_verdict *v)
{
    return v->inside_out > 0 || v->open > 0 || sdm_hopelessly_thin(v->thickness_mm, v->coarse_mm);
}

bool sdm_verdict_errs_near(const sdm_verdict *v)
{
    return v->rmse_voxel_mm > SDM_GRADE_GOOD_VOXELS * v->voxel_mm ||
           v->dice < SDM_GRADE_GOOD_DICE || v->volume_error > SDM_VOLUME_BAD ||
           (sdm_verdict_surfaces_off(v) && !sdm_verdict_voxels_cut(v));
}

bool sdm_verdict_needs_pod(const sdm_verdict *v)
{
    return v->limited && v->limit == SDM_CAUSE_FAR && !(v->cut > 0) && !sdm_verdict_broken(v) &&
           sdm_verdict_errs_near(v);
}

/* Why a poor model is not for use. */
static const char *poor_text(const sdm_verdict *v, char *text)
{
    if (v->inside_out > 0)
        snprintf(text, SDM_GRADE_TEXT, "not for use: parts of the shape are missing");
    else if (v->cut > SDM_CUT_POOR)
        snprintf(text, SDM_GRADE_TEXT,
                 "not for use: its grid cuts %.3g %% of the shapes, whose surfaces end open there",
                 fmin(v->cut < 1 ? 99 : 100, 100 * v->cut));
    else if (v->thickness_mm < SDM_PART_MISSING * v->coarse_mm)
        snprintf(text, SDM_GRADE_TEXT, "not for use: its thinnest part is missing");
    else
        snprintf(text, SDM_GRADE_TEXT, "not for use: whole voxels are on the wrong side");
    return text;
}

/* The unit of the second digit of x > 0. */
static double second_digit(double x) { return pow(10, floor(log10(x)) - 1); }

/* The spacing, rounded down to two digits. */
static double rounded_down(double spacing)
{
    const double unit = second_digit(spacing);
    return floor(spacing / unit) * unit;
}

/* The smallest blur of images, or voxels of labels, for which the voxels of the maps are fine
 * enough, mm, rounded up to two digits. */
static double finest_data(const sdm_verdict *v)
{
    const double least = v->coarse_mm / (SDM_GRID_FIT_ADVISED * SDM_GRID_FIT_DATA),
                 unit = second_digit(least);
    return ceil(least / unit - 1e-9) * unit;
}

/* Fits need a thinnest part that is known, and data that are no finer than the maps. */
static void write_good_uses(const sdm_verdict *v, bool measures, char *text)
{
    if (isnan(v->thickness_mm) || !isnan(sdm_verdict_fit_spacing(v)))
        snprintf(text, SDM_GRADE_TEXT, "for level sets%s",
                 measures ? ", surfaces and measurements" : " and surfaces");
    else
        snprintf(text, SDM_GRADE_TEXT,
                 "for level sets, surfaces%s fits to images with a blur (standard deviation), or "
                 "labels with voxels, of %.2g mm or more",
                 measures ? ", measurements and" : " and", finest_data(v));
}

const char *sdm_grade_text(const sdm_verdict *v, char *text)
{
    // a volume is a measurement
    const bool measures = !(v->volume_error > SDM_VOLUME_BAD) && !sdm_verdict_surfaces_off(v) &&
                          !sdm_verdict_lacks_part(v);
    if (v->grade == SDM_GRADE_POOR) return poor_text(v, text);
    if (v->grade == SDM_GRADE_GOOD)
        write_good_uses(v, measures, text);
    else
        snprintf(text, SDM_GRADE_TEXT, "for pictures, segmentations and first fits%s",
                 measures ? "; for measurements check maps with --max-error" : "");
    return text;
}

double sdm_spacing_for_volume(double spacing, double off)
{
    // the volume that edges and thin walls lose is about quadratic in the spacing
    return rounded_down(sqrt(SDM_VOLUME_AIM / off) * spacing);
}

double sdm_verdict_fit_spacing(const sdm_verdict *v)
{
    const double enough = SDM_GRID_FIT_ADVISED * v->thickness_mm / SDM_GRID_FIT_VOXELS;
    return enough < v->coarse_mm ? rounded_down(enough) : NAN;
}

double sdm_verdict_spacing(const sdm_verdict *v)
{
    if (!strcmp(v->key, "grid.spacing")) return v->to;
    if (sdm_hopelessly_thin(v->thickness_mm, v->coarse_mm)) return NAN;
    if (sdm_verdict_lacks_part(v)) return rounded_down(0.5 * v->thickness_mm);
    return sdm_verdict_voxels_cut(v) ? sdm_spacing_for_volume(v->coarse_mm, v->surface_volume_error)
                                     : NAN;
}

bool sdm_verdict_errs_far(const sdm_verdict *v) { return v->far_largest_mm > v->voxel_mm; }

void sdm_verdict_json(sdm_json *j, const sdm_verdict *v)
{
    char key[32];
    sdm_json_text(j, "grade", sdm_grade_name(v->grade));
    sdm_json_real(j, "voxel_mm", v->voxel_mm);
    sdm_json_real(j, "rmse_mm", v->rmse_mm);
    sdm_json_real(j, "rmse_voxel_mm", v->rmse_voxel_mm);
    sdm_json_real(j, "near_mm", v->near_mm);
    sdm_json_real(j, "rmse_near_mm", v->rmse_near_mm);
    sdm_json_real(j, "rmse_inside_mm", v->rmse_inside_mm);
    sdm_json_real(j, "rmse_outside_mm", v->rmse_outside_mm);
    sdm_json_real(j, "largest_mm", v->largest_mm);
    sdm_json_real(j, "largest_at_mm", v->largest_at_mm);
    sdm_json_real(j, "far_largest_mm", v->far_largest_mm);
    sdm_json_real(j, "dice", v->dice);
    sdm_json_real(j, "dice_min", v->dice_min);
    for (int i = 0; i < SDM_CAUSES; i++) {
        snprintf(key, sizeof key, "%s_mm2", sdm_cause_name((sdm_cause)i));
        sdm_json_real(j, key, v->part_mm2[i]);
    }
    sdm_json_real(j, "modes_mm2", v->modes_mm2);
    sdm_json_real(j, "motion_mm", v->motion_mm);
    sdm_json_real(j, "warp_mm", v->warp_mm);
    sdm_json_real(j, "degree", v->degree);
    sdm_json_real(j, "ridge", v->ridge);
    sdm_json_real(j, "thin", v->thin);
    sdm_json_real(j, "thickness_mm", v->thickness_mm);
    sdm_json_real(j, "cut", v->cut);
    sdm_json_real(j, "inside_out", v->inside_out);
    sdm_json_real(j, "open", v->open);
    sdm_json_real(j, "volume_error", v->volume_error);
    sdm_json_real(j, "volume_error_max", v->volume_error_max);
    sdm_json_real(j, "surface_volume_error", v->surface_volume_error);
    sdm_json_real(j, "surface_volume_error_max", v->surface_volume_error_max);
    sdm_json_int(j, "derivative_shapes", v->derivative_shapes);
    sdm_json_real(j, "derivative_error", v->derivative_error);
    sdm_json_text(j, "derivative_by", v->derivative_by);
    sdm_json_real(j, "volume_derivative_error", v->volume_derivative_error);
    sdm_json_text(j, "volume_derivative_by", v->volume_derivative_by);
    sdm_json_real(j, "volume_own_error", v->volume_own_error);
    sdm_json_text(j, "volume_own_by", v->volume_own_by);
    sdm_json_real(j, "volume_derivative_voxels", v->volume_derivative_voxels);
    sdm_json_text(j, "triangles_by", v->triangles_by);
    sdm_json_real(j, "fall", v->fall);
    sdm_json_text(j, "limit", v->limited ? sdm_cause_name(v->limit) : "none");
    sdm_json_text(j, "key", v->key);
    sdm_json_real(j, "from", v->from);
    sdm_json_real(j, "to", v->to);
    sdm_json_real(j, "minutes", v->minutes);
    sdm_json_real(j, "at_best_mm", v->at_best_mm);
    sdm_json_text(j, "sentence", v->sentence);
}
