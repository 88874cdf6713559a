/* Looks whether the vertices of a family of shapes are in mm: by the size of the shapes, and by how
 * far a parameter in mm moves the vertices. */
#include "survey_scale.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/units.h"

/* The step of a parameter, as a fraction of its range. */
static const double STEP = 0.01;

/* *speed = how far a vertex moves per unit of parameter k beside p[], at most; NaN: not known. */
static sdm_status measure_speed(const shape_family *f, const double *p, size_t k,
                                const sdm_mesh *here, sdm_mesh *there, double *speed,
                                sdm_error *err)
{
    double moved[SHAPE_PARAMS_MAX], square = 0;
    const double step = STEP * (f->max[k] - f->min[k]);
    *speed = NAN;
    memcpy(moved, p, f->shape->n_params * sizeof *moved);
    moved[k] += moved[k] + step <= f->max[k] ? step : -step;
    if (!(step > 0)) return SDM_OK;
    const sdm_status s = sdm_instance_mesh(f->shape, moved, there, err);
    if (s || there->n_vert != here->n_vert) return s == SDM_E_NOMEM ? s : SDM_OK;
    for (size_t v = 0; v < here->n_vert; v++) {
        double sum = 0;
        for (size_t i = 3 * v; i < 3 * v + 3; i++)
            sum += (there->vert[i] - here->vert[i]) * (there->vert[i] - here->vert[i]);
        square = fmax(square, sum);
    }
    *speed = sqrt(square) / fabs(moved[k] - p[k]);
    return SDM_OK;
}

/* Sets speed and param. */
static sdm_status find_speed(const shape_family *f, const double *p, sdm_survey_scale *out,
                             sdm_error *err)
{
    sdm_mesh here = {0}, there = {0};
    sdm_status s = sdm_instance_mesh(f->shape, p, &here, err);
    out->speed = NAN;
    for (size_t k = 0; k < f->shape->n_params && !s; k++) {
        double speed;
        if (strcmp(f->shape->params[k].unit, "mm")) continue;
        s = measure_speed(f, p, k, &here, &there, &speed, err);
        if (isfinite(speed) && !(speed <= out->speed)) out->speed = speed, out->param = k;
    }
    sdm_mesh_dispose(&there);
    sdm_mesh_dispose(&here);
    return s == SDM_E_NOMEM ? s : SDM_OK;
}

sdm_status sdm_survey_measure_scale(const shape_family *f, sdm_shape_survey *s, sdm_error *err)
{
    sdm_survey_scale *c = &s->scale;
    *c = (sdm_survey_scale){.speed = NAN};
    if (s->failed.shapes == s->n) return SDM_OK;
    for (int a = 0; a < 3; a++) c->size = fmax(c->size, s->high[a] - s->low[a]);
    c->odd_size = c->size < SDM_SURVEY_SIZE_MIN || c->size > SDM_SURVEY_SIZE_MAX;
    const sdm_status status = find_speed(f, s->p, c, err);
    if (status) return status;
    c->odd_speed =
        c->speed > 0 && (c->speed < SDM_SURVEY_SPEED_MIN || c->speed > SDM_SURVEY_SPEED_MAX);
    if (c->odd_speed)
        c->unit = sdm_unit_near(1 / c->speed, &c->unit_mm);
    else if (c->odd_size)
        c->unit = sdm_unit_near(c->size < SDM_SURVEY_SIZE_MIN ? 1e3 : 1e-3, &c->unit_mm);
    return SDM_OK;
}
