/* ABI of shape plug-ins. A plug-in needs only this header; all services of the program are reached
 * through `sdm_host`. A shape is ONE constant table. Its callbacks are stateless and re-entrant:
 * results depend only on the arguments, and several threads may call at the same time. The host
 * checks parameters against their ranges before each call, and indices and coordinates of the mesh
 * after it. */
#ifndef SDM_SHAPE_H
#define SDM_SHAPE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_SHAPE_ABI 1u

/* A shape parameter, an input of the networks. Names match [a-z][a-z0-9_]* and are unique within
 * the shape. */
typedef struct sdm_param {
    const char *name;
    const char *unit; /* "mm", "rad", "sd" (standard deviations) or "" */
    double min, max, def;
    const char *help;
} sdm_param;

typedef enum sdm_option_type {
    SDM_OPTION_REAL = 0,
    SDM_OPTION_INT = 1,
    SDM_OPTION_CHOICE = 2, /* one of the words in `choices`, "left|right" */
    /* path of a file; the host resolves relative paths against the folder of the configuration */
    SDM_OPTION_FILE = 3
} sdm_option_type;

/* An option: fixed for all meshes of one instance (mesh density, constants of the model, data
 * files). */
typedef struct sdm_option {
    const char *name;
    sdm_option_type type;
    const char *unit;
    double min, max, def; /* for REAL and INT */
    const char *choices;  /* CHOICE: "left|right", the first one is the default */
    const char *help;
} sdm_option;

/* The value of an option as passed to the callbacks, in the order of the shape's option table. */
typedef struct sdm_option_value {
    double number;    /* REAL, INT: the value; CHOICE: index of the choice */
    const char *text; /* FILE: the path, "" if not given; CHOICE: name of the choice */
} sdm_option_value;

/* Distribution of a parameter, within the range of the parameter. */
typedef enum sdm_distribution_kind {
    SDM_DISTRIBUTION_UNIFORM = 0,
    SDM_DISTRIBUTION_NORMAL = 1 /* truncated to the range of the parameter */
} sdm_distribution_kind;

typedef struct sdm_distribution {
    sdm_distribution_kind kind;
    /* NORMAL: mean and standard deviation before the truncation, in the unit of the parameter;
     * UNIFORM: not used */
    double mean, deviation;
} sdm_distribution;

/* A measure: a number that describes the shape at given parameters, such as a length. */
typedef struct sdm_measure {
    const char *name; /* matches [a-z][a-z0-9_]*, unique within the shape */
    const char *unit; /* "mm", "deg", "Hz", ... or "" */
    const char *help; /* what is measured, with its source (author, year) if it has one */
    /* 1: the measure is a function of a depth, mm: how far in from the beginning of the shape;
     * 0: it is one number */
    int of_depth;
} sdm_measure;

/* Mesh output: after host->reserve() the plug-in writes vert[n_vert][3] (mm) and tri[n_tri][3]
 * (vertex indices, counter-clockwise seen from outside). */
typedef struct sdm_mesh_out {
    double *vert;
    uint32_t *tri;
    size_t n_vert, n_tri;
} sdm_mesh_out;

