/* Reads image files: the ending of the name selects the reader of the header; the voxels are
 * converted to float. */
#include "sdm/volume.h"

#include <math.h>

#include "image_readers.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/text.h"

enum { BLOCK = 4096 }; // voxels decoded at a time

typedef sdm_status header_reader(sdm_stream *in, sdm_image_header *h, sdm_volume *v,
                                 sdm_error *err);

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

/* Updates the statistics of *v with values[n]. */
static void add_statistics(sdm_volume *v, const float *values, size_t n)
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

/* Sorts voxels in file order into layers. The file holds `run` voxels of layer 0, then `run` voxels
 * of layer 1, and so on, and begins again with layer 0. */
typedef struct layer_sorter {
    size_t run, layers;
    /* number of voxels of a whole layer */
    size_t count;
    /* the next voxel: its layer, its place in the run, and the number of voxels of its layer in
       earlier runs */
    size_t layer, in_run, before;
} layer_sorter;

static void sort_voxels(layer_sorter *p, const float *from, size_t n, float *values)
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

/* *total = number of voxels of all layers. Moves the stream to the first voxel when the voxels are
   at the end of the file, and compares their size in bytes with the length of the file. */
static sdm_status count_voxels(sdm_stream *in, const sdm_image_header *h, size_t count,
                               size_t *total, sdm_error *err)
{
    const size_t size = sdm_voxel_size(h->type);
    size_t n_bytes;
    if (sdm_mul(count, h->layers, total, NULL) || sdm_mul(*total, size, &n_bytes, NULL))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: the header declares more voxels than memory can hold", in->path);
    const sdm_status s = h->tail ? sdm_stream_skip_to_tail(in, n_bytes, err) : SDM_OK;
    return s ? s : sdm_stream_expect(in, n_bytes, err);
}

static sdm_status read_voxels(sdm_stream *in, const sdm_image_header *h, sdm_volume *v,
                              sdm_error *err)
{
    uint8_t bytes[8 * BLOCK];
    float block[BLOCK];
    const size_t count = sdm_grid_count(&v->grid), size = sdm_voxel_size(h->type);
    size_t total;
    sdm_status s = count_voxels(in, h, count, &total, err);
    // pages of memory are used as the voxels come: a header may declare more than there are
    void *values = NULL;
    if (!s) s = sdm_alloc_unset(&values, total, sizeof *v->values, in->path, err);
    v->values = values;
    if (s) return s;
    v->min = INFINITY;
    v->max = -INFINITY;
    layer_sorter p = {.run = h->run ? h->run : count, .layers = h->layers, .count = count};
    for (size_t done = 0; done < total && !s;) {
        const size_t n = total - done < BLOCK ? total - done : BLOCK;
        s = sdm_stream_read(in, bytes, n * size, err);
        if (s) break;
        sdm_voxels_decode(bytes, h->type, h->big, h->slope, h->intercept, n, block);
        add_statistics(v, block, n);
        sort_voxels(&p, block, n, v->values);
        done += n;
    }
    if (!s) s = sdm_stream_end(in, err);
    if (v->min > v->max) v->min = v->max = 0;
    v->checked = in->zip;
    v->detached = in->detached;
    v->n_layers = h->layers;
    v->stored = h->type;
    return s;
}

sdm_status sdm_volume_read(const char *path, sdm_volume *out, sdm_error *err)
{
    if (!path || !out) return sdm_fail(err, SDM_E_ARG, "sdm_volume_read: NULL argument");
    sdm_volume_dispose(out);
    header_reader *read_header;
    sdm_stream *in = NULL;
    sdm_image_header h = {.slope = 1, .layers = 1};
    if (!find_reader(path, &read_header)) return fail_unknown(path, err);
    sdm_status s = SDM_ALLOC(&in, 1, "buffer of an image file", err);
    if (s) return s;
    s = sdm_stream_open(in, path, err);
    if (!s) s = read_header(in, &h, out, err);
    if (!s && (s = sdm_frame_grid(&h, &out->grid, err))) s = sdm_fail_in(err, s, "%s", path);
    if (!s) s = read_voxels(in, &h, out, err);
    sdm_stream_close(in);
    sdm_free(in);
    if (s) sdm_volume_dispose(out);
    return s;
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
