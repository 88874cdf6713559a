/* The canvas, drawn by cairo; the only file that includes cairo's headers. */
#include "canvas.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bytes.h"
#include "drawer.h"
#include "sdm/internal/file.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "sdm/picture.h"

enum { SIDE_MAX = 16384, TEXT_MAX = 500 };

typedef enum canvas_format { FORMAT_PNG, FORMAT_SVG, FORMAT_PDF, N_FORMATS } canvas_format;

static const char *const ENDINGS[N_FORMATS] = {".png", ".svg", ".pdf"};

/* Font size over the height of a capital letter, for common sans-serif fonts. */
static const double EM_PER_CAPITAL = 1.37;

/* An image that was drawn. */
typedef struct drawn_image {
    struct drawn_image *next;
    cairo_surface_t *surface;
} drawn_image;

struct sdm_canvas {
    /* name of the file, owned by the caller */
    const char *path;
    canvas_format format;
    cairo_surface_t *surface;
    cairo_t *cr;
    sdm_outfile *file;
    /* this process is the child that draws, and ends with the canvas */
    bool in_child;
    /* SVG: the document by cairo, and the text elements to put at its end */
    sdm_text document, labels;
    /* the images of SVG and PDF files, which live as long as the surface: cairo 1.16 would copy an
     * image that it has not written yet when the image is freed, and crashes if there is no memory
     * for the copy */
    drawn_image *images;
    /* first error in drawing and writing; nothing is drawn after it */
    sdm_error error;
    /* an allocation of cairo failed */
    bool starved;
};

/* Before calls of cairo: false if there was an error and nothing may be drawn any more. */
static bool cairo_begin(const sdm_canvas *c)
{
    errno = 0;
    return !c->error.status;
}

/* After calls of cairo: notes an allocation that failed. cairo forgets some of them and leaves out
 * what it had to draw, but malloc() has set errno. */
static void cairo_end(sdm_canvas *c)
{
    if (errno != ENOMEM) return;
    c->starved = true;
    if (!c->error.status)
        sdm_fail(&c->error, SDM_E_NOMEM, "%s: out of memory for the picture", c->path);
}

/* ---- the file ---- */

/* The format of a file name; N_FORMATS: unknown ending. */
static canvas_format format_of(const char *path)
{
    int f = 0;
    while (f < N_FORMATS && !sdm_has_ext(path, ENDINGS[f])) f++;
    return (canvas_format)f;
}

sdm_status sdm_picture_check(const char *path, sdm_error *err)
{
    if (!path) return sdm_fail(err, SDM_E_ARG, "a picture without a file name");
    if (format_of(path) < N_FORMATS) return SDM_OK;
    return sdm_fail(err, SDM_E_UNSUPPORTED,
                    "%s: unknown type of picture, the name must end in .png, .svg or .pdf", path);
}

/* Receives the next bytes of the file from cairo: adds those of an SVG file to c->document, and
   writes those of other files to the output file. */
static cairo_status_t write_bytes(void *user, const unsigned char *data, unsigned size)
{
    sdm_canvas *c = user;
    if (c->format == FORMAT_SVG)
        sdm_text_add(&c->document, "%.*s", (int)size, (const char *)data);
    else if (!c->error.status)
        sdm_outfile_write(c->file, data, size, &c->error);
    if (c->document.failed) return CAIRO_STATUS_NO_MEMORY;
    return c->error.status ? CAIRO_STATUS_WRITE_ERROR : CAIRO_STATUS_SUCCESS;
}

/* Reports the first error in drawing and writing; if there was none, the error of cairo. */
static sdm_status canvas_fail(const sdm_canvas *c, cairo_status_t status, sdm_error *err)
{
    if (c->error.status) return sdm_fail(err, c->error.status, "%s", c->error.text);
    if (status == CAIRO_STATUS_NO_MEMORY)
        return sdm_fail(err, SDM_E_NOMEM, "%s: out of memory for the picture", c->path);
    return sdm_fail(err, SDM_E_INTERNAL, "%s: cairo: %s", c->path, cairo_status_to_string(status));
}

/* In the parent of a child that has drawn the picture: writes the file under its final name, or
 * removes it after an error of the child. */
