/* A shard: a file with consecutive exact maps of one set (docs/dataset.md has the layout). */
#pragma once

#include "sdm/internal/config.h"
#include "sdm/internal/text.h"
#include "sdm/registry.h"

/* The sets of maps of a training, in the order in which they are made. Map k of a set depends on
   the configuration and k alone. */
typedef enum map_set { MAP_HOLDOUT = 0, MAP_STATIC, MAP_RANDOM, MAP_SETS } map_set;

#define SHARD_ENDING ".sdms"

enum { SHARD_NAME_MAX = 48 };

/* Which maps a file holds: maps first .. first + n - 1 of the set. */
typedef struct shard_place {
    map_set set;
    size_t first, n;
} shard_place;

/* name = "random-00000111.sdms" */
void trainer_shard_name(const shard_place *at, char name[SHARD_NAME_MAX]);

/* Number of maps of a full shard: as many as fit into 16 MiB, 1 to 128. */
size_t trainer_shard_maps(const sdm_grid *grid);

/* Appends the lines key=value of all that decides the maps. SDM_E_NOMEM; SDM_E_CONFIG: ranges or
   distributions that do not fit the shape. */
sdm_status trainer_shard_identity(const sdm_config *config, const sdm_instance *shape,
                                  sdm_text *out, sdm_error *err);

/* The sizes of the maps of a configuration, and its identity. */
typedef struct shard_form {
    const char *identity;
    size_t n_params, n_voxels;
} shard_form;

/* A shard, without its maps. */
typedef struct shard {
    shard_place place;
    char version[32]; /* of the program that made it */
    double *params;   /* [n][n_params] */
    uint64_t *sums;   /* [n] CRC-64 of each map */
    uint64_t maps_at; /* where the maps begin in the file */
    uint64_t bytes;   /* size of the file */
} shard;

/* Reads a shard without its maps, with the checksums of all that is read. whole: also compares the
   checksums of the maps and of the file. trainer_shard_dispose() frees, also after an error.
   SDM_E_IO; SDM_E_FORMAT: damaged, or no shard; SDM_E_CONFIG: of another configuration. */
sdm_status trainer_shard_read(const char *path, const shard_form *form, bool whole, shard *out,
                              sdm_error *err);
void trainer_shard_dispose(shard *s);

/* Reads map k of the n of a shard. SDM_E_IO; SDM_E_FORMAT: its checksum is wrong. */
sdm_status trainer_shard_map(const char *path, const shard *s, const shard_form *form, size_t k,
                             float *map, sdm_error *err);

/* Writes a shard: params[n][n_params], maps[n][n_voxels]. SDM_E_IO, SDM_E_NOMEM. */
sdm_status trainer_shard_write(const char *path, const shard_form *form, const shard_place *at,
                               const double *params, const float *maps, uint64_t *bytes,
                               sdm_error *err);
