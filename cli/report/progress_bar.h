/* Progress on stderr: on a terminal a bar that is redrawn in place, elsewhere a plain line every
 * ten seconds. */
#pragma once

#include <stdbool.h>

typedef struct cli_progress {
    bool terminal;   /* stderr is a terminal */
    bool drawn;      /* a bar is visible */
    double last;     /* time of the last line, s */
    double interval; /* shortest time between two lines, s */
} cli_progress;

void cli_progress_start(cli_progress *p);

/* Shows the title (the current work), the bar for the fraction done (clamped to 0 .. 1), and the
 * text (NULL: none). Cheap: it does nothing until the interval has passed. */
void cli_progress_show(cli_progress *p, const char *title, double fraction, const char *text);

/* Removes the bar before other output. */
void cli_progress_clear(cli_progress *p);
