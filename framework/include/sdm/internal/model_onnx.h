/* Writes a trained network as an ONNX file, for programs that evaluate such files. */
#pragma once

#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes the network as a graph of ONNX operators, opset 13, IR version 7: input `params` [N][P],
   floats in the units of the parameters, output `sdm` [N][nz][ny][nx], floats in mm, negative
   inside; N is any number of maps. Weights stored as bytes or halves become the floats that they
   stand for. The metadata name the grid, the parameters with their ranges, and the model. Memory:
   a small multiple of one map, besides the model. SDM_E_UNSUPPORTED: ONNX cannot express this kind
   of network, or the file would have more than 2^31 - 1 bytes. SDM_E_IO, SDM_E_NOMEM; no file is
   left. [any thread] */
sdm_status sdm_model_write_onnx(const sdm_model *m, const char *path, sdm_error *err);

#ifdef __cplusplus
}
#endif
