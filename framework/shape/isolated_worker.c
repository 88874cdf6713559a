/* The work of a worker process: loads one plug-in and calls the callbacks of one instance. */
#define _GNU_SOURCE // ftruncate(), sigaltstack(), MAP_ANONYMOUS
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include "isolated_protocol.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/sanitized.h"
#include "sdm/memory.h"

#define ARRAY_MAX ((size_t)1 << 31) // vertices, triangles

typedef struct worker {
    int socket, memory;
    isolated_state *state;
    sdm_registry *registry;
    sdm_instance *instance;
    isolated_layout layout; // of the arrays; size 0: none yet
    uint8_t *arrays;        // the pages from layout.real_pages on, with pages between and behind
    size_t mapped;
} worker;

/* ---- limits ---- */

static struct {
    const worker *w;
    uint64_t bytes; // address space at the start
} crash;

/* Notes whether mesh() used the page behind one of its arrays, at the address `at`. */
static void note_beyond(const worker *w, const uint8_t *at)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE),
                 reals = w->layout.index_pages - w->layout.real_pages;
    const uint8_t *end = w->arrays + w->mapped;
    if (!w->arrays || strcmp(w->state->running, "mesh")) return;
    if (at >= w->arrays + reals && at < w->arrays + reals + page)
        w->state->vertices = w->layout.n_real / 3;
    if (at >= end - page && at < end) w->state->triangles = w->layout.n_index / 3;
}

/* Notes how much memory there was, as a plug-in that gets none crashes, and where it crashed. */
static void on_crash(int signal_number, siginfo_t *info, void *context)
{
    (void)context;
    const uint64_t now = sdm_address_space();
    crash.w->state->memory = now > crash.bytes ? now - crash.bytes : 0;
    if (signal_number == SIGSEGV) note_beyond(crash.w, info->si_addr);
    signal(signal_number, SIG_DFL);
    raise(signal_number);
}

static void watch_crashes(worker *w)
{
    static char stack[1 << 16]; // the own one may have overflowed
    const stack_t own = {.ss_sp = stack, .ss_size = sizeof stack};
    struct sigaction action;
    static const int signals[] = {SIGSEGV, SIGBUS, SIGABRT};
    crash.w = w;
    crash.bytes = sdm_address_space();
    sigaltstack(&own, NULL);
    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_crash;
    action.sa_flags = SA_ONSTACK | SA_SIGINFO;
    sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < sizeof signals / sizeof *signals && !SDM_SANITIZED; i++)
        sigaction(signals[i], &action, NULL);
}

/* Sanitizers need terabytes of addresses. */
static void limit_memory(uint64_t bytes)
{
    struct rlimit limit;
    const struct rlimit none = {0, 0};
    setrlimit(RLIMIT_CORE, &none);
    if (SDM_SANITIZED || getrlimit(RLIMIT_AS, &limit)) return;
    const rlim_t most = (rlim_t)(sdm_address_space() + bytes);
    if (limit.rlim_max != RLIM_INFINITY && limit.rlim_max < most) return;
    limit.rlim_cur = limit.rlim_max = most;
    setrlimit(RLIMIT_AS, &limit);
}

/* Ends this process as soon as the program has ended, even while a callback is running. */
static void *watch_program(void *user)
{
    const worker *w = user;
    struct pollfd p = {.fd = w->socket};
    while (!(p.revents & (POLLHUP | POLLERR | POLLNVAL))) poll(&p, 1, -1);
    _exit(0);
}

static bool start_watch(worker *w)
{
    pthread_t thread;
    pthread_attr_t attributes;
    sigset_t all, before;
    sigfillset(&all);
    if (pthread_attr_init(&attributes)) return false;
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    pthread_sigmask(SIG_BLOCK, &all, &before); // signals are for the thread of the callbacks
    const int failed = pthread_create(&thread, &attributes, watch_program, w);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attributes);
    return !failed;
}

/* ---- arrays ---- */

/* Unmaps the arrays. */
static void take_back(worker *w)
{
    if (w->arrays) munmap(w->arrays, w->mapped);
    w->arrays = NULL;
}

/* Maps `n_real` numbers and `n_index` indices. The pages behind each of them stay without access.
 * The bytes before them, and the few behind, get a value that shows whether they were written. */
