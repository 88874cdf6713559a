/* Shows the verdict of a fit: what was checked, with its figure and the bound that it needs. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"
#include "sdm/internal/fit_finding.h"

static const char *const GRADES[] = {
    [SDM_FIT_PASSED] = "passed", [SDM_FIT_DOUBTFUL] = "doubtful", [SDM_FIT_FAILED] = "FAILED"};

const char *cli_fit_grade_name(sdm_fit_grade grade)
{
    static const char *const words[] = {
        [SDM_FIT_PASSED] = "passed", [SDM_FIT_DOUBTFUL] = "doubtful", [SDM_FIT_FAILED] = "failed"};
    return words[grade];
}

/* What the figure of a check is. */
static const char *const MEANINGS[SDM_FIT_N_CHECKS] = {
    [SDM_FIT_CHECK_NO_SHAPE] = "gain over an image without the shape",
    [SDM_FIT_CHECK_CONTRAST] = "mean value inside minus mean value outside",
    [SDM_FIT_CHECK_CAVITY] = "radius of the largest ball in the shape, mm",
    [SDM_FIT_CHECK_IN_IMAGE] = "share of the shape that lies in the image",
    [SDM_FIT_CHECK_CONVERGED] = "iterations",
    [SDM_FIT_CHECK_RESIDUALS] = "residuals inside the surface over noise",
    [SDM_FIT_CHECK_BESIDE] = "residuals outside of the surface over noise",
    [SDM_FIT_CHECK_EMPTY] = "share of the shape that is of another material",
    [SDM_FIT_CHECK_MISSING] = "the shape's material beside it, over its volume",
    [SDM_FIT_CHECK_INSIDE] = "spread of the values inside, fitted over measured",
    [SDM_FIT_CHECK_OUTSIDE] = "spread of the values outside, fitted over measured",
    [SDM_FIT_CHECK_GIVEN] = "mean values found, from those given, in sd",
    [SDM_FIT_CHECK_BOUNDS] = "parameters at an end of their range",
    [SDM_FIT_CHECK_BLOB] = "gain over an ellipsoid in its place",
    [SDM_FIT_CHECK_KEPT_POSE] = "gain of a free pose",
    [SDM_FIT_CHECK_MIRROR] = "gain over the mirror image",
    [SDM_FIT_CHECK_GRID] = "depth of the border of the maps in the shape, mm",
    [SDM_FIT_CHECK_NETWORK] = "share of the shapes that the model's grid cuts",
    [SDM_FIT_CHECK_SIZE] = "spread of the points, mm",
    [SDM_FIT_CHECK_VOXELS] = "voxel of the maps, mm",
    [SDM_FIT_CHECK_NEXT_POSE] = "gain over the next best pose or parameter",
    [SDM_FIT_CHECK_PATCH] = "share of the points that form another surface",
    [SDM_FIT_CHECK_COVERED] = "share of the surface without points",
    [SDM_FIT_CHECK_NETWORK_ERROR] = "move of a parameter by exact maps, in sd",
    [SDM_FIT_CHECK_KEPT_PARAMS] = "gain of free parameters",
    [SDM_FIT_CHECK_OFFSET] = "mean distance of the surface of the data, mm",
};

/* What the figure of this check is in this fit; points have no material. */
static const char *meaning_of(const cli_fit *f, sdm_fit_check_kind kind)
{
    const bool points = f->target.kind == SDM_FIT_POINTS;
    if (kind == SDM_FIT_CHECK_DATA)
        return points ? "points on the surface" : "longest edge of a voxel of the labels, mm";
    if (points && kind == SDM_FIT_CHECK_EMPTY)
        return "space between the surface and points inside of it, over the volume";
    if (points && kind == SDM_FIT_CHECK_MISSING)
        return "space between the surface and points outside of it, over the volume";
    return MEANINGS[kind];
}

