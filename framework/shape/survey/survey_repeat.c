/* Repeats meshes of a survey. */
#include "survey_repeat.h"

enum { THREADS = 4, SHAPES = 8, SHAPES_BRIEF = 4, TRIANGLES = 200000 };
static const double SECONDS_BRIEF = 0.1;

/* Number of shapes: fewer if the mesh at p has many triangles. */
static size_t choose(const sdm_instance *shape, const double *p, size_t n, bool brief)
{
    sdm_mesh mesh = {0};
    size_t most = brief ? SHAPES_BRIEF : SHAPES;
    if (!sdm_instance_mesh(shape, p, &mesh, NULL) && mesh.n_tri * most > TRIANGLES)
        most = TRIANGLES / mesh.n_tri;
    sdm_mesh_dispose(&mesh);
    if (most < 1) most = 1;
    return n < most ? n : most;
}

sdm_status sdm_survey_repeat(const sdm_instance *shape, const double *p, size_t n, bool brief,
                             sdm_repeat *out, sdm_error *err)
{
    n = choose(shape, p, n, brief);
    const sdm_status s = sdm_shape_repeat(shape, p, n, out, err);
    if (s == SDM_E_PLUGIN) return SDM_OK;
    if (s || out->unlike || sdm_is_isolated(shape)) return s;
    return sdm_shape_repeat_at_once(shape, p, n, THREADS,
                                    brief ? SECONDS_BRIEF : SHAPE_REPEAT_SECONDS, out, err);
}
