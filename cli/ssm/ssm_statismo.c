/* Models of Statismo (Luethi et al. 2012) and Scalismo. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "import_ssm.h"
#include "report/files.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"
#include "tree.h"

/* A reading in progress: the file, and the path of the model in it ("" for the root). */
typedef struct source {
    const cli_args *args;
    cli_tree tree;
    char root[CLI_TREE_TEXT];
    bool scaled; /* the basis is multiplied by the standard deviations (0.8) */
} source;

static const char *name_of(const source *r, const char *name, char buf[2 * CLI_TREE_TEXT])
{
    snprintf(buf, 2 * CLI_TREE_TEXT, "%s%s", r->root, name);
    return buf;
}

/* Names of the catalog for a message, in quotes. */
static void list_catalog(const source *r, char *out, size_t size)
{
    char name[CLI_TREE_TEXT];
    size_t n = 0;
    out[0] = '\0';
    for (size_t i = 0; r->tree.child(&r->tree, "/catalog", i, name) && n + 64 < size; i++)
        n += (size_t)snprintf(out + n, size - n, "%s'%.40s'", i ? ", " : "", name);
}

/* Finds the model: the root, or an entry of the catalog. */
static sdm_status choose_model(source *r, sdm_error *err)
{
    char names[512], first[CLI_TREE_TEXT], second[CLI_TREE_TEXT], path[2 * CLI_TREE_TEXT];
    const char *asked = r->args->import.model;
    r->root[0] = '\0';
    if (!asked && r->tree.has(&r->tree, "/model")) return SDM_OK;
    if (!r->tree.has(&r->tree, "/catalog"))
        return sdm_fail(err, SDM_E_FORMAT, "%s: no shape model: neither /model nor /catalog",
                        r->tree.path);
    list_catalog(r, names, sizeof names);
    if (!asked && (!r->tree.child(&r->tree, "/catalog", 0, first) ||
                   r->tree.child(&r->tree, "/catalog", 1, second)))
        return sdm_fail(err, SDM_E_ARG, "%s: several models: choose one by --model, %s",
                        r->tree.path, names);
    snprintf(path, sizeof path, "/catalog/%.200s/modelPath", asked ? asked : first);
    if (!r->tree.text(&r->tree, path, NULL, r->root))
        return sdm_fail(err, SDM_E_ARG, "%s: no model '%.100s', the catalog has %s", r->tree.path,
                        asked ? asked : first, names);
    size_t n = strlen(r->root);
    while (n > 0 && r->root[n - 1] == '/') r->root[--n] = '\0';
    return SDM_OK;
}

/* A number that stands alone, in `size` 1. */
static sdm_status read_single(const source *r, const char *name, double *out, sdm_error *err)
{
    double *v = NULL;
    size_t shape[2];
    int n_dim;
    sdm_status s = r->tree.numbers(&r->tree, name, &v, shape, &n_dim, err);
    if (!s && shape[0] * shape[1] != 1)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: %s has %zu numbers, need one", r->tree.path, name,
                     shape[0] * shape[1]);
    if (!s) *out = *v;
    sdm_free(v);
    return s;
}

/* 0.8, which the oldest files do not state, has scaled modes; 0.9 and 1.x have orthonormal ones. */
static sdm_status read_version(source *r, sdm_error *err)
{
    double major = 0, minor = 8;
    char buf[2 * CLI_TREE_TEXT], name[CLI_TREE_TEXT] = "";
    sdm_status s = SDM_OK;
    if (r->tree.has(&r->tree, "/version/majorVersion")) {
        s = read_single(r, "/version/majorVersion", &major, err);
        if (!s) s = read_single(r, "/version/minorVersion", &minor, err);
    } else {
        const bool known =
            r->tree.text(&r->tree, name_of(r, "/representer", buf), "name", name) &&
            (!strcmp(name, "vtkPolyDataRepresenter") || !strcmp(name, "itkMeshRepresenter"));
        if (!known)
            return sdm_fail(err, SDM_E_FORMAT, "%s: no /version/majorVersion", r->tree.path);
    }
    if (s) return s;
    const bool old = major == 0 && minor == 8;
    if (!old && !(major == 0 && minor == 9) && major != 1)
        return sdm_fail(err, SDM_E_FORMAT, "%s: version %g.%g, known are 0.8, 0.9 and 1.x",
                        r->tree.path, major, minor);
    r->scaled = old;
    return SDM_OK;
}

static sdm_status read_mean(const source *r, sdm_ssm *out, sdm_error *err)
{
    char name[2 * CLI_TREE_TEXT];
    size_t shape[2];
    int n_dim;
    name_of(r, "/model/mean", name);
    const sdm_status s = r->tree.numbers(&r->tree, name, &out->mean, shape, &n_dim, err);
    if (s) return s;
    const size_t n = shape[0] * shape[1];
    if (n_dim == 0 || (n_dim == 2 && shape[0] != 1 && shape[1] != 1) || n % 3)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: %s has %zu x %zu numbers, need x, y, z of each point", r->tree.path,
                        name, shape[0], shape[1]);
    out->n_vert = n / 3;
    return SDM_OK;
}

/* Transposes the basis[3 n_vert][n] into the modes, in mm per standard deviation, without those of
 * no variance. */
