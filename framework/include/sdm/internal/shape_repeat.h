/* Why a shape gives other meshes when they are made again. */
#pragma once

#include "sdm/internal/isolation.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sdm_repeat_cause {
    SDM_REPEAT_UNKNOWN = 0,
    SDM_REPEAT_HISTORY, /* the mesh depends on the calls before */
    SDM_REPEAT_BEHIND,  /* mesh() reads values behind the last parameter */
    SDM_REPEAT_UNSET,   /* mesh() reads memory that it has not written */
    SDM_REPEAT_THREADS, /* the mesh changes when several threads call at once */
    SDM_REPEAT_PROCESS, /* the mesh is another one in a process that made another shape first */
    SDM_REPEAT_BESIDE,  /* the mesh is another one after a call in which one parameter differs */
    SDM_REPEAT_OPTION   /* the mesh is another one after that of an instance with another option */
} sdm_repeat_cause;

typedef struct sdm_repeat {
    size_t unlike; /* meshes with other bits */
    size_t first;  /* the first of them */
    sdm_repeat_cause cause;
    /* BEHIND: the index of the first value that mesh() must not read; BESIDE: of the
     * parameter; OPTION: of the option */
    size_t param;
} sdm_repeat;

/* Makes some of the n meshes at p[n][n_params] again, fewer if they are large, also right after a
 * mesh of which a single parameter differs, each in turn; brief: fewer, and threads for a tenth of
 * a second. *out: the first cause found, BESIDE in place of HISTORY if a parameter decides; cause
 * UNKNOWN and unlike 0 if there is none. Several threads at once are tested unless the shape is
 * isolated, where each has a process. A call that ends the worker of an isolated shape is no error.
 * SDM_E_NOMEM. */
sdm_status sdm_repeat_find(const sdm_instance *shape, const double *p, size_t n, bool brief,
                           sdm_repeat *out, sdm_error *err);

/* How a plug-in is loaded into another process. */
typedef struct sdm_repeat_process {
    const char *plugin; /* its file; NULL: there is no other process */
    sdm_isolation how;
} sdm_repeat_process;

/* Makes some of the n meshes at p[n][n_params] here and in another process, there that of the last
 * shape first, and compares their bits; then meshes beside other shapes, of which a single
 * parameter differs, here right after those shapes. *out: cause PROCESS or BESIDE, or UNKNOWN and
 * unlike 0. Takes the start of a process, at most 4 + n_params meshes in it, and 4 + 2 n_params
 * here. SDM_E_UNSUPPORTED: there are no such processes here;
 * SDM_E_IO, SDM_E_PLUGIN: the process or the plug-in in it fails. */
sdm_status sdm_repeat_in_process(const sdm_instance *shape, const sdm_repeat_process *process,
                                 const double *p, size_t n, sdm_repeat *out, sdm_error *err);

/* BESIDE, of the parameter NAME: "mesh() depends on an earlier call: ...". */
#define SDM_REPEAT_BESIDE_TEXT                                                                     \
    "mesh() depends on an earlier call: after a call in which only '%s' differs it gives another " \
    "mesh"

/* What the author of the shape has done, and what to do: a text without a full stop. */
const char *sdm_repeat_advice(sdm_repeat_cause cause);

#ifdef __cplusplus
}
#endif
