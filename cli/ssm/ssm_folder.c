/* What the readers of folders have in common: the names of the files, the model of the shapes. */
#include "ssm_folder.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "report/files.h"
#include "sdm/internal/ssm_build.h"
#include "sdm/memory.h"

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name); // whatever the locale is
}

static sdm_status add_path(const char *folder, const char *name, cli_list *out, sdm_error *err)
{
    char *path = NULL;
    const size_t size = strlen(folder) + strlen(name) + 2;
    const sdm_status s = SDM_ALLOC(&path, size, "names of files", err);
    if (s) return s;
    snprintf(path, size, "%s/%s", folder, name);
    out->items[out->n++] = path;
    return SDM_OK;
}

sdm_status cli_folder_list(const char *folder, const char *endings, cli_list *out, sdm_error *err)
{
    struct dirent **files = NULL;
    *out = (cli_list){0};
    const int n = scandir(folder, &files, NULL, by_name);
    if (n < 0) return sdm_fail(err, SDM_E_IO, "%s: cannot be read as a folder", folder);
    sdm_status s = SDM_ALLOC(&out->items, (size_t)n, "names of files", err);
    for (int i = 0; i < n; i++) {
        const char *name = files[i]->d_name;
        if (!s && name[0] != '.' && cli_ends_with_any(name, endings))
            s = add_path(folder, name, out, err);
        free(files[i]);
    }
    free(files);
    if (s) cli_folder_free(out);
    return s;
}

void cli_folder_free(cli_list *list)
{
    for (size_t i = 0; i < list->n; i++) sdm_free((void *)list->items[i]);
    sdm_free((void *)list->items);
    *list = (cli_list){0};
}

sdm_status cli_ssm_build(size_t n, double *vert, bool scale, sdm_ssm *out, sdm_error *err)
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