/* Services of the program for a callback. Valid only during the call. */
typedef struct sdm_host {
    uint32_t abi, size;
    void *ctx;
    /* Allocates the arrays of *out and sets its sizes. What is not written afterwards is refused:
     * the arrays hold NaN and vertices that do not exist. Arrays reserved in create() are valid
     * until create() returns. Returns 0, or non-zero if memory is short; the callback must then
     * return this value. */
    int (*reserve)(const struct sdm_host *host, sdm_mesh_out *out, size_t n_vert, size_t n_tri);
    /* Sets the error message and returns a non-zero value, which the callback must return. `text`
     * is copied. */
    int (*fail)(const struct sdm_host *host, const char *text);
    /* Reads a whole data file; *data is valid until the callback returns. Only for create().
     * Returns 0 or non-zero. */
    int (*read_file)(const struct sdm_host *host, const char *path, const unsigned char **data,
                     size_t *size);
    /* Reads a mesh file (.ply .stl .obj .off .vtk .vtp) into *out, whose arrays are valid until the
     * callback returns. Only for create(). Returns 0 or non-zero. */
    int (*read_mesh)(const struct sdm_host *host, const char *path, sdm_mesh_out *out);
    /* Reads a .npy file of float32 or float64 in C order, at most 4 dimensions. *values (converted
     * to double) is valid until the callback returns; sizes in shape[0 .. *n_dim - 1]. Only for
     * create(). Returns 0 or non-zero. */
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

    /* Optional, both or neither: make and free data that all calls of one instance share. create()
     * returns 0 on success. *self is passed to all other callbacks (NULL without create()); the
     * plug-in owns the memory behind it and frees it in destroy(). */
    int (*create)(const sdm_host *host, const sdm_option_value *options, void **self);
    void (*destroy)(void *self);

    /* Optional: gives parameters that depend on the data of the instance (for example, one for each
       mode). They stay valid as long as self. Without this callback the member `params` is used. */
    void (*describe)(const void *self, const sdm_param **params, uint32_t *n_params);

    /* Required: makes the mesh at parameters p[n_params]. Vertices depend smoothly on p; the
     * numbers of vertices and triangles should not depend on p. Returns 0 on success. */
    int (*mesh)(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out);

    /* Optional: velocity[n_params][n_vert][3] = d(vertex)/d(parameter), for the vertices that
     * mesh() returns at p. Returns 0 on success. */
    int (*velocity)(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, size_t n_vert, double *velocity);

    /* Optional: closed-form signed distance (mm, negative inside) of the ideal shape at x[3], used
     * to verify distance maps. If it is exact only outside, it must be a lower bound of the
     * absolute value inside, and `summary` or the documentation must say so. Returns 0 on success;
     * calls host->fail() if there is no closed form for the given options. */
    int (*distance)(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, const double x[3], double *distance);

    /* Optional: states the distributions out[n_params] of the instance's parameters. All are
     * uniform before the call. Training, random shapes and the priors of fits use them. Normal: a
     * finite mean and a deviation above 0 with a probability of at least 1e-9 of lying in the range
     * of the parameter. */
    void (*distributions)(const void *self, sdm_distribution *out);

    /* Optional: the name of an option of the type CHOICE with two choices, each of which gives the
     * mirror image of the other at the same parameters ("ear" of "left|right"). A fit tries both.
     * NULL: the shape states none. */
    const char *mirror;

    /* Optional, all or none: measures of the shape's own. measure() computes measures[index] at p.
     * depth: mm, >= 0, for a measure with of_depth; else 0. *value is finite, or NaN where a depth
     * lies beyond the end of the shape; smooth in p, so that a fit can state its standard
     * deviation. Returns 0 on success. Volume, area and extents need no callback: every shape has
     * them from its mesh, and the names volume, area, extent_x, extent_y and extent_z are taken. */
    const sdm_measure *measures;
    uint32_t n_measures;
    int (*measure)(const void *self, const sdm_host *host, const sdm_option_value *options,
                   const double *p, uint32_t index, double depth, double *value);
} sdm_shape;

/* Members of a table and their numbers of rows (C, C++20): sdm_shape x = {..., SDM_PARAMS(PARAMS),
 * ...} sets .params and .n_params. `table` is the name of an array, not a pointer. */
#define SDM_ROWS(table) ((uint32_t)(sizeof(table) / sizeof((table)[0])))
#define SDM_PARAMS(table) .params = (table), .n_params = SDM_ROWS(table)
#define SDM_OPTIONS(table) .options = (table), .n_options = SDM_ROWS(table)
#define SDM_MEASURES(table) .measures = (table), .n_measures = SDM_ROWS(table)

/* The only symbol that the shared object of a plug-in exports: returns shape `index`, NULL beyond
 * the last. */
typedef const sdm_shape *(*sdm_plugin_entry)(uint32_t index);
#define SDM_PLUGIN_SYMBOL "sdm_plugin_shape"

#if defined(__GNUC__)
#define SDM_PLUGIN_EXPORT __attribute__((visibility("default")))
#else
#define SDM_PLUGIN_EXPORT
#endif

/* Defined by the plug-in. Declared here so that it is exported whatever the compiler's visibility
 * options are. */
const sdm_shape *sdm_plugin_shape(uint32_t index) SDM_PLUGIN_EXPORT;

#ifdef __cplusplus
}
#endif
#endif
