/* Duct: a cochlea whose cross-section is free: a circle, an ellipse or two lobes (scala tympani and
 * scala vestibuli) that change along the turns, with a hook and a cap of any length at the base and
 * a tapering apex. At its defaults it is the cochlea of cochlea.c, of which it has the four
 * published parameters and the rings of vertices. A RECONSTRUCTION like that one: the form of the
 * terms below is chosen, not published.
 *
 *     r = a exp(-b theta) + hook u
 *     z = c theta + alpha exp(-0.3 theta) cos(theta - phi) + 4 dome f (1 - f) + dip u
 *
 * with f = theta / (apical angle) and u = (1 - theta / (pi/2))^3 in the first quarter of a turn, 0
 * beyond. The section is normal to the centreline. With x outward
 * and horizontal and y upward, and turned by the tilt from x to y, its outline is
 *
 *     x = W cos(v) (1 - waist cos(v)^2) (1 + egg sin(v))      y = H sin(v)
 *
 * where 2 W, 2 H and the tilt are parabolas of f through their values at the base, in the middle
 * and at the apex; flare exp(-theta / 0.35) is added to W and H. Where such a sum g is below g0 =
 * 0.1 mm, the half axis is g0 exp(g / g0 - 1), which is positive. Over the last half turn both
 * shrink to the share `tip`. The area is pi W H (1 - 3/4 waist); above a waist of 1/3 the outline
 * has two lobes. The basal end is slanted: a point of a section at (x, y) lies u (slant_out x +
 * slant_up y) further along the centreline. Half-ellipsoids over the end sections close the tube;
 * they are as long as the geometric mean of W and H, at the base times `cap`.
 *
 * With the option `detail` exp(-0.3 theta) (surge cos(theta) + sway sin(theta)) is added to z,
 * flare_high exp(-theta / 0.35) to H, and twist u^(2/3) to the tilt; from a detail of 2 on the
 * outline is multiplied by
 *
 *     exp(size + outer cos(v) + upper sin(v) + oval cos(2 v) + oblique sin(2 v))
 *
 * where each of the five is a cubic spline of f with `detail` control values. Then the area is no
 * longer the above.
 *
 * Sections are cut off at the centre of curvature as those of the cochlea. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cochlea_measure.h"
#include "cochlea_ring.h"
#include "duct_curve.h"
#include "lathe.h"
#include "sdm/shape.h"

/* UNKNOWN(index, name, unit, smallest, largest, default, meaning) of all that can be fixed; in the
 * order of duct_curve.h. */
