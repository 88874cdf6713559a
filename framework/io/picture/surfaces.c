/* Pictures of surfaces: shaded orthographic views, rendered with a depth buffer and coloured by a
 * value at each vertex. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "panel.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"
#include "sdm/picture.h"

/* Limits, and lengths in pixels. */
enum {
    SURFACES_MAX = 8,
    GALLERY_MAX = 16,
    N_VIEWS = 2,
    OBLIQUE = 1,    /* index of the view of a gallery */
    FAN_MAX = 1000, /* a vertex of more triangles has no mean normal */
    FINE = 3,       /* samples along each side of a pixel */
    N_SHADES = 255,
    MIDDLE = N_SHADES / 2, /* index of the colour of 0 */
    PANEL = 400,           /* pixels of the longer side of the largest view */
    SIDE = 20,
    TOP = 46,
    GAP = 20,
    BAR = 14,
    FOOT = 64, /* colour bars with numbers and caption */
    NOTE = 22  /* the line about back sides */
};

/* The colour of back sides in a gallery. */
static const sdm_colour BACK = {220, 50, 32};

/* A direction of view: axis[0] points to the right, axis[1] upwards, axis[2] to the viewer. */
typedef struct view {
    const char *name;
    double axis[3][3];
} view;

/* From above, and from the front at an elevation of 30 degrees, 30 degrees to the side. */
static const view VIEWS[N_VIEWS] = {
    {"from +z", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
    {"oblique",
     {{0.86602540378443865, 0.5, 0},
      {-0.25, 0.43301270189221933, 0.86602540378443865},
      {0.43301270189221933, -0.75, 0.5}}},
};

/* The surfaces and where everything lies on the canvas. */
typedef struct scene {
    const sdm_picture_surface *surfaces;
    size_t n, columns;
    int first_view; /* the surfaces are drawn in this view and those after it */
    bool backs;     /* back sides have the colour BACK */
    /* bounding boxes of all surfaces in the planes of the views, mm */
    double low[N_VIEWS][2], high[N_VIEWS][2];
    double pixels; /* per mm */
    /* the colours span the values -limit .. limit, mm */
    double limit;
    /* size of the panels in pixels */
    int width, height[N_VIEWS];
    /* colours of evenly spaced values from -limit to limit */
    sdm_colour shade[N_SHADES];
} scene;

/* The samples of one panel, FINE times as many as pixels in width and height; depth is -INFINITY
   where no surface is. */
typedef struct raster {
    int w, h;
    double *depth;
    uint8_t *rgb;
} raster;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Finds the bounding boxes and the largest absolute value that is finite. */
static void scene_measure(scene *sc)
{
    for (int v = 0; v < N_VIEWS; v++)
        for (int d = 0; d < 2; d++) {
            sc->low[v][d] = INFINITY;
            sc->high[v][d] = -INFINITY;
        }
    for (size_t k = 0; k < sc->n; k++) {
        const sdm_picture_surface *p = &sc->surfaces[k];
        for (size_t i = 0; i < 3 * p->mesh->n_tri; i++) {
            const size_t vertex = p->mesh->tri[i];
            for (int v = 0; v < N_VIEWS; v++)
                for (int d = 0; d < 2; d++) {
                    const double at = dot(p->mesh->vert + 3 * vertex, VIEWS[v].axis[d]);
                    sc->low[v][d] = fmin(sc->low[v][d], at);
                    sc->high[v][d] = fmax(sc->high[v][d], at);
                }
            if (p->values && isfinite(p->values[vertex]))
                sc->limit = fmax(sc->limit, fabs(p->values[vertex]));
        }
    }
}

/* Finds the scale, the sizes of the panels and the colours. */
static void scene_place(scene *sc)
{
    double widest = 0, longest = 0;
    for (int v = 0; v < N_VIEWS; v++) {
        widest = fmax(widest, sc->high[v][0] - sc->low[v][0]);
        for (int d = 0; d < 2; d++) longest = fmax(longest, sc->high[v][d] - sc->low[v][d]);
    }
    if (!(longest > 0)) longest = widest = 1;
    sc->pixels = PANEL / longest;
    sc->width = (int)fmax(220, ceil(widest * sc->pixels) + 8);
    for (int v = 0; v < N_VIEWS; v++)
        sc->height[v] = (int)fmax(40, ceil((sc->high[v][1] - sc->low[v][1]) * sc->pixels) + 64);
    if (!(sc->limit > 0)) sc->limit = 1e-3;
    for (int i = 0; i < N_SHADES; i++)
        sc->shade[i] = sdm_map_colour(SDM_MAP_SIGNED, -1, 1, (double)(i - MIDDLE) / MIDDLE);
}

/* cross[3] = the cross product of two edges of triangle t. */
static void triangle_cross(const sdm_mesh *m, size_t t, double cross[3])
{
    v3_triangle_normal(m->vert + 3 * (size_t)m->tri[3 * t], m->vert + 3 * (size_t)m->tri[3 * t + 1],
                       m->vert + 3 * (size_t)m->tri[3 * t + 2], cross);
}

/* The triangles at each vertex, tri[first[v]] .. tri[first[v + 1] - 1], and the cross product of
 * each triangle. */
typedef struct fans {
    uint32_t *first; /* [n_vert + 2], the last one is unused */
    uint32_t *tri;   /* [3 n_tri] */
    double *cross;   /* [n_tri][3] */
} fans;

static void fans_dispose(fans *f)
{
    sdm_free(f->first);
    sdm_free(f->tri);
    sdm_free(f->cross);
}

static sdm_status fans_find(const sdm_mesh *m, fans *f, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&f->first, m->n_vert + 2, "triangles at vertices", err);
    if (!s) s = SDM_ALLOC(&f->tri, 3 * m->n_tri, "triangles at vertices", err);
    if (!s) s = SDM_ALLOC(&f->cross, 3 * m->n_tri, "normals of a picture", err);
    if (s) return s;
    // counting sort: first[v + 1] counts on from the triangles before those of v
    for (size_t i = 0; i < 3 * m->n_tri; i++) f->first[m->tri[i] + 2]++;
    for (size_t v = 0; v < m->n_vert; v++) f->first[v + 2] += f->first[v + 1];
    for (size_t i = 0; i < 3 * m->n_tri; i++) f->tri[f->first[m->tri[i] + 1]++] = (uint32_t)(i / 3);
    for (size_t t = 0; t < m->n_tri; t++) triangle_cross(m, t, f->cross + 3 * t);
    return SDM_OK;
}