static sdm_status close_drawn(sdm_canvas *c, sdm_status s, sdm_error *err)
{
    if (!s) s = sdm_outfile_commit(&c->file, err);
    sdm_outfile_discard(&c->file);
    sdm_free(c);
    return s;
}

static void create_surface(sdm_canvas *c, int w, int h)
{
    if (c->format == FORMAT_PNG) {
        c->surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, w, h);
    } else if (c->format == FORMAT_SVG) {
        c->surface = cairo_svg_surface_create_for_stream(write_bytes, c, w, h);
        cairo_svg_surface_set_document_unit(c->surface, CAIRO_SVG_UNIT_PX);
    } else {
        c->surface = cairo_pdf_surface_create_for_stream(write_bytes, c, w, h);
        // a fixed date: the same picture is the same bytes
        cairo_pdf_surface_set_metadata(c->surface, CAIRO_PDF_METADATA_CREATE_DATE,
                                       "1970-01-01T00:00:00Z");
        cairo_pdf_surface_set_metadata(c->surface, CAIRO_PDF_METADATA_CREATOR, "sdmgen");
    }
}

/* Text and lines of all pictures. */
static void set_style(cairo_t *cr)
{
    // without hinting, text has the same width in every format
    cairo_font_options_t *options = cairo_font_options_create();
    cairo_font_options_set_antialias(options, CAIRO_ANTIALIAS_GRAY);
    cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
    cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
    cairo_set_font_options(cr, options);
    cairo_font_options_destroy(options);
    // round line ends
    cairo_set_line_cap(cr, CAIRO_LINE_CAP_ROUND);
    cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
}

sdm_status sdm_canvas_create(const char *path, int w, int h, sdm_canvas **out, sdm_error *err)
{
    // name and size
    *out = NULL;
    sdm_status s = sdm_picture_check(path, err);
    if (s) return s;
    if (w < 1 || h < 1 || w > SIDE_MAX || h > SIDE_MAX)
        return sdm_fail(err, SDM_E_ARG, "picture of %d x %d pixels, need 1 to %d a side", w, h,
                        SIDE_MAX);
    // file, surface and context of cairo
    sdm_canvas *c = NULL;
    s = SDM_ALLOC(&c, 1, "picture", err);
    if (s) return s;
    c->path = path;
    c->format = format_of(path);
    s = sdm_outfile_open(path, &c->file, err);
    sdm_drawer_part part = SDM_DRAWS_ITSELF;
    if (!s) s = sdm_drawer_start(path, &part, err);
    if (part == SDM_HAS_CHILD_DRAWN) return close_drawn(c, s, err);
    c->in_child = part == SDM_DRAWS_AS_CHILD;
    if (!s) {
        cairo_begin(c);
        create_surface(c, w, h);
        c->cr = cairo_create(c->surface);
        const cairo_status_t status = cairo_status(c->cr);
        if (!status) set_style(c->cr);
        cairo_end(c);
        if (status || c->error.status) s = canvas_fail(c, status, err);
    }
    if (s && c->in_child) sdm_drawer_end(s, err);
    if (s) {
        sdm_canvas_discard(c);
        return s;
    }
    sdm_canvas_fill(c, (sdm_box){0, 0, w, h}, (sdm_colour){255, 255, 255}, 1);
    *out = c;
    return SDM_OK;
}

/* Appends the document by cairo with other ids. cairo numbers images and surfaces, "image12" and
   "surface10", by a counter of the process. Subtracting the number of the first surface makes the
   file of a picture the same whatever was drawn before. */
static void add_renumbered(sdm_text *t, const char *document)
{
    const char *first = strstr(document, "id=\"surface");
    const unsigned long base = first ? strtoul(first + strlen("id=\"surface"), NULL, 10) : 0;
    for (const char *at = document; *at;) {
        // ids follow a quotation mark or a hash sign
        size_t n = strcspn(at, "\"#");
        n += at[n] != '\0';
        sdm_text_add(t, "%.*s", (int)n, at);
        at += n;
        const int word = !strncmp(at, "image", 5) ? 5 : !strncmp(at, "surface", 7) ? 7 : 0;
        if (!word || !isdigit((unsigned char)at[word])) continue;
        char *end;
        const unsigned long number = strtoul(at + word, &end, 10);
        sdm_text_add(t, "%.*s%lu", word, at, number - base);
        at = end;
    }
}

