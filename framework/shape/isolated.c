/* Shapes whose callbacks run in worker processes: their tables hold callbacks that ask a worker. */
#include "isolated_protocol.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/text.h"
#include "sdm/memory.h"

/* After this many calls that did not end in time an instance makes none any more: a survey of
 * hundreds of shapes must not wait for each. */
#define LATE_MAX 3

typedef struct isolated_plugin isolated_plugin;

/* A shape of a plug-in. The name is the first member: the text that its table has as name leads to
 * the shape, also from copies of the table. */
typedef struct isolated_shape {
    char name[SDM_NAME_LENGTH_MAX + 1];
    isolated_plugin *plugin;
    uint32_t index;
    const sdm_param *params;     // owned, of the table
    const sdm_option *options;   // owned, of the table
    const sdm_measure *measures; // owned, of the table
    uint32_t n_options;
} isolated_shape;

struct isolated_plugin {
    const sdm_isolation *how;
    char *path;
    isolated_bytes tables; // the texts of the shapes
    isolated_shape *shapes;
    size_t n_shapes;
    _Atomic(isolated_worker *) spare; // has loaded the plug-in, and has no instance yet
    atomic_flag told;                 // that it prints
};

typedef struct pool {
    const isolated_shape *shape;
    isolated_bytes options; // text of the request that makes the instance
    isolated_bytes answer;  // the texts of params
    sdm_param *params;
    uint32_t n_params;
    sdm_distribution *distributions;
    pthread_mutex_t lock; // of the members below
    isolated_worker *idle;
    int late;    // calls that did not end in time
    size_t ends; // calls that ended a worker
} pool;

/* What the callbacks of an instance get: they may not change it, but take workers from the pool. */
typedef struct handle {
    pool *pool;
} handle;

/* ---- workers ---- */

/* The first line of what the plug-in printed, once for each plug-in. */
static void tell(isolated_plugin *plugin, const isolated_worker *w)
{
    if (!w->said[0] || !plugin->how->notice || atomic_flag_test_and_set(&plugin->told)) return;
    char text[1024];
    snprintf(text, sizeof text, "plug-in %.600s prints: %.*s", plugin->path,
             (int)strcspn(w->said, "\n"), w->said);
    plugin->how->notice(text);
}

/* Asks the worker; a failure that ends it counts. */
static sdm_status ask(pool *at, isolated_worker *w, const isolated_request *q, const void *text,
                      isolated_answer *a, isolated_bytes *said, sdm_error *err)
{
    const sdm_status s = sdm_worker_ask(w, q, text, a, said, err);
    if (w->ended) {
        pthread_mutex_lock(&at->lock);
        at->late += w->late;
        at->ends++;
        pthread_mutex_unlock(&at->lock);
    }
    if (!w->ended) tell(at->shape->plugin, w);
    return s;
}

/* *out = a worker that has the instance of the pool. */
static sdm_status worker_new(pool *at, isolated_worker **out, isolated_bytes *said, sdm_error *err)
{
    isolated_plugin *plugin = at->shape->plugin;
    isolated_worker *w = atomic_exchange(&plugin->spare, NULL);
    const isolated_request q = {.task = ISOLATED_CREATE, .length = (uint32_t)at->options.size};
    isolated_answer a;
    sdm_status s = w ? SDM_OK : sdm_worker_start(plugin->how, plugin->path, &w, NULL, err);
    if (!s) s = ask(at, w, &q, at->options.data, &a, said, err);
    if (s)
        sdm_worker_free(w);
    else
        *out = w;
    return s;
}

static sdm_status take(pool *at, isolated_worker **out, sdm_error *err)
{
    pthread_mutex_lock(&at->lock);
    isolated_worker *w = at->idle;
    const bool late = at->late >= LATE_MAX;
    if (w && !late) at->idle = w->next;
    pthread_mutex_unlock(&at->lock);
    if (late)
        return sdm_fail(err, SDM_E_PLUGIN,
                        "%s: it is not called again, after %d calls that did not come to an end",
                        at->shape->plugin->path, LATE_MAX);
    if (!w) return worker_new(at, out, NULL, err);
    *out = w;
    return SDM_OK;
}

