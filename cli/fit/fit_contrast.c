/* Recognises that the values of the inside and the outside were exchanged on the command line. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"
#include "measure/enclosed.h"
#include "report/terminal.h"
#include "sdm/memory.h"

/* Least contrast of the exchanged values at the start, over that of the given ones: a start beside
 * the shape shows a part of it only. */
#define CONTRAST_MIN 0.15

/* Before the fit, the values pass for exchanged where the mean on either side of the start shape is
 * nearer to the value of the other side than this share of its distance from its own, and the means
 * differ by this many of their standard deviations. A value is like the inside by the same share.
 */
#define CLEARLY 0.5
#define DEVIATIONS 5.0

/* An image shows the inside at its border where so much of it is like the inside. */
#define BORDER_SHARE 0.9

/* With exchanged values, the voxels like the outside are the shape: they have its volume at the
 * start, up to this factor. */
#define VOLUME_FACTOR 4.0
/* Less than this share of the volume of the start shape is enclosed by noise and narrow gaps. */
#define ENCLOSED_MAX 0.05

/* Sums and number of the voxels of an image on one side of the surface; volume (mm^3) of this side,
 * also where it lies beside the image. */
typedef struct side_values {
    double sum, squares, n, volume;
} side_values;

/* in, around: the image within the start shape and in the layer of the margin around it, sampled at
 * the voxels of the maps. */
static sdm_status measure_start(const cli_fit *f, side_values *in, side_values *around,
                                sdm_error *err)
{
    const sdm_grid *g = f->source.model ? &sdm_model_get_info(f->source.model)->grid
                                        : &f->source.grid,
                   *image = &f->target.grid;
    const sdm_pose own = {{0, 0, 0}, {0, 0, 0}};
    const double voxel = g->spacing[0] * g->spacing[1] * g->spacing[2];
    float *map = NULL;
    sdm_status s = SDM_ALLOC(&map, sdm_grid_count(g), "distance map", err);
    if (!s) s = sdm_fit_map(&f->source, f->start, &own, g, f->opts.n_threads, map, err);
    size_t v = 0;
    for (int64_t k = 0; k < g->n[2] && !s; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++, v++) {
                const double index[3] = {(double)i, (double)j, (double)k};
                double world[3], x[3];
                bool there = map[v] <= f->opts.margin;
                side_values *side = map[v] < 0 ? in : around;
                if (there) side->volume += voxel;
                sdm_grid_world(g, index, world);
                sdm_pose_apply(&f->opts.start_pose, world, world);
                sdm_grid_index(image, world, x);
                for (int a = 0; a < 3; a++)
                    there = there && x[a] >= -0.5 && x[a] < (double)image->n[a] - 0.5;
                if (!there) continue;
                const size_t at =
                    (size_t)((llrint(x[2]) * image->n[1] + llrint(x[1])) * image->n[0] +
                             llrint(x[0]));
                const double value = f->target.values[at];
                if (isfinite(value)) side->sum += value, side->squares += value * value, side->n++;
            }
    sdm_free(map);
    return s;
}

/* *fits = a fit from the same start with the exchanged values finds the shape. Its residuals, which
 * coarse maps enlarge, and its last steps may be those of a fit that is not trustworthy. */
static sdm_status fit_exchanged(const cli_fit *f, bool *fits, sdm_error *err)
{
    sdm_fit_opts opts = f->opts;
    sdm_fit_law *in = &opts.appearance.inside[0], *out = &opts.appearance.outside[0];
    sdm_fit_result r = {0};
    const sdm_fit_law given = *in;
    in->mean = out->mean, in->sd = out->sd;
    out->mean = given.mean, out->sd = given.sd;
    opts.max_restarts = 0;
    opts.progress = NULL;
    opts.cancelled = cli_interrupted;
    sdm_status s = sdm_fit(&f->source, &f->target, &opts, &r, err);
    *fits = !s || (s == SDM_E_QUALITY && r.verdict.n_findings);
    for (size_t i = 0; i < r.verdict.n_findings; i++) {
        const sdm_fit_finding *x = &r.verdict.findings[i];
        *fits = *fits && (x->grade != SDM_FIT_FAILED || x->kind == SDM_FIT_CHECK_RESIDUALS ||
                          x->kind == SDM_FIT_CHECK_CONVERGED);
    }
    *fits = *fits && !(r.evidence <= f->result.evidence + SDM_FIT_PREFERRED);
    sdm_fit_dispose(&r);
    if (s == SDM_E_CANCELLED)
        return sdm_fail(err, s,
                        "%s: the fit was stopped on request while exchanged values of the inside "
                        "and the outside were tried; no file was written",
                        f->path);
    return s == SDM_E_NOMEM ? s : SDM_OK;
}

