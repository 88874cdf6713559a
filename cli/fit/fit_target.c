/* Reads the target of a fit: an image, labels, a mesh or points. */
#include <math.h>
#include <string.h>

#include "fit_command.h"
#include "inputs/points_file.h"
#include "inputs/setup.h"
#include "report/files.h"
#include "report/report_audit.h"
#include "report/report_image.h"
#include "report/terminal.h"
#include "sdm/memory.h"

/* Number of points on the surface of a mesh: more make a fit slower but hardly more precise. */
enum { SURFACE_POINTS = 20000 };

/* An image with as few different values looks like labels, labels with more values like an image.
 */
enum { FEW_VALUES = 16, MANY_VALUES = 1000 };

void cli_fit_negate_xy(double *points, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        points[3 * i] = -points[3 * i];
        points[3 * i + 1] = -points[3 * i + 1];
    }
}

/* ---- images ---- */

/* An image looks like labels: refuses one of 0 and 1 alone, unless values of tissues say that it is
 * meant as an image; else a notice. */
static sdm_status check_few_values(cli_fit *f, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    float found[FEW_VALUES];
    const size_t n = f->image.stored > SDM_VOXEL_INT64
                         ? FEW_VALUES + 1
                         : cli_fit_distinct(&f->image, FEW_VALUES, found);
    if (n > FEW_VALUES || n < 2 || found[0] < 0) return SDM_OK;
    const bool binary = n == 2 && !(found[0] > 0) && !(found[1] > 1);
    if (binary && isnan(a->inside[0]) && isnan(a->outside[0]))
        return sdm_fail(err, SDM_E_ARG,
                        "%s holds only the values 0 and 1, as labels do: --label 1 fits to them; "
                        "--inside and --outside fit to them as to an image",
                        f->path);
    cli_notice("%s holds only %zu different values, %g to %g: if it is a label map, give --label "
               "with the value of the shape, e.g. --label %g",
               f->path, n, (double)found[0], (double)found[n - 1], (double)found[n - 1]);
    f->suspicion = "; if the file is a label map, give --label";
    return SDM_OK;
}

sdm_status cli_fit_many_values(const sdm_volume *v, bool *many, sdm_error *err)
{
    float *found = NULL;
    const sdm_status s = SDM_ALLOC(&found, MANY_VALUES, "labels", err);
    *many = !s && cli_fit_distinct(v, MANY_VALUES, found) > MANY_VALUES;
    sdm_free(found);
    return s;
}

void cli_fit_warn_many_values(const char *path, const char *mend)
{
    cli_warn("%s holds over %d different values, or fractions: %s", path, MANY_VALUES, mend);
}

static sdm_status use_image(cli_fit *f, sdm_error *err)
{
    const sdm_volume *v = &f->image;
    if (v->n_segments)
        return sdm_fail(
            err, SDM_E_ARG,
            "%s is a segmentation of %zu segments: select those of the shape, e.g. --label '%s'",
            f->path, v->n_segments, v->segments[0].name);
    if (v->n_layers > 1)
        return sdm_fail(err, SDM_E_FORMAT, "%s has %zu layers, need one image", f->path,
                        v->n_layers);
    if (cli_is_distance_map(v) && !f->args->force)
        return sdm_fail(err, SDM_E_ARG,
                        "%s is a signed distance map, no image: fit the surface that it describes "
                        "(written with -o FILE.stl in place of this file); --force fits to the "
                        "distances as grey values",
                        f->path);
    f->target.kind = SDM_FIT_IMAGE;
    f->target.values = v->values;
    return check_few_values(f, err);
}

/* Do most voxels of the mask lie alone, without another one beside them? No label of an organ is
 * like this; a value of an image is. */
static bool is_scattered(const sdm_grid *g, const float *mask)
{
    const size_t step[3] = {1, (size_t)g->n[0], (size_t)(g->n[0] * g->n[1])};
    size_t n = 0, alone = 0;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++) {
                const size_t at = sdm_grid_voxel(g, i, j, k);
                const int64_t place[3] = {i, j, k};
                bool beside = false;
                if (!(mask[at] > 0)) continue;
                for (int a = 0; a < 3; a++) {
                    beside |= place[a] > 0 && mask[at - step[a]] > 0;
                    beside |= place[a] + 1 < g->n[a] && mask[at + step[a]] > 0;
                }
                n++, alone += !beside;
            }
    return 2 * alone > n;
}

