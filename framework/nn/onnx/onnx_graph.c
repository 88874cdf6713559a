/* The graph of an ONNX file: tensors, nodes, attributes and loops. The numbers of fields are those
   of onnx.proto, IR version 7. */
#include <stdio.h>
#include <string.h>

#include "onnx_parts.h"
#include "sdm/memory.h"

sdm_status sdm_onnx_create(size_t n_params, sdm_onnx **out, sdm_onnx_value *input, sdm_error *err)
{
    const sdm_status s = SDM_ALLOC(out, 1, "ONNX graph", err);
    if (s) return s;
    (*out)->n_params = n_params;
    (*out)->nodes = &(*out)->main;
    *input = (*out)->n_values++;
    return SDM_OK;
}

void sdm_onnx_free(sdm_onnx *g)
{
    if (!g) return;
    while (g->memory) {
        onnx_memory *next = g->memory->next;
        sdm_free(g->memory);
        g->memory = next;
    }
    sdm_proto_dispose(&g->main);
    sdm_proto_dispose(&g->body);
    sdm_proto_dispose(&g->attributes);
    sdm_proto_dispose(&g->metadata);
    sdm_free(g->tensors);
    sdm_free(g);
}

void *sdm_onnx_memory(sdm_onnx *g, size_t count, size_t size)
{
    onnx_memory *m = NULL;
    if ((size && count > (SIZE_MAX - sizeof *m) / size) ||
        sdm_alloc((void **)&m, 1, sizeof *m + count * size, "ONNX graph", NULL)) {
        g->failed = true;
        return NULL;
    }
    m->next = g->memory;
    g->memory = m;
    return m->data;
}

const char *onnx_name(sdm_onnx_value v, char name[ONNX_NAME_SIZE])
{
    snprintf(name, ONNX_NAME_SIZE, v ? "v%u" : "params", (unsigned)v);
    return name;
}

// tensors

static onnx_tensor *new_tensor(sdm_onnx *g)
{
    if (g->n_tensors == g->capacity) {
        onnx_tensor *grown;
        if (sdm_alloc((void **)&grown, 2 * g->capacity + 16, sizeof *grown, "ONNX graph", NULL)) {
            g->failed = true;
            return NULL;
        }
        if (g->n_tensors) memcpy(grown, g->tensors, g->n_tensors * sizeof *grown);
        sdm_free(g->tensors);
        g->tensors = grown;
        g->capacity = 2 * g->capacity + 16;
    }
    return &g->tensors[g->n_tensors++];
}

static sdm_onnx_value add_tensor(sdm_onnx *g, int type, const char *what, size_t n_dims,
                                 const size_t *dims, sdm_onnx_fill fill, const void *user,
                                 const void *data)
{
    onnx_tensor *t = new_tensor(g);
    if (!t) return 0;
    *t = (onnx_tensor){.value = g->n_values++,
                       .type = type,
                       .n_dims = n_dims,
                       .what = what,
                       .fill = fill,
                       .user = user,
                       .data = data};
    memcpy(t->dims, dims, n_dims * sizeof *dims);
    return t->value;
}

sdm_onnx_value sdm_onnx_weights(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                                sdm_onnx_fill fill, const void *user)
{
    return add_tensor(g, SDM_ONNX_FLOAT, what, n_dims, dims, fill, user, NULL);
}

sdm_onnx_value sdm_onnx_layer_weights(sdm_onnx *g, size_t rows, size_t columns, sdm_onnx_fill fill,
                                      const void *network, size_t layer)
{
    const size_t dims[] = {rows, columns};
    sdm_onnx_layer *user = sdm_onnx_memory(g, 1, sizeof *user);
    if (!user) return 0;
    *user = (sdm_onnx_layer){network, layer};
    return sdm_onnx_weights(g, "layer", 2, dims, fill, user);
}

sdm_onnx_value sdm_onnx_floats(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                               const float *values)
{
    return add_tensor(g, SDM_ONNX_FLOAT, what, n_dims, dims, NULL, NULL, values);
}

