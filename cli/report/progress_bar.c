/* Draws the progress bar, or prints lines of progress. */
#include "progress_bar.h"

#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "sdm/internal/clock.h"
#include "sdm/internal/text.h"
#include "terminal.h"

enum { MIN_CELLS = 6, MAX_CELLS = 24, LINE_MAX_BYTES = 512 };

/* Shortest time between two lines of progress, s: plain lines are for log files, the others for
 * programs that show them. */
static double interval_of(bool bar)
{
    if (bar) return 0.1;
    const cli_form form = cli_get_form();
    return form == CLI_FORM_JSON || form == CLI_FORM_SLICER ? 0.25 : 10.0;
}

void cli_progress_start(cli_progress *p)
{
    p->bar = cli_get_form() == CLI_FORM_AUTO && cli_has_terminal();
    p->drawn = false;
    p->interval = interval_of(p->bar);
    p->last = sdm_clock() - (p->interval < 1 ? p->interval : 0.0);
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

static void draw(cli_progress *p, const char *title, double fraction, const char *text)
{
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

/* {"progress":0.42,"title":"fit","text":"iteration 3 of at most 80"} */
static void print_json(const char *title, double fraction, const char *text)
{
    sdm_json json = {0};
    sdm_json_open(&json, NULL, '{');
    sdm_json_real(&json, "progress", fraction);
    sdm_json_text(&json, "title", title);
    sdm_json_text(&json, "text", text);
    sdm_json_close(&json, '}');
    cli_json_line(&json);
}

/* The elements that 3D Slicer finds among other output of a module. */
static void print_slicer(double fraction)
{
    printf("<filter-progress>%.3f</filter-progress>\n", fraction);
    fflush(stdout);
}

static void print_line(const char *title, double fraction, const char *text)
{
    if (cli_get_form() == CLI_FORM_JSON)
        print_json(title, fraction, text);
    else if (cli_get_form() == CLI_FORM_SLICER)
        print_slicer(fraction);
    else
        fprintf(stderr, "sdmgen: %s %.0f %%  %s\n", title, 100 * fraction, text);
}

void cli_progress_tell(cli_progress *p, const char *title, const char *text)
{
    if (cli_is_quiet()) return;
    cli_progress_clear(p);
    print_line(title, 0, text);
    p->last = sdm_clock();
}

void cli_progress_show(cli_progress *p, const char *title, double fraction, const char *text)
{
    const double now = sdm_clock();
    if (cli_is_quiet() || now - p->last < p->interval) return;
    p->last = now;
    if (!(fraction >= 0)) fraction = 0;
    if (fraction > 1) fraction = 1;
    if (!text) text = "";

    if (p->bar)
        draw(p, title, fraction, text);
    else
        print_line(title, fraction, text);
}

void cli_progress_clear(cli_progress *p)
{
    if (!p->drawn) return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
    p->drawn = false;
}

void cli_progress_end(cli_progress *p, bool done)
{
    cli_progress_clear(p);
    if (!done || cli_is_quiet()) return;
    if (cli_get_form() == CLI_FORM_JSON)
        print_json("done", 1, "");
    else if (cli_get_form() == CLI_FORM_SLICER)
        print_slicer(1);
}
