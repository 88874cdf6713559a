/* Reads the lines of metrics.jsonl, draws them, and tells whether the error was still falling. */
#include "history.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "sdm/picture.h"

/* How a line about the choice of the kind begins. */
static const char AUTO[] = "{\"phase\": \"auto\"";

/* Number after `key` in one line; NaN if there is none, or null. */
static double number_after(const char *line, size_t length, const char *key)
{
    const char *at = strstr(line, key);
    if (!at || at >= line + length) return NAN;
    at += strlen(key);
    return *at == 'n' ? NAN : strtod(at, NULL);
}

/* The phase that the line names; SDM_PHASE_DATA: none with steps. */
static sdm_phase phase_of(const char *line)
{
    static const struct {
        const char *start;
        sdm_phase phase;
    } known[] = {{"{\"phase\": \"fit\"", SDM_PHASE_MODE_FIT},
                 {"{\"phase\": \"refine\"", SDM_PHASE_REFINE},
                 {"{\"phase\": \"evaluate\"", SDM_PHASE_EVALUATE}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (!strncmp(line, known[i].start, strlen(known[i].start))) return known[i].phase;
    return SDM_PHASE_DATA;
}

sdm_status trainer_history_read(const trainer *t, history *out, sdm_error *err)
{
    size_t lines = 0;
    *out = (history){0};
    for (const char *p = t->metrics->data; p && *p; p++) lines += *p == '\n';
    const sdm_status s = SDM_ALLOC(&out->point, lines, "history of the run", err);
    if (s) return s;
    const char *end = NULL;
    for (const char *p = t->metrics->data; p && (end = strchr(p, '\n')); p = end + 1) {
        const size_t length = (size_t)(end - p);
        const history_point point = {.phase = phase_of(p),
                                     .step = number_after(p, length, "\"step\": "),
                                     .seconds = number_after(p, length, "\"seconds\": "),
                                     .loss = number_after(p, length, "\"loss_mm2\": "),
                                     .heldout = number_after(p, length, "\"heldout_mse_mm2\": ")};
        // the training of another kind begins
        if (!strncmp(p, AUTO, sizeof AUTO - 1)) out->n = 0;
        if (point.phase != SDM_PHASE_DATA && isfinite(point.step)) out->point[out->n++] = point;
    }
    return SDM_OK;
}

void trainer_history_dispose(history *h)
{
    sdm_free(h->point);
    *h = (history){0};
}

int64_t trainer_history_last_step(const history *h)
{
    return h->n ? (int64_t)h->point[h->n - 1].step : -1;
}

/* Root mean square error beyond the floor, mm. */
static double beyond(const history_point *p, double floor)
{
    return sqrt(fmax(0, p->heldout - floor));
}

double trainer_history_fall(const history *h, sdm_phase phase, double floor)
{
    const history_point *first = NULL, *last = NULL;
    size_t n = 0;
    for (size_t i = 0; i < h->n; i++) {
        if (h->point[i].phase != phase || !isfinite(h->point[i].heldout)) continue;
        if (!first) first = &h->point[i];
        last = &h->point[i];
        n++;
    }
    if (n < 3) return NAN;
    // the error at two thirds of the steps, between two measurements
    const double at = first->step + (last->step - first->step) * 2 / 3;
    const history_point *before = first;
    double error = NAN;
    for (const history_point *p = first; p <= last; p++) {
        if (p->phase != phase || !isfinite(p->heldout)) continue;
        if (p->step >= at) {
            const double length = p->step - before->step,
                         share = length > 0 ? (at - before->step) / length : 1;
            error = beyond(before, floor) * (1 - share) + beyond(p, floor) * share;
            break;
        }
        before = p;
    }
    return error > 0 ? fmax(0, 1 - beyond(last, floor) / error) : 0;
}

/* The curves of loss.png. */
typedef struct loss_curves {
    double *x;                        // [n] of all points
    double *loss, *refined, *heldout; // [n] root mean square errors, mm; NaN: not of this curve
    double end[2];                    // of the finished model
    double begin[2], height[2];       // the line where the refinement begins; NaN: it does not
} loss_curves;

static sdm_status curves_create(size_t n, loss_curves *c, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&c->x, n, "loss curve", err);
    if (!s) s = SDM_ALLOC(&c->loss, n, "loss curve", err);
    if (!s) s = SDM_ALLOC(&c->refined, n, "loss curve", err);
    if (!s) s = SDM_ALLOC(&c->heldout, n, "loss curve", err);
    return s;
}

static void curves_dispose(loss_curves *c)
{
    sdm_free(c->heldout);
    sdm_free(c->refined);
    sdm_free(c->loss);
    sdm_free(c->x);
}

static void curves_fill(const history *h, bool timed, loss_curves *c)
{
    double low = INFINITY, high = 0, begin = NAN;
    for (size_t i = 0; i < h->n; i++) {
        const history_point *p = &h->point[i];
        const bool finished = p->phase == SDM_PHASE_EVALUATE, other = p->phase == SDM_PHASE_REFINE,
                   first = other && !isfinite(begin);
        c->x[i] = timed ? p->seconds : p->step;
        if (first) begin = c->x[i];
        if (finished) c->end[0] = c->x[i], c->end[1] = sqrt(p->heldout);
        c->heldout[i] = finished ? NAN : sqrt(p->heldout);
        c->loss[i] = other ? NAN : sqrt(p->loss);
        // before the first step of the refinement the last batch is one of the fit
        c->refined[i] = other && !first ? sqrt(p->loss) : NAN;
        low = fmin(low, fmin(sqrt(p->heldout), sqrt(p->loss)));
        high = fmax(high, fmax(sqrt(p->heldout), sqrt(p->loss)));
    }
    c->begin[0] = c->begin[1] = begin;
    c->height[0] = low, c->height[1] = high;
}

sdm_status trainer_history_picture(const trainer *t, const history *h, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    loss_curves c = {.end = {NAN, NAN}};
    bool timed = true;
    for (size_t i = 0; i < h->n; i++) timed = timed && isfinite(h->point[i].seconds);
    sdm_status s = curves_create(h->n, &c, err);
    if (!s) {
        curves_fill(h, timed, &c);
        snprintf(path, sizeof path, "%s/loss.png", t->folder);
        const sdm_curve curves[] = {{"training (one batch)", c.x, c.loss, h->n},
                                    {"held-out shapes", c.x, c.heldout, h->n},
                                    {"finished model", &c.end[0], &c.end[1], 1},
                                    {"refinement (one batch)", c.x, c.refined, h->n},
                                    {"refinement begins", c.begin, c.height, 2}};
        s = sdm_picture_plot(path, "Error of the network while it is trained",
                             timed ? "seconds" : "optimiser steps", "root mean square error, mm",
                             true, curves, isfinite(c.begin[0]) ? 5 : 3, err);
    }
    curves_dispose(&c);
    return s;
}
