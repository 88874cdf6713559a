/* Surveys a family of shapes: meshes at many parameters, their audits, and checks of continuity,
 * velocities and repeatability. */
#include "sdm/internal/shape_survey.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "survey_fold.h"
#include "survey_line.h"
#include "survey_meeting.h"
#include "survey_repeat.h"
#include "survey_scale.h"
#include "survey_still.h"

enum {
    LINES_PER_PARAM = 4,
    LINES_MAX = 64,
    FOLD_SAMPLES = 32,
    VELOCITIES = 4,
    REPEATS = 8,
    FACE_SAMPLES = 8,
    BOX_SAMPLES = 64
};

/* What is known about one shape. */
typedef struct finding {
    sdm_status status;
    bool untested; /* for want of time; the status is then SDM_E_CANCELLED */
    size_t n_vert, n_tri;
    uint64_t crc_vert, crc_tri;
    size_t open, unused, inside_out, turned, apart, flat, overlaps, crossed, degenerate, duplicate;
    double volume, area, min[3], max[3];
    double times;        /* of sdm_survey_part_lengths() */
    double winding;      /* the largest of sdm_survey_part_winding() */
    double turned_over;  /* the largest of sdm_part.folded */
    double thick;        /* of the thinnest part, mm; NaN: not known */
    double beyond[3][2]; /* mm */
    survey_contacts contacts;
} finding;

/* ---- parameters ---- */

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

/* ---- one mesh ---- */

static void hash(const sdm_mesh *m, finding *f)
{
    f->n_vert = m->n_vert;
    f->n_tri = m->n_tri;
    f->crc_vert = sdm_crc64(0, m->vert, 3 * m->n_vert * sizeof *m->vert);
    f->crc_tri = sdm_crc64(0, m->tri, 3 * m->n_tri * sizeof *m->tri);
}

bool sdm_survey_part_is_flat(const sdm_part_audit *a, size_t i)
{
    const sdm_part *p = &a->part[i];
    double size = 0;
    for (int d = 0; d < 3; d++) size = fmax(size, a->mesh.max[d] - a->mesh.min[d]);
    return p->state == SDM_PART_FLAT || p->doubled || p->thick < SDM_SURVEY_FLAT * size;
}

double sdm_survey_part_lengths(const sdm_part_audit *a, size_t *shortest, size_t *longest)
{
    double least = INFINITY, most = 0;
    for (size_t i = 0; i < a->n; i++) {
        double length = 0;
        if (a->part[i].state == SDM_PART_FLAT) continue; // told as such
        for (int d = 0; d < 3; d++) length = fmax(length, a->part[i].max[d] - a->part[i].min[d]);
        if (length > 0 && length < least) least = length, *shortest = i;
        if (length > most) most = length, *longest = i;
    }
    return most > least ? most / least : 0;
}

double sdm_survey_part_winding(const sdm_mesh *m, const sdm_part_audit *a, size_t i)
{
    const sdm_part *p = &a->part[i];
    double most = (p->max[0] - p->min[0]) * (p->max[1] - p->min[1]) * (p->max[2] - p->min[2]);
    if (p->state != SDM_PART_SOLID || !p->crossed) return 0;
    // fmin() ignores NaN
    if (isfinite(a->union_volume)) most = fmin(most, sdm_part_filled(m, a, i));
    return most > 0 ? fabs(p->volume) / most : 0;
}

bool sdm_survey_winds_wrongly(const sdm_shape_survey *s)
{
    return s->wound.amount > SDM_SURVEY_WOUND_MAX || (s->wound.shapes && s->scale.degrees);
}