/* Lambert shading with ambient light 0.42 and a light from the upper left behind the viewer. Back
 * sides are lit like front sides. n[3] need not be of unit length. */
static double brightness(const double n[3], const view *v)
{
    static const double LIGHT[3] = {-0.4, 0.5, 0.76811};
    const double length = sqrt(dot(n, n)), front = dot(n, v->axis[2]) < 0 ? -1 : 1;
    double lit = 0;
    for (int d = 0; d < 3; d++) lit += LIGHT[d] * dot(n, v->axis[d]);
    return length > 0 ? 0.42 + 0.58 * fmax(0, front * lit / length) : 0.42;
}

static sdm_colour colour_of(const scene *sc, double value)
{
    if (!isfinite(value)) return (sdm_colour){160, 160, 160};
    return sc->shade[(int)lround((fmax(-1, fmin(1, value / sc->limit)) + 1) * MIDDLE)];
}

/* A corner of a triangle: position in samples, depth towards the viewer in mm, and the quantities
 * that are interpolated. */
typedef struct corner {
    double x, y, z, value, normal[3];
} corner;

/* Renders a triangle; flat: in this colour, or NULL: in the colours of its values. */
static void draw_triangle(const scene *sc, raster *r, const view *v, const corner c[3],
                          const sdm_colour *flat)
{
    const double area =
        (c[1].x - c[0].x) * (c[2].y - c[0].y) - (c[2].x - c[0].x) * (c[1].y - c[0].y);
    if (!(fabs(area) > 0)) return;
    // the bounding box in samples
    const int x0 = (int)fmax(0, floor(fmin(c[0].x, fmin(c[1].x, c[2].x)))),
              x1 = (int)fmin(r->w - 1, ceil(fmax(c[0].x, fmax(c[1].x, c[2].x)))),
              y0 = (int)fmax(0, floor(fmin(c[0].y, fmin(c[1].y, c[2].y)))),
              y1 = (int)fmin(r->h - 1, ceil(fmax(c[0].y, fmax(c[1].y, c[2].y))));
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            // barycentric coordinates
            const double px = x + 0.5, py = y + 0.5;
            double b[3];
            b[1] = ((px - c[0].x) * (c[2].y - c[0].y) - (c[2].x - c[0].x) * (py - c[0].y)) / area;
            b[2] = ((c[1].x - c[0].x) * (py - c[0].y) - (px - c[0].x) * (c[1].y - c[0].y)) / area;
            b[0] = 1 - b[1] - b[2];
            if (!(b[0] >= 0 && b[1] >= 0 && b[2] >= 0)) continue;
            // only in front of what has been drawn
            const size_t at = (size_t)y * (size_t)r->w + (size_t)x;
            const double z = b[0] * c[0].z + b[1] * c[1].z + b[2] * c[2].z;
            if (!(z > r->depth[at])) continue;
            // colour of the interpolated value, brightness by the interpolated normal
            double n[3], value = 0;
            for (int d = 0; d < 3; d++)
                n[d] = b[0] * c[0].normal[d] + b[1] * c[1].normal[d] + b[2] * c[2].normal[d];
            for (int k = 0; k < 3; k++) value += b[k] * c[k].value;
            const sdm_colour base = flat ? *flat : colour_of(sc, value);
            const double light = brightness(n, v);
            r->depth[at] = z;
            r->rgb[3 * at] = (uint8_t)(base.r * light + 0.5);
            r->rgb[3 * at + 1] = (uint8_t)(base.g * light + 0.5);
            r->rgb[3 * at + 2] = (uint8_t)(base.b * light + 0.5);
        }
}

