/* Fits the cases of a table, or of a part of it. */
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "cohort.h"
#include "inputs/part.h"
#include "report/terminal.h"
#include "sdm/internal/file.h"

/* A run over the cases first .. end - 1. */
typedef struct cohort_run {
    cli_cohort cohort;
    cli_cohort_fit *fit;
    cli_part part;
    size_t first, end;
    struct timespec begin; /* by the clock of the file system of the results */
    size_t done[4];        /* cases by state, of this run and of earlier ones */
    size_t n_earlier;      /* that were done before */
    size_t n_held;         /* that another process works on */
} cohort_run;

/* ---- the part ---- */

static sdm_status read_part(cohort_run *r, sdm_error *err)
{
    const sdm_status s = cli_read_part(r->cohort.args->part, &r->part, err);
    if (s) return s;
    const size_t n = r->cohort.cells.n_rows;
    r->first = n * (r->part.part - 1) / r->part.of;
    r->end = n * r->part.part / r->part.of;
    return SDM_OK;
}

static void notice_part(const cohort_run *r)
{
    const size_t n = r->cohort.cells.n_rows;
    if (r->part.of == 1) return;
    if (r->first == r->end)
        cli_notice("part %zu of %zu: none of the %zu cases; the others do them", r->part.part,
                   r->part.of, n);
    else
        cli_notice("part %zu of %zu: cases %zu to %zu of %zu; the others are not done by this call",
                   r->part.part, r->part.of, r->first + 1, r->end, n);
}

/* ---- the fit of one case: whether it is to be done, its lease, its record ---- */

static bool is_later(const struct timespec *a, const struct timespec *b)
{
    return a->tv_sec > b->tv_sec || (a->tv_sec == b->tv_sec && a->tv_nsec > b->tv_nsec);
}

/* Whether the record of a case is that of the key, so that the case need not be done again. A case
 * that failed is tried again in every run, but by one of the processes that share the cases. */
static bool is_done(const cohort_run *r, const char *id, const char *key, cli_case_end *end)
{
    char path[CLI_CASE_PATH_MAX];
    struct stat st;
    cli_record_read(r->cohort.out, id, true, end);
    if (end->state == CLI_CASE_MISSING || strcmp(end->key, key)) return false;
    if (end->state != CLI_CASE_FAILED) return true;
    cli_case_path(r->cohort.out, id, CLI_CASE_RECORD, path);
    return r->cohort.args->cohort.claim && !stat(path, &st) && is_later(&st.st_mtim, &r->begin);
}

static void notice_end(const cohort_run *r, size_t i, const cli_case_end *end)
{
    cli_notice("case %zu of %zu, %s: %s, %.3g s%s%s", i + 1, r->cohort.cells.n_rows,
               cli_cohort_id(&r->cohort, i), cli_case_state_name(end->state), end->seconds,
               *end->reason ? ": " : "", end->reason);
}

/* Fits a case whose lease is held, and writes its record. */
static sdm_status fit_case(cohort_run *r, size_t i, const cli_words *w, const char *key,
                           cli_lease *lease, sdm_error *err)
{
    const char *out = r->cohort.out, *id = cli_cohort_id(&r->cohort, i);
    char folder[CLI_CASE_PATH_MAX];
    cli_case_end end = {.state = CLI_CASE_MISSING};
    cli_case_path(out, id, NULL, folder);
    cli_record_remove(out, id, &w->outputs);
    sdm_status s = cli_cohort_child(w, folder, r->fit, lease, &end, err);
    cli_record_sweep(out, id);
    memcpy(end.key, key, sizeof end.key);
    if (!s) s = cli_record_write(out, id, &end, &w->outputs, err);
    cli_lease_release(lease, !s);
    if (s) return s;
    r->done[end.state]++;
    notice_end(r, i, &end);
    return SDM_OK;
}

/* Takes the lease of a case and fits it, unless that is done or another process does it. */
static sdm_status take_case(cohort_run *r, size_t i, const cli_words *w, const char *key,
                            sdm_error *err)
{
    const char *id = cli_cohort_id(&r->cohort, i);
    char folder[CLI_CASE_PATH_MAX], holder[200];
    cli_lease lease = {.number = 0};
    cli_case_end end;
    cli_case_path(r->cohort.out, id, NULL, folder);
    sdm_status s = sdm_make_folder(folder, err);
    if (!s) s = cli_lease_take(folder, &lease, holder, err);
    if (s) return s;
    if (*holder) {
        r->n_held++;
        cli_notice("case %zu of %zu, %s: %s works on it", i + 1, r->cohort.cells.n_rows, id,
                   holder);
        return SDM_OK;
    }
    // it may have been done before the lease was taken
    if (!is_done(r, id, key, &end)) return fit_case(r, i, w, key, &lease, err);
    cli_lease_release(&lease, true);
    r->done[end.state]++;
    r->n_earlier++;
    return SDM_OK;
}

/* Removes leases that processes left that were killed after the record of the case was written. */
static sdm_status drop_leases(const cohort_run *r, size_t i, sdm_error *err)
{
    const char *id = cli_cohort_id(&r->cohort, i);
    char first[CLI_CASE_PATH_MAX], folder[CLI_CASE_PATH_MAX], holder[200];
    cli_lease lease = {.number = 0};
    cli_case_path(r->cohort.out, id, CLI_CASE_LEASE "-1", first);
    if (access(first, F_OK)) return SDM_OK;
    cli_case_path(r->cohort.out, id, NULL, folder);
    const sdm_status s = cli_lease_take(folder, &lease, holder, err);
    if (!s && lease.number) cli_lease_release(&lease, true);
    return s;
}

