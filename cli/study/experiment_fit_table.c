/* Tables of the fits by parameter: differences from the exact fits and from the truth. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "experiment_fit_table.h"
#include "sdm/internal/file.h"
#include "sdm/internal/table.h"

/* Returns the row of exact fits in the same variant; NULL: there is no finished one. */
static const cli_experiment_result *find_exact(const cli_experiment_run *run,
                                               const cli_experiment_result *r)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const cli_experiment_result *other = &run->results[i];
        if (other->row->variant == r->row->variant &&
            other->row->method->fit == SDM_EXPERIMENT_FIT_EXACT &&
            other->state == CLI_EXPERIMENT_DONE)
            return other;
    }
    return NULL;
}

void cli_experiment_fit_finish(const cli_experiment_run *run)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        cli_experiment_result *r = &run->results[i];
        if (r->row->method->fit != SDM_EXPERIMENT_FIT_NAIVE || r->state != CLI_EXPERIMENT_DONE)
            continue;
        const cli_experiment_result *exact = find_exact(run, r);
        const double maps = exact ? exact->figure[SDM_FIGURE_MAPS_EXACT] : NAN;
        r->figure[SDM_FIGURE_FIT] = 1e-3 * r->figure[SDM_FIGURE_MS] * maps;
        if (exact)
            snprintf(r->note, sizeof r->note,
                     "not run: the %.3g maps of a fit of '%s' times the measured time of a naive "
                     "map, %s, without derivatives",
                     maps, exact->row->title, r->grid);
        else
            snprintf(r->note, sizeof r->note,
                     "one naive map, %s; without exact fits the number of maps is unknown",
                     r->grid);
    }
}

/* The published difference of the parameter `name`; NaN: none. */
static double reference_difference(const cli_experiment_result *r, const char *name)
{
    const sdm_experiment_reference *reference = r->row->reference;
    for (size_t i = 0; reference && i < reference->n_differences; i++)
        if (!strcmp(reference->differences[i].name, name)) return reference->differences[i].value;
    return NAN;
}

/* Returns the exact fit of phantom i; NULL: it did not converge, or it fitted a different
 * phantom. */
static const cli_experiment_fit *find_exact_fit(const cli_experiment_result *exact,
                                                const cli_experiment_fits *f, size_t i)
{
    if (!exact || !exact->fits || exact->fits->n_params != f->n_params ||
        !exact->fits->fit[i].converged)
        return NULL;
    const cli_experiment_fit *other = &exact->fits->fit[i];
    for (size_t k = 0; k < f->n_params; k++)
        if (!(fabs(other->truth[k] - f->fit[i].truth[k]) <= 0)) return NULL;
    return other;
}

/* Errors of one parameter over the fits that are to be trusted; NaN: unknown. */
typedef struct fit_spread {
    double difference; /* mean abs(estimate - estimate of the exact fit) */
    double error;      /* mean abs(estimate - truth) */
    double sd;         /* mean standard deviation */
    double within; /* fraction with abs(estimate - truth) <= 3 sd, without estimates at a bound */
    double reference; /* published difference */
} fit_spread;

static fit_spread spread_of(const cli_experiment_run *run, const cli_experiment_result *r,
                            size_t param)
{
    const cli_experiment_fits *f = r->fits;
    const cli_experiment_result *exact = find_exact(run, r);
    double difference = 0, error = 0, sd = 0, within = 0, n = 0, n_pairs = 0, n_free = 0;
    for (size_t i = 0; i < f->n; i++) {
        const cli_experiment_fit *one = &f->fit[i], *other = find_exact_fit(exact, f, i);
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
    return (fit_spread){.difference = n_pairs > 0 ? difference / n_pairs : NAN,
                        .error = n > 0 ? error / n : NAN,
                        .sd = n > 0 ? sd / n : NAN,
                        .within = n_free > 0 ? within / n_free : NAN,
                        .reference = reference_difference(r, f->name[param])};
}

static bool has_fits(const cli_experiment_result *r)
{
    return r->state == CLI_EXPERIMENT_DONE && r->fits;
}

/* A fit that started beside the shape has found it, and is right, from this Dice coefficient on. */
static const double FOUND_DICE = 0.9;

/* Adds the number of right and of wrong fits, and how many of them were accepted, where the
 * experiment has wrong ones. */
static void add_verdicts(const cli_experiment_run *run, sdm_text *t)
{
    size_t n[2] = {0, 0}, accepted[2] = {0, 0}, found = 0;
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const cli_experiment_result *r = &run->results[i];
        if (!has_fits(r)) continue;
        const bool wrong = *r->row->method->shows || r->row->method->wrong;
        n[wrong] += r->fits->n;
        for (size_t k = 0; k < r->fits->n; k++) {
            const cli_experiment_fit *fit = &r->fits->fit[k];
            const bool finds = wrong && fit->converged && fit->dice >= FOUND_DICE;
            found += finds;
            n[wrong] -= finds;
            accepted[wrong] += fit->converged && !finds;
        }
    }
    if (!n[1]) return;
    sdm_text_add(t,
                 "\n| cases | fits | accepted | refused |\n|---|---:|---:|---:|\n"
                 "| right | %zu | %zu | %zu |\n| wrong | %zu | %zu | %zu |\n",
                 n[0], accepted[0], n[0] - accepted[0], n[1], accepted[1], n[1] - accepted[1]);
    if (found)
        sdm_text_add(t, "| wrong start, the shape was found | %zu | %zu | 0 |\n", found, found);
}

