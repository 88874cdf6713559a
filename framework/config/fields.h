/* Field tables: one row a key gives its parsing, bounds, default, dump and description. */
#ifndef SDM_FIELDS_H
#define SDM_FIELDS_H

#include "yaml_tree.h"

#define SDM_KEY_PATH_MAX 160
#define SDM_SECTION_FIELDS_MAX 24
#define SDM_SECTIONS_MAX 8

typedef enum sdm_field_type {
    SDM_FIELD_INT = 0, /* int */
    SDM_FIELD_INT64,   /* int64_t */
    SDM_FIELD_UINT64,  /* uint64_t, bounds not used */
    SDM_FIELD_REAL,    /* double */
    SDM_FIELD_CHOICE,  /* an enum; choices "a|b" in the order of its values 0, 1 ... */
    SDM_FIELD_TEXT,    /* char[max + 1]: printable, not empty */
    SDM_FIELD_SPECIAL  /* by the functions of the row */
} sdm_field_type;

struct sdm_reader;

typedef struct sdm_field {
    const char *key;
    sdm_field_type type;
    size_t offset; /* in what is read: sdm_reader.target; not used by SPECIAL */
    double min, max;
    const char *def; /* default as it is written in YAML; NULL: none */
    const char *choices;
    const char *unit, *help;
    const char *shown_type, *shown_range,
        *shown_def;               /* for the description; NULL: derived from the above */
    unsigned kinds;               /* bit k: networks of kind k have the key; 0: all have it */
    const char *const *kind_defs; /* default for each kind of network; NULL: def for all */
    bool (*read)(struct sdm_reader *r, const struct sdm_field *f, const sdm_tree_node *node,
                 const char *path);
    void (*dump)(const sdm_config *c,
                 sdm_text *out); /* the value only; NULL in a SPECIAL row: nothing is written */
} sdm_field;

/* Keys under one top-level name; the name "" stands for the top level itself. */
typedef struct sdm_section {
    const char *name, *help;
    const sdm_field *fields;
    size_t n_fields;
} sdm_section;

/* Where a key was given last, and whether that value was refused. */
typedef struct sdm_given {
    sdm_mark mark;
    bool refused;
} sdm_given;

/* A configuration, or an element of a list in one, under construction. */
typedef struct sdm_reader {
    void *target;       /* the struct that the tables describe */
    sdm_config *config; /* the same where it is a training configuration, else NULL */
    sdm_mistakes *mistakes;
    const sdm_section *sections;
    size_t n_sections;
    sdm_mark section_mark[SDM_SECTIONS_MAX];
    sdm_given given[SDM_SECTIONS_MAX][SDM_SECTION_FIELDS_MAX];
    double centre[3]; /* grid.centre; turned into the origin when everything is read */
    int file_kind;    /* network.kind before the overrides */
} sdm_reader;

static inline bool sdm_mark_is_set(sdm_mark m) { return m.line > 0 || m.override > 0; }

/* Sets one field to a default, a text as in YAML. */
void sdm_field_set_default(sdm_reader *r, const sdm_field *f, const char *def);

/* Sets every field to its default. */
void sdm_fields_set_defaults(sdm_reader *r);

/* Reads a whole configuration or the tree of one override; later values replace earlier ones. */
void sdm_fields_read(sdm_reader *r, const sdm_tree_node *root);

/* The record of key section.key; both must exist. */
sdm_given *sdm_fields_given(sdm_reader *r, const char *section, const char *key);

/* One value of a list or a scalar. False after a mistake was recorded; *out is then unchanged. */
bool sdm_read_real(sdm_reader *r, const sdm_tree_node *node, const char *path, double min,
                   double max, double *out);
bool sdm_read_int(sdm_reader *r, const sdm_tree_node *node, const char *path, int64_t min,
                  int64_t max, int64_t *out);
bool sdm_read_text(sdm_reader *r, const sdm_tree_node *node, const char *path, size_t max,
                   char *out);

/* Records "PATH: needs WANTED, got ...". False. */
bool sdm_refuse_type(sdm_reader *r, const sdm_tree_node *node, const char *path,
                     const char *wanted);

/* "a list", "a mapping", "nothing", "the text 'x'" or "'x'": what stands where something else was
 * wanted. */
const char *sdm_describe_node(const sdm_tree_node *node, char buf[SDM_QUOTE_MAX + 16]);

/* "0 .. 16" of a row, "silu, tanh, relu", or what the row says. Returns buf. */
const char *sdm_field_range(const sdm_field *f, char *buf, size_t size);
const char *sdm_field_type_name(const sdm_field *f);

/* The value of a field as YAML. */
void sdm_field_dump(const sdm_config *c, const sdm_field *f, sdm_text *out);

/* Appends a table of every key of sections[n]: name, type, range, default, unit, meaning. */
void sdm_fields_describe(const sdm_section *sections, size_t n, bool markdown, sdm_text *out);

/* sdm_format_real(), but 20 and not 2e+01 for whole numbers of up to nine digits. */
const char *sdm_format_plain(double v, char buf[32]);

/* A text in double quotes, as YAML. */
void sdm_dump_text(const char *text, sdm_text *out);

/* Name `index` of a list "a|b|c" into buf; false behind the last. */
bool sdm_choice_name(const char *choices, int index, char buf[SDM_NAME_MAX]);

#endif
