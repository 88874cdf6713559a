/* Selects labels of a label map or a segmentation as a mask of 1 and 0. */
#include <math.h>
#include <stdio.h>

#include "fit_command.h"
#include "report/terminal.h"
#include "sdm/memory.h"

/* Most labels that a message lists. */
enum { LABELS_TOLD = 16 };

/* A label: a value in one layer or in all layers. */
typedef struct label {
    float value;
    size_t layer; /* n_layers: all layers */
} label;

/* Finds the label that a word names: the word is the name of a segment, or a value. */
static sdm_status find_label(const char *path, const sdm_volume *v, const char *word, label *out,
                             sdm_error *err)
{
    int64_t value = 0;
    const sdm_segment *segment = NULL;
    sdm_error unknown = {0};
    const sdm_status s =
        v->n_segments ? sdm_volume_find_segment(v, word, &segment, &unknown) : SDM_E_ARG;
    if (!s) {
        *out = (label){(float)segment->value, segment->layer};
        return SDM_OK;
    }
    if (sdm_parse_int(word, &value) && value != 0) {
        *out = (label){(float)value, v->n_layers};
        return SDM_OK;
    }
    if (v->n_segments) return sdm_fail(err, SDM_E_ARG, "%s: %s", path, unknown.text);
    return sdm_fail(
        err, SDM_E_ARG,
        "%s: label '%.100s': need a whole number other than 0 (the file names no segments)", path,
        word);
}

/* Sets the voxels of the label to 1; returns their number. */
static size_t add_label(const sdm_volume *v, const label *l, float *mask)
{
    const size_t n = sdm_grid_count(&v->grid);
    size_t found = 0;
    for (size_t layer = 0; layer < v->n_layers; layer++) {
        if (l->layer != v->n_layers && l->layer != layer) continue;
        const float *values = v->values + layer * n;
        for (size_t i = 0; i < n; i++)
            if (values[i] == l->value) mask[i] = 1, found++;
    }
    return found;
}

/* Sets every voxel to 1 that is not 0 in at least one layer. */
static void add_all(const sdm_volume *v, float *mask)
{
    const size_t n = sdm_grid_count(&v->grid);
    for (size_t i = 0; i < n * v->n_layers; i++)
        if (v->values[i] > 0 || v->values[i] < 0) mask[i % n] = 1;
}

size_t cli_fit_distinct(const sdm_volume *v, size_t most, float *found)
{
    const size_t n_values = sdm_grid_count(&v->grid) * v->n_layers;
    size_t n = 0;
    for (size_t i = 0; i < n_values; i++) {
        const float x = v->values[i];
        // neighbours mostly have the same value
        if (isnan(x) || (i > 0 && x - v->values[i - 1] == 0)) continue;
        size_t low = 0, high = n; // the first value found that is not below x
        while (low < high) {
            const size_t middle = (low + high) / 2;
            if (found[middle] < x)
                low = middle + 1;
            else
                high = middle;
        }
        if (low < n && found[low] <= x) continue;
        if (n == most || rintf(x) - x != 0) return most + 1;
        for (size_t k = n++; k > low; k--) found[k] = found[k - 1];
        found[low] = x;
    }
    return n;
}

/* list = " 1 2 5", the n values of labels that are not 0; returns their number. */
static size_t list_labels(const float *found, size_t n, char list[16 * LABELS_TOLD])
{
    size_t labels = 0, used = 0;
    list[0] = 0;
    for (size_t i = 0; i < n && n <= LABELS_TOLD; i++)
        if (found[i] < 0 || found[i] > 0)
            used += (size_t)snprintf(list + used, 16 * LABELS_TOLD - used, " %g", (double)found[i]),
                labels++;
    return labels;
}

/* Tells that several labels are united because none was chosen. */
static void notice_united(const char *path, const sdm_volume *v)
{
    float found[LABELS_TOLD];
    char list[16 * LABELS_TOLD];
    const size_t n = cli_fit_distinct(v, LABELS_TOLD, found);
    if (list_labels(found, n, list) > 1)
        cli_notice("%s: no label is chosen, so the labels%s count as one", path, list);
}

/* The message where a label is missing: the labels that are there, or that there are none. */
static sdm_status missing_label(const char *path, const sdm_volume *v, const char *word,
                                sdm_error *err)
{
    float found[LABELS_TOLD];
    const size_t n = cli_fit_distinct(v, LABELS_TOLD, found);
    char list[16 * LABELS_TOLD];
    list_labels(found, n, list);
    if (n <= LABELS_TOLD)
        return sdm_fail(err, SDM_E_FORMAT, "%s: no voxel has the label '%.100s'; its labels are%s",
                        path, word, list);
    return sdm_fail(err, SDM_E_FORMAT,
                    "%s: no voxel has the label '%.100s' (values %g to %g, over %d different ones, "
                    "or fractions): if it is an image, leave --label out",
                    path, word, (double)v->min, (double)v->max, LABELS_TOLD);
}

sdm_status cli_fit_label_mask(const char *path, const sdm_volume *v, const cli_list *words,
                              float *values, sdm_error *err)
{
    const size_t n = sdm_grid_count(&v->grid);
    for (size_t i = 0; i < n; i++) values[i] = 0;
    if (!words->n) {
        add_all(v, values);
        notice_united(path, v);
    }
    for (size_t w = 0; w < words->n; w++) {
        label l;
        const sdm_status s = find_label(path, v, words->items[w], &l, err);
        if (s) return s;
        if (!add_label(v, &l, values)) return missing_label(path, v, words->items[w], err);
    }
    size_t inside = 0;
    for (size_t i = 0; i < n; i++) inside += values[i] > 0;
    if (!inside) return sdm_fail(err, SDM_E_FORMAT, "%s: every voxel is 0: no label", path);
    return SDM_OK;
}

sdm_status cli_fit_close_labels(const cli_fit *f, const sdm_grid *grid, float *values,
                                sdm_error *err)
{
    const double radius = f->args->fit.label_close;
    if (isnan(radius)) return SDM_OK;
    return sdm_fit_close_labels(grid, radius, f->opts.n_threads, values, err);
}
