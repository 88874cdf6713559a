/* The processes of a training, for the back-ends. */
#pragma once

#include "comm_backend.h"
#include "sdm/internal/comm.h"

struct sdm_comm {
    const comm_backend *backend;
    void *state;
    int rank, size;
    bool agreed;
};
