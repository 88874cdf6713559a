/* Reading of images: the format follows the name, the voxels become float. */
#include "sdm/volume.h"

#include <math.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/text.h"
#include "volumeparts.h"

enum { BLOCK = 4096 }; /* voxels decoded at once */

typedef sdm_status header_reader(sdm_stream *s, sdm_image_header *h, sdm_volume *v, sdm_error *err);

static const struct {
    const char *ext;
    header_reader *read;
} known[] = {{".nii", sdm_nifti_read}, {".nii.gz", sdm_nifti_read},  {".nrrd", sdm_nrrd_read},
             {".nhdr", sdm_nrrd_read}, {".mha", sdm_metaimage_read}, {".mhd", sdm_metaimage_read}};

static bool find_reader(const char *path, header_reader **out)
{
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        *out = known[i].read;
        if (sdm_has_ext(path, known[i].ext)) return true;
    }
    return false;
}

bool sdm_volume_knows(const char *path)
{
    header_reader *reader;
    return path && find_reader(path, &reader);
}

static sdm_status fail_unknown(const char *path, sdm_error *err)
{
    if (sdm_has_ext(path, ".hdr") || sdm_has_ext(path, ".img"))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: images in pairs of files (.hdr and .img) are not read: convert it to "
                        ".nii or .nii.gz",
                        path);
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "%s: unknown type of image file, known are .nii .nii.gz .nrrd .nhdr .mha .mhd",
                    path);
}

static void survey(sdm_volume *v, const float *values, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const float x = values[i];
        if (!isfinite(x)) {
            *(isnan(x) ? &v->n_nan : &v->n_inf) += 1;
            continue;
        }
        if (x < v->min) v->min = x;
        if (x > v->max) v->max = x;
    }
}

/* Puts voxels in file order where they belong: layers take turns after every run. */
typedef struct placer {
    size_t run, layers, count;    /* count: voxels of a layer */
    size_t in_run, layer, before; /* before: voxels of earlier runs of each layer */
} placer;

static void place(placer *p, const float *from, size_t n, float *values)
{
    while (n > 0) {
        const size_t left = p->run - p->in_run, part = n < left ? n : left;
        memcpy(values + p->layer * p->count + p->before + p->in_run, from, part * sizeof *from);
        from += part;
        n -= part;
        p->in_run += part;
        if (p->in_run < p->run) continue;
        p->in_run = 0;
        if (++p->layer < p->layers) continue;
        p->layer = 0;
        p->before += p->run;
    }
}

/* *total = voxels of all layers, once the file has turned out to be of that length. */
static sdm_status count_voxels(sdm_stream *s, const sdm_image_header *h, size_t count,
                               size_t *total, sdm_error *err)
{
    const size_t size = sdm_voxel_size(h->type);
    size_t n_bytes;
    if (sdm_mul(count, h->layers, total, NULL) || sdm_mul(*total, size, &n_bytes, NULL))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: the header declares more voxels than memory can hold", s->path);
    const sdm_status e = h->tail ? sdm_stream_skip_to_tail(s, n_bytes, err) : SDM_OK;
    return e ? e : sdm_stream_expect(s, n_bytes, err);
}

static sdm_status read_voxels(sdm_stream *s, const sdm_image_header *h, sdm_volume *v,
                              sdm_error *err)
{
    uint8_t bytes[8 * BLOCK];
    float block[BLOCK];
    const size_t count = sdm_grid_count(&v->grid), size = sdm_voxel_size(h->type);
    size_t total;
    sdm_status e = count_voxels(s, h, count, &total, err);
    if (!e) e = SDM_ALLOC(&v->values, total, s->path, err);
    if (e) return e;
    v->min = INFINITY;
    v->max = -INFINITY;
    placer p = {.run = h->run ? h->run : count, .layers = h->layers, .count = count};
    for (size_t done = 0; done < total && !e;) {
        const size_t n = total - done < BLOCK ? total - done : BLOCK;
        e = sdm_stream_read(s, bytes, n * size, err);
        if (e) break;
        sdm_voxels_decode(bytes, h->type, h->big, h->slope, h->intercept, n, block);
        survey(v, block, n);
        place(&p, block, n, v->values);
        done += n;
    }
    if (!e) e = sdm_stream_end(s, err);
    if (v->min > v->max) v->min = v->max = 0;
    v->checked = s->zip;
    v->n_layers = h->layers;
    v->stored = h->type;
    return e;
}

sdm_status sdm_volume_read(const char *path, sdm_volume *out, sdm_error *err)
{
    if (!path || !out) return sdm_fail(err, SDM_E_ARG, "sdm_volume_read: NULL argument");
    sdm_volume_dispose(out);
    header_reader *read_header;
    sdm_stream *s = NULL;
    sdm_image_header h = {.slope = 1, .layers = 1};
    if (!find_reader(path, &read_header)) return fail_unknown(path, err);
    sdm_status e = SDM_ALLOC(&s, 1, "buffer of an image file", err);
    if (e) return e;
    e = sdm_stream_open(s, path, err);
    if (!e) e = read_header(s, &h, out, err);
    if (!e && (e = sdm_frame_grid(&h, &out->grid, err))) e = sdm_fail_in(err, e, "%s", path);
    if (!e) e = read_voxels(s, &h, out, err);
    sdm_stream_close(s);
    sdm_free(s);
    if (e) sdm_volume_dispose(out);
    return e;
}

void sdm_volume_dispose(sdm_volume *v)
{
    sdm_free(v->values);
    sdm_free(v->segments);
    memset(v, 0, sizeof *v);
}

sdm_status sdm_volume_find_segment(const sdm_volume *v, const char *name, const sdm_segment **out,
                                   sdm_error *err)
{
    if (!v || !name || !out)
        return sdm_fail(err, SDM_E_ARG, "sdm_volume_find_segment: NULL argument");
    for (int by_id = 0; by_id < 2; by_id++)
        for (size_t i = 0; i < v->n_segments; i++) {
            *out = &v->segments[i];
            if (!strcmp(by_id ? (*out)->id : (*out)->name, name)) return SDM_OK;
        }
    *out = NULL;
    sdm_text list = {0};
    for (size_t i = 0; i < v->n_segments; i++)
        sdm_text_add(&list, "%s'%s' (%s)", i ? ", " : "", v->segments[i].name, v->segments[i].id);
    sdm_fail(err, SDM_E_ARG, "no segment is called '%s'; the file has %s", name,
             list.data ? list.data : "none: it names no segments");
    sdm_text_dispose(&list);
    return SDM_E_ARG;
}

double sdm_length_unit(const char *name)
{
    static const struct {
        const char *names;
        double mm;
    } units[] = {{"mm|millimeter|millimetre|millimeters", 1},
                 {"um|micron|microns|micrometer|micrometre|\xC2\xB5m", 1e-3},
                 {"cm|centimeter|centimetre", 10},
                 {"m|meter|metre", 1000}};
    for (size_t i = 0; i < sizeof units / sizeof *units; i++)
        if (sdm_is_listed(name, units[i].names)) return units[i].mm;
    return 0;
}
