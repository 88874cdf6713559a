/* Warns of a plug-in whose meshes depend on the calls before. */
#include "report/terminal.h"
#include "report_survey.h"
#include "sdm/internal/shape_repeat.h"
#include "sdm/memory.h"

/* Shapes that are made again, and the room behind them, which a mesh() that expects more parameters
 * reads. */
enum { SHAPES = 6, ROOM = 64 };

/* p[n] = shape number i of SHAPES: the defaults, both ends of all ranges, and shapes between. */
static void choose(const sdm_param *params, size_t n, size_t i, double *p)
{
    static const double share[SHAPES] = {0, 0, 1, 0.3, 0.55, 0.8};
    for (size_t k = 0; k < n; k++) {
        // between the ends every parameter has a share of its own
        const double at = i < 3 ? share[i] : share[3 + (i + k) % 3];
        p[k] = i ? params[k].min + at * (params[k].max - params[k].min) : params[k].def;
    }
}

void cli_warn_repeats(const sdm_instance *shape)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    sdm_repeat r = {0};
    double *p = NULL;
    if (SDM_ALLOC(&p, SHAPES * n + ROOM, "parameters of shapes", NULL)) return;
    for (size_t i = 0; i < SHAPES; i++) choose(params, n, i, p + i * n);
    const sdm_status s = sdm_repeat_find(shape, p, SHAPES, true, &r, NULL);
    sdm_free(p);
    if (s || !r.unlike) return;
    const char *name = sdm_instance_shape(shape)->name;
    if (r.cause == SDM_REPEAT_BESIDE)
        cli_warn("shape '%s': " SDM_REPEAT_BESIDE_TEXT "; %s. Results of exact maps may be wrong; "
                 "sdmgen shapes check %s tells more",
                 name, params[r.param].name, sdm_repeat_advice(r.cause), name);
    else
        cli_warn(
            "shape '%s': meshes have other bits when they are made again; %s. Results of exact "
            "maps may be wrong; sdmgen shapes check %s tells more",
            name, sdm_repeat_advice(r.cause), name);
}
