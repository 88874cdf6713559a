/* A shape model of the particles of ShapeWorks (Cates et al. 2007) in a folder: one file a shape,
 * x y z a line; line i of all files is the same point of the shape. The mesh of one shape is warped
 * onto the particles of all. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "import_ssm.h"
#include "report/files.h"
#include "sdm/exact.h"
#include "sdm/internal/file.h"
#include "sdm/internal/ssm_build.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"
#include "ssm_folder.h"

#define MAX_BYTES ((uint64_t)1 << 28)

/* Particles may be so far from their mesh, as a fraction of the diagonal of its box. */
#define GAP_MAX 0.05

/* Points of all shapes of a folder. */
typedef struct particles {
    cli_list files;
    size_t n;     /* of one shape */
    double *vert; /* [files.n][n][3] */
} particles;

/* Reads the three numbers of a line, which is changed. */
static bool read_line(char *line, double x[3])
{
    for (int d = 0; d < 3; d++) {
        line += strspn(line, " \t\r");
        char *word = line;
        line += strcspn(line, " \t\r");
        if (*line) *line++ = '\0';
        if (!sdm_parse_real(word, &x[d])) return false;
    }
    return line[strspn(line, " \t\r")] == '\0';
}

/* *x = new array [*n][3] of a file. */
static sdm_status read_particles(const char *path, double **x, size_t *n, sdm_error *err)
{
    char *text = NULL;
    size_t size, lines, number = 0;
    sdm_status s = sdm_file_read_text(path, MAX_BYTES, &text, &size, &lines, err);
    if (s) return s;
    *n = 0;
    s = SDM_ALLOC(x, 3 * lines, "particles", err);
    for (char *at = text; !s && *at;) {
        char *line = at + strspn(at, " \t\r");
        at += strcspn(at, "\n");
        if (*at) *at++ = '\0';
        number++;
        if (!*line) continue;
        if (!read_line(line, *x + 3 * *n))
            s = sdm_fail(err, SDM_E_FORMAT, "%s:%zu: need three finite numbers: x y z", path,
                         number);
        else
            ++*n;
    }
    if (!s && *n == 0) s = sdm_fail(err, SDM_E_FORMAT, "%s: no particles", path);
    sdm_free(text);
    return s;
}

/* The files of the aligned shapes, else those in the frames of their images, else all. */
static sdm_status find_files(const char *folder, cli_list *out, sdm_error *err)
{
    static const char *const endings[] = {"_world.particles", "_local.particles", ".particles"};
    sdm_status s = cli_folder_list(folder, endings[0], out, err);
    for (int i = 1; i < 3 && !s && out->n == 0; i++) {
        cli_folder_free(out);
        s = cli_folder_list(folder, endings[i], out, err);
    }
    return s;
}

static sdm_status read_all(const char *folder, particles *p, sdm_error *err)
{
    sdm_status s = find_files(folder, &p->files, err);
    if (!s && p->files.n < 2)
        s = sdm_fail(err, SDM_E_ARG, "%s: %zu file of particles, a model needs at least 2", folder,
                     p->files.n);
    for (size_t i = 0; i < p->files.n && !s; i++) {
        double *x = NULL;
        size_t n;
        s = read_particles(p->files.items[i], &x, &n, err);
        if (!s && i == 0) {
            p->n = n;
            s = SDM_ALLOC(&p->vert, 3 * n * p->files.n, "particles", err);
        }
        if (!s && n != p->n)
            s = sdm_fail(err, SDM_E_FORMAT,
                         "%s: %zu particles, %s has %zu: the particles of all shapes must "
                         "correspond (one folder for each domain)",
                         p->files.items[i], n, p->files.items[0], p->n);
        if (!s) memcpy(p->vert + 3 * n * i, x, 3 * n * sizeof *x);
        sdm_free(x);
    }
    return s;
}

/* path[size] = the file in the folder that holds the particles of the mesh NAME.vtk:
 * NAME_local.particles, else NAME.particles. Returns false if there is neither. */
static bool find_own(const char *folder, const char *mesh, char *path, size_t size)
{
    static const char *const endings[] = {"_local.particles", ".particles"};
    const char *slash = strrchr(mesh, '/'), *name = slash ? slash + 1 : mesh,
               *dot = strrchr(name, '.');
    const int length = (int)(dot ? (size_t)(dot - name) : strlen(name));
    for (int i = 0; i < 2; i++) {
        const int n = snprintf(path, size, "%s/%.*s%s", folder, length, name, endings[i]);
        FILE *f = n > 0 && (size_t)n < size ? fopen(path, "rb") : NULL;
        if (!f) continue;
        fclose(f);
        return true;
    }
    return false;
}

/* Demands that the particles x[n] are near the mesh: those of another shape, or in another frame,
 * would give a model that looks right at first. */
