/* A folder of shards: which maps it has, found by their parameters. */
#include "sdm/internal/map_store.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/heap.h"
#include "shard.h"

typedef struct stored_map {
    uint32_t shard, k; /* map k of a shard */
} stored_map;

struct sdm_map_store {
    char folder[SDM_PATH_TEXT_MAX];
    sdm_text identity;
    shard_form form;
    shard *shards; // [n_shards]
    size_t n_shards;
    /* Table of the maps by the hash of their parameters: place i or one of those after it holds the
       number of a map, from 1; 0: free. */
    uint32_t *table; // [mask + 1]
    size_t mask;
    stored_map *maps; // [n_maps]
    size_t n_maps;
};

enum { STORE_PATH_MAX = SDM_PATH_TEXT_MAX + SHARD_NAME_MAX + 2, MAPS_MAX = UINT32_MAX / 4 };

static void path_of(const sdm_map_store *s, const char *name, char path[STORE_PATH_MAX])
{
    snprintf(path, STORE_PATH_MAX, "%s/%s", s->folder, name);
}

static void path_of_shard(const sdm_map_store *s, const shard *file, char path[STORE_PATH_MAX])
{
    char name[SHARD_NAME_MAX];
    trainer_shard_name(&file->place, name);
    path_of(s, name, path);
}

/* ---- the table ---- */

static const double *params_of(const sdm_map_store *s, const stored_map *m)
{
    return s->shards[m->shard].params + m->k * s->form.n_params;
}

/* Returns the place in the table of the map at p, or the free one where it belongs. */
static uint32_t *place_of(const sdm_map_store *s, const double *p)
{
    const size_t bytes = s->form.n_params * sizeof *p;
    for (size_t i = (size_t)sdm_crc64(0, p, bytes) & s->mask;; i = (i + 1) & s->mask)
        if (!s->table[i] || !memcmp(p, params_of(s, &s->maps[s->table[i] - 1]), bytes))
            return &s->table[i];
}

static sdm_status make_table(sdm_map_store *s, sdm_error *err)
{
    size_t n = 0, places = 16;
    for (size_t i = 0; i < s->n_shards; i++) n += s->shards[i].place.n;
    if (n > MAPS_MAX)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: more than %u maps", s->folder,
                        (unsigned)MAPS_MAX);
    while (places < 2 * n) places *= 2;
    s->mask = places - 1;
    sdm_status status = SDM_ALLOC(&s->table, places, "table of maps", err);
    if (!status) status = SDM_ALLOC(&s->maps, n, "table of maps", err);
    for (size_t i = 0; i < s->n_shards && !status; i++)
        for (size_t k = 0; k < s->shards[i].place.n; k++) {
            const stored_map m = {(uint32_t)i, (uint32_t)k};
            uint32_t *place = place_of(s, params_of(s, &m));
            if (*place) continue; // the same parameters twice
            s->maps[s->n_maps++] = m;
            *place = (uint32_t)s->n_maps;
        }
    return status;
}

static const stored_map *find(const sdm_map_store *s, const double *p)
{
    const uint32_t number = *place_of(s, p);
    return number ? &s->maps[number - 1] : NULL;
}

bool sdm_map_store_has(const sdm_map_store *s, const double *p) { return find(s, p) != NULL; }

sdm_status sdm_map_store_read(const sdm_map_store *s, const double *p, float *map, bool *found,
                              sdm_error *err)
{
    char path[STORE_PATH_MAX];
    const stored_map *m = find(s, p);
    *found = m != NULL;
    if (!m) return SDM_OK;
    path_of_shard(s, &s->shards[m->shard], path);
    return trainer_shard_map(path, &s->shards[m->shard], &s->form, m->k, map, err);
}

sdm_stored_map sdm_map_store_map(const sdm_map_store *s, size_t i)
{
    const stored_map *m = &s->maps[i];
    const shard *file = &s->shards[m->shard];
    sdm_stored_map out = {params_of(s, m), file->place.first + m->k, "", file->version};
    trainer_shard_name(&file->place, out.file);
    return out;
}

size_t sdm_map_store_maps(const sdm_map_store *s) { return s->n_maps; }

/* ---- the folder ---- */

static int compare_names(const void *a, const void *b) { return strcmp(a, b); }

