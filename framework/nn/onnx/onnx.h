/* A network as a graph of ONNX operators (opset 13), and its file. A kind of network appends
   tensors (its weights) and nodes (operators); the file is written at the end, weights piece by
   piece.

   Values of the graph are numbers. Batches: a value may have the dimension N, the number of maps,
   which is only known when the graph runs. Running out of memory is reported by
   sdm_onnx_write(); before, functions return values that do no harm. */
#pragma once

#include "protobuf.h"
#include "sdm/status.h"

typedef struct sdm_onnx sdm_onnx;

/* A value: the result of a node, a tensor, or the input. */
typedef uint32_t sdm_onnx_value;

enum { SDM_ONNX_MAX_DIMS = 5 };

/* Types of elements, as in onnx.proto. */
typedef enum sdm_onnx_type {
    SDM_ONNX_FLOAT = 1,
    SDM_ONNX_INT32 = 6,
    SDM_ONNX_INT64 = 7
} sdm_onnx_type;

/* *out = an empty graph with the input `params`[N][n_params], whose value is *input; free it with
   sdm_onnx_free(). SDM_E_NOMEM. */
sdm_status sdm_onnx_create(size_t n_params, sdm_onnx **out, sdm_onnx_value *input, sdm_error *err);
void sdm_onnx_free(sdm_onnx *g);

/* Memory that lives as long as the graph, count * size bytes, zeroed. NULL: none is left. */
void *sdm_onnx_memory(sdm_onnx *g, size_t count, size_t size);

/* Writes to[product of dims[1], dims[2] ...] = the elements of a tensor with index `item` in
   dims[0]. */
typedef void (*sdm_onnx_fill)(const void *user, size_t item, float *to);

/* A tensor of floats dims[n_dims], n_dims <= SDM_ONNX_MAX_DIMS, which `fill` computes when the file
   is written; `user` must live as long as the graph. `what` describes it for readers of the file.
 */
sdm_onnx_value sdm_onnx_weights(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                                sdm_onnx_fill fill, const void *user);

/* A layer of a network: `user` of the function that fills the matrix of sdm_onnx_layer_weights().
 */
typedef struct sdm_onnx_layer {
    const void *network;
    size_t layer;
} sdm_onnx_layer;

/* The matrix [rows][columns] of a layer; the network must live as long as the graph. */
sdm_onnx_value sdm_onnx_layer_weights(sdm_onnx *g, size_t rows, size_t columns, sdm_onnx_fill fill,
                                      const void *network, size_t layer);

/* Tensors with given elements, which must live as long as the graph: floats, 32-bit integers, and a
   copied list of n 64-bit integers. */
sdm_onnx_value sdm_onnx_floats(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                               const float *values);
sdm_onnx_value sdm_onnx_indices(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                                const int32_t *values);
sdm_onnx_value sdm_onnx_list(sdm_onnx *g, size_t n, const int64_t *values);

/* A tensor with one float. */
sdm_onnx_value sdm_onnx_scalar(sdm_onnx *g, double value);

/* Set an attribute of the node that is appended next. */
void sdm_onnx_set_int(sdm_onnx *g, const char *name, int64_t v);
void sdm_onnx_set_float(sdm_onnx *g, const char *name, double v);
void sdm_onnx_set_ints(sdm_onnx *g, const char *name, size_t n, const int64_t *v);

/* Adds a node of the ONNX operator `op`, for example "MatMul", with inputs[n] to the graph; returns
   the output of the node. */
sdm_onnx_value sdm_onnx_node(sdm_onnx *g, const char *op, size_t n, const sdm_onnx_value *inputs);

/* The same for one, two and three inputs. */
sdm_onnx_value sdm_onnx_node1(sdm_onnx *g, const char *op, sdm_onnx_value a);
sdm_onnx_value sdm_onnx_node2(sdm_onnx *g, const char *op, sdm_onnx_value a, sdm_onnx_value b);
sdm_onnx_value sdm_onnx_node3(sdm_onnx *g, const char *op, sdm_onnx_value a, sdm_onnx_value b,
                              sdm_onnx_value c);

