/* What fits found, parameter by parameter: against exact fits and against the truth. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "experiment_fit.h"
#include "sdm/internal/file.h"

/* The row of exact fits in the same variant; NULL: there is none. */
static const experiment_result *find_exact(const experiment_run *run, const experiment_result *r)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const experiment_result *other = &run->results[i];
        if (other->row->variant == r->row->variant &&
            other->row->method->fit == SDM_EXPERIMENT_FIT_EXACT && other->state == EXPERIMENT_DONE)
            return other;
    }
    return NULL;
}

void experiment_fit_finish(const experiment_run *run)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        experiment_result *r = &run->results[i];
        if (r->row->method->fit != SDM_EXPERIMENT_FIT_NAIVE || r->state != EXPERIMENT_DONE)
            continue;
        const experiment_result *exact = find_exact(run, r);
        const double maps = exact ? exact->figure[SDM_FIGURE_MAPS_EXACT] : NAN;
        r->figure[SDM_FIGURE_FIT] = 1e-3 * r->figure[SDM_FIGURE_MS] * maps;
        if (exact)
            snprintf(r->note, sizeof r->note,
                     "not run: the %.3g maps of a fit of '%s' at the measured time of a naive one, "
                     "%s, derivatives not "
                     "counted",
                     maps, exact->row->title, r->grid);
        else
            snprintf(r->note, sizeof r->note,
                     "one naive map, %s; without exact fits the maps of a fit are not known",
                     r->grid);
    }
}

static double reference_of(const experiment_result *r, const char *name)
{
    const sdm_experiment_reference *reference = r->row->reference;
    for (size_t i = 0; reference && i < reference->n_differences; i++)
        if (!strcmp(reference->differences[i].name, name)) return reference->differences[i].value;
    return NAN;
}

/* The fit of the same phantom, if it converged too. */
static const experiment_fit *partner(const experiment_result *exact, const experiment_fits *f,
                                     size_t i)
{
    if (!exact || !exact->fits || exact->fits->n_params != f->n_params ||
        !exact->fits->fit[i].converged)
        return NULL;
    const experiment_fit *other = &exact->fits->fit[i];
    for (size_t k = 0; k < f->n_params; k++)
        if (!(fabs(other->truth[k] - f->fit[i].truth[k]) <= 0)) return NULL;
    return other;
}

experiment_spread experiment_fit_spread(const experiment_run *run, const experiment_result *r,
                                        size_t param)
{
    const experiment_fits *f = r->fits;
    const experiment_result *exact = find_exact(run, r);
    double difference = 0, error = 0, sd = 0, within = 0, n = 0, n_pairs = 0, n_free = 0;
    for (size_t i = 0; i < f->n; i++) {
        const experiment_fit *one = &f->fit[i], *other = partner(exact, f, i);
        if (!one->converged) continue;
        const double off = fabs(one->found[param] - one->truth[param]);
        n++;
        error += off;
        sd += one->sd[param];
        if (!one->at_bound[param]) n_free++;
        if (!one->at_bound[param] && off <= 3 * one->sd[param]) within++;
        if (!other || exact == r) continue;
        n_pairs++;
        difference += fabs(one->found[param] - other->found[param]);
    }
    return (experiment_spread){.difference = n_pairs > 0 ? difference / n_pairs : NAN,
                               .error = n > 0 ? error / n : NAN,
                               .sd = n > 0 ? sd / n : NAN,
                               .within = n_free > 0 ? within / n_free : NAN,
                               .reference = reference_of(r, f->name[param])};
}

static bool has_fits(const experiment_result *r) { return r->state == EXPERIMENT_DONE && r->fits; }

static void add_figure(sdm_text *t, double v)
{
    sdm_text_add(t, isfinite(v) ? " %.3g |" : " - |", v);
}

