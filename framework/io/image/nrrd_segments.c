/* Segments of a 3D Slicer segmentation: the keys SegmentN_Name, _ID, _LabelValue and _Layer of a
 * NRRD file. */
#include "imageparts.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/text.h"
#include "volumeparts.h"

#define SEGMENTS_MAX 1024
#define UNSTATED SIZE_MAX

/* Makes room for segment number `i`; those in between are taken out at the end where the file does
 * not name them. */
static sdm_status reserve(sdm_volume *v, size_t i, sdm_error *err)
{
    if (i < v->n_segments) return SDM_OK;
    const sdm_status e = sdm_grow((void **)&v->segments, v->n_segments, i + 1, sizeof *v->segments,
                                  "segments of an image", err);
    for (; !e && v->n_segments <= i; v->n_segments++)
        v->segments[v->n_segments] = (sdm_segment){.value = 1, .layer = UNSTATED};
    return e;
}

/* "Segment12_Name" -> 12 and "Name"; false for another key. */
static bool split(const char *key, size_t *number, const char **what)
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

sdm_status sdm_segments_take(sdm_volume *v, const sdm_stream *s, const char *key, const char *value,
                             sdm_error *err)
{
    size_t number;
    const char *what;
    if (!split(key, &number, &what)) return SDM_OK;
    if (number >= SEGMENTS_MAX)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s:%zu: segment %zu, read are the numbers below %d", s->path, s->lines,
                        number, SEGMENTS_MAX);
    const sdm_status e = reserve(v, number, err);
    if (e) return e;
    sdm_segment *g = &v->segments[number];
    int64_t n;
    if (!strcmp(what, "Name")) {
        sdm_one_line(value, g->name, sizeof g->name);
    } else if (!strcmp(what, "ID")) {
        sdm_one_line(value, g->id, sizeof g->id);
    } else if (!strcmp(what, "LabelValue")) {
        if (!sdm_parse_int(value, &g->value))
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is no label value", s->path,
                            s->lines, value);
    } else if (!strcmp(what, "Layer")) {
        if (!sdm_parse_int(value, &n) || n < 0)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is no layer", s->path, s->lines,
                            value);
        g->layer = (size_t)n;
    }
    return SDM_OK;
}

sdm_status sdm_segments_finish(sdm_volume *v, const sdm_stream *s, size_t layers, sdm_error *err)
{
    size_t kept = 0;
    for (size_t i = 0; i < v->n_segments; i++) {
        sdm_segment g = v->segments[i];
        if (!g.name[0] && !g.id[0]) continue;
        if (g.layer == UNSTATED) g.layer = i; /* older files: a layer for each segment */
        if (g.layer >= layers)
            return sdm_fail(err, SDM_E_FORMAT, "%s: segment '%s' is in layer %zu, the file has %zu",
                            s->path, g.name, g.layer, layers);
        v->segments[kept++] = g;
    }
    v->n_segments = kept;
    return SDM_OK;
}
