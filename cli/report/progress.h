/* A progress line on stderr: a bar that is redrawn on a terminal, a plain line every ten seconds
 * elsewhere. */
#ifndef CLI_PROGRESS_H
#define CLI_PROGRESS_H

#include <stdbool.h>

typedef struct cli_progress {
    bool terminal, drawn;
    double last, interval; /* time of the last line, seconds between two */
} cli_progress;

void cli_progress_start(cli_progress *p);

/* title: what is being done; fraction 0..1; text (may be NULL): the figures behind the bar. Cheap
 * to call often. */
void cli_progress_show(cli_progress *p, const char *title, double fraction, const char *text);

/* Removes the bar, so that something else can be printed. */
void cli_progress_clear(cli_progress *p);

#endif
