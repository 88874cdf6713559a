/* Memory of large maps: what is free, what a grid needs, and how long an exact map takes. */
#pragma once

#include <stddef.h>

#include "sdm/exact.h"
#include "sdm/internal/text.h"

/* Bytes that the program can still use: the free memory of the machine, or less where a limit is
 * set (--max-memory); 0: not known. */
double cli_free_memory(void);

/* SDM_E_NOMEM if `bytes` for a map on the grid are not free: names the voxels, the memory, and a
 * spacing with which it fits. */
sdm_status cli_check_map_memory(const sdm_grid *grid, double bytes, sdm_error *err);

/* *values = new memory for a map of the grid, to be freed with sdm_free(); its values are not set.
 * SDM_E_NOMEM: names the voxels and the options that make fewer. */
sdm_status cli_allocate_map(const sdm_grid *grid, float **values, sdm_error *err);

/* Appends voxels, memory and time of an exact map on the grid, with `bytes` for each voxel, and a
 * spacing that makes a small one. The time follows from a few planes in the middle of the grid,
 * which are computed. Errors of sdm_exact_map(). */
sdm_status cli_forecast_map(const sdm_exact *engine, const sdm_grid *grid, double bytes,
                            sdm_text *text, sdm_error *err);

/* The same as a notice, of maps that take over a gigabyte; nothing for others. */
sdm_status cli_tell_large_map(const sdm_exact *engine, const sdm_grid *grid, double bytes,
                              sdm_error *err);
