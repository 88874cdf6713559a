/* Finds out why a length moves vertices by too little or too much: all coordinates of a part are in
 * another unit, or mesh() converts this length alone, in all parts or in one. */
#include <math.h>
#include <string.h>

#include "sdm/internal/units.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "survey_scale.h"

/* The step of a parameter, as a fraction of its range. */
static const double STEP = 0.01;

/* In its own unit a part is at most so many times longer than the other parts and lengths. */
static const double LONGER_MAX = 5;

/* mm per mm: a length in m moves a part by MIXED_MIN to MIXED_MAX, one in mm by FAIR_MIN. */
static const double MIXED_MIN = 2e-4, MIXED_MAX = 2e-3, FAIR_MIN = 0.25;

/* The motion by a converted length is the same everywhere, up to this fraction. Other small
 * motions, such as that of a part that turns a little, differ from shape to shape. */
static const double SAME = 1e-3;

/* Shapes at which the motion must be the same: the first one and samples. */
enum { SHAPES = 4 };

/* The parts of the first shape, and how far each moves. */
typedef struct motion {
    const shape_family *f;
    sdm_mesh here, there;
    sdm_part_audit parts;
    double *speed; /* [n_params][parts.n] mm per unit; NaN: not known */
} motion;

static void motion_dispose(motion *m)
{
    sdm_free(m->speed);
    sdm_part_audit_dispose(&m->parts);
    sdm_mesh_dispose(&m->there);
    sdm_mesh_dispose(&m->here);
}

/* SDM_E_NOMEM stays. Another error says that a mesh cannot be made: what would be measured on it
 * stays unknown, without an error. */
static sdm_status only_memory(sdm_status s) { return s == SDM_E_NOMEM ? s : SDM_OK; }

/* speed[parts] = how far a vertex of each part moves, at most, from the mesh `here`, which is that
 * of p[], to the one with parameter k at `value`, per unit of the parameter; NaN: not known. */
static sdm_status measure(motion *m, const double *p, size_t k, double value, double *speed,
                          sdm_error *err)
{
    double q[SHAPE_PARAMS_MAX];
    for (size_t i = 0; i < m->parts.n; i++) speed[i] = NAN;
    memcpy(q, p, m->f->shape->n_params * sizeof *q);
    q[k] = value;
    const double change = fabs(value - p[k]);
    if (!(change > 0)) return SDM_OK;
    const sdm_status s = sdm_instance_mesh(m->f->shape, q, &m->there, err);
    if (s || m->there.n_vert != m->parts.mesh.n_vert || m->here.n_vert != m->there.n_vert)
        return only_memory(s);
    for (size_t i = 0; i < m->parts.n; i++) speed[i] = 0;
    for (size_t t = 0; t < m->parts.mesh.n_tri; t++) {
        const uint32_t part = m->parts.part_of[t];
        for (size_t c = 3 * t; c < 3 * t + 3 && part != SDM_NO_PART; c++) {
            const double *a = m->here.vert + 3 * (size_t)m->here.tri[c],
                         *b = m->there.vert + 3 * (size_t)m->here.tri[c];
            const double far = sqrt(v3_dist2(a, b)) / change;
            speed[part] = fmax(speed[part], far);
        }
    }
    return SDM_OK;
}

/* Makes the first mesh, its parts and their speeds by all parameters. Without a mesh parts.n is 0.
 */
static sdm_status motion_make(const shape_family *f, const sdm_shape_survey *s, motion *m,
                              sdm_error *err)
{
    *m = (motion){.f = f};
    sdm_status status = sdm_instance_mesh(f->shape, s->p, &m->here, err);
    if (!status) status = sdm_part_audit_make(&m->here, 0, NULL, &m->parts, err);
    if (status) return only_memory(status);
    status = SDM_ALLOC(&m->speed, s->n_params * m->parts.n + 1, "speeds of parts", err);
    for (size_t k = 0; k < s->n_params && !status; k++) {
        const double step = STEP * (f->max[k] - f->min[k]);
        const double value = s->p[k] + (s->p[k] + step <= f->max[k] ? step : -step);
        status = measure(m, s->p, k, value, m->speed + k * m->parts.n, err);
    }
    return status;
}

