/* The matrix product of floats, compiled once for each instruction set. Before inclusion, define VW
   (floats in a register) and MR (rows of the register tile, a multiple of 3).

   Panels of NR columns of b, KC rows at a time, are copied into the second-level cache and then
   multiplied by all rows of a, MR at a time. a is read where it lies: the tile takes one element at
   a time, and neighbours in memory follow soon along the rows or the columns. For a few rows of a,
   b is not copied either if its rows lie in one piece. */
#pragma once

#include <string.h>

#include "kernels_table.h"
#include "kernels_vector.h"

#define NV 2 /* registers along a row of the register tile */
#define NR (NV * VW)

/* Rows of b in a panel; rows of a for which a copy of b does not pay. */
enum { KC = 256, FEW_ROWS = 64 };

/* One tile: c[MR][ldc] = a * b, or += with `add`; element (i, p) of a is a[i * row + p * col],
   row p of b is b[p * ldb]. */
static inline void product_tile(size_t k, const float *a, size_t row, size_t col, const float *b,
                                size_t ldb, bool add, float *c, size_t ldc)
{
    vec acc[MR][NV];
    const float *at[MR / 3]; // every third row: the two rows after it are offsets of an address
    for (int i = 0; i < MR / 3; i++) at[i] = a + (size_t)(3 * i) * row;
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < NV; j++)
            acc[i][j] = add ? load(c + (size_t)i * ldc + j * VW) : (vec){0};
    for (size_t p = 0; p < k; p++, b += ldb) {
        vec columns[NV];
        for (int j = 0; j < NV; j++) columns[j] = load(b + j * VW);
        for (int i = 0; i < MR; i++) {
            const vec s = splat(at[i / 3][(size_t)(i % 3) * row]);
            for (int j = 0; j < NV; j++) acc[i][j] = FMA(s, columns[j], acc[i][j]);
        }
        for (int i = 0; i < MR / 3; i++) at[i] += col;
    }
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < NV; j++) store(c + (size_t)i * ldc + j * VW, acc[i][j]);
}

/* packed[k][NR] = n <= NR columns of b, the rest filled with zeros. */
static void product_pack(size_t k, size_t n, sdm_view b, float *packed)
{
    if (n < NR) {
        memset(packed, 0, k * NR * sizeof *packed);
        for (size_t p = 0; p < k; p++)
            for (size_t j = 0; j < n; j++) packed[p * NR + j] = b.data[p * b.row + j * b.col];
    } else if (b.col == 1) {
        for (size_t p = 0; p < k; p++)
            memcpy(packed + p * NR, b.data + p * b.row, NR * sizeof *packed);
    } else {
        for (size_t p = 0; p < k; p++)
            for (size_t j = 0; j < NR; j++) packed[p * NR + j] = b.data[p * b.row + j * b.col];
    }
}

/* A tile that reaches beyond the m rows or n columns of c is computed as a whole tile in `edge`;
   the missing rows of a are zeros. */
static void product_edge(size_t m, size_t n, size_t k, sdm_view a, const float *b, size_t ldb,
                         bool add, float *c, size_t ldc)
{
    float rows[KC * MR], edge[MR * NR] = {0};
    if (m < MR) {
        memset(rows, 0, k * MR * sizeof *rows);
        for (size_t p = 0; p < k; p++)
            for (size_t i = 0; i < m; i++) rows[p * MR + i] = a.data[i * a.row + p * a.col];
        a = (sdm_view){rows, 1, MR};
    }
    if (add)
        for (size_t i = 0; i < m; i++) memcpy(edge + i * NR, c + i * ldc, n * sizeof *c);
    product_tile(k, a.data, a.row, a.col, b, ldb, add, edge, NR);
    for (size_t i = 0; i < m; i++) memcpy(c + i * ldc, edge + i * NR, n * sizeof *c);
}

/* c[m][ldc] = a * b, or += with `add`; c has n columns. */
static void product(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c,
                    size_t ldc)
{
    _Alignas(64) float packed[KC * NR];
    for (size_t k0 = 0; k0 < k || k0 == 0; k0 += KC, add = true) {
        const size_t kc = k - k0 < KC ? k - k0 : KC;
        for (size_t j = 0; j < n; j += NR) {
            const size_t nj = n - j < NR ? n - j : NR;
            const sdm_view bj = {b.data + k0 * b.row + j * b.col, b.row, b.col};
            const bool in_place = b.col == 1 && nj == NR && m <= FEW_ROWS;
            const float *panel = in_place ? bj.data : packed;
            const size_t ldb = in_place ? b.row : NR;
            if (!in_place) product_pack(kc, nj, bj, packed);
            for (size_t i = 0; i < m; i += MR) {
                const size_t mi = m - i < MR ? m - i : MR;
                const sdm_view ai = {a.data + i * a.row + k0 * a.col, a.row, a.col};
                float *to = c + i * ldc + j;
                if (mi == MR && nj == NR)
                    product_tile(kc, ai.data, ai.row, ai.col, panel, ldb, add, to, ldc);
                else
                    product_edge(mi, nj, kc, ai, panel, ldb, add, to, ldc);
            }
        }
    }
}
