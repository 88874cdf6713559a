/* Reads the segments of a 3D Slicer segmentation: the keys SegmentN_Name, _ID, _LabelValue and
 * _Layer of a NRRD file. */
#include "image_readers.h"
#include "image_writers.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/text.h"

#define SEGMENTS_MAX 1024
/* The layer of a segment before its key has been read. */
#define LAYER_UNKNOWN SIZE_MAX

/* Makes room for segments 0 .. i. sdm_segments_finish() removes those without a name and an id. */
static sdm_status reserve_segments(sdm_volume *v, size_t i, sdm_error *err)
{
    if (i < v->n_segments) return SDM_OK;
    const sdm_status s = sdm_grow((void **)&v->segments, v->n_segments, i + 1, sizeof *v->segments,
                                  "segments of an image", err);
    for (; !s && v->n_segments <= i; v->n_segments++)
        v->segments[v->n_segments] = (sdm_segment){.value = 1, .layer = LAYER_UNKNOWN};
    return s;
}

/* Splits "Segment12_Name" into 12 and "Name"; false for another key. */
static bool split_key(const char *key, size_t *number, const char **what)
{
    static const char prefix[] = "Segment";
    if (strncmp(key, prefix, sizeof prefix - 1)) return false;
    const char *p = key + sizeof prefix - 1;
    size_t n = 0, digits = 0;
    for (; p[digits] >= '0' && p[digits] <= '9' && digits < 6; digits++)
        n = 10 * n + (size_t)(p[digits] - '0');
    if (digits == 0 || p[digits] != '_') return false;
    *number = n;
    *what = p + digits + 1;
    return true;
}

sdm_status sdm_segments_take(sdm_volume *v, const sdm_stream *in, const char *key,
                             const char *value, sdm_error *err)
{
    size_t number;
    const char *what;
    if (!split_key(key, &number, &what)) return SDM_OK;
    // the segment
    if (number >= SEGMENTS_MAX)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s:%zu: segment %zu, read are the numbers below %d", in->path, in->lines,
                        number, SEGMENTS_MAX);
    const sdm_status s = reserve_segments(v, number, err);
    if (s) return s;
    sdm_segment *g = &v->segments[number];
    int64_t n;
    // its property; unknown ones are ignored
    if (!strcmp(what, "Name")) {
        sdm_one_line(value, g->name, sizeof g->name);
    } else if (!strcmp(what, "ID")) {
        sdm_one_line(value, g->id, sizeof g->id);
    } else if (!strcmp(what, "LabelValue")) {
        if (!sdm_parse_int(value, &g->value))
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is no label value", in->path,
                            in->lines, value);
    } else if (!strcmp(what, "Layer")) {
        if (!sdm_parse_int(value, &n) || n < 0)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is no layer", in->path, in->lines,
                            value);
        g->layer = (size_t)n;
    }
    return SDM_OK;
}

sdm_status sdm_segments_finish(sdm_volume *v, const sdm_stream *in, size_t layers, sdm_error *err)
{
    size_t kept = 0;
    for (size_t i = 0; i < v->n_segments; i++) {
        sdm_segment g = v->segments[i];
        if (!g.name[0] && !g.id[0]) continue;
        if (g.layer == LAYER_UNKNOWN)
            g.layer = i; // older files have a layer for each segment and no key
        if (g.layer >= layers)
            return sdm_fail(err, SDM_E_FORMAT, "%s: segment '%s' is in layer %zu, the file has %zu",
                            in->path, g.name, g.layer, layers);
        v->segments[kept++] = g;
    }
    v->n_segments = kept;
    return SDM_OK;
}
