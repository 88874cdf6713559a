/* Reads NIfTI-1 and NIfTI-2 single files (.nii, .nii.gz) in both byte orders; the frame comes from
 * sform, qform or the voxel sizes alone, and is RAS. */
#include <math.h>

#include "image_readers.h"
#include "image_writers.h"
#include "sdm/internal/mat3.h"

/* Bytes of a header of version 1 and of version 2. */
#define SIZE_1 348
#define SIZE_2 540
/* Largest accepted offset of the first voxel. */
#define START_MAX (1 << 30)
/* Codes of xyzt_units: metre, micrometre; everything else counts as mm. */
#define UNIT_M 1
#define UNIT_UM 3
/* Accepted excess of b^2 + c^2 + d^2 over 1: the components are rounded to float32. */
#define QUATERNION_SLACK 1e-4

/* A raw header. In the functions below, at_1 and at_2 are the byte offsets of a field in version 1
 * and in version 2. */
typedef struct nifti {
    const char *path;
    uint8_t bytes[SIZE_2];
    /* true: version 2 of the format */
    bool two;
    /* true: the file is big-endian */
    bool big;
} nifti;

/* Entry `number` of a field of reals: float32 in version 1, float64 in version 2. */
static double real_at(const nifti *f, size_t at_1, size_t at_2, size_t number)
{
    return f->two ? sdm_get_f64(f->bytes + at_2 + 8 * number, f->big)
                  : (double)sdm_get_f32(f->bytes + at_1 + 4 * number, f->big);
}

static int16_t short_at(const nifti *f, size_t at)
{
    return (int16_t)sdm_get_uint(f->bytes + at, 2, f->big);
}

/* Entry `number` of the field dim: dim[0] is the number of dimensions, dim[1], dim[2] ... are the
   sizes. */
static int64_t dim(const nifti *f, size_t number)
{
    return f->two ? (int64_t)sdm_get_uint(f->bytes + 16 + 8 * number, 8, f->big)
                  : short_at(f, 40 + 2 * number);
}

/* A field that is an int16 in version 1 and an int32 in version 2. */
static int code_at(const nifti *f, size_t at_1, size_t at_2)
{
    return f->two ? (int32_t)sdm_get_uint(f->bytes + at_2, 4, f->big) : short_at(f, at_1);
}

/* Finds version and byte order from the header size in the first four bytes, and checks the magic
 * string. */
static sdm_status read_header(sdm_stream *in, nifti *f, sdm_error *err)
{
    f->path = in->path;
    sdm_status s = sdm_stream_read(in, f->bytes, 4, err);
    if (s) return s;
    for (int big = 0; big < 2; big++) {
        const uint64_t size = sdm_get_uint(f->bytes, 4, big);
        if (size != SIZE_1 && size != SIZE_2) continue;
        f->big = big;
        f->two = size == SIZE_2;
        s = sdm_stream_read(in, f->bytes + 4, (f->two ? SIZE_2 : SIZE_1) - 4, err);
        if (s) return s;
        const uint8_t *magic = f->bytes + (f->two ? 4 : 344);
        if (!memcmp(magic, f->two ? "n+2\0\r\n\032\n" : "n+1", f->two ? 8 : 4)) return SDM_OK;
        if (!memcmp(magic, "ni1", 4) || !memcmp(magic, "ni2", 4))
            return sdm_fail(err, SDM_E_UNSUPPORTED,
                            "%s: the header of an image in a pair of files (.hdr and .img): "
                            "convert it to one .nii file",
                            f->path);
        return sdm_fail(
            err, SDM_E_FORMAT,
            "%s: not a NIfTI file: the mark 'n+%d' is missing (Analyze 7.5 is not read)", f->path,
            f->two ? 2 : 1);
    }
    return sdm_fail(err, SDM_E_FORMAT,
                    "%s: not a NIfTI file: it begins neither with 348 nor with 540", f->path);
}