/* Makes the mesh at p and looks at it. Returns only errors that end the survey. */
static sdm_status examine(const sdm_instance *shape, const sdm_survey_opts *opts, const double *p,
                          sdm_mesh *m, finding *out, sdm_error *err)
{
    sdm_part_audit audit;
    out->status = sdm_instance_mesh(shape, p, m, err);
    if (!out->status) {
        hash(m, out);
        out->status = sdm_part_audit_make(m, !opts->brief, &audit, err);
    }
    if (out->status == SDM_E_NOMEM) return SDM_E_NOMEM;
    if (out->status) return SDM_OK;
    for (size_t i = 0; i < audit.n; i++) {
        out->open += audit.part[i].open_edges;
        out->turned += audit.part[i].turned && audit.part[i].volume < 0;
        out->crossed += audit.part[i].crossed;
        out->flat += sdm_survey_part_is_flat(&audit, i);
        out->winding = fmax(out->winding, sdm_survey_part_winding(m, &audit, i));
        out->turned_over = fmax(out->turned_over, audit.part[i].folded);
    }
    size_t shortest, longest;
    out->times = sdm_survey_part_lengths(&audit, &shortest, &longest);
    sdm_survey_contacts(&audit, &out->contacts);
    out->thick = sdm_part_audit_thickness(&audit);
    out->apart = audit.bodies > 1 ? audit.bodies : 0;
    out->unused = audit.unused;
    out->inside_out = audit.inside_out;
    out->overlaps = audit.mesh.self_intersections;
    out->degenerate = audit.mesh.degenerate;
    out->duplicate = audit.mesh.duplicate;
    out->volume = audit.union_volume;
    out->area = audit.union_area;
    memcpy(out->min, audit.mesh.min, sizeof out->min);
    memcpy(out->max, audit.mesh.max, sizeof out->max);
    if (opts->grid) sdm_grid_mesh_beyond(opts->grid, m, out->beyond);
    sdm_part_audit_dispose(&audit);
    return SDM_OK;
}

static bool is_cancelled(const sdm_survey_opts *o) { return o->cancelled && o->cancelled(o->user); }

/* A loop body: works on item i with a mesh of the thread. */
typedef sdm_status survey_body(void *user, size_t i, sdm_mesh *mesh, sdm_error *err);

/* Reports that one more of n items is done. */
static void report(const sdm_survey_opts *opts, const char *what, size_t *done, size_t n)
{
    if (!opts->progress || !what) return;
#pragma omp critical(sdm_survey_progress)
    opts->progress(opts->user, what, (double)++*done / (double)n);
}

/* Runs body(user, i) for i < n on several threads. The error of the lowest i that failed counts.
 * what: the stage, for the progress; NULL: none. */
static sdm_status run(const sdm_survey_opts *opts, int n_threads, const char *what, size_t n,
                      survey_body *body, void *user, sdm_error *err)
{
    sdm_status status = SDM_OK;
    size_t done = 0;
#pragma omp parallel num_threads(n_threads)
    {
        sdm_mesh mesh = {0};
        sdm_error why = {0};
#pragma omp for schedule(dynamic)
        for (size_t i = 0; i < n; i++) {
            sdm_status now;
#pragma omp atomic read
            now = status;
            if (now) continue;
            const sdm_status s = is_cancelled(opts)
                                     ? sdm_fail(&why, SDM_E_CANCELLED, "the survey was cancelled")
                                     : body(user, i, &mesh, &why);
            if (!s) report(opts, what, &done, n);
            if (!s) continue;
#pragma omp critical(sdm_survey)
            if (!status) {
                if (err) *err = why;
#pragma omp atomic write
                status = s;
            }
        }
        sdm_mesh_dispose(&mesh);
    }
    return status;
}

/* ---- all meshes ---- */

/* A line through the ranges, along one parameter. */
typedef struct followed {
    sdm_survey_jump jump;
    bool untested; /* for want of time */
} followed;

typedef struct survey {
    shape_family family;
    const sdm_survey_opts *opts;
    sdm_shape_survey *out;
    finding *found; /* [n] */
    followed *line; /* [n_lines] */
    size_t n_lines;
    bool *fold_late;   /* [1 + n_corners + FOLD_SAMPLES]: left out for want of time */
    survey_fold *fold; /* [1 + n_corners + FOLD_SAMPLES], by shape */
    bool *unlike;      /* [REPEATS] */
    double size;       /* diagonal of the box, mm */
    double start;      /* time of the clock, s */
} survey;

/* Is `part` of the time over? */
static bool is_late(const survey *v, double part)
{
    return v->opts->seconds > 0 && sdm_clock() - v->start > part * v->opts->seconds;
}