void cli_experiment_fit_markdown(const cli_experiment_run *run, sdm_text *t)
{
    bool any = false;
    for (size_t i = 0; i < run->e->n_rows; i++) any |= has_fits(&run->results[i]);
    if (!any) return;
    add_verdicts(run, t);
    sdm_text_add(t,
                 "\n| method | parameter | unit | difference from the exact fit | difference (%s) "
                 "| error | standard deviation | within 3 sd |\n",
                 run->e->experiment.reference);
    sdm_markdown_rule(t, 3, 5);
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const cli_experiment_result *r = &run->results[i];
        for (size_t k = 0; has_fits(r) && k < r->fits->n_params; k++) {
            const fit_spread s = spread_of(run, r, k);
            const double cells[] = {s.difference, s.reference, s.error, s.sd, s.within};
            sdm_text_add(t, "| ");
            sdm_markdown_text(t, r->row->title);
            sdm_text_add(t, " | %s | %s |", r->fits->name[k], r->fits->unit[k]);
            for (size_t c = 0; c < sizeof cells / sizeof *cells; c++)
                sdm_markdown_real(t, cells[c]);
            sdm_text_add(t, "\n");
        }
    }
    sdm_text_add(
        t, "\nMeans of absolute values over the fits that are to be trusted; the last column omits "
           "estimates at an end of their range.\n");
}

void cli_experiment_fit_json(const cli_experiment_run *run, const cli_experiment_result *r,
                             sdm_json *j)
{
    if (!has_fits(r)) return;
    sdm_json_open(j, "parameters", '[');
    for (size_t k = 0; k < r->fits->n_params; k++) {
        const fit_spread s = spread_of(run, r, k);
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

static void add_parameters(const cli_experiment_run *run, sdm_text *t)
{
    sdm_text_add(t, "method,parameter,unit,difference,reference_difference,error,sd,within_3sd\n");
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const cli_experiment_result *r = &run->results[i];
        for (size_t k = 0; has_fits(r) && k < r->fits->n_params; k++) {
            const fit_spread s = spread_of(run, r, k);
            const double cells[] = {s.difference, s.reference, s.error, s.sd, s.within};
            sdm_csv_text(t, r->row->title);
            sdm_text_add(t, ",%s,%s", r->fits->name[k], r->fits->unit[k]);
            for (size_t c = 0; c < sizeof cells / sizeof *cells; c++) sdm_csv_real(t, cells[c]);
            sdm_text_add(t, "\n");
        }
    }
}

static void add_fits(const cli_experiment_fits *f, sdm_text *t)
{
    sdm_text_add(t, "phantom,converged,seconds,maps_network,maps_exact,dice");
    for (size_t k = 0; k < f->n_params; k++)
        sdm_text_add(t, ",%s_true,%s,%s_sd,%s_at_bound", f->name[k], f->name[k], f->name[k],
                     f->name[k]);
    sdm_text_add(t, ",reason\n");
    for (size_t i = 0; i < f->n; i++) {
        const cli_experiment_fit *one = &f->fit[i];
        sdm_text_add(t, "%zu,%s", i + 1, one->converged ? "true" : "false");
        sdm_csv_real(t, one->seconds);
        sdm_text_add(t, ",%zu,%zu", one->maps_network, one->maps_exact);
        sdm_csv_real(t, one->dice);
        for (size_t k = 0; k < f->n_params; k++) {
            sdm_csv_real(t, one->truth[k]);
            sdm_csv_real(t, one->found[k]);
            sdm_csv_real(t, one->sd[k]);
            sdm_text_add(t, ",%s", one->at_bound[k] ? "true" : "false");
        }
        sdm_text_add(t, ",");
        sdm_csv_text(t, one->reason);
        sdm_text_add(t, "\n");
    }
}

sdm_status cli_experiment_fit_write(const cli_experiment_run *run, sdm_error *err)
{
    bool any = false;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < run->e->n_rows && !s; i++) {
        const cli_experiment_result *r = &run->results[i];
        char folder[SDM_PATH_TEXT_MAX], path[SDM_PATH_TEXT_MAX];
        sdm_text text = {0};
        if (!has_fits(r)) continue;
        any = true;
        add_fits(r->fits, &text);
        s = cli_experiment_path(run, i, "", folder, err);
        if (!s) s = sdm_make_folder(folder, err);
        if (!s) s = cli_experiment_path(run, i, "fits.csv", path, err);
        if (!s) s = sdm_text_write(&text, path, err);
        sdm_text_dispose(&text);
    }
    if (s || !any) return s;
    sdm_text text = {0};
    add_parameters(run, &text);
    s = cli_experiment_write_file(run, "parameters.csv", &text, err);
    sdm_text_dispose(&text);
    return s;
}
