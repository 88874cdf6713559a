/* Reads the results of all cases of a cohort into a table. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "collect.h"
#include "sdm/internal/file.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/json_read.h"
#include "sdm/memory.h"

enum { FIT_BYTES_MAX = 1 << 26 };

/* A number of the table before its size is known. */
typedef struct entry {
    size_t row, column;
    double value;
} entry;

/* The table while it is read. Errors set `status`; later calls do nothing. */
typedef struct reader {
    cli_collect *table;
    size_t n_places; /* of table->columns */
    entry *entries;
    size_t n, capacity;
    size_t row; /* the current one */
    const sdm_json_document *json;
    sdm_status status;
    sdm_error *err;
} reader;

/* Index of the column; a new one is appended. */
static size_t find_column(reader *r, cli_group group, const char *name, bool is_sd)
{
    cli_collect *t = r->table;
    for (size_t k = 0; k < t->n_columns; k++)
        if (t->columns[k].group == group && t->columns[k].is_sd == is_sd &&
            !strcmp(t->columns[k].name, name))
            return k;
    if (t->n_columns == r->n_places) {
        const size_t more = r->n_places ? 2 * r->n_places : 64;
        r->status = sdm_grow((void **)&t->columns, r->n_places, more, sizeof *t->columns, "columns",
                             r->err);
        if (r->status) return 0;
        r->n_places = more;
    }
    cli_collect_column *c = &t->columns[t->n_columns];
    *c = (cli_collect_column){.group = group, .is_sd = is_sd};
    snprintf(c->name, sizeof c->name, "%s", name);
    return t->n_columns++;
}

/* Adds the number at index `at` of the JSON document; 0: there is none. A number that is null has
 * its column, too. */
static void add(reader *r, cli_group group, const char *name, bool is_sd, size_t at)
{
    double value = NAN;
    if (r->status || !at) return;
    if (!sdm_json_number(r->json, at, &value)) value = NAN;
    const size_t column = find_column(r, group, name, is_sd);
    if (!r->status && r->n == r->capacity) {
        const size_t more = r->capacity ? 2 * r->capacity : 256;
        r->status = sdm_grow((void **)&r->entries, r->capacity, more, sizeof *r->entries, "numbers",
                             r->err);
        if (!r->status) r->capacity = more;
    }
    if (!r->status) r->entries[r->n++] = (entry){r->row, column, value};
}

static void add_params(reader *r)
{
    const sdm_json_document *d = r->json;
    const size_t params = sdm_json_member(d, 0, "parameters"),
                 sds = sdm_json_member(d, 0, "parameters_sd");
    if (!params || d->values[params].kind != '{') return;
    for (size_t k = params + 1; k < d->values[params].next; k = d->values[k + 1].next) {
        char name[100];
        if (!sdm_json_word(d, k, name, sizeof name)) continue;
        add(r, CLI_GROUP_PARAM, name, false, k + 1);
        add(r, CLI_GROUP_PARAM, name, true, sds ? sdm_json_member(d, sds, name) : 0);
    }
}

/* Adds the three numbers of an array as NAME_x, NAME_y, NAME_z. */
static void add_vector(reader *r, size_t object, const char *key, const char *sd_key,
                       const char *name)
{
    const sdm_json_document *d = r->json;
    const size_t v = sdm_json_member(d, object, key), sd = sdm_json_member(d, object, sd_key);
    for (int a = 0; a < 3; a++) {
        char column[100];
        snprintf(column, sizeof column, "%s_%c", name, "xyz"[a]);
        const size_t at = v + 1 + (size_t)a, sd_at = sd + 1 + (size_t)a;
        add(r, CLI_GROUP_POSE, column, false, v && at < d->values[v].next ? at : 0);
        add(r, CLI_GROUP_POSE, column, true, sd && sd_at < d->values[sd].next ? sd_at : 0);
    }
}

/* Adds the measures, objects {name, value, sd, unit}: "volume" in "mm^3" is volume_mm3. */
static void add_measures(reader *r)
{
    const sdm_json_document *d = r->json;
    const size_t list = sdm_json_member(d, 0, "measures");
    if (!list || d->values[list].kind != '[') return;
    for (size_t k = list + 1; k < d->values[list].next; k = d->values[k].next) {
        char name[100], unit[32] = "";
        const size_t at = sdm_json_member(d, k, "name"), of_unit = sdm_json_member(d, k, "unit");
        if (!at || !sdm_json_word(d, at, name, sizeof name - sizeof unit)) continue;
        if (of_unit && !sdm_json_word(d, of_unit, unit, sizeof unit)) *unit = '\0';
        size_t n = strlen(name);
        if (*unit) name[n++] = '_';
        for (const char *c = unit; *c; c++)
            if (isalnum((unsigned char)*c)) name[n++] = *c;
        name[n] = '\0';
        add(r, CLI_GROUP_MEASURE, name, false, sdm_json_member(d, k, "value"));
        add(r, CLI_GROUP_MEASURE, name, true, sdm_json_member(d, k, "sd"));
    }
}

