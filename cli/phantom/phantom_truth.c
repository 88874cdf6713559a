/* Writes the truth of a phantom as JSON: shape, parameters, pose, grid and settings of the
 * image. */
#include "phantom_command.h"
#include "report/json_values.h"

static void add_shape(sdm_json *j, const cli_phantom *p)
{
    const sdm_shape *shape = sdm_instance_shape(p->shape.instance);
    const sdm_option_value *values = sdm_instance_options(p->shape.instance);
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
    cli_json_params(j, "parameters", p->shape.params, p->shape.n_params, p->shape.values);
}

static void add_pose(sdm_json *j, const sdm_pose *pose)
{
    sdm_json_open(j, "pose", '{');
    sdm_json_reals(j, "rotation_rad", pose->rotation, 3);
    sdm_json_reals(j, "translation_mm", pose->translation, 3);
    sdm_json_text(j, "meaning",
                  "world = R x + translation, LPS mm; R turns about the origin of the shape's "
                  "frame by the rotation "
                  "vector (axis times angle)");
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
    sdm_json_reals(j, "blur_mm", o->blur, 3);
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
    sdm_json_grid(j, "grid", &p->grid, true);
    add_image(j, &p->opts);
    sdm_json_int(j, "inside_voxels", (int64_t)inside);
    sdm_json_bool(j, "cut", p->cut);
    sdm_json_close(j, '}');
}
