/* Registry: the set of known shapes. */
#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/isolation.h"
#include "sdm/internal/skipped.h"
#include "sdm/internal/text.h"
#include "shape_internal.h"

typedef struct entry {
    sdm_shape shape;
    char *origin;
} entry;

typedef struct loaded {
    void *object;
    void (*close)(void *object);
    char *path;
} loaded;

struct skipped {
    char *message;
    bool folder; /* a folder, not a file */
};

struct sdm_registry {
    /* pointers, because the address of a shape must not change when the array grows */
    entry **entries;
    size_t count, capacity;
    loaded *objects; /* shared objects that the shapes come from */
    size_t n_objects;
    struct skipped *skipped; /* what could not be loaded */
    size_t n_skipped;
    sdm_isolation *isolation; /* NULL: plug-ins run in this process */
};

sdm_status sdm_registry_create(sdm_registry **out, sdm_error *err)
{
    return SDM_ALLOC(out, 1, "shape registry", err);
}

void sdm_registry_shrink(sdm_registry *r, size_t count)
{
    while (r->count > count) {
        entry *e = r->entries[--r->count];
        sdm_free(e->origin);
        sdm_free(e);
    }
}

void sdm_registry_free(sdm_registry *r)
{
    if (!r) return;
    sdm_registry_shrink(r, 0);
    for (size_t i = r->n_objects; i-- > 0;) {
        r->objects[i].close(r->objects[i].object);
        sdm_free(r->objects[i].path);
    }
    for (size_t i = 0; i < r->n_skipped; i++) sdm_free(r->skipped[i].message);
    sdm_free(r->skipped);
    sdm_free(r->isolation);
    sdm_free(r->objects);
    sdm_free(r->entries);
    sdm_free(r);
}

const sdm_isolation *sdm_registry_isolation(const sdm_registry *r) { return r->isolation; }

sdm_status sdm_registry_set_isolation(sdm_registry *r, const sdm_isolation *how, sdm_error *err)
{
    const sdm_status s = r->isolation ? SDM_OK : SDM_ALLOC(&r->isolation, 1, "isolation", err);
    if (!s) *r->isolation = *how;
    return s;
}

/* *out = a copy of the text, to be freed with sdm_free(). */
static sdm_status copy_text(const char *text, char **out, sdm_error *err)
{
    const sdm_status s = SDM_ALLOC(out, strlen(text) + 1, "text", err);
    if (!s) strcpy(*out, text);
    return s;
}

sdm_status sdm_registry_keep(sdm_registry *r, const char *path, void *object,
                             void (*close)(void *object), sdm_error *err)
{
    char *copy = NULL;
    sdm_status s = sdm_grow((void **)&r->objects, r->n_objects, r->n_objects + 1,
                            sizeof *r->objects, "plug-ins", err);
    if (!s) s = copy_text(path, &copy, err);
    if (!s) r->objects[r->n_objects++] = (loaded){object, close, copy};
    return s;
}

const char *sdm_registry_kept(const sdm_registry *r, size_t index)
{
    return index < r->n_objects ? r->objects[index].path : NULL;
}

sdm_status sdm_registry_skip(sdm_registry *r, const char *message, bool folder, sdm_error *err)
{
    char *copy = NULL;
    sdm_status s = sdm_grow((void **)&r->skipped, r->n_skipped, r->n_skipped + 1,
                            sizeof *r->skipped, "plug-ins", err);
    if (!s) s = copy_text(message, &copy, err);
    if (!s) r->skipped[r->n_skipped++] = (struct skipped){copy, folder};
    return s;
}

const char *sdm_registry_skipped(const sdm_registry *r, size_t index)
{
    return r && index < r->n_skipped ? r->skipped[index].message : NULL;
}

bool sdm_registry_skipped_folder(const sdm_registry *r, size_t index)
{
    return r && index < r->n_skipped && r->skipped[index].folder;
}

static sdm_status registry_make_room(sdm_registry *r, sdm_error *err)
{
    if (r->count < r->capacity) return SDM_OK;
    const size_t capacity = r->capacity ? 2 * r->capacity : 16;
    const sdm_status s = sdm_grow((void **)&r->entries, r->capacity, capacity, sizeof *r->entries,
                                  "shape registry", err);
    if (!s) r->capacity = capacity;
    return s;
}

sdm_status sdm_registry_add(sdm_registry *r, const sdm_shape *shape, const char *origin,
                            sdm_error *err)
{
    if (!r || !shape || !origin)
        return sdm_fail(err, SDM_E_ARG, "registry, shape and origin are needed to add a shape");
    sdm_shape checked;
    sdm_status s = sdm_shape_copy_checked(shape, origin, &checked, err);
    if (s) return s;
    for (size_t i = 0; i < r->count; i++)
        if (strcmp(r->entries[i]->shape.name, checked.name) == 0)
            return sdm_fail(err, SDM_E_PLUGIN,
                            "%s: shape '%s' is there already (%s): choose another name", origin,
                            checked.name, r->entries[i]->origin);

    s = registry_make_room(r, err);
    if (s) return s;
    entry *e = NULL;
    s = SDM_ALLOC(&e, 1, "shape", err);
    if (s) return s;
    s = copy_text(origin, &e->origin, err);
    if (s) {
        sdm_free(e);
        return s;
    }
    e->shape = checked;
    r->entries[r->count++] = e;
    return SDM_OK;
}

size_t sdm_registry_count(const sdm_registry *r) { return r ? r->count : 0; }

const sdm_shape *sdm_registry_at(const sdm_registry *r, size_t index)
{
    return r && index < r->count ? &r->entries[index]->shape : NULL;
}

const char *sdm_registry_origin(const sdm_registry *r, size_t index)
{
    return r && index < r->count ? r->entries[index]->origin : NULL;
}

const sdm_shape *sdm_registry_find(const sdm_registry *r, const char *name, const char **nearest)
{
    if (nearest) *nearest = NULL;
    if (!r || !name) return NULL;
    for (size_t i = 0; i < r->count; i++)
        if (strcmp(r->entries[i]->shape.name, name) == 0) return &r->entries[i]->shape;
    const char **names = NULL;
    if (nearest && SDM_ALLOC(&names, r->count, "names", NULL) == SDM_OK) {
        for (size_t i = 0; i < r->count; i++) names[i] = r->entries[i]->shape.name;
        *nearest = sdm_nearest_name(name, names, r->count);
    }
    sdm_free((void *)names);
    return NULL;
}