sdm_onnx_value sdm_onnx_indices(sdm_onnx *g, const char *what, size_t n_dims, const size_t *dims,
                                const int32_t *values)
{
    return add_tensor(g, SDM_ONNX_INT32, what, n_dims, dims, NULL, NULL, values);
}

sdm_onnx_value sdm_onnx_list(sdm_onnx *g, size_t n, const int64_t *values)
{
    int64_t *copy = sdm_onnx_memory(g, n, sizeof *copy);
    if (!copy) return 0;
    memcpy(copy, values, n * sizeof *copy);
    return add_tensor(g, SDM_ONNX_INT64, "list", 1, &n, NULL, NULL, copy);
}

sdm_onnx_value sdm_onnx_scalar(sdm_onnx *g, double value)
{
    float *copy = sdm_onnx_memory(g, 1, sizeof *copy);
    if (!copy) return 0;
    *copy = (float)value;
    return sdm_onnx_floats(g, "scalar", 1, (const size_t[]){1}, copy);
}

// attributes (AttributeProto: name 1, f 2, i 3, g 6, ints 8, type 20) and nodes (NodeProto: input
// 1, output 2, op_type 4, attribute 5)

enum { TYPE_FLOAT = 1, TYPE_INT = 2, TYPE_GRAPH = 5, TYPE_INTS = 7 };

// ends the attribute *a: adds its type and appends it to those of the next node
static void add_attribute(sdm_onnx *g, sdm_proto *a, int type)
{
    sdm_proto_int(a, 20, (uint64_t)type);
    sdm_proto_message(&g->attributes, 5, a);
    sdm_proto_dispose(a);
}

void sdm_onnx_set_int(sdm_onnx *g, const char *name, int64_t v)
{
    sdm_proto a = {0};
    sdm_proto_text(&a, 1, name);
    sdm_proto_int(&a, 3, (uint64_t)v);
    add_attribute(g, &a, TYPE_INT);
}

void sdm_onnx_set_float(sdm_onnx *g, const char *name, double v)
{
    sdm_proto a = {0};
    sdm_proto_text(&a, 1, name);
    sdm_proto_float(&a, 2, (float)v);
    add_attribute(g, &a, TYPE_FLOAT);
}

void sdm_onnx_set_ints(sdm_onnx *g, const char *name, size_t n, const int64_t *v)
{
    sdm_proto a = {0};
    sdm_proto_text(&a, 1, name);
    for (size_t i = 0; i < n; i++) sdm_proto_int(&a, 8, (uint64_t)v[i]);
    add_attribute(g, &a, TYPE_INTS);
}

sdm_onnx_value sdm_onnx_node(sdm_onnx *g, const char *op, size_t n, const sdm_onnx_value *inputs)
{
    char name[ONNX_NAME_SIZE];
    const sdm_onnx_value result = g->n_values++;
    sdm_proto node = {0};
    for (size_t i = 0; i < n; i++) sdm_proto_text(&node, 1, onnx_name(inputs[i], name));
    sdm_proto_text(&node, 2, onnx_name(result, name));
    sdm_proto_text(&node, 4, op);
    // the attributes are whole fields of the node already
    sdm_proto_append(&node, &g->attributes);
    sdm_proto_dispose(&g->attributes);
    sdm_proto_message(g->nodes, 1, &node);
    sdm_proto_dispose(&node);
    return result;
}

sdm_onnx_value sdm_onnx_node1(sdm_onnx *g, const char *op, sdm_onnx_value a)
{
    return sdm_onnx_node(g, op, 1, &a);
}

sdm_onnx_value sdm_onnx_node2(sdm_onnx *g, const char *op, sdm_onnx_value a, sdm_onnx_value b)
{
    return sdm_onnx_node(g, op, 2, (const sdm_onnx_value[]){a, b});
}

sdm_onnx_value sdm_onnx_node3(sdm_onnx *g, const char *op, sdm_onnx_value a, sdm_onnx_value b,
                              sdm_onnx_value c)
{
    return sdm_onnx_node(g, op, 3, (const sdm_onnx_value[]){a, b, c});
}

