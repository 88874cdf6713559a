/* The interface of shape plug-ins. A plug-in includes this header and links no library of sdmgen.
 *
 * - A shape is one constant table, sdm_shape. sdm_plugin_shape() gives it to the program.
 * - An instance is a shape with values of its options. Its parameters vary from mesh to mesh.
 * - Callbacks get the services of the program (memory, errors, files) as an sdm_host.
 * - The results of a callback depend on its arguments alone: several threads call at once.
 * - Callbacks that return an int return 0 on success.
 * - The program checks parameters before each call, and indices and coordinates after it.
 *
 * docs/adding-a-shape.md explains all parts with examples. */
#ifndef SDM_SHAPE_H
#define SDM_SHAPE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_SHAPE_ABI 1u

/* A parameter of a shape, an input of the networks. */
typedef struct sdm_param {
    const char *name;     /* matches [a-z][a-z0-9_]*, unique within the shape */
    const char *unit;     /* "mm", "rad", "sd" (standard deviations) or "" */
    double min, max, def; /* range and default value; min < max */
    const char *help;     /* its meaning, in one line */
} sdm_param;

typedef enum sdm_option_type {
    SDM_OPTION_REAL = 0,
    SDM_OPTION_INT = 1,
    SDM_OPTION_CHOICE = 2, /* one of the words in `choices` */
    /* path of a file; in a configuration, relative paths start from its folder */
    SDM_OPTION_FILE = 3
} sdm_option_type;

/* An option: constant for all meshes of an instance, such as the mesh density, a variant of the
 * shape, or a data file. */
typedef struct sdm_option {
    const char *name;
    sdm_option_type type;
    const char *unit;     /* "" if it has none */
    double min, max, def; /* REAL and INT: range and default value */
    const char *choices;  /* CHOICE: words such as "left|right"; the first one is the default */
    const char *help;
} sdm_option;

/* The value of an option. Callbacks get an array of these in the order of the table of options. */
typedef struct sdm_option_value {
    double number;    /* REAL, INT: the value; CHOICE: index of the choice */
    const char *text; /* CHOICE: name of the choice; FILE: the path, "" if it is not given */
} sdm_option_value;

/* How the values of a parameter are distributed within its range. */
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
    /* 1: the measure is a function of a depth, the distance in mm from the beginning of the shape;
     * 0: it is one number */
    int of_depth;
} sdm_measure;

/* An open end: a face that closes the mesh where the real organ goes on, such as into a wider
 * space.
 */
typedef struct sdm_open_end {
    double centre[3];  /* of the opening, mm: the organ goes on beyond the plane through it */
    double outward[3]; /* normal of this plane, away from the shape, of any length */
    double radius;     /* mm: no part of the mesh beyond this plane is farther from the centre */
} sdm_open_end;

/* A mesh. After host->reserve() the callback writes vert[n_vert][3], in mm, and tri[n_tri][3]:
 * indices of vertices from 0, counter-clockwise seen from outside. */
typedef struct sdm_mesh_out {
    double *vert;
    uint32_t *tri;
    size_t n_vert, n_tri;
} sdm_mesh_out;

/* Services of the program for a callback, valid only during the call. Functions that return an int
 * return 0 on success; else the callback must return their value. */
typedef struct sdm_host {
    uint32_t abi, size;
    void *ctx;
    /* Allocates the arrays of *out and sets its sizes. At first they hold NaN and indices of no
     * vertex, so that the program finds what mesh() forgets to write. Call it once in mesh().
     * Arrays reserved in create() are valid until create() returns. */
    int (*reserve)(const struct sdm_host *host, sdm_mesh_out *out, size_t n_vert, size_t n_tri);
    /* Sets the error message, a copy of `text`. Never returns 0: return host->fail(host, "why"). */
    int (*fail)(const struct sdm_host *host, const char *text);
    /* Reads a whole file. Only for create(); *data is valid until create() returns. */
    int (*read_file)(const struct sdm_host *host, const char *path, const unsigned char **data,
                     size_t *size);
    /* Reads a mesh file: .ply .stl .obj .off .vtk .vtp. Only for create(); the arrays of *out are
     * valid until create() returns. */
    int (*read_mesh)(const struct sdm_host *host, const char *path, sdm_mesh_out *out);
    /* Reads a .npy file of float32 or float64 in C order with at most 4 dimensions, whose sizes are
     * shape[0 .. *n_dim - 1]. Only for create(); *values is valid until create() returns. */
    int (*read_npy)(const struct sdm_host *host, const char *path, const double **values,
                    size_t shape[4], int *n_dim);
} sdm_host;