static void give_back(pool *at, isolated_worker *w)
{
    if (w->ended) {
        sdm_worker_free(w);
        return;
    }
    pthread_mutex_lock(&at->lock);
    w->next = at->idle;
    at->idle = w;
    pthread_mutex_unlock(&at->lock);
}

static void pool_free(pool *at)
{
    while (at->idle) {
        isolated_worker *w = at->idle;
        at->idle = w->next;
        sdm_worker_free(w);
    }
    pthread_mutex_destroy(&at->lock);
    sdm_free(at->options.data);
    sdm_free(at->answer.data);
    sdm_free(at->params);
    sdm_free(at->distributions);
    sdm_free(at);
}

/* ---- callbacks ---- */

static pool *pool_of(const void *self) { return ((const handle *)self)->pool; }

static int give_reason(const sdm_host *host, const sdm_error *err)
{
    return host->fail(host, err->text);
}

/* The messages of create() begin with the name of the shape, which the caller adds again. */
static const char *skip_name(const char *text, const char *name)
{
    char begin[SDM_NAME_LENGTH_MAX + 12];
    const size_t n = (size_t)snprintf(begin, sizeof begin, "shape '%s'", name);
    if (strncmp(text, begin, n) != 0 || !strchr(":,", text[n])) return text;
    return text + n + strspn(text + n, ":, ");
}

/* Makes the first worker, which says what the parameters are. */
static sdm_status start(pool *at, sdm_error *err)
{
    isolated_worker *w = NULL;
    const sdm_status s = worker_new(at, &w, &at->answer, err);
    if (s) return s;
    at->params = sdm_bytes_get_params(&at->answer, &at->n_params);
    at->distributions = sdm_bytes_get_distributions(&at->answer, at->n_params);
    give_back(at, w);
    return at->answer.failed ? sdm_fail(err, SDM_E_PLUGIN, "%s: its process answers nonsense",
                                        at->shape->plugin->path)
                             : SDM_OK;
}

static int create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    const sdm_shape *table = ((const host_call *)host->ctx)->shape;
    const isolated_shape *shape = (const isolated_shape *)(const void *)table->name;
    sdm_error err = {0};
    handle *h = NULL;
    if (SDM_ALLOC(&h, 1, "isolated shape", &err) ||
        SDM_ALLOC(&h->pool, 1, "isolated shape", &err)) {
        sdm_free(h);
        return give_reason(host, &err);
    }
    pool *at = h->pool;
    at->shape = shape;
    pthread_mutex_init(&at->lock, NULL);
    sdm_bytes_put_count(&at->options, shape->index);
    sdm_bytes_put_options(&at->options, options, shape->n_options);
    const sdm_status s =
        at->options.failed ? sdm_fail(&err, SDM_E_NOMEM, "no memory for options") : start(at, &err);
    if (s) {
        pool_free(at);
        sdm_free(h);
        return host->fail(host, skip_name(err.text, shape->name));
    }
    *self = h;
    return 0;
}

static void describe(const void *self, const sdm_param **params, uint32_t *n_params)
{
    const pool *at = pool_of(self);
    *params = at->params;
    *n_params = at->n_params;
}

static void distributions(const void *self, sdm_distribution *out)
{
    const pool *at = pool_of(self);
    memcpy(out, at->distributions, at->n_params * sizeof *out);
}

/* The callbacks destroy() of the workers run, too; a failure there is told, as it can hurt nobody.
 */
static void destroy(void *self)
{
    pool *at = pool_of(self);
    const isolated_request q = {.task = ISOLATED_DESTROY};
    for (isolated_worker *w = at->idle; w; w = w->next) {
        isolated_answer a;
        sdm_error err = {0};
        const bool late = at->late >= LATE_MAX;
        if (!late && ask(at, w, &q, NULL, &a, NULL, &err) && at->shape->plugin->how->notice)
            at->shape->plugin->how->notice(err.text);
    }
    pool_free(at);
    sdm_free(self);
}

static isolated_request request_at(const pool *at, isolated_task task, const double *p)
{
    isolated_request q = {.task = task};
    memcpy(q.p, p, at->n_params * sizeof *p);
    return q;
}

