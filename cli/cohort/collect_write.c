/* The table of a cohort as CSV and as JSON. */
#include <stdio.h>

#include "collect.h"
#include "sdm/internal/table.h"

static const char *outliers_of(const cli_collect_row *row)
{
    return row->outliers.size ? row->outliers.data : "";
}

void cli_collect_csv(const cli_collect *t, sdm_text *out)
{
    sdm_text_add(out, "id,state,exit_code,verdict,outliers");
    for (size_t k = 0; k < t->n_columns; k++)
        sdm_text_add(out, ",%s%s", t->columns[k].name, t->columns[k].is_sd ? "_sd" : "");
    sdm_text_add(out, ",reason\n");
    for (size_t i = 0; i < t->ids.n; i++) {
        const cli_collect_row *row = &t->rows[i];
        sdm_text_add(out, "%s,%s,", row->id, cli_case_state_name(row->state));
        if (row->state != CLI_CASE_MISSING) sdm_text_add(out, "%d", row->exit_code);
        sdm_text_add(out, ",%s,%s", row->verdict, outliers_of(row));
        for (size_t k = 0; k < t->n_columns; k++)
            sdm_csv_real(out, t->values[i * t->n_columns + k]);
        sdm_text_add(out, ",");
        if (*row->reason) sdm_csv_text(out, row->reason);
        sdm_text_add(out, "\n");
    }
}

void cli_collect_json(const cli_collect *t, sdm_json *json)
{
    sdm_json_open(json, NULL, '{');
    sdm_json_int(json, "n", (int64_t)t->ids.n);
    sdm_json_open(json, "cases", '[');
    for (size_t i = 0; i < t->ids.n; i++) {
        const cli_collect_row *row = &t->rows[i];
        sdm_json_open(json, NULL, '{');
        sdm_json_text(json, "id", row->id);
        sdm_json_text(json, "state", cli_case_state_name(row->state));
        if (row->state != CLI_CASE_MISSING) sdm_json_int(json, "exit_code", row->exit_code);
        sdm_json_text(json, "verdict", row->verdict);
        sdm_json_text(json, "outliers", outliers_of(row));
        sdm_json_text(json, "reason", row->reason);
        sdm_json_open(json, "figures", '{');
        for (size_t k = 0; k < t->n_columns; k++) {
            char name[120];
            snprintf(name, sizeof name, "%s%s", t->columns[k].name,
                     t->columns[k].is_sd ? "_sd" : "");
            sdm_json_real(json, name, t->values[i * t->n_columns + k]);
        }
        sdm_json_close(json, '}');
        sdm_json_close(json, '}');
    }
    sdm_json_close(json, ']');
    sdm_json_close(json, '}');
}
