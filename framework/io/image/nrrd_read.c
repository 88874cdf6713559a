/* Reads NRRD files (.nrrd, .seg.nrrd, .nhdr): voxels raw or compressed with gzip, in the same file
 * or in one beside the header; frames LPS, RAS and LAS. */
#include <math.h>

#include "image_readers.h"
#include "image_writers.h"
#include "sdm/internal/text.h"

enum { AXES_MAX = 4 };

/* The contents of the header lines that have been read. Axes are numbered as in the file. */
typedef struct nrrd {
    sdm_stream *in;
    sdm_image_header *h;
    sdm_volume *v;
    /* bit i: fields[i] has been read */
    uint32_t seen;
    /* number of axes; 0: not read yet */
    int axes;
    int64_t size[AXES_MAX];
    double spacing[AXES_MAX];
    /* vector from a voxel to the next along each axis, in the space of the file */
    double step[AXES_MAX][3];
    /* true: the axis has a direction in space; an axis without a direction counts layers or
       channels */
    bool in_space[AXES_MAX];
    /* factors from the space of the file to LPS in mm */
    double scale[3];
    bool gzip;
    /* lines and bytes to skip before the voxels; skip_bytes = -1: the voxels are the last bytes of
       the file */
    int64_t skip_lines, skip_bytes;
    char data_file[512];
} nrrd;

static sdm_status fail_field(const nrrd *f, sdm_status status, sdm_error *err, const char *text,
                             const char *value)
{
    return sdm_fail(err, status, "%s:%zu: %s: '%.100s'", f->in->path, f->in->lines, text, value);
}

static sdm_status take_dimension(nrrd *f, char *value, sdm_error *err)
{
    int64_t n;
    if (!sdm_parse_int(value, &n) || n < 1 || n > 16)
        return fail_field(f, SDM_E_FORMAT, err, "bad dimension", value);
    if (n != 3 && n != 4)
        return fail_field(f, SDM_E_UNSUPPORTED, err, "need 3 dimensions (or 4 for a segmentation)",
                          value);
    f->axes = (int)n;
    return SDM_OK;
}

static sdm_status take_type(nrrd *f, char *value, sdm_error *err)
{
    const size_t n = strlen(value);
    if (n > 2 && !strcmp(value + n - 2, "_t")) value[n - 2] = '\0';
    for (int i = 0; i < SDM_N_VOXEL_TYPES; i++) {
        f->h->type = (sdm_voxel_type)i;
        if (sdm_is_listed(value, sdm_voxel_formats[i].nrrd)) return SDM_OK;
    }
    return fail_field(f, SDM_E_UNSUPPORTED, err, "unknown type of voxels", value);
}

static sdm_status need_axes(const nrrd *f, const char *field, sdm_error *err)
{
    if (f->axes > 0) return SDM_OK;
    return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%s' comes before 'dimension'", f->in->path,
                    f->in->lines, field);
}

static sdm_status take_sizes(nrrd *f, char *value, sdm_error *err)
{
    sdm_status s = need_axes(f, "sizes", err);
    const sdm_scan place = {.path = f->in->path, .line = f->in->lines};
    for (int a = 0; a < f->axes && !s; a++)
        s = sdm_scan_count(&place, &value, INT32_MAX, "size", &f->size[a], err);
    if (!s && sdm_scan_word(&value))
        s = sdm_fail(err, SDM_E_FORMAT, "%s:%zu: more than %d sizes", f->in->path, f->in->lines,
                     f->axes);
    return s;
}

/* A spacing of "nan" marks an axis that has no spacing. */
static sdm_status take_spacings(nrrd *f, char *value, sdm_error *err)
{
    const sdm_status s = need_axes(f, "spacings", err);
    for (int a = 0; a < f->axes && !s; a++) {
        const char *word = sdm_scan_word(&value);
        if (!word || (!sdm_is_listed(word, "nan") && !sdm_parse_real(word, &f->spacing[a])))
            return fail_field(f, SDM_E_FORMAT, err, "bad spacing", word ? word : "");
    }
    return s;
}

