/* The function table of a kind of network, and the functions that all kinds share. A new kind needs
   a file NAME_open.c that defines its table, a declaration at the end of this header, and an entry
   in open/model_open.c. */
#pragma once

#include "model_text.h"
#include "onnx/onnx.h"
#include "sdm/internal/container.h"
#include "sdm/internal/fine.h"
#include "sdm/model.h"

typedef struct sdm_model_kind {
    const char *name; /* as in the file and in sdm_model_info.kind */

    /* Reads the lines of the description that belong to this kind, and sections[n]; checks every
       size before it allocates memory; sets m->network, m->info.weight_bytes and m->info.macs.
       SDM_E_FORMAT, SDM_E_NOMEM. The caller disposes of m->network, also after an error. */
    sdm_status (*open)(sdm_model *m, sdm_lines *lines, const sdm_section *sections, size_t n,
                       sdm_error *err);
    void (*dispose)(void *network); /* frees `network`; NULL does nothing */

    /* Implement sdm_model_scratch_bytes_threads() and sdm_model_forward_threads(). */
    size_t (*scratch_bytes)(const sdm_model *m, size_t n, int n_threads);
    void (*forward)(const sdm_model *m, const double *params, size_t n, float *values,
                    void *scratch, int n_threads);
    bool threaded; /* result of sdm_model_is_threaded() */

    /* Implement sdm_model_jacobian_scratch_bytes_threads() and sdm_model_jacobian_threads(). */
    size_t (*jacobian_scratch_bytes)(const sdm_model *m, int n_threads);
    void (*jacobian)(const sdm_model *m, const double *params, float *values, float *jacobian,
                     void *scratch, int n_threads);

    /* Implement sdm_model_jvp(), with n_threads >= 1 threads, and sdm_model_vjp(). NULL: these
       products are computed from the Jacobian. */
    size_t (*jvp_scratch_bytes)(const sdm_model *m, int n_threads);
    void (*jvp)(const sdm_model *m, const double *params, const double *direction, float *values,
                float *tangent, void *scratch, int n_threads);
    size_t (*vjp_scratch_bytes)(const sdm_model *m);
    void (*vjp)(const sdm_model *m, const double *params, const float *adjoint, double *gradient,
                void *scratch);

    /* Appends the network to a graph: returns the maps [N][nz][ny][nx], mm, at x[N][P], the
       parameters scaled to [-1, 1]. The model must outlive the graph. NULL: ONNX cannot express
       the network. */
    sdm_onnx_value (*onnx)(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x);
} sdm_model_kind;

struct sdm_model {
    sdm_model_info info;
    sdm_model_param *params;
    char **option_names, **option_values;
    char *config, *folder;
    uint8_t *file; /* the whole file; weights point into it */
    const sdm_model_kind *kind;
    void *network; /* a struct whose type depends on the kind */
    sdm_fine fine; /* width 0: none */
};

/* Type of the numbers in a section of weights. */
typedef enum sdm_number {
    SDM_NUMBER_BYTE,
    SDM_NUMBER_INT32, /* signed or unsigned */
    SDM_NUMBER_FLOAT16,
    SDM_NUMBER_FLOAT32,
    SDM_NUMBER_FLOAT64
} sdm_number;

/* Returns the data (64-byte aligned) of the section `name`, `count` numbers of this type, and adds
   their bytes to m->info.weight_bytes. NULL, with SDM_E_FORMAT in *err, if the section is missing,
   has another size, or holds a floating-point number that is not finite. */
const void *sdm_model_weights(sdm_model *m, const sdm_section *sections, size_t n, const char *name,
                              sdm_number type, uint64_t count, sdm_error *err);

/* Reads the section of the fine level, if there is one, into m->fine; its weights point into the
   file. SDM_E_FORMAT. */
sdm_status sdm_fine_open(sdm_model *m, const sdm_section *sections, size_t n, sdm_error *err);

/* Appends the content of the section "quality" to *t; nothing without a grade. */
void sdm_quality_describe(const sdm_model_quality *q, sdm_text *t);

/* *q = the content of the section "quality"; NULL: no quality. SDM_E_FORMAT. */
sdm_status sdm_quality_read(const sdm_section *section, sdm_model_quality *q, sdm_error *err);

/* The section `name` among sections[n], or NULL. */
const sdm_section *sdm_section_find(const sdm_section *sections, size_t n, const char *name);

/* Appends to *t the lines with which the description of every kind begins. The kind appends its own
   lines afterwards. */
void sdm_model_describe(const sdm_model_info *info, const char *kind, sdm_text *t);

/* *bytes = a model file of *size bytes, to be freed with sdm_free(), with the description,
   info->config and sections[n] of the kind. SDM_E_NOMEM, also if an allocation for the description
   has failed; SDM_E_INTERNAL: too many sections. */
sdm_status sdm_model_pack(const sdm_model_info *info, const sdm_text *description,
                          const sdm_section *sections, size_t n, uint8_t **bytes, size_t *size,
                          sdm_error *err);

/* *out = the model of a file in memory, bytes[size], 64-byte aligned, to be freed with
   sdm_model_free(). kinds[]: the kinds of network that the file may have; NULL ends the list. Takes
   over `bytes`, which are freed with the model or after an error. Errors as sdm_model_open(). */
sdm_status sdm_model_read(uint8_t *bytes, size_t size, const sdm_model_kind *const *kinds,
                          sdm_model **out, sdm_error *err);

/* The maps rows[N][voxels] as [N][nz][ny][nx], for the functions `onnx`. */
sdm_onnx_value sdm_model_onnx_maps(const sdm_model *m, sdm_onnx *g, sdm_onnx_value rows);

extern const sdm_model_kind sdm_kind_pod, sdm_kind_template, sdm_kind_deepsdf, sdm_kind_imnet,
    sdm_kind_sdmnn;
