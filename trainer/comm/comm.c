/* Broadcasts, gathers and scatters between ranks, for every back-end. */
#include <string.h>

#include "comm_types.h"
#include "sdm/memory.h"

int sdm_comm_rank(const sdm_comm *c) { return c ? c->rank : 0; }

int sdm_comm_size(const sdm_comm *c) { return c ? c->size : 1; }

const char *sdm_comm_name(const sdm_comm *c) { return c ? c->backend->name : "one process"; }

size_t sdm_comm_first(const sdm_comm *c, size_t n, int rank)
{
    const size_t size = (size_t)sdm_comm_size(c), r = (size_t)rank, left = n % size;
    return r * (n / size) + (r < left ? r : left);
}

sdm_comm_part sdm_comm_own(const sdm_comm *c, size_t n)
{
    const int rank = sdm_comm_rank(c);
    return (sdm_comm_part){sdm_comm_first(c, n, rank), sdm_comm_first(c, n, rank + 1)};
}

static sdm_status result(sdm_comm *c, bool done, sdm_error *err)
{
    c->agreed = false;
    return done ? SDM_OK : sdm_fail(err, SDM_E_IO, "%s", c->backend->why(c->state));
}

sdm_status sdm_comm_broadcast(sdm_comm *c, int root, void *data, size_t bytes, sdm_error *err)
{
    return !c || !bytes ? SDM_OK
                        : result(c, c->backend->broadcast(c->state, root, data, bytes), err);
}

sdm_status sdm_comm_gather(sdm_comm *c, void *data, const size_t *at, sdm_error *err)
{
    return c ? result(c, c->backend->gather(c->state, data, at), err) : SDM_OK;
}

sdm_status sdm_comm_gather_shares(sdm_comm *c, void *data, size_t n, size_t bytes, sdm_error *err)
{
    size_t *at = NULL;
    if (!c) return SDM_OK;
    sdm_status s = SDM_ALLOC(&at, (size_t)c->size + 1, "shares of the ranks", err);
    for (int r = 0; r <= c->size && !s; r++) at[r] = sdm_comm_first(c, n, r) * bytes;
    if (!s) s = sdm_comm_gather(c, data, at, err);
    sdm_free(at);
    return s;
}

sdm_status sdm_comm_scatter(sdm_comm *c, const void *from, const size_t *at, void *const *to,
                            sdm_error *err)
{
    return c ? result(c, c->backend->scatter(c->state, from, at, to), err) : SDM_OK;
}

sdm_status sdm_comm_least(sdm_comm *c, size_t *value, sdm_error *err)
{
    size_t least = *value;
    sdm_status s = SDM_OK;
    for (int r = 0; r < sdm_comm_size(c) && !s; r++) {
        size_t other = *value;
        s = sdm_comm_broadcast(c, r, &other, sizeof other, err);
        if (other < least) least = other;
    }
    *value = least;
    return s;
}

sdm_status sdm_comm_agree(sdm_comm *c, sdm_status s, sdm_error *err)
{
    int *all = NULL, root = 0;
    sdm_error local = {0};
    if (!c) return s;
    if (!err) err = &local;
    sdm_status sent = SDM_ALLOC(&all, (size_t)c->size, "states of the ranks", err);
    if (sent) return sent;
    all[c->rank] = (int)s;
    sent = sdm_comm_gather_shares(c, all, (size_t)c->size, sizeof *all, err);
    while (!sent && root < c->size && !all[root]) root++;
    const bool failed = !sent && root < c->size;
    if (failed) {
        sent = sdm_comm_broadcast(c, root, err, sizeof *err, err);
        c->agreed = !sent;
        if (!sent) sent = (sdm_status)all[root];
    }
    sdm_free(all);
    return sent;
}

bool sdm_comm_agreed(const sdm_comm *c) { return c && c->agreed; }

bool sdm_comm_broken(const sdm_comm *c) { return c && c->backend->broken(c->state); }

void sdm_comm_abort(sdm_comm *c, const char *why)
{
    if (c) c->backend->abort(c->state, why);
}

void sdm_comm_end(sdm_comm **c)
{
    if (!*c) return;
    (*c)->backend->end((*c)->state);
    sdm_free(*c);
    *c = NULL;
}