/* *names = the names of the shards in the folder, in alphabetical order. A folder that is not there
 * has none. */
static sdm_status list_names(const char *folder, char (**names)[SHARD_NAME_MAX], size_t *n,
                             sdm_error *err)
{
    size_t room = 0;
    *n = 0;
    DIR *dir = opendir(folder);
    if (!dir && errno == ENOENT) return SDM_OK;
    if (!dir) return sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", folder, strerror(errno));
    sdm_status s = SDM_OK;
    for (const struct dirent *one; !s && (one = readdir(dir));) {
        const size_t length = strlen(one->d_name), ending = strlen(SHARD_ENDING);
        if (length < ending || length >= SHARD_NAME_MAX ||
            strcmp(one->d_name + length - ending, SHARD_ENDING))
            continue;
        if (*n == room) {
            const size_t more = room ? 2 * room : 64;
            s = sdm_grow((void **)names, room, more, sizeof **names, "list of files", err);
            if (s) break;
            room = more;
        }
        memcpy((*names)[(*n)++], one->d_name, length + 1);
    }
    closedir(dir);
    if (*n) qsort(*names, *n, sizeof **names, compare_names);
    return s;
}

static sdm_status read_shards(sdm_map_store *s, char (*names)[SHARD_NAME_MAX], size_t n,
                              void (*damaged)(void *, const char *), void *user, sdm_error *err)
{
    char path[STORE_PATH_MAX];
    sdm_status status = SDM_ALLOC(&s->shards, n, "shards", err);
    for (size_t i = 0; i < n && !status; i++) {
        sdm_error reason = {0};
        shard *file = &s->shards[s->n_shards++];
        path_of(s, names[i], path);
        status = trainer_shard_read(path, &s->form, false, file, &reason);
        if (!status) continue;
        trainer_shard_dispose(file);
        if (status == SDM_E_FORMAT && damaged) {
            damaged(user, reason.text);
            s->n_shards--;
            status = SDM_OK;
        } else if (err) {
            *err = reason;
        }
    }
    return status;
}

/* ---- opening ---- */

static sdm_status open_store(sdm_map_store *s, const sdm_config *config, const sdm_instance *shape,
                             void (*damaged)(void *, const char *), void *user, sdm_error *err)
{
    char(*names)[SHARD_NAME_MAX] = NULL;
    size_t n = 0;
    s->form.n_voxels = sdm_grid_count(&config->grid);
    sdm_instance_params(shape, &s->form.n_params);
    sdm_status status = trainer_shard_identity(config, shape, &s->identity, err);
    s->form.identity = s->identity.data;
    if (!status) status = list_names(s->folder, &names, &n, err);
    if (!status && !n && !damaged)
        status = sdm_fail(err, SDM_E_CONFIG,
                          "%s: no shards of maps (*" SHARD_ENDING "): `sdmgen dataset` makes them",
                          s->folder);
    if (!status && n) status = read_shards(s, names, n, damaged, user, err);
    if (!status) status = make_table(s, err);
    sdm_free(names);
    return status;
}

sdm_status sdm_map_store_open(const char *folder, const sdm_config *config,
                              const sdm_instance *shape,
                              void (*damaged)(void *user, const char *message), void *user,
                              sdm_map_store **out, sdm_error *err)
{
    sdm_map_store *s = NULL;
    *out = NULL;
    if (strlen(folder) >= SDM_PATH_TEXT_MAX)
        return sdm_fail(err, SDM_E_ARG, "'%.100s...': the name is too long", folder);
    sdm_status status = SDM_ALLOC(&s, 1, "store of maps", err);
    if (status) return status;
    strcpy(s->folder, folder);
    for (size_t n = strlen(s->folder); n > 1 && s->folder[n - 1] == '/'; n--)
        s->folder[n - 1] = '\0';
    status = open_store(s, config, shape, damaged, user, err);
    if (status)
        sdm_map_store_free(s);
    else
        *out = s;
    return status;
}

void sdm_map_store_free(sdm_map_store *s)
{
    if (!s) return;
    for (size_t i = 0; i < s->n_shards; i++) trainer_shard_dispose(&s->shards[i]);
    sdm_free(s->shards);
    sdm_free(s->table);
    sdm_free(s->maps);
    sdm_text_dispose(&s->identity);
    sdm_free(s);
}
