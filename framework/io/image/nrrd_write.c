/* Writes NRRD files (.nrrd): a text header followed by the voxels, compressed with gzip; frame
 * left-posterior-superior, mm. */
#include "image_writers.h"
#include "sdm/internal/text.h"

/* Adds "(x,y,z)". */
static void add_vector(sdm_text *t, const double v[3])
{
    char x[32], y[32], z[32];
    sdm_text_add(t, "(%s,%s,%s)", sdm_format_real(v[0], x), sdm_format_real(v[1], y),
                 sdm_format_real(v[2], z));
}

static void add_header(sdm_text *t, const sdm_image *m)
{
    const sdm_grid *g = m->grid;
    const char *type = sdm_voxel_formats[m->type].nrrd;
    char content[256];
    sdm_one_line(m->text, content, sizeof content);
    sdm_text_add(t, "NRRD0005\n");
    if (content[0]) sdm_text_add(t, "content: %s\n", content);
    sdm_text_add(t, "type: %.*s\ndimension: 3\nspace: left-posterior-superior\n",
                 (int)strcspn(type, "|"), type);
    sdm_text_add(t, "sizes: %lld %lld %lld\nspace directions:", (long long)g->n[0],
                 (long long)g->n[1], (long long)g->n[2]);
    for (int axis = 0; axis < 3; axis++) {
        double step[3];
        for (int row = 0; row < 3; row++) step[row] = g->dir[3 * row + axis] * g->spacing[axis];
        sdm_text_add(t, " ");
        add_vector(t, step);
    }
    sdm_text_add(t, "\nkinds: domain domain domain\nendian: little\nencoding: gzip\nspace units: "
                    "\"mm\" \"mm\" \"mm\"\n");
    sdm_text_add(t, "space origin: ");
    add_vector(t, g->origin);
    sdm_text_add(t, "\n%s\n", m->keys ? m->keys : "");
}

sdm_status sdm_nrrd_write(sdm_outfile *f, const sdm_image *m, sdm_error *err)
{
    sdm_text header = {0};
    sdm_sink sink;
    add_header(&header, m);
    sdm_status s =
        header.failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the header of an image") : SDM_OK;
    if (!s) s = sdm_outfile_write(f, header.data, header.size, err);
    sdm_text_dispose(&header);
    if (!s) s = sdm_sink_open(&sink, f, true, err);
    if (s) return s;
    s = sdm_sink_voxels(&sink, m->values, m->type, sdm_grid_count(m->grid), err);
    if (!s) s = sdm_sink_finish(&sink, err);
    sdm_sink_free(&sink);
    return s;
}
