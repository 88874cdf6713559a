/* The open end of an instance, as the shape states it, checked. */
#include "sdm/internal/open_end.h"

#include <math.h>

#include "shape_internal.h"

bool sdm_instance_has_open_end(const sdm_instance *s) { return s->shape->open_end != NULL; }

static sdm_status end_check(sdm_open_end *e, sdm_error *err)
{
    double length = 0;
    bool finite = isfinite(e->radius);
    for (int k = 0; k < 3; k++) {
        finite = finite && isfinite(e->centre[k]) && isfinite(e->outward[k]);
        length += e->outward[k] * e->outward[k];
    }
    length = sqrt(length);
    if (!finite) return sdm_fail(err, SDM_E_PLUGIN, "open_end() gives a number that is not finite");
    if (!(length > 0) || !(e->radius > 0))
        return sdm_fail(err, SDM_E_PLUGIN,
                        "open_end() gives a normal of length %g and a radius of %g mm: both must "
                        "be above 0",
                        length, e->radius);
    for (int k = 0; k < 3; k++) e->outward[k] /= length;
    return SDM_OK;
}

sdm_status sdm_instance_open_end(const sdm_instance *s, const double *p, sdm_open_end *out,
                                 sdm_error *err)
{
    if (!s->shape->open_end)
        return sdm_fail(err, SDM_E_ARG, "shape '%s' states no open end", s->shape->name);
    host_call call;
    sdm_host_call_begin(&call, NULL, false);
    sdm_callback_begin(s, "open_end", p);
    *out = (sdm_open_end){.radius = NAN};
    const int failed = s->shape->open_end(s->self, &call.host, s->options, p, out);
    sdm_callback_end();
    const sdm_status status =
        failed ? sdm_host_call_failed(&call, "open_end", failed, SDM_E_PLUGIN, err)
               : end_check(out, err);
    sdm_host_call_end(&call);
    return status ? sdm_instance_fail_at(s, p, status, err) : SDM_OK;
}
