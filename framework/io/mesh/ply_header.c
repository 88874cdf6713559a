/* Reads the header of a PLY file: format, elements, properties. */
#include "ply_header.h"

size_t sdm_ply_type_size(sdm_ply_type type)
{
    static const size_t size[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    return size[type];
}

/* The type of this name; SDM_PLY_NONE for an unknown name or NULL. */
static sdm_ply_type find_type(const char *word)
{
    static const struct {
        const char *name;
        sdm_ply_type type;
    } known[] = {
        {"char", SDM_PLY_INT8},      {"int8", SDM_PLY_INT8},       {"uchar", SDM_PLY_UINT8},
        {"uint8", SDM_PLY_UINT8},    {"short", SDM_PLY_INT16},     {"int16", SDM_PLY_INT16},
        {"ushort", SDM_PLY_UINT16},  {"uint16", SDM_PLY_UINT16},   {"int", SDM_PLY_INT32},
        {"int32", SDM_PLY_INT32},    {"uint", SDM_PLY_UINT32},     {"uint32", SDM_PLY_UINT32},
        {"float", SDM_PLY_FLOAT32},  {"float32", SDM_PLY_FLOAT32}, {"double", SDM_PLY_FLOAT64},
        {"float64", SDM_PLY_FLOAT64}};
    for (size_t i = 0; word && i < sizeof known / sizeof *known; i++)
        if (strcmp(word, known[i].name) == 0) return known[i].type;
    return SDM_PLY_NONE;
}

static bool is_word(const char *word, const char *wanted)
{
    return word && strcmp(word, wanted) == 0;
}

static sdm_status read_format(const sdm_scan *scan, char *line, sdm_ply_header *h, sdm_error *err)
{
    const char *name = sdm_scan_word(&line);
    h->ascii = is_word(name, "ascii");
    h->big = is_word(name, "binary_big_endian");
    if (!h->ascii && !h->big && !is_word(name, "binary_little_endian"))
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s:%zu: unknown PLY format '%.40s'", scan->path,
                        scan->line, name ? name : "");
    return SDM_OK;
}

static sdm_status read_element(const sdm_scan *scan, char *line, sdm_ply_header *h, sdm_error *err)
{
    const char *name = sdm_scan_word(&line);
    if (!name)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the element's name is missing", scan->path,
                        scan->line);
    if (h->n_elements == SDM_PLY_ELEMENTS)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s:%zu: more than %d elements", scan->path,
                        scan->line, SDM_PLY_ELEMENTS);
    sdm_ply_element e = {.first = h->n_properties,
                         .is_vertex = is_word(name, "vertex"),
                         .is_face = is_word(name, "face")};
    for (size_t i = 0; i < h->n_elements; i++)
        if ((e.is_vertex && h->element[i].is_vertex) || (e.is_face && h->element[i].is_face))
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: a second element '%s'", scan->path,
                            scan->line, name);
    const sdm_status status =
        sdm_scan_count(scan, &line, (int64_t)1 << 31, "number of elements", &e.count, err);
    if (status) return status;
    if (e.is_vertex) h->n_vert = e.count;
    h->element[h->n_elements++] = e;
    return SDM_OK;
}

/* The role of a property of this name. */
static sdm_ply_role find_role(const sdm_ply_element *e, const sdm_ply_property *p, const char *name)
{
    const bool list = p->count_type != SDM_PLY_NONE;
    if (e->is_vertex && !list && name[0] >= 'x' && name[0] <= 'z' && name[1] == '\0')
        return (sdm_ply_role)(name[0] - 'x');
    if (e->is_face && list && (is_word(name, "vertex_indices") || is_word(name, "vertex_index")))
        return SDM_PLY_CORNERS;
    return SDM_PLY_SKIPPED;
}

static sdm_status read_property(const sdm_scan *scan, char *line, sdm_ply_header *h, sdm_error *err)
{
    if (h->n_elements == 0)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: a property before any element", scan->path,
                        scan->line);
    if (h->n_properties == SDM_PLY_PROPERTIES)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s:%zu: more than %d properties", scan->path,
                        scan->line, SDM_PLY_PROPERTIES);
    sdm_ply_element *e = &h->element[h->n_elements - 1];
    sdm_ply_property p = {0};
    // "TYPE NAME" or "list COUNT_TYPE TYPE NAME"
    const char *word = sdm_scan_word(&line);
    const bool list = is_word(word, "list");
    if (list) {
        p.count_type = find_type(sdm_scan_word(&line));
        word = sdm_scan_word(&line);
    }
    p.type = find_type(word);
    const char *name = sdm_scan_word(&line);
    if (p.type == SDM_PLY_NONE ||
        (list && (p.count_type == SDM_PLY_NONE || p.count_type >= SDM_PLY_FLOAT32)) || !name)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the property's type or name cannot be read",
                        scan->path, scan->line);
    // its role, which no other property of the element may have
    p.role = find_role(e, &p, name);
    for (size_t i = 0; i < e->n && p.role != SDM_PLY_SKIPPED; i++)
        if (h->property[e->first + i].role == p.role)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: a second property '%s'", scan->path,
                            scan->line, name);
    h->property[h->n_properties++] = p;
    e->n++;
    return SDM_OK;
}

/* Demands vertices with x, y and z, and a list of corners when there are faces. */
static sdm_status check_roles(const sdm_scan *scan, const sdm_ply_header *h, sdm_error *err)
{
    unsigned found = 0;
    bool vertices = false, faces = false;
    for (size_t i = 0; i < h->n_elements; i++) {
        const sdm_ply_element *e = &h->element[i];
        vertices = vertices || e->is_vertex;
        faces = faces || e->is_face;
        for (size_t k = 0; k < e->n; k++) found |= 1u << h->property[e->first + k].role;
    }
    if (!vertices || (found & 7u) != 7u)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: no element 'vertex' with x, y and z",
                        scan->path, scan->line);
    if (faces && !(found & 1u << SDM_PLY_CORNERS))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s:%zu: the element 'face' has no list 'vertex_indices'", scan->path,
                        scan->line);
    return SDM_OK;
}

sdm_status sdm_ply_read_header(sdm_scan *scan, sdm_ply_header *h, sdm_error *err)
{
    char *line = sdm_scan_line(scan);
    if (!is_word(line ? sdm_scan_word(&line) : NULL, "ply"))
        return sdm_fail(err, SDM_E_FORMAT, "%s:1: not a PLY file", scan->path);
    bool has_format = false;
    // one keyword per line
    while ((line = sdm_scan_line(scan)) != NULL) {
        const char *word = sdm_scan_word(&line);
        sdm_status s = SDM_OK;
        if (is_word(word, "end_header")) {
            if (!has_format)
                return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the header names no format", scan->path,
                                scan->line);
            return check_roles(scan, h, err);
        }
        if (is_word(word, "format")) {
            s = read_format(scan, line, h, err);
            has_format = true;
        } else if (is_word(word, "element")) {
            s = read_element(scan, line, h, err);
        } else if (is_word(word, "property")) {
            s = read_property(scan, line, h, err);
        } else if (!is_word(word, "comment") && !is_word(word, "obj_info")) {
            s = sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is not a word of a PLY header",
                         scan->path, scan->line, word);
        }
        if (s) return s;
    }
    return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the file ends inside its header", scan->path,
                    scan->lines);
}
