/* The opened `template` network and the functions between the files of this folder.

   Words in addition to sdm/internal/template.h
     pose         frames and warp amplitudes of all parts for one parameter vector
     control      the control displacements of one warp: the sum of its modes
     carried      for a voxel x, the point y of the template with T(y + U(y)) = x
     metric       B B^T with B = d y / d x: |grad_x d0(y(x))|^2 = g^T B B^T g
     station      a voxel index at which y and the metric are computed exactly: every fourth voxel
                  along each axis, from one step before the grid to one after it; between stations y
                  follows cubic B-splines, the metric is linear
     index        a point in units of the lattice `near`, from its first node */
#pragma once

#include "model/model_kind.h"
#include "sdm/internal/template.h"
#include "template_kernels.h"

/* Voxels between two stations, and the edge of a block of voxels. */
enum { SDM_TEMPLATE_STEP = 4 };

typedef struct template_network {
    size_t n_parts, n_numbers, n_terms, degree;
    uint8_t *exponents;      /* [F][P] */
    const double *functions; /* [N][F] */
    sdm_template_part parts[SDM_TEMPLATE_MAX_PARTS];
    template_level near[SDM_TEMPLATE_MAX_PARTS], far[SDM_TEMPLATE_MAX_PARTS];
    size_t stations[3]; /* number of stations along x, y, z */
    template_expansion expansion;
    sdm_model *correction; /* the network r; NULL: none */
    template_correction correction_lattice;
} template_network;

/* The kernels for this processor. */
const template_table *sdm_template_kernels(void);

/* template_pose.c: parameters to frames. */

/* A frame T: x = m y + b; inverse = m^-1. */
typedef struct part_pose {
    double m[9], b[3], inverse[9];
} part_pose;

/* Floats of scratch memory of sdm_template_numbers(). */
size_t sdm_template_numbers_scratch(const sdm_model *model);

/* g[N] = the numbers at the parameters p[P]; unless dg is NULL, dg[P][N] = their derivatives. */
void sdm_template_numbers(const sdm_model *model, const double *p, float *scratch, double *g,
                          double *dg);

/* pose[n_parts] = the frames for the numbers g[N]. */
void sdm_template_frames(const template_network *k, const double *g, part_pose *pose);

/* dm[n_parts][9], db[n_parts][3] = derivatives of m and b along dg[N]; pose belongs to g. */
void sdm_template_frames_slope(const template_network *k, const double *g, const double *dg,
                               const part_pose *pose, double (*dm)[9], double (*db)[3]);

/* template_warp.c: warps and their inverse. */

/* control[nodes][4] = sum over the modes m of a[m] mode_m; the fourth element is 0. */
void sdm_template_control(const sdm_template_part *part, const double *a, float *control);

/* The transpose: a[M] = the adjoints of the amplitudes, from those of control[nodes][4], which is
   changed. */
void sdm_template_control_back(const sdm_template_part *part, float *control, double *a);

/* u[3] = the displacement of a warp with `control` at y[3]; unless NULL, du[9] = its derivative,
   row-major, and ddu[3][9]: ddu[c] = derivative of du by y[c]. Beyond the lattice the displacement
   is that of the nearest point of the lattice. */
void sdm_template_displacement(const sdm_lattice *l, const float *control, const double y[3],
                               double u[3], double *du, double (*ddu)[9]);

/* metric[6] = B B^T as xx, yy, zz, yz, xz, xy, for B = b[9]; slope[6] = its derivative when B has
   the derivative db[9]. */
void sdm_template_metric(const double b[9], float metric[6]);
void sdm_template_metric_slope(const double b[9], const double db[9], float slope[6]);

/* The transpose: adds to db[9] what follows from the adjoint slope[6]. */
void sdm_template_metric_slope_back(const double b[9], const double slope[6], double db[9]);

/* out[9] = derivative of the inverse of the frame's matrix m when m has the derivative dm[9]:
   -m^-1 dm m^-1. */
