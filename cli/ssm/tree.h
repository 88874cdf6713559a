/* A file of named groups and arrays, HDF5 or its form in JSON, as readers of shape models see it.
 */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "sdm/status.h"

#define CLI_TREE_TEXT 256

/* Names are paths such as "/model/mean". */
typedef struct cli_tree {
    const char *path; /* the file, for messages */
    void *self;
    /* *values = the numbers of an array of one or two dimensions, or a single number (n_dim 0), to
       be freed with sdm_free(). Sizes are checked against the file before memory is allocated.
       SDM_E_FORMAT, SDM_E_NOMEM. */
    sdm_status (*numbers)(const struct cli_tree *t, const char *name, double **values,
                          size_t shape[2], int *n_dim, sdm_error *err);
    /* True when there is a group or an array of this name. */
    bool (*has)(const struct cli_tree *t, const char *name);
    /* The text of a string attribute or, with attribute NULL, of an array of one string. False when
       there is none. */
    bool (*text)(const struct cli_tree *t, const char *name, const char *attribute,
                 char out[CLI_TREE_TEXT]);
    /* The name of member `index` of a group, in some fixed order. False when there is none. */
    bool (*child)(const struct cli_tree *t, const char *group, size_t index,
                  char out[CLI_TREE_TEXT]);
    void (*close)(struct cli_tree *t);
} cli_tree;

/* Open a file; call tree->close(tree) after success. SDM_E_IO, SDM_E_FORMAT, SDM_E_NOMEM;
 * cli_tree_hdf5(): SDM_E_UNSUPPORTED in a build without HDF5. */
sdm_status cli_tree_hdf5(const char *path, cli_tree *tree, sdm_error *err);
sdm_status cli_tree_json(const char *path, cli_tree *tree, sdm_error *err);
