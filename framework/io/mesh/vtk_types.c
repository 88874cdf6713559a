/* The number types of VTK files and the decoding of their binary form. */
#include "vtk_types.h"

#include <string.h>
#include <strings.h>

#include "bytes.h"

static const sdm_vtk_type types[] = {
    {"float", "Float32", 4, 'f'},
    {"double", "Float64", 8, 'f'},
    {"char", "Int8", 1, 'i'},
    {"unsigned_char", "UInt8", 1, 'u'},
    {"short", "Int16", 2, 'i'},
    {"unsigned_short", "UInt16", 2, 'u'},
    {"int", "Int32", 4, 'i'},
    {"unsigned_int", "UInt32", 4, 'u'},
    {"vtktypeint64", "Int64", 8, 'i'},
    {"vtktypeuint64", "UInt64", 8, 'u'},
    {"long", NULL, 8, 'i'},
    {"unsigned_long", NULL, 8, 'u'},
    {"signed_char", NULL, 1, 'i'},
    {"vtkidtype", NULL, 4, 'i'}, // 32 bits in the file
    {"vtktypeint32", NULL, 4, 'i'},
};
enum { N_TYPES = sizeof types / sizeof *types };

const sdm_vtk_type *sdm_vtk_type_legacy(const char *name)
{
    for (int i = 0; i < N_TYPES; i++)
        if (strcasecmp(types[i].legacy, name) == 0) return &types[i];
    return NULL;
}

const sdm_vtk_type *sdm_vtk_type_xml(const char *name, size_t length)
{
    for (int i = 0; i < N_TYPES; i++)
        if (types[i].xml && strlen(types[i].xml) == length && !memcmp(types[i].xml, name, length))
            return &types[i];
    return NULL;
}

int64_t sdm_vtk_index(const uint8_t *p, const sdm_vtk_type *type, bool big)
{
    const uint64_t v = sdm_get_uint(p, type->size, big);
    if (type->kind == 'u') return v > INT64_MAX ? -1 : (int64_t)v;
    switch (type->size) {
    case 1:
        return (int8_t)v;
    case 2:
        return (int16_t)v;
    case 4:
        return (int32_t)v;
    default:
        return (int64_t)v;
    }
}

double sdm_vtk_real(const uint8_t *p, const sdm_vtk_type *type, bool big)
{
    if (type->kind == 'f')
        return type->size == 4 ? (double)sdm_get_f32(p, big) : sdm_get_f64(p, big);
    if (type->kind == 'u') return (double)sdm_get_uint(p, type->size, big);
    return (double)sdm_vtk_index(p, type, big);
}
