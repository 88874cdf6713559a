/* Parameter vectors of a family of shapes: random ones, and corners of the ranges. */
#include "shape_family.h"

#include "sdm/internal/distribution.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/sampling.h"

enum { ALL_CORNERS_MAX = 6, RANDOM_CORNERS = 64 };
enum { STREAM_SAMPLES = 1, STREAM_CORNERS = 2, STREAM_ENDS = 3 };

sdm_status sdm_family_set(shape_family *f, const sdm_instance *shape, const double (*range)[2],
                          const sdm_distribution *distribution, uint64_t seed, sdm_error *err)
{
    const size_t n = shape->n_params;
    const bool all = n <= ALL_CORNERS_MAX;
    *f = (shape_family){.shape = shape,
                        .seed = seed,
                        .n_corners = all ? (size_t)1 << n : RANDOM_CORNERS,
                        .all_corners = all};
    for (size_t i = 0; i < n; i++) {
        const sdm_param *p = &shape->params[i];
        f->min[i] = range ? range[i][0] : p->min;
        f->max[i] = range ? range[i][1] : p->max;
        if (!(f->min[i] >= p->min && f->min[i] <= f->max[i] && f->max[i] <= p->max))
            return sdm_fail(err, SDM_E_RANGE,
                            "the range %g .. %g of '%s' does not lie within %g .. %g", f->min[i],
                            f->max[i], p->name, p->min, p->max);
        f->distribution[i] = distribution ? distribution[i] : shape->distributions[i];
        if (sdm_distribution_check(&f->distribution[i], f->min[i], f->max[i], NULL))
            f->distribution[i] = (sdm_distribution){SDM_DISTRIBUTION_UNIFORM, 0, 0};
    }
    return SDM_OK;
}

static void draw(const shape_family *f, uint64_t stream, uint64_t index, double *p)
{
    sdm_sample_params(f->seed, stream, index, f->min, f->max, f->distribution, f->shape->n_params,
                      p);
}

void sdm_family_sample(const shape_family *f, uint64_t index, double *p)
{
    draw(f, STREAM_SAMPLES, index, p);
}

void sdm_family_corner(const shape_family *f, uint64_t index, double *p)
{
    const size_t n = f->shape->n_params;
    if (!f->all_corners) draw(f, STREAM_CORNERS, index, p);
    for (size_t i = 0; i < n; i++) {
        const uint64_t end =
            f->all_corners ? index >> i & 1 : sdm_rng_below(f->seed, STREAM_ENDS, index * n + i, 2);
        if (f->all_corners || f->distribution[i].kind == SDM_DISTRIBUTION_UNIFORM)
            p[i] = end ? f->max[i] : f->min[i];
    }
}
