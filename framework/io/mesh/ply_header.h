/* The header of a PLY file: elements and their properties, in the order of the body. */
#pragma once

#include "mesh_formats.h"

#define SDM_PLY_ELEMENTS 16
#define SDM_PLY_PROPERTIES 256

/* The type of a number in the file; SDM_PLY_NONE: no number. */
typedef enum sdm_ply_type {
    SDM_PLY_NONE = 0,
    SDM_PLY_INT8,
    SDM_PLY_UINT8,
    SDM_PLY_INT16,
    SDM_PLY_UINT16,
    SDM_PLY_INT32,
    SDM_PLY_UINT32,
    SDM_PLY_FLOAT32,
    SDM_PLY_FLOAT64
} sdm_ply_type;

/* How a property is used: as a coordinate of a vertex, as the corners of a face, or not at all. */
typedef enum sdm_ply_role {
    SDM_PLY_X = 0,
    SDM_PLY_Y,
    SDM_PLY_Z,
    SDM_PLY_CORNERS,
    SDM_PLY_SKIPPED
} sdm_ply_role;

typedef struct sdm_ply_property {
    sdm_ply_type type;
    sdm_ply_type count_type; /* type of the length of a list; NONE: a single value */
    sdm_ply_role role;
} sdm_ply_property;

typedef struct sdm_ply_element {
    int64_t count;   /* instances in the body */
    size_t first, n; /* its properties: property[first .. first + n - 1] */
    bool is_vertex, is_face;
} sdm_ply_element;

typedef struct sdm_ply_header {
    bool ascii, big;
    size_t n_elements, n_properties;
    int64_t n_vert;
    sdm_ply_element element[SDM_PLY_ELEMENTS];
    sdm_ply_property property[SDM_PLY_PROPERTIES];
} sdm_ply_header;

/* Bytes of a number of this type; 0 for SDM_PLY_NONE. */
size_t sdm_ply_type_size(sdm_ply_type type);

/* Reads the header into *h, which is zero-initialised; afterwards scan->at is the first byte of the
 * body. SDM_E_FORMAT; SDM_E_UNSUPPORTED for an unknown format or too many elements or properties.
 */
sdm_status sdm_ply_read_header(sdm_scan *scan, sdm_ply_header *h, sdm_error *err);