static const double *params_of(const survey *v, size_t i)
{
    return v->out->p + i * v->out->n_params;
}

static sdm_status examine_one(void *user, size_t i, sdm_mesh *mesh, sdm_error *err)
{
    survey *v = user;
    if (i && is_late(v, 0.5)) {
        v->found[i].untested = true;
        v->found[i].status = SDM_E_CANCELLED;
        return SDM_OK;
    }
    return examine(v->family.shape, v->opts, params_of(v, i), mesh, &v->found[i], err);
}

static void count(sdm_survey_count *c, size_t shape, double amount)
{
    if (!(amount > 0)) return;
    c->shapes++;
    if (!(amount > c->amount)) return;
    c->amount = amount;
    c->worst = shape;
}

static void count_beyond(sdm_shape_survey *s, size_t i, const finding *f)
{
    double most = 0;
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            s->beyond[a][side] = fmax(s->beyond[a][side], f->beyond[a][side]);
            most = fmax(most, f->beyond[a][side]);
        }
    if (i > s->n_corners) count(&s->cut, i, most);
}

static void count_thin(sdm_shape_survey *s, size_t i, double thick, double voxel)
{
    if (sdm_too_thin(thick, voxel)) count(&s->thin, i, voxel / thick);
}

static void spread(double range[2], double x)
{
    range[0] = fmin(range[0], x); // fmin() and fmax() ignore NaN
    range[1] = fmax(range[1], x);
}

/* Sums up the findings, in the order of the shapes. */
static void sum_up(survey *v)
{
    sdm_shape_survey *s = v->out;
    const finding *first = NULL;
    for (int a = 0; a < 3; a++) {
        s->low[a] = INFINITY;
        s->high[a] = -INFINITY;
    }
    s->volume[0] = s->volume[1] = s->area[0] = s->area[1] = NAN;
    for (size_t i = 0; i < s->n; i++) {
        const finding *f = &v->found[i];
        s->untested += f->untested;
        count(&s->failed, i, f->status && !f->untested);
        if (f->status) continue;
        if (!first) {
            first = f;
            s->n_vert = f->n_vert;
            s->n_tri = f->n_tri;
        }
        count(&s->open, i, (double)f->open);
        count(&s->unused, i, (double)f->unused);
        count(&s->inside_out, i, (double)f->inside_out);
        if (f->turned_over > SDM_PART_FOLDED_MIN) count(&s->crossing, i, f->turned_over);
        if (f->winding > SDM_SURVEY_WOUND) count(&s->wound, i, f->winding);
        count(&s->turned, i, (double)f->turned);
        count(&s->apart, i, (double)f->apart);
        count(&s->flat, i, (double)f->flat);
        if (f->times >= SDM_SURVEY_TINY) count(&s->tiny, i, f->times);
        count(&s->overlaps, i, (double)f->overlaps);
        count(&s->degenerate, i, (double)f->degenerate);
        count(&s->duplicate, i, (double)f->duplicate);
        if (f->n_vert != first->n_vert || f->n_tri != first->n_tri)
            count(&s->resized, i, (double)f->n_vert);
        else
            count(&s->rewired, i, f->crc_tri != first->crc_tri);
        spread(s->volume, f->volume);
        spread(s->area, f->area);
        for (int a = 0; a < 3; a++) {
            s->low[a] = fmin(s->low[a], f->min[a]);
            s->high[a] = fmax(s->high[a], f->max[a]);
        }
        count_beyond(s, i, f);
        if (v->opts->grid && !f->flat) count_thin(s, i, f->thick, sdm_grid_coarsest(v->opts->grid));
    }
    s->overlaps_begin = s->overlaps.shapes && !v->found[0].status && !v->found[0].overlaps;
    double sum = 0;
    for (int a = 0; a < 3; a++) sum += (s->high[a] - s->low[a]) * (s->high[a] - s->low[a]);
    v->size = sqrt(sum);
}

