/* Progress in the form that --progress asks for: on a terminal a bar that is redrawn in place;
 * plain lines on stderr; JSON lines on stderr; or 3D Slicer's elements on stdout. */
#pragma once

#include <stdbool.h>

typedef struct cli_progress {
    bool bar;        /* a bar on a terminal instead of lines */
    bool drawn;      /* a bar is visible */
    double last;     /* time of the last line, s */
    double interval; /* shortest time between two lines, s */
} cli_progress;

void cli_progress_start(cli_progress *p);

/* Shows the title (the current work), the fraction done (clamped to 0 .. 1), and the text (NULL:
 * none). Cheap: it does nothing until the interval has passed. */
void cli_progress_show(cli_progress *p, const char *title, double fraction, const char *text);

/* Prints the title and the text as a line of its own, at once: why the progress begins again. */
void cli_progress_tell(cli_progress *p, const char *title, const char *text);

/* Removes the bar before other output. */
void cli_progress_clear(cli_progress *p);

/* Ends the progress: removes the bar; programs that read the lines get a last one with fraction 1
 * if all is done. */
void cli_progress_end(cli_progress *p, bool done);
