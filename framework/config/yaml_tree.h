/* A YAML document as a tree of nodes with their positions (marks). Only a subset of YAML is
 * allowed: one document without tags, anchors, aliases and directives. */
#pragma once

#include "sdm/internal/mistakes.h"

#define SDM_TREE_BYTES_MAX ((size_t)1 << 20)
#define SDM_TREE_DEPTH_MAX 32
#define SDM_TREE_NODES_MAX 4096
#define SDM_TREE_PATH_BYTES 512 /* maximum length of the dotted key of an override */
#define SDM_TREE_PATH_NAMES 8   /* maximum number of names in such a key */

typedef enum sdm_tree_kind { SDM_TREE_SCALAR = 0, SDM_TREE_LIST, SDM_TREE_MAP } sdm_tree_kind;

typedef struct sdm_tree_node {
    sdm_tree_kind kind;
    bool quoted;      /* the scalar is in quotes or block style */
    const char *text; /* text of a scalar; NULL for lists and maps */
    const char *key;  /* key of the node if its parent is a map, else NULL */
    sdm_mark mark, key_mark;
    size_t n_children;
    struct sdm_tree_node *first, *last; /* children, in the order of the file */
    struct sdm_tree_node *next;         /* next sibling */
} sdm_tree_node;

/* Zero-initialise the tree; sdm_tree_dispose() frees it. Nodes and texts are owned by the tree. */
typedef struct sdm_tree {
    sdm_tree_node *nodes;
    size_t n_nodes, max_nodes;
    char *pool; /* the texts */
    size_t pool_used, pool_size;
    sdm_tree_node *root; /* NULL: an empty document */
} sdm_tree;

/* Reads a file of at most SDM_TREE_BYTES_MAX bytes; *data is freed with sdm_free(). SDM_E_IO,
 * SDM_E_CONFIG (too long), SDM_E_NOMEM. */
sdm_status sdm_tree_read(const char *path, uint8_t **data, size_t *size, sdm_error *err);

/* Parses text[size]. override: mark of the key=value argument that contains the text, which becomes
 * the mark of all nodes; a zero mark for the text of a file. Mistakes are added to *mistakes; a
 * repeated key is a mistake, too, and only its first value is kept in the tree. SDM_E_CONFIG: the
 * tree cannot be used; *mistakes has the reason. SDM_E_NOMEM: *err has the message. */
sdm_status sdm_tree_parse(sdm_tree *tree, const char *text, size_t size, sdm_mark override,
                          sdm_mistakes *mistakes, sdm_error *err);

/* Puts the root below the dotted key path[length]: "a.b" and the root 4 give {a: {b: 4}}; an empty
 * document counts as an empty value. May be called at most once per tree. `path` must have fewer
 * than SDM_TREE_PATH_BYTES bytes and at most SDM_TREE_PATH_NAMES names. */
sdm_status sdm_tree_wrap(sdm_tree *tree, const char *path, size_t length, sdm_mark override,
                         sdm_error *err);

void sdm_tree_dispose(sdm_tree *tree);

/* True for a scalar without text, as in "key:". */
bool sdm_tree_is_empty(const sdm_tree_node *node);

/* Offset of the first byte of text[size] that is not printable UTF-8 (tabs and line breaks are not
 * printable); `size` if all bytes are printable. */
size_t sdm_tree_printable(const char *text, size_t size);