#define FIXABLE(UNKNOWN)                                                                           \
    UNKNOWN(DUCT_C, "c", "mm/rad", 0.14, 0.30, 0.20, "rise of the centreline")                     \
    UNKNOWN(DUCT_THETA, "theta", "rad", 12.3, 16.7, 14.5, "angle of the apical end")               \
    UNKNOWN(DUCT_DOME, "dome", "mm", -0.6, 1.0, 0.0,                                               \
            "how far the middle of the centreline lies above an even rise")                        \
    UNKNOWN(DUCT_HOOK, "hook", "mm", -0.8, 1.8, 0.0,                                               \
            "how far the basal end lies outside of the spiral")                                    \
    UNKNOWN(DUCT_DIP, "dip", "mm", -1.0, 1.0, 0.0, "how far the basal end lies above the spiral")  \
    UNKNOWN(DUCT_WIDTH_BASE, "width_base", "mm", 1.4, 3.4, 2.22,                                   \
            "width of the section at the base, without the flare")                                 \
    UNKNOWN(DUCT_WIDTH_MIDDLE, "width_middle", "mm", 1.2, 2.6, 1.93,                               \
            "width of the section half-way along the angle")                                       \
    UNKNOWN(DUCT_WIDTH_APEX, "width_apex", "mm", 0.8, 3.0, 1.64,                                   \
            "width of the section at the apex, without the taper")                                 \
    UNKNOWN(DUCT_FLARE, "flare", "mm", -0.3, 0.5, 0.25,                                            \
            "growth of the half axes at the basal end, which decays by e in 0.35 rad")             \
    UNKNOWN(DUCT_CAP, "cap", "", 0.3, 2.5, 1.0,                                                    \
            "length of the basal cap over the mean radius of its section")                         \
    UNKNOWN(DUCT_TIP, "tip", "", 0.4, 1.4, 1.0,                                                    \
            "share of its size that the section keeps at the apical end; taper of half a turn")    \
    UNKNOWN(DUCT_HEIGHT_BASE, "height_base", "mm", 1.2, 3.0, 2.22,                                 \
            "height of the section at the base, without the flare")                                \
    UNKNOWN(DUCT_HEIGHT_MIDDLE, "height_middle", "mm", 1.0, 2.6, 1.93,                             \
            "height of the section half-way along the angle")                                      \
    UNKNOWN(DUCT_HEIGHT_APEX, "height_apex", "mm", 0.6, 2.4, 1.64,                                 \
            "height of the section at the apex, without the taper")                                \
    UNKNOWN(DUCT_TILT_BASE, "tilt_base", "rad", -0.8, 1.5, 0.0,                                    \
            "turn of the section's width from outward to upward at the base")                      \
    UNKNOWN(DUCT_TILT_MIDDLE, "tilt_middle", "rad", -0.8, 0.8, 0.0, "the same half-way")           \
    UNKNOWN(DUCT_TILT_APEX, "tilt_apex", "rad", -0.8, 0.8, 0.0, "the same at the apex")            \
    UNKNOWN(DUCT_WAIST, "waist", "", -0.2, 0.5, 0.0,                                               \
            "how much narrower the section is at half its height; above 1/3 it has two lobes")     \
    UNKNOWN(DUCT_EGG, "egg", "", -0.4, 0.4, 0.0,                                                   \
            "how much wider its upper part is, and narrower its lower part")                       \
    UNKNOWN(DUCT_SLANT_OUT, "slant_out", "", -1.2, 1.2, 0.0,                                       \
            "slope of the basal end face: how far its outer side lies back from its inner side")   \
    UNKNOWN(DUCT_SLANT_UP, "slant_up", "", -1.2, 1.2, 0.0,                                         \
            "the same for its upper side and its lower side")

#define PARAM(index, name, unit, min, max, def, help) [index] = {name, unit, min, max, def, help},
static const sdm_param PARAMS[DUCT_UNKNOWNS] = {
    PARAM(DUCT_A, "a", "mm", 2.0, 5.0, 4.4,
          "scale of the radial component: radius of the spiral at theta = 0")
        PARAM(DUCT_ALPHA, "alpha", "mm", 0.0, 1.2, 0.5,
              "amplitude of the longitudinal wave of the basal turn")
            PARAM(DUCT_B, "b", "", 0.05, 0.25, 0.145, "decay of the spiral per radian")
                PARAM(DUCT_PHI, "phi", "rad", -LATHE_PI / 4, LATHE_PI / 4, 0.4,
                      "phase of the longitudinal wave") FIXABLE(PARAM)};

enum {
    EDGE,
    EAR,
    SECTION,
    FREE,
    DETAIL,
    CONSTANTS,
    N_OPTIONS = CONSTANTS + DUCT_UNKNOWNS - DUCT_C
};
enum { FREE_ALL, FREE_PAPER, FREE_CENTRELINE, FREE_SECTION };

#define OPTION(index, name, unit, min, max, def, help)                                             \
    [CONSTANTS + index - DUCT_C] = {name, SDM_OPTION_REAL, unit, min, max, def, NULL, help},
static const sdm_option OPTIONS[N_OPTIONS] = {
    [EDGE] = {"edge", SDM_OPTION_REAL, "mm", 0.05, 1.0, 0.30, NULL,
              "mean edge length the mesh aims at, over the parameter ranges"},
    [EAR] = {"ear", SDM_OPTION_CHOICE, "", 0, 0, 0, "right|left", "left is the mirror image in y"},
    [SECTION] =
        {"section", SDM_OPTION_CHOICE, "", 0, 0, 0, "ellipse|circle|lobes",
         "ellipse: widths, heights and tilts; circle: widths are diameters; lobes: ellipses with a "
         "waist and an egg, and a slanted basal end"},
    [FREE] = {"free", SDM_OPTION_CHOICE, "", 0, 0, 0, "all|paper|centreline|section",
              "which parameters there are: all, the four published ones, or these and those of "
              "the centreline (c .. dip) or of the section (width_base ..); the others are "
              "constants, and the options of their names are their values"},
    [DETAIL] = {"detail", SDM_OPTION_INT, "", 0, DUCT_VALUES_MAX, 0, NULL,
                "further parameters, for fits to labels: 1: surge, sway, flare_high, twist; 2 to "
                "7: also so many values along the turns for each of five ways in which the outline "
                "grows (size_1 .. oblique_7)"},
    FIXABLE(OPTION)};

