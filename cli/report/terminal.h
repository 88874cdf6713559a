/* What the commands share towards the user and the system: messages, exit codes, interrupts, clock,
 * threads. */
#ifndef CLI_TERMINAL_H
#define CLI_TERMINAL_H

#include <stdbool.h>

#include "sdm/internal/text.h"
#include "sdm/status.h"

/* Exit codes, fixed for scripts. */
enum {
    CLI_EXIT_DONE = 0,
    CLI_EXIT_FAILED = 1,
    CLI_EXIT_USAGE = 2,
    CLI_EXIT_INPUT = 3,
    CLI_EXIT_QUALITY = 4,
    CLI_EXIT_RANGE = 5,
    CLI_EXIT_INTERRUPTED = 130
};
int cli_exit_code(sdm_status status);

/* Switches notices and progress off. */
void cli_set_quiet(bool quiet);
bool cli_is_quiet(void);

/* Prints the message of a failure on stderr: "sdmgen: error: text"; a mistake in a configuration
   with its place has its line to itself. Returns the exit code. */
int cli_report(const sdm_error *err);

/* "sdmgen: text" on stderr, unless quiet. */
void cli_notice(const char *fmt, ...) SDM_PRINTF(1, 2);

/* Terminal colours on stderr are wanted: a terminal, not TERM=dumb, NO_COLOR unset or empty. */
bool cli_wants_colour(void);
/* stderr is a terminal that can redraw a line. */
bool cli_has_terminal(void);

/* Catches SIGINT and SIGTERM: the first sets a flag, the second ends the program at once with 130.
 */
void cli_catch_interrupts(void);
bool cli_is_interrupted(void);
/* The same as a hook of the library. */
bool cli_interrupted(void *user);
/* SDM_E_CANCELLED when interrupted. */
sdm_status cli_check_interrupt(sdm_error *err);

/* Prints a finished JSON text as one line on stdout and disposes of it. SDM_E_NOMEM. */
sdm_status cli_print_json(sdm_json *json, sdm_error *err);

/* Seconds of this thread's processor: other programs on the machine do not count. */
double cli_thread_clock(void);

/* n with its thousands separated by commas; buf has 32 bytes; returns buf. */
const char *cli_format_count(int64_t n, char buf[32]);

#endif
