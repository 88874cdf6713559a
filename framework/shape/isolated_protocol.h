/* What the program and a worker process, in which a plug-in runs, say to each other.
 *
 * They share a socket and a block of memory. A request goes through the socket, with the bytes of
 * its text behind it; the answer comes back in the same way. Vertices and triangles stay in the
 * memory: first a page with the state of the worker, then the real numbers and the indices, each in
 * whole pages, which they fill from the end: the worker maps a page behind each that nobody may
 * touch, so that an index too large is a crash in the callback that used it. */
#pragma once

#include "sdm/internal/isolation.h"
#include "shape_internal.h"

#define ISOLATED_TEXT_MAX (UINT32_C(1) << 26)

typedef enum isolated_task {
    ISOLATED_LOAD = 1, /* text: the path; answers with the tables of the shapes */
    ISOLATED_CREATE,   /* text: index of the shape, values of the options; answers with the
                          parameters and their distributions */
    ISOLATED_MESH,     /* at p; n_vert, n_tri: what there is in the memory */
    ISOLATED_VELOCITY, /* at p, for n_vert vertices: n_vert * n_params * 3 numbers */
    ISOLATED_DISTANCE, /* at p and x */
    ISOLATED_MEASURE,  /* number `measure` at p and x[0], its depth */
    ISOLATED_OPEN_END, /* at p */
    ISOLATED_REPEAT,   /* text: number of threads and parameter vectors; answers with the number of
                          meshes with other bits and the first of them */
    ISOLATED_DESTROY
} isolated_task;

typedef struct isolated_request {
    isolated_task task;
    uint32_t length;            /* bytes of text */
    uint64_t memory;            /* LOAD: limit, bytes */
    uint64_t n_vert;            /* VELOCITY */
    uint32_t measure;           /* MEASURE: index of the measure */
    double p[SHAPE_PARAMS_MAX]; /* MESH, VELOCITY, DISTANCE, MEASURE, OPEN_END */
    double x[3];                /* DISTANCE, MEASURE */
} isolated_request;

typedef struct isolated_answer {
    sdm_status status;      /* not SDM_OK: the text is the message */
    uint32_t length;        /* bytes of text */
    uint64_t n_vert, n_tri; /* MESH */
    sdm_repeat repeat;      /* REPEAT */
    double value;           /* DISTANCE, MEASURE */
    sdm_open_end open_end;  /* OPEN_END */
} isolated_answer;

/* The first page of the memory. The worker writes it at any time, the program reads it when the
 * worker has ended. */
typedef struct isolated_state {
    char running[32]; /* the callback that the worker is in, "" outside */
    uint64_t memory;  /* at a crash: address space beyond that of the start, bytes */
    /* at a crash behind one of the arrays of reserve(): the number of vertices or triangles that it
     * has room for; else 0 */
    uint64_t vertices, triangles;
} isolated_state;

/* ---- isolated_bytes.c: texts of requests and answers ---- */

/* Bytes that are written at the end and read from the beginning. Zero-initialise; free data with
 * sdm_free(). Reading beyond the end gives zeros and sets failed. */
typedef struct isolated_bytes {
    uint8_t *data;
    size_t size, capacity, at;
    bool failed;
} isolated_bytes;

void sdm_bytes_put_params(isolated_bytes *b, const sdm_param *params, size_t n);
void sdm_bytes_put_distributions(isolated_bytes *b, const sdm_distribution *d, size_t n);
void sdm_bytes_put_options(isolated_bytes *b, const sdm_option_value *options, size_t n);
void sdm_bytes_put_shape(isolated_bytes *b, const sdm_shape *shape);
void sdm_bytes_put_count(isolated_bytes *b, size_t n);
void sdm_bytes_put_reals(isolated_bytes *b, const double *x, size_t n);

/* Texts that are read point into b->data; the arrays are new and freed with sdm_free(). b->failed:
 * these are not bytes that were put. */
size_t sdm_bytes_get_count(isolated_bytes *b, size_t most);
sdm_param *sdm_bytes_get_params(isolated_bytes *b, uint32_t *n);
sdm_distribution *sdm_bytes_get_distributions(isolated_bytes *b, size_t n);
sdm_option_value *sdm_bytes_get_options(isolated_bytes *b, size_t n);

/* A new array of the rest. */
double *sdm_bytes_get_reals(isolated_bytes *b, size_t *n);

/* Reads a table: its callbacks are those of `callbacks`, as far as the shape that was put has them;
 * params, options and measures are new arrays. */
sdm_shape sdm_bytes_get_shape(isolated_bytes *b, const sdm_shape *callbacks);

/* ---- isolated_memory.c: the memory that both share ---- */

/* Where `n_real` numbers and `n_index` indices lie in the memory. */
typedef struct isolated_layout {
    size_t n_real, n_index;
    size_t real, index;             /* offsets of the first ones */
    size_t real_pages, index_pages; /* offsets of their first pages */
    size_t size;                    /* of the memory, bytes */
} isolated_layout;

isolated_layout sdm_isolated_layout(size_t n_real, size_t n_index);

/* Blocking, without SIGPIPE. false: the other end is closed. */
bool sdm_socket_send(int fd, const void *data, size_t size);

/* ---- isolated_process.c: a worker as the program sees it ---- */

typedef struct isolated_worker isolated_worker;

struct isolated_worker {
    isolated_worker *next; /* in a list of idle ones */
    const sdm_isolation *how;
    const char *plugin; /* path, for messages */
    int pid, socket, output, memory;
    uint8_t *map;
    size_t mapped;
    double deadline; /* of the call, by sdm_clock() */
    bool late;       /* the last call was ended for its time */
    bool ended;      /* it takes no more requests */
    char said[256];  /* begin of what it has printed in this call */
};

/* Starts a process that has loaded the plug-in `path`; *tables: what it has, freed with
 * sdm_free(tables->data). `how` and `path` stay valid as long as the worker. SDM_E_PLUGIN,
 * SDM_E_IO: no process, SDM_E_NOMEM. */
sdm_status sdm_worker_start(const sdm_isolation *how, const char *path, isolated_worker **out,
                            isolated_bytes *tables, sdm_error *err);

/* Ends the process. NULL is allowed. */
void sdm_worker_free(isolated_worker *w);

/* Sends a request with q->length bytes of text and waits for the answer. *said: its text, freed
 * with sdm_free(); NULL: not wanted. SDM_E_PLUGIN: the callback failed, or it ended the worker
 * (w->ended). */
sdm_status sdm_worker_ask(isolated_worker *w, const isolated_request *q, const void *text,
                          isolated_answer *a, isolated_bytes *said, sdm_error *err);

/* The numbers and indices of an answer in the memory of the worker. SDM_E_PLUGIN: there are less.
 */
sdm_status sdm_worker_data(isolated_worker *w, size_t n_real, size_t n_index, const double **real,
                           const uint32_t **index, sdm_error *err);

/* ---- isolated.c: shapes whose callbacks run in workers ---- */

/* Loads the plug-in at an absolute path into a worker and adds its shapes to the registry; *object
 * is freed with sdm_isolated_close(), after the shapes. Errors of sdm_worker_start(). */
sdm_status sdm_isolated_load(sdm_registry *r, const sdm_isolation *how, const char *path,
                             void **object, sdm_error *err);
void sdm_isolated_close(void *object);
