/* Messages, exit codes, interrupts and the processor clock, shared by all commands. */
#pragma once

#include <stdbool.h>

#include "sdm/internal/text.h"
#include "sdm/status.h"

/* Exit codes. Scripts rely on them: they must not change. */
enum {
    CLI_EXIT_DONE = 0,
    CLI_EXIT_FAILED = 1,
    CLI_EXIT_USAGE = 2,
    CLI_EXIT_INPUT = 3,
    CLI_EXIT_QUALITY = 4,
    CLI_EXIT_RANGE = 5,
    CLI_EXIT_INCOMPLETE = 6, /* some cases of a cohort failed or are missing */
    CLI_EXIT_INTERRUPTED = 130
};

/* true: no notices and no progress from now on; warnings remain. */
void cli_set_quiet(bool quiet);
bool cli_is_quiet(void);

/* Form of the progress, and of all lines on stderr. */
typedef enum cli_form {
    CLI_FORM_AUTO = 0, /* a bar on a terminal, plain lines elsewhere */
    CLI_FORM_PLAIN,    /* plain lines */
    CLI_FORM_JSON,     /* each line on stderr is a JSON object with the key progress, notice,
                          warning or error */
    CLI_FORM_SLICER    /* progress on stdout as 3D Slicer reads it: <filter-progress> */
} cli_form;

/* Sets the form from the value of --progress; NULL: CLI_FORM_AUTO. */
void cli_set_form(const char *name);
cli_form cli_get_form(void);

/* Prints a finished JSON object as one line on stderr and frees it; an incomplete one is dropped.
 */
void cli_json_line(sdm_json *json);

/* Prints the message of a failure on stderr, "sdmgen: error: text". Lines of a configuration error
   that begin with the place of the mistake, "file:line:column:", have no such prefix. Returns the
   exit code. */
int cli_report(const sdm_error *err);

/* From now on cli_report() returns CLI_EXIT_INCOMPLETE. */
void cli_set_incomplete(void);

/* Prints "sdmgen: text" on stderr, unless quiet: good to know. */
void cli_notice(const char *fmt, ...) SDM_PRINTF(1, 2);

/* Prints "sdmgen: warning: text" on stderr, quiet or not: the input has a fault, or the result is
   probably not what the user wants. */
void cli_warn(const char *fmt, ...) SDM_PRINTF(1, 2);

/* Number of warnings that the program has printed so far. */
size_t cli_warnings(void);

/* printf() for texts that quote a file: characters that command a terminal are printed as \xNN, as
 * they are in all messages on stderr. */
void cli_print(const char *fmt, ...) SDM_PRINTF(1, 2);

/* text[32] = x with `digits` digits, or below 1e9 with all of those before the point, so that there
 * is no exponent. Returns text. */
const char *cli_number(double x, int digits, char text[32]);

/* True when memory was too short for a text of cli_print(), which is then missing. */
bool cli_is_unprinted(void);

/* True when stderr is a terminal that can redraw a line: TERM is set and not "dumb". */
bool cli_has_terminal(void);

/* Catches SIGINT and SIGTERM: the first sets a flag, the second ends the program at once with
 * exit code 130. Ignores SIGXFSZ: writing beyond a limit on file sizes then fails like any
 * other write. */
void cli_catch_interrupts(void);
bool cli_is_interrupted(void);

/* cli_is_interrupted() with the signature of the library's `cancelled` callbacks. */
bool cli_interrupted(void *user);

/* SDM_E_CANCELLED after an interrupt, else SDM_OK. */
sdm_status cli_check_interrupt(sdm_error *err);

/* Prints a finished JSON text as one line on stdout and frees it. SDM_E_NOMEM: it is incomplete. */
sdm_status cli_print_json(sdm_json *json, sdm_error *err);

/* Prints a text on stdout and frees it. SDM_E_NOMEM: it is incomplete. */
sdm_status cli_print_text(sdm_text *text, sdm_error *err);

/* Writes a time as "12 s", "3.5 min" or "2.1 h" into buf; returns buf. */
const char *cli_format_seconds(double seconds, char buf[32]);

/* Writes n into buf with commas between groups of three digits; returns buf. */
const char *cli_format_count(int64_t n, char buf[32]);