/* ---- what a brief survey leaves out ---- */

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
    v->fold_late[i] = i && (v->found[i].untested || is_late(v, 0.75));
    if (!i || v->found[i].status || v->fold_late[i]) return SDM_OK;
    return sdm_survey_find_fold(&v->family, params_of(v, 0), params_of(v, i), v->size, &v->fold[i],
                                err);
}

/* Looks for folds between the first shape and the corners and some samples. */
static sdm_status find_folds(survey *v, int n_threads, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    const size_t all = 1 + s->n_corners + FOLD_SAMPLES, n = s->n < all ? s->n : all;
    sdm_status status = SDM_ALLOC(&v->fold, n, "folds", err);
    if (!status) status = SDM_ALLOC(&v->fold_late, n, "folds", err);
    if (!status) status = run(v->opts, n_threads, "folds", n, find_fold, v, err);
    for (size_t i = 0; i < n && !status; i++) {
        s->fold_untested += v->fold_late[i];
        const survey_fold *fold = &v->fold[i];
        const bool crossed = !v->found[0].crossed && v->found[i].crossed;
        if (!(fold->share > (crossed ? SDM_SURVEY_FOLD_CROSSED : SDM_SURVEY_FOLD_MIN))) continue;
        if (fold->share > s->folded.amount) s->folded_at = fold->at;
        count(&s->folded, i, fold->share);
    }
    s->fold_tested = n - 1 - s->fold_untested;
    return status;
}

/* Line number i follows parameter i % n_params from a sample. */
static sdm_status follow_one(void *user, size_t i, sdm_mesh *mesh, sdm_error *err)
{
    (void)mesh;
    survey *v = user;
    v->line[i].untested = is_late(v, 1);
    if (v->line[i].untested) return SDM_OK;
    const size_t n = v->out->n_params,
                 shape = v->out->n - 1 - (i / n) % (v->out->n_samples ? v->out->n_samples : 1);
    const sdm_status s =
        sdm_survey_line(&v->family, params_of(v, shape), i % n, v->size, &v->line[i].jump, err);
    v->line[i].jump.shape = shape;
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
    if (!status) status = run(v->opts, n_threads, "lines", v->n_lines, follow_one, v, err);
    s->lines = v->n_lines;
    for (size_t i = 0; i < v->n_lines && !status; i++) {
        sdm_survey_jump *worst = &s->jump[i % n];
        const sdm_survey_jump *j = &v->line[i].jump;
        s->lines_untested += v->line[i].untested;
        // a change of sizes or triangles counts more than a jump
        if (j->kind > worst->kind || (j->kind == worst->kind && j->mm > worst->mm)) *worst = *j;
    }
    return status;
}

/* Compares the velocity callback with differences at shape `shape`. */
static sdm_status compare_velocity(survey *v, size_t shape, sdm_error *err)
{
    sdm_shape_survey *s = v->out;
    const double *p = params_of(v, shape);
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
    for (size_t k = 0; k < VELOCITIES && k < s->n_samples && s->has_velocity && !status; k++)
        if (!v->found[s->n - 1 - k].status) status = compare_velocity(v, s->n - 1 - k, err);
    return status;
}