static bool lay_out(worker *w, size_t n_real, size_t n_index)
{
    const isolated_layout l = sdm_isolated_layout(n_real, n_index);
    if (w->arrays && l.n_real == w->layout.n_real && l.n_index == w->layout.n_index) return true;
    take_back(w);
    const size_t page = (size_t)sysconf(_SC_PAGESIZE), reals = l.index_pages - l.real_pages,
                 indices = l.size - l.index_pages;
    if (ftruncate(w->memory, (off_t)l.size) && errno != EPERM) return false; // EPERM: large enough
    uint8_t *at = mmap(NULL, reals + indices + 2 * page, PROT_NONE,
                       MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (at == MAP_FAILED) return false;
    w->arrays = at;
    w->mapped = reals + indices + 2 * page;
    w->layout = l;
    const int access = PROT_READ | PROT_WRITE, kind = MAP_SHARED | MAP_FIXED;
    if (mmap(at, reals, access, kind, w->memory, (off_t)l.real_pages) == MAP_FAILED ||
        mmap(at + reals + page, indices, access, kind, w->memory, (off_t)l.index_pages) ==
            MAP_FAILED) {
        take_back(w);
        return false;
    }
    memset(at, SHAPE_UNUSED, page);
    memset(at + reals - 16, SHAPE_UNUSED, 16);
    memset(at + reals + page, SHAPE_UNUSED, page);
    memset(at + reals + page + indices - 16, SHAPE_UNUSED, 16);
    return true;
}

static double *reals_of(const worker *w)
{
    return (double *)(void *)(w->arrays + (w->layout.real - w->layout.real_pages));
}

static uint32_t *indices_of(const worker *w)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    return (uint32_t *)(void *)(w->arrays + (w->layout.index - w->layout.real_pages) + page);
}

/* SDM_E_PLUGIN: the callback wrote next to its arrays. */
static sdm_status check_around(worker *w, sdm_error *err)
{
    const isolated_layout *l = &w->layout;
    const uint8_t *real = (const uint8_t *)reals_of(w), *index = (const uint8_t *)indices_of(w);
    const size_t before_real = l->real - l->real_pages, before_index = l->index - l->index_pages,
                 page = (size_t)sysconf(_SC_PAGESIZE);
    if (sdm_is_unused(real - (before_real < page ? before_real : page), real) &&
        sdm_is_unused(real + l->n_real * sizeof(double),
                      w->arrays + (l->index_pages - l->real_pages)) &&
        sdm_is_unused(index - (before_index < page ? before_index : page), index) &&
        sdm_is_unused(index + l->n_index * sizeof(uint32_t), index + (l->size - l->index)))
        return SDM_OK;
    take_back(w); // the next call gets new ones
    return sdm_fail(err, SDM_E_PLUGIN, "%s() wrote outside of the arrays of reserve()",
                    w->state->running);
}

/* ---- callbacks ---- */

typedef struct worker_call {
    host_call call; // first: the context of the host points to it
    worker *worker;
    sdm_mesh_out given;
} worker_call;

static int reserve(const sdm_host *host, sdm_mesh_out *out, size_t n_vert, size_t n_tri)
{
    worker_call *c = host->ctx;
    if (n_vert > ARRAY_MAX || n_tri > ARRAY_MAX || !lay_out(c->worker, 3 * n_vert, 3 * n_tri))
        return (int)sdm_fail(&c->call.err, SDM_E_PLUGIN,
                             "mesh() asks for %zu vertices and %zu triangles: there is no memory "
                             "for them",
                             n_vert, n_tri);
    c->given = (sdm_mesh_out){.vert = reals_of(c->worker),
                              .tri = indices_of(c->worker),
                              .n_vert = n_vert,
                              .n_tri = n_tri};
    // what the callback does not write is found
    memset(c->given.vert, 0xFF, 3 * n_vert * sizeof *c->given.vert);
    memset(c->given.tri, 0xFF, 3 * n_tri * sizeof *c->given.tri);
    *out = c->given;
    return 0;
}

static sdm_status check_params(const worker *w, const double *p, const double *sent, sdm_error *err)
{
    return memcmp(p, sent, w->instance->n_params * sizeof *p)
               ? sdm_fail(err, SDM_E_PLUGIN, "%s() changed the parameters that it was given",
                          w->state->running)
               : SDM_OK;
}

static sdm_status make_mesh(worker *w, const isolated_request *q, isolated_answer *a,
                            sdm_error *err)
{
    const sdm_instance *s = w->instance;
    worker_call c = {.worker = w};
    sdm_mesh_out filled = {0};
    double p[SHAPE_PARAMS_MAX + SHAPE_PARAMS_BEHIND];
    memcpy(p, q->p, s->n_params * sizeof *p);
    for (size_t i = 0; i < SHAPE_PARAMS_BEHIND; i++) p[s->n_params + i] = NAN;
    sdm_host_call_begin(&c.call, NULL, false);
    c.call.host.reserve = reserve;
    const int failed = s->shape->mesh(s->self, &c.call.host, s->options, p, &filled);
    sdm_status status = failed ? sdm_host_call_failed(&c.call, "mesh", failed, SDM_E_PLUGIN, err)
                               : sdm_mesh_out_check(&filled, &c.given, err);
    if (!status) status = check_params(w, p, q->p, err);
    if (!status) status = check_around(w, err);
    sdm_host_call_end(&c.call);
    a->n_vert = filled.n_vert;
    a->n_tri = filled.n_tri;
    return status;
}

