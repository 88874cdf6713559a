/* Measures of a shape: those of the plug-in, then volume, area and extents from the mesh. */
#include <math.h>
#include <string.h>

#include "sdm/internal/mesh_measures.h"
#include "sdm/internal/part_audit.h"
#include "shape_internal.h"

static sdm_status add_measure(const sdm_measure *m, double depth, double value, sdm_measures *out,
                              sdm_error *err)
{
    if (out->n == SDM_MEASURES_MAX)
        return sdm_fail(err, SDM_E_ARG, "more than %d measures: take fewer depths",
                        SDM_MEASURES_MAX);
    out->at[out->n++] = (sdm_measured){.name = m->name,
                                       .unit = m->unit,
                                       .help = m->help,
                                       .depth = depth,
                                       .value = value,
                                       .sd = NAN};
    return SDM_OK;
}

/* Calls the plug-in for measures[index]. */
static sdm_status measure_call(const sdm_instance *s, const double *p, uint32_t index, double depth,
                               double *value, sdm_error *err)
{
    const sdm_measure *m = &s->shape->measures[index];
    host_call call;
    sdm_host_call_begin(&call, NULL, false);
    sdm_callback_begin(s, "measure", p);
    const int failed = s->shape->measure(s->self, &call.host, s->options, p, index,
                                         m->of_depth ? depth : 0, value);
    sdm_callback_end();
    sdm_status status = SDM_OK;
    if (failed)
        status = sdm_host_call_failed(&call, "measure", failed, SDM_E_PLUGIN, err);
    else if (isinf(*value) || (isnan(*value) && !m->of_depth))
        status = sdm_fail(err, SDM_E_PLUGIN, "measure() gives a number that is not finite");
    sdm_host_call_end(&call);
    if (!status) return SDM_OK;
    sdm_fail_in(err, status, "measure '%s'", m->name);
    return sdm_instance_fail_at(s, p, status, err);
}

static sdm_status add_own(const sdm_instance *s, const double *p, const double *depths,
                          size_t n_depths, sdm_measures *out, sdm_error *err)
{
    sdm_status status = SDM_OK;
    for (uint32_t i = 0; i < s->shape->n_measures; i++) {
        const sdm_measure *m = &s->shape->measures[i];
        const size_t n = m->of_depth ? n_depths : 1;
        for (size_t k = 0; k < n && !status; k++) {
            const double depth = m->of_depth ? depths[k] : NAN;
            double value = NAN;
            if (p) status = measure_call(s, p, i, depth, &value, err);
            if (!status) status = add_measure(m, depth, value, out, err);
        }
    }
    return status;
}

static sdm_status add_those_of_mesh(const sdm_instance *s, const double *p, sdm_measures *out,
                                    sdm_error *err)
{
    double value[SDM_MESH_MEASURES] = {NAN, NAN, NAN, NAN, NAN};
    sdm_status status = SDM_OK;
    if (p) {
        sdm_mesh mesh = {0};
        sdm_part_audit audit = {0};
        status = sdm_instance_mesh(s, p, &mesh, err);
        if (!status && (status = sdm_part_audit_make(&mesh, SDM_AUDIT_WALLS | SDM_AUDIT_UNION, NULL,
                                                     &audit, err)))
            sdm_instance_fail_at(s, p, status, err);
        value[0] = audit.union_volume;
        value[1] = audit.mesh.closed ? audit.union_area : audit.mesh.area;
        for (int d = 0; d < 3; d++) value[2 + d] = audit.mesh.max[d] - audit.mesh.min[d];
        sdm_part_audit_dispose(&audit);
        sdm_mesh_dispose(&mesh);
    }
    for (int i = 0; i < SDM_MESH_MEASURES && !status; i++)
        status = add_measure(&sdm_mesh_measures[i], NAN, value[i], out, err);
    return status;
}

static sdm_status check_depths(const sdm_instance *s, const double *depths, size_t n,
                               sdm_error *err)
{
    bool of_depth = false;
    for (uint32_t i = 0; i < s->shape->n_measures; i++)
        of_depth = of_depth || s->shape->measures[i].of_depth;
    if (n && !of_depth)
        return sdm_fail(err, SDM_E_ARG, "shape '%s' has no measure of a depth", s->shape->name);
    for (size_t k = 0; k < n; k++)
        if (!(depths[k] >= 0 && isfinite(depths[k])))
            return sdm_fail(err, SDM_E_ARG, "depth %g mm: need 0 or more", depths[k]);
    return SDM_OK;
}

sdm_status sdm_shape_measure_own(const sdm_instance *s, const double *p, const double *depths,
                                 size_t n_depths, sdm_measures *out, sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "a place for the measures is needed");
    out->n = 0;
    if (!s || (n_depths && !depths))
        return sdm_fail(err, SDM_E_ARG, "an instance to measure, and its depths, are needed");
    sdm_status status = p ? sdm_instance_check(s, p, err) : SDM_OK;
    if (!status) status = check_depths(s, depths, n_depths, err);
    if (!status) status = add_own(s, p, depths, n_depths, out, err);
    if (status) out->n = 0;
    return status;
}

sdm_status sdm_shape_measure(const sdm_instance *s, const double *p, const double *depths,
                             size_t n_depths, sdm_measures *out, sdm_error *err)
{
    sdm_status status = sdm_shape_measure_own(s, p, depths, n_depths, out, err);
    if (status) return status;
    status = add_those_of_mesh(s, p, out, err);
    if (status) out->n = 0;
    return status;
}

const sdm_measured *sdm_measures_find(const sdm_measures *m, const char *name)
{
    for (size_t i = 0; i < m->n; i++)
        if (!strcmp(m->at[i].name, name)) return &m->at[i];
    return NULL;
}