static const sdm_param DETAILS[] = {
    {"surge", "mm", -1.2, 1.2, 0.0, "amplitude of a second longitudinal wave: of its cosine"},
    {"sway", "mm", -1.2, 1.2, 0.0, "the same of its sine"},
    {"flare_high", "mm", -0.4, 0.6, 0.0, "how much more the height flares than the width"},
    {"twist", "rad", -1.2, 1.5, 0.0,
     "further tilt of the basal end, which fades in a quarter turn"},
};

/* Name and help of the control values of each harmonic. Their range is wide; their distribution is
 * normal with this deviation. */
#define GROWTH_LIMIT 0.35
#define GROWTH_DEVIATION 0.1
static const struct harmonic {
    const char *name, *help;
} HARMONICS[DUCT_HARMONICS] = {
    [DUCT_GROWTH_SIZE] = {"size", "growth of the outline (logarithm)"},
    [DUCT_GROWTH_OUTER] = {"outer", "growth outward along the width; the inner side shrinks"},
    [DUCT_GROWTH_UPPER] = {"upper", "growth upward along the height; the lower side shrinks"},
    [DUCT_GROWTH_OVAL] = {"oval", "growth along the width; the height shrinks"},
    [DUCT_GROWTH_OBLIQUE] = {"oblique", "growth up and outward, and down and inward; the other two "
                                        "corners shrink"}};

typedef struct duct {
    duct_form form;
    bool left;
    size_t n_values;
    sdm_param params[DUCT_ALL];
    char names[DUCT_ALL - DUCT_VALUES][32]; /* of the control values, which come last */
    size_t unknown[DUCT_ALL]; /* [n_params] index of each parameter among the unknowns */
    uint32_t n_params;
    double constant[DUCT_ALL]; /* values of the unknowns that are not parameters */
    cochlea_rings rings;
} duct;

static bool is_of_form(duct_form form, int unknown)
{
    if (unknown >= DUCT_WAIST) return form == DUCT_LOBES;
    return unknown < DUCT_HEIGHT_BASE || form != DUCT_CIRCLE;
}

static bool is_free(int free, int unknown)
{
    if (unknown < DUCT_C || free == FREE_ALL) return true;
    return free == (unknown < DUCT_WIDTH_BASE ? FREE_CENTRELINE : FREE_SECTION);
}

static void param_add(duct *d, size_t unknown, sdm_param param)
{
    d->unknown[d->n_params] = unknown;
    d->params[d->n_params++] = param;
}

static void params_choose(duct *d, const sdm_option_value *o)
{
    for (int k = 0; k < DUCT_UNKNOWNS; k++) {
        d->constant[k] = k < DUCT_C ? PARAMS[k].def : o[CONSTANTS + k - DUCT_C].number;
        if (!is_of_form(d->form, k) || !is_free((int)o[FREE].number, k)) continue;
        param_add(d, (size_t)k, PARAMS[k]);
        d->params[d->n_params - 1].def = d->constant[k];
    }
}

static void details_add(duct *d, int detail)
{
    if (detail == 0) return;
    for (size_t k = DUCT_SURGE; k < DUCT_VALUES; k++)
        if (k <= DUCT_SWAY || d->form != DUCT_CIRCLE) param_add(d, k, DETAILS[k - DUCT_SURGE]);
    if (detail == 1) return; // widths, heights and tilts do the same as one value
    d->n_values = (size_t)detail;
    for (size_t i = 0; i < DUCT_HARMONICS * d->n_values; i++) {
        const struct harmonic *h = &HARMONICS[i / d->n_values];
        snprintf(d->names[i], sizeof d->names[i], "%s_%zu", h->name, i % d->n_values + 1);
        param_add(d, DUCT_VALUES + i,
                  (sdm_param){d->names[i], "", -GROWTH_LIMIT, GROWTH_LIMIT, 0, h->help});
    }
}