/* Common nodes: the elements of `from` with the indices `index` along `axis`; `from` with other
   dimensions dims[n] (-1: what remains); f(from), f: `kind` of sdm_activate(). */
sdm_onnx_value sdm_onnx_gather(sdm_onnx *g, sdm_onnx_value from, sdm_onnx_value index, int axis);
sdm_onnx_value sdm_onnx_reshape(sdm_onnx *g, sdm_onnx_value from, size_t n, const int64_t *dims);
sdm_onnx_value sdm_onnx_activate(sdm_onnx *g, int kind, sdm_onnx_value from);

/* a + b, a - b, a * b, and the product of matrices. */
sdm_onnx_value sdm_onnx_add(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b);
sdm_onnx_value sdm_onnx_sub(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b);
sdm_onnx_value sdm_onnx_mul(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b);
sdm_onnx_value sdm_onnx_product(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b);

/* A value with elements of another type. */
sdm_onnx_value sdm_onnx_cast(sdm_onnx *g, sdm_onnx_value v, sdm_onnx_type to);

/* A tensor of floats from values that are copied. */
sdm_onnx_value sdm_onnx_constant(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                                 const double *values);

/* Along one axis (negative: counted from the last): the elements index[n], which are copied; the
   elements first .. end - 1; the sum, and the extreme (op: ReduceMin or ReduceMax), which keep the
   axis. Values joined along an axis; a value with its n axes in the order axes[n]. */
sdm_onnx_value sdm_onnx_pick(sdm_onnx *g, sdm_onnx_value from, int axis, size_t n,
                             const int32_t *index);
sdm_onnx_value sdm_onnx_slice(sdm_onnx *g, sdm_onnx_value from, int64_t axis, int64_t first,
                              int64_t end);
sdm_onnx_value sdm_onnx_sum(sdm_onnx *g, sdm_onnx_value from, int64_t axis);
sdm_onnx_value sdm_onnx_extreme(sdm_onnx *g, const char *op, sdm_onnx_value from, int64_t axis);
sdm_onnx_value sdm_onnx_join(sdm_onnx *g, int axis, size_t n, const sdm_onnx_value *parts);
sdm_onnx_value sdm_onnx_transpose(sdm_onnx *g, sdm_onnx_value from, size_t n, const int64_t *axes);

/* phi[n_terms][N] = products of normalised Legendre polynomials of x[n_params][N];
   exponents[n_terms][n_params] <= degree, degree <= 16, as from sdm_poly_table(). */
sdm_onnx_value sdm_onnx_polynomials(sdm_onnx *g, sdm_onnx_value x, const uint8_t *exponents,
                                    size_t n_terms, size_t n_params, size_t degree);

/* A loop over the first dimension of `over`: the nodes between the two calls belong to its body and
   may use all values of the graph. sdm_onnx_loop_begin() returns the current slice of `over`, which
   has the dimensions dims[n_dims]. sdm_onnx_loop_end() returns the slices `result` of all rounds,
   joined along the new dimension `axis`; a slice has the dimensions dims[n_dims], 0 for N. Loops
   are not nested. */
sdm_onnx_value sdm_onnx_loop_begin(sdm_onnx *g, sdm_onnx_value over, size_t n_dims,
                                   const size_t *dims);
sdm_onnx_value sdm_onnx_loop_end(sdm_onnx *g, sdm_onnx_value result, size_t n_dims,
                                 const size_t *dims, int axis);

/* Adds a line of metadata. */
void sdm_onnx_metadata(sdm_onnx *g, const char *key, const char *value);

/* Writes the file, with the output `sdm`[N][dims[3]] = `result`. SDM_E_UNSUPPORTED: it would have
   more than 2^31 - 1 bytes, the limit of Protocol Buffers; SDM_E_NOMEM, SDM_E_IO. */
sdm_status sdm_onnx_write(sdm_onnx *g, const char *path, sdm_onnx_value result,
                          const size_t dims[3], sdm_error *err);
