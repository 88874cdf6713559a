/* cohort.json, the list of the cases of a cohort in the order of its table, and failed.csv. */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cohort.h"
#include "report/json_values.h"
#include "sdm/internal/file.h"
#include "sdm/internal/json_read.h"
#include "sdm/internal/table.h"
#include "sdm/memory.h"

enum { LIST_BYTES_MAX = 1 << 28 };

static void list_path(const char *out, char path[CLI_CASE_PATH_MAX])
{
    snprintf(path, CLI_CASE_PATH_MAX, "%s/" CLI_COHORT_LIST, out);
}

/* Whether the file holds this text and a line feed. */
static bool is_there(const char *path, const char *text)
{
    uint8_t *data = NULL;
    size_t size = 0;
    if (sdm_file_read(path, LIST_BYTES_MAX, &data, &size, NULL)) return false;
    const size_t length = strlen(text);
    const bool same = size == length + 1 && !memcmp(data, text, length);
    sdm_free(data);
    return same;
}

sdm_status cli_cohort_list_write(const cli_cohort *c, sdm_error *err)
{
    char path[CLI_CASE_PATH_MAX];
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "made_by", "sdmgen " SDM_VERSION_TEXT);
    sdm_json_text(&j, "cases", c->csv);
    sdm_json_open(&j, "ids", '[');
    for (size_t i = 0; i < c->cells.n_rows; i++) sdm_json_text(&j, NULL, cli_cohort_id(c, i));
    sdm_json_close(&j, ']');
    sdm_json_close(&j, '}');
    list_path(c->out, path);
    // parts that run at the same time write the same list
    const bool done = !j.text.failed && is_there(path, j.text.data);
    const sdm_status s = done ? SDM_OK : cli_json_write(&j, path, err);
    sdm_json_dispose(&j);
    return s;
}

static sdm_status take_ids(const char *path, const sdm_json_document *d, cli_ids *ids,
                           sdm_error *err)
{
    const size_t list = sdm_json_member(d, 0, "ids");
    size_t n = 0;
    if (!list || d->values[list].kind != '[')
        return sdm_fail(err, SDM_E_FORMAT, "%s: no list of ids", path);
    for (size_t k = list + 1; k < d->values[list].next; k = d->values[k].next) n++;
    sdm_status s = SDM_ALLOC(&ids->id, n, "ids", err);
    for (size_t k = list + 1; k < d->values[list].next && !s; k = d->values[k].next) {
        if (!sdm_json_word(d, k, ids->id[ids->n], sizeof ids->id[0]))
            s = sdm_fail(err, SDM_E_FORMAT, "%s: id number %zu is not one", path, ids->n + 1);
        else if ((s = cli_check_id(ids->id[ids->n], err)))
            s = sdm_fail_in(err, s, "%s", path);
        else
            ids->n++;
    }
    return s;
}

sdm_status cli_cohort_list_read(const char *out, cli_ids *ids, sdm_error *err)
{
    char path[CLI_CASE_PATH_MAX];
    uint8_t *text = NULL;
    size_t size = 0;
    sdm_json_document d = {0};
    *ids = (cli_ids){0};
    list_path(out, path);
    if (access(path, F_OK))
        return sdm_fail(err, SDM_E_IO,
                        "%s: not there: need the folder in which `sdmgen fit --cases TABLE -o DIR` "
                        "writes its results",
                        path);
    sdm_status s = sdm_file_read(path, LIST_BYTES_MAX, &text, &size, err);
    if (!s) s = sdm_json_parse(path, (const char *)text, size, &d, err);
    if (!s) s = take_ids(path, &d, ids, err);
    sdm_json_document_dispose(&d);
    sdm_free(text);
    return s;
}

void cli_ids_dispose(cli_ids *ids)
{
    sdm_free(ids->id);
    *ids = (cli_ids){0};
}

/* Appends a row for each case that failed. */
static void list_failed(const char *out, const cli_ids *ids, sdm_text *t)
{
    for (size_t i = 0; i < ids->n; i++) {
        cli_case_end end;
        cli_record_read(out, ids->id[i], false, &end);
        if (end.state != CLI_CASE_FAILED) continue;
        if (!t->size) sdm_text_add(t, "id,exit_code,reason\n");
        sdm_text_add(t, "%s,%d,", ids->id[i], end.exit_code);
        sdm_csv_text(t, end.reason);
        sdm_text_add(t, "\n");
    }
}

sdm_status cli_cohort_write_failed(const char *out, const cli_ids *ids, sdm_error *err)
{
    char path[CLI_CASE_PATH_MAX];
    sdm_text written = {0}, now = {0};
    sdm_status s = SDM_OK;
    snprintf(path, sizeof path, "%s/" CLI_COHORT_FAILED, out);
    // until nothing changes: of two runs that end at the same time, the last one to write has seen
    // the cases of both
    do {
        sdm_text_dispose(&written);
        written = now;
        now = (sdm_text){0};
        list_failed(out, ids, &now);
        const bool same = written.size == now.size &&
                          (!now.size || !strcmp(written.data, now.data)) && !now.failed;
        if (same && now.size) break;
        if (now.size)
            s = sdm_text_write(&now, path, err);
        else
            unlink(path);
        if (same) break;
    } while (!s && !now.failed);
    sdm_text_dispose(&written);
    sdm_text_dispose(&now);
    return s;
}
