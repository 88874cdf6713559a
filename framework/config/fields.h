/* Field tables: each row belongs to one key and defines how the value of the key is parsed and
 * written, its bounds, its default and its description. */
#pragma once

#include "yaml_tree.h"

#define SDM_KEY_PATH_MAX 160
#define SDM_SECTION_FIELDS_MAX 24
#define SDM_SECTIONS_MAX 8

typedef enum sdm_field_type {
    SDM_FIELD_INT = 0, /* int */
    SDM_FIELD_INT64,   /* int64_t */
    SDM_FIELD_UINT64,  /* uint64_t; min and max are not used */
    SDM_FIELD_REAL,    /* double */
    SDM_FIELD_CHOICE,  /* enum with values 0, 1, ... named in order by `choices`, "a|b" */
    SDM_FIELD_TEXT,    /* char[max + 1]: not empty, printable UTF-8 */
    SDM_FIELD_SPECIAL  /* read and written by the functions of the row */
} sdm_field_type;

struct sdm_reader;

/* A row of a field table: one key. */
typedef struct sdm_field {
    const char *key;
    sdm_field_type type;
    size_t offset; /* byte offset of the member in *sdm_reader.target; unused for SPECIAL */
    double min, max;
    const char *def; /* default as text in YAML syntax; NULL: none */
    const char *choices;
    const char *unit, *help;
    /* type, range and default as shown in the description; NULL: derived from the members above */
    const char *shown_type, *shown_range, *shown_def;
    unsigned kinds;               /* bit k: networks of kind k have the key; 0: all have it */
    const char *const *kind_defs; /* [kind] default for each kind of network; NULL: `def` for all */
    /* For SPECIAL: reads a value; returns false after it has recorded a mistake. */
    bool (*read)(struct sdm_reader *r, const struct sdm_field *f, const sdm_tree_node *node,
                 const char *path);
    /* For SPECIAL: writes the value as YAML, without the key; NULL: the key is not written. */
    void (*dump)(const sdm_config *c, sdm_text *out);
    /* Returns false if the key has no value, so that it is not written; NULL: it always has one. */
    bool (*has)(const sdm_config *c);
} sdm_field;

/* The keys under one top-level name; the name "" stands for the top level itself. */
typedef struct sdm_section {
    const char *name, *help;
    const sdm_field *fields;
    size_t n_fields;
    /* A word that may stand in place of the keys, "auto", and what it does; NULL: none. */
    const char *word;
    void (*take_word)(struct sdm_reader *r, sdm_mark mark);
} sdm_section;

/* The position at which a key was given last, and whether its value was refused. If the mark is not
 * set, the key was not given, and the default holds. */
typedef struct sdm_given {
    sdm_mark mark;
    bool refused;
} sdm_given;

/* State of reading a configuration, or one element of a list of a configuration, into a struct. */
typedef struct sdm_reader {
    void *target;       /* the struct that the tables describe */
    sdm_config *config; /* the same struct if it is a training configuration, else NULL */
    sdm_mistakes *mistakes;
    const sdm_section *sections; /* [n_sections] */
    size_t n_sections;
    sdm_mark section_mark[SDM_SECTIONS_MAX]; /* first position of each section */
    sdm_given given[SDM_SECTIONS_MAX][SDM_SECTION_FIELDS_MAX];
    /* a key of the section is unknown: what seems to be missing may be this one */
    bool unknown[SDM_SECTIONS_MAX];
    double centre[3]; /* grid.centre; converted to grid.origin after all keys are read */
    int file_kind;    /* network.kind before the overrides are applied */
} sdm_reader;

static inline bool sdm_mark_is_set(sdm_mark m) { return m.line > 0 || m.override > 0; }

/* True if position a is after position b. */
static inline bool sdm_mark_is_later(sdm_mark a, sdm_mark b)
{
    if (a.override != b.override) return a.override > b.override;
    return a.line != b.line ? a.line > b.line : a.column > b.column;
}

/* True if the key was last given by this override, with an accepted value. */
static inline bool sdm_given_by(const sdm_given *g, int override)
{
    return g->mark.override == override && !g->refused;
}

/* Sets one field to `def`, a text in YAML syntax. */
void sdm_field_set_default(sdm_reader *r, const sdm_field *f, const char *def);

/* Sets every field to its default. */
void sdm_fields_set_defaults(sdm_reader *r);

/* Reads the tree of a whole file or of one override; later values replace earlier ones. Mistakes
 * are recorded in r->mistakes. */
void sdm_fields_read(sdm_reader *r, const sdm_tree_node *root);

/* The entry of r->given for section.key, which must exist in the tables. */
sdm_given *sdm_fields_given(sdm_reader *r, const char *section, const char *key);

/* True if a key of the section is unknown: then no other key of it is called missing. */
bool sdm_fields_unknown(const sdm_reader *r, const char *section);

/* Read one number in min .. max, or a text of at most `max` bytes; `path` names the key in
 * messages. Return false after a mistake was recorded; *out is then unchanged. */
bool sdm_read_real(sdm_reader *r, const sdm_tree_node *node, const char *path, double min,
                   double max, double *out);
bool sdm_read_int(sdm_reader *r, const sdm_tree_node *node, const char *path, int64_t min,
                  int64_t max, int64_t *out);
bool sdm_read_text(sdm_reader *r, const sdm_tree_node *node, const char *path, size_t max,
                   char *out);
/* Reads one of the words f->choices; *out = its number, from 0. Returns false after a mistake. */
bool sdm_read_choice(sdm_reader *r, const sdm_field *f, const sdm_tree_node *node, const char *path,
                     int *out);

/* Records the mistake "PATH: needs WANTED, got ..." and returns false. */
bool sdm_refuse_type(sdm_reader *r, const sdm_tree_node *node, const char *path,
                     const char *wanted);

/* The allowed values of a field as text: "0 .. 16", "silu, tanh, relu", or f->shown_range. Returns
 * buf. */
const char *sdm_field_range(const sdm_field *f, char *buf, size_t size);

/* As sdm_format_real(), but always writes integers of up to nine digits without an exponent: 20,
 * not 2e+01. */
const char *sdm_format_plain(double v, char buf[32]);

/* Appends a text in double quotes, in YAML syntax. */
void sdm_dump_text(const char *text, sdm_text *out);

/* buf = name number `index`, from 0, of the list "a|b|c"; false if the index is too large. */
bool sdm_choice_name(const char *choices, int index, char buf[SDM_NAME_MAX]);
