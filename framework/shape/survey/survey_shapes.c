/* The meshes of a survey: what each of them is like, and the sums over all of them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/internal/part_audit.h"
#include "sdm/memory.h"
#include "survey_state.h"

enum { REPEATS = 8 };

/* Where in the time these stages end. */
#define MESHES_END 0.2
#define PARTS_END 0.4
#define UNIONS_END 0.65
/* The audit of the first shape may take the whole time, and at least so long. */
#define FIRST_SECONDS 5.0

static void hash(const sdm_mesh *m, finding *f)
{
    f->n_vert = m->n_vert;
    f->n_tri = m->n_tri;
    f->crc_vert = sdm_crc64(0, m->vert, 3 * m->n_vert * sizeof *m->vert);
    f->crc_tri = sdm_crc64(0, m->tri, 3 * m->n_tri * sizeof *m->tri);
    sdm_box box = SDM_BOX_EMPTY;
    sdm_box_add_mesh(&box, m);
    memcpy(f->min, box.min, sizeof f->min);
    memcpy(f->max, box.max, sizeof f->max);
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

double sdm_survey_part_winding(const sdm_mesh *m, const sdm_part_audit *a, size_t i,
                               const sdm_exact_opts *stop)
{
    const sdm_part *p = &a->part[i];
    double most = (p->max[0] - p->min[0]) * (p->max[1] - p->min[1]) * (p->max[2] - p->min[2]);
    if (p->state != SDM_PART_SOLID || !p->crossed) return 0;
    // fmin() ignores NaN
    if (isfinite(a->union_volume)) most = fmin(most, sdm_part_filled(m, a, i, stop));
    return most > 0 ? fabs(p->volume) / most : 0;
}

static void find_winding(const sdm_mesh *m, const sdm_part_audit *a, const sdm_exact_opts *stop,
                         finding *out)
{
    for (size_t i = 0; i < a->n; i++) {
        const double winding = sdm_survey_part_winding(m, a, i, stop);
        if (winding > out->winding) out->winding = winding, out->winding_part = i;
    }
}

bool sdm_survey_winds_wrongly(const sdm_shape_survey *s)
{
    return s->wound.amount > SDM_SURVEY_WOUND_MAX || (s->wound.shapes && s->scale.degrees);
}

/* Is it too late to begin with shape i? Without the first one nothing is known. */
static bool is_left_out(const survey *v, size_t i, double part)
{
    return i ? survey_is_late(v, part) : survey_is_cancelled(v);
}

/* Makes the mesh of shape i. Returns only errors that end the survey. */
static sdm_status make_one(void *user, size_t i, sdm_mesh *m, sdm_error *err)
{
    survey *v = user;
    finding *out = &v->found[i];
    out->untested = is_left_out(v, i, MESHES_END);
    out->status = out->untested ? SDM_E_CANCELLED
                                : sdm_instance_mesh(v->family.shape, survey_params(v, i), m, err);
    if (out->status) return out->status == SDM_E_NOMEM ? SDM_E_NOMEM : SDM_OK;
    sdm_part_audit audit = {0};
    const sdm_status s = sdm_part_audit_unused(m, &audit, err);
    out->unused = audit.unused;
    out->made = true;
    hash(m, out);
    return s;
}

/* Looks at the parts of shape i. Returns only errors that end the survey. */
static sdm_status examine(void *user, size_t i, sdm_mesh *m, sdm_error *err)
{
    survey *v = user;
    finding *out = &v->found[i];
    sdm_part_audit audit;
    survey_stop stop;
    const unsigned what = SDM_AUDIT_WALLS | (v->opts->brief ? 0 : SDM_AUDIT_MEETINGS);
    if (!out->made) return SDM_OK;
    survey_stop_set(&stop, v, i ? PARTS_END : 1, i ? 0 : FIRST_SECONDS);
    out->status = is_left_out(v, i, PARTS_END)
                      ? SDM_E_CANCELLED
                      : sdm_instance_mesh(v->family.shape, survey_params(v, i), m, err);
    if (!out->status) out->status = sdm_part_audit_make(m, what, &stop.opts, &audit, err);
    out->untested = out->status == SDM_E_CANCELLED;
    if (out->status) return out->status == SDM_E_NOMEM ? SDM_E_NOMEM : SDM_OK;
    for (size_t k = 0; k < audit.n; k++) {
        out->open += audit.part[k].open_edges;
        out->turned += audit.part[k].turned && audit.part[k].volume < 0;
        out->crossed += audit.part[k].crossed;
        out->flat += sdm_survey_part_is_flat(&audit, k);
        out->tangle = fmax(out->tangle, sdm_part_tangle(&audit.part[k]));
    }
    find_winding(m, &audit, NULL, out);
    out->plain = audit.n == 1 && !audit.part[0].crossed && audit.mesh.closed;
    size_t shortest, longest;
    out->times = sdm_survey_part_lengths(&audit, &shortest, &longest);
    sdm_survey_contacts(&audit, &out->contacts);
    out->thick = sdm_part_audit_thickness(&audit);
    out->apart = audit.bodies > 1 ? audit.bodies : 0;
    out->inside_out = audit.inside_out;
    out->overlaps = audit.mesh.self_intersections;
    out->degenerate = audit.mesh.degenerate;
    out->duplicate = audit.mesh.duplicate;
    out->volume = out->area = NAN;
    if (out->plain) out->volume = fabs(audit.mesh.volume), out->area = audit.mesh.area;
    if (v->opts->grid) sdm_grid_mesh_beyond(v->opts->grid, m, out->beyond);
    sdm_part_audit_dispose(&audit);
    return SDM_OK;
}

/* Computes the union of shape i. Returns only errors that end the survey. */
static sdm_status find_union(void *user, size_t i, sdm_mesh *m, sdm_error *err)
{
    survey *v = user;
    finding *f = &v->found[i];
    sdm_part_audit audit;
    survey_stop stop;
    if (f->status || f->plain || f->open) return SDM_OK;
    survey_stop_set(&stop, v, UNIONS_END, 0);
    sdm_status s = survey_is_late(v, UNIONS_END)
                       ? SDM_E_CANCELLED
                       : sdm_instance_mesh(v->family.shape, survey_params(v, i), m, err);
    if (!s) s = sdm_part_audit_make(m, SDM_AUDIT_UNION, &stop.opts, &audit, err);
    f->no_union = s == SDM_E_CANCELLED;
    if (s) return s == SDM_E_NOMEM ? s : SDM_OK;
    f->volume = audit.union_volume;
    f->area = audit.union_area;
    find_winding(m, &audit, &stop.opts, f);
    sdm_part_audit_dispose(&audit);
    return SDM_OK;
}

static void count_beyond(sdm_shape_survey *s, size_t i, const finding *f)
{
    double most = 0;
    for (int a = 0; a < 3; a++)
        for (int side = 0; side < 2; side++) {
            s->beyond[a][side] = fmax(s->beyond[a][side], f->beyond[a][side]);
            most = fmax(most, f->beyond[a][side]);
        }
    if (i > s->n_corners) survey_count(&s->cut, i, most);
}

static void count_thin(sdm_shape_survey *s, size_t i, double thick, double voxel)
{
    if (sdm_too_thin(thick, voxel)) survey_count(&s->thin, i, voxel / thick);
}

/* Sums up the meshes, in the order of the shapes. */
static void sum_up_meshes(survey *v)
{
    sdm_shape_survey *s = v->out;
    const finding *first = NULL;
    double square = 0;
    s->volume[0] = s->volume[1] = s->area[0] = s->area[1] = NAN; // later stages know them
    for (int a = 0; a < 3; a++) {
        s->low[a] = INFINITY;
        s->high[a] = -INFINITY;
    }
    for (size_t i = 0; i < s->n; i++) {
        const finding *f = &v->found[i];
        s->untested += f->untested;
        survey_count(&s->failed, i, f->status && !f->untested);
        if (!f->made) continue;
        if (!first) {
            first = f;
            s->n_vert = f->n_vert;
            s->n_tri = f->n_tri;
        }
        survey_count(&s->unused, i, (double)f->unused);
        if (f->n_vert != first->n_vert || f->n_tri != first->n_tri)
            survey_count(&s->resized, i, (double)f->n_vert);
        else
            survey_count(&s->rewired, i, f->crc_tri != first->crc_tri);
        for (int a = 0; a < 3; a++) {
            s->low[a] = fmin(s->low[a], f->min[a]);
            s->high[a] = fmax(s->high[a], f->max[a]);
        }
    }
    for (int a = 0; a < 3; a++) square += (s->high[a] - s->low[a]) * (s->high[a] - s->low[a]);
    v->size = sqrt(square);
}

/* Sums up what the parts are like. */
static void sum_up_parts(survey *v)
{
    sdm_shape_survey *s = v->out;
    s->untested = 0;
    s->failed = (sdm_survey_count){0};
    for (size_t i = 0; i < s->n; i++) {
        const finding *f = &v->found[i];
        s->untested += f->untested;
        survey_count(&s->failed, i, f->status && !f->untested);
        if (f->status) continue;
        survey_count(&s->open, i, (double)f->open);
        survey_count(&s->inside_out, i, (double)f->inside_out);
        survey_count(&s->crossing, i, f->tangle);
        survey_count(&s->turned, i, (double)f->turned);
        survey_count(&s->apart, i, (double)f->apart);
        survey_count(&s->flat, i, (double)f->flat);
        if (f->times >= SDM_SURVEY_TINY) survey_count(&s->tiny, i, f->times);
        survey_count(&s->overlaps, i, (double)f->overlaps);
        survey_count(&s->degenerate, i, (double)f->degenerate);
        survey_count(&s->duplicate, i, (double)f->duplicate);
        count_beyond(s, i, f);
        if (v->opts->grid && !f->flat) count_thin(s, i, f->thick, sdm_grid_coarsest(v->opts->grid));
    }
    s->overlaps_begin = s->overlaps.shapes && !v->found[0].status && !v->found[0].overlaps;
}

static void spread(double range[2], double x)
{
    range[0] = fmin(range[0], x); // fmin() and fmax() ignore NaN
    range[1] = fmax(range[1], x);
}

/* Sums up volumes and windings, in the order of the shapes. */
static void sum_up_unions(survey *v)
{
    sdm_shape_survey *s = v->out;
    s->wound = (sdm_survey_count){0};
    s->unions_untested = 0;
    for (size_t i = 0; i < s->n; i++) {
        const finding *f = &v->found[i];
        s->unions_untested += f->no_union;
        if (f->status) continue;
        if (!v->opts->brief) spread(s->volume, f->volume), spread(s->area, f->area);
        if (f->winding > SDM_SURVEY_WOUND && f->winding > s->wound.amount)
            s->wound_part = f->winding_part;
        if (f->winding > SDM_SURVEY_WOUND) survey_count(&s->wound, i, f->winding);
    }
}

/* Makes mesh i once more and compares its bits. */
static sdm_status repeat_one(void *user, size_t i, sdm_mesh *mesh, sdm_error *err)
{
    survey *v = user;
    finding again = {0};
    if (!v->found[i].made) return SDM_OK;
    again.status = sdm_instance_mesh(v->family.shape, survey_params(v, i), mesh, err);
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

/* Makes some meshes again, and compares their bits: on one thread backwards, with the time, then on
 * several. */
static sdm_status make_again(survey *v, int n_threads, sdm_error *err)
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
    if (!s) s = survey_run(v, n_threads, NULL, n, repeat_one, err);
    if (s) return s;
    // a cause is known already, or the meshes differ from one process to another
    for (size_t i = 0; i < n && !v->out->repeat.cause; i++) v->out->repeat.unlike += v->unlike[i];
    qsort(ms, n, sizeof *ms, by_size);
    v->out->ms_mesh = ms[n / 2];
    return SDM_OK;
}

sdm_status survey_meshes(survey *v, int n_threads, sdm_error *err)
{
    const sdm_status s = survey_run(v, n_threads, "meshes", v->out->n, make_one, err);
    if (s) return s;
    sum_up_meshes(v);
    // the time of a mesh is of no interest there
    return v->opts->brief ? SDM_OK : make_again(v, n_threads, err);
}

sdm_status survey_parts(survey *v, int n_threads, sdm_error *err)
{
    const sdm_status s = survey_run(v, n_threads, "shapes", v->out->n, examine, err);
    if (s) return s;
    sum_up_parts(v);
    sum_up_unions(v);
    return SDM_OK;
}

sdm_status survey_unions(survey *v, int n_threads, sdm_error *err)
{
    const sdm_status s = survey_run(v, n_threads, "volumes", v->out->n, find_union, err);
    if (!s) sum_up_unions(v);
    return s;
}
