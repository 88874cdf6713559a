/* Writes maps as level sets, images, surfaces or pictures, as the ending of the file name says. */
#include "output.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files.h"
#include "sdm/image.h"
#include "sdm/internal/near.h"
#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/verdict.h"
#include "sdm/internal/volume_cause.h"
#include "sdm/isosurface.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"
#include "sdm/picture.h"
#include "sdm/vdb.h"
#include "sdm/volume.h"
#include "terminal.h"

/* Largest part by which the volume of a surface may differ from that of the shape in silence. */
#define VOLUME_OFF_MAX 0.02

typedef enum file_kind {
    KIND_NONE = 0,
    KIND_VDB,
    KIND_IMAGE,
    KIND_SURFACE,
    KIND_PICTURE
} file_kind;

static const struct {
    const char *suffix;
    file_kind kind;
} kinds[] = {{".vdb", KIND_VDB},     {".nii", KIND_IMAGE},   {".nii.gz", KIND_IMAGE},
             {".nrrd", KIND_IMAGE},  {".mha", KIND_IMAGE},   {".npy", KIND_IMAGE},
             {".ply", KIND_SURFACE}, {".stl", KIND_SURFACE}, {".obj", KIND_SURFACE},
             {".off", KIND_SURFACE}, {".vtk", KIND_SURFACE}, {".vtp", KIND_SURFACE},
             {".png", KIND_PICTURE}, {".svg", KIND_PICTURE}, {".pdf", KIND_PICTURE}};
enum { N_KINDS = sizeof kinds / sizeof *kinds };

/* The type of the file by its ending; *suffix (may be NULL) points to the ending. */
static file_kind kind_of(const char *path, const char **suffix)
{
    for (size_t i = 0; i < N_KINDS; i++) {
        if (!cli_ends_with(path, kinds[i].suffix)) continue;
        if (suffix) *suffix = path + strlen(path) - strlen(kinds[i].suffix);
        return kinds[i].kind;
    }
    return KIND_NONE;
}

sdm_status cli_check_type(const char *path, bool meshes_only, sdm_error *err)
{
    const file_kind kind = kind_of(path, NULL);
    if (meshes_only && kind != KIND_SURFACE)
        return sdm_fail(err, SDM_E_ARG,
                        "output '%s': its name must end in .ply .stl .obj .off .vtk "
                        "or .vtp",
                        path);
    if (kind == KIND_NONE)
        return sdm_fail(err, SDM_E_ARG,
                        "output '%s': its name must end in .vdb .nii .nii.gz .nrrd .seg.nrrd .mha "
                        ".npy .ply .stl .obj .off .vtk .vtp .png .svg or .pdf",
                        path);
#ifndef SDM_HAVE_VDB
    if (kind == KIND_VDB)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "output '%s': built without OpenVDB", path);
#endif
    return kind == KIND_PICTURE ? sdm_picture_check(path, err) : SDM_OK;
}

bool cli_writes_level_set(const cli_args *args)
{
    for (size_t i = 0; i < args->outputs.n; i++)
        if (kind_of(args->outputs.items[i], NULL) == KIND_VDB) return true;
    return false;
}

sdm_status cli_check_vdb_options(const cli_args *args, sdm_error *err)
{
    const char *given = args->dense      ? "--dense"
                        : args->half     ? "--half"
                        : args->band > 0 ? "--band"
                                         : NULL;
    if (given && !cli_writes_level_set(args))
        return sdm_fail(err, SDM_E_ARG, "%s: %s does nothing without an output -o FILE.vdb",
                        args->command->name, given);
    if (args->dense && args->band > 0)
        return sdm_fail(err, SDM_E_ARG,
                        "%s: --band does nothing with --dense, which writes the whole map",
                        args->command->name);
    return SDM_OK;
}

bool cli_blocks_suffice(const cli_args *args)
{
    for (size_t i = 0; i < args->outputs.n; i++)
        if (kind_of(args->outputs.items[i], NULL) != KIND_VDB) return false;
    return args->outputs.n > 0 && !args->dense;
}

sdm_status cli_blocks_band(const sdm_grid *grid, const cli_args *args, double *band_mm,
                           sdm_error *err)
{
#ifdef SDM_HAVE_VDB
    const sdm_vdb_opts opts = {.band_voxels = args->band, .half = args->half};
    return sdm_vdb_band(grid, &opts, band_mm, err);
#else
    (void)grid;
    (void)args;
    (void)band_mm;
    return sdm_fail(err, SDM_E_UNSUPPORTED, "built without OpenVDB");
#endif
}

bool cli_is_picture(const char *path) { return kind_of(path, NULL) == KIND_PICTURE; }

