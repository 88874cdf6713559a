/* The file of a statistical shape model. */
#include <math.h>
#include <string.h>

#include "bytes.h"
#include "sdm/internal/container.h"
#include "sdm/internal/ssm.h"
#include "sdm/memory.h"

enum { VERSION = 1, HEAD_BYTES = 48 };

#define COUNT_MAX (UINT64_C(1) << 31)

/* The sections in the order of the file. */
enum { HEAD, MEAN, TRIANGLES, MODES, VARIANCE, ABOUT, N_SECTIONS };
static const char *const names[N_SECTIONS] = {"ssm",       "ssm.mean",     "ssm.triangles",
                                              "ssm.modes", "ssm.variance", "ssm.about"};

void sdm_ssm_dispose(sdm_ssm *m)
{
    sdm_free(m->mean);
    sdm_free(m->tri);
    sdm_free(m->modes);
    sdm_free(m->variance);
    *m = (sdm_ssm){0};
}

sdm_status sdm_ssm_check(const char *path, const sdm_ssm *m, sdm_error *err)
{
    const size_t n = 3 * m->n_vert;
    if (m->n_vert == 0 || m->n_tri == 0 || m->n_modes == 0)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: %zu points, %zu triangles, %zu modes: none may be 0", path, m->n_vert,
                        m->n_tri, m->n_modes);
    for (size_t i = 0; i < n; i++)
        if (!isfinite(m->mean[i]))
            return sdm_fail(err, SDM_E_FORMAT, "%s: the mean of point %zu is not finite", path,
                            i / 3);
    for (size_t i = 0; i < n * m->n_modes; i++)
        if (!isfinite(m->modes[i]))
            return sdm_fail(err, SDM_E_FORMAT, "%s: mode %zu is not finite at point %zu", path,
                            i / n + 1, i % n / 3);
    for (size_t i = 0; i < m->n_modes; i++)
        if (!(m->variance[i] > 0 && isfinite(m->variance[i])))
            return sdm_fail(err, SDM_E_FORMAT, "%s: the variance of mode %zu is %g, need > 0", path,
                            i + 1, m->variance[i]);
    for (size_t i = 0; i < 3 * m->n_tri; i++)
        if (m->tri[i] >= m->n_vert)
            return sdm_fail(err, SDM_E_FORMAT, "%s: triangle %zu has point %u of %zu", path, i / 3,
                            m->tri[i], m->n_vert);
    if (!(m->noise >= 0 && isfinite(m->noise) && isfinite(m->total)))
        return sdm_fail(err, SDM_E_FORMAT, "%s: the variance of the noise is %g, need >= 0", path,
                        m->noise);
    return SDM_OK;
}

sdm_status sdm_ssm_write(const char *path, const sdm_ssm *m, sdm_error *err)
{
    uint8_t head[HEAD_BYTES], *bytes = NULL;
    const uint64_t counts[] = {VERSION, m->n_vert, m->n_tri, m->n_modes};
    for (size_t i = 0; i < 4; i++) sdm_put_uint(head + 8 * i, 8, counts[i]);
    sdm_put_f64(head + 32, m->noise);
    sdm_put_f64(head + 40, m->total);
    const size_t row = 3 * m->n_vert * sizeof(double);
    const sdm_section sections[N_SECTIONS] = {
        {names[HEAD], head, sizeof head},
        {names[MEAN], m->mean, row},
        {names[TRIANGLES], m->tri, 3 * m->n_tri * sizeof *m->tri},
        {names[MODES], m->modes, m->n_modes * row},
        {names[VARIANCE], m->variance, m->n_modes * sizeof *m->variance},
        {names[ABOUT], m->about, strlen(m->about)}};
    size_t size = 0;
    sdm_status s = sdm_container_build(sections, N_SECTIONS, &bytes, &size, err);
    if (!s) s = sdm_container_write(path, bytes, size, err);
    sdm_free(bytes);
    return s;
}

/* Finds the sections and demands their sizes. */
static sdm_status find_sections(const char *path, const sdm_section *sections, size_t n,
                                const sdm_section *found[N_SECTIONS], sdm_ssm *out, sdm_error *err)
{
    for (int k = 0; k < N_SECTIONS; k++) {
        found[k] = NULL;
        for (size_t i = 0; i < n; i++)
            if (!strcmp(sections[i].name, names[k])) found[k] = &sections[i];
        if (!found[k])
            return sdm_fail(
                err, SDM_E_FORMAT,
                "%s: not a shape model (no section '%s'); `sdmgen import ssm` writes one", path,
                names[k]);
    }
    if (found[HEAD]->size != HEAD_BYTES)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: section 'ssm'", path);
    const uint8_t *head = found[HEAD]->data;
    uint64_t counts[4];
    for (size_t i = 0; i < 4; i++) counts[i] = sdm_get_uint(head + 8 * i, 8, false);
    if (counts[0] != VERSION)
        return sdm_fail(err, SDM_E_FORMAT, "%s: shape model of version %llu, known is %d", path,
                        (unsigned long long)counts[0], VERSION);
    if (counts[1] > COUNT_MAX || counts[2] > COUNT_MAX || counts[3] > 1 << 20)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: counts of section 'ssm'", path);
    out->n_vert = (size_t)counts[1], out->n_tri = (size_t)counts[2],
    out->n_modes = (size_t)counts[3];
    out->noise = sdm_get_f64(head + 32, false);
    out->total = sdm_get_f64(head + 40, false);
    const size_t row = 3 * out->n_vert * sizeof(double);
    if (found[MEAN]->size != row || found[TRIANGLES]->size != 12 * out->n_tri ||
        found[MODES]->size % (row ? row : 1) || (row && found[MODES]->size / row != out->n_modes) ||
        found[VARIANCE]->size != out->n_modes * sizeof(double) ||
        found[ABOUT]->size >= sizeof out->about)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: sizes of sections", path);
    return SDM_OK;
}

static sdm_status copy(void **out, const sdm_section *section, sdm_error *err)
{
    const sdm_status s = sdm_alloc(out, section->size, 1, "shape model", err);
    if (!s) memcpy(*out, section->data, section->size);
    return s;
}

sdm_status sdm_ssm_parse(const char *path, const uint8_t *bytes, size_t size, sdm_ssm *out,
                         sdm_error *err)
{
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char section_names[SDM_CONTAINER_MAX_SECTIONS][24];
    const sdm_section *found[N_SECTIONS];
    size_t n;
    uint64_t checksum;
    sdm_error why = {0};
    *out = (sdm_ssm){0};
    sdm_status s = sdm_container_parse(bytes, size, sections, section_names, &n, &checksum, &why);
    if (s) return sdm_fail(err, s, "%s: no shape model: %s", path, why.text);
    s = find_sections(path, sections, n, found, out, err);
    if (!s) s = copy((void **)&out->mean, found[MEAN], err);
    if (!s) s = copy((void **)&out->tri, found[TRIANGLES], err);
    if (!s) s = copy((void **)&out->modes, found[MODES], err);
    if (!s) s = copy((void **)&out->variance, found[VARIANCE], err);
    if (!s) memcpy(out->about, found[ABOUT]->data, found[ABOUT]->size);
    if (!s) s = sdm_ssm_check(path, out, err);
    if (s) sdm_ssm_dispose(out);
    return s;
}
