/* Writes 3D Slicer segmentations (.seg.nrrd): a label map with names, colours and codes of its
 * segments in the keys of the header. The keys are those of Slicer's file format, version 5. */
#include "image_writers.h"
#include "sdm/internal/text.h"

/* Colours of the segments in turn, red, green and blue. */
static const char *const colours[] = {"0.435 0.702 0.671", "0.945 0.839 0.569", "0.694 0.478 0.396",
                                      "0.435 0.722 0.824", "0.847 0.396 0.310", "0.867 0.510 0.396",
                                      "0.565 0.933 0.565", "0.753 0.408 0.345"};
enum { N_COLOURS = sizeof colours / sizeof *colours };

/* SNOMED CT 85756007, tissue: the code of Slicer for a segment of no particular kind. */
#define TISSUE                                                                                     \
    "TerminologyEntry:Segmentation category and type - 3D Slicer General Anatomy list~SCT^"        \
    "85756007^Tissue~SCT^85756007^Tissue~^^~Anatomic codes - DICOM master list~^^~^^|"

/* The box of the voxels with this label, low[3] and high[3]; false: there are none. */
static bool find_box(const sdm_grid *g, const uint8_t *labels, int64_t value, int64_t low[3],
                     int64_t high[3])
{
    bool found = false;
    for (int64_t v = 0; v < (int64_t)sdm_grid_count(g); v++) {
        if (labels[v] != value) continue;
        const int64_t at[3] = {v % g->n[0], v / g->n[0] % g->n[1], v / g->n[0] / g->n[1]};
        for (int a = 0; a < 3; a++) {
            if (!found || at[a] < low[a]) low[a] = at[a];
            if (!found || at[a] > high[a]) high[a] = at[a];
        }
        found = true;
    }
    return found;
}

static void add_segment(sdm_text *t, size_t i, const sdm_segment *s, const int64_t low[3],
                        const int64_t high[3])
{
    char name[sizeof s->name], id[sizeof s->id];
    sdm_one_line(s->name, name, sizeof name);
    sdm_one_line(s->id, id, sizeof id);
    sdm_text_add(t, "Segment%zu_Color:=%s\n", i, colours[i % N_COLOURS]);
    sdm_text_add(t, "Segment%zu_Extent:=%lld %lld %lld %lld %lld %lld\n", i, (long long)low[0],
                 (long long)high[0], (long long)low[1], (long long)high[1], (long long)low[2],
                 (long long)high[2]);
    sdm_text_add(t, "Segment%zu_ID:=%s\n", i, *id ? id : name);
    sdm_text_add(t, "Segment%zu_LabelValue:=%lld\n", i, (long long)s->value);
    sdm_text_add(t, "Segment%zu_Layer:=0\n", i);
    sdm_text_add(t, "Segment%zu_Name:=%s\n", i, name);
    sdm_text_add(t, "Segment%zu_Tags:=%s\n", i, TISSUE);
}

static sdm_status add_keys(sdm_text *t, const char *path, const sdm_grid *grid,
                           const uint8_t *labels, const sdm_segment *segments, size_t n,
                           sdm_error *err)
{
    for (size_t i = 0; i < n; i++) {
        int64_t low[3], high[3];
        if (segments[i].value < 1 || segments[i].value > UINT8_MAX)
            return sdm_fail(err, SDM_E_ARG, "%s: label %lld of segment '%s', need 1 to 255", path,
                            (long long)segments[i].value, segments[i].name);
        if (!find_box(grid, labels, segments[i].value, low, high))
            return sdm_fail(err, SDM_E_ARG,
                            "%s: no voxel belongs to the segment '%s': a segmentation without "
                            "voxels is not written",
                            path, segments[i].name);
        add_segment(t, i, &segments[i], low, high);
    }
    sdm_text_add(t, "Segmentation_ContainedRepresentationNames:=Binary labelmap|\n"
                    "Segmentation_ConversionParameters:=\n"
                    "Segmentation_MasterRepresentation:=Binary labelmap\n"
                    "Segmentation_ReferenceImageExtentOffset:=0 0 0\n");
    return t->failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the header of an image") : SDM_OK;
}

sdm_status sdm_segmentation_write(const char *path, const sdm_grid *grid, const uint8_t *labels,
                                  const sdm_segment *segments, size_t n, const char *text,
                                  sdm_error *err)
{
    if (!path || !grid || !labels || !segments || !n)
        return sdm_fail(err, SDM_E_ARG, "sdm_segmentation_write: NULL argument or no segment");
    if (!sdm_has_ext(path, ".seg.nrrd"))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: the name of a segmentation must end in .seg.nrrd", path);
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    sdm_text keys = {0};
    sdm_outfile *f = NULL;
    s = add_keys(&keys, path, grid, labels, segments, n, err);
    if (!s) s = sdm_outfile_open(path, &f, err);
    if (!s) {
        const sdm_image m = {.grid = grid,
                             .values = labels,
                             .type = SDM_VOXEL_UINT8,
                             .text = text ? text : "",
                             .keys = keys.data};
        s = sdm_nrrd_write(f, &m, err);
        if (!s)
            s = sdm_outfile_commit(&f, err);
        else
            sdm_outfile_discard(&f);
    }
    sdm_text_dispose(&keys);
    return s;
}