static sdm_status take_space(nrrd *f, char *value, sdm_error *err)
{
    static const struct {
        const char *names;
        double x, y;
    } known[] = {{"left-posterior-superior|LPS", 1, 1},
                 {"right-anterior-superior|RAS", -1, -1},
                 {"left-anterior-superior|LAS", 1, -1}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (sdm_is_listed(value, known[i].names)) {
            f->scale[0] *= known[i].x;
            f->scale[1] *= known[i].y;
            f->v->placed = true;
            return SDM_OK;
        }
    return fail_field(
        f, SDM_E_UNSUPPORTED, err,
        "need the space left-posterior-superior, right-anterior-superior or left-anterior-superior",
        value);
}

static sdm_status take_space_dimension(nrrd *f, char *value, sdm_error *err)
{
    return strcmp(value, "3")
               ? fail_field(f, SDM_E_UNSUPPORTED, err, "need a space of 3 dimensions", value)
               : SDM_OK;
}

/* Reads three units in quotes: "mm" "mm" "mm". An empty unit or "???" (unknown) counts as mm. */
static sdm_status take_units(nrrd *f, char *value, sdm_error *err)
{
    for (int row = 0; row < 3; row++) {
        char *open = strchr(value, '"'), *close = open ? strchr(open + 1, '"') : NULL;
        if (!close)
            return fail_field(f, SDM_E_FORMAT, err, "need three space units in quotes", value);
        *close = '\0';
        const double mm = open[1] && strcmp(open + 1, "???") ? sdm_length_unit(open + 1) : 1;
        if (mm == 0)
            return fail_field(f, SDM_E_UNSUPPORTED, err, "unknown unit of length", open + 1);
        f->scale[row] *= mm;
        value = close + 1;
    }
    return SDM_OK;
}

/* Reads "(x,y,z)" at *at, and moves *at behind it. With `given` not NULL, "none" is allowed too and
 * sets *given to false. */
static sdm_status take_vector(const nrrd *f, char **at, double v[3], bool *given, sdm_error *err)
{
    char *p = *at + strspn(*at, " \t");
    if (given) *given = strncmp(p, "none", 4) != 0;
    if (given && !*given) {
        *at = p + 4;
        return SDM_OK;
    }
    char *open = p, *close = strchr(p, ')');
    if (*open != '(' || !close)
        return fail_field(f, SDM_E_FORMAT, err, "need a vector like (1,0,0)", p);
    *close = '\0';
    for (int i = 0; i < 3; i++) {
        char *comma = strchr(++open, ',');
        if (!comma != (i == 2))
            return fail_field(f, SDM_E_FORMAT, err, "need a vector of three numbers", p);
        if (comma) *comma = '\0';
        char *rest = open, *word = sdm_scan_word(&rest);
        if (!word || sdm_scan_word(&rest) || !sdm_parse_real(word, &v[i]))
            return fail_field(f, SDM_E_FORMAT, err, "not a finite number in a vector",
                              word ? word : "");
        open = comma;
    }
    *at = close + 1;
    return SDM_OK;
}

static sdm_status take_directions(nrrd *f, char *value, sdm_error *err)
{
    sdm_status s = need_axes(f, "space directions", err);
    for (int a = 0; a < f->axes && !s; a++)
        s = take_vector(f, &value, f->step[a], &f->in_space[a], err);
    return s;
}

static sdm_status take_origin(nrrd *f, char *value, sdm_error *err)
{
    return take_vector(f, &value, f->h->origin, NULL, err);
}

static sdm_status take_endian(nrrd *f, char *value, sdm_error *err)
{
    if (!sdm_is_listed(value, "little|big"))
        return fail_field(f, SDM_E_FORMAT, err, "need endian little or big", value);
    f->h->big = sdm_is_listed(value, "big");
    return SDM_OK;
}

static sdm_status take_encoding(nrrd *f, char *value, sdm_error *err)
{
    f->gzip = sdm_is_listed(value, "gzip|gz");
    if (f->gzip || sdm_is_listed(value, "raw")) return SDM_OK;
    return fail_field(f, SDM_E_UNSUPPORTED, err,
                      "need the encoding raw or gzip, save it as one of them", value);
}

static sdm_status take_content(nrrd *f, char *value, sdm_error *err)
{
    (void)err;
    sdm_one_line(value, f->v->text, sizeof f->v->text);
    return SDM_OK;
}

static sdm_status take_data_file(nrrd *f, char *value, sdm_error *err)
{
    if (!strncmp(value, "LIST", 4) || strchr(value, '%'))
        return fail_field(f, SDM_E_UNSUPPORTED, err,
                          "voxels in a list of files are not read, join them to one", value);
    if (strlen(value) >= sizeof f->data_file)
        return fail_field(f, SDM_E_FORMAT, err, "too long a name", value);
    strcpy(f->data_file, value);
    return SDM_OK;
}

static sdm_status take_skip_lines(nrrd *f, char *value, sdm_error *err)
{
    if (sdm_parse_int(value, &f->skip_lines) && f->skip_lines >= 0) return SDM_OK;
    return fail_field(f, SDM_E_FORMAT, err, "bad number of lines to skip", value);
}

static sdm_status take_skip_bytes(nrrd *f, char *value, sdm_error *err)
{
    if (sdm_parse_int(value, &f->skip_bytes) && f->skip_bytes >= -1) return SDM_OK;
    return fail_field(f, SDM_E_FORMAT, err, "bad number of bytes to skip", value);
}

/* Indices of the fields that the reader looks up; those up to ENDIAN are required. */
enum { DIMENSION, TYPE, SIZES, ENCODING, ENDIAN, SPACINGS, DIRECTIONS, ORIGIN, OTHER };

static const struct {
    const char *names;
    sdm_status (*take)(nrrd *f, char *value, sdm_error *err);
} fields[] = {[DIMENSION] = {"dimension", take_dimension},
              [TYPE] = {"type", take_type},
              [SIZES] = {"sizes", take_sizes},
              [ENCODING] = {"encoding", take_encoding},
              [ENDIAN] = {"endian", take_endian},
              [SPACINGS] = {"spacings", take_spacings},
              [DIRECTIONS] = {"space directions", take_directions},
              [ORIGIN] = {"space origin", take_origin},
              [OTHER] = {"space", take_space},
              {"space dimension", take_space_dimension},
              {"space units", take_units},
              {"content", take_content},
              {"data file|datafile", take_data_file},
              {"line skip|lineskip", take_skip_lines},
              {"byte skip|byteskip", take_skip_bytes}};

static bool has_field(const nrrd *f, int field) { return f->seen >> field & 1; }

/* Reads "field: value" or "key:=value". Fields that are not in fields[] do not affect geometry or
 * voxels and are ignored. */
static sdm_status take_line(nrrd *f, char *line, sdm_error *err)
{
    char *colon = strchr(line, ':');
    if (line[0] == '#') return SDM_OK;
    if (!colon || (colon[1] != ' ' && colon[1] != '=' && colon[1] != '\0'))
        return fail_field(f, SDM_E_FORMAT, err, "need 'field: value' or 'key:=value'", line);
    *colon = '\0';
    char *value = colon + 1;
    if (*value == '=') return sdm_segments_take(f->v, f->in, line, value + 1, err);
    value += strspn(value, " \t");
    for (size_t n = strlen(value); n > 0 && (value[n - 1] == ' ' || value[n - 1] == '\t'); n--)
        value[n - 1] = '\0';
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
        if (!sdm_is_listed(line, fields[i].names)) continue;
        if (has_field(f, (int)i))
            return fail_field(f, SDM_E_FORMAT, err, "a field given twice", line);
        f->seen |= UINT32_C(1) << i;
        return fields[i].take(f, value, err);
    }
    return SDM_OK;
}