/* Whether the refused fit itself has exchanged them on its way, and found the shape. */
static bool has_exchanged(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    const double inside = f->opts.appearance.inside[0].mean,
                 outside = f->opts.appearance.outside[0].mean, in = r->appearance.inside[0].mean,
                 out = r->appearance.outside[0].mean;
    return r->evidence > SDM_FIT_PREFERRED && fabs(in - outside) < fabs(in - inside) &&
           fabs(out - inside) < fabs(out - outside);
}

/* text[size] = that the values of the tissues are exchanged, or the default ones wrong, and what to
 * do. a, b: the image within the start shape and around it; fitted: a fit with the exchanged values
 * has shown it. */
static void describe_exchange(const cli_fit *f, double a, double b, bool fitted, char *text,
                              size_t size)
{
    const double inside = f->opts.appearance.inside[0].mean,
                 outside = f->opts.appearance.outside[0].mean;
    const bool given = !isnan(f->args->fit.inside[0]) || !isnan(f->args->fit.outside[0]);
    char shown[120];
    if (fitted)
        snprintf(shown, sizeof shown, "a fit that exchanges them finds the shape in this image");
    else
        snprintf(shown, sizeof shown,
                 "at the start the image is %.4g within the shape and %.4g around it", a, b);
    snprintf(text, size, "%s: %s, but the inside %s %.4g and the outside %.4g: %s",
             given ? "the values of the inside and the outside are exchanged"
                   : "no values of the tissues were given, and the default ones do not suit this "
                     "image",
             shown, given ? "was given as" : "has the default value", inside, outside,
             given ? "exchange --inside and --outside"
                   : "give the values of this image with --inside and --outside");
}

/* Makes exchanged values the only reason of the refusal; see describe_exchange(). */
static void name_exchange(cli_fit *f, double a, double b, bool fitted)
{
    sdm_fit_verdict *v = &f->result.verdict;
    sdm_fit_finding why = {
        .kind = SDM_FIT_CHECK_CONTRAST, .grade = SDM_FIT_FAILED, .figure = a - b, .limit = 0};
    for (size_t i = 0; i < v->n_findings; i++) *v->findings[i].text = '\0';
    describe_exchange(f, a, b, fitted, why.text, sizeof why.text);
    sdm_fit_verdict_add(v, &why);
    snprintf(f->doubt.text, sizeof f->doubt.text, "%s", why.text);
    f->exchanged = true;
}

/* Variance of the mean of one side. The voxels of the maps may be smaller than those of the image,
 * whose noise several of them share; 27 neighbours count as one sample. */
static double variance_of_mean(const cli_fit *f, const side_values *side)
{
    const sdm_grid *image = &f->target.grid;
    const double mean = side->sum / side->n, map = cli_fit_map_voxel(f),
                 share = fmin(map * map * map /
                                  (image->spacing[0] * image->spacing[1] * image->spacing[2]),
                              1);
    return (side->squares / side->n - mean * mean) / (side->n * share / 27);
}

/* Difference of the value from the mean inside. */
static double from_inside(const sdm_fit_appearance *a, double value)
{
    return fabs(value - a->inside[0].mean);
}

/* Difference of the value from the nearest mean of the tissues outside; infinite for NaN. */
static double from_outside(const sdm_fit_appearance *a, double value)
{
    double least = INFINITY;
    for (size_t k = 0; k < a->n_outside; k++) // fmin() ignores NaN
        least = fmin(least, fabs(value - a->outside[k].mean));
    return least;
}

/* Is the value clearly nearer to the inside than to every tissue outside? NaN is not. */
static bool is_like_inside(const sdm_fit_appearance *a, double value)
{
    return from_inside(a, value) < CLEARLY * from_outside(a, value);
}

/* Is the value clearly nearer to a tissue outside than to the inside? NaN is not. */
static bool is_like_outside(const sdm_fit_appearance *a, double value)
{
    return from_outside(a, value) < CLEARLY * from_inside(a, value);
}

/* Have the voxels like the outside about the volume of the shape at the start, mm^3? Around a shape
 * whose values are right, an image mostly shows more of the outside. */
static bool outside_is_as_small(const cli_fit *f, double shape)
{
    const sdm_grid *g = &f->target.grid;
    const double voxel = g->spacing[0] * g->spacing[1] * g->spacing[2];
    double volume = 0;
    for (size_t v = 0; v < sdm_grid_count(g); v++)
        if (is_like_outside(&f->opts.appearance, f->target.values[v])) volume += voxel;
    return volume * VOLUME_FACTOR > shape && volume < VOLUME_FACTOR * shape;
}

/* Has nearly the whole border of the image the values of the inside? One value alone there is
 * padding. tell: with a notice, because an image that holds the whole shape rarely has. */
