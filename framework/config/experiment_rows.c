/* Makes the rows of an experiment's table: one per method and variant, with title, folder and
 * reference figures. */
#include <stdio.h>
#include <string.h>

#include "experiment_schema.h"
#include "sdm/memory.h"

/* folder = the title as a folder name: "POD, 128^3" becomes "pod-128-3". */
static void make_folder(const char *title, char folder[SDM_EXPERIMENT_TITLE_MAX])
{
    size_t n = 0;
    for (const char *p = title; *p; p++) {
        const char c = *p >= 'A' && *p <= 'Z' ? (char)(*p + 32) : *p;
        const bool kept = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
        if (kept)
            folder[n++] = c;
        else if (n > 0 && folder[n - 1] != '-')
            folder[n++] = '-';
    }
    while (n > 0 && folder[n - 1] == '-') n--;
    if (n == 0) folder[n++] = '-';
    folder[n] = 0;
}

static void make_row(const sdm_experiment *e, const sdm_experiment_method *m,
                     const sdm_experiment_variant *v, sdm_experiment_row *row)
{
    row->method = m;
    row->variant = v;
    row->samples = m->samples   ? m->samples
                   : *m->engine ? e->experiment.engine_samples
                                : e->experiment.samples;
    snprintf(row->title, sizeof row->title, v ? "%.*s, %s" : "%.*s", SDM_NAME_MAX - 2, m->name,
             v ? v->name : "");
    make_folder(row->title, row->folder);
}

/* The first variant with the same `set` as v. */
static size_t first_alike(const sdm_experiment *e, size_t v)
{
    for (size_t u = 0; u < v; u++) {
        const sdm_overrides *a = &e->variants[u].set, *b = &e->variants[v].set;
        size_t i = 0;
        if (a->n != b->n) continue;
        while (i < a->n && !strcmp(a->items[i].text, b->items[i].text)) i++;
        if (i == a->n) return u;
    }
    return v;
}

/* Sets network_row of every row. A method with fit: polish uses the network of the last method with
 * fit: network before it. `model`: position of the key fit.model. */
static void find_networks(sdm_experiment *e, sdm_mark model, sdm_mistakes *mistakes)
{
    size_t n_networks = 0;
    for (size_t i = 0; i < e->n_methods; i++) {
        sdm_experiment_method *m = &e->methods[i];
        size_t from = i;
        n_networks += m->fit == SDM_EXPERIMENT_FIT_NETWORK;
        if (m->fit == SDM_EXPERIMENT_FIT_POLISH) {
            while (from > 0 && e->methods[from].fit != SDM_EXPERIMENT_FIT_NETWORK) from--;
            if (e->methods[from].fit != SDM_EXPERIMENT_FIT_NETWORK)
                sdm_mistakes_add(
                    mistakes, m->mark,
                    "method '%s' with fit: polish needs one with fit: network before it", m->name);
            else
                strcpy(m->network, e->methods[from].network);
        }
        for (size_t row = i, v = 0; row < e->n_rows; row += e->n_methods, v++)
            e->rows[row].network_row = first_alike(e, v) * e->n_methods + from;
    }
    if (*e->fit.model && n_networks != 1)
        sdm_mistakes_add(
            mistakes, model,
            "fit.model: one model for %zu methods with fit: network, need one such method",
            n_networks);
}

/* Sets shown_row of every row from the key `shows` of its method. */
static void find_shown(sdm_experiment *e, sdm_mistakes *mistakes)
{
    for (size_t i = 0; i < e->n_methods; i++) {
        const sdm_experiment_method *m = &e->methods[i];
        size_t from = i;
        if (*m->shows)
            for (from = 0; from < e->n_methods; from++)
                if (e->methods[from].fit && !strcmp(e->methods[from].name, m->shows)) break;
        if (from == e->n_methods) {
            sdm_mistakes_add(mistakes, m->mark,
                             "method '%s': shows: no method with fit is named '%s'", m->name,
                             m->shows);
            from = i;
        }
        for (size_t row = i; row < e->n_rows; row += e->n_methods)
            e->rows[row].shown_row = row - i + from;
    }
}

