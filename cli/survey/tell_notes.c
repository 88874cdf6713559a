/* Tells what is no mistake by itself: triangles that meet, and groups of parts. */
#include "teller.h"

#include "report/report_audit.h"

/* A part that meets itself in a smaller share of its surface is not named. */
#define CROSSING_MIN 1e-3

/* Appends "; 12 of them within part 1 of 2 (...) alone; ..." about the part of shape `c->worst`
 * that meets itself most. */
static void add_crossed(teller *t, const sdm_survey_count *c, sdm_text *text)
{
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    const sdm_part *most = NULL;
    for (size_t i = 0; audit && i < audit->n; i++) {
        const sdm_part *p = &audit->part[i];
        if (p->crossing >= CROSSING_MIN && p->overlaps > (most ? most->overlaps : 0)) most = p;
    }
    if (!most) return;
    sdm_text_add(text, "; %zu of them within ", most->overlaps);
    cli_name_part(audit, (size_t)(most - audit->part), text);
    sdm_text_add(text, "alone (%.2g %% of its surface); to see what faces the wrong way there: ",
                 100 * most->crossing);
    teller_add_command(t->s, c->worst, "--certify -o x.nrrd", text);
}

void tell_overlaps(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const struct {
        const sdm_survey_count *count;
        const char *what, *after;
    } notes[] = {{&f->overlaps, "overlaps (pairs of triangles that meet)", ": the union counts"},
                 {&f->degenerate, "triangles without area", ""},
                 {&f->duplicate, "triangles given twice", ": they count once"}};
    for (size_t i = 0; i < sizeof notes / sizeof *notes; i++) {
        sdm_text text = {0};
        const size_t n = notes[i].count->shapes;
        // where all shapes overlap themselves, it is likely to be wanted
        if (!n || (notes[i].count == &f->overlaps && t->s->brief && n == f->n)) continue;
        teller_add_count(t->s, notes[i].count, notes[i].what, &text);
        sdm_text_add(&text, "%s", notes[i].after);
        const bool twins = notes[i].count == &f->duplicate && sdm_survey_has_twins(f);
        if (twins) sdm_text_add(&text, "; do two parts lie in the same place?");
        if (notes[i].count == &f->overlaps) add_crossed(t, notes[i].count, &text);
        // the first shape with overlaps is not the default shape
        if (notes[i].count == &f->overlaps && f->overlaps_begin)
            sdm_text_add(&text,
                         "; the default shape has none: look at slices there (exact -o x.png)");
        teller_tell(t, twins ? SDM_E_QUALITY : SDM_OK, &text);
    }
}

/* Groups of parts that meet no other group, the smallest of one shape, and how far it lies from the
 * others. */
static void tell_apart(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    sdm_text text = {0};
    if (!f->apart.shapes) return;
    teller_add_count(t->s, &f->apart, "groups of parts that meet no other part", &text);
    sdm_text_add(&text, ": ");
    const sdm_part_audit *audit = teller_audit(t, f->apart.worst);
    if (audit) cli_describe_apart(&t->mesh, audit, &text);
    teller_tell(t, SDM_OK, &text);
}

/* Two parts that meet in some of the shapes: where they begin to, and which parameter decides. */
static void tell_meeting(teller *t)
{
    const sdm_survey_meeting *c = &t->s->found.meeting;
    sdm_text text = {0};
    // a part that is inside out may take the surface away where it meets another one
    if (!c->pairs || t->s->found.inside_out.shapes) return;
    const sdm_part_audit *audit = teller_audit(t, c->shape[1]);
    if (audit && c->part[1] < audit->n) {
        for (int i = 0; i < 2; i++) {
            sdm_text_add(&text, "%s", i ? "and " : "");
            cli_name_part(audit, c->part[i], &text);
        }
        sdm_text_add(&text, "meet in %zu of %zu shapes and lie apart in the others: ", c->meet,
                     c->meet + c->apart);
        const char *name = sdm_instance_params(t->s->shape, NULL)[c->param].name;
        if (10 * c->odd <= c->meet + c->apart) {
            sdm_text_add(&text, "'%s' decides, they meet %s about %s=%.3g", name,
                         c->below ? "up to" : "from", name, c->value);
        } else {
            sdm_text_add(&text, "they meet at ");
            teller_add_params(t->s, c->shape[1], SIZE_MAX, &text);
            sdm_text_add(&text, ", not at ");
            teller_add_params(t->s, c->shape[0], SIZE_MAX, &text);
        }
        if (c->pairs > 1) sdm_text_add(&text, "; so do %zu other pairs of parts", c->pairs - 1);
        sdm_text_add(&text,
                     "; the surface joins or splits there, where a network errs most: if this is "
                     "not meant, narrow the ranges");
        teller_tell(t, SDM_OK, &text);
    }
}

void tell_groups(teller *t)
{
    tell_apart(t);
    tell_meeting(t);
}