/* The shortest and the longest edge of the box of a part, mm. */
static void measure_edges(const sdm_part *p, double *shortest, double *longest)
{
    for (int d = 0; d < 3; d++) {
        *shortest = fmin(*shortest, p->max[d] - p->min[d]);
        *longest = fmax(*longest, p->max[d] - p->min[d]);
    }
}

/* Are all coordinates of the parts that parameter k moves in the unit u->mm? moved[parts] */
static bool is_whole(const motion *m, const sdm_shape_survey *s, size_t k, const bool *moved,
                     const sdm_survey_unit *u)
{
    double shortest = INFINITY, longest = 0, other = 0, none = INFINITY;
    for (size_t i = 0; i < m->parts.n; i++)
        if (moved[i])
            measure_edges(&m->parts.part[i], &shortest, &longest);
        else
            measure_edges(&m->parts.part[i], &none, &other);
    for (size_t j = 0; j < s->n_params; j++)
        for (size_t i = 0; i < m->parts.n && sdm_survey_is_length(m->f->shape, j); i++) {
            const double speed = m->speed[j * m->parts.n + i];
            if (!moved[i] || !(speed > 0)) continue;
            // a part that another length moves as one in mm does is in mm
            if (u->mm > 1 && speed > sqrt(u->mm) * s->speed[k]) return false;
            if (u->mm < 1 && speed < sqrt(u->mm) * s->speed[k]) return false;
            other = fmax(other, fabs(s->p[j]));
        }
    return u->mm > 1 ? longest * u->mm <= LONGER_MAX * other : shortest * sqrt(u->mm) >= other;
}

/* Is the motion by parameter k too small by itself, or the odd speed of the survey? */
static bool is_odd(const motion *m, const sdm_shape_survey *s, size_t k)
{
    const sdm_instance *shape = m->f->shape;
    return sdm_survey_is_length(shape, k) && s->speed[k] > 0 &&
           (sdm_survey_is_slow(s, shape, k) || (s->scale.odd_speed && s->scale.param == k));
}

/* Sets s->unit[k]. moved[parts]: scratch. */
static void find_unit(const motion *m, sdm_shape_survey *s, size_t k, bool *moved)
{
    sdm_survey_unit *u = &s->unit[k];
    const double *speed = m->speed + k * m->parts.n;
    double most = 0;
    u->n_parts = m->parts.n;
    u->name = sdm_unit_near(1 / s->speed[k], &u->mm);
    for (size_t i = 0; i < u->n_parts; i++) most = fmax(most, speed[i]);
    for (size_t i = 0; i < u->n_parts; i++) {
        moved[i] = speed[i] > 0.1 * most;
        if (moved[i] && u->moved++ < SDM_SURVEY_NAMED) u->part[u->moved - 1] = i;
    }
    u->whole = u->name && u->moved && is_whole(m, s, k, moved, u);
}

sdm_status sdm_survey_find_units(const shape_family *f, sdm_shape_survey *s, sdm_error *err)
{
    motion m = {.f = f};
    bool any = false, *moved = NULL;
    for (size_t k = 0; k < s->n_params; k++) any = any || is_odd(&m, s, k);
    if (!any) return SDM_OK;
    sdm_status status = motion_make(f, s, &m, err);
    if (!status) status = SDM_ALLOC(&moved, m.parts.n + 1, "parts", err);
    for (size_t k = 0; k < s->n_params && !status; k++)
        if (is_odd(&m, s, k)) find_unit(&m, s, k, moved);
    sdm_free(moved);
    motion_dispose(&m);
    return status;
}