static sdm_status read_fields(nrrd *f, sdm_error *err)
{
    bool more;
    sdm_status s = sdm_stream_line(f->in, &more, err);
    if (s) return s;
    if (!more || strncmp(f->in->line, "NRRD000", 7) || f->in->line[7] < '1' ||
        f->in->line[7] > '5' || f->in->line[8])
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: not a NRRD file: the first line is not NRRD0001 to NRRD0005",
                        f->in->path);
    for (;;) {
        s = sdm_stream_line(f->in, &more, err);
        if (s || !more || !f->in->line[0])
            break; // an empty line, or for a separate header the end of the file
        s = take_line(f, f->in->line, err);
        if (s) return s;
    }
    return s;
}

/* Demands the required fields (the byte order only for voxels of several bytes), and a field that
   states the size of the voxels. */
static sdm_status check_fields(const nrrd *f, sdm_error *err)
{
    for (int i = DIMENSION; i <= ENDIAN; i++)
        if (!has_field(f, i) && !(i == ENDIAN && sdm_voxel_size(f->h->type) == 1))
            return sdm_fail(err, SDM_E_FORMAT, "%s: the header has no field '%s'", f->in->path,
                            fields[i].names);
    if (!has_field(f, DIRECTIONS) && (!has_field(f, SPACINGS) || f->axes == 4))
        return sdm_fail(
            err, SDM_E_UNSUPPORTED,
            "%s: the header does not state the size of the voxels ('space directions'%s)",
            f->in->path, f->axes == 4 ? "" : " or 'spacings'");
    return SDM_OK;
}

