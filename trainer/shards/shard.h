/* A shard: a file with consecutive exact maps of one set (docs/dataset.md has the layout). */
#pragma once

#include "shard_identity.h"

/* The sizes of the maps of a configuration, and its identity. */
typedef struct shard_form {
    const char *identity;
    size_t n_params, n_voxels;
} shard_form;

/* A shard, one file of a dataset, as far as it is in memory: its maps stay in the file. */
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
