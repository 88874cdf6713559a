/* Remembers for each thread the callback of a shape that it is in. */
#include "sdm/internal/callback.h"

#include <string.h>

#include "shape_internal.h"

static _Thread_local sdm_callback running; // function is NULL outside of callbacks
static struct {
    char *place;
    size_t size;
} shown;

void sdm_callback_show(char *place, size_t size)
{
    shown.place = place;
    shown.size = size;
}

void sdm_callback_begin(const sdm_instance *s, const char *function, const double *p)
{
    running = (sdm_callback){s->shape->name, function, s->params, p, p ? s->n_params : 0};
    if (shown.place) strncpy(shown.place, function, shown.size - 1);
}

void sdm_callback_end(void)
{
    running.function = NULL;
    if (shown.place) shown.place[0] = '\0';
}

const sdm_callback *sdm_callback_running(void) { return running.function ? &running : NULL; }
