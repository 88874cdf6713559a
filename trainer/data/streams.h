/* Streams of the counter-based random numbers: one for each purpose, so that drawing more numbers
 * for one purpose does not change the others. */
#pragma once

enum {
    STREAM_TRAIN = 100,    // parameters of random training maps
    STREAM_HOLDOUT = 200,  // parameters of held-out maps
    STREAM_BATCH = 300,    // slots of a batch: mode fit of pod, training of the direct kinds
    STREAM_REFINE = 350,   // slots of a batch: refinement of pod
    STREAM_INIT = 400,     // initial weights
    STREAM_FAMILY = 500,   // parameters of meshes from which templates are designed
    STREAM_POINTS = 600,   // voxels of a map that a point network is trained on
    STREAM_EVALUATE = 650, // voxels of a held-out map that a point network is evaluated on
    STREAM_DROPOUT = 700,
    STREAM_SURFACE = 720, // points of a surface (surface_check.h)
    STREAM_PLAN = 750,    // rejection of Sobol' points (sample_plan.h)
    STREAM_FINE = 800,    // samples of the fine level: shapes, cells; 802 weights, 803 batches
    STREAM_BASES = 1000   // start of subspace iterations: global modes; block b has 1001 + b
};