/* n[3] = unit normal for the shading of triangle t at vertex v: the mean, by area, of the triangles
 * there that lie within 30 degrees of it. Beyond a sharp edge a surface has another normal. */
static void corner_normal(const fans *f, size_t t, size_t v, double n[3])
{
    const double SMOOTH = 0.86602540378443865; // cosine of 30 degrees
    const double *own = f->cross + 3 * t;
    const uint32_t alone = (uint32_t)t;
    const size_t n_fan = f->first[v + 1] - f->first[v], n_tri = n_fan > FAN_MAX ? 1 : n_fan;
    const uint32_t *tri = n_fan > FAN_MAX ? &alone : f->tri + f->first[v];
    double sum[3] = {0};
    for (size_t i = 0; i < n_tri; i++) {
        const double *cross = f->cross + 3 * (size_t)tri[i];
        const double lengths = sqrt(dot(own, own) * dot(cross, cross));
        for (int d = 0; d < 3 && dot(own, cross) >= SMOOTH * lengths; d++) sum[d] += cross[d];
    }
    const double length = sqrt(dot(sum, sum));
    for (int d = 0; d < 3; d++) n[d] = length > 0 ? sum[d] / length : 0;
}

/* Renders a surface in one view. */
static void draw_surface(const scene *sc, raster *r, int view_index, const sdm_picture_surface *p,
                         const fans *f)
{
    static const sdm_colour PLAIN = {214, 208, 196};
    const view *v = &VIEWS[view_index];
    const double scale = sc->pixels * FINE,
                 middle[2] = {0.5 * (sc->low[view_index][0] + sc->high[view_index][0]),
                              0.5 * (sc->low[view_index][1] + sc->high[view_index][1])};
    for (size_t t = 0; t < p->mesh->n_tri; t++) {
        corner c[3];
        for (size_t k = 0; k < 3; k++) {
            const size_t i = p->mesh->tri[3 * t + k];
            const double *x = p->mesh->vert + 3 * i;
            c[k].x = 0.5 * r->w + scale * (dot(x, v->axis[0]) - middle[0]);
            c[k].y = 0.5 * r->h - scale * (dot(x, v->axis[1]) - middle[1]);
            c[k].z = dot(x, v->axis[2]);
            c[k].value = p->values ? p->values[i] : 0;
            corner_normal(f, t, i, c[k].normal);
        }
        const bool back = dot(f->cross + 3 * t, v->axis[2]) < 0;
        draw_triangle(sc, r, v, c, back && sc->backs ? &BACK : p->values ? NULL : &PLAIN);
    }
}

