/* A shape model of the corresponding meshes in a folder. */
#include <string.h>

#include "import_ssm.h"
#include "report/files.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"
#include "ssm_folder.h"

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

sdm_status cli_ssm_meshes(const cli_args *args, const char *folder, sdm_ssm *out, sdm_error *err)
{
    cli_list files;
    double *vert = NULL;
    sdm_status s = cli_folder_list(folder, CLI_MESH_ENDINGS, &files, err);
    if (s) return s;
    if (files.n < 2)
        s = sdm_fail(err, SDM_E_ARG,
                     "%s: %zu mesh files (" CLI_MESH_ENDINGS
                     ") and no .particles; a model needs at least 2",
                     folder, files.n);
    for (size_t i = 0; i < files.n && !s; i++)
        s = read_shape(files.items[i], files.n, i, &vert, out, err);
    if (!s) s = cli_ssm_build(files.n, vert, args->import.scale, out, err);
    cli_folder_free(&files);
    sdm_free(vert);
    return s;
}