/* One word that names the method that made the map: "network", "exact", "edt" ... */
static const char *made_by(const cli_map *map)
{
    return map->source == SDM_SOURCE_NETWORK ? "network" : map->origin;
}

/* text = the method and, in parentheses, whether parameters were clamped or why the exact engine
 * replaced the network. */
static void describe_method(const cli_map *map, char text[80])
{
    static const char *const reasons[] = {"", " (out of the trained range)",
                                          " (network over the bound)"};
    snprintf(text, 80, "%s%s%s", made_by(map), map->clamped ? " (clamped)" : "",
             reasons[map->reason]);
}

#ifdef SDM_HAVE_VDB
static sdm_status map_beyond(void *engine, const sdm_grid *grid, float *values, sdm_error *err)
{
    return sdm_exact_map(engine, grid, values, err);
}
#endif

/* Maps of at most so many voxels have their level sets compared with the shape. */
#define COMPARED_MAX 2000000

/* Is a volume that is off by `more` of that of the shape an error of the network? Voxels cut edges,
 * so that the surface encloses less. */
static bool network_errs(const cli_map *map, double more)
{
    return map->quality &&
           (more > 0 || !sdm_voxels_explain_volume(-more, map->quality->volume_error));
}

/* Warns of a surface that encloses volume[0] mm^3 in place of volume[1]. */
static void warn_network_volume(const char *path, const cli_map *map, const double volume[2])
{
    const double more = volume[0] / volume[1] - 1, error = map->quality->surface_volume_error;
    char measured[96] = "", own[32], right[32];
    if (!isnan(error))
        snprintf(measured, sizeof measured,
                 ": its training found volumes of surfaces off by %.2g %% (root mean square)",
                 100 * error);
    cli_warn("%s: the surface encloses %s mm^3, %.2g %% %s than the shape, %s mm^3, because the "
             "network errs%s; exact maps (sdmgen exact) have no such error",
             path, cli_number(volume[0], 4, own), 100 * fabs(more), more < 0 ? "less" : "more",
             cli_number(volume[1], 4, right), measured);
}

/* Warns of a surface that cannot be compared with its shape, if the training found volumes of such
 * surfaces to be off. */
static void warn_unknown_volume(const char *path, const cli_map *map)
{
    const double error = map->quality ? map->quality->surface_volume_error : NAN;
    if (error > VOLUME_OFF_MAX && sdm_grid_coarsest(map->grid) >= map->trained_mm)
        cli_warn("%s: the training found volumes of such surfaces off by %.2g %% (root mean "
                 "square); --plugin with the shape tells this one's",
                 path, 100 * error);
}

/* Warns if the surface has more pieces than the shape whose map it was made from, or encloses
 * another volume. */
static void warn_surface(const char *path, const cli_map *map, const sdm_mesh *surface)
{
    sdm_audit audit;
    if (!(map->volume > 0)) warn_unknown_volume(path, map);
    if (!(map->volume > 0) || sdm_mesh_audit(surface, &audit, NULL) || !audit.closed) return;
    const double more = fabs(audit.volume) / map->volume - 1, voxel = sdm_grid_coarsest(map->grid);
    const bool trained = map->trained_mm >= voxel; // a finer grid shows no more of the shape
    if (map->pieces && audit.components > map->pieces)
        cli_warn("%s: the surface has %zu pieces, the shape %zu: a neck or a wall is thinner than "
                 "a voxel of %.3g mm and is torn; %s shows it",
                 path, audit.components, map->pieces, trained ? map->trained_mm : voxel,
                 trained ? "a training with a smaller grid.spacing" : "a smaller --spacing");
    else if (fabs(more) > VOLUME_OFF_MAX && network_errs(map, more)) {
        warn_network_volume(path, map, (const double[]){fabs(audit.volume), map->volume});
    } else if (fabs(more) > VOLUME_OFF_MAX) {
        const double cuts = trained ? map->trained_mm : voxel;
        char advice[96] = "", own[32], right[32];
        // between the voxels of a model, too, its interpolated map has sharper edges than they show
        if (trained || !map->thin)
            snprintf(advice, sizeof advice, "; about %.0f %% for this shape with --spacing %.2g",
                     100 * SDM_VOLUME_AIM, sdm_spacing_for_volume(cuts, fabs(more)));
        cli_warn("%s: the surface encloses %s mm^3, %.2g %% %s than the shape, %s mm^3: voxels of "
                 "%.3g %s%s",
                 path, cli_number(fabs(audit.volume), 4, own), 100 * fabs(more),
                 more < 0 ? "less" : "more", cli_number(map->volume, 4, right), cuts,
                 more < 0 ? "mm cut its edges and thin parts" : "mm fill its gaps and inner edges",
                 advice);
    }
}