void sdm_template_inverse_slope(const part_pose *pose, const double dm[9], double out[9]);

/* Returns the warp of a part whose control displacements are control[nodes][4]. */
template_warp sdm_template_warp_of(const sdm_template_part *part, const float *control);

/* out[3] = the position of the station x, y, z of the lattice of stations in the world. */
void sdm_template_station_world(const sdm_grid *grid, size_t x, size_t y, size_t z, double out[3]);

/* Scratch memory of a warp for one map. */
typedef struct warp_scratch {
    float *control; /* [nodes][4] */
    /* [stations][4] carried points as indices; after sdm_template_prefilter() coefficients of the
       B-splines through them */
    float *points;
    float *metric; /* [stations][8] */
    template_samples sample;
    template_station *station; /* [stations]; NULL unless derivatives are wanted */
} warp_scratch;

/* Fills points and metric (and station) of w for a part in `pose`, with the control of w. */
void sdm_template_invert(const template_network *k, const sdm_template_part *part,
                         const part_pose *pose, const sdm_grid *grid, const warp_scratch *w);

/* Turns n samples of `width` functions into coefficients of the cubic B-splines that interpolate
   them, n >= 3; stride: floats from one sample to the next. At both ends the second derivative is
   zero. */
void sdm_template_spline(float *v, size_t n, size_t stride, size_t width);

/* Turns points[stations][4] into the coefficients of the cubic B-splines that interpolate them. */
void sdm_template_prefilter(const template_network *k, float *points);

/* Its transpose: turns adjoints of the coefficients into adjoints of the points. */
void sdm_template_prefilter_back(const template_network *k, float *points);

/* template_warp_slopes.c: derivatives of the inverse of a warp. */

/* A direction in which a part with a warp changes. */
typedef struct warp_motion {
    double inverse[9];    /* derivative of the inverse of the frame's matrix; */
    double shift[3];      /* inverse of the frame's matrix times the derivative of b */
    bool turns;           /* inverse is not 0 */
    const float *control; /* derivative of the warp's control displacements */
    /* output: the derivatives of points[stations][4] (not yet coefficients) and
       metric[stations][8] */
    float *points, *metric;
} warp_motion;

/* Fills points and metric of motion[n] for a part in `pose`, after sdm_template_invert(). */
void sdm_template_invert_slopes(const template_network *k, const sdm_template_part *part,
                                const part_pose *pose, const sdm_grid *grid, const warp_scratch *w,
                                size_t n, const warp_motion *motion);

/* Adjoints of the inputs of a part with a warp, see warp_motion. */
typedef struct warp_adjoint {
    double inverse[9], shift[3];
    float *control; /* [nodes][4] */
} warp_adjoint;

/* The transpose of sdm_template_invert_slopes(): adds to *adjoint what follows from the adjoints
   points[stations][4] (of the points, not of coefficients) and metric[stations][8]. */
void sdm_template_invert_back(const template_network *k, const sdm_template_part *part,
                              const part_pose *pose, const sdm_grid *grid, const warp_scratch *w,
                              const float *points, const float *metric, warp_adjoint *adjoint);

/* template_forward.c, template_slopes.c, template_reverse.c: entries of the function table
 * sdm_model_kind. */
size_t sdm_template_scratch_bytes(const sdm_model *m, size_t n, int n_threads);
void sdm_template_forward(const sdm_model *m, const double *params, size_t n, float *values,
                          void *scratch, int n_threads);
size_t sdm_template_jacobian_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_template_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                           void *scratch, int n_threads);
size_t sdm_template_jvp_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_template_jvp(const sdm_model *m, const double *params, const double *direction,
                      float *values, float *tangent, void *scratch, int n_threads);
size_t sdm_template_vjp_scratch_bytes(const sdm_model *m);
void sdm_template_vjp(const sdm_model *m, const double *params, const float *adjoint,
                      double *gradient, void *scratch);

/* template_onnx.c: entry of the function table. */
sdm_onnx_value sdm_template_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x);
