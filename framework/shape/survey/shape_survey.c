/* Surveys a family of shapes: what takes little time first, then what takes longer. */
#include "sdm/internal/shape_survey.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/clock.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "survey_scale.h"
#include "survey_state.h"
#include "survey_still.h"

enum { FACE_SAMPLES = 8, BOX_SAMPLES = 64 };

/* Chooses the shapes. */
static sdm_status choose(shape_family *f, const sdm_survey_opts *opts, sdm_shape_survey *s,
                         sdm_error *err)
{
    const size_t n = f->shape->n_params;
    if (opts->brief && f->n_corners > opts->samples) {
        f->n_corners = opts->samples;
        f->all_corners = false;
    }
    s->n_params = n;
    s->n_samples = opts->samples;
    s->n_corners = f->n_corners;
    s->n = 1 + s->n_corners + s->n_samples;
    // with room behind, which a mesh() that expects more parameters reads
    const sdm_status status =
        SDM_ALLOC(&s->p, s->n * n + SHAPE_PARAMS_MAX, "parameters of shapes", err);
    if (status) return status;
    for (size_t i = 0; i < n; i++)
        s->p[i] = fmin(fmax(f->shape->params[i].def, f->min[i]), f->max[i]);
    for (size_t k = 0; k < s->n_corners; k++) sdm_family_corner(f, k, s->p + (1 + k) * n);
    for (size_t k = 0; k < s->n_samples; k++)
        sdm_family_sample(f, k, s->p + (1 + s->n_corners + k) * n);
    return SDM_OK;
}

/* Widens the box by the search of sdm_shape_box(). */
static sdm_status widen_box(survey *v, sdm_error *err)
{
    double low[3], high[3];
    sdm_shape_survey *s = v->out;
    if (s->failed.shapes) return SDM_OK;
    const sdm_status status = sdm_shape_box(v->family.shape, v->opts->range,
                                            s->n_samples < BOX_SAMPLES ? s->n_samples : BOX_SAMPLES,
                                            v->opts->seed, low, high, err);
    for (int a = 0; a < 3 && !status; a++) {
        s->low[a] = fmin(s->low[a], low[a]);
        s->high[a] = fmax(s->high[a], high[a]);
    }
    return status == SDM_E_PLUGIN ? SDM_OK : status;
}

/* Makes some of the meshes again, here and in another process. */
static sdm_status repeat(const survey *v, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    const sdm_instance *shape = v->family.shape;
    const sdm_repeat_process *process = &v->opts->process;
    const sdm_status status = sdm_repeat_find(shape, s->p, s->n, v->opts->brief, &s->repeat, err);
    // threads may keep different meshes, which a process of its own would not mend
    const bool open = !s->repeat.unlike || s->repeat.cause == SDM_REPEAT_THREADS;
    if (status || !open || !process->plugin) return status;
    sdm_repeat there;
    if (!sdm_repeat_in_process(shape, process, s->p, s->n, &there, &s->process_untested) &&
        there.unlike)
        s->repeat = there;
    return SDM_OK;
}

/* What takes longer: unions, lines through the ranges, the largest box, surfaces that stay. */
static sdm_status look_closer(survey *v, int n_threads, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    survey_stop stop;
    survey_stop_set(&stop, v, 1, 0);
    sdm_status status = survey_unions(v, n_threads, err);
    if (!status) status = survey_follow(v, n_threads, err);
    if (!status && !survey_is_late(v, 1)) status = sdm_survey_find_mixed(&v->family, s, err);
    s->box_untested = survey_is_late(v, 1);
    if (!status && !s->box_untested) status = widen_box(v, err);
    if (status || s->failed.shapes || s->open.shapes || s->inside_out.shapes) return status;
    s->still_untested = survey_is_late(v, 1);
    if (s->still_untested) return SDM_OK;
    status = sdm_survey_find_still(&v->family, &stop.opts, v->size, s, err);
    if (status != SDM_E_CANCELLED) return status;
    sdm_free(s->still);
    s->still = NULL;
    s->still_untested = true;
    return SDM_OK;
}

bool sdm_survey_mend_first(const sdm_shape_survey *s)
{
    const sdm_repeat_cause cause = s->repeat.cause;
    // on one thread the meshes are the same; a vertex that is not set is told with `failed`
    const bool usable =
        cause == SDM_REPEAT_THREADS || (cause == SDM_REPEAT_UNSET && s->failed.shapes);
    return (s->repeat.unlike && !usable) || s->unused.shapes || s->scale.swings;
}

/* Tells that a stage is done. Does another one follow? */
static bool goes_on(const survey *v, sdm_survey_stage stage)
{
    const sdm_shape_survey *s = v->out;
    if (v->opts->known) v->opts->known(v->opts->user, stage);
    return s->failed.shapes < s->n - s->untested &&
           !(v->opts->mend_first && sdm_survey_mend_first(s));
}