sdm_onnx_value sdm_onnx_gather(sdm_onnx *g, sdm_onnx_value from, sdm_onnx_value index, int axis)
{
    sdm_onnx_set_int(g, "axis", axis);
    return sdm_onnx_node2(g, "Gather", from, index);
}

sdm_onnx_value sdm_onnx_reshape(sdm_onnx *g, sdm_onnx_value from, size_t n, const int64_t *dims)
{
    return sdm_onnx_node2(g, "Reshape", from, sdm_onnx_list(g, n, dims));
}

sdm_onnx_value sdm_onnx_activate(sdm_onnx *g, int kind, sdm_onnx_value from)
{
    if (kind == 0) return sdm_onnx_node2(g, "Mul", from, sdm_onnx_node1(g, "Sigmoid", from));
    if (kind == 1) return sdm_onnx_node1(g, "Tanh", from);
    if (kind == 2) return sdm_onnx_node1(g, "Relu", from);
    sdm_onnx_set_float(g, "alpha", 0.02);
    return sdm_onnx_node1(g, "LeakyRelu", from);
}

// ValueInfoProto: name 1, type 2 (tensor_type 1 (elem_type 1, shape 2 (dim 1 (dim_value 1,
// dim_param 2))))
void onnx_describe(sdm_proto *graph, unsigned field, const char *name, size_t n_dims,
                   const size_t *dims)
{
    sdm_proto shape = {0}, tensor = {0}, type = {0}, value = {0};
    for (size_t i = 0; i < n_dims; i++) {
        sdm_proto dim = {0};
        if (dims[i])
            sdm_proto_int(&dim, 1, dims[i]);
        else
            sdm_proto_text(&dim, 2, "N");
        sdm_proto_message(&shape, 1, &dim);
        sdm_proto_dispose(&dim);
    }
    sdm_proto_int(&tensor, 1, SDM_ONNX_FLOAT);
    sdm_proto_message(&tensor, 2, &shape);
    sdm_proto_message(&type, 1, &tensor);
    sdm_proto_text(&value, 1, name);
    sdm_proto_message(&value, 2, &type);
    sdm_proto_message(graph, field, &value);
    sdm_proto_dispose(&shape);
    sdm_proto_dispose(&tensor);
    sdm_proto_dispose(&type);
    sdm_proto_dispose(&value);
}

// loops: the operator Scan, whose body is a graph (GraphProto: node 1, name 2, input 11, output 12)

sdm_onnx_value sdm_onnx_loop_begin(sdm_onnx *g, sdm_onnx_value over, size_t n_dims,
                                   const size_t *dims)
{
    g->over = over;
    g->slice = g->n_values++;
    g->slice_n_dims = n_dims;
    memcpy(g->slice_dims, dims, n_dims * sizeof *dims);
    g->nodes = &g->body;
    return g->slice;
}

sdm_onnx_value sdm_onnx_loop_end(sdm_onnx *g, sdm_onnx_value result, size_t n_dims,
                                 const size_t *dims, int axis)
{
    char name[ONNX_NAME_SIZE];
    sdm_proto a = {0};
    sdm_proto_text(&g->body, 2, "body");
    onnx_describe(&g->body, 11, onnx_name(g->slice, name), g->slice_n_dims, g->slice_dims);
    onnx_describe(&g->body, 12, onnx_name(result, name), n_dims, dims);
    sdm_proto_text(&a, 1, "body");
    sdm_proto_message(&a, 6, &g->body);
    sdm_proto_dispose(&g->body);
    g->nodes = &g->main;
    add_attribute(g, &a, TYPE_GRAPH);
    sdm_onnx_set_int(g, "num_scan_inputs", 1);
    sdm_onnx_set_ints(g, "scan_output_axes", 1, (const int64_t[]){axis});
    return sdm_onnx_node1(g, "Scan", g->over);
}

// ModelProto: metadata_props 14 (key 1, value 2)
void sdm_onnx_metadata(sdm_onnx *g, const char *key, const char *value)
{
    sdm_proto entry = {0};
    sdm_proto_text(&entry, 1, key);
    sdm_proto_text(&entry, 2, value);
    sdm_proto_message(&g->metadata, 14, &entry);
    sdm_proto_dispose(&entry);
}
