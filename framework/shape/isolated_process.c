/* A worker process as the program sees it: start, requests with a limit of time, and the reason of
 * its end. */
#define _GNU_SOURCE // memfd_create(), pipe2()
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "isolated_protocol.h"
#include "sdm/internal/callback.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"

/* A process starts within this time also on a busy machine, s. */
#define START_SECONDS 30

/* ---- start and end ---- */

/* The child's ends of what it shares with the program; -1: not open. */
typedef struct child_ends {
    int socket, output;
} child_ends;

static void close_open(int *fd)
{
    if (*fd >= 0) close(*fd);
    *fd = -1;
}

/* Opens socket, pipe and memory. What a plug-in prints never blocks it: text that nobody has read
 * yet fills the pipe, and more is dropped. The memory cannot be cut while the program reads it. */
static sdm_status open_ends(isolated_worker *w, child_ends *child, sdm_error *err)
{
    int sockets[2] = {-1, -1}, pipe_ends[2] = {-1, -1};
    w->memory = memfd_create("sdmgen shape", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    const bool failed = w->memory < 0 || fcntl(w->memory, F_ADD_SEALS, F_SEAL_SHRINK) ||
                        ftruncate(w->memory, (off_t)sdm_isolated_layout(0, 0).size) ||
                        socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) ||
                        pipe2(pipe_ends, O_CLOEXEC | O_NONBLOCK);
    const int reason = errno;
    w->socket = sockets[0];
    w->output = pipe_ends[0];
    *child = (child_ends){sockets[1], pipe_ends[1]};
    return failed ? sdm_fail(err, SDM_E_IO, "plug-in %s: no connection to a process for it: %s",
                             w->plugin, strerror(reason))
                  : SDM_OK;
}

/* The descriptors keep their numbers, which the program gets as arguments. */
static int spawn(isolated_worker *w, const child_ends *child)
{
    char name[] = "sdmgen", command[] = SDM_ISOLATION_COMMAND, socket_text[16], memory_text[16];
    char *argv[] = {name, command, socket_text, memory_text, NULL};
    snprintf(socket_text, sizeof socket_text, "%d", child->socket);
    snprintf(memory_text, sizeof memory_text, "%d", w->memory);
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    sigset_t none;
    sigemptyset(&none);
    if (posix_spawn_file_actions_init(&files)) return ENOMEM;
    int failed = posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    if (!failed) failed = posix_spawn_file_actions_adddup2(&files, child->output, STDOUT_FILENO);
    if (!failed) failed = posix_spawn_file_actions_adddup2(&files, child->output, STDERR_FILENO);
    // onto themselves: they stay open
    if (!failed) failed = posix_spawn_file_actions_adddup2(&files, child->socket, child->socket);
    if (!failed) failed = posix_spawn_file_actions_adddup2(&files, w->memory, w->memory);
    if (!failed) failed = posix_spawnattr_init(&attributes);
    if (!failed) {
        posix_spawnattr_setsigmask(&attributes, &none);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
        failed = posix_spawn(&w->pid, w->how->program, &files, &attributes, argv, environ);
        posix_spawnattr_destroy(&attributes);
    }
    posix_spawn_file_actions_destroy(&files);
    return failed;
}

/* Waits for the end of the process, which is killed after `seconds`; returns its status. */
static int wait_for_end(isolated_worker *w, double seconds)
{
    int status = 0;
    const struct timespec pause = {.tv_nsec = 1000000};
    const double until = sdm_clock() + seconds;
    while (w->pid > 0) {
        const pid_t ended = waitpid(w->pid, &status, WNOHANG);
        if (ended == w->pid || (ended < 0 && errno != EINTR)) break;
        if (sdm_clock() > until) {
            kill(w->pid, SIGKILL);
            while (waitpid(w->pid, &status, 0) < 0 && errno == EINTR) {
            }
            break;
        }
        nanosleep(&pause, NULL);
    }
    w->pid = 0;
    w->ended = true;
    return status;
}

void sdm_worker_free(isolated_worker *w)
{
    if (!w) return;
    close_open(&w->socket); // a worker ends when its socket is closed
    wait_for_end(w, 1);
    close_open(&w->output);
    close_open(&w->memory);
    if (w->map) munmap(w->map, w->mapped);
    sdm_free(w);
}