void experiment_fit_markdown(const experiment_run *run, sdm_text *t)
{
    bool any = false;
    for (size_t i = 0; i < run->e->n_rows; i++) any |= has_fits(&run->results[i]);
    if (!any) return;
    sdm_text_add(t,
                 "\n| method | parameter | unit | difference from the exact fit | difference (%s) "
                 "| error | standard "
                 "deviation | within 3 sd |\n|---|---|---|---:|---:|---:|---:|---:|\n",
                 run->e->experiment.reference);
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const experiment_result *r = &run->results[i];
        for (size_t k = 0; has_fits(r) && k < r->fits->n_params; k++) {
            const experiment_spread s = experiment_fit_spread(run, r, k);
            const double cells[] = {s.difference, s.reference, s.error, s.sd, s.within};
            sdm_text_add(t, "| ");
            experiment_add_cell(t, r->row->title);
            sdm_text_add(t, " | %s | %s |", r->fits->name[k], r->fits->unit[k]);
            for (size_t c = 0; c < sizeof cells / sizeof *cells; c++) add_figure(t, cells[c]);
            sdm_text_add(t, "\n");
        }
    }
    sdm_text_add(t, "\nMeans of absolute values over the fits that converged; estimates at an end "
                    "of their range do not "
                    "count for the last column.\n");
}

void experiment_fit_json(const experiment_run *run, const experiment_result *r, sdm_json *j)
{
    if (!has_fits(r)) return;
    sdm_json_open(j, "parameters", '[');
    for (size_t k = 0; k < r->fits->n_params; k++) {
        const experiment_spread s = experiment_fit_spread(run, r, k);
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "name", r->fits->name[k]);
        sdm_json_text(j, "unit", r->fits->unit[k]);
        sdm_json_real(j, "difference", s.difference);
        sdm_json_real(j, "reference_difference", s.reference);
        sdm_json_real(j, "error", s.error);
        sdm_json_real(j, "sd", s.sd);
        sdm_json_real(j, "within_3sd", s.within);
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
}

/* ---- files ---- */

static void add_value(sdm_text *t, double v)
{
    char number[32];
    sdm_text_add(t, ",%s", isfinite(v) ? sdm_format_real(v, number) : "");
}

static void add_parameters(const experiment_run *run, sdm_text *t)
{
    sdm_text_add(t, "method,parameter,unit,difference,reference_difference,error,sd,within_3sd\n");
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const experiment_result *r = &run->results[i];
        for (size_t k = 0; has_fits(r) && k < r->fits->n_params; k++) {
            const experiment_spread s = experiment_fit_spread(run, r, k);
            const double cells[] = {s.difference, s.reference, s.error, s.sd, s.within};
            experiment_add_csv_text(t, r->row->title);
            sdm_text_add(t, ",%s,%s", r->fits->name[k], r->fits->unit[k]);
            for (size_t c = 0; c < sizeof cells / sizeof *cells; c++) add_value(t, cells[c]);
            sdm_text_add(t, "\n");
        }
    }
}

static void add_fits(const experiment_fits *f, sdm_text *t)
{
    sdm_text_add(t, "phantom,converged,seconds,maps_network,maps_exact,dice");
    for (size_t k = 0; k < f->n_params; k++)
        sdm_text_add(t, ",%s_true,%s,%s_sd,%s_at_bound", f->name[k], f->name[k], f->name[k],
                     f->name[k]);
    sdm_text_add(t, "\n");
    for (size_t i = 0; i < f->n; i++) {
        const experiment_fit *one = &f->fit[i];
        sdm_text_add(t, "%zu,%s", i + 1, one->converged ? "true" : "false");
        add_value(t, one->seconds);
        sdm_text_add(t, ",%zu,%zu", one->maps_network, one->maps_exact);
        add_value(t, one->dice);
        for (size_t k = 0; k < f->n_params; k++) {
            add_value(t, one->truth[k]);
            add_value(t, one->found[k]);
            add_value(t, one->sd[k]);
            sdm_text_add(t, ",%s", one->at_bound[k] ? "true" : "false");
        }
        sdm_text_add(t, "\n");
    }
}

sdm_status experiment_fit_write(const experiment_run *run, sdm_error *err)
{
    bool any = false;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < run->e->n_rows && !s; i++) {
        const experiment_result *r = &run->results[i];
        char folder[SDM_PATH_TEXT_MAX], name[SDM_PATH_TEXT_MAX];
        sdm_text text = {0};
        if (!has_fits(r)) continue;
        any = true;
        add_fits(r->fits, &text);
        s = experiment_path(run, i, "", folder, err);
        if (!s) s = sdm_make_folder(folder, err);
        snprintf(name, sizeof name, "%s/fits.csv", r->row->folder);
        if (!s) s = experiment_write_file(run, name, &text, err);
        sdm_text_dispose(&text);
    }
    if (s || !any) return s;
    sdm_text text = {0};
    add_parameters(run, &text);
    s = experiment_write_file(run, "parameters.csv", &text, err);
    sdm_text_dispose(&text);
    return s;
}
