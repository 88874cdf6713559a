/* A shape model of the corresponding meshes in a folder. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "import_ssm.h"
#include "report/files.h"
#include "sdm/internal/ssm_build.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"

static int is_mesh(const struct dirent *entry)
{
    return entry->d_name[0] != '.' && cli_ends_with_any(entry->d_name, CLI_MESH_ENDINGS);
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name); // whatever the locale is
}

/* Reads one mesh into vert[n_vert][3]. The first one, *vert NULL, sets the sizes and triangles. */
static sdm_status read_shape(const char *path, size_t n, size_t index, double **vert, sdm_ssm *out,
                             sdm_error *err)
{
    sdm_mesh m = {0};
    sdm_status s = sdm_mesh_read(path, &m, err);
    if (!s && index == 0) {
        out->n_vert = m.n_vert, out->n_tri = m.n_tri;
        s = SDM_ALLOC(vert, 3 * m.n_vert * n, "shapes", err);
        if (!s) s = SDM_ALLOC(&out->tri, 3 * m.n_tri, "triangles", err);
        if (!s) memcpy(out->tri, m.tri, 3 * m.n_tri * sizeof *m.tri);
    }
    if (!s && (m.n_vert != out->n_vert || m.n_tri != out->n_tri ||
               memcmp(m.tri, out->tri, 3 * m.n_tri * sizeof *m.tri) != 0))
        s = sdm_fail(
            err, SDM_E_FORMAT,
            "%s: not the triangles of the first mesh (%zu points and %zu triangles, the first "
            "has %zu and %zu): the points of all meshes must correspond",
            path, m.n_vert, m.n_tri, out->n_vert, out->n_tri);
    if (!s) memcpy(*vert + 3 * m.n_vert * index, m.vert, 3 * m.n_vert * sizeof *m.vert);
    sdm_mesh_dispose(&m);
    return s;
}

static sdm_status build(size_t n, double *vert, bool scale, sdm_ssm *out, sdm_error *err)
{
    double *mean = NULL;
    // the components begin with an empty model
    uint32_t *tri = out->tri;
    const size_t n_vert = out->n_vert, n_tri = out->n_tri;
    *out = (sdm_ssm){0};
    sdm_status s = SDM_ALLOC(&mean, 3 * n_vert, "mean shape", err);
    if (!s) s = sdm_ssm_align(n, n_vert, scale, vert, mean, err);
    if (!s) s = sdm_ssm_components(n, n_vert, vert, mean, out, err);
    out->tri = tri, out->n_tri = n_tri;
    sdm_free(mean);
    return s;
}

sdm_status cli_ssm_meshes(const cli_args *args, const char *folder, sdm_ssm *out, sdm_error *err)
{
    struct dirent **files = NULL;
    double *vert = NULL;
    char path[4096];
    sdm_status s = SDM_OK;
    const int n = scandir(folder, &files, is_mesh, by_name);
    if (n < 0) return sdm_fail(err, SDM_E_IO, "%s: cannot be read as a folder", folder);
    if (n < 2)
        s = sdm_fail(err, SDM_E_ARG, "%s: %d mesh files (" CLI_MESH_ENDINGS "), need at least 2",
                     folder, n);
    for (int i = 0; i < n && !s; i++) {
        if (snprintf(path, sizeof path, "%s/%s", folder, files[i]->d_name) >= (int)sizeof path)
            s = sdm_fail(err, SDM_E_ARG, "%.100s...: the name of a file is too long", path);
        if (!s) s = read_shape(path, (size_t)n, (size_t)i, &vert, out, err);
    }
    if (!s) s = build((size_t)n, vert, args->import.scale, out, err);
    for (int i = 0; i < n; i++) free(files[i]);
    free(files);
    sdm_free(vert);
    return s;
}
