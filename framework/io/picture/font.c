/* Lettering for the pictures: strokes and arcs on a grid of 14 units a capital, drawn at any size.
 */
#include "canvas.h"

#include <math.h>
#include <string.h>

#define CAPITAL 14.0
#define TRACKING 0.7
#define UNIT_ANGLE (3.14159265358979323846 / 12)

/* "m x y" moves the pen, "l x y" draws a line, "a cx cy rx ry from to" an arc, anticlockwise, in
   steps of 15 degrees from the right. The base line is y = 0. */
typedef struct glyph {
    int width;
    const char *strokes;
} glyph;

static const glyph ascii[95] = {
    {6, ""},                                                     /* space */
    {4, "m2 14l2 5m2 0l2 0"},                                    /* ! */
    {7, "m2 14l2 10m5 14l5 10"},                                 /* " */
    {11, "m4 14l2 0m9 14l7 0m1 9l10 9m1 5l10 5"},                /* # */
    {11, "a6 10 4 3 2 18a6 4 4 3 -10 6m6 15l6 -1"},              /* $ */
    {14, "a4 11 3 3 0 24a10 3 3 3 0 24m11 14l3 0"},              /* % */
    {12, "m11 0l4 10l4 12l6 14l8 12l8 10l2 5l2 2l4 0l7 0l11 5"}, /* & */
    {4, "m2 14l2 10"},                                           /* ' */
    {6, "a8 6 6 11 9 15"},                                       /* ( */
    {6, "a-2 6 6 11 -3 3"},                                      /* ) */
    {8, "m4 13l4 7m1 12l7 8m7 12l1 8"},                          /* * */
    {10, "m5 10l5 2m1 6l9 6"},                                   /* + */
    {4, "m2 0l1 -3"},                                            /* , */
    {7, "m1 5l6 5"},                                             /* - */
    {4, "m2 0l2 0"},                                             /* . */
    {8, "m1 -2l7 15"},                                           /* / */
    {10, "a5 7 4 7 0 24"},                                       /* 0 */
    {10, "m2 11l6 14l6 0"},                                      /* 1 */
    {10, "a5 10 4 4 -3 11m8 7l1 0l9 0"},                         /* 2 */
    {10, "a5 11 3 3 -6 10a5 4 4 4 -10 6"},                       /* 3 */
    {10, "m7 0l7 14l1 4l10 4"},                                  /* 4 */
    {10, "m8 14l2 14l2 8a5 5 4 5 -10 9"},                        /* 5 */
    {10, "a5 4 4 4 0 24a9 4 8 10 7 12"},                         /* 6 */
    {10, "m1 14l9 14l4 0"},                                      /* 7 */
    {10, "a5 11 3 3 0 24a5 4 4 4 0 24"},                         /* 8 */
    {10, "a5 10 4 4 0 24a1 10 8 10 -5 0"},                       /* 9 */
    {4, "m2 8l2 8m2 1l2 1"},                                     /* : */
    {4, "m2 8l2 8m2 0l1 -3"},                                    /* ; */
    {10, "m9 11l1 6l9 1"},                                       /* < */
    {10, "m1 8l9 8m1 4l9 4"},                                    /* = */
    {10, "m1 11l9 6l1 1"},                                       /* > */
    {9, "a4 11 3 3 -4 11m6 8l4 6l4 4m4 0l4 0"},                  /* ? */
    {16, "a8 6 3 3 0 24m11 9l11 3l14 3a8 6 7 8 0 20"},           /* @ */
    {12, "m1 0l6 14l11 0m3 5l9 5"},                              /* A */
    {11, "m2 0l2 14l6 14a6 11 3 3 -6 6m2 8l6 8a6 4 4 4 -6 6m2 0l6 0"},
    {12, "a7 7 6 7 4 20"},
    {12, "m2 0l2 14l5 14a5 7 6 7 -6 6m2 0l5 0"},
    {10, "m9 14l2 14l2 0l9 0m2 7l8 7"},
    {10, "m9 14l2 14l2 0m2 7l8 7"},
    {14, "a7 7 6 7 4 24m13 7l8 7"},
    {13, "m2 0l2 14m11 0l11 14m2 7l11 7"},
    {4, "m2 0l2 14"},
    {9, "m7 14l7 4a4 4 3 4 12 24"},
    {11, "m2 0l2 14m10 14l2 5m5 8l10 0"},
    {9, "m2 14l2 0l8 0"},
    {14, "m2 0l2 14l7 4l12 14l12 0"},
    {13, "m2 0l2 14l11 0l11 14"},
    {14, "a7 7 6 7 0 24"},
    {11, "m2 0l2 14l6 14a6 10 4 4 -6 6m6 6l2 6"},
    {14, "a7 7 6 7 0 24m9 4l13 -1"},
    {11, "m2 0l2 14l6 14a6 10 4 4 -6 6m6 6l2 6m6 6l10 0"},
    {11, "a6 11 4 3 2 18a6 4 4 4 -10 6"},
    {12, "m1 14l11 14m6 14l6 0"},
    {12, "m2 14l2 5a6 5 4 5 12 24m10 5l10 14"},
    {12, "m1 14l6 0l11 14"},
    {16, "m1 14l4 0l8 12l12 0l15 14"},
    {11, "m1 14l10 0m10 14l1 0"},
    {12, "m1 14l6 7l11 14m6 7l6 0"},
    {11, "m1 14l10 14l1 0l10 0"}, /* Z */
    {5, "m4 15l2 15l2 -3l4 -3"},  /* [ */
    {8, "m7 -2l1 15"},
    {5, "m1 15l3 15l3 -3l1 -3"},
    {8, "m1 10l4 14l7 10"},
    {9, "m0 -3l9 -3"},
    {5, "m1 14l3 11"},
    {11, "a5 5 4 5 0 24m9 10l9 0"}, /* a */
    {11, "m2 14l2 0a6 5 4 5 0 24"},
    {9, "a5 5 4 5 3 21"},
    {11, "m9 14l9 0a5 5 4 5 0 24"},
    {10, "m1 5l9 5a5 5 4 5 0 21"},
    {7, "m3 0l3 11a6 11 3 3 6 12m1 10l6 10"},
    {11, "a5 5 4 5 0 24m9 10l9 0a5 0 4 4 14 24"},
    {11, "m2 14l2 0a5 6 3 4 0 12m8 6l8 0m2 6l2 6"},
    {4, "m2 10l2 0m2 14l2 14"},
    {5, "m3 10l3 -1a0 -1 3 3 18 24m3 14l3 14"},
    {9, "m2 14l2 0m8 10l2 4m4 6l9 0"},
    {4, "m2 14l2 0"},
    {16, "m2 10l2 0a5 7 3 3 0 12m8 7l8 0a11 7 3 3 0 12m14 7l14 0"},
    {11, "m2 10l2 0a5 6 3 4 0 12m8 6l8 0"},
    {10, "a5 5 4 5 0 24"},
    {11, "m2 10l2 -4a6 5 4 5 0 24"},
    {11, "m9 10l9 -4a5 5 4 5 0 24"},
    {8, "m2 10l2 0a6 6 4 4 5 12"},
    {9, "a5 8 3 2 2 18a5 3 3 3 -10 6"},
    {7, "m3 13l3 3a6 3 3 3 12 18m1 10l6 10"},
    {11, "m2 10l2 4a5 4 3 4 12 24m8 10l8 0"},
    {10, "m1 10l5 0l9 10"},
    {14, "m1 10l4 0l7 9l10 0l13 10"},
    {9, "m1 10l8 0m8 10l1 0"},
    {10, "m1 10l5 1m9 10l3 -4"},
    {9, "m1 10l8 10l1 0l8 0"}, /* z */
    {6, "m5 15l4 15l3 13l3 8l2 6l3 4l3 -1l4 -3l5 -3"},
    {4, "m2 15l2 -3"},
    {6, "m1 15l2 15l3 13l3 8l4 6l3 4l3 -1l2 -3l1 -3"},
    {10, "m1 5l3 7l7 5l9 7"}, /* ~ */
};