/* The mean of the samples of a pixel. */
static sdm_colour raster_pixel(const void *user, int x, int y)
{
    const raster *r = user;
    int sum[3] = {0, 0, 0};
    uint8_t mean[3];
    for (int k = 0; k < FINE * FINE; k++) {
        const size_t at =
            (size_t)(y * FINE + k / FINE) * (size_t)r->w + (size_t)(x * FINE + k % FINE);
        for (int d = 0; d < 3; d++) sum[d] += r->rgb[3 * at + (size_t)d];
    }
    for (int d = 0; d < 3; d++) mean[d] = (uint8_t)((sum[d] + FINE * FINE / 2) / (FINE * FINE));
    return (sdm_colour){mean[0], mean[1], mean[2]};
}

static sdm_status draw_panel(const scene *sc, sdm_canvas *c, size_t column, int v, sdm_box box,
                             sdm_error *err)
{
    const sdm_picture_surface *p = &sc->surfaces[column];
    raster r = {.w = box.w * FINE, .h = box.h * FINE};
    const size_t n = (size_t)r.w * (size_t)r.h;
    fans f = {0};
    sdm_status s = SDM_ALLOC(&r.depth, n, "depth of a picture", err);
    if (!s) s = SDM_ALLOC(&r.rgb, 3 * n, "panel of a picture", err);
    if (!s) s = fans_find(p->mesh, &f, err);
    if (!s) {
        for (size_t i = 0; i < n; i++) r.depth[i] = -INFINITY;
        memset(r.rgb, 255, 3 * n);
        draw_surface(sc, &r, v, p, &f);
        sdm_canvas_image(c, box, raster_pixel, &r);
    }
    sdm_free(r.depth);
    sdm_free(r.rgb);
    fans_dispose(&f);
    return s;
}

static const char *title_of(const scene *sc, size_t k)
{
    return sc->surfaces[k].title ? sc->surfaces[k].title : "";
}

static bool has_values(const scene *sc)
{
    for (size_t k = 0; k < sc->n; k++)
        if (sc->surfaces[k].values) return true;
    return false;
}

/* Height of a row of surfaces with its titles. */
static int row_height(const scene *sc)
{
    int h = TOP - GAP;
    for (int v = sc->first_view; v < N_VIEWS; v++) h += sc->height[v] + GAP;
    return h;
}

