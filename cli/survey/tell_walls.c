/* Do walls pass through each other, lie on each other, or vanish beside other parts? */
#include "teller.h"

#include <math.h>

#include "report/report_audit.h"
#include "report/terminal.h"

/* Parts that pass through themselves. */
static void tell_crossing(teller *t)
{
    const sdm_survey_count *c = &t->s->found.crossing;
    if (!c->shapes || t->s->found.inside_out.shapes > 0) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    sdm_text text = {0};
    if (!audit || !cli_describe_folded(audit, &text)) {
        teller_tell_count(t, SDM_E_QUALITY, c, "parts that pass through themselves");
        return;
    }
    sdm_text_add(&text, " (");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, ", most at ");
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, "); slices show it: ");
    teller_add_command(t->s, c->worst, "-o x.png", &text);
    teller_tell(t, SDM_E_QUALITY, &text);
}

/* The parameter of which mesh() seems to convert the length, and which moves this part; n_params:
 * none. */
static size_t converted_param(const sdm_shape_survey *f, size_t part)
{
    for (size_t k = 0; k < f->n_params && f->unit; k++)
        for (size_t i = 0; i < f->unit[k].moved && i < SDM_SURVEY_NAMED; i++)
            if (f->unit[k].name && !f->unit[k].whole && f->unit[k].part[i] == part) return k;
    return f->n_params;
}

/* One line about parts a thousand times shorter than others. */
static void tell_tiny(teller *t)
{
    const sdm_survey_count *c = &t->s->found.tiny;
    sdm_text text = {0};
    size_t part[2] = {0};
    if (!c->shapes || sdm_survey_stretches(&t->s->found)) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    if (!audit || !(sdm_survey_part_lengths(audit, &part[0], &part[1]) > 0)) {
        teller_tell_count(t, SDM_E_QUALITY, c, "parts much smaller than others");
        return;
    }
    cli_name_part(audit, part[0], &text);
    sdm_text_add(&text, "is %.0f times smaller than ", c->amount);
    cli_name_part(audit, part[1], &text);
    sdm_text_add(&text, "at ");
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, " (");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, ")");
    const size_t k = converted_param(&t->s->found, part[0]);
    if (k < t->s->found.n_params)
        sdm_survey_ask_unit(&t->s->found, t->s->shape, k, &text);
    else
        sdm_text_add(&text, ": are the vertices of one of them in another unit than mm? Multiply "
                            "those in m by 1000, those in um by 0.001; if it is a leftover speck, "
                            "remove it");
    teller_tell(t, SDM_E_QUALITY, &text);
}

/* One line about parts without thickness. */
static void tell_flat(teller *t)
{
    const sdm_survey_count *c = &t->s->found.flat;
    sdm_text text = {0};
    size_t i = 0;
    // lengths in m are reported by tell_tiny(), tell_unit(), tell_params() and tell_motion()
    if (!c->shapes || t->s->found.tiny.shapes >= c->shapes || t->s->found.narrow ||
        t->s->found.scale.odd_size || sdm_survey_converts(&t->s->found))
        return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    if (!audit) {
        teller_tell_count(t, SDM_E_QUALITY, c, "parts without thickness");
        return;
    }
    while (i + 1 < audit->n && !sdm_survey_part_is_flat(audit, i)) i++;
    if (audit->part[i].state == SDM_PART_FLAT || audit->part[i].doubled)
        sdm_text_add(&text, "walls lie on each other at ");
    else
        sdm_text_add(&text,
                     "part %zu of %zu has walls %.2g mm apart, less than a thousandth of the "
                     "shape, at ",
                     i + 1, audit->n, audit->part[i].thick);
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, " (");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, "): no grid shows it; let the range of its thickness begin higher, or "
                        "are its vertices in m?");
    teller_tell(t, SDM_E_QUALITY, &text);
}

/* A part that winds around its inside more than once, such as a ring whose angle is too large. */
static void tell_wound(teller *t)
{
    const sdm_survey_count *c = &t->s->found.wound;
    const sdm_status weight = sdm_survey_winds_wrongly(&t->s->found) ? SDM_E_QUALITY : SDM_OK;
    const size_t most = t->s->found.wound_part;
    // in a warning of a training the turns of a spiral are wanted
    if (!c->shapes || (t->s->brief && !weight)) return;
    const sdm_part_audit *audit = teller_audit(t, c->worst);
    if (!audit) {
        teller_tell_count(t, weight, c, "parts that wind around their inside more than once");
        return;
    }
    char number[32];
    sdm_text text = {0};
    cli_name_part(audit, most, &text);
    sdm_text_add(&text,
                 "winds around its inside more than once: it encloses %s mm^3, %.3g times "
                 "the volume that it fills, and %zu pairs of its triangles meet (at ",
                 cli_number(fabs(audit->part[most].volume), 3, number), c->amount,
                 audit->part[most].crossed);
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, "; parts wind more than once ");
    teller_add_share(t->s, c, &text);
    sdm_text_add(&text, ")");
    teller_add_degrees(t->s, &text);
    // the mistake may lie in mesh(), not in a parameter
    if (!t->s->found.scale.degrees)
        sdm_text_add(&text, "; does a tube go round more than once, or is an angle in degrees, "
                            "such as 360 * j / n, given to cos() or sin()? These want rad");
    teller_tell(t, weight, &text);
}

/* Inner walls that pass through each other, and where they begin to. */
static void tell_folded(teller *t)
{
    const sdm_shape_survey *f = &t->s->found;
    const sdm_survey_count *c = &f->folded;
    const sdm_param *params = sdm_instance_params(t->s->shape, NULL);
    sdm_text text = {0};
    // a part whose triangles turn over does the same: tell_inside_out() has told it
    if (!c->shapes || f->inside_out.shapes) return;
    const double *p = f->p + c->worst * f->n_params;
    sdm_text_add(&text, "walls pass through each other ");
    sdm_text_add(&text, "in %zu of the %zu shapes that were followed from the default shape",
                 c->shapes, f->fold_tested);
    sdm_text_add(&text, ": on the way from the default shape to ");
    teller_add_params(t->s, c->worst, SIZE_MAX, &text);
    sdm_text_add(&text, " %.2g %% of the surface turns over, at about", 100 * c->amount);
    for (size_t i = 0; i < f->n_params && i < PARAMS_TOLD; i++)
        sdm_text_add(&text, " %s=%.3g", params[i].name, f->p[i] + f->folded_at * (p[i] - f->p[i]));
    sdm_text_add(&text,
                 "; is a wall thicker than the shape is wide? Narrow the ranges, or limit the "
                 "wall in mesh()");
    teller_tell(t, SDM_E_QUALITY, &text);
}

void tell_walls(teller *t)
{
    tell_crossing(t);
    tell_tiny(t);
    tell_flat(t);
}

void tell_walls_closer(teller *t)
{
    tell_wound(t);
    tell_folded(t);
}
