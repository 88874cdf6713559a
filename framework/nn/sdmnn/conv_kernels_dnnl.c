/* Convolution by oneDNN 2.x where it is faster than the native convolution: 3 x 3 x 3 with many
   channels on the smaller levels, in the forward pass and in the backward pass to the inputs. The
   gradient by the weights is always native, and so is a convolution for which oneDNN reports an
   error. Each call reorders maps and weights to the layout of oneDNN, and the result back. */
#include <oneapi/dnnl/dnnl.h>
#include <pthread.h>
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "conv.h"

static dnnl_engine_t engine;
static dnnl_stream_t stream;
static pthread_once_t once = PTHREAD_ONCE_INIT;

// creates `engine` and `stream`, called once; they are NULL if oneDNN fails
static void engine_start(void)
{
    if (dnnl_engine_create(&engine, dnnl_cpu, 0) != dnnl_success) engine = NULL;
    if (engine && dnnl_stream_create(&stream, engine, dnnl_stream_default_flags) != dnnl_success)
        stream = NULL;
}

// Measured on AVX2: with fewer than 16 channels or on large maps the reordering costs more than
// oneDNN saves.
static bool onednn_pays(const sdm_fmap *g, sdm_conv c)
{
    return c.taps == 27 && c.in % 16 == 0 && c.out % 16 == 0 &&
           g->n[0] * g->n[1] * g->n[2] <= 32768;
}

// Number of floats of the packed weights: first the result of sdm_conv_pack(), for native calls,
// then the same weights as [outputs][inputs][taps] for oneDNN, transposed for the backward pass.
static size_t packed_count(sdm_conv c)
{
    return (sdm_conv_packed_count(c) + 15) / 16 * 16 + c.in * c.out * c.taps;
}

static void weights_pack(sdm_conv c, bool transposed, const float *w, float *packed)
{
    const sdm_conv to = transposed ? sdm_conv_opposite(c) : c;
    sdm_conv_pack(c, transposed, w, packed);
    packed += (sdm_conv_packed_count(to) + 15) / 16 * 16;
    if (!transposed) memcpy(packed, w, c.in * c.out * c.taps * sizeof *w);
    for (size_t o = 0; o < to.out && transposed; o++)
        for (size_t i = 0; i < to.in; i++)
            for (size_t t = 0; t < c.taps; t++)
                *packed++ = w[(i * c.in + o) * c.taps + c.taps - 1 - t];
}

// oneDNN objects of one call; call_destroy() destroys them after success and after an error.
typedef struct call {
    dnnl_primitive_desc_t plan;
    dnnl_primitive_t convolution;
    // source, weights, result: in our layout, and in the layout that oneDNN chooses
    dnnl_memory_t user[3], own[3];
} call;

static void call_destroy(call *k)
{
    for (int i = 0; i < 3; i++) {
        if (k->own[i]) dnnl_memory_destroy(k->own[i]);
        if (k->user[i]) dnnl_memory_destroy(k->user[i]);
    }
    if (k->convolution) dnnl_primitive_destroy(k->convolution);
    if (k->plan) dnnl_primitive_desc_destroy(k->plan);
}

static dnnl_status_t reorder(const dnnl_memory_desc_t *from_desc, dnnl_memory_t from,
                             const dnnl_memory_desc_t *to_desc, dnnl_memory_t to)
{
    dnnl_primitive_desc_t plan = NULL;
    dnnl_primitive_t p = NULL;
    const dnnl_exec_arg_t args[2] = {{DNNL_ARG_FROM, from}, {DNNL_ARG_TO, to}};
    dnnl_status_t s =
        dnnl_reorder_primitive_desc_create(&plan, from_desc, engine, to_desc, engine, NULL);
    if (!s) s = dnnl_primitive_create(&p, plan);
    if (!s) s = dnnl_primitive_execute(p, stream, 2, args);
    if (p) dnnl_primitive_destroy(p);
    if (plan) dnnl_primitive_desc_destroy(plan);
    return s;
}

