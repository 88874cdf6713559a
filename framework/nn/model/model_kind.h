/* The function table of a kind of network, and the functions that all kinds share. A new kind needs
   a file NAME_open.c that defines its table, a declaration at the end of this header, and an entry
   in open/model_open.c. */
#ifndef SDM_MODEL_KIND_H
#define SDM_MODEL_KIND_H

#include "model_text.h"
#include "sdm/internal/container.h"
#include "sdm/model.h"

typedef struct sdm_model_kind {
    const char *name; /* as in the file and in sdm_model_info.kind */

    /* Reads the kind's own lines of the description and its sections[n], checking every size before
   it allocates; sets m->network, m->info.weight_bytes and m->info.macs. SDM_E_FORMAT,
   SDM_E_NOMEM. The caller disposes of m->network, also after an error. */
    sdm_status (*open)(sdm_model *m, sdm_lines *lines, const sdm_section *sections, size_t n,
                       sdm_error *err);
    void (*dispose)(void *network); /* frees `network`; NULL does nothing */

    /* sdm_model_scratch_bytes_threads() and sdm_model_forward_threads(). */
    size_t (*scratch_bytes)(const sdm_model *m, size_t n, int n_threads);
    void (*forward)(const sdm_model *m, const double *params, size_t n, float *values,
                    void *scratch, int n_threads);
    bool threaded; /* sdm_model_is_threaded() */

    /* sdm_model_jacobian_scratch_bytes_threads() and sdm_model_jacobian_threads(). */
    size_t (*jacobian_scratch_bytes)(const sdm_model *m, int n_threads);
    void (*jacobian)(const sdm_model *m, const double *params, float *values, float *jacobian,
                     void *scratch, int n_threads);

    /* sdm_model_jvp() with n_threads >= 1 threads, and sdm_model_vjp(). NULL: computed from the
   Jacobian. */
    size_t (*jvp_scratch_bytes)(const sdm_model *m, int n_threads);
    void (*jvp)(const sdm_model *m, const double *params, const double *direction, float *values,
                float *tangent, void *scratch, int n_threads);
    size_t (*vjp_scratch_bytes)(const sdm_model *m);
    void (*vjp)(const sdm_model *m, const double *params, const float *adjoint, double *gradient,
                void *scratch);
} sdm_model_kind;

struct sdm_model {
    sdm_model_info info;
    sdm_model_param *params;
    char **option_names, **option_values;
    char *config, *folder;
    uint8_t *file; /* the whole file; weights point into it */
    const sdm_model_kind *kind;
    void *network; /* type and content belong to the kind */
};

/* The data, 64-byte aligned, of the section `name`, which must have `size` bytes; NULL with
   SDM_E_FORMAT in *err if it has not or is missing. Adds `size` to m->info.weight_bytes. */
const void *sdm_model_weights(sdm_model *m, const sdm_section *sections, size_t n, const char *name,
                              size_t size, sdm_error *err);

/* The section `name` among sections[n], or NULL. */
const sdm_section *sdm_section_find(const sdm_section *sections, size_t n, const char *name);

/* Appends the lines to *t that the descriptions of all kinds begin with; the kind appends its
   own. */
void sdm_model_describe(const sdm_model_info *info, const char *kind, sdm_text *t);

/* *bytes = a model file of *size bytes with the description, info->config and sections[n] of the
   kind, to be freed with sdm_free(). SDM_E_NOMEM, also if the description has failed;
   SDM_E_INTERNAL for too many sections. */
sdm_status sdm_model_pack(const sdm_model_info *info, const sdm_text *description,
                          const sdm_section *sections, size_t n, uint8_t **bytes, size_t *size,
                          sdm_error *err);

extern const sdm_model_kind sdm_kind_pod, sdm_kind_deepsdf, sdm_kind_imnet, sdm_kind_sdmnn;

#endif
