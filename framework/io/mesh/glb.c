/* Writes a mesh as binary glTF 2.0: a header, the JSON that describes the scene, and one buffer
   with the positions, the targets and the triangles. */
#include "sdm/internal/glb.h"

#include <math.h>

#include "bytes.h"
#include "sdm/export.h"
#include "sdm/internal/text.h"

enum { FLOAT = 5126, UINT32 = 5125, ARRAY = 34962, ELEMENTS = 34963, CHUNK = 1024 };

// the accessor `index` of the positions: numbers, and limits of their coordinates
static void describe_positions(sdm_json *j, size_t n_vert, const double *vert, size_t index)
{
    float min[3] = {INFINITY, INFINITY, INFINITY}, max[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * n_vert; i++) {
        min[i % 3] = fminf(min[i % 3], (float)vert[i]);
        max[i % 3] = fmaxf(max[i % 3], (float)vert[i]);
    }
    sdm_json_open(j, NULL, '{');
    sdm_json_uint(j, "bufferView", index);
    sdm_json_uint(j, "componentType", FLOAT);
    sdm_json_uint(j, "count", n_vert);
    sdm_json_text(j, "type", "VEC3");
    for (int m = 0; m < 2; m++) {
        sdm_json_open(j, m ? "max" : "min", '[');
        for (int a = 0; a < 3; a++) sdm_json_real(j, NULL, (double)(m ? max : min)[a]);
        sdm_json_close(j, ']');
    }
    sdm_json_close(j, '}');
}

static void describe_accessors(sdm_json *j, const sdm_mesh *mesh, const sdm_glb_target *targets,
                               size_t n)
{
    sdm_json_open(j, "accessors", '[');
    describe_positions(j, mesh->n_vert, mesh->vert, 0);
    for (size_t i = 0; i < n; i++) describe_positions(j, mesh->n_vert, targets[i].delta, 1 + i);
    sdm_json_open(j, NULL, '{');
    sdm_json_uint(j, "bufferView", 1 + n);
    sdm_json_uint(j, "componentType", UINT32);
    sdm_json_uint(j, "count", 3 * mesh->n_tri);
    sdm_json_text(j, "type", "SCALAR");
    sdm_json_close(j, '}');
    sdm_json_close(j, ']');
}

static void describe_view(sdm_json *j, uint64_t offset, uint64_t length, uint64_t target)
{
    sdm_json_open(j, NULL, '{');
    sdm_json_uint(j, "buffer", 0);
    sdm_json_uint(j, "byteOffset", offset);
    sdm_json_uint(j, "byteLength", length);
    sdm_json_uint(j, "target", target);
    sdm_json_close(j, '}');
}

// the parts of the buffer: positions, targets, triangles
static void describe_buffer(sdm_json *j, const sdm_mesh *mesh, size_t n)
{
    const uint64_t positions = 12 * (uint64_t)mesh->n_vert, triangles = 12 * (uint64_t)mesh->n_tri;
    sdm_json_open(j, "bufferViews", '[');
    for (size_t i = 0; i <= n; i++) describe_view(j, i * positions, positions, ARRAY);
    describe_view(j, (1 + n) * positions, triangles, ELEMENTS);
    sdm_json_close(j, ']');
    sdm_json_open(j, "buffers", '[');
    sdm_json_open(j, NULL, '{');
    sdm_json_uint(j, "byteLength", (1 + n) * positions + triangles);
    sdm_json_close(j, '}');
    sdm_json_close(j, ']');
}

static void describe_mesh(sdm_json *j, const sdm_glb_target *targets, size_t n,
                          sdm_glb_extras extras, const void *user)
{
    sdm_json_open(j, "meshes", '[');
    sdm_json_open(j, NULL, '{');
    sdm_json_open(j, "primitives", '[');
    sdm_json_open(j, NULL, '{');
    sdm_json_open(j, "attributes", '{');
    sdm_json_uint(j, "POSITION", 0);
    sdm_json_close(j, '}');
    sdm_json_uint(j, "indices", 1 + n);
    if (n) sdm_json_open(j, "targets", '[');
    for (size_t i = 0; i < n; i++) {
        sdm_json_open(j, NULL, '{');
        sdm_json_uint(j, "POSITION", 1 + i);
        sdm_json_close(j, '}');
    }
    if (n) sdm_json_close(j, ']');
    sdm_json_close(j, '}');
    sdm_json_close(j, ']');
    if (n) sdm_json_open(j, "weights", '[');
    for (size_t i = 0; i < n; i++) sdm_json_real(j, NULL, targets[i].weight);
    if (n) sdm_json_close(j, ']');
    sdm_json_open(j, "extras", '{');
    if (n) sdm_json_open(j, "targetNames", '[');
    for (size_t i = 0; i < n; i++) sdm_json_text(j, NULL, targets[i].name);
    if (n) sdm_json_close(j, ']');
    extras(user, j);
    sdm_json_close(j, '}');
    sdm_json_close(j, '}');
    sdm_json_close(j, ']');
}

