/* Inside of the pictures: an RGB canvas with antialiased strokes and text, PNG output, colour maps,
 * axis ticks. */
#ifndef SDM_IO_CANVAS_H
#define SDM_IO_CANVAS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

typedef struct sdm_colour {
    uint8_t r, g, b;
} sdm_colour;

/* Pixels are squares: (0, 0) is the upper left corner of the first one. Strokes are gathered in a
   mask, so that strokes that overlap do not add up, and inked together. */
typedef struct sdm_canvas {
    int w, h;
    uint8_t *rgb;  /* [h][w][3] */
    uint8_t *mask; /* [h][w], coverage */
    int clip[4];   /* x0, y0, x1, y1: nothing is drawn outside */
    int dirty[4];  /* box of the mask in use */
} sdm_canvas;

/* A white canvas. SDM_E_ARG over 16384 pixels a side. */
sdm_status sdm_canvas_create(sdm_canvas *c, int w, int h, sdm_error *err);
void sdm_canvas_dispose(sdm_canvas *c);

void sdm_canvas_clip(sdm_canvas *c, int x, int y, int w, int h);
void sdm_canvas_unclip(sdm_canvas *c);
void sdm_canvas_box(sdm_canvas *c, int x, int y, int w, int h, sdm_colour colour, double alpha);
/* One pixel wide outline just outside the box. */
void sdm_canvas_frame(sdm_canvas *c, int x, int y, int w, int h, sdm_colour colour);
void sdm_canvas_stroke(sdm_canvas *c, double x0, double y0, double x1, double y1, double width);
void sdm_canvas_ink(sdm_canvas *c, sdm_colour colour, double alpha);

typedef enum sdm_align { SDM_LEFT = 0, SDM_CENTRE = 1, SDM_RIGHT = 2 } sdm_align;

/* How text is set: height of capitals in pixels, alignment at the point, upwards instead of to the
 * right. */
typedef struct sdm_type {
    double size;
    sdm_align align;
    bool upwards;
    bool bold;
    sdm_colour colour;
    bool halo; /* a white rim, for text on an image */
} sdm_type;

/* UTF-8; characters without a glyph become '?'. (x, y): on the base line. */
void sdm_canvas_text(sdm_canvas *c, double x, double y, sdm_type type, const char *text);
double sdm_text_width(double size, const char *text);

/* 8-bit RGB, atomic. */
sdm_status sdm_png_write(const char *path, const sdm_canvas *c, sdm_error *err);

typedef enum sdm_colour_map {
    SDM_MAP_DISTANCE, /* diverging, orange inside (below 0), blue outside */
    SDM_MAP_ERROR,    /* sequential, dark to light */
    SDM_MAP_SIGNED,   /* diverging, green below 0, magenta above */
    SDM_MAP_GREY      /* black to white */
} sdm_colour_map;

/* Colour of `value` where the map spans low .. high; the diverging maps are white at 0 and take low
   < 0 < high. Grey for NaN. */
sdm_colour sdm_map_colour(sdm_colour_map map, double low, double high, double value);

/* Round tick positions: the first multiple of *step in low .. high and how many there are, about
 * `wanted` of them. */
int sdm_ticks(double low, double high, int wanted, double *first, double *step);
/* A tick's number with the decimals its step needs; buf has 32 bytes. */
const char *sdm_tick_text(double value, double step, char buf[32]);

#endif