// y[O] = w * x[I] by oneDNN
static dnnl_status_t convolve(const sdm_fmap *g, sdm_conv c, const float *w, const float *x,
                              float *y, call *k)
{
    const dnnl_dim_t in = (dnnl_dim_t)c.in, out = (dnnl_dim_t)c.out;
    const dnnl_dim_t nx = (dnnl_dim_t)g->n[0], ny = (dnnl_dim_t)g->n[1], nz = (dnnl_dim_t)g->n[2];
    const dnnl_dims_t dims[3] = {{1, in, nz, ny, nx}, {out, in, 3, 3, 3}, {1, out, nz, ny, nx}},
                      ones = {1, 1, 1};
    const dnnl_dims_t strides = {(dnnl_dim_t)(g->stride * (c.in + c.out)), (dnnl_dim_t)g->stride,
                                 (dnnl_dim_t)g->plane, (dnnl_dim_t)g->row, 1};
    union {
        const float *in;
        void *any;
    } source = {x}, weights = {w};
    void *const data[3] = {source.any, weights.any, y};

    // memory in our layout, and descriptors with a layout of oneDNN's choice
    dnnl_memory_desc_t here[3], any[3];
    dnnl_status_t s = dnnl_success;
    for (int i = 0; i < 3 && !s; i++) {
        s = i == 1 ? dnnl_memory_desc_init_by_tag(&here[i], 5, dims[i], dnnl_f32, dnnl_oidhw)
                   : dnnl_memory_desc_init_by_strides(&here[i], 5, dims[i], dnnl_f32, strides);
        if (!s)
            s = dnnl_memory_desc_init_by_tag(&any[i], 5, dims[i], dnnl_f32, dnnl_format_tag_any);
        if (!s) s = dnnl_memory_create(&k->user[i], &here[i], engine, data[i]);
    }

    // the convolution
    dnnl_convolution_desc_t d;
    if (!s)
        s = dnnl_convolution_forward_desc_init(&d, dnnl_forward_inference, dnnl_convolution_direct,
                                               &any[0], &any[1], NULL, &any[2], ones, ones, ones);
    if (!s) s = dnnl_primitive_desc_create(&k->plan, &d, NULL, engine, NULL);
    if (!s) s = dnnl_primitive_create(&k->convolution, k->plan);
    if (s) return s;

    // memory in oneDNN's layout, inputs reordered
    static const dnnl_query_t what[3] = {dnnl_query_src_md, dnnl_query_weights_md,
                                         dnnl_query_dst_md};
    const dnnl_memory_desc_t *wanted[3];
    for (int i = 0; i < 3 && !s; i++) {
        wanted[i] = dnnl_primitive_desc_query_md(k->plan, what[i], 0);
        s = dnnl_memory_create(&k->own[i], wanted[i], engine, DNNL_MEMORY_ALLOCATE);
        if (!s && i < 2) s = reorder(&here[i], k->user[i], wanted[i], k->own[i]);
    }
    const dnnl_exec_arg_t args[3] = {
        {DNNL_ARG_SRC, k->own[0]}, {DNNL_ARG_WEIGHTS, k->own[1]}, {DNNL_ARG_DST, k->own[2]}};
    if (!s) s = dnnl_primitive_execute(k->convolution, stream, 3, args);
    if (!s) s = reorder(wanted[2], k->own[2], &here[2], k->user[2]);
    return s ? s : dnnl_stream_wait(stream);
}

static void conv_apply(const sdm_fmap *g, sdm_conv c, const float *packed, const float *x,
                       sdm_conv_finish finish, float *y, int n_threads)
{
    pthread_once(&once, engine_start);
    dnnl_status_t s = dnnl_unimplemented;
    if (stream && onednn_pays(g, c)) {
        call k = {0};
#ifdef _OPENMP
        const int before = omp_get_max_threads(); // oneDNN uses the OpenMP default
        if (n_threads) omp_set_num_threads(n_threads);
#endif
        s = convolve(g, c, packed + (sdm_conv_packed_count(c) + 15) / 16 * 16, x, y, &k);
        call_destroy(&k);
#ifdef _OPENMP
        omp_set_num_threads(before);
#endif
    }
    if (s == dnnl_success)
        sdm_conv_finish_maps(g, c.out, finish, y, n_threads);
    else
        sdm_conv_apply(g, c, packed, x, finish, y, n_threads);
}

const sdm_conv_backend *sdm_conv_dnnl(void)
{
    static const sdm_conv_backend backend = {.name = "onednn",
                                             .packed_count = packed_count,
                                             .pack = weights_pack,
                                             .apply = conv_apply,
                                             .gradient = sdm_conv_gradient};
    return &backend;
}