sdm_status sdm_worker_start(const sdm_isolation *how, const char *path, isolated_worker **out,
                            isolated_bytes *tables, sdm_error *err)
{
    isolated_worker *w = NULL;
    sdm_status s = SDM_ALLOC(&w, 1, "worker process", err);
    if (s) return s;
    *w = (isolated_worker){.how = how, .plugin = path, .socket = -1, .output = -1, .memory = -1};
    child_ends child = {-1, -1};
    s = open_ends(w, &child, err);
    const int failed = s ? 0 : spawn(w, &child);
    close_open(&child.socket);
    close_open(&child.output);
    if (failed)
        s = sdm_fail(err, SDM_E_IO, "plug-in %s: no process for it (%s): %s", path, how->program,
                     strerror(failed));
    const isolated_request load = {
        .task = ISOLATED_LOAD, .length = (uint32_t)strlen(path) + 1, .memory = how->bytes};
    isolated_answer a;
    if (!s) s = sdm_worker_ask(w, &load, path, &a, tables, err);
    if (s)
        sdm_worker_free(w);
    else
        *out = w;
    return s;
}

/* ---- requests ---- */

/* Reads what the plug-in has printed, as far as it is there. */
static void listen_to(isolated_worker *w)
{
    char text[4096];
    for (;;) {
        const ssize_t got = read(w->output, text, sizeof text);
        if (got < 0 && errno == EINTR) continue;
        if (got == 0) close_open(&w->output);
        if (got <= 0) return;
        const size_t used = strlen(w->said), room = sizeof w->said - 1 - used,
                     n = (size_t)got < room ? (size_t)got : room;
        memcpy(w->said + used, text, n);
        w->said[used + n] = '\0';
    }
}

/* Waits until the answer can be read; false: the time is over. */
static bool wait_for_answer(isolated_worker *w)
{
    for (;;) {
        const double left = w->deadline - sdm_clock();
        w->late = left <= 0;
        if (w->late) return false;
        struct pollfd p[2] = {{.fd = w->socket, .events = POLLIN},
                              {.fd = w->output, .events = POLLIN}};
        const double ms = 1e3 * left < 1e6 ? 1e3 * left : 1e6;
        if (poll(p, 2, (int)ms + 1) <= 0) continue;
        if (p[1].revents) listen_to(w);
        if (p[0].revents) return true;
    }
}

static bool receive(isolated_worker *w, void *data, size_t size)
{
    for (char *at = data; size;) {
        const ssize_t got = wait_for_answer(w) ? read(w->socket, at, size) : 0;
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        at += got, size -= (size_t)got;
    }
    return true;
}

/* Maps the first `size` bytes of the memory. */
static bool map_memory(isolated_worker *w, size_t size)
{
    if (size <= w->mapped) return true;
    struct stat st;
    if (fstat(w->memory, &st) || (uint64_t)st.st_size < size) return false;
    if (w->map) munmap(w->map, w->mapped);
    w->mapped = 0;
    w->map = mmap(NULL, size, PROT_READ, MAP_SHARED, w->memory, 0);
    if (w->map == MAP_FAILED) w->map = NULL;
    if (w->map) w->mapped = size;
    return w->map;
}

/* The state of the worker when it ended. */
static void read_state(isolated_worker *w, isolated_state *state)
{
    *state = (isolated_state){.memory = 0};
    if (map_memory(w, sizeof *state)) memcpy(state, w->map, sizeof *state);
    state->running[sizeof state->running - 1] = '\0';
    for (char *c = state->running; *c; c++) // a plug-in may have written there
        if (!((*c >= 'a' && *c <= 'z') || *c == '_')) *c = '\0';
}

/* The first line of what the plug-in printed in its last call, as ", it printed: ...". */
static void last_words(isolated_worker *w, char *text, size_t size)
{
    if (w->output >= 0) listen_to(w);
    w->said[strcspn(w->said, "\n")] = '\0';
    snprintf(text, size, w->said[0] ? "; it printed: %s" : "%s", w->said);
}

