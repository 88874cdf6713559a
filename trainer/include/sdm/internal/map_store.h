/* Exact maps kept in files: a folder of shards, made from a configuration, from which trainings
   take their maps in place of computing them. docs/dataset.md has the layout. */
#pragma once

#include <stdbool.h>

#include "sdm/internal/config.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_map_store sdm_map_store;

/* Opens the shards in `folder`, which must be those of this configuration: shape with options,
   ranges and distributions, grid, static grid, seed. Their maps are not read yet. The grid of the
   configuration is complete (sdm_train_complete()). damaged: NULL, or a function that is told the
   message about each file that is damaged, which is then left out; a folder may then be empty or
   missing. Free with sdm_map_store_free(). SDM_E_IO; SDM_E_CONFIG: there is no shard, or a shard is
   of another configuration, and the message names what differs; SDM_E_FORMAT: a file is damaged;
   SDM_E_NOMEM. */
sdm_status sdm_map_store_open(const char *folder, const sdm_config *config,
                              const sdm_instance *shape,
                              void (*damaged)(void *user, const char *message), void *user,
                              sdm_map_store **out, sdm_error *err);
void sdm_map_store_free(sdm_map_store *s);

/* Number of maps. [any thread] */
size_t sdm_map_store_maps(const sdm_map_store *s);

/* A map of a store. */
typedef struct sdm_stored_map {
    const double *p;     /* [n_params], owned by the store */
    size_t number;       /* in its set */
    char file[48];       /* name of its file in the folder */
    const char *version; /* of the program that made it, owned by the store */
} sdm_stored_map;

/* Map i of sdm_map_store_maps(). [any thread] */
sdm_stored_map sdm_map_store_map(const sdm_map_store *s, size_t i);

/* Makes a few of the maps and compares them with those of the files. SDM_E_CONFIG: they differ, so
   another program or shape has made them; errors of the shape and of sdm_map_store_read(). */
sdm_status sdm_map_store_compare(const sdm_map_store *s, const sdm_config *config,
                                 const sdm_instance *shape, sdm_error *err);

/* true: the store has the map at p[n_params], bit for bit these parameters. [any thread] */
bool sdm_map_store_has(const sdm_map_store *s, const double *p);

/* Reads the map at p[n_params], if the store has it, into map[nz][ny][nx], mm, and compares its
   checksum. *found: whether it has. SDM_E_IO, SDM_E_FORMAT: the map is damaged. [any thread] */
sdm_status sdm_map_store_read(const sdm_map_store *s, const double *p, float *map, bool *found,
                              sdm_error *err);

/* Callbacks and choices of sdm_dataset_make(). */
typedef struct sdm_dataset_opts {
    const char *folder;   /* made if it is missing */
    size_t part, n_parts; /* part 1 .. n_parts of the files */
    size_t n_random;      /* random maps */
    int n_threads;        /* 0: all */
    /* Called by the calling thread, `done` of `all` maps are there; may be NULL, as the others. */
    void (*progress)(void *user, size_t done, size_t all);
    bool (*cancelled)(void *user); /* [any thread] */
    /* A warning of one line: a damaged file that is made again, a file that cannot be made. One
       call at a time. [any thread] */
    void (*warning)(void *user, const char *line);
    void *user;
} sdm_dataset_opts;

typedef struct sdm_dataset_report {
    size_t n_files;                  /* of all parts */
    size_t first, end;               /* files of this part: number first .. end - 1, from 0 */
    size_t made, kept, failed;       /* files of this part; kept: were there before */
    size_t maps_made, maps_kept;     /* maps in these files */
    uint64_t bytes;                  /* size of the files made and kept */
    char reason[SDM_ERROR_TEXT_MAX]; /* why the first of the failed ones failed */
} sdm_dataset_report;

/* Makes the shards of one part: held-out maps, static grid and n_random random maps, the same as a
   training of this configuration makes. A shard that is there and whole is kept. A file appears
   under its name when it is complete. A map that cannot be made leaves its file out, and the others
   are made. *report is set also after an error. SDM_E_CONFIG: the folder holds shards of another
   configuration; SDM_E_IO, SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_dataset_make(const sdm_config *config, const sdm_instance *shape,
                            const sdm_dataset_opts *opts, sdm_dataset_report *report,
                            sdm_error *err);

#ifdef __cplusplus
}
#endif
