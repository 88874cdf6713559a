/* Looks whether the vertices of a family of shapes are in mm: by the size of the shapes, and by how
 * far a parameter in mm moves the vertices. */
#include "survey_scale.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/units.h"
#include "sdm/memory.h"
#include "survey_pole.h"
#include "survey_swing.h"

/* rad; larger angles are likely to be degrees. */
static const double ANGLE_MAX = 30;

/* The step of a parameter, as a fraction of its range. */
static const double STEP = 0.01;

/* Samples at which the speed of slow parameters is measured again. */
enum { SLOW_SAMPLES = 3 };

bool sdm_survey_is_length(const sdm_instance *shape, size_t k)
{
    return !strcmp(shape->params[k].unit, "mm");
}

bool sdm_survey_is_faint(const sdm_shape_survey *s, const sdm_instance *shape, size_t k)
{
    const sdm_param *p = &shape->params[k];
    return !strcmp(p->unit, "rad") && s->speed[k] > 0 &&
           s->speed[k] * fmax(1, p->max - p->min) < SDM_SURVEY_FAINT * s->scale.size;
}

bool sdm_survey_is_slow(const sdm_shape_survey *s, const sdm_instance *shape, size_t k)
{
    return s->speed[k] == 0 ||
           (sdm_survey_is_length(shape, k) && s->speed[k] < SDM_SURVEY_SPEED_SLOW) ||
           sdm_survey_is_faint(s, shape, k);
}

bool sdm_survey_is_narrow(const sdm_shape_survey *s, const sdm_instance *shape, size_t k)
{
    const sdm_param *p = &shape->params[k];
    const double size = s->scale.size, value = fmax(fabs(p->min), fabs(p->max));
    return sdm_survey_is_length(shape, k) && s->speed[k] > 0 && value < SDM_SURVEY_VALUE * size &&
           s->speed[k] * (p->max - p->min) < SDM_SURVEY_NARROW * size;
}

/* *speed = how far a vertex moves, at most, from the mesh `here` to the mesh with parameter k at
 * `value` and the others as in p[], divided by `change`, that of the parameter; NaN: not known. */
static sdm_status measure_speed(const shape_family *f, const double *p, size_t k, double value,
                                double change, const sdm_mesh *here, sdm_mesh *there, double *speed,
                                sdm_error *err)
{
    double moved[SHAPE_PARAMS_MAX], square = 0;
    *speed = NAN;
    memcpy(moved, p, f->shape->n_params * sizeof *moved);
    moved[k] = value;
    if (!(change > 0)) return SDM_OK;
    const sdm_status s = sdm_instance_mesh(f->shape, moved, there, err);
    if (s || there->n_vert != here->n_vert) return s == SDM_E_NOMEM ? s : SDM_OK;
    for (size_t v = 0; v < here->n_vert; v++) {
        double sum = 0;
        for (size_t i = 3 * v; i < 3 * v + 3; i++)
            sum += (there->vert[i] - here->vert[i]) * (there->vert[i] - here->vert[i]);
        square = fmax(square, sum);
    }
    *speed = sqrt(square) / change;
    return SDM_OK;
}

/* *speed = how far a vertex moves per unit of parameter k beside p[], whose mesh is `here`. */
static sdm_status speed_beside(const shape_family *f, const double *p, size_t k,
                               const sdm_mesh *here, sdm_mesh *there, double *speed, sdm_error *err)
{
    const double step = STEP * (f->max[k] - f->min[k]);
    const double value = p[k] + (p[k] + step <= f->max[k] ? step : -step);
    return measure_speed(f, p, k, value, fabs(value - p[k]), here, there, speed, err);
}

/* Measures parameter k again, which moves nothing beside the shapes so far: a parameter with a
 * threshold moves vertices only there. The speed becomes the largest motion from the first shape to
 * a quarter of the range, over the width of the range; NaN if the mesh gets other vertices. */
static sdm_status measure_threshold(const shape_family *f, sdm_shape_survey *s, size_t k,
                                    sdm_error *err)
{
    enum { QUARTERS = 4 };
    sdm_mesh here = {0}, there = {0};
    sdm_status status = sdm_instance_mesh(f->shape, s->p, &here, err);
    for (int i = 0; i <= QUARTERS && !status; i++) {
        const double width = f->max[k] - f->min[k], value = f->min[k] + width * i / QUARTERS;
        double speed;
        status = measure_speed(f, s->p, k, value, width, &here, &there, &speed, err);
        if (!(speed * width <= 1e-9 * s->scale.size) && !(speed <= s->speed[k]))
            s->speed[k] = speed;
    }
    sdm_mesh_dispose(&there);
    sdm_mesh_dispose(&here);
    return status == SDM_E_NOMEM ? status : SDM_OK;
}

/* Raises the speeds s->speed[] of the parameters that are slow so far by those beside shape
 * `shape`. */
static sdm_status raise_speeds(const shape_family *f, sdm_shape_survey *s, size_t shape,
                               sdm_error *err)
{
    const double *p = s->p + shape * s->n_params;
    sdm_mesh here = {0}, there = {0};
    sdm_status status = sdm_instance_mesh(f->shape, p, &here, err);
    for (size_t k = 0; k < s->n_params && !status; k++) {
        double speed;
        if (shape && !sdm_survey_is_slow(s, f->shape, k)) continue;
        status = speed_beside(f, p, k, &here, &there, &speed, err);
        if (speed * (f->max[k] - f->min[k]) <= 1e-9 * s->scale.size) speed = 0;
        s->speed[k] = fmax(s->speed[k], speed); // fmax() ignores NaN
    }
    sdm_mesh_dispose(&there);
    sdm_mesh_dispose(&here);
    return status == SDM_E_NOMEM ? status : SDM_OK;
}

