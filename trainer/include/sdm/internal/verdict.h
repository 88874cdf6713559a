/* The verdict on a finished training: how good the model is, of which parts its error consists,
   what limits it, and which key of the configuration to change. All figures are measured in the
   run, on the held-out shapes unless stated otherwise; NaN: not measured. */
#pragma once

#include "sdm/internal/text.h"
#include "sdm/model.h" /* SDM_VOLUME_BAD, SDM_DERIVATIVE_BAD */

#ifdef __cplusplus
extern "C" {
#endif

/* A model is good only if its root mean square error, at voxels within one voxel of the surface, is
   at most this many voxels. */
#define SDM_GRADE_GOOD_VOXELS 0.05

/* The same of the Dice overlap: at least so much. */
#define SDM_GRADE_GOOD_DICE 0.98

/* What a model is good for, by its error within a voxel of the surface, by its Dice overlap, and by
   the fraction of the shapes that the grid cuts. */
typedef enum sdm_grade {
    SDM_GRADE_GOOD = 0, /* at most SDM_GRADE_GOOD_VOXELS, Dice at least 0.98, 5 % cut at most */
    SDM_GRADE_USABLE,   /* at most a fifth of a voxel, Dice at least 0.9, half of the shapes cut */
    SDM_GRADE_POOR
} sdm_grade;

/* The causes of error. All but the last add up to the mean square error of the model. */
typedef enum sdm_cause {
    /* `pod` and the correction of `template`: too few basis functions. Measured: what the best
       coefficients leave of training maps. */
    SDM_CAUSE_BASES = 0,
    /* The network is too small or was trained too shortly. Measured: the error of its coefficients
       (other kinds: of its maps) on training maps. */
    SDM_CAUSE_NETWORK,
    /* Too few maps. Measured: error on held-out maps minus error on training maps. */
    SDM_CAUSE_MAPS,
    /* The weights in the file have fewer digits. Measured: model minus network before rounding. */
    SDM_CAUSE_ROUNDING,
    /* `template`: motion, warp and the lattices of the template. Measured: model minus correction,
       the share of the voxels near the surface (near_mm). */
    SDM_CAUSE_TEMPLATE,
    /* `template`: far from the surface its maps are estimates, bounds inside overlaps of parts and
       distances to first order where a part is stretched. Measured: the share of the other voxels.
     */
    SDM_CAUSE_FAR,
    /* The voxels are too large for the shape. Measured: exact maps, interpolated at points of the
       exact surface. Not a part of the error at the voxels. */
    SDM_CAUSE_GRID,
    SDM_CAUSES
} sdm_cause;

/* Bytes of a text that lists parameters with their errors. */
enum { SDM_VERDICT_LIST = 320 };

typedef struct sdm_verdict {
    double voxel_mm;               /* smallest spacing of the grid */
    double rmse_mm, rmse_voxel_mm; /* of all voxels; of those within a voxel of the surface */
    double dice, dice_min; /* overlap of the volumes inside: mean, and smallest of a shape */
    /* by the exact distance: root mean square errors of the voxels within near_mm of the surface
       (two voxels), and of those farther inside and outside; NaN: there are none */
    double near_mm, rmse_near_mm, rmse_inside_mm, rmse_outside_mm;
    double largest_mm, largest_at_mm; /* largest error of a voxel; exact signed distance there */
    double far_largest_mm; /* largest error of a voxel farther than near_mm; NaN: there are none */
    sdm_grade grade;
    int64_t heldout;             /* number of the shapes on which the figures were measured */
    double part_mm2[SDM_CAUSES]; /* parts of the mean square error; of the grid: of the surface */
    /* Part of the held-out root mean square error, beyond that of the bases, that the last third of
       the steps took away. */
    double fall;
    double modes_mm2; /* `pod`: what the bases can represent and network.modes leaves out */
    double motion_mm, warp_mm; /* `template`: frames and amplitudes, and warp, at the vertices */
    /* `pod` and the correction of `template`: total degree of the polynomials, and their ridge
       relative to the number of maps, as the trainer chose them; NaN: no polynomials */
    double degree, ridge;
    double thin; /* fraction of the surface where the shape is thinner than two voxels or has an
                    edge */
    double thickness_mm; /* of the thinnest part of a few held-out shapes; NaN: not known */
    double coarse_mm;    /* largest spacing of the grid */
    double cut; /* fraction of the held-out shapes whose surfaces leave the grid: there they end
                   open */
    /* fraction of a few held-out shapes with parts that are inside out and overlap others */
    double inside_out;
    /* fraction of a few held-out shapes with open or badly oriented edges */
    double open;
    /* On a few held-out shapes, over the right value; NaN: not measured. Volumes of maps: root mean
       square, and the largest; the same of the surfaces of these maps. Derivatives by the parameter
       for which they are worst, root mean square: of maps within half a voxel of the surface, and
       of the volume of maps. */
    double volume_error, volume_error_max, surface_volume_error, surface_volume_error_max,
        derivative_error, volume_derivative_error;
    int64_t derivative_shapes;                        /* on which derivatives were measured */
    char derivative_by[64], volume_derivative_by[64]; /* names of these parameters; "": none */
    /* all parameters whose errors exceed SDM_DERIVATIVE_BAD, the worst first, as "a: off by 32 %;
       by b: off by 24 %"; cut where they are too many. Of the volume: of the parameters that
       change it by at least 5 % over their range; the others have their own list, with their errors
       over the size of their derivatives, however small. */
    char derivatives_bad[SDM_VERDICT_LIST], volume_derivatives_bad[SDM_VERDICT_LIST],
        volume_derivatives_small[SDM_VERDICT_LIST];
    /* the errors of derivatives of the volume that exact maps on these voxels have, of the
       parameters of volume_derivatives_bad, and what mends them: "25 % for a: take a finer
       grid.spacing; by 4 % for b: the network errs, ..."; "": not measured. The largest of them;
       NaN: not measured. */
    char volume_causes[SDM_VERDICT_LIST];
    double volume_derivative_voxels;
    /* the parameters that move no part of the surface, "a, b"; "": none was found */
    char still_params[SDM_VERDICT_LIST];
    /* a parameter that changes the numbers of vertices or the triangles of the mesh, so that
       vertices do not correspond; "": none was found */
    char triangles_by[64];
    /* error of the derivative of the volume over its own root mean square, however small, of the
       parameter for which it is worst, and the name of this parameter; NaN, "": not measured, or
       no parameter changes the volume */
    double volume_own_error;
    char volume_own_by[64];
    double saved_seconds; /* that train.patience has saved */
    bool limited;         /* false: nothing that could be measured limits the model */
    sdm_cause limit;
    /* The key to change, its value in the run and the value to try; "": none. */
    char key[40];
    double from, to;
    /* train.minutes for the training with this change; 0: as many as now, or other budgets */
    double minutes;
    double at_best_mm;  /* root mean square error without the part that limits; NaN: not known */
    char sentence[512]; /* what limits the model and what to do, one sentence */
} sdm_verdict;

/* "bases", "network", "maps", "rounding", "template", "far" or "grid". [any thread] */
const char *sdm_cause_name(sdm_cause cause);

/* How the part was measured, a few words. [any thread] */
const char *sdm_cause_text(sdm_cause cause);

/* A model is poor if its grid cuts a larger fraction of the held-out shapes. */
#define SDM_CUT_POOR 0.5

/* A model is poor if its thinnest part is thinner than this multiple of a voxel: it is missing in
   most places. */
#define SDM_PART_MISSING 0.7

/* "good", "usable" or "poor". [any thread] */
const char *sdm_grade_name(sdm_grade grade);

/* Figures from fewer held-out shapes say little. */
enum { SDM_HELDOUT_FEW = 10 };

/* What follows the name of a grade: " (from 3 shapes only)", or "" from SDM_HELDOUT_FEW held-out
   shapes on and for 0, not known. `text` holds SDM_GRADE_FEW characters. Returns text. [any thread]
 */
enum { SDM_GRADE_FEW = 32 };
const char *sdm_grade_few(int64_t heldout, char *text);

/* What such a model is good for, without the uses that its other figures exclude; of a poor one why
   it is not for use. `text` holds SDM_GRADE_TEXT characters. Returns text. [any thread] */
enum { SDM_GRADE_TEXT = 160 };
const char *sdm_grade_text(const sdm_verdict *v, char *text);

/* text = the uses for which the model is not good, a line each, with a '\n' at the end of each; "":
   none. [any thread] */
void sdm_verdict_unfit(const sdm_verdict *v, char text[SDM_MODEL_UNFIT]);

/* The surfaces of the maps enclose too small or too large volumes (surface_volume_error exceeds
   SDM_VOLUME_BAD). [any thread] */
bool sdm_verdict_surfaces_off(const sdm_verdict *v);

/* They do, and voxels that cut edges and thin walls explain it: the volumes of maps are much
   better. [any thread] */
bool sdm_verdict_voxels_cut(const sdm_verdict *v);

/* Are parts of the meshes inside out, or edges open, or is a part so thin that no grid shows it
   (sdm_hopelessly_thin())? Then neither network nor maps are the cause. */
bool sdm_verdict_broken(const sdm_verdict *v);

/* At the surface the model is not good, by its error within a voxel, its Dice overlap or volumes
   that voxels do not explain. [any thread] */
bool sdm_verdict_errs_near(const sdm_verdict *v);

/* A template limits the model near the surface, too: another kind of network is the remedy, no key
   of this one. [any thread] */
bool sdm_verdict_needs_pod(const sdm_verdict *v);

/* The grid does not show the thinnest part of the shapes (sdm_too_thin()). [any thread] */
bool sdm_verdict_lacks_part(const sdm_verdict *v);

/* Fits need maps with SDM_GRID_FIT_VOXELS / SDM_GRID_FIT_ADVISED voxels across the thinnest part:
   their spacing, mm, rounded down to two digits; NaN: the maps have so many, or the thickness is
   not known. [any thread] */
double sdm_verdict_fit_spacing(const sdm_verdict *v);

/* The one spacing that the verdict advises, mm: that of its key, or the spacing that shows the
   thinnest part or keeps the volumes of surfaces where the grid changes them, not the network; NaN:
   none. Rounded down to two digits. [any
   thread] */
double sdm_verdict_spacing(const sdm_verdict *v);

/* The error of volumes that advice aims at: well below SDM_VOLUME_BAD. */
#define SDM_VOLUME_AIM 0.01

/* The spacing, mm, with which surfaces enclose volumes that are off by about SDM_VOLUME_AIM, where
   with `spacing` they are off by `off` > 0 of the volume, because voxels cut edges and thin walls.
   Rounded down to two digits. [any thread] */
double sdm_spacing_for_volume(double spacing, double off);

/* true: farther than near_mm from the surface, where the grade says nothing, the largest error
   exceeds a voxel. [any thread] */
bool sdm_verdict_errs_far(const sdm_verdict *v);

/* Adds the figures of the verdict to the open object of *j. */
void sdm_verdict_json(sdm_json *j, const sdm_verdict *v);

#ifdef __cplusplus
}
#endif