/* The rings lie as those of a cochlea with the same centreline and its usual tube. */
static int rings_make(duct *d, double edge)
{
    const cochlea_model m = {
        .radius = 1.11, .taper = 0.02, .flare = 0.25, .flare_angle = DUCT_FLARE_ANGLE};
    const double *x = d->constant,
                 usual[COCHLEA_UNKNOWNS] = {
                     [COCHLEA_A] = x[DUCT_A],        [COCHLEA_ALPHA] = x[DUCT_ALPHA],
                     [COCHLEA_B] = x[DUCT_B],        [COCHLEA_PHI] = x[DUCT_PHI],
                     [COCHLEA_C] = x[DUCT_C],        [COCHLEA_KAPPA] = DUCT_KAPPA,
                     [COCHLEA_THETA] = x[DUCT_THETA]};
    return sdm_cochlea_rings_make(&m, usual, edge, &d->rings);
}

static int duct_create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    duct *d = calloc(1, sizeof *d);
    if (!d) return host->fail(host, "out of memory");
    d->form = (duct_form)options[SECTION].number;
    d->left = options[EAR].number > 0;
    params_choose(d, options);
    details_add(d, (int)options[DETAIL].number);
    if (rings_make(d, options[EDGE].number)) {
        free(d);
        return host->fail(host, "out of memory");
    }
    *self = d;
    return 0;
}

static void duct_destroy(void *self)
{
    duct *d = self;
    sdm_cochlea_rings_free(&d->rings);
    free(d);
}

static void duct_describe(const void *self, const sdm_param **params, uint32_t *n_params)
{
    const duct *d = self;
    *params = d->params;
    *n_params = d->n_params;
}

static void duct_distributions(const void *self, sdm_distribution *out)
{
    const duct *d = self;
    for (uint32_t i = 0; i < d->n_params; i++)
        if (d->unknown[i] >= DUCT_VALUES)
            out[i] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0, GROWTH_DEVIATION};
}

/* x[DUCT_ALL] = the unknowns of the parameters p[n_params]. */
static void unknowns_at(const duct *d, const double *p, double *x)
{
    memcpy(x, d->constant, sizeof d->constant);
    for (size_t i = 0; i < d->n_params; i++) x[d->unknown[i]] = p[i];
}

/* Moves a vertex of a section in front of the centre of curvature. */
static void vertex_cut(const duct_section *s, double at[2])
{
    const dual bend[2] = {sdm_dual_of(s->bend[0]), sdm_dual_of(s->bend[1])};
    dual x = sdm_dual_of(at[0]), y = sdm_dual_of(at[1]);
    sdm_cochlea_cut(bend, &x, &y);
    at[0] = x.v, at[1] = y.v;
}

/* Writes the n vertices of a ring. direction[n][2]: cosine and sine of their angles. Returns the
 * address after the last one. */
static double *ring_write(const duct *d, const double *x, const cochlea_ring *r, size_t n,
                          const double *direction, double *vert)
{
    duct_section s;
    sdm_duct_section_at(d->form, d->n_values, x, r->fraction, &s);
    const double ahead = r->ahead * sdm_duct_mean_radius(&s) * (r->ahead < 0 ? x[DUCT_CAP] : 1);
    double slant[2]; // per mm along e1 and e2
    sdm_duct_slant_at(x, r->fraction, slant);
    for (size_t j = 0; j < n; j++, vert += 3) {
        double at[2];
        sdm_duct_outline_at(&s, direction[2 * j], direction[2 * j + 1], at);
        if (!r->whole && at[0] * s.bend[0] + at[1] * s.bend[1] > COCHLEA_CUT_FROM)
            vertex_cut(&s, at);
        const double along = ahead + r->shrink * (at[0] * slant[0] + at[1] * slant[1]);
        for (int k = 0; k < 3; k++)
            vert[k] = s.centre[k] + along * s.tangent[k] +
                      r->shrink * (at[0] * s.e1[k] + at[1] * s.e2[k]);
        if (d->left) vert[1] = -vert[1];
    }
    return vert;
}

static int duct_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)options;
    const duct *d = self;
    const cochlea_ring base = {.fraction = 0, .ahead = -1, .whole = true},
                       apex = {.fraction = 1, .ahead = 1, .whole = true};
    const double none[2] = {0, 0};
    const size_t n = d->rings.n_sectors;
    const int failed =
        host->reserve(host, out, sdm_lathe_n_vert(d->rings.n, n), sdm_lathe_n_tri(d->rings.n, n));
    if (failed) return failed;
    double x[DUCT_ALL];
    unknowns_at(d, p, x);
    double *vert = ring_write(d, x, &base, 1, none, out->vert);
    for (size_t i = 0; i < d->rings.n; i++)
        vert = ring_write(d, x, &d->rings.at[i], n, d->rings.direction + (i % 2 ? 2 * n : 0), vert);
    ring_write(d, x, &apex, 1, none, vert);
    sdm_lathe_triangles(d->rings.n, n, d->left, out->tri);
    return 0;
}

