/* Command line modules of 3D Slicer: SdmgenFit, SdmgenExact and SdmgenGenerate are names of the
 * program sdmgen. The name by which it is called selects the command; the description of the module
 * (XML) is made from the table of options. Slicer's rules are in its documentation, "Slicer
 * Execution Model": it reads NAME.xml beside the file NAME, passes files by flags of the
 * description, and reads progress from stdout and results from a file. */
#pragma once

#include "args/options.h"

enum { SLICER_N_MODULES = 3 };

typedef struct slicer_module {
    const char *name;    /* "SdmgenFit" */
    size_t command;      /* index into cli_commands */
    const char *title;   /* in Slicer's list of modules */
    const char *basic;   /* options that the panel shows first, separated by spaces */
    const char *omitted; /* options that make no sense in Slicer */
} slicer_module;

extern const slicer_module slicer_modules[SLICER_N_MODULES];

/* A file that Slicer passes by a flag of its own. */
typedef struct slicer_file {
    const char *flag;       /* without the dashes */
    const char *option;     /* the option of sdmgen for it; NULL: a positional argument */
    const char *tag;        /* "image", "geometry" or "file" */
    const char *type;       /* attribute of the tag; NULL: none */
    const char *extensions; /* ".ply,.stl"; NULL: Slicer's own format */
    bool is_output;
    uint32_t modules; /* one bit for each index into slicer_modules */
    const char *label, *help;
} slicer_file;

extern const slicer_file slicer_files[];
extern const size_t slicer_n_files;

/* A result that Slicer reads back. */
typedef struct slicer_result {
    const char *name, *label, *help;
    uint32_t modules;
} slicer_result;

extern const slicer_result slicer_results[];
extern const size_t slicer_n_results;

/* The module whose name is the last part of the path; NULL: none. */
const slicer_module *slicer_find_module(const char *path);

/* True when a text of words separated by spaces has this word. */
bool slicer_has_word(const char *words, const char *word);

/* The file of this module with this flag[length]; NULL: none. */
const slicer_file *slicer_find_file(const slicer_module *m, const char *flag, size_t length);

/* True when an option of the command is a parameter of the module. */
bool slicer_has_option(const slicer_module *m, const cli_option *o);

/* Appends the description of the module. */
void slicer_describe(const slicer_module *m, sdm_text *out);

/* An sdmgen command line made from that of a module. */
typedef struct slicer_line {
    int argc;
    char **argv; /* [argc + 1], the last one NULL; points into the module's arguments or memory */
    sdm_text *words; /* storage of the words that were made */
    size_t n_words;
} slicer_line;

/* Translates the arguments of a module. SDM_E_ARG, SDM_E_NOMEM. slicer_line_dispose() frees the
 * line, also after an error. */
sdm_status slicer_translate(const slicer_module *m, int argc, char **argv, slicer_line *out,
                            sdm_error *err);
void slicer_line_dispose(slicer_line *line);
