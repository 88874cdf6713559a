/* Reads MetaImage files (.mha, .mhd): voxels raw or compressed with zlib, in the same file or in
 * one beside the header; frame LPS. */
#include "image_readers.h"
#include "image_writers.h"
#include "sdm/internal/text.h"

/* The contents of the header lines that have been read. */
typedef struct metaimage {
    sdm_stream *in;
    sdm_image_header *h;
    sdm_volume *v;
    /* bit i: fields[i] has been read */
    uint32_t seen;
    double spacing[3];
    /* the three axis directions, one after the other */
    double matrix[9];
    /* mm per unit of length of the file */
    double unit;
    /* true: the voxels are compressed with zlib */
    bool zip;
    /* number of bytes before the voxels in a separate file; -1: the voxels are the last bytes of
       that file */
    int64_t header_bytes;
    char data_file[512];
} metaimage;

static sdm_status fail_field(const metaimage *f, sdm_status status, sdm_error *err,
                             const char *text, const char *value)
{
    return sdm_fail(err, status, "%s:%zu: %s: '%.100s'", f->in->path, f->in->lines, text, value);
}

static sdm_status take_flag(const metaimage *f, const char *value, bool *out, sdm_error *err)
{
    *out = sdm_is_listed(value, "true|t|1|yes");
    return *out || sdm_is_listed(value, "false|f|0|no")
               ? SDM_OK
               : fail_field(f, SDM_E_FORMAT, err, "need True or False", value);
}

static sdm_status take_numbers(const metaimage *f, char *value, double *out, int n, sdm_error *err)
{
    const sdm_scan place = {.path = f->in->path, .line = f->in->lines};
    return sdm_scan_reals(&place, &value, out, n, err);
}

static sdm_status take_object(metaimage *f, char *value, sdm_error *err)
{
    return sdm_is_listed(value, "image")
               ? SDM_OK
               : fail_field(f, SDM_E_UNSUPPORTED, err, "not an image", value);
}

static sdm_status take_dimensions(metaimage *f, char *value, sdm_error *err)
{
    int64_t n;
    if (!sdm_parse_int(value, &n) || n < 1)
        return fail_field(f, SDM_E_FORMAT, err, "bad number of dimensions", value);
    if (n != 3) return fail_field(f, SDM_E_UNSUPPORTED, err, "need 3 dimensions", value);
    return SDM_OK;
}

static sdm_status take_sizes(metaimage *f, char *value, sdm_error *err)
{
    const sdm_scan place = {.path = f->in->path, .line = f->in->lines};
    sdm_status s = SDM_OK;
    for (int a = 0; a < 3 && !s; a++)
        s = sdm_scan_count(&place, &value, INT32_MAX, "size", &f->h->n[a], err);
    return s;
}

static sdm_status take_type(metaimage *f, char *value, sdm_error *err)
{
    const bool prefix = !strncmp(value, "MET_", 4);
    for (int i = 0; i < SDM_N_VOXEL_TYPES && prefix; i++) {
        f->h->type = (sdm_voxel_type)i;
        if (sdm_is_listed(value + 4, sdm_voxel_formats[i].meta)) return SDM_OK;
    }
    return fail_field(f, SDM_E_UNSUPPORTED, err, "unknown type of voxels", value);
}

static sdm_status take_channels(metaimage *f, char *value, sdm_error *err)
{
    return strcmp(value, "1")
               ? fail_field(f, SDM_E_UNSUPPORTED, err, "need one number a voxel", value)
               : SDM_OK;
}

static sdm_status take_spacing(metaimage *f, char *value, sdm_error *err)
{
    return take_numbers(f, value, f->spacing, 3, err);
}

static sdm_status take_matrix(metaimage *f, char *value, sdm_error *err)
{
    return take_numbers(f, value, f->matrix, 9, err);
}

static sdm_status take_origin(metaimage *f, char *value, sdm_error *err)
{
    return take_numbers(f, value, f->h->origin, 3, err);
}

static sdm_status take_unit(metaimage *f, char *value, sdm_error *err)
{
    f->unit = sdm_is_listed(value, "?") ? 1 : sdm_length_unit(value);
    return f->unit > 0 ? SDM_OK
                       : fail_field(f, SDM_E_UNSUPPORTED, err, "unknown unit of length", value);
}

static sdm_status take_binary(metaimage *f, char *value, sdm_error *err)
{
    bool binary;
    const sdm_status s = take_flag(f, value, &binary, err);
    return s || binary ? s
                       : fail_field(f, SDM_E_UNSUPPORTED, err,
                                    "voxels written as text are not read", value);
}

static sdm_status take_order(metaimage *f, char *value, sdm_error *err)
{
    return take_flag(f, value, &f->h->big, err);
}

static sdm_status take_compressed(metaimage *f, char *value, sdm_error *err)
{
    return take_flag(f, value, &f->zip, err);
}

static sdm_status take_header_size(metaimage *f, char *value, sdm_error *err)
{
    if (sdm_parse_int(value, &f->header_bytes) && f->header_bytes >= -1) return SDM_OK;
    return fail_field(f, SDM_E_FORMAT, err, "bad size of a header", value);
}

/* A slope other than 1 or an offset other than 0 is refused: programs disagree on whether they are
 * to be applied to the voxels. */
static sdm_status take_slope(metaimage *f, char *value, sdm_error *err)
{
    double v;
    const sdm_status s = take_numbers(f, value, &v, 1, err);
    return s || v == 1 ? s
                       : fail_field(f, SDM_E_UNSUPPORTED, err,
                                    "scaled values are not read, save them as they are", value);
}

