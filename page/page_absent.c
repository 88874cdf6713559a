/* A page reads and writes no files, asks for no products with transposed Jacobians, and its shape
 * is compared with its model before it is written. The functions of this file take the place of the
 * library's, which would make every page 30 kB larger. */
#include "model/model_kind.h"
#include "pod/pod_internal.h"
#include "point/point_internal.h"
#include "sdm/image.h"
#include "sdm/internal/model_mesh.h"
#include "sdm/internal/ssm.h"
#include "sdm/meshfile.h"
#include "sdmnn/sdmnn_model.h"
#include "template/template_internal.h"

static sdm_status no_files(const char *path, sdm_error *err)
{
    return sdm_fail(err, SDM_E_IO, "%s: a page has no files", path);
}

sdm_status sdm_mesh_read(const char *path, sdm_mesh *out, sdm_error *err)
{
    (void)out;
    return no_files(path, err);
}

sdm_status sdm_npy_read(const char *path, double **read, size_t size[4], int *n_dim, sdm_error *err)
{
    (void)read, (void)size, (void)n_dim;
    return no_files(path, err);
}

sdm_status sdm_ssm_parse(const char *path, const uint8_t *bytes, size_t size, sdm_ssm *out,
                         sdm_error *err)
{
    (void)bytes, (void)size, (void)out;
    return no_files(path, err);
}

void sdm_ssm_dispose(sdm_ssm *model) { (void)model; }

sdm_onnx_value sdm_point_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x)
{
    (void)m, (void)g;
    return x;
}

sdm_onnx_value sdm_pod_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x)
{
    return sdm_point_onnx(m, g, x);
}

sdm_onnx_value sdm_sdmnn_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x)
{
    return sdm_point_onnx(m, g, x);
}

sdm_onnx_value sdm_template_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x)
{
    return sdm_point_onnx(m, g, x);
}

void sdm_pod_decode_back(const pod_network *k, const sdm_grid *grid, const float *adjoint,
                         const pod_scratch *w, float *dz)
{
    (void)k, (void)grid, (void)adjoint, (void)w, (void)dz;
}

size_t sdm_template_vjp_scratch_bytes(const sdm_model *m)
{
    (void)m;
    return 0;
}

void sdm_template_vjp(const sdm_model *m, const double *params, const float *adjoint,
                      double *gradient, void *scratch)
{
    (void)m, (void)params, (void)adjoint, (void)gradient, (void)scratch;
}

sdm_status sdm_model_mesh_check(const sdm_model_info *info, const sdm_instance *shape,
                                sdm_error *err)
{
    (void)info, (void)shape, (void)err;
    return SDM_OK;
}
