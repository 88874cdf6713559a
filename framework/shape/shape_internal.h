/* Declarations shared by the source files of this folder. */
#pragma once

#include "sdm/internal/shape_repeat.h"
#include "sdm/mesh.h"
#include "sdm/registry.h"

#define SHAPE_PARAMS_MAX 64
/* Behind the parameters mesh() finds so many values that are NaN: one that reads them fails. */
#define SHAPE_PARAMS_BEHIND 16
#define SHAPE_OPTIONS_MAX 64
#define SHAPE_MEASURES_MAX 64

/* shape_check.c: copies min(size, sizeof(sdm_shape)) bytes of a plug-in's table to *out (further
   members become zero) and checks the contents. `origin` is the start of error messages.
   SDM_E_PLUGIN. */
sdm_status sdm_shape_copy_checked(const sdm_shape *table, const char *origin, sdm_shape *out,
                                  sdm_error *err);

/* shape_check.c: checks names, ranges and defaults of params[n]. `who` is the start of error
 * messages. SDM_E_PLUGIN. */
sdm_status sdm_shape_check_params(const char *who, const sdm_param *params, uint32_t n,
                                  sdm_error *err);

/* registry.c: removes the shapes from index `count` on. */
void sdm_registry_shrink(sdm_registry *r, size_t count);

/* registry.c: makes sdm_registry_free() call close(object), where `object` is a shared object from
   the file `path` that holds shapes of the registry. SDM_E_NOMEM; then the caller still owns the
   object. */
sdm_status sdm_registry_keep(sdm_registry *r, const char *path, void *object,
                             void (*close)(void *object), sdm_error *err);

/* registry.c: path number `index` of those given to sdm_registry_keep(); NULL: there are fewer. */
const char *sdm_registry_kept(const sdm_registry *r, size_t index);

/* registry.c: adds a message, about a folder or a file, to those of sdm_registry_skipped().
 * SDM_E_NOMEM. */
sdm_status sdm_registry_skip(sdm_registry *r, const char *message, bool folder, sdm_error *err);

/* registry.c: how plug-ins are isolated; NULL: they run in this process. */
const struct sdm_isolation *sdm_registry_isolation(const sdm_registry *r);

/* registry.c: plug-ins that are loaded from now on are isolated as *how says. SDM_E_NOMEM. */
sdm_status sdm_registry_set_isolation(sdm_registry *r, const struct sdm_isolation *how,
                                      sdm_error *err);

/* options.c: converts the given texts to values[shape->n_options]; the texts of the values are
 * stored in the new block *text, which the caller frees with sdm_free(). SDM_E_ARG, SDM_E_CONFIG,
 * SDM_E_NOMEM. */
sdm_status sdm_shape_parse_options(const sdm_shape *shape, const sdm_named_text *given,
                                   size_t n_given, const char *base_dir, sdm_option_value *values,
                                   char **text, sdm_error *err);

/* host.c: state of one callback. host->reserve() allocates in `mesh` if it is not NULL, otherwise
 * in a block of the call. files: whether the callback may read files. sdm_host_call_end() frees the
 * blocks of the call. */
typedef struct host_call {
    sdm_host host;
    const sdm_shape *shape; /* in create(): the table as the instance has it */
    sdm_mesh *mesh;
    bool files;
    /* reserve() fills the arrays that it gives to mesh() with this byte: by default 0xff, so that a
     * coordinate that mesh() forgets to write is NaN */
    int fill;
    bool fill_stack; /* reserve() also fills the stack with it, for sdm_shape_repeat() */
    struct host_block *blocks;
    sdm_error err; /* SDM_OK until a function of the host fails */
} host_call;

void sdm_host_call_begin(host_call *c, sdm_mesh *mesh, bool files);
void sdm_host_call_end(host_call *c);

/* host.c: behind the arrays of reserve() lie so many vertices and triangles of this byte, which a
 * callback must leave as they are. */
#define SHAPE_BEHIND 64
#define SHAPE_UNUSED 0xA5

/* host.c: are the bytes from `from` to `to` SHAPE_UNUSED? */
bool sdm_is_unused(const void *from, const void *to);

/* host.c: SDM_E_PLUGIN: mesh() has written behind the arrays of m, which are those of reserve(). */
sdm_status sdm_host_check_behind(const sdm_mesh *m, sdm_error *err);

/* host.c: reports the error of a callback that returned non-zero: stores the message of the host,
 * or one with the name of the callback and the value returned. Returns SDM_E_NOMEM if memory was
 * short, else `otherwise`. */
sdm_status sdm_host_call_failed(const host_call *c, const char *callback, int returned,
                                sdm_status otherwise, sdm_error *err);

/* callback.c: the calling thread is in the callback `function` of the shape from begin to end; p:
 * its parameters, NULL: it gets none. */
void sdm_callback_begin(const sdm_instance *s, const char *function, const double *p);
void sdm_callback_end(void);

/* callback.c: from now on place[size] holds the name of the callback that the process is in, "" for
 * none; for processes with one thread that calls. */