static sdm_status draw_scene(const scene *sc, sdm_canvas *c, int bar_top, const char *caption,
                             sdm_error *err)
{
    const double unit = sc->limit < 0.1 ? 1000 : 1;
    char text[160];
    sdm_status s = SDM_OK;
    bool large = true; // all titles alike
    for (size_t k = 0; k < sc->n; k++)
        large &= sdm_panel_title_fits(c, (sdm_box){.w = sc->width}, title_of(sc, k));
    for (size_t k = 0; k < sc->n && !s; k++) {
        const int left = SIDE + (int)(k % sc->columns) * (sc->width + GAP);
        int top = TOP + (int)(k / sc->columns) * row_height(sc);
        const sdm_box first = {left, top, sc->width, sc->height[sc->first_view]};
        sdm_panel_title(c, first, large, title_of(sc, k));
        for (int v = sc->first_view; v < N_VIEWS && !s; v++) {
            const sdm_box box = {left, top, sc->width, sc->height[v]};
            s = draw_panel(sc, c, k, v, box, err);
            if (sc->first_view + 1 < N_VIEWS) // several views, with their names
                sdm_canvas_text(c, left + 6, top + 14,
                                (sdm_type){.size = 9, .colour = SDM_INK_LIGHT}, VIEWS[v].name);
            if (k == 0 && v == sc->first_view) sdm_panel_scale_bar(c, box, sc->pixels);
            top += sc->height[v] + GAP;
        }
        if (!sc->surfaces[k].values) continue;
        const sdm_box bar = {left + sc->width / 10, bar_top, sc->width - 2 * (sc->width / 10), BAR};
        snprintf(text, sizeof text, "%.120s (%s)", caption, unit > 1 ? "\xC2\xB5m" : "mm");
        sdm_colour_bar(c, bar, SDM_MAP_SIGNED, -sc->limit * unit, sc->limit * unit, text);
    }
    return s;
}

/* Draws at most `most` surfaces in rows of `columns`, in the views from first_view on. */
static sdm_status draw_surfaces(const char *path, const sdm_picture_surface *surfaces, size_t n,
                                size_t most, size_t columns, int first_view, const char *caption,
                                sdm_error *err)
{
    if (!path || !surfaces || !caption)
        return sdm_fail(err, SDM_E_ARG, "picture of surfaces: NULL argument");
    if (n < 1 || n > most)
        return sdm_fail(err, SDM_E_ARG, "%zu surfaces in a picture, need 1 to %zu", n, most);
    for (size_t k = 0; k < n; k++) {
        if (!surfaces[k].mesh)
            return sdm_fail(err, SDM_E_ARG, "surface %zu of the picture has no mesh", k);
        sdm_audit audit; // refuses bad indices and coordinates that are not finite
        const sdm_status s = sdm_mesh_audit(surfaces[k].mesh, &audit, err);
        if (s) return sdm_fail_in(err, s, "surface %zu of the picture", k);
    }
    scene sc = {.surfaces = surfaces,
                .n = n,
                .columns = columns,
                .first_view = first_view,
                .backs = first_view == OBLIQUE};
    sdm_canvas *c = NULL;
    scene_measure(&sc);
    scene_place(&sc);
    const int rows = (int)((n + columns - 1) / columns),
              foot = (has_values(&sc) ? FOOT : 0) + (sc.backs ? NOTE : 0),
              h = rows * row_height(&sc) + GAP + foot;
    sdm_status s =
        sdm_canvas_create(path, 2 * SIDE + (int)columns * (sc.width + GAP) - GAP, h, &c, err);
    if (s || !c) return s;
    if (sc.backs)
        sdm_canvas_text(c, SIDE, h - 10, (sdm_type){.size = 9, .colour = SDM_INK_LIGHT},
                        "red, if any: the inner side of a surface. A part is inside out, or the "
                        "mesh has a hole.");
    s = draw_scene(&sc, c, h - foot, caption, err);
    if (!s) return sdm_canvas_finish(c, err);
    sdm_canvas_discard(c);
    return s;
}

sdm_status sdm_picture_surfaces(const char *path, const sdm_picture_surface *surfaces, size_t n,
                                const char *caption, sdm_error *err)
{
    return draw_surfaces(path, surfaces, n, SURFACES_MAX, n, 0, caption, err);
}

sdm_status sdm_picture_gallery(const char *path, const sdm_picture_surface *surfaces, size_t n,
                               const char *caption, sdm_error *err)
{
    size_t columns = 1;
    while (columns * columns < n) columns++;
    return draw_surfaces(path, surfaces, n, GALLERY_MAX, columns, OBLIQUE, caption, err);
}