sdm_status sdm_shape_survey_make(const sdm_instance *shape, const sdm_survey_opts *opts,
                                 sdm_shape_survey *out, sdm_error *err)
{
    if (!shape || !out)
        return sdm_fail(err, SDM_E_ARG, "survey without a shape or a place for the result");
    static const sdm_survey_opts none = {0};
    if (!opts) opts = &none;
    *out = (sdm_shape_survey){0};
    out->grid_fitted = opts->grid_fitted;
    survey v = {.opts = opts, .out = out, .start = sdm_clock()};
    int n_threads = sdm_threads(opts->n_threads);
    sdm_status s = opts->grid ? sdm_grid_check(opts->grid, err) : SDM_OK;
    if (!s) s = sdm_family_set(&v.family, shape, opts->range, opts->distribution, opts->seed, err);
    if (!s) s = choose(&v.family, opts, out, err);
    if (!s) s = SDM_ALLOC(&v.found, out->n, "findings of a survey", err);
    if (!s) s = repeat(&v, err);
    // further findings are to be those of the shape
    if (out->repeat.cause == SDM_REPEAT_THREADS) n_threads = 1;
    if (!s) s = survey_meshes(&v, n_threads, err);
    if (!s) s = sdm_survey_measure_scale(&v.family, out, err);
    if (!s) s = sdm_survey_find_units(&v.family, out, err);
    bool more = !s && goes_on(&v, SDM_SURVEY_MESHES);
    if (more) s = survey_parts(&v, n_threads, err);
    more = more && !s && goes_on(&v, SDM_SURVEY_PARTS);
    if (more && !opts->brief) s = look_closer(&v, n_threads, err);
    if (!s && opts->grid)
        out->surplus = sdm_grid_surplus(opts->grid, out->low, out->high, out->surplus_along);
    if (more && !s && opts->grid && !opts->brief && !out->failed.shapes && !out->untested)
        s = sdm_grid_family_hits(shape, opts->range, FACE_SAMPLES, opts->seed, opts->grid,
                                 &out->hits, err);
    out->cancelled = opts->cancelled && opts->cancelled(opts->user);
    sdm_free(v.found);
    sdm_free(v.fold);
    sdm_free(v.fold_late);
    sdm_free(v.line);
    sdm_free(v.unlike);
    if (s) sdm_shape_survey_dispose(out);
    return s;
}

void sdm_shape_survey_dispose(sdm_shape_survey *s)
{
    sdm_free(s->p);
    sdm_free(s->jump);
    sdm_free(s->speed);
    sdm_free(s->unit);
    sdm_free(s->still);
    *s = (sdm_shape_survey){0};
}

size_t sdm_survey_samples(const sdm_instance *shape, size_t samples)
{
    const size_t triangles = 400000; // of all meshes: about a second
    double p[SHAPE_PARAMS_MAX];
    sdm_mesh mesh = {0};
    for (size_t i = 0; i < shape->n_params; i++) p[i] = shape->params[i].def;
    size_t n = samples;
    if (!sdm_instance_mesh(shape, p, &mesh, NULL) && mesh.n_tri * n > triangles)
        n = triangles / mesh.n_tri;
    sdm_mesh_dispose(&mesh);
    return n < 8 ? 8 : n;
}

bool sdm_survey_has_twins(const sdm_shape_survey *s)
{
    return s->duplicate.amount > 0.1 * (double)s->n_tri;
}

sdm_status sdm_shape_survey_verdict(const sdm_shape_survey *s)
{
    if (s->failed.shapes || s->open.shapes) return SDM_E_MESH;
    bool bad = s->unused.shapes || s->inside_out.shapes || s->crossing.shapes ||
               sdm_survey_winds_wrongly(s) || s->folded.shapes || s->turned.shapes ||
               s->resized.shapes || s->rewired.shapes || s->cut.shapes ||
               (s->thin.shapes && !s->grid_fitted) || s->flat.shapes || s->tiny.shapes ||
               s->narrow || s->repeat.unlike || s->surplus > SDM_SURVEY_SURPLUS_MAX ||
               s->velocity_error > SDM_SURVEY_VELOCITY_LIMIT || s->scale.odd_size ||
               s->scale.odd_speed || s->scale.odd_angle || s->scale.other_length || s->scale.swings;
    for (size_t k = 0; k < s->n_params && s->jump; k++)
        bad = bad || s->jump[k].kind != SDM_BREAK_NONE;
    for (size_t k = 0; k < s->n_params && s->still; k++) bad = bad || s->still[k];
    bad = bad || s->slow || sdm_survey_has_twins(s);
    return bad ? SDM_E_QUALITY : SDM_OK;
}
