/* Do the parameters move the vertices, smoothly, and are lengths in mm and angles in rad? */
#include "teller.h"

#include <string.h>

/* One line if the vertices are hardly in mm. */
void tell_unit(teller *t)
{
    const sdm_survey_scale *c = &t->s->found.scale;
    sdm_text text = {0};
    // the size and the speed are those of a part in another unit: tell_tiny() has told it
    if (!c->odd_size && !c->odd_speed) return;
    if (t->s->found.tiny.shapes && !sdm_survey_stretches(&t->s->found)) return;
    if (c->odd_size) sdm_text_add(&text, "the shape is %.3g mm in size", c->size);
    if (c->odd_speed)
        sdm_text_add(&text, "%s1 mm of the parameter '%s' moves its vertices by %.2g mm",
                     c->odd_size ? ", " : "", sdm_instance_params(t->s->shape, NULL)[c->param].name,
                     c->speed);
    sdm_text_add(&text, "; the unit of sdmgen is mm");
    // an angle in degrees that tan() or a division makes huge
    if (c->degrees && c->size > SDM_SURVEY_SIZE_MAX)
        teller_add_degrees(t->s, &text);
    else if (c->odd_speed && !c->swings)
        sdm_survey_ask_unit(&t->s->found, t->s->shape, c->param, &text);
    else if (c->unit && !c->swings)
        sdm_text_add(&text, ": are the vertices in %s? Multiply them by %g", c->unit, c->unit_mm);
    teller_tell(t, SDM_E_QUALITY, &text);
}

/* Parameters that hardly move a vertex, angles in degrees, and units that sdmgen does not know. */
void tell_params(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    for (size_t k = 0; k < f->n_params; k++) {
        const char *unit = params[k].unit;
        sdm_text slow = {0}, other = {0};
        if (f->speed[k] == 0) {
            sdm_text_add(&slow, "the parameter '%s' moves no vertex: does mesh() use it?",
                         params[k].name);
            teller_tell_cause(t, SDM_E_QUALITY, &slow);
        } else if (sdm_survey_is_narrow(f, t->s->shape, k) && !sdm_survey_stretches(f)) {
            sdm_text_add(&slow,
                         "the parameter '%s' ranges from %g to %g mm, which moves no vertex of a "
                         "shape of %.3g mm by more than %.2g mm",
                         params[k].name, params[k].min, params[k].max, f->scale.size,
                         f->speed[k] * (params[k].max - params[k].min));
            // an angle that is taken for rad makes shapes too large
            if (f->scale.degrees)
                teller_add_degrees(t->s, &slow);
            else if (!f->scale.swings)
                sdm_text_add(&slow, ": are these m (times 1000)?");
            teller_tell(t, SDM_E_QUALITY, &slow);
        }
        // tell_swings() has named it
        if (f->scale.swings && f->scale.angle == k) continue;
        if (sdm_survey_is_odd_angle(&params[k])) {
            sdm_text_add(&other,
                         "the parameter '%s' ranges from %g to %g rad: are these degrees (times "
                         "0.017453)?",
                         params[k].name, params[k].min, params[k].max);
            teller_tell_cause(t, SDM_E_QUALITY, &other);
        }
        if (sdm_survey_is_radian(&params[k])) {
            sdm_text_add(&other,
                         "the parameter '%s' has the unit %s, but ranges from %g to %g: are these "
                         "rad? Then its unit is \"rad\"",
                         params[k].name, unit, params[k].min, params[k].max);
            teller_tell_cause(t, SDM_E_QUALITY, &other);
            continue;
        }
        if (sdm_survey_is_other_length(&params[k])) {
            sdm_text_add(&other,
                         "the parameter '%s' has the unit %s: sdmgen counts in mm; give its range, "
                         "its default and its unit in mm",
                         params[k].name, unit);
            teller_tell_cause(t, SDM_E_QUALITY, &other);
            continue;
        }
        if (t->s->brief || !strcmp(unit, "mm") || !strcmp(unit, "rad") || !strcmp(unit, "sd") ||
            !*unit)
            continue;
        sdm_text_add(&other,
                     "the unit '%s' of the parameter '%s' is none that sdmgen knows: mm, rad, sd "
                     "(standard deviations) or none at all",
                     unit, params[k].name);
        if (sdm_survey_is_degree(&params[k]))
            sdm_text_add(&other,
                         "; mesh() must multiply it by 0.017453 before it calls cos() or sin()");
        teller_tell_cause(t, SDM_OK, &other);
    }
}

/* Tells that the meshes just below and just above a value of parameter k depend on the calls of
 * mesh() before them. */
