/* Writes the graph as an ONNX file. The tensors are computed and written piece by piece, hence all
   lengths are computed before. The numbers of fields are those of onnx.proto, IR version 7. */
#include <string.h>

#include "onnx_parts.h"
#include "sdm/export.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

#ifdef __BYTE_ORDER__
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
               "tensors are written as they are in memory: little-endian");
#endif

enum { IR_VERSION = 7, OPSET = 13 };

static size_t element_bytes(int type) { return type == SDM_ONNX_INT64 ? 8 : 4; }

// bytes of one item of dims[0]; a tensor fits in memory, so that nothing overflows
static double item_bytes(const onnx_tensor *t)
{
    double n = (double)element_bytes(t->type);
    for (size_t i = 1; i < t->n_dims; i++) n *= (double)t->dims[i];
    return n;
}

// *head = the fields of a tensor up to its elements, which follow. TensorProto: dims 1, data_type
// 2, name 8, raw_data 9, doc_string 12
static void tensor_head(const onnx_tensor *t, sdm_proto *head)
{
    char name[ONNX_NAME_SIZE];
    for (size_t i = 0; i < t->n_dims; i++) sdm_proto_int(head, 1, t->dims[i]);
    sdm_proto_int(head, 2, (uint64_t)t->type);
    sdm_proto_text(head, 8, onnx_name(t->value, name));
    sdm_proto_text(head, 12, t->what);
    sdm_proto_head(head, 9, (uint64_t)(item_bytes(t) * (double)t->dims[0]));
}

// *field = tag and length of the tensor in the graph (initializer 5), and its fields up to its
// elements; returns their bytes
static uint64_t tensor_field(const onnx_tensor *t, sdm_proto *field)
{
    sdm_proto head = {0};
    const uint64_t bytes = (uint64_t)(item_bytes(t) * (double)t->dims[0]);
    tensor_head(t, &head);
    sdm_proto_head(field, 5, head.size + bytes);
    sdm_proto_append(field, &head);
    sdm_proto_dispose(&head);
    return bytes;
}

static sdm_status write_message(sdm_outfile *f, const sdm_proto *p, sdm_error *err)
{
    if (p->failed) return sdm_fail(err, SDM_E_NOMEM, "out of memory for the ONNX graph");
    return sdm_outfile_write(f, p->data, p->size, err);
}

static sdm_status write_elements(sdm_outfile *f, const onnx_tensor *t, sdm_error *err)
{
    const size_t bytes = (size_t)item_bytes(t);
    if (!t->fill) return sdm_outfile_write(f, t->data, t->dims[0] * bytes, err);
    float *item = NULL;
    sdm_status s = SDM_ALLOC(&item, bytes / sizeof *item, "weights", err);
    for (size_t i = 0; i < t->dims[0] && !s; i++) {
        t->fill(t->user, i, item);
        s = sdm_outfile_write(f, item, bytes, err);
    }
    sdm_free(item);
    return s;
}

static sdm_status write_tensor(sdm_outfile *f, const onnx_tensor *t, sdm_error *err)
{
    sdm_proto field = {0};
    tensor_field(t, &field);
    sdm_status s = write_message(f, &field, err);
    sdm_proto_dispose(&field);
    return s ? s : write_elements(f, t, err);
}

// *bytes += bytes of all tensors as fields of the graph
static sdm_status measure_tensors(const sdm_onnx *g, uint64_t *bytes, sdm_error *err)
{
    double total = 0;
    for (size_t i = 0; i < g->n_tensors; i++)
        total += item_bytes(&g->tensors[i]) * (double)g->tensors[i].dims[0];
    if (total > INT32_MAX)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "the ONNX file would have %.1f GB of weights, and the format allows 2 GB: "
                        "export a smaller network",
                        total / 1e9);
    for (size_t i = 0; i < g->n_tensors; i++) {
        sdm_proto field = {0};
        *bytes += tensor_field(&g->tensors[i], &field);
        *bytes += field.size;
        const bool failed = field.failed;
        sdm_proto_dispose(&field);
        if (failed) return sdm_fail(err, SDM_E_NOMEM, "out of memory for the ONNX graph");
    }
    return SDM_OK;
}

// Writes head (the fields of the model before the graph), the graph (field 7) and the fields after
// it.
static sdm_status write_parts(sdm_outfile *f, const sdm_onnx *g, const sdm_proto *head,
                              const sdm_proto *tail, sdm_error *err)
{
    sdm_status s = write_message(f, head, err);
    if (!s) s = write_message(f, &g->main, err);
    for (size_t i = 0; i < g->n_tensors && !s; i++) s = write_tensor(f, &g->tensors[i], err);
    return s ? s : write_message(f, tail, err);
}

// ModelProto: ir_version 1, producer_name 2, producer_version 3, graph 7
static void model_head(uint64_t graph_bytes, sdm_proto *head)
{
    sdm_proto_int(head, 1, IR_VERSION);
    sdm_proto_text(head, 2, "sdmgen");
    sdm_proto_text(head, 3, SDM_VERSION_TEXT);
    sdm_proto_head(head, 7, graph_bytes);
}

// ModelProto: opset_import 8 (domain 1: "", version 2)
static void model_tail(const sdm_onnx *g, sdm_proto *tail)
{
    sdm_proto opset = {0};
    sdm_proto_text(&opset, 1, "");
    sdm_proto_int(&opset, 2, OPSET);
    sdm_proto_message(tail, 8, &opset);
    sdm_proto_dispose(&opset);
    sdm_proto_append(tail, &g->metadata);
}

// the node that gives the output its name, and the fields of the graph that are no tensors: name 2,
// input 11, output 12
static void end_graph(sdm_onnx *g, sdm_onnx_value result, const size_t dims[3])
{
    char name[ONNX_NAME_SIZE];
    sdm_proto node = {0};
    sdm_proto_text(&node, 1, onnx_name(result, name));
    sdm_proto_text(&node, 2, "sdm");
    sdm_proto_text(&node, 4, "Identity");
    sdm_proto_message(&g->main, 1, &node);
    sdm_proto_dispose(&node);
    sdm_proto_text(&g->main, 2, "sdmgen");
    onnx_describe(&g->main, 11, "params", 2, (const size_t[]){0, g->n_params});
    onnx_describe(&g->main, 12, "sdm", 4, (const size_t[]){0, dims[0], dims[1], dims[2]});
}

sdm_status sdm_onnx_write(sdm_onnx *g, const char *path, sdm_onnx_value result,
                          const size_t dims[3], sdm_error *err)
{
    uint64_t tensors = 0;
    end_graph(g, result, dims);
    if (g->failed || g->main.failed || g->metadata.failed)
        return sdm_fail(err, SDM_E_NOMEM, "out of memory for the ONNX graph");
    sdm_status s = measure_tensors(g, &tensors, err);
    if (s) return s;
    sdm_proto head = {0}, tail = {0};
    sdm_outfile *f = NULL;
    model_head(tensors + g->main.size, &head);
    model_tail(g, &tail);
    const uint64_t total = head.size + tensors + g->main.size + tail.size;
    if (total > INT32_MAX)
        s = sdm_fail(
            err, SDM_E_UNSUPPORTED,
            "the ONNX file would have %llu bytes, and the format allows 2147483647: export "
            "a smaller network",
            (unsigned long long)total);
    if (!s) s = sdm_outfile_open(path, &f, err);
    if (!s) s = write_parts(f, g, &head, &tail, err);
    sdm_proto_dispose(&head);
    sdm_proto_dispose(&tail);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}