static sdm_status fill_modes(const source *r, const double *basis, const double *variance, size_t n,
                             sdm_ssm *out, sdm_error *err)
{
    const size_t size = 3 * out->n_vert;
    sdm_status s = SDM_ALLOC(&out->modes, n * size, "modes", err);
    if (!s) s = SDM_ALLOC(&out->variance, n, "variances", err);
    for (size_t i = 0; i < n && !s; i++) {
        if (!(variance[i] >= 0 && isfinite(variance[i])))
            return sdm_fail(err, SDM_E_FORMAT, "%s: the variance of mode %zu is %g, need >= 0",
                            r->tree.path, i + 1, variance[i]);
        if (!(variance[i] > 1e-12 * variance[0])) continue;
        double *mode = out->modes + size * out->n_modes;
        const double scale = r->scaled ? 1 : sqrt(variance[i]);
        for (size_t k = 0; k < size; k++) mode[k] = scale * basis[k * n + i];
        out->total += out->variance[out->n_modes++] = variance[i];
    }
    return s;
}

static sdm_status read_modes(const source *r, sdm_ssm *out, sdm_error *err)
{
    char basis_name[2 * CLI_TREE_TEXT], variance_name[2 * CLI_TREE_TEXT], noise[2 * CLI_TREE_TEXT];
    double *basis = NULL, *variance = NULL;
    size_t shape[2], n[2];
    int n_dim, n_dim_variance;
    name_of(r, "/model/pcaBasis", basis_name);
    name_of(r, "/model/pcaVariance", variance_name);
    name_of(r, "/model/noiseVariance", noise);
    sdm_status s = r->tree.numbers(&r->tree, basis_name, &basis, shape, &n_dim, err);
    if (!s && (n_dim != 2 || shape[0] != 3 * out->n_vert))
        s = sdm_fail(err, SDM_E_FORMAT, "%s: %s has %zu rows in %d dimensions, need 3 x %zu in two",
                     r->tree.path, basis_name, shape[0], n_dim, out->n_vert);
    if (!s) s = r->tree.numbers(&r->tree, variance_name, &variance, n, &n_dim_variance, err);
    if (!s && n[0] * n[1] != shape[1])
        s = sdm_fail(err, SDM_E_FORMAT, "%s: %zu variances of %zu modes", r->tree.path, n[0] * n[1],
                     shape[1]);
    if (!s) s = fill_modes(r, basis, variance, shape[1], out, err);
    if (!s && r->tree.has(&r->tree, noise)) s = read_single(r, noise, &out->noise, err);
    sdm_free(basis);
    sdm_free(variance);
    return s;
}

/* The triangles of --surface. */
static sdm_status read_surface(const source *r, sdm_ssm *out, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status s = sdm_mesh_read(r->args->import.surface, &mesh, err);
    if (!s && mesh.n_vert != out->n_vert)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: %zu vertices, the model %s has %zu points",
                     r->args->import.surface, mesh.n_vert, r->tree.path, out->n_vert);
    if (!s) s = SDM_ALLOC(&out->tri, 3 * mesh.n_tri, "triangles", err);
    if (!s) {
        memcpy(out->tri, mesh.tri, 3 * mesh.n_tri * sizeof *mesh.tri);
        out->n_tri = mesh.n_tri;
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

/* The cells [3][n] of the representer. */
static sdm_status read_cells(const source *r, sdm_ssm *out, sdm_error *err)
{
    char name[2 * CLI_TREE_TEXT];
    double *cells = NULL;
    size_t shape[2];
    int n_dim;
    if (r->args->import.surface) return read_surface(r, out, err);
    if (!r->tree.has(&r->tree, name_of(r, "/representer/cells", name)))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: points without triangles (no %s): give a mesh with the same points by "
                        "--surface MESH",
                        r->tree.path, name);
    sdm_status s = r->tree.numbers(&r->tree, name, &cells, shape, &n_dim, err);
    if (!s && (n_dim != 2 || shape[0] != 3))
        s = sdm_fail(err, SDM_E_FORMAT, "%s: %s has %zu rows, need the 3 corners of triangles",
                     r->tree.path, name, shape[0]);
    if (!s) s = SDM_ALLOC(&out->tri, 3 * shape[1], "triangles", err);
    for (size_t i = 0; !s && i < 3 * shape[1]; i++) {
        const double v = cells[i % 3 * shape[1] + i / 3];
        if (!(v >= 0 && v < (double)out->n_vert && v == floor(v)))
            s = sdm_fail(err, SDM_E_FORMAT, "%s: triangle %zu has point %g of %zu", r->tree.path,
                         i / 3, v, out->n_vert);
        else
            out->tri[i] = (uint32_t)v;
    }
    if (!s) out->n_tri = shape[1];
    sdm_free(cells);
    return s;
}

sdm_status cli_ssm_statismo(const cli_args *args, const char *path, sdm_ssm *out, sdm_error *err)
{
    source r = {.args = args};
    sdm_status s = cli_ends_with(path, ".json") ? cli_tree_json(path, &r.tree, err)
                                                : cli_tree_hdf5(path, &r.tree, err);
    if (s) return s;
    s = choose_model(&r, err);
    if (!s) s = read_version(&r, err);
    if (!s) s = read_mean(&r, out, err);
    if (!s) s = read_modes(&r, out, err);
    if (!s) s = read_cells(&r, out, err);
    r.tree.close(&r.tree);
    return s;
}
