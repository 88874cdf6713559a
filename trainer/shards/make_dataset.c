/* Makes the shards of a dataset, or of a part of it: each thread makes a file at a time. */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "data/workbench.h"
#include "sdm/internal/file.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/train.h"
#include "shard.h"

typedef struct making {
    const sdm_dataset_opts *opts;
    sdm_dataset_report *report;
    dataset data; /* the parameter space, and a store with the maps that are in files already */
    sdm_text identity;
    shard_form form;
    size_t n[MAP_SETS]; /* maps of each set */
    size_t per_shard;
    size_t maps_done, maps_all; /* of this part */
    sdm_error failure;          /* that ends the whole run; status 0: none */
} making;

/* ---- the files ---- */

static size_t shards_of(const making *m, int set)
{
    return (m->n[set] + m->per_shard - 1) / m->per_shard;
}

/* The maps of file number i of all. */
static shard_place place_of(const making *m, size_t i)
{
    int set = 0;
    while (i >= shards_of(m, set)) i -= shards_of(m, set++);
    const size_t first = i * m->per_shard, left = m->n[set] - first;
    return (shard_place){(map_set)set, first, left < m->per_shard ? left : m->per_shard};
}

static void params_of(const dataset *d, const shard_place *at, size_t k, double *p)
{
    if (at->set == MAP_HOLDOUT)
        trainer_dataset_holdout_params(d, at->first + k, p);
    else if (at->set == MAP_STATIC)
        trainer_dataset_static_params(d, at->first + k, p);
    else
        trainer_dataset_random_params(d, at->first + k, p);
}

/* ---- one file ---- */

/* Counts a finished map, and tells the progress in the calling thread of the run. */
static void count_map(making *m, size_t n)
{
    size_t done;
#pragma omp critical(sdm_dataset_make)
    done = m->maps_done += n;
    if (m->opts->progress && sdm_thread() == 0) m->opts->progress(m->opts->user, done, m->maps_all);
}

/* Ends the run with this error. */
static void stop(making *m, const sdm_error *e)
{
#pragma omp critical(sdm_dataset_make)
    if (!m->failure.status) m->failure = *e;
}

static bool is_stopped(making *m)
{
    bool stopped;
#pragma omp critical(sdm_dataset_make)
    stopped = m->failure.status != SDM_OK;
    sdm_error e = {0};
    if (!stopped && m->opts->cancelled && m->opts->cancelled(m->opts->user)) {
        sdm_fail(&e, SDM_E_CANCELLED, "interrupted");
        stop(m, &e);
    }
    return stopped || e.status;
}

/* *kept: the file is there with at least these maps, and whole. A damaged one is told. */
static void check_file(making *m, const char *path, const shard_place *at, bool *kept)
{
    shard there;
    sdm_error reason = {0};
    *kept = false;
    if (access(path, F_OK)) return;
    const sdm_status s = trainer_shard_read(path, &m->form, true, &there, &reason);
    *kept = !s && there.place.n >= at->n;
#pragma omp critical(sdm_dataset_make)
    {
        // what only the header shows was told when the store was opened
        if (s == SDM_E_FORMAT && there.maps_at && m->opts->warning)
            m->opts->warning(m->opts->user, reason.text);
        if (*kept)
            m->report->kept++, m->report->maps_kept += at->n, m->report->bytes += there.bytes;
    }
    trainer_shard_dispose(&there);
}

/* Computes map k of a file. One that another file has, whole, is taken from there. */
static sdm_status make_map(const making *m, workbench *w, const double *p, float *map,
                           sdm_error *err)
{
    dataset without = m->data;
    sdm_status s = trainer_workbench_exact(w, &m->data, p, err);
    without.store = NULL;
    if (s == SDM_E_FORMAT || s == SDM_E_IO) s = trainer_workbench_exact(w, &without, p, err);
    if (!s) memcpy(map, w->exact, m->form.n_voxels * sizeof *map);
    return s;
}

/* Makes the maps and the file. *finished: all maps were made. */
static sdm_status make_file(making *m, const char *path, const shard_place *at, bool *finished,
                            sdm_error *err)
{
    workbench w = {0};
    double *params = NULL;
    float *maps = NULL;
    size_t count;
    uint64_t bytes = 0;
    *finished = false;
    sdm_status s = trainer_workbench_create(&w, &m->data, err);
    if (!s) s = SDM_ALLOC(&params, at->n * m->form.n_params, "parameters", err);
    if (!s) s = sdm_mul(at->n, m->form.n_voxels, &count, err);
    if (!s) s = sdm_alloc_unset((void **)&maps, count, sizeof *maps, "maps of a file", err);
    for (size_t k = 0; k < at->n && !s && !is_stopped(m); k++) {
        double *p = params + k * m->form.n_params;
        params_of(&m->data, at, k, p);
        s = make_map(m, &w, p, maps + k * m->form.n_voxels, err);
        if (s) sdm_fail_in(err, s, "map %zu", at->first + k);
        if (!s) count_map(m, 1);
        *finished = !s && k + 1 == at->n;
    }
    trainer_workbench_dispose(&w);
    if (*finished) {
        s = trainer_shard_write(path, &m->form, at, params, maps, &bytes, err);
        if (s) stop(m, err);
    }
#pragma omp critical(sdm_dataset_make)
    if (*finished && !s)
        m->report->made++, m->report->maps_made += at->n, m->report->bytes += bytes;
    sdm_free(maps);
    sdm_free(params);
    return s;
}

