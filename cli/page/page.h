/* The page of `sdmgen report`: one HTML file with a model, the runtime as WebAssembly, and figures.
 * The files that make up the page lie in the folder page/. */
#pragma once

#include "sdm/internal/text.h"
#include "sdm/model.h"

/* A model as it stands without the runtime: its surface and three slices at the default
 * parameters. Zero-initialise; cli_still_dispose() frees, also after an error. */
typedef struct cli_still {
    double volume, area;   /* of the surface, mm^3 and mm^2 */
    double min[3], max[3]; /* corners of its box, mm */
    bool cut;              /* the surface leaves the grid: the volume is not that of the shape */
    size_t n_vert, n_tri;  /* 0: no surface in the grid */
    int64_t slice[3];      /* index of the slice across each axis of the grid */
    /* For the page, little-endian: the slices (float32: [nz][ny], [nz][nx], [ny][nx]), triangles
     * ([n_tri][3], uint16, or uint32 of more than 65536 vertices) and vertices (uint16 [n_vert][3],
     * 0 .. 65535 from min to max). */
    uint8_t *bytes;
    size_t size;
} cli_still;

sdm_status cli_still_make(const sdm_model *model, cli_still *out, sdm_error *err);
void cli_still_dispose(cli_still *s);

/* The content of a page. */
typedef struct cli_page {
    const sdm_model_info *info;
    /* the parameters of the shape, with their help; NULL: the shape is not known */
    const sdm_param *of_shape; /* [info->n_params] */
    const char *summary;       /* of the shape; NULL: not known */
    const char *metrics;       /* text of metrics.jsonl; NULL: no training to show */
    const cli_still *still;
    const uint8_t *model; /* [info->file_bytes] the model's file; NULL: pictures alone */
} cli_page;

/* Adds the figures of the page as an object. */
void cli_page_figures(const cli_page *page, sdm_json *json);

/* Adds the lines of metrics.jsonl that tell of steps, as the array "history". Lines and members
 * that are not as the trainer writes them are left out. */
void cli_page_history(const char *metrics, sdm_json *json);

/* Whether this program holds the runtime for pages. */
bool cli_page_has_runtime(void);

/* Writes the page. SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_page_write(const cli_page *page, const char *path, sdm_error *err);
