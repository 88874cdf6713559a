/* Turns the points and cells of a VTK polydata file into a triangle mesh. */
#include "polydata.h"

#include <math.h>

#include "sdm/memory.h"

/* Demands that cell i lies inside the corners, has at least three, and that all are points. */
static sdm_status check_cell(const sdm_polydata *p, const sdm_vtk_cells *cells, size_t i,
                             const char *what, const sdm_builder *b, sdm_error *err)
{
    const int64_t from = cells->offset[i], to = cells->offset[i + 1];
    if (from < 0 || to < from || (uint64_t)to > cells->n_corner)
        return sdm_fail(err, SDM_E_FORMAT, "%s: %s %zu: offsets %lld and %lld of %zu corners",
                        b->path, what, i, (long long)from, (long long)to, cells->n_corner);
    if (to - from < 3)
        return sdm_fail(err, SDM_E_FORMAT, "%s: %s %zu has %lld corners, need 3", b->path, what, i,
                        (long long)(to - from));
    for (int64_t k = from; k < to; k++)
        if (cells->corner[k] < 0 || (uint64_t)cells->corner[k] >= p->n_points)
            return sdm_fail(err, SDM_E_FORMAT, "%s: %s %zu has point %lld of %zu", b->path, what, i,
                            (long long)cells->corner[k], p->n_points);
    return SDM_OK;
}

static sdm_status add_polygon(const int64_t *corner, int64_t n, sdm_builder *b, sdm_error *err)
{
    sdm_fan fan = {0};
    sdm_status s = SDM_OK;
    for (int64_t k = 0; k < n && !s; k++) s = sdm_builder_corner(b, &fan, (uint32_t)corner[k], err);
    return s;
}

/* Every second triangle of a strip runs the other way round. */
static sdm_status add_strip(const int64_t *corner, int64_t n, sdm_builder *b, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (int64_t k = 0; k + 2 < n && !s; k++)
        s = sdm_builder_triangle(b, (uint32_t)corner[k], (uint32_t)corner[k + 1 + k % 2],
                                 (uint32_t)corner[k + 2 - k % 2], err);
    return s;
}

sdm_status sdm_polydata_build(const sdm_polydata *p, sdm_builder *b, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < 3 * p->n_points; i++)
        if (!isfinite(p->points[i]))
            return sdm_fail(err, SDM_E_FORMAT, "%s: coordinates of point %zu are not finite",
                            b->path, i / 3);
    for (size_t i = 0; i < p->n_points && !s; i++)
        s = sdm_builder_vertex(b, p->points + 3 * i, err);
    const struct {
        const sdm_vtk_cells *cells;
        const char *what;
        sdm_status (*add)(const int64_t *corner, int64_t n, sdm_builder *b, sdm_error *err);
    } kinds[] = {{&p->polygons, "polygon", add_polygon}, {&p->strips, "strip", add_strip}};
    for (int k = 0; k < 2; k++) {
        const sdm_vtk_cells *c = kinds[k].cells;
        for (size_t i = 0; i + 1 < c->n_offset && !s; i++) {
            s = check_cell(p, c, i, kinds[k].what, b, err);
            if (!s)
                s = kinds[k].add(c->corner + c->offset[i], c->offset[i + 1] - c->offset[i], b, err);
        }
    }
    return s;
}

void sdm_vtk_cells_dispose(sdm_vtk_cells *cells)
{
    sdm_free(cells->offset);
    sdm_free(cells->corner);
    *cells = (sdm_vtk_cells){0};
}

void sdm_polydata_dispose(sdm_polydata *p)
{
    sdm_free(p->points);
    sdm_vtk_cells_dispose(&p->polygons);
    sdm_vtk_cells_dispose(&p->strips);
    *p = (sdm_polydata){0};
}
