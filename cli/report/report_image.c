/* Prints the grid, the range of values and the segments of an image file. */
#include "report_image.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "json_values.h"
#include "output.h"
#include "sdm/map.h"
#include "terminal.h"

static void print_grid(const sdm_grid *g)
{
    static const char axis[] = "xyz";
    char count[32];
    printf("grid         %lld x %lld x %lld voxels (%s) of %g x %g x %g mm\n", (long long)g->n[0],
           (long long)g->n[1], (long long)g->n[2],
           cli_format_count((int64_t)sdm_grid_count(g), count), g->spacing[0], g->spacing[1],
           g->spacing[2]);
    printf("origin       %g %g %g (LPS, mm)\n", g->origin[0], g->origin[1], g->origin[2]);
    for (int a = 0; a < 3; a++)
        printf("%s %c along %g %g %g\n", a ? "            " : "axes        ", axis[a], g->dir[a],
               g->dir[3 + a], g->dir[6 + a]);
}

bool cli_is_distance_map(const sdm_volume *v)
{
    // a segmentation keeps the description of the map of which it is the inside
    return strstr(v->text, ": " SDM_MAP_TEXT) && v->n_layers == 1 && !v->n_nan && !v->n_segments;
}

/* Volume inside the zero level set, mm^3; NaN: the file is no distance map of this program. */
static double map_volume(const sdm_volume *v)
{
    double volume = NAN;
    return !cli_is_distance_map(v) || sdm_map_volume(&v->grid, v->values, 0, &volume, NULL)
               ? NAN
               : volume;
}

/* Volume of the voxels of a segment, mm^3; NaN: there are several layers. */
static double segment_volume(const sdm_volume *v, const sdm_segment *s)
{
    const double *h = v->grid.spacing;
    size_t n = 0;
    for (size_t i = 0; i < sdm_grid_count(&v->grid) && v->n_layers == 1; i++)
        n += (double)v->values[i] == (double)s->value;
    return v->n_layers == 1 ? (double)n * h[0] * h[1] * h[2] : NAN;
}

void cli_print_volume(const char *path, const sdm_volume *v)
{
    cli_print("%s: image of %s voxels", path, sdm_voxel_name(v->stored));
    if (v->n_layers > 1) cli_print(", %zu layers", v->n_layers);
    cli_print("\n\n");
    print_grid(&v->grid);
    if (!v->placed)
        cli_print(
            "             the file states no frame: axes and origin are defaults of its format\n");
    cli_print("values       %.9g .. %.9g\n", (double)v->min, (double)v->max);
    char number[32];
    const double volume = map_volume(v);
    if (isfinite(volume))
        cli_print("volume       %s mm^3 inside the surface\n", cli_number(volume, 6, number));
    if (v->n_nan > 0 || v->n_inf > 0)
        cli_print("             %zu are NaN, %zu infinite\n", v->n_nan, v->n_inf);
    for (size_t i = 0; i < v->n_segments; i++) {
        const sdm_segment *s = &v->segments[i];
        const double mm3 = segment_volume(v, s);
        cli_print("%s '%s' (%s): value %lld in layer %zu", i ? "            " : "segments    ",
                  s->name, s->id, (long long)s->value, s->layer);
        if (isfinite(mm3)) cli_print(", its voxels have %s mm^3", cli_number(mm3, 6, number));
        cli_print("\n");
    }
    if (v->text[0]) cli_print("description  %s\n", v->text);
}

void cli_json_volume(sdm_json *j, const char *path, const sdm_volume *v)
{
    sdm_json_text(j, "file", path);
    sdm_json_text(j, "type", "image");
    sdm_json_text(j, "voxel_type", sdm_voxel_name(v->stored));
    sdm_json_grid(j, "grid", &v->grid, false);
    sdm_json_reals(j, "direction", v->grid.dir, 9);
    sdm_json_bool(j, "placed", v->placed);
    sdm_json_int(j, "layers", (int64_t)v->n_layers);
    sdm_json_real(j, "min", (double)v->min);
    sdm_json_real(j, "max", (double)v->max);
    const double volume = map_volume(v);
    if (isfinite(volume)) sdm_json_real(j, "volume_mm3", volume);
    sdm_json_int(j, "nan", (int64_t)v->n_nan);
    sdm_json_int(j, "infinite", (int64_t)v->n_inf);
    sdm_json_open(j, "segments", '[');
    for (size_t i = 0; i < v->n_segments; i++) {
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "name", v->segments[i].name);
        sdm_json_text(j, "id", v->segments[i].id);
        sdm_json_int(j, "value", v->segments[i].value);
        sdm_json_int(j, "layer", (int64_t)v->segments[i].layer);
        sdm_json_real(j, "volume_mm3", segment_volume(v, &v->segments[i]));
        sdm_json_close(j, '}');
    }
    sdm_json_close(j, ']');
    sdm_json_text(j, "text", v->text);
}
