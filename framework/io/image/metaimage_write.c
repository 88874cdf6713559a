/* Writes MetaImage files (.mha): a text header followed by uncompressed voxels; frame LPS, mm. */
#include "image_writers.h"
#include "sdm/internal/text.h"

/* Adds "key = v[0] v[1] ...". */
static void add_vector(sdm_text *t, const char *key, const double *v, int n)
{
    char number[32];
    sdm_text_add(t, "%s =", key);
    for (int i = 0; i < n; i++) sdm_text_add(t, " %s", sdm_format_real(v[i], number));
    sdm_text_add(t, "\n");
}

static void add_header(sdm_text *t, const sdm_image *m)
{
    const sdm_grid *g = m->grid;
    const char *type = sdm_voxel_formats[m->type].meta;
    const double centre[3] = {0};
    double matrix[9]; // the three axis directions, one after the other
    for (int i = 0; i < 9; i++) matrix[i] = g->dir[3 * (i % 3) + i / 3];
    char comment[256];
    sdm_one_line(m->text, comment, sizeof comment);
    sdm_text_add(t, "ObjectType = Image\nNDims = 3\n");
    if (comment[0]) sdm_text_add(t, "Comment = %s\n", comment);
    sdm_text_add(t, "BinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n");
    add_vector(t, "TransformMatrix", matrix, 9);
    add_vector(t, "Offset", g->origin, 3);
    add_vector(t, "CenterOfRotation", centre, 3);
    add_vector(t, "ElementSpacing", g->spacing, 3);
    sdm_text_add(t, "DimSize = %lld %lld %lld\n", (long long)g->n[0], (long long)g->n[1],
                 (long long)g->n[2]);
    sdm_text_add(t, "ElementType = MET_%.*s\nElementDataFile = LOCAL\n", (int)strcspn(type, "|"),
                 type);
}

sdm_status sdm_metaimage_write(sdm_outfile *f, const sdm_image *m, sdm_error *err)
{
    sdm_text header = {0};
    sdm_sink sink;
    add_header(&header, m);
    sdm_status s =
        header.failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the header of an image") : SDM_OK;
    if (!s) s = sdm_outfile_write(f, header.data, header.size, err);
    sdm_text_dispose(&header);
    if (!s) s = sdm_sink_open(&sink, f, false, err);
    if (!s) s = sdm_sink_voxels(&sink, m->values, m->type, sdm_grid_count(m->grid), err);
    return s;
}