static bool check_border(const cli_fit *f, bool tell)
{
    const sdm_grid *g = &f->target.grid;
    double sum = 0, least = INFINITY, most = -INFINITY;
    size_t n = 0, like = 0, v = 0;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++, v++) {
                const double value = f->target.values[v];
                const bool within = i > 0 && j > 0 && k > 0 && i < g->n[0] - 1 && j < g->n[1] - 1 &&
                                    k < g->n[2] - 1;
                if (within || !isfinite(value)) continue;
                n++, like += is_like_inside(&f->opts.appearance, value);
                sum += value, least = fmin(least, value), most = fmax(most, value);
            }
    if (!n || !(most > least) || (double)like < BORDER_SHARE * (double)n) return false;
    if (!tell) return true;
    cli_notice(
        "%.0f %% of the border of the image (mean %.4g) is nearer to the value of the inside, "
        "%.4g, than to those outside, %.4g%s: are --inside and --outside exchanged?",
        100 * (double)like / (double)n, sum / (double)n, f->opts.appearance.inside[0].mean,
        f->opts.appearance.outside[0].mean, f->opts.appearance.n_outside > 1 ? " and others" : "");
    return true;
}

/* Is hardly any of what is like the inside enclosed by something else, compared with the volume of
 * the shape at the start, mm^3? Around a shape whose values are right lies the outside. */
static bool encloses_nothing(const cli_fit *f, double shape)
{
    const sdm_grid *g = &f->target.grid;
    const double voxel = g->spacing[0] * g->spacing[1] * g->spacing[2];
    const size_t count = sdm_grid_count(g);
    const sdm_fit_appearance *a = &f->opts.appearance;
    unsigned char *mask = NULL; // 1: nearer to the inside than to every tissue outside, or NaN
    size_t n = 0;
    if (SDM_ALLOC(&mask, count, "voxels of the image", NULL)) return false;
    for (size_t v = 0; v < count; v++)
        mask[v] = !(from_outside(a, f->target.values[v]) < from_inside(a, f->target.values[v]));
    const sdm_status s = cli_count_enclosed(g, mask, &n, NULL);
    sdm_free(mask);
    return !s && (double)n * voxel < ENCLOSED_MAX * shape;
}

sdm_status cli_fit_check_contrast(cli_fit *f, sdm_error *err)
{
    const double inside = f->opts.appearance.inside[0].mean,
                 outside = f->opts.appearance.outside[0].mean;
    side_values in = {0}, around = {0};
    sdm_fit_finding why;
    if (f->target.kind != SDM_FIT_IMAGE || f->args->fit.find) return SDM_OK;
    // the fit itself tells what a shape lacks that has no map
    if (measure_start(f, &in, &around, NULL)) return SDM_OK;
    // NaN, of which no comparison holds, where the start lies beside the image
    const double a = in.sum / in.n, b = around.sum / around.n;
    const bool other = fabs(a - outside) < fabs(a - inside) && fabs(b - inside) < fabs(b - outside),
               clear = fabs(a - outside) < CLEARLY * fabs(a - inside) &&
                       fabs(b - inside) < CLEARLY * fabs(b - outside) &&
                       fabs(a - b) > DEVIATIONS * sqrt(variance_of_mean(f, &in) +
                                                       variance_of_mean(f, &around));
    if (!other || !((a - b) / (outside - inside) > CONTRAST_MIN))
        return check_border(f, true), SDM_OK;
    describe_exchange(f, a, b, false, why.text, sizeof why.text);
    const bool alone = check_border(f, false) && outside_is_as_small(f, in.volume) &&
                       encloses_nothing(f, in.volume);
    if (((clear && f->opts.turns == SDM_FIT_TURNS_NONE) || alone) && !f->args->force)
        return sdm_fail(err, SDM_E_QUALITY, "%s: %s; --force fits nevertheless", f->path, why.text);
    // a refused fit is explained by the exchange: no other start mends it
    if (clear || alone) f->opts.max_restarts = 0;
    cli_notice("%s, if the shape lies near the start%s", why.text,
               clear || alone ? "; if the fit is refused, no other start is searched" : "");
    return SDM_OK;
}

sdm_status cli_fit_explain_contrast(cli_fit *f, sdm_error *err)
{
    const double inside = f->opts.appearance.inside[0].mean,
                 outside = f->opts.appearance.outside[0].mean;
    side_values in = {0}, around = {0};
    // --find searches the whole image: there is no start pose to look at
    if (f->target.kind != SDM_FIT_IMAGE || f->doubt.status != SDM_E_QUALITY || f->args->fit.find)
        return SDM_OK;
    sdm_status s = measure_start(f, &in, &around, err);
    if (s || !(in.n > 0) || !(around.n > 0)) return s;
    const double a = in.sum / in.n, b = around.sum / around.n;
    if (!(fabs(b - inside) < fabs(b - outside))) return SDM_OK;
    bool exchanged = (a - b) / (outside - inside) > CONTRAST_MIN, fitted = false;
    // a thin shape that begins beside its place holds as much of both tissues as its surroundings
    if (!exchanged) fitted = has_exchanged(f);
    if (!exchanged && !fitted) s = fit_exchanged(f, &fitted, err);
    if (!s && (exchanged || fitted)) name_exchange(f, a, b, fitted);
    return s;
}