static sdm_status take_intercept(metaimage *f, char *value, sdm_error *err)
{
    double v;
    const sdm_status s = take_numbers(f, value, &v, 1, err);
    return s || v == 0 ? s
                       : fail_field(f, SDM_E_UNSUPPORTED, err,
                                    "moved values are not read, save them as they are", value);
}

static sdm_status take_comment(metaimage *f, char *value, sdm_error *err)
{
    (void)err;
    sdm_one_line(value, f->v->text, sizeof f->v->text);
    return SDM_OK;
}

static sdm_status take_data_file(metaimage *f, char *value, sdm_error *err)
{
    if (!strncmp(value, "LIST", 4) || strchr(value, '%'))
        return fail_field(f, SDM_E_UNSUPPORTED, err,
                          "voxels in a list of files are not read, join them to one", value);
    if (!*value || strlen(value) >= sizeof f->data_file)
        return fail_field(f, SDM_E_FORMAT, err, "bad name of a file", value);
    strcpy(f->data_file, value);
    return SDM_OK;
}

/* Indices of the fields that the reader looks up; those up to DATA_FILE are required. */
enum { DIMENSIONS, SIZES, TYPE, SPACING, DATA_FILE, MATRIX, ORIGIN, OTHER };

static const struct {
    const char *names;
    sdm_status (*take)(metaimage *f, char *value, sdm_error *err);
} fields[] = {[DIMENSIONS] = {"NDims", take_dimensions},
              [SIZES] = {"DimSize", take_sizes},
              [TYPE] = {"ElementType", take_type},
              [SPACING] = {"ElementSpacing", take_spacing},
              [DATA_FILE] = {"ElementDataFile", take_data_file},
              [MATRIX] = {"TransformMatrix|Rotation|Orientation", take_matrix},
              [ORIGIN] = {"Offset|Position|Origin", take_origin},
              [OTHER] = {"ObjectType", take_object},
              {"ElementNumberOfChannels", take_channels},
              {"DistanceUnits", take_unit},
              {"BinaryData", take_binary},
              {"BinaryDataByteOrderMSB", take_order},
              {"ElementByteOrderMSB", take_order},
              {"CompressedData", take_compressed},
              {"HeaderSize", take_header_size},
              {"ElementToIntensityFunctionSlope", take_slope},
              {"ElementToIntensityFunctionOffset", take_intercept},
              {"Comment", take_comment}};

static bool has_field(const metaimage *f, int field) { return f->seen >> field & 1; }

/* Reads "Key = value". Keys that are not in fields[] do not affect geometry or voxels and are
 * ignored. */
static sdm_status take_line(metaimage *f, char *line, sdm_error *err)
{
    char *equals = strchr(line, '='), *key = sdm_scan_word(&line);
    if (!equals || equals < key)
        return fail_field(f, SDM_E_FORMAT, err, "need 'Key = value'", key ? key : "");
    if (key + strlen(key) > equals) *equals = '\0'; // "Key=value": the key ends at the sign
    char *value = equals + 1 + strspn(equals + 1, " \t");
    for (size_t n = strlen(value); n > 0 && (value[n - 1] == ' ' || value[n - 1] == '\t'); n--)
        value[n - 1] = '\0';
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
        if (!sdm_is_listed(key, fields[i].names)) continue;
        if (has_field(f, (int)i)) return fail_field(f, SDM_E_FORMAT, err, "a key given twice", key);
        f->seen |= UINT32_C(1) << i;
        return fields[i].take(f, value, err);
    }
    return SDM_OK;
}

/* Reads all lines up to ElementDataFile, which ends the header. */
static sdm_status read_fields(metaimage *f, sdm_error *err)
{
    while (!has_field(f, DATA_FILE)) {
        bool more;
        sdm_status s = sdm_stream_line(f->in, &more, err);
        if (!s && !more) break;
        if (!s && f->in->line[strspn(f->in->line, " \t")]) s = take_line(f, f->in->line, err);
        if (s) return s;
    }
    for (int i = DIMENSIONS; i <= DATA_FILE; i++)
        if (!has_field(f, i))
            return sdm_fail(err, i == SPACING ? SDM_E_UNSUPPORTED : SDM_E_FORMAT,
                            "%s: the header has no key '%s'", f->in->path, fields[i].names);
    return SDM_OK;
}

sdm_status sdm_metaimage_read(sdm_stream *in, sdm_image_header *h, sdm_volume *v, sdm_error *err)
{
    metaimage f = {.in = in, .h = h, .v = v, .unit = 1, .matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    sdm_status s = read_fields(&f, err);
    if (s) return s;
    for (int row = 0; row < 3; row++) {
        for (int a = 0; a < 3; a++)
            h->step[3 * row + a] = f.unit * f.matrix[3 * a + row] * f.spacing[a];
        h->origin[row] *= f.unit;
    }
    v->placed = has_field(&f, MATRIX) && has_field(&f, ORIGIN);
    const bool local = !strcmp(f.data_file, "LOCAL");
    if (local && f.header_bytes != 0)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: 'HeaderSize' is read for voxels in a file of their own only",
                        in->path);
    if (!local) s = sdm_stream_detach(in, f.data_file, err);
    h->tail = f.header_bytes < 0 && !f.zip;
    if (!s && f.header_bytes > 0) s = sdm_stream_skip(in, (uint64_t)f.header_bytes, err);
    return s || !f.zip ? s : sdm_stream_unzip(in, err);
}