static sdm_status read_sizes(const nifti *f, int64_t n[3], sdm_error *err)
{
    const int64_t n_dim = dim(f, 0);
    if (n_dim < 1 || n_dim > 7)
        return sdm_fail(err, SDM_E_FORMAT, "%s: %lld dimensions, need 1 to 7", f->path,
                        (long long)n_dim);
    if (n_dim < 3)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%s: an image of %lld dimensions, need 3", f->path,
                        (long long)n_dim);
    for (int64_t a = 0; a < n_dim; a++) {
        const int64_t size = dim(f, (size_t)a + 1);
        if (a < 3)
            n[a] = size;
        else if (size != 1)
            return sdm_fail(
                err, SDM_E_UNSUPPORTED,
                "%s: its dimension %lld has %lld entries: several images in one file, save one",
                f->path, (long long)a + 1, (long long)size);
    }
    return SDM_OK;
}

static sdm_status read_type(const nifti *f, sdm_image_header *h, sdm_error *err)
{
    const int code = short_at(f, f->two ? 12 : 70);
    h->big = f->big;
    for (int i = 0; i < SDM_N_VOXEL_TYPES; i++) {
        h->type = (sdm_voxel_type)i;
        if (sdm_voxel_formats[i].nifti == code) return SDM_OK;
    }
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "%s: voxels of NIfTI type %d, read are integers of 8 to 64 bits, float32 and "
                    "float64 (no colours, no complex "
                    "numbers)",
                    f->path, code);
}

/* Reads scl_slope and scl_inter. By the standard a slope of 0, or NaN, means unscaled values. */
static sdm_status read_scale(const nifti *f, sdm_image_header *h, sdm_error *err)
{
    const double slope = real_at(f, 112, 176, 0), intercept = real_at(f, 116, 184, 0);
    if (slope == 0 || isnan(slope)) return SDM_OK;
    if (!isfinite(slope) || !isfinite(intercept))
        return sdm_fail(err, SDM_E_FORMAT, "%s: values are scaled by %g and moved by %g", f->path,
                        slope, intercept);
    h->slope = slope;
    h->intercept = intercept;
    return SDM_OK;
}

static void use_sform(const nifti *f, sdm_image_header *h)
{
    for (size_t row = 0; row < 3; row++) {
        for (size_t a = 0; a < 3; a++)
            h->step[3 * row + a] = real_at(f, 280 + 16 * row, 400 + 32 * row, a);
        h->origin[row] = real_at(f, 280 + 16 * row, 400 + 32 * row, 3);
    }
}

static sdm_status use_qform(const nifti *f, sdm_image_header *h, sdm_error *err)
{
    double b = real_at(f, 256, 352, 0), c = real_at(f, 256, 352, 1), d = real_at(f, 256, 352, 2);
    const double square = b * b + c * c + d * d;
    if (!(square <= 1 + QUATERNION_SLACK))
        return sdm_fail(err, SDM_E_FORMAT, "%s: the quaternion (%g, %g, %g) is longer than 1",
                        f->path, b, c, d);
    const double length = square > 1 ? sqrt(square) : 1, a = sqrt(fmax(0, 1 - square));
    b /= length;
    c /= length;
    d /= length;
    const double r[9] = {1 - 2 * (c * c + d * d), 2 * (b * c - a * d),     2 * (b * d + a * c),
                         2 * (b * c + a * d),     1 - 2 * (b * b + d * d), 2 * (c * d - a * b),
                         2 * (b * d - a * c),     2 * (c * d + a * b),     1 - 2 * (b * b + c * c)};
    const double qfac = real_at(f, 76, 104, 0) < 0 ? -1 : 1;
    for (size_t i = 0; i < 9; i++)
        h->step[i] = r[i] * real_at(f, 76, 104, i % 3 + 1) * (i % 3 == 2 ? qfac : 1);
    for (size_t row = 0; row < 3; row++) h->origin[row] = real_at(f, 268, 376, row);
    return SDM_OK;
}

/* Compares sform with qform at the corners of the image. Differences of a hundredth of a voxel are
 * rounding: both are single precision. A damaged qform, which is not in use, is ignored. */