/* The few characters beyond ASCII that titles and units need. */
static const glyph *beyond_ascii(unsigned code)
{
    static const glyph degree = {6, "a3 12 2 2 0 24"},
                       plus_minus = {10, "m5 11l5 3m1 7l9 7m1 0l9 0"};
    static const glyph squared = {7, "a3 13 2 2 -2 11m5 12l1 8l5 8"}, minus = {10, "m1 6l9 6"};
    static const glyph micro = {11, "m2 10l2 -4a5 4 3 4 12 24m8 10l8 0"},
                       times = {10, "m2 9l8 3m2 3l8 9"};
    switch (code) {
    case 0xB0:
        return &degree;
    case 0xB1:
        return &plus_minus;
    case 0xB2:
        return &squared;
    case 0xB5:
        return &micro;
    case 0xD7:
        return &times;
    case 0x2013:
        return &minus;
    case 0x2212:
        return &minus;
    default:
        return &ascii['?' - ' '];
    }
}

/* Next character of a UTF-8 text; damaged sequences count as one unknown character a byte. */
static const glyph *next_glyph(const char **text)
{
    const unsigned char *p = (const unsigned char *)*text;
    unsigned code = *p;
    int more = code >= 0xF0 ? 3 : code >= 0xE0 ? 2 : code >= 0xC0 ? 1 : 0;
    if (more) code &= 0x3Fu >> more;
    (*text)++;
    for (; more > 0 && ((unsigned char)**text & 0xC0) == 0x80; more--, (*text)++)
        code = code << 6 | ((unsigned char)**text & 0x3F);
    return code >= ' ' && code < 127 ? &ascii[code - ' '] : beyond_ascii(code);
}

