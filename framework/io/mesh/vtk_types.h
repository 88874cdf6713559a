/* The number types of VTK files (.vtk and .vtp) and the decoding of their binary form. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct sdm_vtk_type {
    /* names in .vtk and in .vtp files; NULL: the format does not have the type */
    const char *legacy, *xml;
    /* bytes of a number in the file */
    size_t size;
    /* 'i' signed, 'u' unsigned, 'f' floating point */
    char kind;
} sdm_vtk_type;

/* The type of that name in a .vtk (in any case) or .vtp file; NULL: unknown. */
const sdm_vtk_type *sdm_vtk_type_legacy(const char *name);
const sdm_vtk_type *sdm_vtk_type_xml(const char *name, size_t length);

/* The number at p; big: big-endian. */
double sdm_vtk_real(const uint8_t *p, const sdm_vtk_type *type, bool big);

/* The whole number at p; -1 for an unsigned number above 2^63 - 1, which is no index. Not for
 * floating point. */
int64_t sdm_vtk_index(const uint8_t *p, const sdm_vtk_type *type, bool big);