/* Writes the SVG file: the document by cairo with the text elements before its closing tag. (cairo
 * itself draws text as outlines of glyphs, which cannot be searched or edited.) */
static sdm_status write_svg(sdm_canvas *c, sdm_error *err)
{
    static const char CLOSING[] = "</svg>";
    char *closing = c->document.data ? strstr(c->document.data, CLOSING) : NULL;
    if (!closing) return sdm_fail(err, SDM_E_INTERNAL, "%s: cairo: no closing tag", c->path);
    *closing = '\0';
    sdm_text svg = {0};
    add_renumbered(&svg, c->document.data);
    sdm_text_add(&svg, "%s%s\n", c->labels.data ? c->labels.data : "", CLOSING);
    const sdm_status s = svg.failed || c->labels.failed
                             ? canvas_fail(c, CAIRO_STATUS_NO_MEMORY, err)
                             : sdm_outfile_write(c->file, svg.data, svg.size, err);
    sdm_text_dispose(&svg);
    return s;
}

sdm_status sdm_canvas_finish(sdm_canvas *c, sdm_error *err)
{
    cairo_status_t status = cairo_status(c->cr);
    if (!status && cairo_begin(c)) {
        if (c->format == FORMAT_PNG)
            status = cairo_surface_write_to_png_stream(c->surface, write_bytes, c);
        cairo_surface_finish(c->surface);
        if (!status) status = cairo_surface_status(c->surface);
        cairo_end(c);
    }
    // cairo forgets errors of write_bytes() in PDF files
    sdm_status s = status || c->error.status ? canvas_fail(c, status, err) : SDM_OK;
    if (!s && c->format == FORMAT_SVG) s = write_svg(c, err);
    if (c->in_child) {
        if (!s) s = sdm_outfile_flush(c->file, err);
        sdm_drawer_end(s, err);
    }
    if (!s) s = sdm_outfile_commit(&c->file, err);
    sdm_canvas_discard(c);
    return s;
}

/* Frees what cairo holds. An SVG or PDF file is finished by that, which takes memory: cairo 1.16
 * crashes if there is none, so the drawing is left as it is then. */
static void free_drawing(sdm_canvas *c)
{
    const bool leave = c->starved && c->format != FORMAT_PNG;
    if (!leave) cairo_destroy(c->cr);
    if (!leave) cairo_surface_destroy(c->surface);
    for (drawn_image *image = c->images, *next; image; image = next) {
        next = image->next;
        if (!leave) cairo_surface_destroy(image->surface);
        sdm_free(image);
    }
}

void sdm_canvas_discard(sdm_canvas *c)
{
    if (!c) return;
    if (c->in_child) {
        const sdm_error none = {SDM_E_NOMEM, "no memory for the picture"};
        sdm_drawer_end(SDM_E_NOMEM, c->error.status ? &c->error : &none);
    }
    free_drawing(c);
    sdm_outfile_discard(&c->file);
    sdm_text_dispose(&c->document);
    sdm_text_dispose(&c->labels);
    sdm_free(c);
}

/* ---- drawing ---- */

static void set_colour(sdm_canvas *c, sdm_colour colour, double alpha)
{
    cairo_set_source_rgba(c->cr, colour.r / 255.0, colour.g / 255.0, colour.b / 255.0, alpha);
}

void sdm_canvas_clip(sdm_canvas *c, sdm_box box)
{
    if (!cairo_begin(c)) return;
    cairo_rectangle(c->cr, box.x, box.y, box.w, box.h);
    cairo_clip(c->cr);
    cairo_end(c);
}

void sdm_canvas_unclip(sdm_canvas *c)
{
    if (!cairo_begin(c)) return;
    cairo_reset_clip(c->cr);
    cairo_end(c);
}

void sdm_canvas_fill(sdm_canvas *c, sdm_box box, sdm_colour colour, double alpha)
{
    if (!cairo_begin(c)) return;
    set_colour(c, colour, alpha);
    cairo_rectangle(c->cr, box.x, box.y, box.w, box.h);
    cairo_fill(c->cr);
    cairo_end(c);
}