static sdm_status check_near(const char *path, const double *x, size_t n, const char *mesh_path,
                             const sdm_mesh *mesh, sdm_error *err)
{
    double low[3], high[3], size = 0, gap = 0, *distance = NULL;
    size_t farthest = 0;
    sdm_exact *engine = NULL;
    memcpy(low, mesh->vert, sizeof low);
    memcpy(high, mesh->vert, sizeof high);
    for (size_t i = 0; i < 3 * mesh->n_vert; i++) {
        low[i % 3] = fmin(low[i % 3], mesh->vert[i]);
        high[i % 3] = fmax(high[i % 3], mesh->vert[i]);
    }
    for (size_t d = 0; d < 3; d++) size = hypot(size, high[d] - low[d]);
    sdm_status s = SDM_ALLOC(&distance, n, "distances of particles", err);
    if (!s) s = sdm_exact_create(mesh, NULL, &engine, err);
    const sdm_exact_at out = {.distance = distance};
    if (!s) s = sdm_exact_points(engine, x, n, &out, err);
    for (size_t i = 0; i < n && !s; i++)
        if (fabs(distance[i]) > gap) gap = fabs(distance[i]), farthest = i;
    if (!s && gap > GAP_MAX * size)
        s = sdm_fail(err, SDM_E_FORMAT,
                     "%s: particle %zu is %.3g away from %s, which has a size of %.3g: need the "
                     "particles of this mesh, in its frame",
                     path, farthest + 1, gap, mesh_path, size);
    sdm_exact_free(engine);
    sdm_free(distance);
    return s;
}

/* Warps the mesh, on which the particles of the file `own` are, onto all shapes. */
static sdm_status warp(const particles *p, const char *own, const char *mesh_path,
                       const sdm_mesh *mesh, double **vert, sdm_error *err)
{
    double *x = NULL;
    size_t n;
    sdm_error why = {0};
    sdm_status s = read_particles(own, &x, &n, err);
    if (!s && n != p->n)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: %zu particles, %s has %zu", own, n, p->files.items[0],
                     p->n);
    if (!s) s = check_near(own, x, n, mesh_path, mesh, err);
    if (!s) s = SDM_ALLOC(vert, 3 * mesh->n_vert * p->files.n, "shapes", err);
    if (!s) {
        s = sdm_ssm_warp(n, x, p->files.n, p->vert, mesh->n_vert, mesh->vert, *vert, &why);
        if (s) s = sdm_fail(err, s == SDM_E_ARG ? SDM_E_FORMAT : s, "%s: %s", own, why.text);
    }
    sdm_free(x);
    return s;
}

/* *vert = the vertices of the mesh in all shapes. */
static sdm_status make_shapes(const cli_args *args, const char *folder, particles *p,
                              const sdm_mesh *mesh, double **vert, sdm_error *err)
{
    char found[4096];
    const char *surface = args->import.surface, *own = args->import.particles;
    if (!own && find_own(folder, surface, found, sizeof found)) own = found;
    if (own) return warp(p, own, surface, mesh, vert, err);
    if (mesh->n_vert != p->n)
        return sdm_fail(err, SDM_E_ARG,
                        "%s: %zu vertices for %zu particles, and no file of its particles in %s: "
                        "give it by --particles FILE",
                        surface, mesh->n_vert, p->n, folder);
    *vert = p->vert; // the vertices are the particles
    p->vert = NULL;
    return SDM_OK;
}

bool cli_ssm_has_particles(const char *folder)
{
    cli_list files;
    const bool found = !cli_folder_list(folder, ".particles", &files, NULL) && files.n > 0;
    cli_folder_free(&files);
    return found;
}

sdm_status cli_ssm_particles(const cli_args *args, const char *folder, sdm_ssm *out, sdm_error *err)
{
    particles p = {0};
    sdm_mesh mesh = {0};
    double *vert = NULL;
    if (!args->import.surface)
        return sdm_fail(err, SDM_E_ARG,
                        "%s: particles have no triangles: give the mesh of one shape by "
                        "--surface MESH",
                        folder);
    sdm_status s = read_all(folder, &p, err);
    if (!s) s = sdm_mesh_read(args->import.surface, &mesh, err);
    if (!s && mesh.n_tri == 0)
        s = sdm_fail(err, SDM_E_FORMAT, "%s: no triangles", args->import.surface);
    if (!s) s = make_shapes(args, folder, &p, &mesh, &vert, err);
    if (!s) s = SDM_ALLOC(&out->tri, 3 * mesh.n_tri, "triangles", err);
    if (!s) {
        memcpy(out->tri, mesh.tri, 3 * mesh.n_tri * sizeof *mesh.tri);
        out->n_vert = mesh.n_vert, out->n_tri = mesh.n_tri;
        s = cli_ssm_build(p.files.n, vert, args->import.scale, out, err);
    }
    sdm_free(vert);
    sdm_mesh_dispose(&mesh);
    sdm_free(p.vert);
    cli_folder_free(&p.files);
    return s;
}
