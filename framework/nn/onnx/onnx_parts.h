/* The inside of a graph (onnx.h), for the files of this folder. */
#pragma once

#include "onnx.h"

/* A tensor: its elements come from `fill`, or, if that is NULL, from `data`. */
typedef struct onnx_tensor {
    sdm_onnx_value value;
    int type;
    size_t n_dims, dims[SDM_ONNX_MAX_DIMS];
    const char *what;
    sdm_onnx_fill fill;
    const void *user, *data;
} onnx_tensor;

typedef struct onnx_memory {
    struct onnx_memory *next;
    _Alignas(16) uint8_t data[];
} onnx_memory;

struct sdm_onnx {
    size_t n_params;
    uint32_t n_values;
    sdm_proto main, body;       /* the nodes of the graph and of the loop that is open */
    sdm_proto *nodes;           /* main or body: where nodes are appended */
    sdm_proto attributes;       /* of the next node */
    sdm_proto metadata;         /* fields of ModelProto */
    sdm_onnx_value over, slice; /* of the loop that is open */
    size_t slice_n_dims, slice_dims[SDM_ONNX_MAX_DIMS];
    onnx_tensor *tensors;
    size_t n_tensors, capacity;
    onnx_memory *memory;
    bool failed;
};

/* The name of a value in the file. */
enum { ONNX_NAME_SIZE = 16 };
const char *onnx_name(sdm_onnx_value v, char name[ONNX_NAME_SIZE]);

/* Appends to *graph the description of a float value as field `field` with the dimensions
   dims[n_dims]; a dimension of 0 has the name N. */
void onnx_describe(sdm_proto *graph, unsigned field, const char *name, size_t n_dims,
                   const size_t *dims);
