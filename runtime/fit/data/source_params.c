/* Ranges, names and distributions of the parameters of a source. */
#include "source_params.h"

void sdm_fit_bounds(const sdm_fit_source *source, size_t k, double *low, double *high,
                    const char **name)
{
    if (source->model && source->policy != SDM_RANGE_EXACT) {
        const sdm_model_param *p = &sdm_model_get_info(source->model)->params[k];
        *low = p->min, *high = p->max, *name = p->name;
    } else {
        size_t n;
        const sdm_param *p = &sdm_instance_params(source->shape, &n)[k];
        *low = p->min, *high = p->max, *name = p->name;
    }
}

sdm_distribution sdm_fit_distribution(const sdm_fit_source *source, size_t k)
{
    return source->model ? sdm_model_get_info(source->model)->params[k].distribution
                         : sdm_instance_distributions(source->shape)[k];
}
