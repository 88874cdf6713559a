/* Derivatives of distances at points by parameters that move the vertices. */
#include "point_slopes.h"

#include <math.h>

#include "mesh/facet.h"
#include "sdm/internal/heap.h"

void sdm_exact_slopes_free(sdm_exact_slopes *s)
{
    if (!s) return;
    sdm_free(s->frames);
    sdm_free(s);
}

/* The feature of triangle t of the surface that is nearest to x. */
static int feature_of(const sdm_exact_slopes *s, uint32_t t, const double x[3])
{
    sdm_frame frame;
    double q[3];
    int feature;
    sdm_facet_frame(s->surface, t, &frame);
    (void)sdm_frame_closest(&frame, x, q, &feature);
    return feature;
}

void sdm_exact_slopes_at(const sdm_exact_slopes *s, const double x[3], const sdm_exact_at *answers,
                         size_t index, double *slopes)
{
    const uint32_t triangle = answers->triangle[index];
    const bool inside = answers->distance[index] < 0;
    const size_t n_vert = s->sheets.mesh->n_vert;
    sdm_vertex_gradient g = {.n = 0};
    const bool found = isfinite(answers->distance[index]);
    // outside, the feature does not matter
    if (found)
        sdm_vertex_gradient_find(
            &s->sheets, triangle, inside ? feature_of(s, triangle, x) : SDM_FACE,
            answers->closest + 3 * index, answers->gradient + 3 * index, inside, &g);
    for (size_t k = 0; k < s->n; k++)
        slopes[k] = found ? sdm_vertex_gradient_along(&g, s->velocity + 3 * n_vert * k) : NAN;
}
