/* What a phantom shows, as JSON. */
#include "phantom_command.h"

static void add_numbers(sdm_json *j, const char *key, const double *v, int n)
{
    sdm_json_open(j, key, '[');
    for (int i = 0; i < n; i++) sdm_json_real(j, NULL, v[i]);
    sdm_json_close(j, ']');
}

static void add_shape(sdm_json *j, const cli_phantom *p)
{
    const sdm_shape *shape = sdm_instance_shape(p->shape);
    const sdm_option_value *values = sdm_instance_options(p->shape);
    const sdm_param *params = sdm_instance_params(p->shape, NULL);
    sdm_json_text(j, "shape", shape->name);
    sdm_json_open(j, "options", '{');
    for (uint32_t i = 0; i < shape->n_options; i++) {
        const sdm_option *o = &shape->options[i];
        if (o->type == SDM_OPTION_REAL || o->type == SDM_OPTION_INT)
            sdm_json_real(j, o->name, values[i].number);
        else
            sdm_json_text(j, o->name, values[i].text);
    }
    sdm_json_close(j, '}');
    sdm_json_open(j, "parameters", '{');
    for (size_t i = 0; i < p->n_params; i++) sdm_json_real(j, params[i].name, p->params[i]);
    sdm_json_close(j, '}');
}

static void add_pose(sdm_json *j, const sdm_pose *pose)
{
    sdm_json_open(j, "pose", '{');
    add_numbers(j, "rotation_rad", pose->rotation, 3);
    add_numbers(j, "translation_mm", pose->translation, 3);
    sdm_json_text(j, "meaning",
                  "world = R x + translation, LPS mm; R turns about the origin of the shape's "
                  "frame by the rotation "
                  "vector (axis times angle)");
    sdm_json_close(j, '}');
}

static void add_grid(sdm_json *j, const sdm_grid *g)
{
    sdm_json_open(j, "grid", '{');
    sdm_json_open(j, "size", '[');
    for (int i = 0; i < 3; i++) sdm_json_int(j, NULL, g->n[i]);
    sdm_json_close(j, ']');
    add_numbers(j, "spacing", g->spacing, 3);
    add_numbers(j, "origin", g->origin, 3);
    add_numbers(j, "direction", g->dir, 9);
    sdm_json_close(j, '}');
}

static void add_tissue(sdm_json *j, const char *key, sdm_tissue t)
{
    sdm_json_open(j, key, '{');
    sdm_json_real(j, "mean", t.mean);
    sdm_json_real(j, "sd", t.sd);
    sdm_json_close(j, '}');
}

static void add_image(sdm_json *j, const sdm_phantom_opts *o)
{
    add_tissue(j, "inside", o->inside);
    add_tissue(j, "outside", o->outside);
    if (o->air_share > 0) {
        add_tissue(j, "air", o->air);
        sdm_json_real(j, "air_share", o->air_share);
        sdm_json_real(j, "air_mm", o->air_mm);
        sdm_json_real(j, "air_clear_mm", o->air_clear_mm);
    }
    add_numbers(j, "blur_mm", o->blur, 3);
    sdm_json_real(j, "texture_mm", o->texture_mm);
    sdm_json_real(j, "noise", o->noise);
    sdm_json_bool(j, "noise_is_blurred", o->noise_is_blurred);
    sdm_json_int(j, "supersampling", o->supersampling);
    sdm_json_uint(j, "seed", o->seed);
}

void cli_phantom_truth(const cli_phantom *p, size_t inside, sdm_json *j)
{
    sdm_json_open(j, NULL, '{');
    sdm_json_text(j, "made_by", "sdmgen " SDM_VERSION_TEXT);
    add_shape(j, p);
    add_pose(j, &p->pose);
    add_grid(j, &p->grid);
    add_image(j, &p->opts);
    sdm_json_int(j, "inside_voxels", (int64_t)inside);
    sdm_json_bool(j, "cut", p->cut);
    sdm_json_close(j, '}');
}