static sdm_status fetch_mesh(pool *at, isolated_worker *w, const double *p, const sdm_host *host,
                             sdm_mesh_out *out, int *failed, sdm_error *err)
{
    const isolated_request q = request_at(at, ISOLATED_MESH, p);
    isolated_answer a;
    const double *real;
    const uint32_t *index;
    sdm_status s = ask(at, w, &q, NULL, &a, NULL, err);
    if (s) return s;
    *failed = host->reserve(host, out, (size_t)a.n_vert, (size_t)a.n_tri);
    if (*failed) return SDM_OK;
    s = sdm_worker_data(w, 3 * out->n_vert, 3 * out->n_tri, &real, &index, err);
    if (s) return s;
    memcpy(out->vert, real, 3 * out->n_vert * sizeof *real);
    memcpy(out->tri, index, 3 * out->n_tri * sizeof *index);
    return SDM_OK;
}

static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out)
{
    (void)options;
    pool *at = pool_of(self);
    isolated_worker *w = NULL;
    int failed = 0;
    sdm_error err = {0};
    sdm_status s = take(at, &w, &err);
    if (!s) s = fetch_mesh(at, w, p, host, out, &failed, &err);
    if (w) give_back(at, w);
    return s ? give_reason(host, &err) : failed;
}

static int velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, size_t n_vert, double *out)
{
    (void)options;
    pool *at = pool_of(self);
    isolated_worker *w = NULL;
    isolated_answer a;
    const double *real;
    const uint32_t *index;
    sdm_error err = {0};
    isolated_request q = request_at(at, ISOLATED_VELOCITY, p);
    q.n_vert = n_vert;
    sdm_status s = take(at, &w, &err);
    if (!s) s = ask(at, w, &q, NULL, &a, NULL, &err);
    if (!s) s = sdm_worker_data(w, 3 * n_vert * at->n_params, 0, &real, &index, &err);
    if (!s) memcpy(out, real, 3 * n_vert * at->n_params * sizeof *real);
    if (w) give_back(at, w);
    return s ? give_reason(host, &err) : 0;
}

/* A request that is answered without text or meshes. */
static int ask_numbers(pool *at, const isolated_request *q, const sdm_host *host,
                       isolated_answer *a)
{
    isolated_worker *w = NULL;
    sdm_error err = {0};
    *a = (isolated_answer){0};
    sdm_status s = take(at, &w, &err);
    if (!s) s = ask(at, w, q, NULL, a, NULL, &err);
    if (w) give_back(at, w);
    return s ? give_reason(host, &err) : 0;
}

/* The same for one number. */
static int ask_value(pool *at, const isolated_request *q, const sdm_host *host, double *out)
{
    isolated_answer a;
    const int failed = ask_numbers(at, q, host, &a);
    *out = a.value;
    return failed;
}

static int distance(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, const double x[3], double *out)
{
    (void)options;
    pool *at = pool_of(self);
    isolated_request q = request_at(at, ISOLATED_DISTANCE, p);
    memcpy(q.x, x, sizeof q.x);
    return ask_value(at, &q, host, out);
}

static int measure(const void *self, const sdm_host *host, const sdm_option_value *options,
                   const double *p, uint32_t index, double depth, double *value)
{
    (void)options;
    pool *at = pool_of(self);
    isolated_request q = request_at(at, ISOLATED_MEASURE, p);
    q.measure = index;
    q.x[0] = depth;
    return ask_value(at, &q, host, value);
}

static int open_end(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_open_end *out)
{
    (void)options;
    pool *at = pool_of(self);
    const isolated_request q = request_at(at, ISOLATED_OPEN_END, p);
    isolated_answer a;
    const int failed = ask_numbers(at, &q, host, &a);
    *out = a.open_end;
    return failed;
}

static const sdm_shape CALLBACKS = {.abi = SDM_SHAPE_ABI,
                                    .size = sizeof(sdm_shape),
                                    .create = create,
                                    .destroy = destroy,
                                    .describe = describe,
                                    .mesh = mesh,
                                    .velocity = velocity,
                                    .distance = distance,
                                    .distributions = distributions,
                                    .measure = measure,
                                    .open_end = open_end};