static void tell_state(teller *t, const sdm_survey_jump *j, size_t k)
{
    sdm_text text = {0};
    sdm_text_add(&text, "mesh() depends on an earlier call about %s=%.6g%s",
                 sdm_instance_params(t->s->shape, NULL)[k].name, j->value,
                 t->s->found.n_params > 1 ? ", with " : "");
    teller_add_params(t->s, j->shape, k, &text);
    sdm_text_add(&text,
                 ": meshes there have other bits when they are made again in another order; "
                 "%s",
                 sdm_repeat_advice(SDM_REPEAT_BESIDE));
    teller_tell(t, SDM_E_QUALITY, &text);
}

static void tell_jumps(teller *t)
{
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    for (size_t k = 0; k < t->s->found.n_params && t->s->found.jump; k++) {
        const sdm_survey_jump *j = &t->s->found.jump[k];
        sdm_text text = {0};
        if (j->kind == SDM_BREAK_STATE) tell_state(t, j, k);
        if (j->kind == SDM_BREAK_NONE || j->kind == SDM_BREAK_STATE) continue;
        if (j->kind == SDM_BREAK_JUMP)
            sdm_text_add(&text, "vertex %zu jumps by %.3g mm", j->vertex, j->mm);
        else
            sdm_text_add(&text, "the %s",
                         j->kind == SDM_BREAK_SIZES ? "number of vertices or triangles changes"
                                                    : "triangles change");
        sdm_text_add(&text, " at %s=%.6g%s", params[k].name, j->value,
                     t->s->found.n_params > 1 ? ", with " : "");
        teller_add_params(t->s, j->shape, k, &text);
        sdm_text_add(&text, "; a network cannot learn jumps");
        teller_tell(t, SDM_E_QUALITY, &text);
    }
}

/* Parameters that move no surface, or hardly a vertex. */
static void tell_slow(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    for (size_t k = 0; k < f->n_params; k++) {
        sdm_text slow = {0};
        // all parameters are slow if the vertices are in another unit: tell_unit() says so; one
        // with a threshold moves vertices there alone: tell_jumps()
        const bool jumps = f->jump && f->jump[k].kind != SDM_BREAK_NONE;
        if (f->speed[k] == 0) continue;
        if (f->still && f->still[k]) {
            sdm_text_add(
                &slow,
                "the parameter '%s' moves no part of the surface: it moves vertices inside "
                "of other parts alone",
                params[k].name);
            teller_tell(t, SDM_E_QUALITY, &slow);
        } else if (sdm_survey_is_faint(f, t->s->shape, k) && !f->scale.odd_speed && !jumps) {
            sdm_text_add(&slow,
                         "the parameter '%s' ranges from %g to %g rad, which moves no vertex of a "
                         "shape of %.3g mm by more than %.2g mm: does mesh() multiply it by "
                         "0.017453, as if it were in degrees?",
                         params[k].name, params[k].min, params[k].max, f->scale.size,
                         f->speed[k] * (params[k].max - params[k].min));
            teller_tell(t, SDM_E_QUALITY, &slow);
        } else if (sdm_survey_is_slow(f, t->s->shape, k) && !f->scale.odd_speed && !jumps) {
            sdm_survey_add_slow(f, t->s->shape, k, &slow);
            teller_tell(t, SDM_E_QUALITY, &slow);
        }
    }
}

/* Lengths that move one part as a length in m does. */
static void tell_mixed(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    for (size_t k = 0; k < f->n_params && f->unit; k++) {
        const sdm_survey_unit *u = &f->unit[k];
        sdm_text text = {0};
        if (!(u->mixed > 0)) continue;
        sdm_text_add(&text,
                     "'%s' moves part %zu by %.2g mm per mm, part %zu by %.2g: is it in m in one "
                     "place?",
                     sdm_instance_params(t->s->shape, NULL)[k].name, u->mixed_part + 1, u->mixed,
                     u->fair_part + 1, u->fair);
        teller_tell(t, SDM_OK, &text);
    }
}

static void tell_callbacks(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    if (f->velocity_error > SDM_SURVEY_VELOCITY_LIMIT) {
        sdm_text text = {0};
        sdm_text_add(&text,
                     "velocity() is off by %.3g of the largest velocity by %s, at vertex %zu and ",
                     f->velocity_error, params[f->velocity_param].name, f->velocity_vertex);
        teller_add_params(t->s, f->velocity_shape, SIZE_MAX, &text);
        sdm_text_add(&text, "; compared with differences of meshes");
        teller_tell(t, SDM_E_QUALITY, &text);
    }
}

void tell_motion(teller *t)
{
    tell_jumps(t);
    tell_slow(t);
    tell_callbacks(t);
    tell_mixed(t);
}
