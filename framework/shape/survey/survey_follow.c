/* What changes along lines through the ranges of the parameters. */
#include <math.h>
#include <string.h>

#include "sdm/memory.h"
#include "survey_line.h"
#include "survey_state.h"

enum { LINES_PER_PARAM = 4, LINES_MAX = 64, FOLD_SAMPLES = 32, VELOCITIES = 4 };

/* Where in the time the folds end. */
#define FOLDS_END 0.8

/* Looks for parts that meet in some of the shapes with the triangles of the first one only. */
static sdm_status find_meeting(survey *v, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    const finding *first = &v->found[0];
    survey_contacts *contacts = NULL;
    const sdm_status status = SDM_ALLOC(&contacts, s->n, "parts that meet", err);
    if (status) return status;
    for (size_t i = 0; i < s->n; i++) {
        const finding *f = &v->found[i];
        const bool same = !f->status && !f->open && f->n_vert == first->n_vert &&
                          f->n_tri == first->n_tri && f->crc_tri == first->crc_tri &&
                          f->contacts.n == first->contacts.n;
        if (same) contacts[i] = f->contacts;
    }
    const sdm_status found =
        sdm_survey_find_meeting(contacts, s->n, s->p, s->n_params, &s->meeting, err);
    sdm_free(contacts);
    return found;
}

static sdm_status find_fold(void *user, size_t i, sdm_mesh *mesh, sdm_error *err)
{
    (void)mesh;
    survey *v = user;
    v->fold_late[i] = i && (v->found[i].untested || survey_is_late(v, FOLDS_END));
    if (!i || v->found[i].status || v->fold_late[i]) return SDM_OK;
    return sdm_survey_find_fold(&v->family, survey_params(v, 0), survey_params(v, i), v->size,
                                &v->fold[i], err);
}

/* Looks for folds between the first shape and the corners and some samples. */
static sdm_status find_folds(survey *v, int n_threads, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    const size_t all = 1 + s->n_corners + FOLD_SAMPLES, n = s->n < all ? s->n : all;
    sdm_status status = SDM_ALLOC(&v->fold, n, "folds", err);
    if (!status) status = SDM_ALLOC(&v->fold_late, n, "folds", err);
    if (!status) status = survey_run(v, n_threads, "folds", n, find_fold, err);
    for (size_t i = 0; i < n && !status; i++) {
        s->fold_untested += v->fold_late[i];
        const survey_fold *fold = &v->fold[i];
        const bool crossed = !v->found[0].crossed && v->found[i].crossed;
        if (!(fold->share > (crossed ? SDM_SURVEY_FOLD_CROSSED : SDM_SURVEY_FOLD_MIN))) continue;
        if (fold->share > s->folded.amount) s->folded_at = fold->at;
        survey_count(&s->folded, i, fold->share);
    }
    s->fold_tested = n - 1 - s->fold_untested;
    return status;
}

/* Looks for jumps of the mesh while parameter i % n_params goes through its range and the other
 * parameters keep the values of a sample. */
static sdm_status follow_one(void *user, size_t i, sdm_mesh *mesh, sdm_error *err)
{
    (void)mesh;
    survey *v = user;
    v->line[i].untested = survey_is_late(v, 1);
    if (v->line[i].untested) return SDM_OK;
    const size_t n = v->out->n_params,
                 shape = v->out->n - 1 - (i / n) % (v->out->n_samples ? v->out->n_samples : 1);
    const sdm_status s =
        sdm_survey_line(&v->family, survey_params(v, shape), i % n, v->size, &v->line[i].jump, err);
    v->line[i].jump.shape = shape;
    return s;
}

/* A mesh that depends on the calls before looks like a jump where the dependence begins. */
static sdm_status tell_state_from_jump(const survey *v, size_t k, sdm_survey_jump *j,
                                       sdm_error *err)
{
    bool same = true;
    if (j->kind == SDM_BREAK_NONE) return SDM_OK;
    const double *other = survey_params(v, j->shape ? 0 : v->out->n - 1);
    const sdm_status s = sdm_survey_line_again(&v->family, survey_params(v, j->shape), k, other,
                                               j->value, &same, err);
    if (!same) j->kind = SDM_BREAK_STATE;
    return s;
}

