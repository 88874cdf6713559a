/* Tells the findings from which others follow. */
#include "teller.h"

#include "report/report_audit.h"

sdm_status cli_survey_cause(const cli_survey *s)
{
    const sdm_shape_survey *f = &s->found;
    // where mesh() reads NaN behind the parameters, there is no mesh
    return f->repeat.cause == SDM_REPEAT_BEHIND && f->failed.shapes ? SDM_E_MESH : SDM_E_QUALITY;
}

/* Meshes that are not the same when they are made again. Other findings may follow from it. */
static void tell_repeat(teller *t)
{
    static const char *const where[] = {[SDM_REPEAT_THREADS] = " by several threads at once",
                                        [SDM_REPEAT_PROCESS] =
                                            " in another process, which made another shape first",
                                        [SDM_REPEAT_BESIDE] = NULL}; // has its own text
    const sdm_repeat *r = &t->s->found.repeat;
    const size_t n = t->s->found.n_params;
    sdm_text text = {0};
    // tell_failed() names the vertex that is not written
    if (!r->unlike || (r->cause == SDM_REPEAT_UNSET && t->s->found.failed.shapes)) return;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    if (r->cause == SDM_REPEAT_BEHIND)
        sdm_text_add(&text, "mesh() reads p[%zu], but the last parameter is p[%zu], '%s'; ",
                     r->param, n - 1, params[n - 1].name);
    else if (r->cause == SDM_REPEAT_BESIDE)
        sdm_text_add(&text, SDM_REPEAT_BESIDE_TEXT ", for example at ", params[r->param].name);
    else
        sdm_text_add(&text, "meshes have other bits when they are made again%s, for example at ",
                     where[r->cause] ? where[r->cause] : "");
    if (r->cause != SDM_REPEAT_BEHIND) {
        teller_add_params(t->s, r->first, SIZE_MAX, &text);
        sdm_text_add(&text, "; ");
    }
    sdm_text_add(&text, "%s%s", sdm_repeat_advice(r->cause),
                 r->cause == SDM_REPEAT_THREADS ? "" : TELLER_MEND_FIRST);
    teller_tell_cause(t, cli_survey_cause(t->s), &text);
}

/* An angle in degrees that turns the surface by 57.3 times as many degrees, or as few. */
static void tell_turns(const sdm_survey_scale *c, const sdm_param *p, sdm_text *text)
{
    const double width = p->max - p->min;
    sdm_text_add(text,
                 "over its range of %g %s the parameter '%s' turns the surface at vertex %zu by "
                 "%.3g degrees: ",
                 width, p->unit, p->name, c->spin_vertex, c->turns * width);
    if (c->turns > 1)
        sdm_text_add(
            text,
            "are degrees taken for rad in mesh()? cos() and sin() want rad: multiply '%s' "
            "by 0.017453, or, if its range is in rad, give it the unit \"rad\"" TELLER_MEND_FIRST,
            p->name);
    else
        sdm_text_add(text,
                     "does mesh() multiply '%s' by 0.017453 twice? Once makes rad of "
                     "degrees" TELLER_MEND_FIRST,
                     p->name);
}

/* An angle in degrees that goes to cos() or sin(). Other findings may follow from it. */
static void tell_swings(teller *t)
{
    const sdm_survey_scale *c = &t->s->found.scale;
    const sdm_param *p = &sdm_instance_params(t->s->shape, NULL)[c->angle];
    sdm_text text = {0};
    if (!c->swings) return;
    if (c->turns > 0)
        tell_turns(c, p, &text);
    else if (c->spins)
        sdm_text_add(&text,
                     "over its range of %g rad the parameter '%s' turns vertex %zu by %.3g rad: "
                     "are degrees taken for rad in mesh()? cos() and sin() want rad: do not "
                     "multiply '%s' by 57.3" TELLER_MEND_FIRST,
                     p->max - p->min, p->name, c->spin_vertex,
                     SDM_SURVEY_DEGREES * (p->max - p->min), p->name);
    else if (c->poles)
        sdm_text_add(
            &text,
            "the vertices move beyond all bounds %zu times, at %.4g, %.4g and so on, while the "
            "parameter '%s' goes from %g to %g%s%s, as tan() of so many rad does",
            c->swings, c->pole[0], c->pole[1], p->name, p->min, p->max, *p->unit ? " " : "",
            p->unit);
    else
        sdm_text_add(
            &text,
            "the vertices turn back %zu times while the parameter '%s' goes from %g to %g%s%s, as "
            "cos() and sin() of so many rad do",
            c->swings, p->name, p->min, p->max, *p->unit ? " " : "", p->unit);
    if (!c->spins && !(c->turns > 0))
        sdm_text_add(&text, "; if these are degrees, multiply them by 0.017453 in "
                            "mesh()" TELLER_MEND_FIRST);
    teller_tell_cause(t, SDM_E_QUALITY, &text);
}

/* Vertices of no triangle. Other findings may follow from them. */
static void tell_unused(teller *t)
{
    const sdm_survey_count *c = &t->s->found.unused;
    if (!c->shapes) return;
    sdm_mesh mesh = {0};
    sdm_part_audit audit = {0};
    sdm_text text = {0};
    if (teller_make(t->s, c->worst, &mesh, NULL) && !sdm_part_audit_unused(&mesh, &audit, NULL))
        cli_describe_unused(&audit, &text);
    sdm_mesh_dispose(&mesh);
    sdm_text_add(&text, " (");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, ")" TELLER_MEND_FIRST);
    teller_tell_cause(t, SDM_E_QUALITY, &text);
}

void tell_causes(teller *t)
{
    tell_repeat(t);
    tell_swings(t);
    tell_unused(t);
}