bool sdm_is_isolated(const sdm_instance *s) { return s->shape->mesh == mesh; }

size_t sdm_isolated_ends(const sdm_instance *s)
{
    pool *at = pool_of(s->self);
    pthread_mutex_lock(&at->lock);
    const size_t ends = at->ends;
    pthread_mutex_unlock(&at->lock);
    return ends;
}

sdm_status sdm_isolated_repeat(const sdm_instance *s, const double *p, size_t n, int n_threads,
                               sdm_repeat *out, sdm_error *err)
{
    pool *at = pool_of(s->self);
    isolated_worker *w = NULL;
    isolated_bytes text = {0};
    isolated_answer a = {0};
    sdm_bytes_put_count(&text, (size_t)n_threads);
    sdm_bytes_put_reals(&text, p, n * s->n_params);
    const isolated_request q = {.task = ISOLATED_REPEAT, .length = (uint32_t)text.size};
    sdm_status status =
        text.failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for parameters") : take(at, &w, err);
    if (!status) status = ask(at, w, &q, text.data, &a, NULL, err);
    if (w) give_back(at, w);
    sdm_free(text.data);
    *out = a.repeat;
    return status;
}

/* ---- plug-ins ---- */

sdm_status sdm_registry_isolate(sdm_registry *r, const sdm_isolation *how, sdm_error *err)
{
    if (!r || !how || !how->program || !(how->seconds > 0) || !how->bytes)
        return sdm_fail(err, SDM_E_ARG, "isolation needs a registry, a program and limits above 0");
    return sdm_registry_set_isolation(r, how, err);
}

void sdm_isolated_close(void *object)
{
    isolated_plugin *plugin = object;
    sdm_worker_free(plugin->spare);
    for (size_t i = 0; i < plugin->n_shapes; i++) {
        sdm_free((void *)plugin->shapes[i].params);
        sdm_free((void *)plugin->shapes[i].options);
        sdm_free((void *)plugin->shapes[i].measures);
    }
    sdm_free(plugin->shapes);
    sdm_free(plugin->tables.data);
    sdm_free(plugin->path);
    sdm_free(plugin);
}

static sdm_status add_shape(sdm_registry *r, isolated_plugin *plugin, size_t i, sdm_error *err)
{
    isolated_shape *shape = &plugin->shapes[i];
    sdm_shape table = sdm_bytes_get_shape(&plugin->tables, &CALLBACKS);
    shape->plugin = plugin;
    shape->index = (uint32_t)i;
    shape->params = table.params;
    shape->options = table.options;
    shape->measures = table.measures;
    shape->n_options = table.n_options;
    if (plugin->tables.failed || !sdm_is_name(table.name))
        return sdm_fail(err, SDM_E_PLUGIN, "plug-in %s: its process answers nonsense",
                        plugin->path);
    strcpy(shape->name, table.name);
    table.name = shape->name;
    return sdm_registry_add(r, &table, plugin->path, err);
}

sdm_status sdm_isolated_load(sdm_registry *r, const sdm_isolation *how, const char *path,
                             void **object, sdm_error *err)
{
    isolated_plugin *plugin = NULL;
    isolated_worker *w = NULL;
    sdm_status s = SDM_ALLOC(&plugin, 1, "plug-in", err);
    if (s) return s;
    plugin->how = how;
    s = SDM_ALLOC(&plugin->path, strlen(path) + 1, "path of a plug-in", err);
    if (!s) strcpy(plugin->path, path);
    if (!s) s = sdm_worker_start(how, plugin->path, &w, &plugin->tables, err);
    atomic_init(&plugin->spare, w);
    const size_t n = s ? 0 : sdm_bytes_get_count(&plugin->tables, UINT16_MAX);
    if (!s) s = SDM_ALLOC(&plugin->shapes, n, "shapes of a plug-in", err);
    if (!s) plugin->n_shapes = n;
    if (w) tell(plugin, w);
    for (size_t i = 0; i < n && !s; i++) s = add_shape(r, plugin, i, err);
    if (s)
        sdm_isolated_close(plugin);
    else
        *object = plugin;
    return s;
}
