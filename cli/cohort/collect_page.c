/* The table of a cohort as a page for a browser: one HTML file without scripts, in which the cases
 * that are worth a look come first. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "collect.h"

static const char BEGIN[] =
    "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
    "style-src 'unsafe-inline'; img-src 'self' file:\">\n"
    "<meta name=\"color-scheme\" content=\"light dark\">\n<title>Cohort - sdmgen</title>\n<style>\n"
    "body { font: 15px/1.4 system-ui, sans-serif; margin: 1.5em; }\n"
    "table { border-collapse: collapse; }\n"
    "th, td { padding: .25em .7em; text-align: left; vertical-align: top; white-space: nowrap; "
    "border-bottom: 1px solid #8885; }\n"
    "th { position: sticky; top: 0; background: Canvas; }\n"
    "td.number { text-align: right; font-variant-numeric: tabular-nums; }\n"
    "td.text { white-space: normal; min-width: 24em; }\n"
    ".failed, .missing { background: #e0303030; }\n.refused { background: #e0903030; }\n"
    ".outlier { background: #3070e030; }\n"
    "img { max-height: 7em; }\n</style>\n</head>\n<body>\n";

static void add_escaped(sdm_text *t, const char *text)
{
    for (; *text; text++) {
        const char *name = *text == '<'   ? "&lt;"
                           : *text == '>' ? "&gt;"
                           : *text == '&' ? "&amp;"
                           : *text == '"' ? "&quot;"
                                          : NULL;
        if (name)
            sdm_text_add(t, "%s", name);
        else
            sdm_text_add(t, "%c", *text);
    }
}

/* How far up a case stands: outliers, cases without a result, refused ones, doubtful ones, others.
 */
enum { N_RANKS = 5 };
static int rank_of(const cli_collect_row *row)
{
    if (row->outliers.size) return 0;
    if (row->state == CLI_CASE_FAILED || row->state == CLI_CASE_MISSING) return 1;
    if (row->state == CLI_CASE_REFUSED) return 2;
    return strcmp(row->verdict, "passed") ? 3 : 4;
}

/* Whether a page at `path` lies in the folder of the cohort, so that it can link to its files. */
static bool lies_in(const char *path, const char *out)
{
    char folder[CLI_CASE_PATH_MAX] = ".";
    struct stat a, b;
    const char *slash = strrchr(path, '/');
    if (slash) snprintf(folder, sizeof folder, "%.*s", (int)(slash - path) + 1, path);
    return !stat(folder, &a) && !stat(out, &b) && a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

/* Adds a link to a file of the case, if it is there; its text, or the picture itself. */
static void add_link(sdm_text *t, const char *out, const char *id, const char *name,
                     const char *text)
{
    char path[CLI_CASE_PATH_MAX];
    cli_case_path(out, id, name, path);
    if (access(path, F_OK)) return;
    sdm_text_add(t, "<a href=\"%s/%s\">", id, name);
    if (text)
        sdm_text_add(t, "%s", text);
    else
        sdm_text_add(t, "<img loading=\"lazy\" alt=\"%s of %s\" src=\"%s/%s\">", name, id, id,
                     name);
    sdm_text_add(t, "</a> ");
}

/* Columns of the page: all figures but the pose; a deviation stands beside its value. */
static bool is_shown(const cli_collect_column *c)
{
    return !c->is_sd && c->group != CLI_GROUP_POSE;
}

static void add_figures(const cli_collect *t, size_t row, sdm_text *out)
{
    const double *v = t->values + row * t->n_columns;
    for (size_t k = 0; k < t->n_columns; k++) {
        if (!is_shown(&t->columns[k])) continue;
        sdm_text_add(out, "<td class=\"number\">");
        if (isfinite(v[k])) sdm_text_add(out, "%.4g", v[k]);
        if (k + 1 < t->n_columns && t->columns[k + 1].is_sd && isfinite(v[k + 1]))
            sdm_text_add(out, " &plusmn; %.2g", v[k + 1]);
        sdm_text_add(out, "</td>");
    }
}

static void add_row(const cli_collect *t, size_t i, const char *folder, sdm_text *out)
{
    const cli_collect_row *row = &t->rows[i];
    sdm_text_add(out, "<tr class=\"%s%s\"><th>%s</th><td>", cli_case_state_name(row->state),
                 row->outliers.size ? " outlier" : "", row->id);
    if (folder) {
        add_link(out, folder, row->id, "fit.png", NULL);
        add_link(out, folder, row->id, CLI_CASE_FIT, "figures");
        add_link(out, folder, row->id, CLI_CASE_LOG, "log");
    }
    sdm_text_add(out, "</td><td>%s</td><td>%s</td><td>", cli_case_state_name(row->state),
                 row->verdict);
    if (row->outliers.size) add_escaped(out, row->outliers.data);
    sdm_text_add(out, "</td><td class=\"text\">");
    add_escaped(out, row->reason);
    sdm_text_add(out, "</td>");
    add_figures(t, i, out);
    sdm_text_add(out, "</tr>\n");
}

static void add_head(const cli_collect *t, sdm_text *out)
{
    size_t n[4] = {0}, outliers = 0;
    for (size_t i = 0; i < t->ids.n; i++) {
        n[t->rows[i].state]++;
        outliers += t->rows[i].outliers.size > 0;
    }
    sdm_text_add(out,
                 "<h1>Cohort</h1>\n<p>%zu cases: %zu accepted, %zu refused, %zu failed, %zu "
                 "missing; %zu outliers (with their distance from the median in robust standard "
                 "deviations). sdmgen " SDM_VERSION_TEXT "</p>\n",
                 t->ids.n, n[CLI_CASE_ACCEPTED], n[CLI_CASE_REFUSED], n[CLI_CASE_FAILED],
                 n[CLI_CASE_MISSING], outliers);
    sdm_text_add(out, "<table>\n<thead><tr><th>case</th><th></th><th>state</th><th>verdict</th>"
                      "<th>outliers</th><th>reason</th>");
    for (size_t k = 0; k < t->n_columns; k++) {
        if (!is_shown(&t->columns[k])) continue;
        sdm_text_add(out, "<th>");
        add_escaped(out, t->columns[k].name);
        sdm_text_add(out, "</th>");
    }
    sdm_text_add(out, "</tr></thead>\n<tbody>\n");
}

void cli_collect_page(const cli_collect *t, const char *folder, const char *path, sdm_text *out)
{
    sdm_text_add(out, "%s", BEGIN);
    add_head(t, out);
    for (int rank = 0; rank < N_RANKS; rank++)
        for (size_t i = 0; i < t->ids.n; i++)
            if (rank_of(&t->rows[i]) == rank)
                add_row(t, i, lies_in(path, folder) ? folder : NULL, out);
    sdm_text_add(out, "</tbody>\n</table>\n</body>\n</html>\n");
}
