/* Operators with constant arguments, and the polynomials that several kinds of network use. */
#include <math.h>
#include <string.h>

#include "onnx.h"

sdm_onnx_value sdm_onnx_add(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b)
{
    return sdm_onnx_node2(g, "Add", a, b);
}

sdm_onnx_value sdm_onnx_sub(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b)
{
    return sdm_onnx_node2(g, "Sub", a, b);
}

sdm_onnx_value sdm_onnx_mul(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b)
{
    return sdm_onnx_node2(g, "Mul", a, b);
}

sdm_onnx_value sdm_onnx_product(sdm_onnx *g, sdm_onnx_value a, sdm_onnx_value b)
{
    return sdm_onnx_node2(g, "MatMul", a, b);
}

sdm_onnx_value sdm_onnx_cast(sdm_onnx *g, sdm_onnx_value v, sdm_onnx_type to)
{
    sdm_onnx_set_int(g, "to", to);
    return sdm_onnx_node1(g, "Cast", v);
}

sdm_onnx_value sdm_onnx_constant(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                                 const double *values)
{
    size_t n = 1;
    for (size_t i = 0; i < n_dims; i++) n *= dims[i];
    float *copy = sdm_onnx_memory(g, n, sizeof *copy);
    if (!copy) return 0;
    for (size_t i = 0; i < n; i++) copy[i] = (float)values[i];
    return sdm_onnx_floats(g, what, n_dims, dims, copy);
}

sdm_onnx_value sdm_onnx_pick(sdm_onnx *g, sdm_onnx_value from, int axis, size_t n,
                             const int32_t *index)
{
    int32_t *copy = sdm_onnx_memory(g, n, sizeof *copy);
    if (!copy) return 0;
    memcpy(copy, index, n * sizeof *copy);
    return sdm_onnx_gather(g, from, sdm_onnx_indices(g, "elements", 1, &n, copy), axis);
}

sdm_onnx_value sdm_onnx_slice(sdm_onnx *g, sdm_onnx_value from, int64_t axis, int64_t first,
                              int64_t end)
{
    const sdm_onnx_value inputs[] = {from, sdm_onnx_list(g, 1, &first), sdm_onnx_list(g, 1, &end),
                                     sdm_onnx_list(g, 1, &axis)};
    return sdm_onnx_node(g, "Slice", 4, inputs);
}

sdm_onnx_value sdm_onnx_join(sdm_onnx *g, int axis, size_t n, const sdm_onnx_value *parts)
{
    sdm_onnx_set_int(g, "axis", axis);
    return sdm_onnx_node(g, "Concat", n, parts);
}

sdm_onnx_value sdm_onnx_transpose(sdm_onnx *g, sdm_onnx_value from, size_t n, const int64_t *axes)
{
    sdm_onnx_set_ints(g, "perm", n, axes);
    return sdm_onnx_node1(g, "Transpose", from);
}

sdm_onnx_value sdm_onnx_sum(sdm_onnx *g, sdm_onnx_value from, int64_t axis)
{
    return sdm_onnx_node2(g, "ReduceSum", from, sdm_onnx_list(g, 1, &axis));
}

sdm_onnx_value sdm_onnx_extreme(sdm_onnx *g, const char *op, sdm_onnx_value from, int64_t axis)
{
    sdm_onnx_set_ints(g, "axes", 1, &axis);
    return sdm_onnx_node1(g, op, from);
}

// values[(degree + 1) * P][N]: the normalised Legendre polynomials of x[P][N], degree by degree
static sdm_onnx_value legendre(sdm_onnx *g, sdm_onnx_value x, size_t degree)
{
    // one = x - x + 1 has the dimensions of x
    sdm_onnx_value p[2] = {
        sdm_onnx_node2(g, "Add", sdm_onnx_node2(g, "Sub", x, x), sdm_onnx_scalar(g, 1)), x};
    sdm_onnx_value all[17];
    all[0] = p[0];
    for (size_t k = 1; k <= degree; k++) {
        const double dk = (double)k;
        all[k] = sdm_onnx_node2(g, "Mul", p[1], sdm_onnx_scalar(g, sqrt(2 * dk + 1)));
        if (k == degree) break;
        // (k + 1) P(k+1) = (2k + 1) x P(k) - k P(k-1)
        const sdm_onnx_value next =
            sdm_onnx_node2(g, "Sub",
                           sdm_onnx_node2(g, "Mul", sdm_onnx_node2(g, "Mul", x, p[1]),
                                          sdm_onnx_scalar(g, (2 * dk + 1) / (dk + 1))),
                           sdm_onnx_node2(g, "Mul", p[0], sdm_onnx_scalar(g, dk / (dk + 1))));
        p[0] = p[1], p[1] = next;
    }
    sdm_onnx_set_int(g, "axis", 0);
    return sdm_onnx_node(g, "Concat", degree + 1, all);
}

sdm_onnx_value sdm_onnx_polynomials(sdm_onnx *g, sdm_onnx_value x, const uint8_t *exponents,
                                    size_t n_terms, size_t n_params, size_t degree)
{
    // a product has as many factors as variables with a degree above 0
    const size_t most = n_params < degree ? n_params : degree, n_factors = most ? most : 1;
    const sdm_onnx_value values = legendre(g, x, degree);
    sdm_onnx_value phi = 0;
    for (size_t f = 0; f < n_factors; f++) {
        // row of the (f + 1)-th factor of each product; row 0 is the constant 1
        int32_t *row = sdm_onnx_memory(g, n_terms, sizeof *row);
        if (!row) return 0;
        for (size_t t = 0; t < n_terms; t++)
            for (size_t v = 0, seen = 0; v < n_params; v++)
                if (exponents[t * n_params + v] && seen++ == f)
                    row[t] = (int32_t)(exponents[t * n_params + v] * n_params + v);
        const sdm_onnx_value factor = sdm_onnx_gather(
            g, values, sdm_onnx_indices(g, "factors of the polynomials", 1, &n_terms, row), 0);
        phi = f ? sdm_onnx_mul(g, phi, factor) : factor;
    }
    return phi;
}
