/* Distances of many points: what the kernel, its driver and its scratch memory share.

   Points are sorted along a space-filling curve and cut into blocks. A block has 16 registers of
   eight points, one in each SIMD lane; they are searched as eight vectors of two registers, or half
   of them as eight vectors of one. Other terms are those of map/map.inc. */
#pragma once

#include "features/nearest.h"
#include "map/grid_scratch.h"
#include "point_order.h"

/* Vectors that are searched together, registers of a block, points of a block. */
enum { SDM_POINT_VECTORS = 8, SDM_POINT_REGISTERS = 16, SDM_POINT_BLOCK = 8 * SDM_POINT_REGISTERS };

/* Pairs of a vector and a cluster beyond which less time is taken by vectors of one register in
   place of two, and by a search for each point in place of vectors of one register. */
#define SDM_PAIRS_MAX 704

/* The points of the next block: x[3 * key[i].index], i < n, and their distances, or NULL. */
typedef struct sdm_points_next {
    const sdm_point_key *key;
    int n;
    const double *x, *distance;
} sdm_points_next;

/* A candidate of the current vector. bit i of `lanes`: the feature may be the nearest one of point
   i of the vector. */
typedef struct sdm_point_candidate {
    uint32_t number;
    uint32_t lanes;
} sdm_point_candidate;

/* Scratch memory of one thread. */
typedef struct sdm_point_scratch {
    /* coordinates of the points of the block, mm: x, y and z of the eight points of each SIMD
       register, [register][coordinate][point]; all of them are finite */
    _Alignas(64) double x[SDM_POINT_REGISTERS][3][8];
    /* result: number of the nearest feature of each point and its squared distance, mm^2. Of
       several features with the same squared distance, bit for bit, the highest number */
    uint32_t number[SDM_POINT_BLOCK];
    _Alignas(32) double d2[SDM_POINT_BLOCK];
    /* result: side of each point by sdm_feature_side(); unknown without sdm_features.side, and
       where features that are nearest up to rounding differ */
    int8_t side[SDM_POINT_BLOCK];
    /* clusters that may hold the nearest feature of a point of a vector: the distances of their
       boxes from the centre of the vector, scaled, rounded down to a float whose lowest bits hold
       the index into node[]; [vector][near_end[vector]], INFINITY from there to the next multiple
       of eight */
    _Alignas(32) float near[SDM_POINT_VECTORS][SDM_PAIRS_MAX + 8];
    size_t near_end[SDM_POINT_VECTORS];
    /* nodes of these clusters */
    uint32_t node[SDM_PAIRS_MAX];
    sdm_points_next next;
    /* are vectors of two registers tried first? */
    bool wide;
    /* candidates of the current vector */
    sdm_point_candidate *candidate;
    size_t n_candidate;
    /* reference points of the vectors; at the start any points of the surface */
    sdm_points reference;
} sdm_point_scratch;

/* Finds the nearest features of the points scratch->x. The nearest feature is found in float with a
   margin for rounding errors; among all features within the margin the distances in double decide.
   The result is the minimum over all features of sdm_feature_distance2(), so it does not depend on
   the other points of the block or on the instruction set. */
typedef void sdm_point_kernel(const sdm_nearest *surface, sdm_point_scratch *scratch);

/* The same for a single point x, without scratch memory: returns the number of the nearest feature
   and sets its squared distance and the side of x. */
typedef uint32_t sdm_point_search(const sdm_nearest *surface, const double x[3], double *d2,
                                  int *side);

sdm_point_kernel sdm_point_kernel_generic;
sdm_point_search sdm_point_search_generic;
#if defined(__x86_64__) && defined(__GNUC__)
sdm_point_kernel sdm_point_kernel_avx2, sdm_point_kernel_avx512;
sdm_point_search sdm_point_search_avx2, sdm_point_search_avx512;
#endif
