/* A statistical shape model (point-distribution model; Cootes, Taylor, Cooper and Graham 1995) and
 * its file, .ssm: a container (sdm/internal/container.h) of float64 and uint32 in little endian. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* vertex = mean + sum over modes of weight * mode; the weights are independent and normal, N(0, 1).
 * Zero-initialise; sdm_ssm_dispose() frees all arrays. Coordinates are LPS mm. */
typedef struct sdm_ssm {
    double *mean;     /* [n_vert][3] */
    uint32_t *tri;    /* [n_tri][3], counter-clockwise seen from outside */
    double *modes;    /* [n_modes][n_vert][3], mm per standard deviation */
    double *variance; /* [n_modes], > 0, mm^2: sum of squares of the mode, in descending order */
    size_t n_vert, n_tri, n_modes;
    double noise;    /* mm^2: variance of a coordinate that no mode explains */
    double total;    /* mm^2: sum of the variances of all modes of the source */
    char about[512]; /* where the model comes from: lines of text */
} sdm_ssm;

/* Writes the model; the file appears under its name only when it is complete. SDM_E_IO,
 * SDM_E_NOMEM. [any thread] */
sdm_status sdm_ssm_write(const char *path, const sdm_ssm *model, sdm_error *err);

/* Reads the model from the content of a file, bytes[size], 64-byte aligned; `path` is for messages.
 * SDM_E_FORMAT: no such file, damaged, an index or a number out of range; SDM_E_NOMEM. After an
 * error *out is empty. [any thread] */
sdm_status sdm_ssm_parse(const char *path, const uint8_t *bytes, size_t size, sdm_ssm *out,
                         sdm_error *err);

/* Demands that all numbers are finite, the variances > 0, the indices those of vertices.
 * SDM_E_FORMAT; `path` is for the message. [any thread] */
sdm_status sdm_ssm_check(const char *path, const sdm_ssm *model, sdm_error *err);

void sdm_ssm_dispose(sdm_ssm *model);

#ifdef __cplusplus
}
#endif
