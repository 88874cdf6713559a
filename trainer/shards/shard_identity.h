/* Which maps a shard holds, its name, and all that decides its maps. */
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
