/* The shape plug-in ABI. A plug-in needs this header alone: everything it asks of the program comes
   through `sdm_host`.

   A shape is ONE constant table. Callbacks are stateless and re-entrant: the result depends on the
   arguments only, and many threads call at once. The host checks parameters against their ranges
   before a call, indices and coordinates of the mesh after it. */
#ifndef SDM_SHAPE_H
#define SDM_SHAPE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_SHAPE_ABI 1u

/* A shape parameter: what a network takes as input. Names are [a-z][a-z0-9_]*, unique in the shape.
 */
typedef struct sdm_param {
    const char *name;
    const char *unit; /* "mm", "rad", "sd" or "" */
    double min, max, def;
    const char *help;
} sdm_param;

typedef enum sdm_option_type {
    SDM_OPTION_REAL = 0,
    SDM_OPTION_INT = 1,
    SDM_OPTION_CHOICE = 2, /* one of `choices`, "left|right" */
    SDM_OPTION_FILE =
        3 /* a path; relative ones are resolved against the config's folder by the host */
} sdm_option_type;

/* An option: fixed for all shapes of one instance (mesh density, model constants, data files). */
typedef struct sdm_option {
    const char *name;
    sdm_option_type type;
    const char *unit;
    double min, max, def; /* REAL and INT */
    const char *choices;  /* CHOICE: "left|right", the first is the default */
    const char *help;
} sdm_option;

/* Value of an option as given to the callbacks, in the order of the shape's option table. */
typedef struct sdm_option_value {
    double number;    /* REAL, INT; index of the choice for CHOICE */
    const char *text; /* FILE: the path, "" when not given; CHOICE: its name */
} sdm_option_value;

/* The mesh under construction: after host->reserve() the plug-in writes vert[n_vert][3] (mm) and
   tri[n_tri][3] (counter-clockwise seen from outside). */
typedef struct sdm_mesh_out {
    double *vert;
    uint32_t *tri;
    size_t n_vert, n_tri;
} sdm_mesh_out;

/* What the program offers a plug-in during a call; not to be kept afterwards. */
typedef struct sdm_host {
    uint32_t abi, size;
    void *ctx;
    /* Makes room in *out; returns 0, or non-zero when memory is short (return that value from the
     * callback). */
    int (*reserve)(const struct sdm_host *host, sdm_mesh_out *out, size_t n_vert, size_t n_tri);
    /* Sets the error text and returns a non-zero value to return from the callback. `text` is
     * copied. */
    int (*fail)(const struct sdm_host *host, const char *text);
    /* Reads a data file whole; *data stays valid until the callback returns. For create(). Returns
     * 0 or non-zero. */
    int (*read_file)(const struct sdm_host *host, const char *path, const unsigned char **data,
                     size_t *size);
    /* Reads a mesh file (.ply .stl .obj .off) into *out, as reserve() does. For create(). */
    int (*read_mesh)(const struct sdm_host *host, const char *path, sdm_mesh_out *out);
    /* Reads a .npy file of float32/float64 in C order; *values (double) and shape[4] stay valid
       until the callback returns; n_dim is at most 4. For create(). */
    int (*read_npy)(const struct sdm_host *host, const char *path, const double **values,
                    size_t shape[4], int *n_dim);
} sdm_host;

typedef struct sdm_shape {
    uint32_t abi;  /* SDM_SHAPE_ABI */
    uint32_t size; /* sizeof(sdm_shape) at the plug-in's compile time */
    const char *name;
    const char *summary;
    const sdm_param *params;
    uint32_t n_params;
    const sdm_option *options;
    uint32_t n_options;

    /* Optional, together: data shared by all calls of one instance. 0 on success. self is passed to
       every callback, NULL without create(). Memory behind self is the plug-in's own. */
    int (*create)(const sdm_host *host, const sdm_option_value *options, void **self);
    void (*destroy)(void *self);

    /* Optional: parameters that depend on the data (number of modes). Valid as long as self. When
     * absent, `params` counts. */
    void (*describe)(const void *self, const sdm_param **params, uint32_t *n_params);

    /* Required: the mesh at parameters p[n_params]. Vertices depend smoothly on p; the number of
       vertices and triangles should not depend on p. 0 on success. */
    int (*mesh)(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out);

    /* Optional: velocity[n_params][n_vert][3] = d(vertex)/d(parameter), for the vertices that
     * mesh() gives at p. */
    int (*velocity)(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, size_t n_vert, double *velocity);

    /* Optional: closed-form signed distance (negative inside, mm) of the ideal shape at x[3]: a
       test oracle. It may be exact outside only; then it must be a bound inside and say so in
       `summary` or the documentation. 0 on success; host->fail() where there is no closed form for
       the given options. */
    int (*distance)(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, const double x[3], double *distance);
} sdm_shape;

/* The one symbol a plug-in's shared object exports: returns shape `index`, NULL behind the last. */
typedef const sdm_shape *(*sdm_plugin_entry)(uint32_t index);
#define SDM_PLUGIN_SYMBOL "sdm_plugin_shape"

#if defined(__GNUC__)
#define SDM_PLUGIN_EXPORT __attribute__((visibility("default")))
#else
#define SDM_PLUGIN_EXPORT
#endif

/* Defined by the plug-in; declared here, so that it is visible whatever the compiler's options are.
 */
const sdm_shape *sdm_plugin_shape(uint32_t index) SDM_PLUGIN_EXPORT;

#ifdef __cplusplus
}
#endif
#endif
