/* Functions that read and write the keys of type SDM_FIELD_SPECIAL of a training configuration. The
 * signatures are those of sdm_field.read and sdm_field.dump; NAME in sdm_read_key_NAME() and
 * sdm_dump_key_NAME() is the key. */
#pragma once

#include "fields.h"

/* Reads the key of a node, the name of an option or parameter of a shape. Returns false after it
 * has recorded a mistake. */
bool sdm_read_name(sdm_reader *r, const sdm_tree_node *node, const char *path,
                   char out[SDM_NAME_MAX]);

bool sdm_read_key_size(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                       const char *path);
bool sdm_read_key_spacing(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path);
bool sdm_read_key_origin(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path);
bool sdm_read_key_centre(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path);
bool sdm_read_key_options(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                          const char *path);
bool sdm_read_key_ranges(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path);
bool sdm_read_key_distribution(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                               const char *path);
bool sdm_read_key_static(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node,
                         const char *path);

void sdm_dump_key_size(const sdm_config *c, sdm_text *out);
void sdm_dump_key_spacing(const sdm_config *c, sdm_text *out);
void sdm_dump_key_origin(const sdm_config *c, sdm_text *out);
void sdm_dump_key_options(const sdm_config *c, sdm_text *out);
void sdm_dump_key_ranges(const sdm_config *c, sdm_text *out);
void sdm_dump_key_distribution(const sdm_config *c, sdm_text *out);
void sdm_dump_key_static(const sdm_config *c, sdm_text *out);
