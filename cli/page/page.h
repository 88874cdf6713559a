/* The page of `sdmgen report`: one HTML file with a model, the runtime as WebAssembly, and figures.
 * The files that make up the page lie in the folder page/. */
#pragma once

#include "args/options.h"
#include "page_fit.h"
#include "sdm/internal/text.h"
#include "sdm/registry.h"

/* A shape as it stands without the runtime: its surface and three slices. Zero-initialise;
 * cli_still_dispose() frees, also after an error. */
typedef struct cli_still {
    double volume, area;   /* of the map (sdm_map_volume()), mm^3; of its surface, mm^2 */
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

/* values: a map on the grid. */
sdm_status cli_still_make(const sdm_grid *grid, const float *values, cli_still *out,
                          sdm_error *err);
void cli_still_dispose(cli_still *s);

enum { CLI_PAGE_BINS = 40, CLI_PAGE_BINS_PER_DECADE = 8 };

/* How large the errors of a network are on shapes that its training did not use. */
typedef struct cli_page_errors {
    size_t shapes;     /* 0: not measured */
    double near_mm;    /* sdm_grid_near() */
    double first_edge; /* between the first bin and the second, mm; the last bin has no upper end */
    /* voxels of the maps with an error in the bin: all; those within near_mm of the surface */
    uint64_t voxels[CLI_PAGE_BINS], near[CLI_PAGE_BINS];
} cli_page_errors;

/* Compares maps of the first shapes of `sdmgen eval` with exact ones. Errors of the shape;
 * SDM_E_NOMEM. */
sdm_status cli_page_errors_make(const sdm_model *m, const sdm_instance *shape, cli_page_errors *out,
                                sdm_error *err);

/* The content of a page. */
typedef struct cli_page {
    const sdm_model_info *info;
    const sdm_instance *shape;    /* NULL: the shape of the model is not known */
    const char *metrics;          /* text of metrics.jsonl; NULL: no training to show */
    const cli_page_fit *fit;      /* NULL: a page of a model */
    const cli_still *still;       /* at the default or at the fitted parameters */
    const sdm_measures *measures; /* at the same parameters, the shape's own first; n 0: none */
    const cli_page_errors *errors;
    const uint8_t *model; /* [info->file_bytes] the model's file; NULL: pictures alone */
} cli_page;

/* Adds the figures of the page as an object. */
void cli_page_figures(const cli_page *page, sdm_json *json);

/* Adds the lines of metrics.jsonl that tell of steps, as the array "history". Lines and members
 * that are not as the trainer writes them are left out. */
void cli_page_history(const char *metrics, sdm_json *json);

/* Whether this program holds the runtime for pages. */
bool cli_page_has_runtime(void);

/* Before any work: checks --report of a command whose page may do without the runtime. SDM_E_ARG.
 */
sdm_status cli_page_check_option(const cli_args *args, sdm_error *err);

/* Writes the page of a model file, of the folder of a run or of the result of a fit (.json) to
 * `path`. live: with the model and the runtime. SDM_E_IO, SDM_E_NOMEM, errors of opening. */
sdm_status cli_page_report(const cli_args *args, const char *source, bool live, const char *path,
                           sdm_error *err);

/* The same for the result of a fit in memory; with the runtime if this program has it. */
sdm_status cli_page_report_fit(const cli_args *args, const sdm_json *fit, const char *path,
                               sdm_error *err);

/* Writes the page. SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_page_write(const cli_page *page, const char *path, sdm_error *err);
