/* Reads files of points. */
#pragma once

#include <stddef.h>

#include "sdm/status.h"

/* *x = new array [*n][3] of the points in a file, mm, to be freed with sdm_free(): a text table
 * .csv of x,y,z (one point a line; a first line without numbers is a header, which names the
 * columns x, y and z in any order, and may name others; # begins a comment), an array .npy of
 * float32 or float64 [n][3], or the vertices of a mesh file .ply .stl .obj .off .vtk .vtp.
 * SDM_E_ARG: another ending; SDM_E_FORMAT: names file and line; SDM_E_IO, SDM_E_NOMEM. *lines,
 * unless NULL, = new array [*n] of the lines of the points in a text table, NULL for other files;
 * freed in the same way. */
sdm_status cli_read_points(const char *path, double **x, size_t **lines, size_t *n, sdm_error *err);
