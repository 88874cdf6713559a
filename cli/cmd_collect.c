/* sdmgen collect: makes one table of the fits of a cohort. */
#include <stdio.h>

#include "cohort/collect.h"
#include "commands.h"
#include "report/files.h"
#include "report/terminal.h"
#include "sdm/internal/table.h"

enum { NAMES_SHOWN = 10 };

static size_t count(const cli_collect *t, cli_case_state state)
{
    size_t n = 0;
    for (size_t i = 0; i < t->ids.n; i++) n += t->rows[i].state == state;
    return n;
}

/* Appends "COUNT STATE (id, id, ...)" for the cases of this state; without any nothing. */
static void add_names(const cli_collect *t, cli_case_state state, sdm_text *out)
{
    const size_t n = count(t, state);
    if (!n) return;
    sdm_text_add(out, "%s%zu %s (", out->size ? ", " : "", n, cli_case_state_name(state));
    size_t shown = 0;
    for (size_t i = 0; i < t->ids.n && shown < NAMES_SHOWN; i++)
        if (t->rows[i].state == state)
            sdm_text_add(out, "%s%s", shown++ ? ", " : "", t->rows[i].id);
    sdm_text_add(out, n > shown ? ", ...)" : ")");
}

static void notice_refused(const cli_collect *t)
{
    sdm_text names = {0};
    add_names(t, CLI_CASE_REFUSED, &names);
    if (names.size) cli_notice("%s: their results must not be trusted", names.data);
    sdm_text_dispose(&names);
}

static void notice_outliers(const cli_collect *t)
{
    sdm_text names = {0};
    size_t n = 0;
    for (size_t i = 0; i < t->ids.n; i++) {
        const cli_collect_row *row = &t->rows[i];
        if (row->outliers.size && n++ < NAMES_SHOWN)
            sdm_text_add(&names, "%s%s (%s)", n > 1 ? ", " : "", row->id, row->outliers.data);
    }
    if (n)
        cli_notice("%zu outlier%s, with robust standard deviations from the median: %s%s", n,
                   n > 1 ? "s" : "", names.data ? names.data : "", n > NAMES_SHOWN ? ", ..." : "");
    sdm_text_dispose(&names);
}

/* Fails with exit code 6 when not every case has a result. */
static sdm_status check_complete(const cli_args *args, const cli_collect *t, sdm_error *err)
{
    sdm_text names = {0};
    sdm_status s = SDM_OK;
    add_names(t, CLI_CASE_MISSING, &names);
    add_names(t, CLI_CASE_FAILED, &names);
    if (names.size) {
        cli_set_incomplete();
        s = sdm_fail(err, SDM_E_QUALITY, "%s: of %zu cases %s: `sdmgen fit --cases` does them",
                     args->files.items[0], t->ids.n, names.failed ? "" : names.data);
    }
    sdm_text_dispose(&names);
    return s;
}

static sdm_status write_output(const cli_args *args, const cli_collect *t, const char *path,
                               sdm_error *err)
{
    sdm_text text = {0};
    if (cli_ends_with(path, ".csv"))
        cli_collect_csv(t, &text);
    else
        cli_collect_page(t, args->files.items[0], path, &text);
    const sdm_status s = sdm_text_write(&text, path, err);
    sdm_text_dispose(&text);
    return s;
}

/* Prints the table as JSON, or as CSV where no file holds it. */
static sdm_status print_table(const cli_args *args, const cli_collect *t, sdm_error *err)
{
    sdm_text csv = {0};
    sdm_json json = {0};
    if (args->json) {
        cli_collect_json(t, &json);
        return cli_print_json(&json, err);
    }
    if (args->outputs.n) return SDM_OK;
    cli_collect_csv(t, &csv);
    return cli_print_text(&csv, err);
}

static sdm_status check_arguments(const cli_args *args, sdm_error *err)
{
    for (size_t i = 0; i < args->outputs.n; i++)
        if (!cli_ends_with_any(args->outputs.items[i], ".csv .html .htm"))
            return sdm_fail(err, SDM_E_ARG,
                            "collect: output '%s': its name must end in .csv or .html",
                            args->outputs.items[i]);
    return cli_check_files(args, NULL, err);
}

sdm_status cmd_collect(const cli_args *args, sdm_error *err)
{
    cli_collect table = {.values = NULL};
    sdm_status s = check_arguments(args, err);
    if (!s) s = cli_collect_read(args->files.items[0], &table, err);
    if (!s) s = cli_collect_outliers(&table, err);
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = write_output(args, &table, args->outputs.items[i], err);
    if (!s) s = print_table(args, &table, err);
    if (!s) notice_refused(&table);
    if (!s) notice_outliers(&table);
    if (!s) s = check_complete(args, &table, err);
    cli_collect_dispose(&table);
    return s;
}
