/* Shows the verdict of a fit: what was checked, with its figure and the limit of the figure. */
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

/* Must the figure of a finding be at least the limit, not at most? */
static bool needs_at_least(const sdm_fit_finding *x)
{
    const bool above = x->figure >= x->limit;
    switch (x->kind) {
    case SDM_FIT_CHECK_NO_SHAPE:
    case SDM_FIT_CHECK_IN_IMAGE:
    case SDM_FIT_CHECK_BLOB:
    case SDM_FIT_CHECK_MIRROR:
    case SDM_FIT_CHECK_SIZE:
    case SDM_FIT_CHECK_NEXT_POSE:
        return true;
    case SDM_FIT_CHECK_CONTRAST: // inside brighter or darker, as at the start
    case SDM_FIT_CHECK_DATA:     // a number of points, or the edge of a voxel
        return above == (x->grade == SDM_FIT_PASSED);
    default:
        return false;
    }
}

/* Prints one check: its name, grade and figure, and why it did not pass. */
static void print_finding(const sdm_fit_finding *x)
{
    char figure[64] = "";
    int n = 0;
    // + 0: no negative zero
    if (!isnan(x->figure)) n = snprintf(figure, sizeof figure, "%.3g", x->figure + 0);
    if (!isnan(x->limit))
        snprintf(figure + n, sizeof figure - (size_t)n, ", need at %s %.3g",
                 needs_at_least(x) ? "least" : "most", x->limit);
    printf("  %-12s %-9s %s%s%s\n", sdm_fit_check_name(x->kind), GRADES[x->grade], figure,
           *figure && *x->text ? ": " : "", x->text);
}

/* Has a check passed without a remark? */
static bool is_plain(const sdm_fit_finding *x) { return x->grade == SDM_FIT_PASSED && !*x->text; }

/* Prints the names, figures and limits of the checks that passed without a remark. */
static void print_passed(const sdm_fit_verdict *v)
{
    enum { A_LINE = 4 };
    size_t n = 0, all = 0;
    for (size_t i = 0; i < v->n_findings; i++) all += is_plain(&v->findings[i]);
    for (size_t i = 0; i < v->n_findings; i++) {
        const sdm_fit_finding *x = &v->findings[i];
        if (!is_plain(x)) continue;
        if (n % A_LINE == 0) printf("  %-12s ", n ? "" : "passed");
        printf("%s", sdm_fit_check_name(x->kind));
        if (!isnan(x->figure)) printf(" %.3g", x->figure + 0);
        if (!isnan(x->limit)) printf(" %s %.3g", needs_at_least(x) ? ">=" : "<=", x->limit);
        n++;
        printf("%s", n == all ? "\n" : n % A_LINE ? ", " : ",\n");
    }
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
    if (f->target.kind == SDM_FIT_POINTS &&
        cli_fit_found(f, SDM_FIT_CHECK_OFFSET, SDM_FIT_DOUBTFUL, -INFINITY))
        return "the object may differ from the shape by the length in the line `offset`: use the "
               "values only if you can accept this";
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
            if ((int)v->findings[i].grade == grade && !is_plain(&v->findings[i]))
                print_finding(&v->findings[i]);
    print_passed(v);
    if (f->target.kind == SDM_FIT_POINTS && !f->opts.keep_appearance && v->grade != SDM_FIT_FAILED)
        printf("  scatter      compare the standard deviation about the surface with the error of "
               "your scanner: if it is larger, the object has another shape\n");
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