/* Makes mesh i once more and compares its bits. */
static sdm_status repeat_one(void *user, size_t i, sdm_mesh *mesh, sdm_error *err)
{
    survey *v = user;
    finding again = {0};
    if (v->found[i].status) return SDM_OK;
    again.status = sdm_instance_mesh(v->family.shape, params_of(v, i), mesh, err);
    if (again.status == SDM_E_NOMEM) return SDM_E_NOMEM;
    if (!again.status) hash(mesh, &again);
    v->unlike[i] |= again.status || again.n_vert != v->found[i].n_vert ||
                    again.n_tri != v->found[i].n_tri || again.crc_vert != v->found[i].crc_vert ||
                    again.crc_tri != v->found[i].crc_tri;
    return SDM_OK;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Repeats the first meshes backwards on one thread, with the time, and again on several. */
static sdm_status repeat(survey *v, int n_threads, sdm_error *err)
{
    const size_t n = v->out->n < REPEATS ? v->out->n : REPEATS;
    double ms[REPEATS];
    sdm_mesh mesh = {0};
    sdm_status s = SDM_ALLOC(&v->unlike, REPEATS, "repeated meshes", err);
    for (size_t i = n; i-- > 0 && !s;) {
        const double start = sdm_clock();
        s = repeat_one(v, i, &mesh, err);
        ms[i] = 1e3 * (sdm_clock() - start);
    }
    sdm_mesh_dispose(&mesh);
    if (!s) s = run(v->opts, n_threads, NULL, n, repeat_one, v, err);
    if (s) return s;
    // a cause is known already, or the meshes differ from one process to another
    for (size_t i = 0; i < n && !v->out->repeat.cause; i++) v->out->repeat.unlike += v->unlike[i];
    qsort(ms, n, sizeof *ms, by_size);
    v->out->ms_mesh = ms[n / 2];
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

/* ---- the survey ---- */

sdm_status sdm_shape_survey_make(const sdm_instance *shape, const sdm_survey_opts *opts,
                                 sdm_shape_survey *out, sdm_error *err)
{
    if (!shape || !out)
        return sdm_fail(err, SDM_E_ARG, "survey without a shape or a place for the result");
    static const sdm_survey_opts none = {0};
    if (!opts) opts = &none;
    *out = (sdm_shape_survey){0};
    survey v = {.opts = opts, .out = out, .start = sdm_clock()};
    int n_threads = sdm_threads(opts->n_threads);
    sdm_status s = opts->grid ? sdm_grid_check(opts->grid, err) : SDM_OK;
    if (!s) s = sdm_family_set(&v.family, shape, opts->range, opts->distribution, opts->seed, err);
    if (!s) s = choose(&v.family, opts, out, err);
    if (!s) s = SDM_ALLOC(&v.found, out->n, "findings of a survey", err);
    if (!s) s = sdm_survey_repeat(shape, out->p, out->n, opts->brief, &out->repeat, err);
    // further findings are to be those of the shape
    if (out->repeat.cause == SDM_REPEAT_THREADS) n_threads = 1;
    if (!s) s = run(opts, n_threads, "shapes", out->n, examine_one, &v, err);
    if (!s) sum_up(&v);
    if (!s && !opts->brief && out->failed.shapes < out->n - out->untested) {
        s = find_meeting(&v, err);
        if (!s) s = find_folds(&v, n_threads, err);
        if (!s) s = follow_lines(&v, n_threads, err);
        if (!s) s = compare_velocities(&v, err);
        if (!s) s = repeat(&v, n_threads, err);
        out->box_untested = is_late(&v, 1);
        if (!s && !out->box_untested) s = widen_box(&v, err);
    }
    if (!s && opts->grid)
        out->surplus = sdm_grid_surplus(opts->grid, out->low, out->high, out->surplus_along);
    if (!s && opts->grid && !opts->brief && !out->failed.shapes && !out->untested)
        s = sdm_grid_family_hits(shape, opts->range, FACE_SAMPLES, opts->seed, opts->grid,
                                 &out->hits, err);
    if (!s) s = sdm_survey_measure_scale(&v.family, out, err);
    if (!s && !opts->brief && !out->failed.shapes && !out->open.shapes && !out->inside_out.shapes &&
        !is_late(&v, 1))
        s = sdm_survey_find_still(&v.family, opts, v.size, out, err);
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
               s->resized.shapes || s->rewired.shapes || s->cut.shapes || s->thin.shapes ||
               s->flat.shapes || s->tiny.shapes || s->narrow || s->repeat.unlike ||
               s->surplus > SDM_SURVEY_SURPLUS_MAX ||
               s->velocity_error > SDM_SURVEY_VELOCITY_LIMIT || s->scale.odd_size ||
               s->scale.odd_speed || s->scale.odd_angle || s->scale.other_length || s->scale.swings;
    for (size_t k = 0; k < s->n_params && s->jump; k++)
        bad = bad || s->jump[k].kind != SDM_BREAK_NONE;
    for (size_t k = 0; k < s->n_params && s->still; k++) bad = bad || s->still[k];
    bad = bad || s->slow || sdm_survey_has_twins(s);
    return bad ? SDM_E_QUALITY : SDM_OK;
}
