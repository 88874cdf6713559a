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

sdm_status trainer_history_picture(const trainer *t, const history *h, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    double *step = NULL, *loss = NULL, *refined = NULL, *heldout = NULL, end[2] = {NAN, NAN};
    bool refines = false;
    sdm_status s = SDM_ALLOC(&step, h->n, "loss curve", err);
    if (!s) s = SDM_ALLOC(&loss, h->n, "loss curve", err);
    if (!s) s = SDM_ALLOC(&refined, h->n, "loss curve", err);
    if (!s) s = SDM_ALLOC(&heldout, h->n, "loss curve", err);
    for (size_t i = 0; i < h->n && !s; i++) {
        const history_point *p = &h->point[i];
        const bool finished = p->phase == SDM_PHASE_EVALUATE;
        if (finished) end[0] = p->step, end[1] = sqrt(p->heldout);
        step[i] = p->step;
        // the refinement has another loss
        const bool other = p->phase == SDM_PHASE_REFINE;
        refines |= other;
        loss[i] = other ? NAN : sqrt(p->loss);
        refined[i] = other ? sqrt(p->loss) : NAN;
        heldout[i] = finished ? NAN : sqrt(p->heldout);
    }
    if (!s) {
        snprintf(path, sizeof path, "%s/loss.png", t->folder);
        const sdm_curve curves[] = {{"training (one batch)", step, loss, h->n},
                                    {"held-out shapes", step, heldout, h->n},
                                    {"finished model, held-out shapes", &end[0], &end[1], 1},
                                    {"refinement (one batch)", step, refined, h->n}};
        s = sdm_picture_plot(path, "Error of the network while it is trained", "optimiser steps",
                             "root mean square error, mm", true, curves, refines ? 4 : 3, err);
    }
    sdm_free(heldout);
    sdm_free(refined);
    sdm_free(loss);
    sdm_free(step);
    return s;
}
