/* A way for ranks to exchange data (sdm/internal/comm.h). */
#pragma once

#include <stdbool.h>
#include <stddef.h>

/* The functions of a back-end; state is its own data. Those that return bool return false when
   another rank has ended early. */
typedef struct comm_backend {
    const char *name;
    bool (*broadcast)(void *state, int root, void *data, size_t bytes);
    bool (*gather)(void *state, void *data, const size_t *at); /* as sdm_comm_gather() */
    /* As sdm_comm_scatter(). */
    bool (*scatter)(void *state, const void *from, const size_t *at, void *const *to);
    bool (*broken)(const void *state); /* [any thread] */
    /* Why another rank has ended early; valid after one of the above has told it. */
    const char *(*why)(const void *state);
    void (*abort)(void *state, const char *why);
    void (*end)(void *state); /* frees state */
} comm_backend;

/* What a back-end in a shared object has: a function of this name, which joins the processes that
   were started together. */
#define COMM_MODULE_SYMBOL "sdm_comm_module"

typedef const comm_backend *comm_module_entry(void **state, int *rank, int *size);
