/* Streams of random numbers: one for each purpose, so that none disturbs another. */
#ifndef SDM_STREAMS_H
#define SDM_STREAMS_H

enum {
    STREAM_TRAIN = 100,
    STREAM_HOLDOUT = 200,
    STREAM_FIT = 300,
    STREAM_REFINE = 350,
    STREAM_INIT = 400,
    STREAM_POINTS = 600,
    STREAM_EVALUATE = 650,
    STREAM_DROPOUT = 700,
    STREAM_PLAN = 750,
    STREAM_BASES = 1000 // and on: one for each block
};

#endif
