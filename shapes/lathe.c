/* Mesh topology of bodies of revolution and similar shapes (lathe.h). */
#include "lathe.h"

#include <math.h>

size_t sdm_lathe_n_vert(size_t n_rings, size_t n_sectors) { return n_rings * n_sectors + 2; }

size_t sdm_lathe_n_tri(size_t n_rings, size_t n_sectors) { return 2 * n_rings * n_sectors; }

double sdm_lathe_angle(size_t ring, size_t sector, size_t n_sectors)
{
    return 2 * LATHE_PI * ((double)sector + (ring % 2 ? 0.5 : 0)) / (double)n_sectors;
}

static uint32_t *triangle_write(uint32_t *tri, bool mirrored, size_t a, size_t b, size_t c)
{
    tri[0] = (uint32_t)a;
    tri[1] = (uint32_t)(mirrored ? c : b);
    tri[2] = (uint32_t)(mirrored ? b : c);
    return tri + 3;
}

void sdm_lathe_triangles(size_t n_rings, size_t n_sectors, bool mirrored, uint32_t *tri)
{
    const size_t last = 1 + (n_rings - 1) * n_sectors, pole = 1 + n_rings * n_sectors;
    for (size_t j = 0; j < n_sectors; j++)
        tri = triangle_write(tri, mirrored, 0, 1 + (j + 1) % n_sectors, 1 + j);
    for (size_t i = 0; i + 1 < n_rings; i++) {
        const size_t low = 1 + i * n_sectors, high = low + n_sectors;
        for (size_t j = 0; j < n_sectors; j++) {
            const size_t k = (j + 1) % n_sectors;
            // choose the shorter diagonal: vertex j of an odd ring lies between j and j + 1 of an
            // even one
            if (i % 2 == 0) {
                tri = triangle_write(tri, mirrored, low + j, low + k, high + j);
                tri = triangle_write(tri, mirrored, high + j, low + k, high + k);
            } else {
                tri = triangle_write(tri, mirrored, low + j, low + k, high + k);
                tri = triangle_write(tri, mirrored, low + j, high + k, high + j);
            }
        }
    }
    for (size_t j = 0; j < n_sectors; j++)
        tri = triangle_write(tri, mirrored, last + j, last + (j + 1) % n_sectors, pole);
}

size_t sdm_lathe_pieces(double length, double edge, size_t least)
{
    const double n = nearbyint(length / edge);
    return n > (double)least ? (size_t)n : least;
}