/* The side of the limit on which the figure of a finding must lie. */
static const char *bound_name(const sdm_fit_finding *x)
{
    const bool above = x->figure >= x->limit;
    switch (x->kind) {
    case SDM_FIT_CHECK_NO_SHAPE:
    case SDM_FIT_CHECK_IN_IMAGE:
    case SDM_FIT_CHECK_BLOB:
    case SDM_FIT_CHECK_MIRROR:
    case SDM_FIT_CHECK_SIZE:
    case SDM_FIT_CHECK_NEXT_POSE:
        return "at least";
    case SDM_FIT_CHECK_CONTRAST: // inside brighter or darker, as at the start
    case SDM_FIT_CHECK_DATA:     // a number of points, or the edge of a voxel
        return above == (x->grade == SDM_FIT_PASSED) ? "at least" : "at most";
    default:
        return "at most";
    }
}

/* Prints one check: its name, grade and figure, and why it did not pass or what the figure is. */
static void print_finding(const cli_fit *f, const sdm_fit_finding *x)
{
    char figure[64] = "";
    int n = 0;
    // + 0: no negative zero
    if (!isnan(x->figure)) n = snprintf(figure, sizeof figure, "%.3g", x->figure + 0);
    if (!isnan(x->limit))
        snprintf(figure + n, sizeof figure - (size_t)n, ", need %s %.3g", bound_name(x), x->limit);
    printf("  %-12s %-9s", sdm_fit_check_name(x->kind), GRADES[x->grade]);
    if (*x->text)
        printf(" %s%s%s\n", figure, *figure ? ": " : "", x->text);
    else
        printf(" %-28s %s\n", figure, meaning_of(f, x->kind));
}

void cli_fit_verdict_words(const cli_fit *f, char text[FIT_WORDS_MAX])
{
    const sdm_fit_verdict *v = &f->result.verdict;
    const sdm_fit_finding *worst = NULL;
    text[0] = 0;
    if (!v->n_findings) return;
    for (size_t i = 0; i < v->n_findings; i++)
        if (v->findings[i].grade > (worst ? worst->grade : SDM_FIT_PASSED)) worst = &v->findings[i];
    if (worst)
        snprintf(text, FIT_WORDS_MAX, "%s (%s)", cli_fit_grade_name(v->grade),
                 sdm_fit_check_name(worst->kind));
    else
        snprintf(text, FIT_WORDS_MAX, "%s", cli_fit_grade_name(v->grade));
}

/* Are all checks with this grade or a worse one among these? */
static bool only(const sdm_fit_verdict *v, sdm_fit_grade grade, const sdm_fit_check_kind *kinds,
                 size_t n)
{
    for (size_t i = 0; i < v->n_findings; i++) {
        size_t k = 0;
        while (k < n && kinds[k] != v->findings[i].kind) k++;
        if (v->findings[i].grade >= grade && k == n) return false;
    }
    return true;
}

/* Are the points too few to test the fit? Then the check has no bound. */
static bool untested(const sdm_fit_verdict *v)
{
    const sdm_fit_finding *x = sdm_fit_finding_of(v, SDM_FIT_CHECK_RESIDUALS);
    return x && x->grade == SDM_FIT_DOUBTFUL && isnan(x->limit);
}

/* Is a check doubtful because the data want a parameter beyond its range? Its value and all others
 * may be wrong then. */
static bool wants_beyond(const sdm_fit_verdict *v)
{
    const sdm_fit_finding *x = sdm_fit_finding_of(v, SDM_FIT_CHECK_BOUNDS);
    return x && x->grade > SDM_FIT_PASSED && strstr(x->text, "the data want ");
}

/* Do the data show a part of the shape only, as `covered` says? */
static bool shows_a_part(const cli_fit *f)
{
    return cli_fit_found(f, SDM_FIT_CHECK_COVERED, SDM_FIT_DOUBTFUL, -INFINITY);
}

/* Is the fit doubtful, and only because the data show a part of the shape or do not determine every
 * parameter? */
static bool only_a_part(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    static const sdm_fit_check_kind part[] = {SDM_FIT_CHECK_COVERED, SDM_FIT_CHECK_DATA,
                                              SDM_FIT_CHECK_BOUNDS};
    const bool open = shows_a_part(f) || cli_fit_has_open(f);
    return v->grade == SDM_FIT_DOUBTFUL &&
           only(v, SDM_FIT_DOUBTFUL, part, open && !wants_beyond(v) ? 3 : 2);
}

