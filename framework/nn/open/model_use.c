/* The uses that a model is good enough for, by the figures that its training measured. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/volume_cause.h"
#include "sdm/model.h"

/* Digits after the point with which 100 * error is seen to exceed 100 * bad. */
static int digits_over(double error, double bad)
{
    int n = error < 0.1;
    while (n < 6 && rint(100 * error * pow(10, n)) <= 100 * bad * pow(10, n)) n++;
    return n;
}

/* The error of derivatives by one parameter, in the words of the training. */
typedef struct worst_param {
    char name[64];    /* "the worst parameter" where it is not known */
    char percent[64]; /* "38 %" or "over 1000 % of their own size" */
} worst_param;

/* A parameter as a line of `unfit` names it first: "NAME: off by 38 % of their own size". */
typedef struct told_param {
    const char *name, *figure;
    int name_length, figure_length;
    bool own_size;
    double percent; /* the figure; of "over 1000" that number */
} told_param;

/* Reads the parameter at the begin of `text`. false: there is none. */
static bool read_told(const char *text, told_param *out)
{
    static const char off[] = ": off by ", own[] = " % of their own size";
    const char *end = strstr(text, off), *figure = end ? end + strlen(off) : NULL,
               *percent = figure ? strstr(figure, " %") : NULL;
    if (!percent || percent > text + strcspn(text, "\n")) return false;
    *out = (told_param){.name = text,
                        .name_length = (int)(end - text),
                        .figure = figure,
                        .figure_length = (int)(percent - figure),
                        .own_size = !strncmp(percent, own, strlen(own))};
    out->percent = strtod(figure + strcspn(figure, "0123456789"), NULL);
    return out->name_length < 64 && out->figure_length < 16;
}

/* The parameter with the largest error of the lines of `unfit` that begin with `begin`, with the
 * error that stands there. Where this is the rounded `error`, it has so many digits that it is seen
 * to exceed `bad`. */
static worst_param find_worst(const char *unfit, const char *begin, double error, double bad)
{
    worst_param worst = {.name = "the worst parameter"};
    told_param told, most = {.percent = -1};
    char rounded[32];
    snprintf(worst.percent, sizeof worst.percent, "%.*f %%", digits_over(error, bad), 100 * error);
    for (const char *at = unfit; begin && (at = strstr(at, begin));) {
        at += strlen(begin);
        if (read_told(at, &told) && told.percent > most.percent) most = told;
    }
    if (!most.name) return worst;
    snprintf(worst.name, sizeof worst.name, "%.*s", most.name_length, most.name);
    snprintf(rounded, sizeof rounded, "%.0f", 100 * error);
    if (most.own_size || strlen(rounded) != (size_t)most.figure_length ||
        strncmp(rounded, most.figure, strlen(rounded)) != 0)
        snprintf(worst.percent, sizeof worst.percent, "%.*s %%%s", most.figure_length, most.figure,
                 most.own_size ? " of their own size" : "");
    return worst;
}

/* The first line of `unfit` that begins with `begin` and tells of errors of a derivative over its
 * own size (own) or does not; NULL: there is none. */
static const char *find_line(const char *unfit, const char *begin, bool own)
{
    static const char size[] = " % of their own size";
    for (const char *at = unfit; *at;) {
        const char *end = at + strcspn(at, "\n"), *found = strstr(at, size);
        if (!strncmp(at, begin, strlen(begin)) && own == (found && found < end)) return at;
        at = end + (*end == '\n');
    }
    return NULL;
}

/* SDM_OK, with the parameters that hardly change the volume in the text of *err: those of the line
 * of `unfit` about errors of their own size. "": there are none. */
static sdm_status tell_small(const char *unfit, const char *begin, sdm_error *err)
{
    const char *line = find_line(unfit, begin, true);
    if (!line) return sdm_fail(err, SDM_OK, "%s", "");
    return sdm_fail(err, SDM_OK, "do not use the %.*s", (int)strcspn(line, "\n"), line);
}

/* text = the other parameters than `named` in the line of `unfit` that begins with `begin` and
 * does not tell of errors of their own size: "; by cup_radius: off by 24 %"; "": there are none. */
