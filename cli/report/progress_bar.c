/* Draws the progress bar, or prints progress lines where stderr is no terminal. */
#include "progress_bar.h"

#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "sdm/internal/clock.h"
#include "terminal.h"

enum { MIN_CELLS = 6, MAX_CELLS = 24, LINE_MAX_BYTES = 512 };

void cli_progress_start(cli_progress *p)
{
    p->terminal = cli_has_terminal();
    p->drawn = false;
    p->interval = p->terminal ? 0.1 : 10.0;
    p->last = sdm_clock() - (p->terminal ? p->interval : 0.0);
}

static size_t terminal_width(void)
{
    struct winsize size;
    if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) || size.ws_col < 20) return 80;
    return size.ws_col;
}

/* bar = a text of '#' and '-' with about `room` characters, the number of columns that title and
 * text leave. */
static void bar_draw(char bar[MAX_CELLS + 1], double fraction, size_t room)
{
    const size_t cells = room < MIN_CELLS ? MIN_CELLS : room > MAX_CELLS ? MAX_CELLS : room;
    const size_t full = (size_t)(fraction * (double)cells + 0.5);
    for (size_t i = 0; i < cells; i++) bar[i] = i < full ? '#' : '-';
    bar[cells] = '\0';
}

void cli_progress_show(cli_progress *p, const char *title, double fraction, const char *text)
{
    const double now = sdm_clock();
    if (cli_is_quiet() || now - p->last < p->interval) return;
    p->last = now;
    if (!(fraction >= 0)) fraction = 0;
    if (fraction > 1) fraction = 1;

    if (!text) text = "";
    if (!p->terminal) {
        fprintf(stderr, "sdmgen: %s %.0f %%  %s\n", title, 100 * fraction, text);
        return;
    }
    char line[LINE_MAX_BYTES], bar[MAX_CELLS + 1];
    const size_t width = terminal_width(),
                 around = strlen(title) + strlen(text) + strlen("  100 % [] ") + 1;
    bar_draw(bar, fraction, width > around ? width - around : 0);
    snprintf(line, sizeof line, "%s %3.0f %% [%s] %s", title, 100 * fraction, bar, text);
    // a line that wraps could not be redrawn in place
    if (width < sizeof line) line[width - 1] = '\0';
    fprintf(stderr, "\r%s\033[K", line);
    fflush(stderr);
    p->drawn = true;
}

void cli_progress_clear(cli_progress *p)
{
    if (!p->drawn) return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
    p->drawn = false;
}