/* Why the process ended without an answer. */
static sdm_status explain(isolated_worker *w, isolated_task task, sdm_error *err)
{
    // crashes outside of callbacks
    const char *const outside = task == ISOLATED_LOAD     ? "loading it"
                                : task == ISOLATED_CREATE ? "reading what describe() gave"
                                                          : "after a callback";
    const bool late = w->late;
    const int status = wait_for_end(w, late ? 0 : 1);
    isolated_state state;
    read_state(w, &state);
    char words[300], number[32], reason[160];
    const bool inside = state.running[0];
    last_words(w, words, sizeof words);
    if (late)
        snprintf(
            reason, sizeof reason, "the plug-in did not come to an end within %s s",
            sdm_format_real(w->how->seconds + (task == ISOLATED_LOAD ? START_SECONDS : 0), number));
    else if (WIFSIGNALED(status) && state.memory > w->how->bytes / 8 * 7)
        snprintf(reason, sizeof reason, "the plug-in needs more than %s GB of memory",
                 sdm_format_real((double)w->how->bytes / 1e9, number));
    else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL)
        snprintf(reason, sizeof reason, "the process of the plug-in was killed");
    else if (WIFSIGNALED(status) && (state.vertices || state.triangles))
        snprintf(reason, sizeof reason,
                 "it has written or read beyond the %llu %s that it reserved: let it reserve as "
                 "many as it writes",
                 (unsigned long long)(state.vertices ? state.vertices : state.triangles),
                 state.vertices ? "vertices" : "triangles");
    else if (WIFSIGNALED(status))
        snprintf(reason, sizeof reason, "%s", sdm_callback_crash_reason(WTERMSIG(status)));
    else
        snprintf(reason, sizeof reason,
                 "the plug-in called exit(%d), which it must not: it returns an error",
                 WEXITSTATUS(status));
    return sdm_fail(err, SDM_E_PLUGIN, "%s: %s%s: %s%s", w->plugin,
                    inside ? state.running : outside, inside ? "()" : "", reason, words);
}

static sdm_status receive_answer(isolated_worker *w, isolated_answer *a, isolated_bytes *said,
                                 bool *complete, sdm_error *err)
{
    char *text = NULL;
    *complete = receive(w, a, sizeof *a) && a->length <= ISOLATED_TEXT_MAX;
    if (!*complete) return SDM_OK;
    const sdm_status s = SDM_ALLOC(&text, a->length + 1, "answer of a worker process", err);
    if (s) return s;
    *complete = receive(w, text, a->length);
    if (*complete && !a->status && said) {
        *said = (isolated_bytes){.data = (uint8_t *)text, .size = a->length};
        return SDM_OK;
    }
    const sdm_status failed =
        *complete && a->status ? sdm_fail(err, SDM_E_PLUGIN, "%s", text) : SDM_OK;
    sdm_free(text);
    return failed;
}

sdm_status sdm_worker_ask(isolated_worker *w, const isolated_request *q, const void *text,
                          isolated_answer *a, isolated_bytes *said, sdm_error *err)
{
    bool complete = false;
    sdm_status s = SDM_OK;
    w->deadline = sdm_clock() + w->how->seconds + (q->task == ISOLATED_LOAD ? START_SECONDS : 0);
    w->late = false;
    w->said[0] = '\0';
    if (sdm_socket_send(w->socket, q, sizeof *q) && sdm_socket_send(w->socket, text, q->length))
        s = receive_answer(w, a, said, &complete, err);
    if (!complete && !s) s = explain(w, q->task, err);
    if (!complete) w->ended = true;
    return s;
}

sdm_status sdm_worker_data(isolated_worker *w, size_t n_real, size_t n_index, const double **real,
                           const uint32_t **index, sdm_error *err)
{
    const isolated_layout l = sdm_isolated_layout(n_real, n_index);
    if (!map_memory(w, l.size))
        return sdm_fail(err, SDM_E_PLUGIN, "%s: its answer is not in the memory of its process",
                        w->plugin);
    *real = (const double *)(const void *)(w->map + l.real);
    *index = (const uint32_t *)(const void *)(w->map + l.index);
    return SDM_OK;
}