/* Ends the call of a callback. The status of its return value `failed`, 0: SDM_OK. */
static sdm_status end_call(host_call *call, const char *name, int failed, sdm_error *err)
{
    const sdm_status s =
        failed ? sdm_host_call_failed(call, name, failed, SDM_E_PLUGIN, err) : SDM_OK;
    sdm_host_call_end(call);
    return s;
}

static sdm_status make_velocity(worker *w, const isolated_request *q, sdm_error *err)
{
    const sdm_instance *s = w->instance;
    host_call call;
    double p[SHAPE_PARAMS_MAX];
    memcpy(p, q->p, sizeof p);
    if (q->n_vert > ARRAY_MAX || !lay_out(w, 3 * (size_t)q->n_vert * s->n_params, 0))
        return sdm_fail(err, SDM_E_PLUGIN, "velocity(): there is no memory for it");
    memset(reals_of(w), 0xFF, 3 * (size_t)q->n_vert * s->n_params * sizeof(double));
    sdm_host_call_begin(&call, NULL, false);
    const int failed =
        s->shape->velocity(s->self, &call.host, s->options, p, (size_t)q->n_vert, reals_of(w));
    sdm_status status = end_call(&call, "velocity", failed, err);
    if (!status) status = check_params(w, p, q->p, err);
    return status ? status : check_around(w, err);
}

static sdm_status make_distance(worker *w, const isolated_request *q, isolated_answer *a,
                                sdm_error *err)
{
    const sdm_instance *s = w->instance;
    host_call call;
    sdm_host_call_begin(&call, NULL, false);
    const int failed = s->shape->distance(s->self, &call.host, s->options, q->p, q->x, &a->value);
    return end_call(&call, "distance", failed, err);
}

static sdm_status make_measure(worker *w, const isolated_request *q, isolated_answer *a,
                               sdm_error *err)
{
    const sdm_instance *s = w->instance;
    host_call call;
    if (q->measure >= s->shape->n_measures)
        return sdm_fail(err, SDM_E_INTERNAL, "no measure %u", (unsigned)q->measure);
    sdm_host_call_begin(&call, NULL, false);
    const int failed =
        s->shape->measure(s->self, &call.host, s->options, q->p, q->measure, q->x[0], &a->value);
    return end_call(&call, "measure", failed, err);
}

static sdm_status make_open_end(worker *w, const isolated_request *q, isolated_answer *a,
                                sdm_error *err)
{
    const sdm_instance *s = w->instance;
    host_call call;
    a->open_end = (sdm_open_end){.radius = NAN};
    sdm_host_call_begin(&call, NULL, false);
    const int failed = s->shape->open_end(s->self, &call.host, s->options, q->p, &a->open_end);
    return end_call(&call, "open_end", failed, err);
}

/* ---- requests ---- */

static sdm_status load(worker *w, const isolated_request *q, const char *path,
                       isolated_bytes *answer, sdm_error *err)
{
    watch_crashes(w);
    limit_memory(q->memory);
    sdm_status s = sdm_registry_create(&w->registry, err);
    if (!s) s = sdm_registry_load(w->registry, path, err);
    if (s) return s;
    const size_t n = sdm_registry_count(w->registry);
    sdm_bytes_put_count(answer, n);
    for (size_t i = 0; i < n; i++) sdm_bytes_put_shape(answer, sdm_registry_at(w->registry, i));
    return SDM_OK;
}

static sdm_status create(worker *w, isolated_bytes *text, isolated_bytes *answer, sdm_error *err)
{
    const sdm_shape *shape = sdm_registry_at(w->registry, sdm_bytes_get_count(text, UINT32_MAX));
    if (!shape || w->instance) return sdm_fail(err, SDM_E_INTERNAL, "a worker has one instance");
    sdm_option_value *options = sdm_bytes_get_options(text, shape->n_options);
    // the instance takes the text, in which those of the options are
    char *texts = (char *)text->data;
    text->data = NULL;
    const sdm_status s = sdm_instance_start(shape, options, texts, &w->instance, err);
    if (s) return s;
    sdm_bytes_put_params(answer, w->instance->params, w->instance->n_params);
    sdm_bytes_put_distributions(answer, w->instance->distributions, w->instance->n_params);
    return SDM_OK;
}

