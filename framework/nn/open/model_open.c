/* Opens a model file. */
#include <string.h>

#include "model/model_kind.h"
#include "sdm/internal/file.h"
#include "sdm/internal/model_hash.h"
#include "sdm/memory.h"

#define MODEL_BYTES_MAX (UINT64_C(16) << 30)

// A new kind of network needs an entry here and a declaration in model_kind.h.
static const sdm_model_kind *const KINDS[] = {
    &sdm_kind_pod, &sdm_kind_template, &sdm_kind_deepsdf, &sdm_kind_imnet, &sdm_kind_sdmnn, NULL};

sdm_status sdm_model_open_memory(const char *name, const uint8_t *bytes, size_t size,
                                 sdm_model **out, sdm_error *err)
{
    *out = NULL;
    uint8_t *copy = NULL;
    sdm_status s = SDM_ALLOC(&copy, size, "model file", err);
    if (s) return s;
    memcpy(copy, bytes, size);
    s = sdm_model_read(copy, size, KINDS, out, err);
    return s ? sdm_fail_in(err, s, "%s", name) : SDM_OK;
}

sdm_status sdm_model_open(const char *path, sdm_model **out, sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "model: a place for it is needed");
    *out = NULL;
    if (!path) return sdm_fail(err, SDM_E_ARG, "model: the name of a file is needed");
    uint8_t *bytes;
    size_t size;
    sdm_status s = sdm_file_read(path, MODEL_BYTES_MAX, &bytes, &size, err);
    if (s) return s;
    s = sdm_model_read(bytes, size, KINDS, out, err);
    if (s) return sdm_fail_in(err, s, "%s", path);
    sdm_model *m = *out;
    const char *slash = strrchr(path, '/');
    const size_t length = slash ? (size_t)(slash - path) + 1 : 2;
    if ((s = SDM_ALLOC(&m->folder, length + 1, "model text", err))) {
        sdm_model_free(m);
        *out = NULL;
        return s;
    }
    memcpy(m->folder, slash ? path : "./", length);
    m->info.folder = m->folder;
    return SDM_OK;
}

const char *sdm_model_sha256(const sdm_model *m, char text[SDM_SHA256_TEXT])
{
    return sdm_sha256(m->file, m->info.file_bytes, text);
}

const sdm_model_info *sdm_model_get_info(const sdm_model *m) { return &m->info; }

int sdm_model_param_index(const sdm_model *m, const char *name)
{
    for (size_t i = 0; m && name && i < m->info.n_params; i++)
        if (!strcmp(m->info.params[i].name, name)) return (int)i;
    return -1;
}
