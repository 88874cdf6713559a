/* Are the meshes alike, whole, and the right way out? */
#include "teller.h"

#include "part_turns.h"
#include "report/report_audit.h"

static void tell_failed(teller *t)
{
    const sdm_survey_count *c = &t->s->found.failed;
    sdm_mesh mesh = {0};
    sdm_error why = {0};
    sdm_text text = {0};
    if (!c->shapes) return;
    sdm_text_add(&text, "no mesh ");
    teller_add_share(t->s, c, &text);
    // the audit refuses some meshes that a shape can make
    if (teller_make(t->s, c->worst, &mesh, &why))
        (void)sdm_mesh_audit(&mesh, &(sdm_audit){0}, &why);
    sdm_mesh_dispose(&mesh);
    sdm_text_add(&text, ": %s", why.text);
    teller_tell(t, SDM_E_MESH, &text);
}

static void tell_open(teller *t)
{
    sdm_text text = {0};
    const sdm_survey_count *c = &t->s->found.open;
    if (!c->shapes) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    teller_add_count(t->s, c, "open or badly oriented edges", &text);
    sdm_text_add(&text, ": ");
    if (audit) cli_describe_open(audit, &text);
    teller_tell(t, SDM_E_MESH, &text);
}

/* Appends where a part turns over that is right in other shapes: by itself, a length that becomes
 * negative does that. */
static void add_turn(const teller *t, size_t wrong, const sdm_part_audit *audit, sdm_text *text)
{
    const sdm_shape_survey *f = &t->s->found;
    cli_part_turn turn;
    sdm_text_add(text, "in the other shapes the vertices are in the right order: ");
    if (!cli_find_part_turn(t->s->shape, f, wrong, audit, &turn)) {
        sdm_text_add(text, "a length of the part becomes negative here; narrow the ranges, or "
                           "limit the length in mesh()");
        return;
    }
    const bool one = turn.param < f->n_params;
    const char *name = one ? sdm_instance_params(t->s->shape, NULL)[turn.param].name : "";
    if (one) {
        sdm_text_add(text, "here part %zu turns over where '%s' %s about %.3g", turn.part + 1, name,
                     turn.above ? "rises above" : "falls below", turn.value);
    } else {
        sdm_text_add(text, "part %zu turns over on the way here from ", turn.part + 1);
        teller_add_params(t->s, turn.right, SIZE_MAX, text);
    }
    sdm_text_add(text,
                 ": a length of this part becomes negative there; narrow the range%s%s%s, or "
                 "limit the length in mesh()",
                 one ? " of '" : "s", name, one ? "'" : "");
}

static void tell_inside_out(teller *t)
{
    const sdm_survey_count *c = &t->s->found.inside_out;
    if (!c->shapes) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    if (!audit) {
        teller_tell_count(t, SDM_E_QUALITY, c, "parts that are inside out");
        return;
    }
    sdm_text text = {0};
    cli_describe_inside_out(audit, &text);
    // in other shapes it may be another part
    sdm_text_add(&text, " (at ");
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, "; parts are inside out ");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, "); ");
    if (c->shapes == teller_count_tested(t->s))
        sdm_text_add(&text, CLI_MEND_SHAPE);
    else
        add_turn(t, c->worst, audit, &text);
    teller_tell(t, SDM_E_QUALITY, &text);
}

static void tell_turned(teller *t)
{
    const sdm_survey_count *c = &t->s->found.turned;
    sdm_text text = {0};
    if (!c->shapes || t->s->found.inside_out.shapes > 0) return; // tell_inside_out() has told them
    teller_add_count(t->s, c, "parts that are inside out and that the exact engine turns", &text);
    sdm_text_add(&text, "; for each of these parts: " CLI_MEND_SHAPE);
    teller_tell(t, SDM_E_QUALITY, &text);
}

void tell_sizes(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    sdm_text text = {0};
    if (f->resized.shapes) {
        sdm_text_add(&text,
                     "the numbers of vertices and triangles change: %zu and %zu at first, others ",
                     f->n_vert, f->n_tri);
        teller_add_share(t->s, &f->resized, &text);
        sdm_text_add(&text, ", for example %.0f vertices at ", f->resized.amount);
        teller_add_params(t->s, f->resized.worst, SIZE_MAX, &text);
        sdm_text_add(
            &text, "; derivatives need the same numbers everywhere: choose them by options, not by "
                   "parameters");
        teller_tell(t, SDM_E_QUALITY, &text);
    } else if (f->rewired.shapes) {
        sdm_text_add(&text, "the triangles get other vertices ");
        teller_add_share(t->s, &f->rewired, &text);
        sdm_text_add(&text, ", for example at ");
        teller_add_params(t->s, f->rewired.worst, SIZE_MAX, &text);
        sdm_text_add(&text, "; derivatives need the same triangles everywhere");
        teller_tell(t, SDM_E_QUALITY, &text);
    }
}

void tell_parts(teller *t)
{
    tell_failed(t);
    tell_open(t);
    tell_inside_out(t);
    tell_turned(t);
}
