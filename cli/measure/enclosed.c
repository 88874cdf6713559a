/* Counts the voxels of a mask that its border does not reach: a flood from the border. */
#include "enclosed.h"

#include "sdm/memory.h"

enum { OUT = 0, IN = 1, BESIDE = 2, REACHED = 3 };

/* next[6] = numbers of the neighbours of voxel v; returns how many lie in the grid. */
static int neighbours(const sdm_grid *g, size_t v, size_t next[6])
{
    size_t step = 1, rest = v;
    int n = 0;
    for (int a = 0; a < 3; a++) {
        const size_t length = (size_t)g->n[a], at = rest % length;
        if (at > 0) next[n++] = v - step;
        if (at + 1 < length) next[n++] = v + step;
        rest /= length, step *= length;
    }
    return n;
}

/* Reaches voxel v if its neighbours belong to the mask, too. */
static void reach(const sdm_grid *g, unsigned char *mask, size_t v, size_t *stack, size_t *n)
{
    size_t next[6];
    const int around = neighbours(g, v, next);
    if (mask[v] != IN && mask[v] != BESIDE) return;
    for (int i = 0; i < around; i++)
        if (mask[next[i]] == OUT) return;
    mask[v] = REACHED;
    stack[(*n)++] = v;
}

sdm_status cli_count_enclosed(const sdm_grid *g, unsigned char *mask, size_t *n, sdm_error *err)
{
    const size_t count = sdm_grid_count(g);
    size_t *stack = NULL, n_stack = 0, next[6];
    const sdm_status s = SDM_ALLOC(&stack, count, "voxels of the image", err);
    *n = 0;
    if (s) return s;
    for (size_t v = 0; v < count; v++)
        if (neighbours(g, v, next) < 6) reach(g, mask, v, stack, &n_stack);
    while (n_stack) {
        const int around = neighbours(g, stack[--n_stack], next);
        for (int i = 0; i < around; i++) {
            if (mask[next[i]] == IN) mask[next[i]] = BESIDE;
            reach(g, mask, next[i], stack, &n_stack);
        }
    }
    for (size_t v = 0; v < count; v++) *n += mask[v] == IN;
    sdm_free(stack);
    return SDM_OK;
}
