/* Finds where a part of a shape turns inside out, by meshes between a shape in which it is right
 * and one in which it is not. */
#include "part_turns.h"

#include <math.h>
#include <string.h>

#include "report/report_audit.h"
#include "sdm/internal/config.h"

/* Shapes that are looked through for one in which the part is right; halvings of a range; steps to
 * the end of a range. */
enum { TRIED = 64, HALVINGS = 16, STEPS = 32 };

/* A volume that goes through 0 is smaller than this share of itself after the halvings. */
#define SMALL 0.01

/* The shapes on the line from one in which the part is inside out (at 0) to another one (at 1). */
typedef struct line {
    const sdm_instance *shape;
    size_t n_params, n_parts, part;
    const double *wrong, *right; /* [n_params] */
    size_t only; /* the parameter that changes along the line; n_params: all of them */
} line;

/* The volume of the part at `at`, and the mesh in *mesh, which the caller disposes of. NaN: the
 * mesh has not as many parts, or there is none. */
static double measure(const line *l, double at, sdm_mesh *mesh)
{
    const sdm_param *params = sdm_instance_params(l->shape, NULL);
    double p[SDM_MAX_PARAMS], volume = NAN;
    sdm_part_audit audit = {0};
    for (size_t k = 0; k < l->n_params; k++) {
        const bool moves = l->only == l->n_params || l->only == k;
        p[k] = l->wrong[k] + (moves ? at * (l->right[k] - l->wrong[k]) : 0);
        // rounding may lead beyond
        p[k] = fmin(fmax(p[k], params[k].min), params[k].max);
    }
    if (!sdm_instance_mesh(l->shape, p, mesh, NULL) &&
        !sdm_part_audit_make(mesh, 0, NULL, &audit, NULL) && audit.n == l->n_parts)
        volume = audit.part[l->part].volume;
    sdm_part_audit_dispose(&audit);
    return volume;
}

static bool is_right(const line *l, double at)
{
    sdm_mesh mesh = {0};
    const double volume = measure(l, at, &mesh);
    sdm_mesh_dispose(&mesh);
    return volume > 0;
}

/* Narrows down where the part turns over, between a place where it is not right and one where it
 * is. */
static void halve(const line *l, double *bad, double *good)
{
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (*bad + *good);
        *(is_right(l, middle) ? good : bad) = middle;
    }
}

/* Why the part turns over between two places that lie close together. */
static cli_turn_cause find_cause(const line *l, double bad, double good)
{
    sdm_mesh here = {0}, there = {0}, whole = {0};
    const double a = fabs(measure(l, bad, &here)), b = fabs(measure(l, good, &there)),
                 all = fabs(measure(l, 0, &whole));
    const bool same = here.tri && there.tri && here.n_tri == there.n_tri &&
                      !memcmp(here.tri, there.tri, 3 * here.n_tri * sizeof *here.tri);
    sdm_mesh_dispose(&here);
    sdm_mesh_dispose(&there);
    sdm_mesh_dispose(&whole);
    if (a + b <= SMALL * all) return CLI_TURN_LENGTH;
    return same ? CLI_TURN_VERTICES : CLI_TURN_ORDER;
}

/* The value of parameter k at which the part turns back beyond `bad`, away from `good`; NaN: none
 * was found up to the end of the surveyed range. */
static double find_back(const line *l, const sdm_shape_survey *f, double bad, double good)
{
    const size_t k = l->only;
    const double from = l->wrong[k], across = l->right[k] - from;
    double end = bad;
    for (size_t i = 0; i < f->n; i++) {
        const double at = (f->p[i * f->n_params + k] - from) / across;
        end = bad < good ? fmin(end, at) : fmax(end, at);
    }
    double before = bad;
    for (int i = 1; i <= STEPS; i++) {
        double at = bad + (end - bad) * i / STEPS;
        if (is_right(l, at)) {
            halve(l, &before, &at);
            return from + 0.5 * (before + at) * across;
        }
        before = at;
    }
    return NAN;
}

/* Sets out->param: the first one that makes the part right by itself. */
static void find_param(line *l, cli_part_turn *out)
{
    for (l->only = 0; l->only < l->n_params; l->only++)
        if (l->right[l->only] != l->wrong[l->only] && is_right(l, 1)) break;
    out->param = l->only;
}

bool cli_find_part_turn(const sdm_instance *shape, const sdm_shape_survey *found, size_t wrong,
                        const sdm_part_audit *audit, cli_part_turn *out)
{
    const size_t n = found->n_params, most = found->n < TRIED ? found->n : TRIED;
    *out = (cli_part_turn){.param = n, .back = NAN};
    while (out->part < audit->n && !cli_part_inside_out(audit, out->part)) out->part++;
    if (out->part == audit->n || n > SDM_MAX_PARAMS) return false;
    line l = {shape, n, audit->n, out->part, found->p + wrong * n, found->p, n};
    while (out->right < most && !is_right(&l, 1)) l.right = found->p + ++out->right * n;
    if (out->right == most) return false;
    find_param(&l, out);
    double bad = 0, good = 1;
    halve(&l, &bad, &good);
    out->cause = find_cause(&l, bad, good);
    if (out->param == n) return true;
    const double from = l.wrong[out->param], across = l.right[out->param] - from;
    out->value = from + 0.5 * (bad + good) * across;
    out->above = across < 0;
    out->back = find_back(&l, found, bad, good);
    return true;
}