// A scene with one node, which turns LPS upright (a quarter turn about x: x, y, z become x, z, -y)
// and scales mm to metres.
static void describe_scene(sdm_json *j)
{
    const double rotation[] = {-sqrt(0.5), 0, 0, sqrt(0.5)};
    sdm_json_open(j, "asset", '{');
    sdm_json_text(j, "version", "2.0");
    sdm_json_text(j, "generator", "sdmgen " SDM_VERSION_TEXT);
    sdm_json_close(j, '}');
    sdm_json_uint(j, "scene", 0);
    sdm_json_open(j, "scenes", '[');
    sdm_json_open(j, NULL, '{');
    sdm_json_open(j, "nodes", '[');
    sdm_json_uint(j, NULL, 0);
    sdm_json_close(j, ']');
    sdm_json_close(j, '}');
    sdm_json_close(j, ']');
    sdm_json_open(j, "nodes", '[');
    sdm_json_open(j, NULL, '{');
    sdm_json_uint(j, "mesh", 0);
    sdm_json_open(j, "rotation", '[');
    for (int i = 0; i < 4; i++) sdm_json_real(j, NULL, rotation[i]);
    sdm_json_close(j, ']');
    sdm_json_open(j, "scale", '[');
    for (int i = 0; i < 3; i++) sdm_json_real(j, NULL, 0.001);
    sdm_json_close(j, ']');
    sdm_json_close(j, '}');
    sdm_json_close(j, ']');
}

static sdm_status write_uint(sdm_outfile *f, uint64_t v, sdm_error *err)
{
    uint8_t bytes[4];
    sdm_put_uint(bytes, 4, v);
    return sdm_outfile_write(f, bytes, 4, err);
}

// the numbers as floats
static sdm_status write_positions(sdm_outfile *f, const double *v, size_t n, sdm_error *err)
{
    uint8_t bytes[4 * CHUNK];
    sdm_status s = SDM_OK;
    for (size_t at = 0; at < n && !s; at += CHUNK) {
        const size_t m = n - at < CHUNK ? n - at : CHUNK;
        for (size_t i = 0; i < m; i++) sdm_put_f32(bytes + 4 * i, (float)v[at + i]);
        s = sdm_outfile_write(f, bytes, 4 * m, err);
    }
    return s;
}

static sdm_status write_triangles(sdm_outfile *f, const uint32_t *v, size_t n, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < n && !s; i++) s = write_uint(f, v[i], err);
    return s;
}

// The file: 12 bytes of header, then two chunks (length, type, content): the JSON, padded with
// spaces to a multiple of 4 bytes, and the buffer.
static sdm_status write_file(sdm_outfile *f, const sdm_mesh *mesh, const sdm_glb_target *targets,
                             size_t n, const sdm_text *json, uint64_t buffer, sdm_error *err)
{
    const size_t pad = (4 - json->size % 4) % 4, text = json->size + pad;
    const uint64_t head[] = {0x46546C67, 2, 12 + 8 + text + 8 + buffer, text, 0x4E4F534A};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < 5 && !s; i++) s = write_uint(f, head[i], err);
    if (!s) s = sdm_outfile_write(f, json->data, json->size, err);
    if (!s) s = sdm_outfile_write(f, "   ", pad, err);
    if (!s) s = write_uint(f, buffer, err);
    if (!s) s = write_uint(f, 0x004E4942, err);
    if (!s) s = write_positions(f, mesh->vert, 3 * mesh->n_vert, err);
    for (size_t i = 0; i < n && !s; i++)
        s = write_positions(f, targets[i].delta, 3 * mesh->n_vert, err);
    return s ? s : write_triangles(f, mesh->tri, 3 * mesh->n_tri, err);
}

sdm_status sdm_glb_write(const char *path, const sdm_mesh *mesh, const sdm_glb_target *targets,
                         size_t n, sdm_glb_extras extras, const void *user, sdm_error *err)
{
    const uint64_t buffer = 12 * ((1 + n) * (uint64_t)mesh->n_vert + mesh->n_tri);
    sdm_json j = {0};
    sdm_outfile *f = NULL;
    sdm_json_open(&j, NULL, '{');
    describe_scene(&j);
    describe_mesh(&j, targets, n, extras, user);
    describe_accessors(&j, mesh, targets, n);
    describe_buffer(&j, mesh, n);
    sdm_json_close(&j, '}');
    sdm_status s =
        j.text.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the glTF scene") : SDM_OK;
    if (!s && buffer + j.text.size + 64 > UINT32_MAX)
        s = sdm_fail(
            err, SDM_E_UNSUPPORTED,
            "a mesh of %zu vertices and %zu triangles with %zu targets needs more than the "
            "4 GB of a .glb file",
            mesh->n_vert, mesh->n_tri, n);
    if (!s) s = sdm_outfile_open(path, &f, err);
    if (!s) s = write_file(f, mesh, targets, n, &j.text, buffer, err);
    sdm_json_dispose(&j);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}