void sdm_canvas_frame(sdm_canvas *c, sdm_box box, sdm_colour colour)
{
    if (!cairo_begin(c)) return;
    set_colour(c, colour, 1);
    cairo_set_line_width(c->cr, 1);
    cairo_rectangle(c->cr, box.x - 0.5, box.y - 0.5, box.w + 1, box.h + 1);
    cairo_stroke(c->cr);
    cairo_end(c);
}

void sdm_canvas_move_to(sdm_canvas *c, double x, double y)
{
    if (!cairo_begin(c)) return;
    cairo_move_to(c->cr, x, y);
    cairo_end(c);
}

void sdm_canvas_line_to(sdm_canvas *c, double x, double y)
{
    if (!cairo_begin(c)) return;
    cairo_line_to(c->cr, x, y);
    cairo_end(c);
}

void sdm_canvas_stroke_keep(sdm_canvas *c, double width, sdm_colour colour, double alpha)
{
    if (!cairo_begin(c)) return;
    set_colour(c, colour, alpha);
    cairo_set_line_width(c->cr, width);
    cairo_stroke_preserve(c->cr);
    cairo_end(c);
}

void sdm_canvas_stroke(sdm_canvas *c, double width, sdm_colour colour)
{
    sdm_canvas_stroke_keep(c, width, colour, 1);
    if (!cairo_begin(c)) return;
    cairo_new_path(c->cr);
    cairo_end(c);
}

void sdm_canvas_line(sdm_canvas *c, double x0, double y0, double x1, double y1, double width,
                     sdm_colour colour)
{
    sdm_canvas_move_to(c, x0, y0);
    sdm_canvas_line_to(c, x1, y1);
    sdm_canvas_stroke(c, width, colour);
}

/* Keeps the image until the surface is freed, or frees it now where nothing needs it any more. */
static void image_keep(sdm_canvas *c, cairo_surface_t *image)
{
    drawn_image *kept = NULL;
    if (c->format != FORMAT_PNG && !c->error.status) SDM_ALLOC(&kept, 1, "picture", &c->error);
    if (kept) {
        *kept = (drawn_image){.next = c->images, .surface = image};
        c->images = kept;
    } else {
        cairo_surface_destroy(image);
    }
}

void sdm_canvas_image(sdm_canvas *c, sdm_box box, sdm_canvas_pixel *pixel, const void *user)
{
    if (!cairo_begin(c)) return;
    cairo_surface_t *image = cairo_image_surface_create(CAIRO_FORMAT_RGB24, box.w, box.h);
    unsigned char *data = cairo_image_surface_get_data(image);
    // out of memory: data is NULL, and c->cr takes over the error of the image
    for (int y = 0; data && y < box.h; y++) {
        uint32_t *row = (uint32_t *)(void *)(data + y * cairo_image_surface_get_stride(image));
        for (int x = 0; x < box.w; x++) {
            const sdm_colour v = pixel(user, x, y);
            row[x] = (uint32_t)v.r << 16 | (uint32_t)v.g << 8 | v.b;
        }
    }
    errno = 0; // pixel() may have set it
    cairo_surface_mark_dirty(image);
    cairo_set_source_surface(c->cr, image, box.x, box.y);
    cairo_pattern_set_filter(cairo_get_source(c->cr), CAIRO_FILTER_NEAREST);
    cairo_rectangle(c->cr, box.x, box.y, box.w, box.h);
    cairo_fill(c->cr);
    cairo_end(c);
    image_keep(c, image);
}

/* ---- text ---- */

/* Length of the UTF-8 character at s; 0 for malformed bytes, control characters and code points
 * that XML does not allow. */
