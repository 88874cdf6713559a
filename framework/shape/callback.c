/* Remembers for each thread the callback of a shape that it is in. */
#include "sdm/internal/callback.h"

#include "shape_internal.h"

static _Thread_local sdm_callback running; // function is NULL outside of callbacks

void sdm_callback_begin(const sdm_instance *s, const char *function, const double *p)
{
    running = (sdm_callback){s->shape->name, function, s->params, p, p ? s->n_params : 0};
}

void sdm_callback_end(void) { running.function = NULL; }

const sdm_callback *sdm_callback_running(void) { return running.function ? &running : NULL; }