static sdm_status use_labels(cli_fit *f, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&f->mask, sdm_grid_count(&f->image.grid), "labels", err);
    if (!s) s = cli_fit_label_mask(f->path, &f->image, &f->args->fit.labels, f->mask, err);
    bool many = false;
    if (!s && !f->image.n_segments) s = cli_fit_many_values(&f->image, &many, err);
    if (many && is_scattered(&f->image.grid, f->mask))
        return sdm_fail(err, SDM_E_ARG,
                        "%s: the voxels with this label lie scattered, and the file holds over %d "
                        "different values, or fractions: it is an image; leave --label out",
                        f->path, MANY_VALUES);
    if (many) cli_fit_warn_many_values(f->path, "if it is an image, leave --label out");
    if (!s) s = cli_fit_close_labels(f, &f->image.grid, f->mask, err);
    f->target.kind = SDM_FIT_LABEL;
    f->target.values = f->mask;
    return s;
}

/* A notice where the two frames of a file contradict each other. */
static void notice_frames(const cli_fit *f)
{
    const sdm_volume *v = &f->image;
    if (v->frames_mirrored)
        cli_notice("%s: sform and qform are mirror images of each other: one of them shows the "
                   "wrong side; sform is used",
                   f->path);
    else if (v->frames_differ_mm > 0)
        cli_notice("%s: sform and qform place voxels up to %.3g mm apart; sform is used", f->path,
                   v->frames_differ_mm);
}

static sdm_status read_volume(cli_fit *f, sdm_error *err)
{
    sdm_status s = sdm_volume_read(f->path, &f->image, err);
    if (s) return s;
    if (!f->image.placed)
        cli_notice("%s states no frame: the default axes of its format are assumed", f->path);
    notice_frames(f);
    f->target.grid = f->image.grid;
    return f->args->fit.labels.n ? use_labels(f, err) : use_image(f, err);
}

/* ---- meshes and points ---- */

/* The points of a mesh file: of its surface or, if it holds no triangles, its vertices. */
static sdm_status read_mesh(cli_fit *f, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status s = cli_read_mesh(f->path, &mesh, err);
    if (s) return s;
    if (mesh.n_tri) cli_warn_mesh(&mesh, 0, "sdmgen mesh --turn-parts mends this");
    const size_t n = mesh.n_tri ? SURFACE_POINTS : mesh.n_vert;
    s = SDM_ALLOC(&f->points, 3 * n, "points", err);
    if (!s && !mesh.n_tri && n) memcpy(f->points, mesh.vert, 3 * n * sizeof *f->points);
    if (!s && mesh.n_tri) {
        s = sdm_fit_surface_points(&mesh, n, f->opts.n_threads, f->points, err);
        if (s) s = sdm_fail_in(err, s, "%s", f->path);
        f->of_surface = true;
    }
    f->target.n_points = n;
    sdm_mesh_dispose(&mesh);
    return s;
}

static sdm_status read_points(cli_fit *f, sdm_error *err)
{
    if (f->args->fit.labels.n)
        return sdm_fail(err, SDM_E_ARG, "fit: --label applies to volumes; %s has no labels",
                        f->path);
    const sdm_status s = cli_ends_with_any(f->path, CLI_MESH_ENDINGS)
                             ? read_mesh(f, err)
                             : cli_read_points(f->path, &f->points, NULL, &f->target.n_points, err);
    if (s) return s;
    for (size_t i = 0; i < 3 * f->target.n_points; i++)
        if (!isfinite(f->points[i]))
            return sdm_fail(err, SDM_E_FORMAT, "%s: %c of point %zu is missing or not finite",
                            f->path, "xyz"[i % 3], i / 3 + 1);
    if (f->target.n_points < 3)
        return sdm_fail(err, SDM_E_FORMAT, "%s: %zu points, need 3 or more", f->path,
                        f->target.n_points);
    if (f->args->fit.ras) cli_fit_negate_xy(f->points, f->target.n_points);
    f->target.kind = SDM_FIT_POINTS;
    f->target.points = f->points;
    return SDM_OK;
}

sdm_status cli_fit_read_target(cli_fit *f, sdm_error *err)
{
    if (sdm_volume_knows(f->path)) return read_volume(f, err);
    if (cli_ends_with_any(f->path, CLI_MESH_ENDINGS " .csv .npy")) return read_points(f, err);
    return sdm_fail(err, SDM_E_ARG,
                    "fit: image '%s': its name must end in .nii .nii.gz .nrrd .nhdr .mha .mhd "
                    "(volume), " CLI_MESH_ENDINGS " (mesh), .csv or .npy (points)",
                    f->path);
}

const char *cli_fit_kind(const cli_fit *f)
{
    return f->target.kind == SDM_FIT_IMAGE   ? "image"
           : f->target.kind == SDM_FIT_LABEL ? "labels"
                                             : "points";
}