/* The owner of the path that is measured. */
typedef struct measured {
    duct_form form;
    size_t n_values;
    const double *x;
} measured;

static void centre_at(const void *owner, double fraction, double out[3])
{
    const measured *o = owner;
    duct_section s;
    sdm_duct_section_at(o->form, o->n_values, o->x, fraction, &s);
    memcpy(out, s.centre, sizeof s.centre);
}

/* The section reaches farthest along e1 there. */
static void wall_at(const void *owner, double fraction, double out[3])
{
    const measured *o = owner;
    duct_section s;
    sdm_duct_section_at(o->form, o->n_values, o->x, fraction, &s);
    const double outward[2] = {1, 0}, reach = sdm_duct_reach(&s, outward);
    for (int k = 0; k < 3; k++) out[k] = s.centre[k] + reach * s.e1[k];
}

static double height_at(const void *owner, double fraction, double up, int end)
{
    const measured *o = owner;
    duct_section s;
    sdm_duct_section_at(o->form, o->n_values, o->x, fraction, &s);
    double slant[2];
    sdm_duct_slant_at(o->x, fraction, slant);
    // the heights of a mm along e1, which is horizontal, and along e2
    const double upward[2] = {up * slant[0] * s.tangent[2],
                              up * (s.e2[2] + slant[1] * s.tangent[2])};
    const double across = sdm_duct_reach(&s, upward),
                 length = sdm_duct_mean_radius(&s) * (end < 0 ? o->x[DUCT_CAP] : 1),
                 along = up * end * length * s.tangent[2];
    return up * s.centre[2] + (along > 0 ? hypot(across, along) : across);
}

static int duct_measure(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, uint32_t index, double depth, double *value)
{
    (void)host, (void)options;
    const duct *d = self;
    double x[DUCT_ALL];
    unknowns_at(d, p, x);
    const measured owner = {d->form, d->n_values, x};
    const cochlea_path path = {&owner, x[DUCT_THETA], centre_at, wall_at, height_at};
    *value = sdm_cochlea_path_measure(&path, index, depth);
    return 0;
}

/* The basal section: the duct opens into the vestibule there. A slant of the end face does not turn
 * the plane, so that a fit cannot turn it away from what the shape does not explain. The radius is
 * a smooth bound of the half axes of the section and the length of the cap. */
static int duct_open_end(const void *self, const sdm_host *host, const sdm_option_value *options,
                         const double *p, sdm_open_end *out)
{
    (void)host, (void)options;
    const duct *d = self;
    double x[DUCT_ALL];
    duct_section s;
    unknowns_at(d, p, x);
    sdm_duct_section_at(d->form, d->n_values, x, 0, &s);
    for (int k = 0; k < 3; k++) out->centre[k] = s.centre[k], out->outward[k] = -s.tangent[k];
    if (d->left) out->centre[1] = -out->centre[1], out->outward[1] = -out->outward[1];
    const double cap = x[DUCT_CAP] * sdm_duct_mean_radius(&s);
    out->radius = pow(pow(s.wide, 4) + pow(s.high, 4) + pow(cap, 4), 0.25);
    return 0;
}

const sdm_shape sdm_shape_duct = {
    .abi = SDM_SHAPE_ABI,
    .size = sizeof(sdm_shape),
    .name = "duct",
    .summary = "human cochlea with a free cross-section: circle, ellipse or two lobes, hook and "
               "tapering apex (a reconstruction)",
    .params = PARAMS,
    .n_params = DUCT_WAIST,
    .options = OPTIONS,
    .n_options = N_OPTIONS,
    .create = duct_create,
    .destroy = duct_destroy,
    .describe = duct_describe,
    .mesh = duct_mesh,
    .distributions = duct_distributions,
    .mirror = "ear",
    .measures = sdm_cochlea_measures,
    .n_measures = COCHLEA_MEASURES,
    .measure = duct_measure,
    .open_end = duct_open_end,
};