/* Records a mistake if two rows have the same folder. */
static void check_folders(const sdm_experiment *e, sdm_mistakes *m)
{
    for (size_t i = 0; i < e->n_rows; i++)
        for (size_t k = 0; k < i; k++) {
            const sdm_experiment_row *a = &e->rows[k], *b = &e->rows[i];
            if (strcmp(a->folder, b->folder) != 0) continue;
            const bool variants = a->method == b->method;
            sdm_mistakes_add(m, variants ? b->variant->mark : b->method->mark,
                             "the names '%s' and '%s' give the same folder '%s'; change one",
                             a->title, b->title, b->folder);
            return;
        }
}

/* Sets `reference` of the rows. Mistakes are references without a row, and two references for one
 * row. */
static void attach_references(sdm_experiment *e, sdm_mistakes *m)
{
    const char *titles[SDM_EXPERIMENT_ROWS_MAX];
    for (size_t i = 0; i < e->n_rows; i++) titles[i] = e->rows[i].title;
    for (size_t k = 0; k < e->n_references; k++) {
        const sdm_experiment_reference *r = &e->references[k];
        size_t i = 0;
        while (i < e->n_rows && strcmp(titles[i], r->row) != 0) i++;
        const char *near = i < e->n_rows ? NULL : sdm_nearest_name(r->row, titles, e->n_rows);
        if (i == e->n_rows)
            sdm_mistakes_add(m, r->mark, "reference: there is no row '%s'%s%s%s", r->row,
                             near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
        else if (e->rows[i].reference)
            sdm_mistakes_add(m, r->mark,
                             "reference: a second one for the row '%s' (first at line %d)", r->row,
                             e->rows[i].reference->mark.line);
        else
            e->rows[i].reference = r;
    }
}

/* Records a mistake if the baseline is not the name of a method. */
static void check_baseline(const sdm_experiment *e, sdm_mark mark, sdm_mistakes *m)
{
    const char *names[SDM_EXPERIMENT_ROWS_MAX], *wanted = e->experiment.baseline;
    for (size_t i = 0; i < e->n_methods; i++) {
        names[i] = e->methods[i].name;
        if (!strcmp(names[i], wanted)) return;
    }
    const char *near = sdm_nearest_name(wanted, names, e->n_methods);
    sdm_mistakes_add(m, mark, "experiment.baseline: there is no method '%s'%s%s%s", wanted,
                     near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
}

sdm_status sdm_experiment_finish(sdm_experiment *e, sdm_reader *r, sdm_error *err)
{
    const sdm_mark top = {.line = 1, .column = 1},
                   methods = sdm_fields_given(r, "", "methods")->mark;
    const bool refused = sdm_fields_given(r, "", "methods")->refused;
    const size_t n_variants = e->n_variants ? e->n_variants : 1;
    if (e->n_methods == 0 && !refused)
        sdm_mistakes_add(
            r->mistakes, sdm_mark_is_set(methods) ? methods : top,
            "missing key 'methods': a list of at least one, e.g. - {name: POD, network: pod}");
    if (e->n_methods * n_variants > SDM_EXPERIMENT_ROWS_MAX)
        sdm_mistakes_add(r->mistakes, methods, "%zu methods in %zu variants are over %d rows",
                         e->n_methods, n_variants, SDM_EXPERIMENT_ROWS_MAX);
    if (r->mistakes->count > 0) return SDM_OK;

    // make the rows, variant by variant, each with all methods
    const sdm_status s =
        SDM_ALLOC(&e->rows, e->n_methods * n_variants, "rows of the experiment", err);
    if (s) return s;
    for (size_t v = 0; v < n_variants; v++)
        for (size_t i = 0; i < e->n_methods; i++)
            make_row(e, &e->methods[i], e->n_variants ? &e->variants[v] : NULL,
                     &e->rows[e->n_rows++]);
    find_networks(e, sdm_fields_given(r, "fit", "model")->mark, r->mistakes);
    find_shown(e, r->mistakes);
    check_folders(e, r->mistakes);
    attach_references(e, r->mistakes);
    if (*e->experiment.baseline)
        check_baseline(e, sdm_fields_given(r, "experiment", "baseline")->mark, r->mistakes);
    return SDM_OK;
}
