/* Writes the uses for which a trained model is not accurate enough, one line of text for each. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "judge.h"

/* Of those that hardly change the volume so many are named. */
enum { SMALL_NAMED = 4 };

/* From this error on, over the size of the derivative, its sign may be wrong: the error of a single
   shape is often twice the root mean square. */
static const double SIGN_WRONG = 0.5;

/* Larger errors are not told apart. */
static const double ERROR_MOST = 10;

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
    // the line of the grade tells of more, unless parts are inside out
    if (v->cut > 0 && (v->cut <= SDM_CUT_POOR || v->inside_out > 0))
        add(l, "the %.2g %% of the shapes that the grid cuts", fmin(99, 100 * v->cut));
    if (sdm_verdict_errs_far(v))
        add(l, "distances far from the surface: wrong by up to %.2g mm", v->far_largest_mm);
    if (v->volume_error > SDM_VOLUME_BAD)
        add(l, "volumes of maps: off by %s %%", percent(v->volume_error, text));
    if (sdm_verdict_lacks_part(v))
        add(l,
            "its thinnest part and volumes of surfaces (.stl): it is %.2g mm thick in a few "
            "held-out shapes, too thin for "
            "voxels of %.3g mm, and will be missing or broken; grid.spacing %.2g shows it",
            v->thickness_mm, v->coarse_mm, spacing);
    else if (sdm_verdict_surfaces_off(v) && spacing < v->coarse_mm)
        add(l,
            "volumes of surfaces (.stl): off by %s %%, voxels of %.3g mm cut edges and thin parts; "
            "grid.spacing %.2g keeps more of them",
            percent(v->surface_volume_error, text), v->coarse_mm, spacing);
    else if (sdm_verdict_surfaces_off(v))
        add(l, "volumes of surfaces (.stl): off by %s %%", percent(v->surface_volume_error, text));
}

void sdm_verdict_unfit(const sdm_verdict *v, char text[SDM_MODEL_UNFIT])
{
    unfit_lines l = {.text = text};
    *text = '\0';
    add_parts(v, &l);
    if (v->derivatives_bad[0]) add(&l, "derivatives of maps by %s", v->derivatives_bad);
    if (v->volume_derivatives_bad[0])
        add(&l, "derivatives of the volume by %s", v->volume_derivatives_bad);
    if (v->volume_derivatives_small[0])
        add(&l, "derivatives of the volume by %s", v->volume_derivatives_small);
    if (v->triangles_by[0])
        add(&l,
            "derivatives of exact maps (exact --jacobian, fit --exact or --polish) where the "
            "triangles change with %s: vertices do not correspond there",
            v->triangles_by);
}

/* true: parameter a comes before b in the list. */
static bool is_worse(const double *error, size_t a, size_t b)
{
    return error[a] > error[b] || (error[a] == error[b] && a < b);
}

/* The worst parameter after `last` (n: the first one); n: none. */
static size_t next_worst(const double *error, size_t n, size_t last)
{
    size_t worst = n;
    for (size_t k = 0; k < n; k++)
        if (error[k] > SDM_DERIVATIVE_BAD && (last == n || is_worse(error, last, k)) &&
            (worst == n || is_worse(error, k, worst)))
            worst = k;
    return worst;
}

/* Lists at most `most` parameters within `room` characters; `of` follows the first error. */
static void list(const sdm_param *p, const double *error, size_t n, const char *of, size_t most,
                 size_t room, char *text)
{
    size_t used = 0, named = 0;
    text[0] = '\0';
    for (size_t k = next_worst(error, n, n); k < n; k = next_worst(error, n, k)) {
        char one[160];
        const bool over = error[k] > ERROR_MOST;
        const int length =
            snprintf(one, sizeof one, "%s%.60s: off by %s%.0f %%%s", used ? "; by " : "", p[k].name,
                     over ? "over " : "", 100 * (over ? ERROR_MOST : error[k]), used ? "" : of);
        const bool fits = used + (size_t)length + sizeof "; ..." <= room && named++ < most;
        used += (size_t)snprintf(text + used, room - used, "%s", fits ? one : "; ...");
        if (!fits) return;
    }
}

void trainer_list_derivatives(const sdm_param *p, const double *error, size_t n,
                              char text[SDM_VERDICT_LIST])
{
    list(p, error, n, "", n, SDM_VERDICT_LIST, text);
}

void trainer_list_small(const sdm_param *p, const double *error, size_t n,
                        char text[SDM_VERDICT_LIST])
{
    static const char why[] = ": these parameters hardly change the volume",
                      sign[] = ", and the sign may be wrong";
    const size_t worst = next_worst(error, n, n),
                 room = SDM_VERDICT_LIST - sizeof why - sizeof sign;
    list(p, error, n, " of their own size", SMALL_NAMED, room, text);
    if (worst == n) return;
    const size_t used = strlen(text);
    snprintf(text + used, SDM_VERDICT_LIST - used, "%s%s", why,
             error[worst] < SIGN_WRONG ? "" : sign);
}