/* Notes a file whose maps cannot be made. The first one by number is that of the report. */
static void note_failed(making *m, const char *path, size_t i, size_t *first, const sdm_error *why)
{
#pragma omp critical(sdm_dataset_make)
    {
        char line[SDM_ERROR_TEXT_MAX + 400];
        m->report->failed++;
        if (i < *first) {
            *first = i;
            snprintf(m->report->reason, sizeof m->report->reason, "%s", why->text);
        }
        snprintf(line, sizeof line, "%.300s is not made: %s", path, why->text);
        if (m->opts->warning) m->opts->warning(m->opts->user, line);
    }
}

static void do_file(making *m, size_t i, size_t *first_failed)
{
    char path[SDM_PATH_TEXT_MAX + SHARD_NAME_MAX + 2], name[SHARD_NAME_MAX];
    sdm_error err = {0};
    bool kept, finished;
    const shard_place at = place_of(m, i);
    trainer_shard_name(&at, name);
    snprintf(path, sizeof path, "%s/%s", m->opts->folder, name);
    check_file(m, path, &at, &kept);
    if (kept) {
        count_map(m, at.n);
        return;
    }
    const sdm_status s = make_file(m, path, &at, &finished, &err);
    err.status = s;
    if (s == SDM_E_NOMEM)
        stop(m, &err);
    else if (s && !finished)
        note_failed(m, path, i, first_failed, &err);
}

/* ---- the run ---- */

static void tell_damaged(void *user, const char *message)
{
    const making *m = user;
    if (m->opts->warning) m->opts->warning(m->opts->user, message);
}

/* The parameter space and the numbers of maps. */
static sdm_status prepare(making *m, const sdm_config *c, const sdm_instance *shape, sdm_error *err)
{
    dataset *d = &m->data;
    sdm_instance_params(shape, &d->n_params);
    if (d->n_params > SDM_POD_MAX_PARAMS)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%zu parameters, at most %d can be trained",
                        d->n_params, SDM_POD_MAX_PARAMS);
    d->shape = shape;
    d->grid = &c->grid;
    d->seed = c->seed;
    d->n_voxels = sdm_grid_count(&c->grid);
    sdm_status s = sdm_train_ranges(c, shape, d->min, d->max, err);
    if (!s) s = sdm_train_distributions(c, shape, d->min, d->max, d->distribution, err);
    if (!s) s = trainer_dataset_static(d, c, err);
    if (!s) s = trainer_shard_identity(c, shape, &m->identity, err);
    if (s) return s;
    if (d->n_static > UINT32_MAX / 8 || m->opts->n_random > UINT32_MAX / 8)
        return sdm_fail(err, SDM_E_CONFIG,
                        "%s: data.static (%zu maps) and %zu random maps are "
                        "more than a dataset holds",
                        c->file, d->n_static, m->opts->n_random);
    m->form = (shard_form){m->identity.data, d->n_params, d->n_voxels};
    m->per_shard = trainer_shard_maps(&c->grid);
    m->n[MAP_HOLDOUT] = (size_t)c->data.holdout;
    m->n[MAP_STATIC] = d->n_static;
    m->n[MAP_RANDOM] = m->opts->n_random;
    return SDM_OK;
}

/* The files of the part: contiguous, as the cases of a cohort. */
static void choose_part(making *m)
{
    sdm_dataset_report *r = m->report;
    const sdm_dataset_opts *o = m->opts;
    for (int set = 0; set < MAP_SETS; set++) r->n_files += shards_of(m, set);
    r->first = r->n_files * (o->part - 1) / o->n_parts;
    r->end = r->n_files * o->part / o->n_parts;
    for (size_t i = r->first; i < r->end; i++) m->maps_all += place_of(m, i).n;
}

sdm_status sdm_dataset_make(const sdm_config *config, const sdm_instance *shape,
                            const sdm_dataset_opts *opts, sdm_dataset_report *report,
                            sdm_error *err)
{
    making m = {.opts = opts, .report = report};
    sdm_map_store *store = NULL;
    *report = (sdm_dataset_report){0};
    sdm_status s = prepare(&m, config, shape, err);
    if (!s) s = sdm_map_store_open(opts->folder, config, shape, tell_damaged, &m, &store, err);
    if (!s) s = sdm_make_folder(opts->folder, err);
    if (!s) {
        m.data.store = store;
        choose_part(&m);
        size_t first_failed = SIZE_MAX;
#pragma omp parallel for schedule(dynamic) num_threads(sdm_threads(opts->n_threads))
        for (size_t i = report->first; i < report->end; i++)
            if (!is_stopped(&m)) do_file(&m, i, &first_failed);
        s = m.failure.status;
        if (s && err) *err = m.failure;
    }
    sdm_map_store_free(store);
    sdm_text_dispose(&m.identity);
    return s;
}
