/* The record of a case, case.json: how its fit ended, the key of what decided the result, and
 * checksums of the files. It is written last, so a case with a whole record is finished. */
#include <dirent.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cohort.h"
#include "report/json_values.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/file.h"
#include "sdm/internal/json_read.h"
#include "sdm/memory.h"

enum { RECORD_BYTES_MAX = 1 << 20 };

static const char *const STATES[] = {[CLI_CASE_MISSING] = "missing",
                                     [CLI_CASE_ACCEPTED] = "accepted",
                                     [CLI_CASE_REFUSED] = "refused",
                                     [CLI_CASE_FAILED] = "failed"};
enum { N_STATES = sizeof STATES / sizeof *STATES };

const char *cli_case_state_name(cli_case_state state) { return STATES[state]; }

/* ---- writing ---- */

static void format_crc(uint64_t crc, char text[20]) { snprintf(text, 20, "%016" PRIx64, crc); }

static void add_file(sdm_json *j, const char *out, const char *id, const char *name)
{
    char path[CLI_CASE_PATH_MAX], text[20];
    uint64_t crc = 0;
    cli_case_path(out, id, name, path);
    if (sdm_file_checksum(path, &crc, NULL)) return;
    format_crc(crc, text);
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "file", name);
    sdm_json_text(j, "crc64", text);
    sdm_json_close(j, '}');
}

sdm_status cli_record_write(const char *out, const char *id, const cli_case_end *end,
                            const cli_list *outputs, sdm_error *err)
{
    char path[CLI_CASE_PATH_MAX];
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "made_by", "sdmgen " SDM_VERSION_TEXT);
    sdm_json_text(&j, "id", id);
    sdm_json_text(&j, "state", STATES[end->state]);
    sdm_json_int(&j, "exit_code", end->exit_code);
    sdm_json_text(&j, "reason", end->reason);
    sdm_json_text(&j, "key", end->key);
    sdm_json_real(&j, "seconds", end->seconds);
    sdm_json_open(&j, "files", '[');
    add_file(&j, out, id, CLI_CASE_FIT);
    for (size_t i = 0; i < outputs->n; i++) add_file(&j, out, id, outputs->items[i]);
    sdm_json_close(&j, ']');
    sdm_json_close(&j, '}');
    cli_case_path(out, id, CLI_CASE_RECORD, path);
    const sdm_status s = cli_json_write(&j, path, err);
    sdm_json_dispose(&j);
    return s;
}

/* ---- reading ---- */

/* The text and the values of a record. */
typedef struct record {
    uint8_t *text;
    sdm_json_document json;
} record;

/* false: there is no record that can be read. */
static bool open_record(const char *out, const char *id, record *r)
{
    char path[CLI_CASE_PATH_MAX];
    size_t size = 0;
    *r = (record){0};
    cli_case_path(out, id, CLI_CASE_RECORD, path);
    if (sdm_file_read(path, RECORD_BYTES_MAX, &r->text, &size, NULL)) return false;
    if (!sdm_json_parse(path, (const char *)r->text, size, &r->json, NULL)) return true;
    sdm_free(r->text);
    return false;
}

static void close_record(record *r)
{
    sdm_json_document_dispose(&r->json);
    sdm_free(r->text);
}

/* Whether file number k of the record (an object {file, crc64}) is as it was written. */
static bool is_whole(const record *r, size_t k, const char *out, const char *id)
{
    char name[CLI_CASE_PATH_MAX], path[CLI_CASE_PATH_MAX], text[20];
    uint64_t crc = 0;
    const size_t file = sdm_json_member(&r->json, k, "file"),
                 sum = sdm_json_member(&r->json, k, "crc64");
    if (!file || !sum || !sdm_json_word(&r->json, file, name, sizeof name)) return false;
    cli_case_path(out, id, name, path);
    if (sdm_file_checksum(path, &crc, NULL)) return false;
    format_crc(crc, text);
    return sdm_json_is(&r->json, sum, text);
}

static bool has_whole_files(const record *r, const char *out, const char *id)
{
    const size_t files = sdm_json_member(&r->json, 0, "files");
    if (!files) return false;
    for (size_t k = files + 1; k < r->json.values[files].next; k = r->json.values[k].next)
        if (!is_whole(r, k, out, id)) return false;
    return true;
}

static cli_case_state read_state(const record *r)
{
    const size_t at = sdm_json_member(&r->json, 0, "state");
    for (int i = 0; at && i < N_STATES; i++)
        if (sdm_json_is(&r->json, at, STATES[i])) return (cli_case_state)i;
    return CLI_CASE_MISSING;
}

void cli_record_read(const char *out, const char *id, bool check, cli_case_end *end)
{
    record r;
    double code = 0;
    *end = (cli_case_end){.state = CLI_CASE_MISSING};
    if (!open_record(out, id, &r)) return;
    const size_t key = sdm_json_member(&r.json, 0, "key"),
                 reason = sdm_json_member(&r.json, 0, "reason"),
                 exit_code = sdm_json_member(&r.json, 0, "exit_code");
    const bool read = key && reason && exit_code &&
                      sdm_json_word(&r.json, key, end->key, sizeof end->key) &&
                      sdm_json_word(&r.json, reason, end->reason, sizeof end->reason) &&
                      sdm_json_number(&r.json, exit_code, &code);
    end->exit_code = (int)code;
    if (read && (!check || has_whole_files(&r, out, id))) end->state = read_state(&r);
    close_record(&r);
}

/* ---- removing ---- */

static void remove_file(const char *out, const char *id, const char *name)
{
    char path[CLI_CASE_PATH_MAX];
    cli_case_path(out, id, name, path);
    unlink(path);
}

/* True for NAME.PROCESS.COUNTER.tmp, the temporary name of an output NAME. */
static bool is_temp(const char *name)
{
    char base[256];
    const int length = snprintf(base, sizeof base, "%s", name);
    if (length >= (int)sizeof base) return false;
    for (int part = 0; part < 3; part++) {
        char *dot = strrchr(base, '.');
        if (!dot) return false;
        *dot = '\0';
    }
    return sdm_outfile_is_temp(name, base);
}

void cli_record_sweep(const char *out, const char *id)
{
    char path[CLI_CASE_PATH_MAX];
    cli_case_path(out, id, NULL, path);
    DIR *folder = opendir(path);
    if (!folder) return;
    for (const struct dirent *one; (one = readdir(folder));)
        if (is_temp(one->d_name)) remove_file(out, id, one->d_name);
    closedir(folder);
}

void cli_record_remove(const char *out, const char *id, const cli_list *outputs)
{
    record r;
    const bool there = open_record(out, id, &r);
    remove_file(out, id, CLI_CASE_RECORD); // first: without its files it would be damaged
    const size_t files = there ? sdm_json_member(&r.json, 0, "files") : 0;
    for (size_t k = files + 1; files && k < r.json.values[files].next; k = r.json.values[k].next) {
        char name[CLI_CASE_PATH_MAX];
        const size_t file = sdm_json_member(&r.json, k, "file");
        if (file && sdm_json_word(&r.json, file, name, sizeof name) && !strchr(name, '/'))
            remove_file(out, id, name);
    }
    if (there) close_record(&r);
    remove_file(out, id, CLI_CASE_FIT);
    for (size_t i = 0; i < outputs->n; i++) remove_file(out, id, outputs->items[i]);
    cli_record_sweep(out, id);
}
