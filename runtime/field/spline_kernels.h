/* The inner loops of splines, compiled for several instruction sets. All give the same bits: a sum
   of four products is (w0 c0 + w1 c1) + (w2 c2 + w3 c3) along x, then along y, then along z,
   without fused multiply-adds. Internal to the room `field`. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "spline_place.h"

/* A block of 8 x 8 x 8 positions of a grid. */
typedef struct spline_block {
    const float *rows;           /* interpolated along x: the eight positions of the first row */
    size_t line, plane;          /* distances of rows of coefficients along y and z, in floats */
    int32_t first[2];            /* y and z: the coefficients of the first row */
    const int32_t *cell[2];      /* [8] y and z: the first of the four coefficients */
    const float (*weight[2])[4]; /* [8] */
} spline_block;

/* A row of voxels of a turned grid, and the map. Voxel i has the world coordinates
   ((origin + along i) + across) + up, in this order of sums, and the index of sdm_spline_index()
   in the map of n voxels. */
typedef struct spline_line {
    double origin[3], along[3], across[3], up[3];
    spline_frame frame;
    int64_t n[3];
    size_t step[3]; /* of the coefficients */
} spline_line;

/* Places of neighbouring voxels of a row. */
enum { SPLINE_RUN = 64 };
typedef struct spline_run {
    size_t at[SPLINE_RUN]; /* the first of the 4 x 4 x 4 coefficients */
    float weight[3][SPLINE_RUN][4];
    /* 1: the voxel lies at a voxel of the map or outside of the box, which its value does not
       show; else 0 */
    int32_t apart[SPLINE_RUN];
} spline_run;

/* What spline_table.cut finds. */
enum { SPLINE_BETWEEN, SPLINE_ALL_LOW, SPLINE_ALL_HIGH };

/* Rows or planes of a window of coefficients. */
enum { SPLINE_WINDOW = 5 };

/* The rows that spline_table.fit_rows takes at once. */
enum { SPLINE_LINES = 32 };

typedef struct spline_table {
    /* Solves the systems of sdm_spline_fit() for `width` lines, neighbours in memory, whose n > 2
       elements are `step` floats apart. factor[n]: of the elimination. */
    void (*solve)(float *c, size_t n, size_t step, size_t width, const float *factor);
    /* The same for SPLINE_LINES rows of n > 2 values, `from` floats apart; the solution goes to c,
       rows `to` floats apart. memory[n][SPLINE_LINES], 64-byte aligned. */
    void (*fit_rows)(const float *values, size_t n, size_t from, const float *factor, float *c,
                     size_t to, float *memory);
    /* out[i] = sum over k of weight[i][k] row[cell[i] + k], i < n. */
    void (*expand)(size_t n, const int32_t *cell, const float (*weight)[4], const float *row,
                   float *out);
    /* out[i] = sum over k of weight[k] row[k][i], i < n. */
    void (*combine)(size_t n, const float *const row[4], const float weight[4], float *out);
    /* out[8][8][8] = the values of a block. */
    void (*block)(const spline_block *b, float *out);
    /* Of the five rows or planes of a window, for i < n: the largest abs(plane[k][i + step] -
       plane[k][i]); the largest abs(plane[k + 1][i] - plane[k][i]); the largest plane[k][i]. */
    void (*differences)(const float *const plane[SPLINE_WINDOW], size_t n, size_t step,
                        float *most);
    void (*steps)(const float *const plane[SPLINE_WINDOW], size_t n, float *most);
    void (*largest)(const float *const plane[SPLINE_WINDOW], size_t n, float *most);
    /* low[i] and high[i] become the smallest and the largest of these and plane[k][i]. */
    void (*extremes)(const float *const plane[SPLINE_WINDOW], size_t n, float *low, float *high);
    /* values[512] are cut off at -width and width. Returns SPLINE_ALL_LOW if all were <= -width,
       SPLINE_ALL_HIGH if all were >= width, else SPLINE_BETWEEN. */
    int (*cut)(float width, float *values);
    /* The spline at one point. c: the first of its 4 x 4 x 4 coefficients, rows `line` and planes
       `plane` floats apart; weight[3][4] along x, y, z. */
    float (*value)(const float *c, size_t line, size_t plane, const float (*weight)[4]);
    /* The places of voxels first .. first + n - 1 of a row, n <= SPLINE_RUN: those of
       sdm_spline_place(). */
    void (*places)(const spline_line *line, size_t first, size_t n, spline_run *run);
    /* out[i] = value() at place i < n, with coefficients c. */
    void (*run)(const float *c, const size_t step[3], size_t n, const spline_run *run, float *out);
    /* gradient[3] = its derivatives by the index; slope[3][4]: derivatives of the weights. */
    void (*gradient)(const float *c, size_t line, size_t plane, const float (*weight)[4],
                     const float (*slope)[4], float gradient[3]);
} spline_table;

extern const spline_table sdm_spline_generic, sdm_spline_avx2, sdm_spline_avx512;

/* The table for this processor. */
const spline_table *sdm_spline_kernels(void);