static void list_others(const char *unfit, const char *begin, const char *named, char *text,
                        size_t size)
{
    static const char next[] = "; by ";
    const char *line = find_line(unfit, begin, false);
    *text = '\0';
    if (!line) return;
    const char *from = line + strlen(begin), *to = from + strcspn(from, ";\n");
    const bool skip = !strncmp(from, named, strlen(named)) && from[strlen(named)] == ':';
    if (skip) from = to;
    while (!strncmp(to, next, strlen(next))) to += 1 + strcspn(to + 1, ";\n");
    if (to > from) snprintf(text, size, "%s%.*s", skip ? "" : next, (int)(to - from), from);
}

static sdm_status check_grade(const sdm_model_quality *q, sdm_error *err)
{
    if (!q->grade[0]) return sdm_fail(err, SDM_E_UNSUPPORTED, "the model has no grade");
    return strcmp(q->grade, "poor")
               ? SDM_OK
               : sdm_fail(err, SDM_E_QUALITY, "the training graded this model poor");
}

static sdm_status check_distances(const sdm_model_info *m, sdm_error *err)
{
    const double *h = m->grid.spacing, voxel = fmin(h[0], fmin(h[1], h[2])),
                 error = m->quality.far_error_mm;
    if (isnan(error))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "the training did not measure distances far from the surface");
    if (error <= voxel) return SDM_OK;
    return sdm_fail(
        err, SDM_E_QUALITY,
        "distances of its maps farther than %.3g mm from the surface are wrong by up "
        "to %.2g mm; nearer ones have an RMS error of %.2g mm; exact maps have no such error",
        m->accuracy.near_mm, error, m->accuracy.rmse_near_mm);
}

sdm_status sdm_model_check_use(const sdm_model *m, sdm_model_use use, sdm_error *err)
{
    if (!m || (int)use < SDM_USE_SURFACE || use > SDM_USE_SURFACE_VOLUME)
        return sdm_fail(err, SDM_E_ARG, "model: a model and a use of it are needed");
    const sdm_model_info *info = sdm_model_get_info(m);
    const sdm_model_quality *q = &info->quality;
    if (use == SDM_USE_SURFACE) return check_grade(q, err);
    if (use == SDM_USE_DISTANCE) return check_distances(info, err);
    static const char slopes[] = "; sdmgen exact --jacobian gives right ones",
                      // these models have a line about triangles
        few_slopes[] =
            "; sdmgen exact --jacobian gives right ones where the triangles stay the same",
                      volume_slopes[] = "; take differences of volumes of the mesh (exact "
                                        "--measure): those of maps swing as faces cross planes of "
                                        "voxels";
    const bool network = !sdm_voxels_explain_volume(q->surface_volume_error, q->volume_error);
    const struct {
        const char *name;  // of the figure
        const char *lines; // how its lines in `unfit` begin, which name parameters; NULL: none do
        double error, bad;
        const char *remedy;
    } figures[] =
        {[SDM_USE_VOLUME] = {"volumes of its maps", NULL, q->volume_error, SDM_VOLUME_BAD,
                             "; those of exact maps are right"},
         [SDM_USE_SURFACE_VOLUME] = {"volumes inside the surfaces of its maps", NULL,
                                     q->surface_volume_error, SDM_VOLUME_BAD,
                                     network
                                         ? ": the network errs, more than voxels cut off"
                                         : ": they cut edges and thin walls between the voxels"},
         [SDM_USE_DERIVATIVE] = {"derivatives of its maps", "derivatives of maps by ",
                                 q->derivative_error, SDM_DERIVATIVE_BAD,
                                 strstr(q->unfit, "triangles change with ") ? few_slopes : slopes},
         [SDM_USE_VOLUME_DERIVATIVE] = {"derivatives of volumes of its maps",
                                        "derivatives of the volume by ", q->volume_derivative_error,
                                        SDM_DERIVATIVE_BAD, volume_slopes}},
      *f = &figures[use];
    if (isnan(f->error))
        return sdm_fail(err, SDM_E_UNSUPPORTED, "the training did not measure the errors of %s",
                        f->name);
    if (f->error <= f->bad && use == SDM_USE_VOLUME_DERIVATIVE)
        return tell_small(q->unfit, f->lines, err);
    if (f->error <= f->bad) return SDM_OK;
    const worst_param worst = find_worst(q->unfit, f->lines, f->error, f->bad);
    char others[300] = "";
    if (f->lines) list_others(q->unfit, f->lines, worst.name, others, sizeof others);
    return sdm_fail(err, SDM_E_QUALITY, "%s are off by %s%s%s, more than %g %%%s%s", f->name,
                    worst.percent, f->lines ? " for " : "", f->lines ? worst.name : "",
                    100 * f->bad, others, f->remedy);
}