double sdm_text_width(double size, const char *text)
{
    double units = 0;
    while (*text) units += next_glyph(&text)->width + TRACKING;
    return (units - TRACKING) * size / CAPITAL;
}

/* Where glyph units go on the canvas. */
typedef struct pen {
    sdm_canvas *c;
    double x, y, scale, width;
    bool upwards;
} pen;

static void draw_line(const pen *p, double x0, double y0, double x1, double y1)
{
    const double s = p->scale;
    if (p->upwards)
        sdm_canvas_stroke(p->c, p->x - s * y0, p->y - s * x0, p->x - s * y1, p->y - s * x1,
                          p->width);
    else
        sdm_canvas_stroke(p->c, p->x + s * x0, p->y - s * y0, p->x + s * x1, p->y - s * y1,
                          p->width);
}

static int next_number(const char **s)
{
    int v = 0;
    while (**s == ' ') (*s)++;
    const int sign = **s == '-' ? -1 : 1;
    if (**s == '-') (*s)++;
    for (; **s >= '0' && **s <= '9'; (*s)++) v = 10 * v + (**s - '0');
    return sign * v;
}

static void draw_arc(const pen *p, const int a[6])
{
    const int steps = 3 * (a[5] - a[4]);
    double x = a[0] + a[2] * cos(a[4] * UNIT_ANGLE), y = a[1] + a[3] * sin(a[4] * UNIT_ANGLE);
    for (int i = 1; i <= steps; i++) {
        const double angle = (a[4] + i / 3.0) * UNIT_ANGLE, nx = a[0] + a[2] * cos(angle),
                     ny = a[1] + a[3] * sin(angle);
        draw_line(p, x, y, nx, ny);
        x = nx;
        y = ny;
    }
}

static void draw_glyph(const pen *p, const char *s)
{
    int at[2] = {0, 0};
    while (*s) {
        const char what = *s++;
        int v[6] = {0};
        for (int i = 0; i < (what == 'a' ? 6 : 2); i++) v[i] = next_number(&s);
        if (what == 'a') {
            draw_arc(p, v);
            continue;
        }
        if (what == 'l') draw_line(p, at[0], at[1], v[0], v[1]);
        at[0] = v[0];
        at[1] = v[1];
    }
}

static void draw_text(pen p, const char *text)
{
    while (*text) {
        const glyph *g = next_glyph(&text);
        draw_glyph(&p, g->strokes);
        const double advance = (g->width + TRACKING) * p.scale;
        if (p.upwards)
            p.y -= advance;
        else
            p.x += advance;
    }
}

void sdm_canvas_text(sdm_canvas *c, double x, double y, sdm_type type, const char *text)
{
    const double shift = sdm_text_width(type.size, text) * (int)type.align / 2;
    const double width = fmax(1.15, (type.bold ? 0.17 : 0.125) * type.size);
    pen p = {.c = c,
             .x = x,
             .y = y,
             .scale = type.size / CAPITAL,
             .width = width,
             .upwards = type.upwards};
    if (type.upwards)
        p.y += shift;
    else
        p.x -= shift;
    if (type.halo) {
        p.width = width + 3;
        draw_text(p, text);
        sdm_canvas_ink(c, (sdm_colour){255, 255, 255}, 0.75);
        p.width = width;
    }
    draw_text(p, text);
    sdm_canvas_ink(c, type.colour, 1);
}
