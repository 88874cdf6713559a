/* Writes NIfTI-1 single files (.nii): a header of 348 bytes, 4 zero bytes (no extensions), the
 * voxels; frame RAS. Names in comments are the fields of nifti1.h. */
#include "image_writers.h"

#include <math.h>

#include "sdm/internal/mat3.h"

#define NIFTI_START 352      /* offset of the first voxel */
#define NIFTI_SIZE_MAX 32767 /* sizes are int16 */
#define NIFTI_UNIT_MM 2
#define NIFTI_SCANNER 1 /* NIFTI_XFORM_SCANNER_ANAT */

/* Converts a rotation r[3][3] into a unit quaternion q = (a, b, c, d), a >= 0. Divides by the
   largest component, so that no small number is in a denominator (Shepperd 1978). */
static void quaternion(const double r[9], double q[4])
{
    const double square[4] = {1 + r[0] + r[4] + r[8], 1 + r[0] - r[4] - r[8],
                              1 - r[0] + r[4] - r[8], 1 - r[0] - r[4] + r[8]};
    int best = 0;
    for (int i = 1; i < 4; i++)
        if (square[i] > square[best]) best = i;
    const double root = sqrt(square[best]), half = 0.5 / root;
    const double x = (r[7] - r[5]) * half, y = (r[2] - r[6]) * half, z = (r[3] - r[1]) * half;
    const double xy = (r[3] + r[1]) * half, xz = (r[2] + r[6]) * half, yz = (r[7] + r[5]) * half;
    const double of[4][4] = {{0.5 * root, x, y, z},
                             {x, 0.5 * root, xy, xz},
                             {y, xy, 0.5 * root, yz},
                             {z, xz, yz, 0.5 * root}};
    for (int i = 0; i < 4; i++) q[i] = of[best][0] < 0 ? -of[best][i] : of[best][i];
}

/* Stores both transforms from voxels to the world: qform as a quaternion, sform as a matrix. A
 * reflection is in sform as it is, and in qform as qfac = -1, a reversed third axis. */
static void put_transform(uint8_t *h, const sdm_grid *g)
{
    const double flip[3] = {-1, -1, 1}; // LPS to RAS
    double r[9], adjugate[9], q[4];
    for (int i = 0; i < 9; i++) r[i] = flip[i / 3] * g->dir[i];
    for (int row = 0; row < 3; row++) {
        for (int axis = 0; axis < 3; axis++)
            sdm_put_f32(h + 280 + 16 * row + 4 * axis,
                        (float)(r[3 * row + axis] * g->spacing[axis]));
        sdm_put_f32(h + 280 + 16 * row + 12,
                    (float)(flip[row] * g->origin[row])); /* srow_x, srow_y, srow_z */
        sdm_put_f32(h + 268 + 4 * row, (float)(flip[row] * g->origin[row])); /* qoffset_x, _y, _z */
    }
    const bool mirrored = m3_adjugate(r, adjugate) < 0;
    for (int row = 0; row < 3 && mirrored; row++) r[3 * row + 2] = -r[3 * row + 2];
    quaternion(r, q);
    for (int i = 0; i < 3; i++)
        sdm_put_f32(h + 256 + 4 * i, (float)q[i + 1]); /* quatern_b, _c, _d */
    sdm_put_f32(h + 76, mirrored ? -1.0f : 1.0f);      /* pixdim[0] = qfac */
    for (int i = 0; i < 3; i++) sdm_put_f32(h + 80 + 4 * i, (float)g->spacing[i]);
    sdm_put_uint(h + 252, 2, NIFTI_SCANNER); /* qform_code */
    sdm_put_uint(h + 254, 2, NIFTI_SCANNER); /* sform_code */
}

/* Writes the description, descrip[80], without a word that does not fit: half of "alpha=0.45" would
 * be another value. */
static void put_description(uint8_t descrip[80], const char *text)
{
    char whole[512];
    sdm_one_line(text, whole, sizeof whole);
    sdm_one_line(whole, (char *)descrip, 80);
    const size_t length = strlen((const char *)descrip);
    if (whole[length] == '\0' || whole[length] == ' ') return;
    const char *space = strrchr((const char *)descrip, ' ');
    const size_t end = space ? (size_t)(space - (const char *)descrip) : length;
    memset(descrip + end, 0, 80 - end);
}

static void put_header(uint8_t h[NIFTI_START], const sdm_image *m)
{
    const sdm_grid *g = m->grid;
    const sdm_voxel_format *format = &sdm_voxel_formats[m->type];
    memset(h, 0, NIFTI_START);
    sdm_put_uint(h, 4, 348); /* sizeof_hdr */
    h[38] = 'r';             /* regular */
    sdm_put_uint(h + 40, 2, 3);
    for (int i = 0; i < 7; i++)
        sdm_put_uint(h + 42 + 2 * i, 2, i < 3 ? (uint64_t)g->n[i] : 1); /* dim */
    sdm_put_uint(h + 70, 2, (uint64_t)format->nifti);
    sdm_put_uint(h + 72, 2, 8 * format->size); /* bitpix */
    sdm_put_f32(h + 108, NIFTI_START);         /* vox_offset */
    sdm_put_f32(h + 112, 1.0f);                /* scl_slope */
    h[123] = NIFTI_UNIT_MM;
    put_description(h + 148, m->text);
    put_transform(h, g);
    memcpy(h + 344, "n+1", 4); /* magic */
}

sdm_status sdm_nifti_write(sdm_outfile *f, bool zip, const sdm_image *m, sdm_error *err)
{
    const sdm_grid *g = m->grid;
    for (int i = 0; i < 3; i++)
        if (g->n[i] > NIFTI_SIZE_MAX)
            return sdm_fail(err, SDM_E_UNSUPPORTED,
                            "%lld voxels along axis %d, NIfTI-1 takes %d: write .nrrd or .mha",
                            (long long)g->n[i], i, NIFTI_SIZE_MAX);
    sdm_sink sink;
    uint8_t header[NIFTI_START];
    put_header(header, m);
    sdm_status s = sdm_sink_open(&sink, f, zip, err);
    if (s) return s;
    s = sdm_sink_write(&sink, header, sizeof header, err);
    if (!s) s = sdm_sink_voxels(&sink, m->values, m->type, sdm_grid_count(g), err);
    if (!s) s = sdm_sink_finish(&sink, err);
    sdm_sink_free(&sink);
    return s;
}