/* Measures the speeds and sets speed and param: the fastest parameter in mm. */
static sdm_status find_speed(const shape_family *f, sdm_shape_survey *s, sdm_error *err)
{
    sdm_status status = SDM_OK;
    for (size_t i = 0; i <= SLOW_SAMPLES && i <= s->n_samples && !status; i++)
        status = raise_speeds(f, s, i ? s->n - i : 0, err);
    for (size_t k = 0; k < s->n_params && !status; k++)
        if (s->speed[k] == 0) status = measure_threshold(f, s, k, err);
    for (size_t k = 0; k < s->n_params; k++)
        if (sdm_survey_is_length(f->shape, k) && isfinite(s->speed[k]) &&
            !(s->speed[k] <= s->scale.speed))
            s->scale.speed = s->speed[k], s->scale.param = k;
    for (size_t k = 0; k < s->n_params; k++) {
        s->slow += sdm_survey_is_slow(s, f->shape, k);
        s->narrow += sdm_survey_is_narrow(s, f->shape, k);
    }
    return status;
}

bool sdm_survey_is_odd_angle(const sdm_param *p)
{
    return !strcmp(p->unit, "rad") && !(p->max <= ANGLE_MAX && p->min >= -ANGLE_MAX);
}

/* Is the value, not 0, a multiple of pi / 12 to three digits, but no number of halves? */
static bool is_part_of_turn(double value)
{
    static const double PART = 0.26179938779914944, NEAR = 6e-4;
    const double turn = PART * nearbyint(value / PART), half = 0.5 * nearbyint(2 * value);
    return fabs(turn) > 0.1 && fabs(value - turn) < NEAR * fabs(turn) && fabs(value - half) > 1e-3;
}

/* Is the unit deg or degrees? */
static bool is_degrees(const sdm_param *p)
{
    return !strcmp(p->unit, "deg") || !strcmp(p->unit, "degrees");
}

static bool is_within_turn(const sdm_param *p)
{
    static const double TURN = 6.29;
    return p->min >= -TURN && p->max <= TURN;
}

bool sdm_survey_is_degree(const sdm_param *p) { return is_degrees(p) && !is_within_turn(p); }

bool sdm_survey_is_radian(const sdm_param *p)
{
    return is_degrees(p) && is_within_turn(p) &&
           (is_part_of_turn(p->min) || is_part_of_turn(p->max));
}

bool sdm_survey_is_other_length(const sdm_param *p)
{
    static const char *const LENGTHS[] = {"m", "cm", "um", "km", "in", "inch", "inches"};
    for (size_t i = 0; i < sizeof LENGTHS / sizeof *LENGTHS; i++)
        if (!strcmp(p->unit, LENGTHS[i])) return true;
    return false;
}

sdm_status sdm_survey_measure_scale(const shape_family *f, sdm_shape_survey *s, sdm_error *err)
{
    sdm_survey_scale *c = &s->scale;
    *c = (sdm_survey_scale){.speed = NAN};
    sdm_status status = SDM_ALLOC(&s->speed, s->n_params, "speeds of parameters", err);
    if (!status) status = SDM_ALLOC(&s->unit, s->n_params, "units of parameters", err);
    for (size_t k = 0; k < s->n_params && !status; k++) {
        s->speed[k] = NAN;
        const sdm_param *p = &f->shape->params[k];
        c->odd_angle = c->odd_angle || sdm_survey_is_odd_angle(p) || sdm_survey_is_radian(p);
        c->other_length = c->other_length || sdm_survey_is_other_length(p);
        c->degrees = c->degrees || sdm_survey_is_degree(p);
    }
    if (status || s->failed.shapes == s->n - s->untested) return status;
    for (int a = 0; a < 3; a++) c->size = fmax(c->size, s->high[a] - s->low[a]);
    c->odd_size = c->size < SDM_SURVEY_SIZE_MIN || c->size > SDM_SURVEY_SIZE_MAX;
    status = find_speed(f, s, err);
    for (size_t k = 0; k < s->n_params && !status && !c->swings; k++) {
        status = sdm_survey_poles(f, s->p, k, c->pole, &c->swings, err);
        c->poles = c->swings > 0;
        if (!status && !c->poles) status = sdm_survey_swings(f, s->p, k, &c->swings, err);
        if (!status && !c->swings)
            status = sdm_survey_spins(f, s->p, k, &c->spins, &c->spin_vertex, err);
        if (c->spins) c->swings = (size_t)ceil((f->max[k] - f->min[k]) / SDM_SURVEY_SPIN);
        const sdm_param *p = &f->shape->params[k];
        if (!status && !c->swings && is_degrees(p) && !sdm_survey_is_radian(p))
            status = sdm_survey_turns(f, s->p, k, &c->turns, &c->spin_vertex, err);
        if (c->turns > 0) c->swings = (size_t)ceil(c->turns * (f->max[k] - f->min[k]) / 360);
        c->angle = k;
    }
    if (status) return status;
    c->odd_speed =
        c->speed > 0 && (c->speed < SDM_SURVEY_SPEED_MIN || c->speed > SDM_SURVEY_SPEED_MAX);
    // a parameter in mm that moves the vertices by about as many mm: they are in mm, too
    if (c->speed > 0 && !c->odd_speed && !c->degrees && !c->swings) c->odd_size = false;
    if (c->odd_speed)
        c->unit = sdm_unit_near(1 / c->speed, &c->unit_mm);
    else if (c->odd_size && isnan(c->speed))
        c->unit = sdm_unit_near(c->size < SDM_SURVEY_SIZE_MIN ? 1e3 : 1e-3, &c->unit_mm);
    return SDM_OK;
}
