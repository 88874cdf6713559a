/* Where numbers and indices lie in the memory that the program shares with a worker. */
#define _DEFAULT_SOURCE // MSG_NOSIGNAL, sysconf()
#include <errno.h>
#include <sys/socket.h>
#include <unistd.h>

#include "isolated_protocol.h"

/* Callbacks get arrays that are aligned as those of malloc(). */
#define ALIGNMENT 16

static size_t round_up(size_t n, size_t unit) { return (n + unit - 1) / unit * unit; }

isolated_layout sdm_isolated_layout(size_t n_real, size_t n_index)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t reals = round_up(n_real * sizeof(double), ALIGNMENT),
                 indices = round_up(n_index * sizeof(uint32_t), ALIGNMENT);
    isolated_layout l = {.n_real = n_real, .n_index = n_index, .real_pages = page};
    l.index_pages = l.real_pages + round_up(reals + 1, page);
    l.size = l.index_pages + round_up(indices + 1, page);
    l.real = l.index_pages - reals;
    l.index = l.size - indices;
    return l;
}

bool sdm_socket_send(int fd, const void *data, size_t size)
{
    for (const char *at = data; size;) {
        const ssize_t put = send(fd, at, size, MSG_NOSIGNAL);
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0) return false;
        at += put, size -= (size_t)put;
    }
    return true;
}