void sdm_callback_show(char *place, size_t size);

/* velocity.c: sdm_instance_velocity() by differences of meshes, whatever callbacks the shape has.
 */
sdm_status sdm_velocity_by_differences(const sdm_instance *s, const double *p, size_t n_vert,
                                       double *velocity, sdm_error *err);

struct sdm_instance {
    const sdm_shape *shape;
    void *self;
    const sdm_param *params;
    sdm_distribution *distributions; /* [n_params] */
    size_t n_params;
    sdm_option_value *options;
    char *text;
};

/* instance.c: makes an instance with the values options[shape->n_options], whose texts are in the
 * block `text`. Takes both, also after an error. Errors of sdm_instance_create(). */
sdm_status sdm_instance_start(const sdm_shape *shape, sdm_option_value *options, char *text,
                              sdm_instance **out, sdm_error *err);

/* instance.c: sdm_instance_mesh() without a check of the parameters, which a shape need not bear.
 */
sdm_status sdm_instance_mesh_anywhere(const sdm_instance *s, const double *p, sdm_mesh *out,
                                      sdm_error *err);

/* instance.c: the same; the arrays that mesh() has to write, and the stack behind its variables,
 * are full of the byte `fill`. */
sdm_status sdm_instance_mesh_filled(const sdm_instance *s, const double *p, int fill, sdm_mesh *out,
                                    sdm_error *err);

/* stack_fill.c: fills the stack where the next calls of the caller have their variables. */
void sdm_fill_stack(int fill);

/* mesh_checksum.c: of the numbers, vertices and triangles of a mesh. */
uint64_t sdm_mesh_checksum(const sdm_mesh *m);

/* shape_repeat.c: makes the meshes at p[n][n_params] one after the other and again: backwards, with
 * other values behind the parameters, and with other bytes in the memory that mesh() has to write.
 * A mesh that can be made at one time and not at another counts as unlike. Runs in one worker
 * process if the shape is isolated. SDM_E_NOMEM; SDM_E_PLUGIN: a call has ended the worker. */
sdm_status sdm_shape_repeat(const sdm_instance *s, const double *p, size_t n, sdm_repeat *out,
                            sdm_error *err);

/* shape_repeat.c: makes the meshes one after the other, then all of them again and again on
 * n_threads at once, for `seconds` (a quarter of a second if the shape is isolated). Errors as
 * above. */
sdm_status sdm_shape_repeat_at_once(const sdm_instance *s, const double *p, size_t n, int n_threads,
                                    double seconds, sdm_repeat *out, sdm_error *err);
#define SHAPE_REPEAT_SECONDS 0.25

/* shape_beside.c: makes some of the shapes p[n][n_params], each right after one in which a single
 * parameter differs, and compares their bits: *out: cause BESIDE, or HISTORY if no parameter
 * decides, or UNKNOWN and unlike 0. */
void sdm_shape_repeat_beside(const sdm_instance *s, const double *p, size_t n, bool brief,
                             sdm_repeat *out);

/* shape_beside.c: q[n_params] = shape `from` of p[n][n_params], with parameter k moved by `share`
 * of the way to its value in shape `to`, or in another shape if both are the same. false: it has
 * the same value in all shapes. */
bool sdm_shape_step_beside(const double *p, size_t n, size_t n_params, size_t from, size_t to,
                           size_t k, double share, double *q);

/* shape_other_option.c: makes the mesh at p[2][n_params], of which the two differ, right after that
 * of another instance, each option in turn: *out: cause OPTION, or UNKNOWN and unlike 0. Runs in a
 * worker process if the shape is isolated: another value of an option may crash. Errors of
 * sdm_shape_repeat(). */
sdm_status sdm_shape_repeat_options(const sdm_instance *s, const double *p, sdm_repeat *out,
                                    sdm_error *err);

/* isolated.c: the callbacks of the shape run in worker processes. */
bool sdm_is_isolated(const sdm_instance *s);

/* isolated.c: how many calls have ended a worker of an isolated shape. */
size_t sdm_isolated_ends(const sdm_instance *s);

/* isolated.c: sdm_shape_repeat() (one thread), sdm_shape_repeat_at_once() (more) or
 * sdm_shape_repeat_options() (n_threads is 0) in a worker of an isolated shape. */
sdm_status sdm_isolated_repeat(const sdm_instance *s, const double *p, size_t n, int n_threads,
                               sdm_repeat *out, sdm_error *err);

/* instance.c: SDM_E_PLUGIN: `out` is not what reserve() has given to mesh(). */
sdm_status sdm_mesh_out_check(const sdm_mesh_out *out, const sdm_mesh_out *given, sdm_error *err);

/* instance.c: inserts "shape 'NAME' at a=4.4 alpha=0.5 ...: " before the text of *err and returns
 * `status`. */
sdm_status sdm_instance_fail_at(const sdm_instance *s, const double *p, sdm_status status,
                                sdm_error *err);