static sdm_status follow_lines(survey *v, int n_threads, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    const size_t n = s->n_params;
    v->n_lines = LINES_PER_PARAM * n > LINES_MAX ? (n > LINES_MAX ? n : LINES_MAX / n * n)
                                                 : LINES_PER_PARAM * n;
    sdm_status status = SDM_ALLOC(&s->jump, n, "jumps of the mesh", err);
    if (!status) status = SDM_ALLOC(&v->line, v->n_lines, "lines through the ranges", err);
    if (!status) status = survey_run(v, n_threads, "lines", v->n_lines, follow_one, err);
    s->lines = v->n_lines;
    for (size_t i = 0; i < v->n_lines && !status; i++) {
        sdm_survey_jump *worst = &s->jump[i % n];
        const sdm_survey_jump *j = &v->line[i].jump;
        s->lines_untested += v->line[i].untested;
        // a change of sizes or triangles counts more than a jump
        if (j->kind > worst->kind || (j->kind == worst->kind && j->mm > worst->mm)) *worst = *j;
    }
    for (size_t k = 0; k < n && !status; k++) status = tell_state_from_jump(v, k, &s->jump[k], err);
    return status;
}

/* Compares the velocity callback with differences at shape `shape`. */
static sdm_status compare_velocity(survey *v, size_t shape, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    const double *p = survey_params(v, shape);
    const size_t n = v->found[shape].n_vert;
    double *given = NULL, *found = NULL;
    sdm_status status = SDM_ALLOC(&given, 3 * n * s->n_params, "velocities", err);
    if (!status) status = SDM_ALLOC(&found, 3 * n * s->n_params, "velocities", err);
    if (!status) status = sdm_instance_velocity(v->family.shape, p, n, given, err);
    if (!status) status = sdm_velocity_by_differences(v->family.shape, p, n, found, err);
    for (size_t k = 0; k < s->n_params && !status; k++) {
        double largest = 0, wrong = 0;
        size_t vertex = 0;
        for (size_t i = 3 * n * k; i < 3 * n * (k + 1); i++) {
            largest = fmax(largest, fmax(fabs(given[i]), fabs(found[i])));
            if (fabs(given[i] - found[i]) > wrong) {
                wrong = fabs(given[i] - found[i]);
                vertex = i / 3 % n;
            }
        }
        // velocities that move no vertex by 1e-9 of the size are rounding errors
        const double range = v->family.max[k] - v->family.min[k];
        if (!(largest * range > 1e-9 * v->size) || !(wrong / largest > s->velocity_error)) continue;
        s->velocity_error = wrong / largest;
        s->velocity_param = k;
        s->velocity_shape = shape;
        s->velocity_vertex = vertex;
    }
    sdm_free(given);
    sdm_free(found);
    // the callback failed, or the number of vertices changes nearby
    if (status == SDM_E_PLUGIN) s->velocity_error = INFINITY;
    return status == SDM_E_PLUGIN ? SDM_OK : status;
}

static sdm_status compare_velocities(survey *v, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    s->has_velocity = v->family.shape->shape->velocity != NULL;
    sdm_status status = SDM_OK;
    for (size_t k = 0; k < VELOCITIES && k < s->n_samples && s->has_velocity && !status; k++) {
        s->velocity_untested = survey_is_late(v, 1);
        if (s->velocity_untested) break;
        if (!v->found[s->n - 1 - k].status) status = compare_velocity(v, s->n - 1 - k, err);
    }
    return status;
}

sdm_status survey_follow(survey *v, int n_threads, sdm_error *err)
{
    sdm_status s = find_meeting(v, err);
    if (!s) s = find_folds(v, n_threads, err);
    if (!s) s = follow_lines(v, n_threads, err);
    return s ? s : compare_velocities(v, err);
}