static size_t character_length(const unsigned char *s)
{
    static const uint32_t FIRST[] = {0, 0x20, 0x80, 0x800, 0x10000};
    const size_t n = s[0] < 0x80       ? 1
                     : s[0] >> 5 == 6  ? 2
                     : s[0] >> 4 == 14 ? 3
                     : s[0] >> 3 == 30 ? 4
                                       : 0;
    uint32_t code = n == 1 ? s[0] : s[0] & (0x7Fu >> n);
    for (size_t i = 1; i < n; i++) {
        if ((s[i] & 0xC0) != 0x80) return 0;
        code = code << 6 | (s[i] & 0x3Fu);
    }
    const bool is_allowed = code >= FIRST[n] && !(code >= 0x7F && code < 0xA0) &&
                            !(code >= 0xD800 && code < 0xE000) && (code & 0xFFFE) != 0xFFFE &&
                            code <= 0x10FFFF;
    return is_allowed ? n : 0;
}

static void clean_text(const char *text, char out[TEXT_MAX + 4])
{
    size_t used = 0;
    while (*text && used < TEXT_MAX) {
        const size_t n = character_length((const unsigned char *)text);
        memcpy(out + used, n ? text : "?", n ? n : 1);
        used += n ? n : 1;
        text += n ? n : 1;
    }
    out[used] = '\0';
}

/* Sets the font; returns the width of the clean text. */
static double set_font(sdm_canvas *c, double size, bool bold, const char *clean)
{
    cairo_text_extents_t extents = {0};
    if (!cairo_begin(c)) return 0;
    cairo_select_font_face(c->cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                           bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(c->cr, size * EM_PER_CAPITAL);
    cairo_text_extents(c->cr, clean, &extents);
    cairo_end(c);
    return extents.x_advance;
}

double sdm_canvas_text_width(sdm_canvas *c, double size, bool bold, const char *text)
{
    char clean[TEXT_MAX + 4];
    clean_text(text, clean);
    return set_font(c, size, bold, clean);
}

/* Adds a <text> element to an SVG file; the halo is a stroke below the letters. */
static void add_label(sdm_canvas *c, double x, double y, sdm_type type, const char *clean)
{
    static const char *const ANCHORS[] = {"start", "middle", "end"};
    char at[2][32], size[32];
    sdm_text *t = &c->labels;
    sdm_text_add(t, "<text transform=\"translate(%s,%s)%s\" font-family=\"sans-serif\"",
                 sdm_format_real(x, at[0]), sdm_format_real(y, at[1]),
                 type.upwards ? " rotate(-90)" : "");
    sdm_text_add(t, " font-size=\"%s\"%s text-anchor=\"%s\" fill=\"#%02x%02x%02x\"%s>",
                 sdm_format_real(type.size * EM_PER_CAPITAL, size),
                 type.bold ? " font-weight=\"bold\"" : "", ANCHORS[type.align], type.colour.r,
                 type.colour.g, type.colour.b,
                 type.halo ? " stroke=\"#fff\" stroke-opacity=\"0.75\" stroke-width=\"3\""
                             " stroke-linejoin=\"round\" paint-order=\"stroke\""
                           : "");
    for (const char *p = clean; *p; p++) {
        const char *entity = *p == '&' ? "&amp;" : *p == '<' ? "&lt;" : *p == '>' ? "&gt;" : NULL;
        sdm_text_add(t, "%.*s", entity ? 5 : 1, entity ? entity : p);
    }
    sdm_text_add(t, "</text>\n");
}

void sdm_canvas_text(sdm_canvas *c, double x, double y, sdm_type type, const char *text)
{
    char clean[TEXT_MAX + 4];
    clean_text(text, clean);
    if (c->format == FORMAT_SVG) {
        add_label(c, x, y, type, clean);
        return;
    }
    const double left = -set_font(c, type.size, type.bold, clean) * (int)type.align / 2;
    if (!cairo_begin(c)) return;
    cairo_save(c->cr);
    cairo_translate(c->cr, x, y);
    if (type.upwards) cairo_rotate(c->cr, -acos(0));
    // the rim of the letters' outlines, then the letters
    if (type.halo) {
        cairo_move_to(c->cr, left, 0);
        cairo_text_path(c->cr, clean);
        set_colour(c, (sdm_colour){255, 255, 255}, 0.75);
        cairo_set_line_width(c->cr, 3);
        cairo_stroke(c->cr);
    }
    set_colour(c, type.colour, 1);
    cairo_move_to(c->cr, left, 0);
    cairo_show_text(c->cr, clean);
    cairo_new_path(c->cr);
    cairo_restore(c->cr);
    cairo_end(c);
}
