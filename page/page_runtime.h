/* The runtime inside of a page, as a WebAssembly module: opens one model and computes its maps and
 * surfaces. script/worker.js calls these functions. There is one model and one thread. Memory that
 * a function returns is valid until the same thing is computed again. A function that computes
 * returns 0, or 1 with a text from page_message(). */
#pragma once

#include <stddef.h>
#include <stdint.h>

#define PAGE_EXPORT(name) __attribute__((export_name(#name)))

/* What went wrong last. */
PAGE_EXPORT(page_message) const char *page_message(void);

/* Memory for the bytes of a model; NULL: too little. */
PAGE_EXPORT(page_alloc) void *page_alloc(size_t size);

/* Opens the model in bytes[size] from page_alloc(), and frees them. Call it once. */
PAGE_EXPORT(page_open) int page_open(uint8_t *bytes, size_t size);

/* The array of page_n_params() parameters of the next map: the caller writes into it. */
PAGE_EXPORT(page_params) double *page_params(void);
PAGE_EXPORT(page_n_params) size_t page_n_params(void);

/* Whether the exact engine can compute maps: the shape of the model is a built-in one without data
 * files. */
PAGE_EXPORT(page_knows_shape) int page_knows_shape(void);

/* ranges[n_params][2]: the least and the largest values that page_map() accepts: those of the
 * shape, or else of the training. */
PAGE_EXPORT(page_ranges) const double *page_ranges(void);

/* Computes the map at the parameters: by the network within the trained range, beyond it by the
 * exact engine. */
PAGE_EXPORT(page_map) int page_map(void);
PAGE_EXPORT(page_was_exact) int page_was_exact(void); /* the exact engine computed it */

/* Computes the map by the exact engine; only if page_knows_shape(). */
PAGE_EXPORT(page_exact) int page_exact(void);

/* The last map, values[nz][ny][nx], mm. */
PAGE_EXPORT(page_values) const float *page_values(void);
PAGE_EXPORT(page_n_values) size_t page_n_values(void);

/* Computes the zero surface of the last map, with normals and measures. */
PAGE_EXPORT(page_surface) int page_surface(void);

/* vertices[n_vertices][6], position (mm) and normal; triangles[n_triangles][3]. */
PAGE_EXPORT(page_vertices) const float *page_vertices(void);
PAGE_EXPORT(page_n_vertices) size_t page_n_vertices(void);
PAGE_EXPORT(page_triangles) const uint32_t *page_triangles(void);
PAGE_EXPORT(page_n_triangles) size_t page_n_triangles(void);

/* measures[8]: volume of the map (mm^3; sdm_map_volume()), area of its surface (mm^2), least and
 * largest x, y, z (mm). */
PAGE_EXPORT(page_measures) const double *page_measures(void);
/* The shape's own measures at the parameters, in the order of its table; those of a depth at
 * `depth` (mm). NaN: there is none here. page_n_own_measures() is 0 unless page_knows_shape(). */
PAGE_EXPORT(page_own_measures) const double *page_own_measures(double depth);
PAGE_EXPORT(page_n_own_measures) size_t page_n_own_measures(void);
/* Volume, area and extents of the shape's mesh at the parameters, as sdm_shape_measure() has them:
 * mm^3, mm^2, mm; it takes as long as several maps. NaN: there is none. Only if page_knows_shape().
 */
PAGE_EXPORT(page_mesh_measures) const double *page_mesh_measures(void);

/* The surface leaves the grid: its volume is not that of the shape. */
PAGE_EXPORT(page_is_cut) int page_is_cut(void);