static void add_overlap(reader *r)
{
    static const char *const keys[] = {"dice", "surface_mean_mm", "surface_q95_mm",
                                       "surface_hausdorff_mm"};
    const size_t overlap = sdm_json_member(r->json, 0, "overlap");
    for (size_t i = 0; overlap && i < sizeof keys / sizeof *keys; i++)
        add(r, CLI_GROUP_OVERLAP, keys[i], false, sdm_json_member(r->json, overlap, keys[i]));
}

static void add_numbers(reader *r)
{
    const size_t pose = sdm_json_member(r->json, 0, "pose");
    add_params(r);
    if (pose) {
        add_vector(r, pose, "rotation_rad", "rotation_sd_rad", "rotation");
        add_vector(r, pose, "translation_mm", "translation_sd_mm", "translation");
    }
    add_measures(r);
    add_overlap(r);
    add(r, CLI_GROUP_EVIDENCE, "evidence", false, sdm_json_member(r->json, 0, "evidence"));
}

/* Reads fit.json of the current row, if there is one: some fits are refused before an estimate. */
static void read_fit(reader *r, const char *out)
{
    cli_collect_row *row = &r->table->rows[r->row];
    char path[CLI_CASE_PATH_MAX];
    uint8_t *text = NULL;
    size_t size = 0;
    sdm_json_document d = {0};
    sdm_error missing = {0};
    cli_case_path(out, row->id, CLI_CASE_FIT, path);
    const sdm_status s = sdm_file_read(path, FIT_BYTES_MAX, &text, &size, &missing);
    if (s == SDM_E_IO) return;
    r->status = s ? sdm_fail(r->err, s, "%s", missing.text)
                  : sdm_json_parse(path, (const char *)text, size, &d, r->err);
    if (!r->status) {
        r->json = &d;
        const size_t verdict = sdm_json_member(&d, 0, "verdict"),
                     grade = verdict ? sdm_json_member(&d, verdict, "grade") : 0;
        if (!grade || !sdm_json_word(&d, grade, row->verdict, sizeof row->verdict))
            *row->verdict = '\0';
        add_numbers(r);
    }
    sdm_json_document_dispose(&d);
    sdm_free(text);
}

static void read_row(reader *r, const char *out)
{
    cli_collect_row *row = &r->table->rows[r->row];
    cli_case_end end;
    row->id = r->table->ids.id[r->row];
    cli_record_read(out, row->id, true, &end);
    row->state = end.state;
    row->exit_code = end.exit_code;
    if (end.state == CLI_CASE_MISSING) *end.reason = '\0';
    r->status = SDM_ALLOC(&row->reason, strlen(end.reason) + 1, "reason", r->err);
    if (!r->status) strcpy(row->reason, end.reason);
    if (!r->status && (end.state == CLI_CASE_ACCEPTED || end.state == CLI_CASE_REFUSED))
        read_fit(r, out);
}

/* Sorts the columns of the table by group, and within a group in the order in which they were
 * found; then sets table->values[row][column]. */
static sdm_status fill(reader *r)
{
    cli_collect *t = r->table;
    cli_collect_column *sorted = NULL;
    size_t *place = NULL, n = 0, count = 0;
    sdm_status s = SDM_ALLOC(&sorted, t->n_columns, "columns", r->err);
    if (!s) s = SDM_ALLOC(&place, t->n_columns, "columns", r->err);
    if (!s) s = sdm_mul(t->ids.n, t->n_columns, &count, r->err);
    if (!s) s = SDM_ALLOC(&t->values, count, "numbers", r->err);
    for (int group = 0; group < CLI_N_GROUPS && !s; group++)
        for (size_t k = 0; k < t->n_columns; k++)
            if (t->columns[k].group == (cli_group)group) place[k] = n, sorted[n++] = t->columns[k];
    for (size_t i = 0; i < count && !s; i++) t->values[i] = NAN;
    for (size_t i = 0; i < r->n && !s; i++)
        t->values[r->entries[i].row * t->n_columns + place[r->entries[i].column]] =
            r->entries[i].value;
    sdm_free(place);
    if (s) {
        sdm_free(sorted);
        return s;
    }
    sdm_free(t->columns);
    t->columns = sorted;
    return SDM_OK;
}

sdm_status cli_collect_read(const char *out, cli_collect *table, sdm_error *err)
{
    reader r = {.table = table, .err = err};
    r.status = cli_cohort_list_read(out, &table->ids, err);
    if (!r.status) r.status = SDM_ALLOC(&table->rows, table->ids.n, "table", err);
    for (; !r.status && r.row < table->ids.n; r.row++) read_row(&r, out);
    if (!r.status) r.status = fill(&r);
    sdm_free(r.entries);
    return r.status;
}

void cli_collect_dispose(cli_collect *table)
{
    for (size_t i = 0; table->rows && i < table->ids.n; i++) {
        sdm_free(table->rows[i].reason);
        sdm_text_dispose(&table->rows[i].outliers);
    }
    sdm_free(table->rows);
    sdm_free(table->columns);
    sdm_free(table->values);
    cli_ids_dispose(&table->ids);
}