/* Is the fit through a network doubtful, and only because the data show a part of the shape or the
 * network errs? */
static bool a_part_by_network(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    static const sdm_fit_check_kind part[] = {SDM_FIT_CHECK_NETWORK_ERROR, SDM_FIT_CHECK_COVERED,
                                              SDM_FIT_CHECK_DATA, SDM_FIT_CHECK_BOUNDS};
    return v->grade == SDM_FIT_DOUBTFUL && shows_a_part(f) && cli_fit_knows_usable(f) &&
           only(v, SDM_FIT_DOUBTFUL, part, wants_beyond(v) ? 3 : 4);
}

/* Does the line `use` name the values that can be used? Through a network it does not: where the
 * data show nothing, the errors of its map pass for data. */
static bool tells_usable(const cli_fit *f)
{
    const bool network = f->source.model && !f->result.polished;
    return (f->result.verdict.grade == SDM_FIT_PASSED && cli_fit_has_open(f)) ||
           (only_a_part(f) && cli_fit_knows_usable(f) && !network);
}

/* Figures beyond their limits by less than this share of these are barely beyond. */
#define BARELY 0.05

/* Do residuals or values of tissues alone doubt a fit to an image or labels, each with a figure
 * barely above its limit? */
static bool is_barely_doubtful(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    static const sdm_fit_check_kind values[] = {SDM_FIT_CHECK_RESIDUALS, SDM_FIT_CHECK_BESIDE,
                                                SDM_FIT_CHECK_INSIDE, SDM_FIT_CHECK_OUTSIDE};
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        if (x->grade > SDM_FIT_PASSED && !(x->figure <= (1 + BARELY) * x->limit)) return false;
    }
    return f->target.kind != SDM_FIT_POINTS && only(v, SDM_FIT_DOUBTFUL, values, 4);
}

/* What a verdict means that doubts the maps, and perhaps more. NULL: it does not doubt them. */
static const char *short_of_maps(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    static const sdm_fit_check_kind network[] = {SDM_FIT_CHECK_NETWORK_ERROR,
                                                 SDM_FIT_CHECK_NETWORK},
                                    voxels[] = {SDM_FIT_CHECK_VOXELS, SDM_FIT_CHECK_NETWORK_ERROR,
                                                SDM_FIT_CHECK_NETWORK};
    if (only(v, SDM_FIT_DOUBTFUL, network, 2))
        return "the network limits the fit: exact maps change the values as the lines below say";
    if (!cli_fit_found(f, SDM_FIT_CHECK_VOXELS, SDM_FIT_DOUBTFUL, -INFINITY)) return NULL;
    return only(v, SDM_FIT_DOUBTFUL, voxels, 3)
               ? "the maps are too coarse to judge the shape: fit with finer ones before you use "
                 "the values"
               : "the maps are too coarse, or this is another shape: fit with finer maps before "
                 "you use the values";
}

/* What a verdict that is not `passed` means for the user of the values. */
static const char *in_short(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    static const sdm_fit_check_kind end[] = {SDM_FIT_CHECK_CONVERGED},
                                    few[] = {SDM_FIT_CHECK_COVERED, SDM_FIT_CHECK_DATA,
                                             SDM_FIT_CHECK_RESIDUALS};
    if (v->grade == SDM_FIT_FAILED)
        return only(v, SDM_FIT_FAILED, end, 1)
                   ? "do not use the values: the fit has not come to an end"
                   : "do not use the values: the data contradict them or do not decide";
    if (tells_usable(f))
        return shows_a_part(f) ? "the data show a part of the shape: the line `use` names the "
                                 "values that can be used"
                               : "the data do not determine every parameter: the line `use` names "
                                 "the values that can be used";
    if (a_part_by_network(f))
        return "the data show a part of the shape; where they show nothing, errors of the network "
               "may pass for data: --polish tells the values that can be used";
    if (only_a_part(f))
        return "the data show a part of the shape: do not use what the lines below name, nor what "
               "is `not determined`";
    if (untested(v) && only(v, SDM_FIT_DOUBTFUL, few, sizeof few / sizeof *few))
        return cli_fit_found(f, SDM_FIT_CHECK_COVERED, SDM_FIT_DOUBTFUL, -INFINITY)
                   ? "the data show a part of the shape, and too few points to test the fit: do "
                     "not use what the lines below name, nor what is `not determined`"
                   : "the points are too few to test the fit: its values may be right or wrong";
    const char *maps = short_of_maps(f);
    if (maps) return maps;
    const bool finer = !isfinite(f->result.advised_voxel_mm) && isfinite(cli_fit_finer_voxel(f));
    if (is_barely_doubtful(f))
        return finer ? "barely above a limit, so the contour decides (-o fit.png): if it lies on "
                       "the object, use the values, or fit with finer maps"
                     : "barely above a limit, so the contour decides (-o fit.png): if it lies on "
                       "the object, use the values";
    if (finer)
        return "the maps are nearly too coarse, or the data differ from the shape as the lines "
               "below say: fit with finer maps, and look at a picture (-o fit.png)";
    return "the data may differ from the shape as the lines below say: look at a picture "
           "(-o fit.png) before you use the values";
}