static sdm_status repeat(worker *w, isolated_bytes *text, isolated_answer *a, sdm_error *err)
{
    size_t n;
    const int n_threads = (int)sdm_bytes_get_count(text, 1024);
    double *p = sdm_bytes_get_reals(text, &n);
    const size_t n_shapes = n / w->instance->n_params;
    sdm_status s = text->failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for parameters") : SDM_OK;
    if (!s && n_threads > 1)
        s = sdm_shape_repeat_at_once(w->instance, p, n_shapes, n_threads, SHAPE_REPEAT_SECONDS,
                                     &a->repeat, err);
    else if (!s && n_threads)
        s = sdm_shape_repeat(w->instance, p, n_shapes, &a->repeat, err);
    else if (!s)
        s = sdm_shape_repeat_options(w->instance, p, &a->repeat, err);
    sdm_free(p);
    return s;
}

static sdm_status destroy(worker *w)
{
    sdm_instance_free(w->instance);
    w->instance = NULL;
    return SDM_OK;
}

/* The callback that the request is about is named from outside of the shape's code: a shape may
 * write over everything here. */
static sdm_status work(worker *w, const isolated_request *q, isolated_bytes *text,
                       isolated_answer *a, isolated_bytes *answer, sdm_error *err)
{
    if (q->task == ISOLATED_LOAD && !w->registry)
        return load(w, q, (const char *)text->data, answer, err);
    if (q->task == ISOLATED_CREATE && w->registry) return create(w, text, answer, err);
    if (!w->instance) return sdm_fail(err, SDM_E_INTERNAL, "a worker without an instance");
    if (q->task == ISOLATED_DESTROY) return destroy(w);
    if (q->task == ISOLATED_REPEAT) return repeat(w, text, a, err);
    static const char *const names[] = {[ISOLATED_MESH] = "mesh",
                                        [ISOLATED_VELOCITY] = "velocity",
                                        [ISOLATED_DISTANCE] = "distance",
                                        [ISOLATED_MEASURE] = "measure",
                                        [ISOLATED_OPEN_END] = "open_end"};
    sdm_callback_begin(w->instance, names[q->task], q->p);
    const sdm_status s = q->task == ISOLATED_MESH       ? make_mesh(w, q, a, err)
                         : q->task == ISOLATED_VELOCITY ? make_velocity(w, q, err)
                         : q->task == ISOLATED_MEASURE  ? make_measure(w, q, a, err)
                         : q->task == ISOLATED_OPEN_END ? make_open_end(w, q, a, err)
                                                        : make_distance(w, q, a, err);
    sdm_callback_end();
    return s;
}

static bool receive(int fd, void *data, size_t size)
{
    for (char *at = data; size;) {
        const ssize_t got = read(fd, at, size);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        at += got, size -= (size_t)got;
    }
    return true;
}

/* Does one request; false: the program has ended. */
static bool serve(worker *w)
{
    isolated_request q;
    isolated_bytes text = {0}, answer = {0};
    if (!receive(w->socket, &q, sizeof q) ||
        SDM_ALLOC(&text.data, (size_t)q.length + 1, "request", NULL))
        return false;
    text.size = q.length;
    sdm_error err = {0};
    isolated_answer a = {0};
    bool good = receive(w->socket, text.data, q.length);
    if (good) a.status = work(w, &q, &text, &a, &answer, &err);
    if (good && !a.status && answer.failed)
        a.status = sdm_fail(&err, SDM_E_NOMEM, "no memory for an answer");
    const void *said = a.status ? (const void *)err.text : answer.data;
    a.length = (uint32_t)(a.status ? strlen(err.text) : answer.size);
    good = good && sdm_socket_send(w->socket, &a, sizeof a) &&
           sdm_socket_send(w->socket, said, a.length);
    sdm_free(text.data);
    sdm_free(answer.data);
    return good;
}

int sdm_isolation_worker(int n, char **argument)
{
    if (n != 3) return 1;
    worker w = {.socket = atoi(argument[1]), .memory = atoi(argument[2])};
    fcntl(w.socket, F_SETFD, FD_CLOEXEC);
    fcntl(w.memory, F_SETFD, FD_CLOEXEC);
    // an interrupt is for the program, which closes the socket when it ends
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_IGN);
    signal(SIGHUP, SIG_IGN);
    setvbuf(stdout, NULL, _IOLBF, 0);
    void *page = mmap(NULL, sizeof *w.state, PROT_READ | PROT_WRITE, MAP_SHARED, w.memory, 0);
    if (page == MAP_FAILED || !start_watch(&w)) return 1;
    w.state = page;
    sdm_callback_show(w.state->running, sizeof w.state->running);
    while (serve(&w)) {
    }
    _exit(0);
}
