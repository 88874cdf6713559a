/* What a kind of network provides to be a model. A new kind: a file NAME_open.c that defines its
 * table, and a line in model_kind.c. */
#ifndef SDM_MODEL_KIND_H
#define SDM_MODEL_KIND_H

#include "model_text.h"
#include "sdm/internal/container.h"
#include "sdm/model.h"

typedef struct sdm_model_kind {
    const char *name; /* as in the file and in sdm_model_info.kind */

    /* Reads the lines of the description behind the common ones and the sections, checks every size
       before it allocates, sets m->network and m->info.weight_bytes. What m->network points to when
       it fails is disposed of by the caller. */
    sdm_status (*open)(sdm_model *m, sdm_lines *lines, const sdm_section *sections, size_t n,
                       sdm_error *err);
    void (*dispose)(void *network); /* frees `network`; NULL does nothing */

    /* sdm_model_scratch_bytes() and sdm_model_forward(), with n_threads >= 1 threads that share the
       work on each map; the same bits for any number of threads. */
    size_t (*scratch_bytes)(const sdm_model *m, size_t n, int n_threads);
    void (*forward)(const sdm_model *m, const double *params, size_t n, float *values,
                    void *scratch, int n_threads);
    bool threaded; /* forward uses more than one thread: the maps are too much work for one each */

    /* sdm_model_jacobian_scratch_bytes() and sdm_model_jacobian(), likewise. */
    size_t (*jacobian_scratch_bytes)(const sdm_model *m, int n_threads);
    void (*jacobian)(const sdm_model *m, const double *params, float *values, float *jacobian,
                     void *scratch, int n_threads);

    /* sdm_model_jvp() and sdm_model_vjp(); NULL: by way of the Jacobian. */
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
    void *network; /* of the kind */
};

/* The section of that name and size; NULL with SDM_E_FORMAT in err. Its data is aligned to 64
 * bytes. Adds the size to weight_bytes. */
const void *sdm_model_weights(sdm_model *m, const sdm_section *sections, size_t n, const char *name,
                              size_t size, sdm_error *err);

/* The section of that name, or NULL. */
const sdm_section *sdm_section_find(const sdm_section *sections, size_t n, const char *name);

/* Description of a model of kind `kind`: the common lines; the kind appends its own. */
void sdm_model_describe(const sdm_model_info *info, const char *kind, sdm_text *t);

/* The file in memory (sdm_free()): description, config, and the sections of the kind. */
sdm_status sdm_model_pack(const sdm_model_info *info, const sdm_text *description,
                          const sdm_section *sections, size_t n, uint8_t **bytes, size_t *size,
                          sdm_error *err);

extern const sdm_model_kind sdm_kind_pod, sdm_kind_deepsdf, sdm_kind_imnet, sdm_kind_sdmnn;

#endif