static sdm_status do_case(cohort_run *r, size_t i, sdm_error *err)
{
    cli_words w = {0};
    char key[SDM_SHA256_TEXT];
    cli_case_end end;
    sdm_status s = cli_check_interrupt(err);
    if (!s) s = cli_words_make(&r->cohort, i, &w, err);
    if (!s) s = cli_words_key(&w, key, err);
    if (!s && is_done(r, cli_cohort_id(&r->cohort, i), key, &end)) {
        r->done[end.state]++;
        r->n_earlier++;
        s = drop_leases(r, i, err);
    } else if (!s) {
        s = take_case(r, i, &w, key, err);
    }
    cli_words_dispose(&w);
    return s;
}

/* ---- the run ---- */

/* Makes the folder of the results with the list of the cases; r->begin = its clock. */
static sdm_status prepare(cohort_run *r, sdm_error *err)
{
    char path[CLI_CASE_PATH_MAX];
    struct stat st;
    sdm_outfile *probe = NULL;
    sdm_status s = sdm_make_folder(r->cohort.out, err);
    if (!s) s = cli_cohort_list_write(&r->cohort, err);
    snprintf(path, sizeof path, "%s/" CLI_COHORT_LIST, r->cohort.out);
    if (!s) s = sdm_outfile_open(path, &probe, err);
    if (s) return s;
    if (stat(sdm_outfile_temp_path(probe), &st))
        s = sdm_fail(err, SDM_E_IO, "%s: cannot read its time", path);
    else
        r->begin = st.st_mtim;
    sdm_outfile_discard(&probe);
    return s;
}

static sdm_status print_summary(const cohort_run *r, sdm_error *err)
{
    const size_t *done = r->done, n = r->end - r->first;
    if (!r->cohort.args->json) {
        printf("%zu cases: %zu accepted, %zu refused, %zu failed, %zu with other processes; %zu "
               "were done before\n",
               n, done[CLI_CASE_ACCEPTED], done[CLI_CASE_REFUSED], done[CLI_CASE_FAILED], r->n_held,
               r->n_earlier);
        return SDM_OK;
    }
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_int(&j, "cases_of_table", (int64_t)r->cohort.cells.n_rows);
    sdm_json_int(&j, "cases", (int64_t)n);
    for (int i = CLI_CASE_ACCEPTED; i <= CLI_CASE_FAILED; i++)
        sdm_json_int(&j, cli_case_state_name((cli_case_state)i), (int64_t)done[i]);
    sdm_json_int(&j, "held", (int64_t)r->n_held);
    sdm_json_int(&j, "done_before", (int64_t)r->n_earlier);
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

/* Fails with exit code 6 when cases of this run are not done. */
static sdm_status check_all_done(const cohort_run *r, sdm_error *err)
{
    const size_t n = r->end - r->first, failed = r->done[CLI_CASE_FAILED];
    const bool held = r->n_held && !r->cohort.args->cohort.claim;
    if (!failed && !held) return SDM_OK;
    cli_set_incomplete();
    if (failed)
        return sdm_fail(err, SDM_E_QUALITY,
                        "%s: %zu of %zu cases failed: %s/" CLI_COHORT_FAILED
                        " has the reasons; the "
                        "same command tries them again",
                        r->cohort.csv, failed, n, r->cohort.out);
    return sdm_fail(err, SDM_E_QUALITY,
                    "%s: another process works on %zu of %zu cases; --claim shares them",
                    r->cohort.csv, r->n_held, n);
}

/* Brings failed.csv up to date, which lists the cases of all parts. */
static sdm_status write_failed(const cohort_run *r, sdm_error *err)
{
    char path[CLI_CASE_PATH_MAX];
    cli_ids ids = {0};
    snprintf(path, sizeof path, "%s/" CLI_COHORT_FAILED, r->cohort.out);
    if (!r->done[CLI_CASE_FAILED] && access(path, F_OK)) return SDM_OK;
    sdm_status s = cli_cohort_list_read(r->cohort.out, &ids, err);
    if (!s) s = cli_cohort_write_failed(r->cohort.out, &ids, err);
    cli_ids_dispose(&ids);
    return s;
}

static sdm_status run_cases(cohort_run *r, sdm_error *err)
{
    sdm_status s = read_part(r, err);
    if (!s) s = prepare(r, err);
    if (!s) notice_part(r);
    for (size_t i = r->first; i < r->end && !s; i++) s = do_case(r, i, err);
    // also after an interrupt: the cases that failed before it
    const sdm_status ended = s;
    if (!ended || ended == SDM_E_CANCELLED) s = write_failed(r, err);
    if (!s && ended) return sdm_fail(err, SDM_E_CANCELLED, "interrupted");
    if (!s) s = print_summary(r, err);
    return s ? s : check_all_done(r, err);
}

sdm_status cli_cohort_run(const cli_args *args, cli_cohort_fit *fit, sdm_error *err)
{
    cohort_run r = {.fit = fit};
    sdm_status s = cli_cohort_read(args, &r.cohort, err);
    if (!s) s = cli_cohort_check(&r.cohort, err);
    if (!s) s = run_cases(&r, err);
    cli_cohort_dispose(&r.cohort);
    return s;
}