/* Takes back those of mixed[parts] whose motion by parameter k at shape `shape`, whose mesh is
 * m->here, is another one than at the first shape. speed[parts]: scratch. */
static sdm_status rule_out(motion *m, const sdm_shape_survey *s, size_t k, size_t shape,
                           bool *mixed, double *speed, sdm_error *err)
{
    const double *p = s->p + shape * s->n_params, ends[2] = {m->f->min[k], m->f->max[k]};
    sdm_status status = SDM_OK;
    for (int e = 0; e < 2 && !status; e++) {
        // a short way has few digits
        if (fabs(ends[e] - p[k]) < 0.05 * (ends[1] - ends[0])) continue;
        status = measure(m, p, k, ends[e], speed, err);
        for (size_t i = 0; i < m->parts.n; i++) {
            const double first = m->speed[k * m->parts.n + i];
            mixed[i] = mixed[i] && fabs(speed[i] - first) <= SAME * first;
        }
    }
    return status;
}

/* Sets s->unit[k].mixed. mixed[parts], speed[parts]: scratch. */
static sdm_status find_mixed(motion *m, sdm_shape_survey *s, size_t k, bool *mixed, double *speed,
                             sdm_error *err)
{
    sdm_survey_unit *u = &s->unit[k];
    const double *first = m->speed + k * m->parts.n;
    size_t fair = 0;
    bool any = false;
    for (size_t i = 0; i < m->parts.n; i++) {
        mixed[i] = first[i] >= MIXED_MIN && first[i] <= MIXED_MAX;
        any = any || mixed[i];
        if (first[i] > first[fair]) fair = i;
    }
    if (!any || !(first[fair] >= FAIR_MIN)) return SDM_OK;
    for (size_t n = 0; n < SHAPES && n <= s->n_samples; n++) {
        const size_t shape = n ? s->n - n : 0;
        sdm_status status =
            sdm_instance_mesh(m->f->shape, s->p + shape * s->n_params, &m->here, err);
        if (!status) status = rule_out(m, s, k, shape, mixed, speed, err);
        if (status) return only_memory(status);
    }
    for (size_t i = m->parts.n; i-- > 0;)
        if (mixed[i]) u->mixed = first[i], u->mixed_part = i;
    u->fair = first[fair], u->fair_part = fair;
    return SDM_OK;
}

/* Is there a length of which 1 mm moves some vertices by about 0.001 mm and others by about 1 mm?
 * Looks at all vertices together, which takes less time than an audit of the parts. */
static sdm_status may_be_mixed(const shape_family *f, const sdm_shape_survey *s, bool *out,
                               sdm_error *err)
{
    motion m = {.f = f};
    sdm_status status = sdm_instance_mesh(f->shape, s->p, &m.here, err);
    *out = false;
    for (size_t k = 0; k < s->n_params && !status && !*out; k++) {
        double q[SHAPE_PARAMS_MAX];
        bool small = false, fair = false;
        const double step = STEP * (f->max[k] - f->min[k]);
        if (!sdm_survey_is_length(f->shape, k) || !(step > 0)) continue;
        memcpy(q, s->p, s->n_params * sizeof *q);
        q[k] += q[k] + step <= f->max[k] ? step : -step;
        status = sdm_instance_mesh(f->shape, q, &m.there, err);
        for (size_t v = 0; v < m.here.n_vert && !status && m.there.n_vert == m.here.n_vert; v++) {
            const double *a = m.here.vert + 3 * v, *b = m.there.vert + 3 * v;
            const double far = sqrt(v3_dist2(a, b)) / step;
            small = small || (far >= MIXED_MIN && far <= MIXED_MAX);
            fair = fair || far >= FAIR_MIN;
        }
        *out = small && fair;
    }
    motion_dispose(&m);
    return only_memory(status);
}

