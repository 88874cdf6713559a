/* Lines about the findings of a survey, and the audits of the shapes that they name. */
#include "teller.h"

#include <stdio.h>
#include <stdlib.h>

#include "sdm/internal/clock.h"

void teller_dispose(teller *t)
{
    sdm_part_audit_dispose(&t->audit);
    sdm_mesh_dispose(&t->mesh);
}

void teller_tell_cause(teller *t, sdm_status weight, sdm_text *text)
{
    t->failed = t->failed || text->failed;
    if (!t->failed) t->tell(t->user, weight, text->data);
    sdm_text_dispose(text);
}

void teller_tell(teller *t, sdm_status weight, sdm_text *text)
{
    if (sdm_survey_mend_first(&t->s->found))
        sdm_text_dispose(text);
    else
        teller_tell_cause(t, weight, text);
}

void teller_tell_count(teller *t, sdm_status weight, const sdm_survey_count *c, const char *what)
{
    sdm_text text = {0};
    teller_add_count(t->s, c, what, &text);
    teller_tell(t, weight, &text);
}

void teller_add_params(const cli_survey *s, size_t index, size_t skip, sdm_text *out)
{
    size_t n, told = 0;
    const sdm_param *params = sdm_instance_params(s->shape, &n);
    for (size_t i = 0; i < n && told < PARAMS_TOLD; i++)
        if (i != skip)
            sdm_text_add(out, "%s%s=%.6g", told++ ? " " : "", params[i].name,
                         s->found.p[index * n + i]);
    if (n > PARAMS_TOLD + (skip < n)) sdm_text_add(out, " ...");
}

void teller_add_command(const cli_survey *s, size_t index, const char *what, sdm_text *out)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(s->shape, &n);
    sdm_text_add(out, "exact --shape %s", sdm_instance_shape(s->shape)->name);
    for (size_t i = 0; i < n; i++) {
        const double value = s->found.p[index * n + i];
        char word[32];
        snprintf(word, sizeof word, "%.6g", value);
        // a rounded value must not lie beyond its range
        const double rounded = strtod(word, NULL);
        if (!(rounded >= params[i].min && rounded <= params[i].max))
            snprintf(word, sizeof word, "%.17g", value);
        sdm_text_add(out, " -p %s=%s", params[i].name, word);
    }
    sdm_text_add(out, " %s", what);
}

void teller_add_degrees(const cli_survey *s, sdm_text *text)
{
    size_t n, told = 0;
    const sdm_param *params = sdm_instance_params(s->shape, &n);
    for (size_t i = 0; i < n; i++)
        if (sdm_survey_is_degree(&params[i]))
            sdm_text_add(text, "%s'%s' (%g .. %g %s)", told++ ? ", " : "; does mesh() give ",
                         params[i].name, params[i].min, params[i].max, params[i].unit);
    if (told) sdm_text_add(text, " to cos() or sin()? These want rad (times 0.017453)");
}

bool teller_make(const cli_survey *s, size_t index, sdm_mesh *mesh, sdm_error *err)
{
    return !sdm_instance_mesh(s->shape, s->found.p + index * s->found.n_params, mesh, err);
}

static bool is_late(void *user)
{
    const teller *t = user;
    return sdm_clock() > t->end;
}

const sdm_part_audit *teller_audit(teller *t, size_t index)
{
    const sdm_exact_opts stop = {.cancelled = is_late, .user = t};
    if (t->known && t->shape == index) return &t->audit;
    sdm_part_audit_dispose(&t->audit);
    t->shape = index;
    t->known = !is_late(t) && teller_make(t->s, index, &t->mesh, NULL) &&
               !sdm_part_audit_make(&t->mesh, SDM_AUDIT_WALLS, &stop, &t->audit, NULL);
    return t->known ? &t->audit : NULL;
}

size_t teller_count_tested(const cli_survey *s) { return s->found.n - s->found.untested; }

void teller_add_share(const cli_survey *s, const sdm_survey_count *c, sdm_text *text)
{
    if (c->shapes == teller_count_tested(s))
        sdm_text_add(text, "in all %zu shapes", c->shapes);
    else
        sdm_text_add(text, "in %zu of %zu shapes", c->shapes, teller_count_tested(s));
}

void teller_add_count(const cli_survey *s, const sdm_survey_count *c, const char *what,
                      sdm_text *text)
{
    sdm_text_add(text, "%s ", what);
    teller_add_share(s, c, text);
    sdm_text_add(text, ", up to %.6g at ", c->amount);
    teller_add_params(s, c->worst, SIZE_MAX, text);
}
