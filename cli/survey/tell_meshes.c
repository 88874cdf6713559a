/* Are the meshes alike, whole, and the right way out? */
#include "teller.h"

#include <math.h>
#include <string.h>

#include "part_turns.h"
#include "report/report_audit.h"
#include "sdm/internal/config.h"

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

/* Appends why a part turns over, and how to mend it. name: the parameter that turns it over; NULL:
 * several do it together. */
static void add_turn_cause(cli_turn_cause cause, const char *name, sdm_text *text)
{
    const char *quote = name ? "'" : "", *word = name ? name : "the parameters";
    switch (cause) {
    case CLI_TURN_ORDER:
        sdm_text_add(text,
                     ": mesh() writes its triangles in another order there: look for an if on "
                     "%s%s%s",
                     quote, word, quote);
        break;
    case CLI_TURN_VERTICES:
        sdm_text_add(text, ": its vertices jump there: look for an if on %s%s%s", quote, word,
                     quote);
        break;
    case CLI_TURN_LENGTH:
        sdm_text_add(text,
                     ": a length of this part becomes negative there; narrow the range%s%s%s, or "
                     "limit the length in mesh()",
                     name ? " of '" : "s", name ? name : "", quote);
    }
}

/* Appends where a part turns over that is right in other shapes. */
static void add_turn(const teller *t, size_t wrong, const sdm_part_audit *audit, sdm_text *text)
{
    const sdm_shape_survey *f = &t->s->found;
    cli_part_turn turn;
    sdm_text_add(text, "in the other shapes the vertices are in the right order: ");
    if (!cli_find_part_turn(t->s->shape, f, wrong, audit, &turn)) {
        sdm_text_add(text,
                     "look in mesh() for an if that swaps them, and for a length that becomes "
                     "negative here");
        return;
    }
    const char *name =
        turn.param < f->n_params ? sdm_instance_params(t->s->shape, NULL)[turn.param].name : NULL;
    if (name && isfinite(turn.back)) {
        sdm_text_add(text, "here part %zu turns over where '%s' is between about %.4g and %.4g",
                     turn.part + 1, name, fmin(turn.value, turn.back), fmax(turn.value, turn.back));
    } else if (name) {
        sdm_text_add(text, "here part %zu turns over where '%s' %s about %.3g", turn.part + 1, name,
                     turn.above ? "rises above" : "falls below", turn.value);
    } else {
        sdm_text_add(text, "part %zu turns over on the way here from ", turn.part + 1);
        teller_add_params(t->s, turn.right, SIZE_MAX, text);
    }
    add_turn_cause(turn.cause, name, text);
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
    sdm_text_add(&text, TELLER_MEND_FIRST);
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

/* Has the mesh with these parameters other triangles than `m`? false: it cannot be made. */
static bool is_rewired(const teller *t, const double *p, const sdm_mesh *m)
{
    sdm_mesh mesh = {0};
    const bool other = !sdm_instance_mesh(t->s->shape, p, &mesh, NULL) &&
                       (mesh.n_vert != m->n_vert || mesh.n_tri != m->n_tri ||
                        memcmp(mesh.tri, m->tri, 3 * m->n_tri * sizeof *m->tri) != 0);
    sdm_mesh_dispose(&mesh);
    return other;
}

/* Appends the parameters of shape `from` that change its triangles by themselves, if they get the
 * values of shape `to`: ": 'a', 'b' change them". Returns how many there are. */
static size_t add_changers(const teller *t, size_t from, size_t to, sdm_text *text)
{
    const sdm_shape_survey *f = &t->s->found;
    const size_t n = f->n_params;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    double p[SDM_MAX_PARAMS];
    sdm_mesh mesh = {0};
    size_t told = 0;
    if (n > SDM_MAX_PARAMS || !teller_make(t->s, from, &mesh, NULL)) return 0;
    for (size_t k = 0; k < n && told < PARAMS_TOLD; k++) {
        memcpy(p, f->p + from * n, n * sizeof *p);
        p[k] = f->p[to * n + k];
        if (p[k] != f->p[from * n + k] && is_rewired(t, p, &mesh))
            sdm_text_add(text, "%s'%s'", told++ ? ", " : ": ", params[k].name);
    }
    if (told) sdm_text_add(text, " change%s them", told > 1 ? "" : "s");
    sdm_mesh_dispose(&mesh);
    return told;
}

/* Appends the parameters that change the triangles between the first shape and another one. */
static void add_cause(const teller *t, size_t other, sdm_text *text)
{
    if (!add_changers(t, other, 0, text)) (void)add_changers(t, 0, other, text);
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
        add_cause(t, f->resized.worst, &text);
        sdm_text_add(
            &text, "; derivatives need the same numbers everywhere: choose them by options, not by "
                   "parameters");
        teller_tell(t, SDM_E_QUALITY, &text);
    } else if (f->rewired.shapes) {
        sdm_text_add(&text, "the triangles get other vertices ");
        teller_add_share(t->s, &f->rewired, &text);
        sdm_text_add(&text, ", for example at ");
        teller_add_params(t->s, f->rewired.worst, SIZE_MAX, &text);
        add_cause(t, f->rewired.worst, &text);
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