sdm_status sdm_survey_find_mixed(const shape_family *f, sdm_shape_survey *s, sdm_error *err)
{
    motion m = {.f = f};
    bool any, *mixed = NULL;
    double *speed = NULL;
    if (s->tiny.shapes) return SDM_OK; // a part in m, which is told
    sdm_status status = may_be_mixed(f, s, &any, err);
    if (status || !any) return status;
    status = motion_make(f, s, &m, err);
    if (!status) status = SDM_ALLOC(&mixed, m.parts.n + 1, "parts", err);
    if (!status) status = SDM_ALLOC(&speed, m.parts.n + 1, "speeds of parts", err);
    for (size_t k = 0; k < s->n_params && !status && m.parts.n > 1; k++)
        if (sdm_survey_is_length(f->shape, k)) status = find_mixed(&m, s, k, mixed, speed, err);
    sdm_free(speed);
    sdm_free(mixed);
    motion_dispose(&m);
    return status;
}

/* Appends "part 2 of 5" or "parts 1, 2, 3, 4 and 3 more of 9". */
static void add_parts(const sdm_survey_unit *u, sdm_text *out)
{
    sdm_text_add(out, "part%s ", u->moved > 1 ? "s" : "");
    for (size_t i = 0; i < u->moved && i < SDM_SURVEY_NAMED; i++) {
        const bool last = i + 1 == u->moved;
        sdm_text_add(out, "%s%zu", !i ? "" : last ? " and " : ", ", u->part[i] + 1);
    }
    if (u->moved > SDM_SURVEY_NAMED)
        sdm_text_add(out, " and %zu more", u->moved - SDM_SURVEY_NAMED);
    sdm_text_add(out, " of %zu", u->n_parts);
}

void sdm_survey_ask_unit(const sdm_shape_survey *s, const sdm_instance *shape, size_t k,
                         sdm_text *out)
{
    const sdm_survey_unit *u = &s->unit[k];
    if (!u->name) return;
    if (u->whole) {
        sdm_text_add(out, ": are the vertices ");
        if (u->moved < u->n_parts) {
            sdm_text_add(out, "of ");
            add_parts(u, out);
            sdm_text_add(out, " ");
        }
        sdm_text_add(out, "in %s? Multiply them by %g", u->name, u->mm);
        return;
    }
    // 0.001 and 0.1 have few digits, 1 / 25.4 has not
    const double factor = 1 / u->mm;
    const bool divide = fabs(1e3 * factor - nearbyint(1e3 * factor)) > 1e-9;
    sdm_text_add(out, ": does mesh() %s '%s' by %g?", divide ? "divide" : "multiply",
                 shape->params[k].name, divide ? u->mm : factor);
}

void sdm_survey_add_slow(const sdm_shape_survey *s, const sdm_instance *shape, size_t k,
                         sdm_text *out)
{
    const sdm_survey_unit *u = &s->unit[k];
    sdm_text_add(out, "1 mm of the parameter '%s' moves no vertex ", shape->params[k].name);
    if (u->moved && u->moved < u->n_parts) {
        sdm_text_add(out, "of ");
        add_parts(u, out);
        sdm_text_add(out, " ");
    }
    sdm_text_add(out, "by more than %.2g mm%s", s->speed[k],
                 u->moved && u->moved < u->n_parts ? ", and no other part" : "");
    if (u->name)
        sdm_survey_ask_unit(s, shape, k, out);
    else
        sdm_text_add(out,
                     ": does mesh() multiply '%s' by a small number, or are the vertices of a part "
                     "in another unit than mm?",
                     shape->params[k].name);
}

bool sdm_survey_converts(const sdm_shape_survey *s)
{
    for (size_t k = 0; k < s->n_params && s->unit; k++)
        if (s->unit[k].name && !s->unit[k].whole) return true;
    return false;
}

bool sdm_survey_stretches(const sdm_shape_survey *s)
{
    const sdm_survey_unit *u = s->unit && s->n_params ? &s->unit[s->scale.param] : NULL;
    return u && s->scale.odd_speed && u->name && !u->whole && u->mm < 1;
}