/* Copies the geometry of the three axes in space to the header; an axis without a direction counts
 * the layers. */
static sdm_status set_axes(nrrd *f, sdm_error *err)
{
    sdm_image_header *h = f->h;
    int in_space = 0, layer_axis = -1;
    for (int a = 0; a < f->axes; a++) {
        // an axis without a direction: layers
        if (has_field(f, DIRECTIONS) && !f->in_space[a]) {
            if (f->size[a] < 1)
                return sdm_fail(err, SDM_E_FORMAT, "%s: axis %d has no entries", f->in->path, a);
            layer_axis = a;
            h->layers = (size_t)f->size[a];
            h->run = 1;
            for (int b = 0; b < a; b++) h->run *= (size_t)f->size[b];
            continue;
        }
        // an axis in space
        if (in_space == 3) break;
        for (int row = 0; row < 3; row++) {
            const double step = has_field(f, DIRECTIONS) ? f->step[a][row]
                                : row == a               ? f->spacing[a]
                                                         : 0;
            h->step[3 * row + in_space] = f->scale[row] * step;
        }
        h->n[in_space++] = f->size[a];
    }
    // need exactly three axes in space, and a fourth axis must count layers
    if (in_space != 3 || (f->axes == 4 && layer_axis < 0))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: need three axes with a direction in space (and one 'none' of four)",
                        f->in->path);
    for (int row = 0; row < 3; row++) h->origin[row] *= f->scale[row];
    f->v->placed = f->v->placed && has_field(f, DIRECTIONS) && has_field(f, ORIGIN);
    return SDM_OK;
}

/* Moves the stream to the first voxel. */
static sdm_status find_voxels(nrrd *f, sdm_error *err)
{
    sdm_stream *in = f->in;
    if (f->gzip && (f->skip_lines || f->skip_bytes))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: 'line skip' and 'byte skip' are read with the encoding raw only",
                        in->path);
    sdm_status s = f->data_file[0] ? sdm_stream_detach(in, f->data_file, err) : SDM_OK;
    bool more = true;
    for (int64_t i = 0; i < f->skip_lines && more && !s; i++) s = sdm_stream_line(in, &more, err);
    if (!s && f->gzip) return sdm_stream_unzip(in, err);
    if (!s && f->skip_bytes > 0) s = sdm_stream_skip(in, (uint64_t)f->skip_bytes, err);
    f->h->tail = f->skip_bytes < 0;
    return s;
}

sdm_status sdm_nrrd_read(sdm_stream *in, sdm_image_header *h, sdm_volume *v, sdm_error *err)
{
    nrrd f = {.in = in, .h = h, .v = v, .scale = {1, 1, 1}, .spacing = {NAN, NAN, NAN, NAN}};
    sdm_status s = read_fields(&f, err);
    if (!s) s = check_fields(&f, err);
    if (!s) s = set_axes(&f, err);
    if (!s) s = sdm_segments_finish(v, in, h->layers, err);
    if (!s && h->layers > 1 && v->n_segments == 0)
        s = sdm_fail(err, SDM_E_UNSUPPORTED,
                     "%s: %zu images (or numbers a voxel) in one file, save one", in->path,
                     h->layers);
    return s ? s : find_voxels(&f, err);
}