static void compare_frames(const nifti *f, const sdm_image_header *h, double mm, sdm_volume *v)
{
    sdm_image_header s = *h, q = *h;
    double most = 0, voxel = 0, adjugate[9];
    use_sform(f, &s);
    if (use_qform(f, &q, NULL)) return;
    for (int corner = 0; corner < 8; corner++) {
        double square = 0;
        for (size_t row = 0; row < 3; row++) {
            double d = s.origin[row] - q.origin[row];
            for (size_t a = 0; a < 3; a++)
                d += (corner >> a & 1) * ((double)h->n[a] - 1) *
                     (s.step[3 * row + a] - q.step[3 * row + a]);
            square += d * d;
        }
        most = fmax(most, sqrt(square));
    }
    for (size_t i = 0; i < 9; i++) voxel = fmax(voxel, fabs(s.step[i]));
    if (most > 0.01 * voxel) v->frames_differ_mm = most * mm;
    v->frames_mirrored = m3_adjugate(s.step, adjugate) * m3_adjugate(q.step, adjugate) < 0;
}

/* Reads the frame from sform, else qform, else the voxel sizes alone (methods 3, 2 and 1 of
 * nifti1.h), and converts it from RAS to LPS and to mm. Sets v->placed and what v holds about two
 * frames. */
static sdm_status read_frame(const nifti *f, sdm_image_header *h, sdm_volume *v, sdm_error *err)
{
    const bool sform = code_at(f, 254, 348) > 0, qform = code_at(f, 252, 344) > 0;
    for (size_t a = 0; a < 3 && !sform; a++) {
        const double spacing = real_at(f, 76, 104, a + 1);
        if (!(spacing > 0) || isinf(spacing))
            return sdm_fail(err, SDM_E_FORMAT,
                            "%s: voxels of %g along axis %zu, need a positive size", f->path,
                            spacing, a);
        h->step[4 * a] = spacing;
    }
    sdm_status s = SDM_OK;
    if (sform)
        use_sform(f, h);
    else if (qform)
        s = use_qform(f, h, err);
    const int unit = (f->two ? (int)sdm_get_uint(f->bytes + 500, 4, f->big) : f->bytes[123]) & 7;
    const double mm = unit == UNIT_M ? 1000 : unit == UNIT_UM ? 1e-3 : 1;
    if (sform && qform) compare_frames(f, h, mm, v);
    for (int row = 0; row < 3; row++) {
        const double sign = row < 2 ? -mm : mm;
        for (int a = 0; a < 3; a++) h->step[3 * row + a] *= sign;
        h->origin[row] *= sign;
    }
    v->placed = sform || qform;
    return s;
}

sdm_status sdm_nifti_read(sdm_stream *in, sdm_image_header *h, sdm_volume *v, sdm_error *err)
{
    nifti f = {0};
    sdm_status s = sdm_stream_is_gzip(in) ? sdm_stream_unzip(in, err) : SDM_OK;
    if (!s) s = read_header(in, &f, err);
    if (!s) s = read_sizes(&f, h->n, err);
    if (!s) s = read_type(&f, h, err);
    if (!s) s = read_scale(&f, h, err);
    if (!s) s = read_frame(&f, h, v, err);
    if (s) return s;
    char text[81] = {0};
    memcpy(text, f.bytes + (f.two ? 240 : 148), 80);
    sdm_one_line(text, v->text, sizeof v->text);
    const size_t size = f.two ? SIZE_2 : SIZE_1;
    double start =
        f.two ? (double)(int64_t)sdm_get_uint(f.bytes + 168, 8, f.big) : real_at(&f, 108, 0, 0);
    if (start == 0) start = (double)size + 4;
    if (!(start >= (double)size + 4) || start != floor(start) || start > START_MAX)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: the voxels begin at byte %g, need a whole number from %zu to %d",
                        f.path, start, size + 4, START_MAX);
    return sdm_stream_skip(in, (uint64_t)start - size, err);
}
