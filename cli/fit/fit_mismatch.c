/* Warns where the reference or the truth lies elsewhere than the fitted shape: it is probably that
 * of another case, in another frame or in another unit. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"
#include "report/crop.h"
#include "report/terminal.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/internal/vec3.h"

/* Least Dice of a reference of the same shape in the same place. */
#define DICE_LEAST 0.3
/* A fit that describes its reference has a larger one. */
#define DICE_LIKELY 0.7

/* Middle of the box around the fitted surface; returns the diagonal of the box, mm. */
static double surface_middle(const cli_fit *f, double middle[3])
{
    sdm_box b = SDM_BOX_EMPTY;
    sdm_box_add_mesh(&b, &f->surface);
    for (int a = 0; a < 3; a++) middle[a] = (b.min[a] + b.max[a]) / 2;
    return sqrt(v3_dist2(b.min, b.max));
}

/* Middle of the box around the labels of the reference; false: no voxel has a label. */
static bool reference_middle(const cli_fit *f, double middle[3])
{
    const cli_block b = cli_block_of_labels(&f->reference_grid, f->reference, 0);
    double index[3];
    if (cli_block_is_empty(&b)) return false;
    for (int a = 0; a < 3; a++) index[a] = (double)b.from[a] + 0.5 * (double)(b.n[a] - 1);
    sdm_grid_world(&f->reference_grid, index, middle);
    return true;
}

/* Where the labels overlap hardly: a place of their own points to the frame, the same place to the
 * labels. NaN: no label lies in the image. */
static void warn_reference(const cli_fit *f, const double middle[3], double size)
{
    const cli_overlap *o = &f->overlap;
    const char *path = f->args->fit.reference;
    double labels[3];
    if (!path || !o->measured || o->dice >= DICE_LEAST || !reference_middle(f, labels)) return;
    const double off = sqrt(v3_dist2(labels, middle));
    cli_warn("--reference %s: its labels %s the fitted shape, and their middle lies %.3g mm off: "
             "%s",
             path, o->n_both ? "hardly overlap" : "do not overlap", off,
             off > 0.5 * size ? "are they in another frame (RAS, LPS) or unit than mm, or of "
                                "another case?"
                              : "are they those of another structure (--reference-label) or case?");
}

/* A fit that passed, whose reference lies in its place and yet differs much. */
static void remark_reference(const cli_fit *f)
{
    const cli_overlap *o = &f->overlap;
    if (!f->args->fit.reference || !o->measured || f->result.verdict.grade != SDM_FIT_PASSED ||
        !(o->dice >= DICE_LEAST && o->dice < DICE_LIKELY))
        return;
    cli_notice("--reference %s: Dice %.2f, although the fit has passed: the shape may lack freedom "
               "for this case, or the reference is another structure or thinner than voxels show",
               f->args->fit.reference, o->dice);
}

void cli_fit_warn_mismatch(const cli_fit *f)
{
    double middle[3];
    // where the fit failed, the shape is at no place
    if (!f->surface.n_vert || f->doubt.status) return;
    const double size = surface_middle(f, middle), off = cli_fit_truth_shift(f);
    warn_reference(f, middle, size);
    remark_reference(f);
    if (off > size)
        cli_warn("--truth %s: its pose is %.3g mm off the fitted one, more than the %.3g mm that "
                 "the shape measures across: is it in another frame (RAS, LPS) or unit than mm, or "
                 "that of another case?",
                 f->args->fit.truth, off, size);
}
