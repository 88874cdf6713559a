/* Inside of the mesh file readers: a mesh that grows, a text that is read line by line, one function pair a format. */
#ifndef SDM_IO_MESHPARTS_H
#define SDM_IO_MESHPARTS_H

#include "bytes.h"
#include "sdm/meshfile.h"

/* A mesh under construction: n_vert and n_tri say what is filled, the mesh's own counts what there is room for. */
typedef struct sdm_builder {
    const char *path; /* for messages */
    sdm_mesh *mesh;
    size_t n_vert, n_tri;
} sdm_builder;

/* Both grow geometrically; sdm_builder_finish() sets the mesh's counts to what is filled. */
sdm_status sdm_builder_vertex(sdm_builder *b, const double x[3], sdm_error *err);
sdm_status sdm_builder_triangle(sdm_builder *b, uint32_t v0, uint32_t v1, uint32_t v2, sdm_error *err);
sdm_status sdm_builder_finish(sdm_builder *b, sdm_error *err);

/* A polygon given corner by corner becomes a fan around its first corner. Start with n = 0. */
typedef struct sdm_fan {
    size_t n;
    uint32_t first, last;
} sdm_fan;
sdm_status sdm_builder_corner(sdm_builder *b, sdm_fan *fan, uint32_t vertex, sdm_error *err);

/* A text file in memory, cut up in place; `at` must be followed by one writable zero byte at `end`. */
typedef struct sdm_scan {
    char *at, *end;
    const char *path;
    size_t line;    /* of what was returned last, from 1 */
    size_t lines;   /* read so far */
    char comment;   /* starts a comment that reaches to the end of the line; 0: none */
    bool continues; /* a backslash at the end of a line joins it with the next */
} sdm_scan;

/* Next line with something on it, NULL at the end of the text. */
char *sdm_scan_line(sdm_scan *s);

/* Cuts the next word off *line, NULL when there is none. */
char *sdm_scan_word(char **line);

/* Next word of the text, wherever its line ends; NULL at the end of the text. */
char *sdm_scan_token(sdm_scan *s, char **line);

/* The next n words of a line as finite numbers. SDM_E_FORMAT names file, line and word. */
sdm_status sdm_scan_reals(const sdm_scan *s, char **line, double *out, int n, sdm_error *err);

/* The next word of a line as an integer in [0, limit). `what` names it in the message. */
sdm_status sdm_scan_count(const sdm_scan *s, char **line, int64_t limit, const char *what, int64_t *out,
                          sdm_error *err);

/* Readers take the whole file (one zero byte behind it) and may write to it; the mesh is finished by the caller. */
sdm_status sdm_ply_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_stl_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_obj_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_off_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);

/* Writers get a mesh whose indices and coordinates have been checked. */
sdm_status sdm_ply_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_stl_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_obj_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_off_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);

#endif
