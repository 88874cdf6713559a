/* The mesh topology of everything that is round about a line: a pole, rings of vertices, a pole. */
#ifndef LATHE_H
#define LATHE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LATHE_PI 3.14159265358979323846

/* Vertices are in this order: first pole, rings[n_rings][n_sectors], last pole. Odd rings are
   turned by half a sector, which makes triangles nearly equilateral. */
size_t sdm_lathe_n_vert(size_t n_rings, size_t n_sectors);
size_t sdm_lathe_n_tri(size_t n_rings, size_t n_sectors);

/* Angle of a vertex about the line, from the first to the second axis of the section; first, second
   axis and the direction from the first pole to the last are right-handed. */
double sdm_lathe_angle(size_t ring, size_t sector, size_t n_sectors);

/* Writes tri[sdm_lathe_n_tri()][3], counter-clockwise seen from outside; `mirrored` turns them, for
 * vertices that are reflected. */
void sdm_lathe_triangles(size_t n_rings, size_t n_sectors, bool mirrored, uint32_t *tri);

/* How many pieces of about `edge` a length is cut into, at least `least`. */
size_t sdm_lathe_pieces(double length, double edge, size_t least);

#endif