#ifdef SDM_HAVE_VDB
/* The same of the surface of a level set. */
static void warn_level_set(const char *path, const cli_map *map)
{
    sdm_mesh surface = {0};
    if (!map->values || !(map->volume > 0) || sdm_grid_count(map->grid) > COMPARED_MAX) return;
    if (!sdm_isosurface(map->grid, map->values, 0.0f, &surface, NULL, NULL))
        warn_surface(path, map, &surface);
    sdm_mesh_dispose(&surface);
}
#endif

static sdm_status write_vdb(const char *path, const cli_map *map, const cli_args *args,
                            sdm_error *err)
{
#ifdef SDM_HAVE_VDB
    // metadata
    static const char *const reasons[] = {"none", "range", "error"};
    const sdm_check none = {0}, *check = map->check ? map->check : &none;
    char error[32], rmse[32], q95[32], max[32];
    const sdm_named_value metadata[] = {
        {"sdm_version", "sdmgen " SDM_VERSION_TEXT},
        {"sdm_shape", map->shape},
        {"sdm_parameters", map->params},
        {"sdm_source", made_by(map)},
        {"sdm_origin", map->origin},
        {"sdm_clamped", map->clamped ? "yes" : "no"},
        {"sdm_error_rmse_mm", sdm_format_real(map->error_mm, error)},
        {"sdm_exact_reason", reasons[map->reason]},
        {"sdm_check_rmse_mm", sdm_format_real(check->rmse_mm, rmse)},
        {"sdm_check_q95_mm", sdm_format_real(check->q95_mm, q95)},
        {"sdm_check_max_mm", sdm_format_real(check->max_mm, max)},
    };
    const size_t n_metadata = sizeof metadata / sizeof *metadata - (map->check ? 0 : 3);
    // the file
    const sdm_vdb_opts opts = {.band_voxels = args->band,
                               .dense = args->dense,
                               .half = args->half,
                               .metadata = metadata,
                               .n_metadata = n_metadata,
                               .cancelled = cli_interrupted,
                               .map = map->engine ? map_beyond : NULL,
                               .user = map->engine};
    sdm_vdb_report report = {0};
    const sdm_status s = map->blocks
                             ? sdm_vdb_write_blocks(path, map->blocks, &opts, &report, err)
                             : sdm_vdb_write(path, map->grid, map->values, &opts, &report, err);
    if (!s && !cli_writes_surface(args)) warn_level_set(path, map); // else the surface tells it
    if (!s && report.adjusted_voxels > 0)
        cli_notice("%s: %lld voxels at creases were adjusted by at most %.2g mm to make a valid "
                   "level set; no sign changed",
                   path, (long long)report.adjusted_voxels, report.adjusted_mm);
    if (!s && !report.cut && report.estimated_voxels > 0)
        cli_notice("%s: the band leaves the grid; the distances of %lld voxels beyond it are "
                   "estimated from those at its border: a larger grid or a narrower --band avoids "
                   "this",
                   path, (long long)report.estimated_voxels);
    return s;
#else
    (void)map;
    (void)args;
    return sdm_fail(err, SDM_E_UNSUPPORTED, "output '%s': built without OpenVDB", path);
#endif
}

void cli_map_compare(const sdm_mesh *shape, cli_map *map)
{
    sdm_part_audit audit;
    if (sdm_part_audit_make(shape, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL, &audit, NULL)) return;
    if (audit.mesh.closed && !audit.inside_out) {
        map->volume = audit.union_volume;
        if (!audit.mesh.self_intersections && !audit.mesh.nonmanifold_edges) map->pieces = audit.n;
    }
    sdm_part_audit_dispose(&audit);
}

bool cli_writes_surface(const cli_args *args)
{
    for (size_t i = 0; i < args->outputs.n; i++)
        if (cli_ends_with_any(args->outputs.items[i], CLI_MESH_ENDINGS)) return true;
    return false;
}

static sdm_status write_surface(const char *path, const cli_map *map, sdm_error *err)
{
    sdm_mesh surface = {0};
    sdm_status s = sdm_isosurface(map->grid, map->values, 0.0f, &surface, NULL, err);
    if (!s && surface.n_tri == 0)
        s = sdm_fail(err, SDM_E_MESH,
                     "%s: the map has no zero surface: all voxels are %s the shape; does the grid "
                     "cover it?",
                     path, map->values[0] < 0 ? "inside" : "outside");
    if (!s) s = sdm_mesh_write(path, &surface, err);
    if (!s) warn_surface(path, map, &surface);
    sdm_mesh_dispose(&surface);
    return s;
}

