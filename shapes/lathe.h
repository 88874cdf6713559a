/* Mesh topology of bodies of revolution and similar shapes: a pole, rings of vertices, a pole. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LATHE_PI 3.14159265358979323846

/* Number of vertices and triangles. Vertices are in this order: first pole,
 * rings[n_rings][n_sectors], last pole. Odd rings are rotated by half a sector, so triangles are
 * nearly equilateral. */
size_t sdm_lathe_n_vert(size_t n_rings, size_t n_sectors);
size_t sdm_lathe_n_tri(size_t n_rings, size_t n_sectors);

/* Angle (rad) of a vertex of a ring, from the first towards the second axis of the cross-section;
 * first axis, second axis and the direction from the first to the last pole are right-handed. */
double sdm_lathe_angle(size_t ring, size_t sector, size_t n_sectors);

/* Writes tri[sdm_lathe_n_tri()][3], counter-clockwise seen from outside; mirrored: with the
   opposite order, for vertices that are mirror images. */
void sdm_lathe_triangles(size_t n_rings, size_t n_sectors, bool mirrored, uint32_t *tri);

/* length / edge rounded to a whole number of pieces, at least `least`. */
size_t sdm_lathe_pieces(double length, double edge, size_t least);