void cli_fit_doubt_changed_shape(cli_fit *f)
{
    if (!f->shape_changed || !f->result.verdict.n_findings) return;
    sdm_fit_finding x = {.kind = SDM_FIT_CHECK_NETWORK_ERROR,
                         .grade = SDM_FIT_DOUBTFUL,
                         .figure = NAN,
                         .limit = NAN};
    snprintf(x.text, sizeof x.text,
             "the shape '%s' was changed after the training of the network, which shows the shape "
             "of that time: this may be another shape than you mean, and the error of the network "
             "is not measured; load the shape of that time (--plugin FILE), or train again",
             f->shape_name);
    sdm_fit_verdict_add(&f->result.verdict, &x);
}

void cli_fit_print_verdict(const cli_fit *f)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    if (!v->n_findings) return;
    printf("verdict: %s\n", cli_fit_grade_name(v->grade));
    if (v->grade != SDM_FIT_PASSED) printf("  %-12s %s\n", "in short", in_short(f));
    if (f->source.model && !f->shape && !f->judge_shape && !f->shape_changed)
        printf("  %-12s not tested: the exact shape '%s' is not known here, so the error of "
               "the network is not measured, and the standard deviations may be too "
               "small; load its plug-in (--plugin FILE)\n",
               sdm_fit_check_name(SDM_FIT_CHECK_NETWORK_ERROR), f->shape_name);
    // the worst first
    for (int grade = SDM_FIT_FAILED; grade >= SDM_FIT_PASSED; grade--)
        for (size_t i = 0; i < v->n_findings; i++)
            if ((int)v->findings[i].grade == grade) print_finding(f, &v->findings[i]);
    if (cli_fit_start_is_suspect(f) && f->opts.turns == SDM_FIT_TURNS_NONE &&
        !isnan(f->args->pose.rotation[0]))
        printf("  --rotation gives one start: without it the fit tries 60 rotations\n");
    if (tells_usable(f)) cli_fit_print_usable(f);
}

void cli_fit_json_verdict(const cli_fit *f, sdm_json *j)
{
    const sdm_fit_verdict *v = &f->result.verdict;
    sdm_json_open(j, "verdict", '{');
    sdm_json_text(j, "grade", cli_fit_grade_name(v->grade));
    sdm_json_open(j, "checks", '[');
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "name", sdm_fit_check_name(x->kind));
        sdm_json_text(j, "grade", cli_fit_grade_name(x->grade));
        sdm_json_real(j, "figure", x->figure + 0);
        sdm_json_real(j, "limit", x->limit);
        sdm_json_text(j, "text", x->text);
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
    if (v->n_findings && v->grade != SDM_FIT_PASSED) sdm_json_text(j, "in_short", in_short(f));
    if (tells_usable(f)) cli_fit_json_usable(f, j);
    sdm_json_close(j, '}');
    if (!f->mirror) return;
    sdm_json_open(j, "mirror", '{');
    sdm_json_text(j, "option", f->mirror);
    if (*f->side) sdm_json_text(j, "value", f->side);
    sdm_json_real(j, "better_by", f->better);
    sdm_json_close(j, '}');
}