/* The table of a shape. Members that are marked optional may be 0. */
typedef struct sdm_shape {
    uint32_t abi;        /* SDM_SHAPE_ABI */
    uint32_t size;       /* sizeof(sdm_shape) where the plug-in was compiled */
    const char *name;    /* matches [a-z][a-z0-9_]* */
    const char *summary; /* the shape in one line */
    const sdm_param *params;
    uint32_t n_params;
    const sdm_option *options;
    uint32_t n_options;

    /* Optional, both or neither: create() makes data that all calls of an instance share, and
     * destroy() frees them. All other callbacks get *self as `self`, NULL without create(). */
    int (*create)(const sdm_host *host, const sdm_option_value *options, void **self);
    void (*destroy)(void *self);

    /* Optional: gives the parameters if they depend on the data of the instance, such as one for
     * each mode. They must stay valid until destroy(). Without this callback the parameters are
     * those of the table. */
    void (*describe)(const void *self, const sdm_param **params, uint32_t *n_params);

    /* Required: makes the mesh at parameters p[n_params]. Vertices are continuous functions of p.
     * The triangles should not depend on p: derivatives and some networks need the same ones for
     * all p. */
    int (*mesh)(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out);

    /* Optional: velocity[n_params][n_vert][3] = d(vertex)/d(parameter), for the vertices that
     * mesh() writes at p. Without this callback the program computes differences of meshes. */
    int (*velocity)(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, size_t n_vert, double *velocity);

    /* Optional: the signed distance of the ideal shape at x[3] by a formula, in mm, negative
     * inside. Only tests use it. If the formula is exact outside only, its absolute value inside
     * must be a lower bound, and `summary` must say so. If there is no formula for the given
     * options, return host->fail(). */
    int (*distance)(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, const double x[3], double *distance);

    /* Optional: sets the distributions out[n_params] of the parameters; all are uniform before the
     * call. Training, random shapes and the priors of fits use them. A normal distribution needs a
     * finite mean, a deviation > 0, and a probability >= 1e-9 of lying in the range of the
     * parameter. */
    void (*distributions)(const void *self, sdm_distribution *out);

    /* Optional: the name of an option of the type CHOICE with two choices, such as "left|right". At
     * the same parameters, one choice gives the mirror image of the other. A fit tries both. */
    const char *mirror;

    /* Optional, all or none: figures that describe the shape. measure() computes measures[index] at
     * p. depth: mm, >= 0, for a measure with of_depth; else 0. *value is smooth in p, so that a fit
     * can state its standard deviation. It is finite, or NaN where a depth lies beyond the end of
     * the shape. Every shape has the measures volume, area, extent_x, extent_y and extent_z without
     * this callback: other measures need other names. */
    const sdm_measure *measures;
    uint32_t n_measures;
    int (*measure)(const void *self, const sdm_host *host, const sdm_option_value *options,
                   const double *p, uint32_t index, double depth, double *value);

    /* Optional: the open end at p, smooth in p. With sdm_fit_opts.open_end a fit takes no evidence
     * from the image beyond it. */
    int (*open_end)(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_open_end *out);
} sdm_shape;

/* For the table of a shape, in C or C++20: sdm_shape x = {..., SDM_PARAMS(PARAMS), ...} sets
 * .params and .n_params, the number of rows. `table` must be an array, not a pointer. */
#define SDM_ROWS(table) ((uint32_t)(sizeof(table) / sizeof((table)[0])))
#define SDM_PARAMS(table) .params = (table), .n_params = SDM_ROWS(table)
#define SDM_OPTIONS(table) .options = (table), .n_options = SDM_ROWS(table)
#define SDM_MEASURES(table) .measures = (table), .n_measures = SDM_ROWS(table)

/* The type and the name of the only function that a plug-in exports. It returns shape `index` of
 * the file, from 0; NULL after the last. */
typedef const sdm_shape *(*sdm_plugin_entry)(uint32_t index);
#define SDM_PLUGIN_SYMBOL "sdm_plugin_shape"

#if defined(__GNUC__)
#define SDM_PLUGIN_EXPORT __attribute__((visibility("default")))
#else
#define SDM_PLUGIN_EXPORT
#endif

/* The plug-in defines this function. Its declaration here exports it, whatever the compiler's
 * visibility options are. */
const sdm_shape *sdm_plugin_shape(uint32_t index) SDM_PLUGIN_EXPORT;

#ifdef __cplusplus
}
#endif
#endif