static sdm_status write_picture(const char *path, const cli_map *map, sdm_error *err)
{
    const float levels[] = {0.0f, sdm_grid_contour(map->grid)};
    char made[80];
    sdm_text title = {0};
    describe_method(map, made);
    sdm_text_add(&title, "%.64s: %s%s%s", map->shape, made, map->params && *map->params ? "\n" : "",
                 map->params ? map->params : "");
    const sdm_picture_map column = {.title = title.failed ? made : title.data,
                                    .values = map->values};
    const sdm_status s = sdm_picture_slices(path, map->grid, &column, 1, levels, 2, err);
    sdm_text_dispose(&title);
    return s;
}

sdm_status cli_write_labels(const char *path, const sdm_grid *grid, const uint8_t *labels,
                            const char *name, const char *text, sdm_error *err)
{
    sdm_segment segment = {.value = 1};
    if (!cli_ends_with(path, CLI_SEGMENTATION_ENDING))
        return sdm_volume_write(path, grid, labels, SDM_VOXEL_UINT8, text, err);
    snprintf(segment.name, sizeof segment.name, "%s", name);
    return sdm_segmentation_write(path, grid, labels, &segment, 1, text, err);
}

/* text[400] = the description of an image that was made from the map; `values` says what the voxels
 * hold. The parameters come last: NIfTI files keep only 79 characters. */
static void describe_image(const cli_map *map, const char *values, char text[400])
{
    char made[80];
    describe_method(map, made);
    snprintf(text, 400, "sdmgen %s: %s; %s: %s %s", SDM_VERSION_TEXT, values, made, map->shape,
             map->params);
}

/* Writes the inside of the map as a segmentation. */
static sdm_status write_inside(const char *path, const cli_map *map, sdm_error *err)
{
    char text[400];
    describe_image(map, "labels, 1 inside, 0 outside", text);
    const size_t n = sdm_grid_count(map->grid);
    uint8_t *labels = NULL;
    sdm_status s = SDM_ALLOC(&labels, n, "labels", err);
    for (size_t i = 0; i < n && !s; i++) labels[i] = map->values[i] < 0;
    if (!s) s = cli_write_labels(path, map->grid, labels, map->shape, text, err);
    sdm_free(labels);
    return s;
}

sdm_status cli_write_map(const char *path, const cli_map *map, const cli_args *args, sdm_error *err)
{
    char text[400];
    const sdm_status s = cli_check_interrupt(err);
    if (s) return s;
    switch (kind_of(path, NULL)) {
    case KIND_VDB:
        return write_vdb(path, map, args, err);
    case KIND_IMAGE:
        if (cli_ends_with(path, CLI_SEGMENTATION_ENDING)) return write_inside(path, map, err);
        describe_image(map, SDM_MAP_TEXT, text);
        return sdm_image_write(path, map->grid, map->values, text, err);
    case KIND_SURFACE:
        return write_surface(path, map, err);
    case KIND_PICTURE:
        return write_picture(path, map, err);
    default:
        return sdm_fail(err, SDM_E_ARG, "output '%s': unknown type", path);
    }
}

/* Length of a placeholder %d, %4d or %04d at `at`, 0 when there is none; *width: the field width of
 * the placeholder. */
static size_t number_mark(const char *at, int *width)
{
    if (*at != '%') return 0;
    size_t digits = strspn(at + 1, "0123456789");
    if (digits > 2 || at[1 + digits] != 'd') return 0;
    *width = digits ? atoi(at + 1) : 1;
    return digits + 2;
}

/* The first placeholder of a name, its length and its field width; NULL: there is none. */
static const char *find_mark(const char *path, size_t *length, int *width)
{
    const char *mark = path;
    while ((mark = strchr(mark, '%')) && !(*length = number_mark(mark, width))) mark++;
    return mark;
}

bool cli_has_number(const char *path)
{
    size_t length;
    int width;
    return find_mark(path, &length, &width) != NULL;
}

sdm_status cli_number_path(const char *path, size_t row, char *buf, size_t size, sdm_error *err)
{
    int width = 4, written;
    size_t length = 0;
    const char *mark = find_mark(path, &length, &width), *suffix = path + strlen(path);
    if (mark)
        written =
            snprintf(buf, size, "%.*s%0*zu%s", (int)(mark - path), path, width, row, mark + length);
    else {
        kind_of(path, &suffix);
        written = snprintf(buf, size, "%.*s-%04zu%s", (int)(suffix - path), path, row, suffix);
    }
    if (written < 0 || (size_t)written >= size)
        return sdm_fail(err, SDM_E_ARG, "output '%.100s...': the name is too long", path);
    return SDM_OK;
}

sdm_status cli_write_maps(const char *const *paths, size_t n, cli_map *map, const cli_args *args,
                          sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < n && !s; i++) {
        s = cli_write_map(paths[i], map, args, err);
        if (cli_ends_with_any(paths[i], CLI_MESH_ENDINGS))
            map->volume = 0; // compare only one surface
    }
    return s;
}
