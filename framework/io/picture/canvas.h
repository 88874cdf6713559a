/* Drawing into a PNG, SVG or PDF file: filled boxes, stroked paths, text and images. Colour maps
 * and axis ticks.
 *
 * Lengths are in pixels; (0, 0) is the upper left corner, y points down. Functions without a status
 * remember the first error for sdm_canvas_finish(). */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

typedef struct sdm_colour {
    uint8_t r, g, b;
} sdm_colour;

typedef struct sdm_box {
    int x, y, w, h;
} sdm_box;

/* A picture in the making, of one thread. */
typedef struct sdm_canvas sdm_canvas;

/* A white canvas for the file `path`, which must stay valid until sdm_canvas_finish(). SDM_E_ARG
   for a side of more than 16384 pixels; SDM_E_UNSUPPORTED for an unknown ending; SDM_E_IO. *out =
   NULL: the call has returned a second time, after a child process has drawn the picture
   (drawer.h), and the file is complete, or the error is that of the child. The child returns from
   no call of sdm_canvas_finish() or sdm_canvas_discard(). */
sdm_status sdm_canvas_create(const char *path, int w, int h, sdm_canvas **out, sdm_error *err);

/* Writes the file under its final name, frees the canvas in every case, and returns the first error
 * of everything that was drawn. */
sdm_status sdm_canvas_finish(sdm_canvas *c, sdm_error *err);

/* Frees the canvas and leaves no file. NULL is fine. */
void sdm_canvas_discard(sdm_canvas *c);

/* Restricts drawing to the box. No text may be drawn before sdm_canvas_unclip(). */
void sdm_canvas_clip(sdm_canvas *c, sdm_box box);
void sdm_canvas_unclip(sdm_canvas *c);

/* Fills the box; alpha: 0 transparent .. 1 opaque. */
void sdm_canvas_fill(sdm_canvas *c, sdm_box box, sdm_colour colour, double alpha);
/* Draws an outline of one pixel just outside the box. */
void sdm_canvas_frame(sdm_canvas *c, sdm_box box, sdm_colour colour);

/* Add to the path: move to the start of a line, then draw to its further points. Line ends are
 * round, so a line of length 0 is a dot. */
void sdm_canvas_move_to(sdm_canvas *c, double x, double y);
void sdm_canvas_line_to(sdm_canvas *c, double x, double y);
/* Strokes the path and keeps it, for a second stroke on top. Where the path crosses itself, alpha
 * does not add up. */
void sdm_canvas_stroke_keep(sdm_canvas *c, double width, sdm_colour colour, double alpha);
/* Strokes the path, opaque, and starts a new one. */
void sdm_canvas_stroke(sdm_canvas *c, double width, sdm_colour colour);
/* Strokes one line. */
void sdm_canvas_line(sdm_canvas *c, double x0, double y0, double x1, double y1, double width,
                     sdm_colour colour);

/* The colour of pixel (x, y) of an image, 0 <= x < w, 0 <= y < h. */
typedef sdm_colour sdm_canvas_pixel(const void *user, int x, int y);

/* Fills the box with an image of box.w x box.h pixels. */
void sdm_canvas_image(sdm_canvas *c, sdm_box box, sdm_canvas_pixel *pixel, const void *user);

typedef enum sdm_align { SDM_LEFT = 0, SDM_CENTRE = 1, SDM_RIGHT = 2 } sdm_align;

typedef struct sdm_type {
    /* height of capital letters */
    double size;
    /* which point of the text lies at (x, y) */
    sdm_align align;
    /* true: the text runs upwards instead of to the right */
    bool upwards;
    bool bold;
    sdm_colour colour;
    /* true: the text has a white rim, for text on an image */
    bool halo;
} sdm_type;

/* Draws UTF-8 text with its base line at (x, y). Malformed bytes and control characters become '?';
 * the text is cut after 500 bytes. */
void sdm_canvas_text(sdm_canvas *c, double x, double y, sdm_type type, const char *text);
/* Width of text whose capital letters are `size` high. */
double sdm_canvas_text_width(sdm_canvas *c, double size, bool bold, const char *text);

typedef enum sdm_colour_map {
    SDM_MAP_DISTANCE, /* diverging: orange below 0 (inside), blue above */
    SDM_MAP_ERROR,    /* sequential, dark to light */
    SDM_MAP_SIGNED,   /* diverging: green below 0, magenta above */
    SDM_MAP_GREY      /* black to white */
} sdm_colour_map;

/* Colour of `value` in a map that spans low .. high; values outside get the colour of the nearer
   end, NaN and infinities grey. The diverging maps are white at 0 and need low < 0 < high. */
sdm_colour sdm_map_colour(sdm_colour_map map, double low, double high, double value);

/* Finds round tick positions *first + i * *step in low .. high, about `wanted` of them, with a step
   of 1, 2 or 5 times a power of ten. Returns the number of ticks. */
int sdm_ticks(double low, double high, int wanted, double *first, double *step);
/* Writes the number of a tick to buf, with as many decimals as `step` needs, and returns buf. */
const char *sdm_tick_text(double value, double step, char buf[32]);
