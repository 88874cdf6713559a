/* Reads a shape model of HDF5 in a child process; its arrays come back one behind the other. */
#include <string.h>

#include "import_ssm.h"
#include "inputs/reader_child.h"
#include "sdm/memory.h"

/* Every model is smaller: products of its sizes do not overflow. */
#define COUNT_MAX ((size_t)1 << 31)

/* The arrays of a model: n[i] elements of size[i] bytes. */
typedef struct layout {
    size_t n[4], size[4], total;
} layout;

static layout layout_of(const sdm_ssm *m)
{
    layout a = {{3 * m->n_vert, 3 * m->n_tri, 3 * m->n_vert * m->n_modes, m->n_modes},
                {sizeof *m->mean, sizeof *m->tri, sizeof *m->modes, sizeof *m->variance},
                sizeof *m};
    for (int i = 0; i < 4; i++) a.total += a.n[i] * a.size[i];
    return a;
}

/* The model in one block: the structure, then its arrays. */
static sdm_status read_model(const void *user, const char *path, char **bytes, size_t *size,
                             sdm_error *err)
{
    sdm_ssm m = {0};
    sdm_status s = cli_ssm_statismo(user, path, &m, err);
    const layout a = layout_of(&m);
    if (!s) s = SDM_ALLOC(bytes, a.total, "shape model", err);
    if (!s) {
        const void *const arrays[4] = {m.mean, m.tri, m.modes, m.variance};
        char *to = *bytes;
        memcpy(to, &m, sizeof m);
        to += sizeof m;
        for (int i = 0; i < 4; i++) {
            const size_t n = a.n[i] * a.size[i];
            if (n) memcpy(to, arrays[i], n);
            to += n;
        }
        *size = a.total;
    }
    sdm_ssm_dispose(&m);
    return s;
}

/* Takes the model out of the block, whose sizes a damaged child may have chosen. */
static sdm_status take_model(const char *path, const char *bytes, size_t size, sdm_ssm *out,
                             sdm_error *err)
{
    void **const arrays[4] = {(void **)&out->mean, (void **)&out->tri, (void **)&out->modes,
                              (void **)&out->variance};
    sdm_ssm m;
    sdm_status s = SDM_OK;
    if (size >= sizeof m) memcpy(&m, bytes, sizeof m);
    if (size < sizeof m || m.n_vert >= COUNT_MAX || m.n_tri >= COUNT_MAX ||
        m.n_modes >= COUNT_MAX / (m.n_vert + 1) || layout_of(&m).total != size)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: its sizes contradict each other", path);
    const layout a = layout_of(&m);
    *out = m;
    out->about[sizeof out->about - 1] = '\0';
    for (int i = 0; i < 4; i++) *arrays[i] = NULL;
    bytes += sizeof m;
    for (int i = 0; i < 4 && !s; i++) {
        s = sdm_alloc(arrays[i], a.n[i], a.size[i], "shape model", err);
        if (s) break;
        memcpy(*arrays[i], bytes, a.n[i] * a.size[i]);
        bytes += a.n[i] * a.size[i];
    }
    return s;
}

sdm_status cli_ssm_hdf5(const cli_args *args, const char *path, sdm_ssm *out, sdm_error *err)
{
    char *bytes = NULL;
    size_t size;
    sdm_status s = cli_read_in_child(path, "libhdf5", read_model, args, &bytes, &size, err);
    if (!s) s = take_model(path, bytes, size, out, err);
    sdm_free(bytes);
    return s;
}
