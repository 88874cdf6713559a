/* Messages, exit codes, interrupts and the clock of the command line. */
#include "terminal.h"

#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "args/options.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/utf8.h"

#define REPEAT_S 0.5

static bool quiet_wanted;
static cli_form form;
static bool incomplete;
static size_t warnings;
static volatile sig_atomic_t interrupts;
static volatile double first_interrupt; // seconds of sdm_clock(); only the handler uses it
static bool unprinted;                  // by cli_print()

static int exit_code_of(sdm_status status)
{
    if (incomplete) return CLI_EXIT_INCOMPLETE;
    switch (status) {
    case SDM_OK:
        return CLI_EXIT_DONE;
    case SDM_E_ARG:
    case SDM_E_CONFIG:
        return CLI_EXIT_USAGE;
    case SDM_E_FORMAT:
    case SDM_E_MESH:
    case SDM_E_PLUGIN:
        return CLI_EXIT_INPUT;
    case SDM_E_QUALITY:
        return CLI_EXIT_QUALITY;
    case SDM_E_RANGE:
        return CLI_EXIT_RANGE;
    case SDM_E_CANCELLED:
        return CLI_EXIT_INTERRUPTED;
    default:
        return CLI_EXIT_FAILED;
    }
}

void cli_set_quiet(bool quiet) { quiet_wanted = quiet; }
bool cli_is_quiet(void) { return quiet_wanted; }

void cli_set_incomplete(void) { incomplete = true; }

void cli_set_form(const char *name)
{
    form = !name || !strcmp(name, "auto") ? CLI_FORM_AUTO
           : !strcmp(name, "plain")       ? CLI_FORM_PLAIN
           : !strcmp(name, "json")        ? CLI_FORM_JSON
                                          : CLI_FORM_SLICER;
}

cli_form cli_get_form(void) { return form; }

void cli_json_line(sdm_json *json)
{
    if (!json->text.failed) fprintf(stderr, "%s\n", json->text.data);
    sdm_json_dispose(json);
}

/* Room for a message as it is printed: a byte becomes \xNN, or \u00NN in JSON. */
#define ROOM_BYTES (6 * SDM_ERROR_TEXT_MAX + 64)

/* An empty text for at most `bytes` bytes. A message is printed where memory has ended, too: if it
 * is no longer than that of an error, its text lies in `room` and takes no memory. */
static sdm_text begin_text(char room[ROOM_BYTES], size_t bytes)
{
    room[0] = '\0';
    if (bytes < ROOM_BYTES) return (sdm_text){.data = room, .capacity = ROOM_BYTES};
    return (sdm_text){0};
}

static void end_text(sdm_text *t, const char *room)
{
    if (t->data != room) sdm_text_dispose(t);
}

/* Prints an object with one member. */
static void print_json_message(const char *key, const char *text)
{
    char room[ROOM_BYTES];
    sdm_json json = {.text = begin_text(room, 6 * strlen(text) + 64)};
    sdm_json_open(&json, NULL, '{');
    sdm_json_text(&json, key, text);
    sdm_json_close(&json, '}');
    if (!json.text.failed) fprintf(stderr, "%s\n", json.text.data);
    end_text(&json.text, room);
}

bool cli_has_terminal(void)
{
    const char *term = getenv("TERM");
    return isatty(STDERR_FILENO) && term && *term && strcmp(term, "dumb");
}

/* True when stderr takes colours: a terminal, not TERM=dumb, NO_COLOR unset or empty. */
static bool wants_colour(void)
{
    const char *no = getenv("NO_COLOR");
    return cli_has_terminal() && !(no && *no);
}

/* True when the line begins with the place of the mistake: "file:line:column: ..." or "argument
 * 'key=value': ...". */
static bool has_place(const char *line, size_t length)
{
    if (!strncmp(line, "argument '", 10)) return true;
    for (size_t i = 0; i + 1 < length; i++) {
        if (line[i] != ':' || line[i + 1] < '0' || line[i + 1] > '9') continue;
        size_t k = i + 1;
        while (k < length && line[k] >= '0' && line[k] <= '9') k++;
        if (k + 1 < length && line[k] == ':' && line[k + 1] >= '0' && line[k + 1] <= '9')
            return true;
    }
    return false;
}

int cli_report(const sdm_error *err)
{
    const bool colour = wants_colour();
    char named[SDM_ERROR_TEXT_MAX], room[ROOM_BYTES];
    snprintf(named, sizeof named, "%s", err->text[0] ? err->text : sdm_status_name(err->status));
    cli_name_options(named);
    const char *text = named;
    if (form == CLI_FORM_JSON) {
        print_json_message("error", text);
        return exit_code_of(err->status);
    }
    sdm_text shown = begin_text(room, 4 * strlen(text));
    sdm_text_add_shown(&shown, text);
    text = shown.data;
    while (*text) {
        const size_t length = strcspn(text, "\n");
        if (!(err->status == SDM_E_CONFIG && has_place(text, length)))
            fprintf(stderr, "%ssdmgen: error: %s", colour ? "\033[31m" : "",
                    colour ? "\033[0m" : "");
        fprintf(stderr, "%.*s\n", (int)length, text);
        text += length + (text[length] == '\n');
    }
    end_text(&shown, room);
    return exit_code_of(err->status);
}

/* The formatted text: `room` if it fits there, else memory that the caller frees. Without memory
 * the result is `room` with the beginning of the text, and *cut is true. */
static char *format_text(char room[SDM_ERROR_TEXT_MAX], bool *cut, const char *fmt, va_list args)
{
    va_list again;
    va_copy(again, args);
    const int length = vsnprintf(room, SDM_ERROR_TEXT_MAX, fmt, args);
    const bool fits = length >= 0 && length < SDM_ERROR_TEXT_MAX;
    char *whole = fits || length < 0 ? NULL : malloc((size_t)length + 1);
    if (whole) vsnprintf(whole, (size_t)length + 1, fmt, again);
    va_end(again);
    *cut = !fits && !whole;
    if (length < 0) snprintf(room, SDM_ERROR_TEXT_MAX, "%s", fmt);
    return whole ? whole : room;
}

/* Prints a notice or a warning; `kind` is its key in JSON, `begin` its beginning elsewhere. Without
 * memory a text longer than the longest error message is cut. */
static void print_line(const char *kind, const char *begin, const char *fmt, va_list args)
{
    char start[SDM_ERROR_TEXT_MAX], room[ROOM_BYTES];
    bool cut;
    char *text = format_text(start, &cut, fmt, args);
    cli_name_options(text);
    if (form == CLI_FORM_JSON) {
        print_json_message(kind, text);
    } else {
        sdm_text shown = begin_text(room, 4 * strlen(text));
        sdm_text_add_shown(&shown, text);
        fprintf(stderr, "%s%s\n", begin, shown.data ? shown.data : start);
        end_text(&shown, room);
    }
    if (text != start) free(text);
}

void cli_print(const char *fmt, ...)
{
    char start[SDM_ERROR_TEXT_MAX];
    sdm_text shown = {0};
    bool cut;
    va_list args;
    va_start(args, fmt);
    char *text = format_text(start, &cut, fmt, args);
    va_end(args);
    if (!cut) sdm_text_add_shown(&shown, text);
    if (cut || shown.failed)
        unprinted = true;
    else if (shown.data)
        fputs(shown.data, stdout);
    if (text != start) free(text);
    sdm_text_dispose(&shown);
}

const char *cli_number(double x, int digits, char text[32])
{
    // all of the digits stand before the point
    const bool long_whole = fabs(x) >= pow(10, digits) - 0.5 && fabs(x) < 1e9;
    snprintf(text, 32, long_whole ? "%.*f" : "%.*g", long_whole ? 0 : digits, x);
    return text;
}

bool cli_is_unprinted(void) { return unprinted; }

void cli_notice(const char *fmt, ...)
{
    if (quiet_wanted) return;
    va_list args;
    va_start(args, fmt);
    print_line("notice", "sdmgen: ", fmt, args);
    va_end(args);
}

void cli_warn(const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    print_line("warning", "sdmgen: warning: ", fmt, args);
    va_end(args);
    warnings++;
}

size_t cli_warnings(void) { return warnings; }

/* The first interrupt asks the work to stop, and a later one ends the program at once. timeout and
 * job schedulers send the same signal to the process and to its group: within REPEAT_S that is one
 * interrupt. */
static void on_interrupt(int number)
{
    (void)number;
    const double now = sdm_clock(); // clock_gettime(): safe in a signal handler
    if (interrupts && now > first_interrupt + REPEAT_S) _exit(CLI_EXIT_INTERRUPTED);
    if (!interrupts) first_interrupt = now;
    interrupts = 1;
}

void cli_catch_interrupts(void)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_interrupt;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    // when a limit on file sizes is exceeded, write() then fails: so a message appears and no file
    // is left
    action.sa_handler = SIG_IGN;
    sigaction(SIGXFSZ, &action, NULL);
}

bool cli_is_interrupted(void) { return interrupts != 0; }

bool cli_interrupted(void *user)
{
    (void)user;
    return cli_is_interrupted();
}

sdm_status cli_check_interrupt(sdm_error *err)
{
    return interrupts ? sdm_fail(err, SDM_E_CANCELLED, "interrupted") : SDM_OK;
}

sdm_status cli_print_json(sdm_json *json, sdm_error *err)
{
    const bool failed = json->text.failed || !json->text.data;
    if (!failed) puts(json->text.data);
    sdm_json_dispose(json);
    return failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the JSON text") : SDM_OK;
}

sdm_status cli_print_text(sdm_text *text, sdm_error *err)
{
    const bool failed = text->failed || !text->data;
    if (!failed) fputs(text->data, stdout);
    sdm_text_dispose(text);
    return failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the text") : SDM_OK;
}

const char *cli_format_seconds(double seconds, char buf[32])
{
    if (seconds < 120)
        snprintf(buf, 32, "%.3g s", seconds);
    else if (seconds < 7200)
        snprintf(buf, 32, "%.3g min", seconds / 60);
    else
        snprintf(buf, 32, "%.3g h", seconds / 3600);
    return buf;
}

const char *cli_format_count(int64_t n, char buf[32])
{
    char digits[32];
    const int length = snprintf(digits, sizeof digits, "%lld", (long long)n);
    int out = 0;
    for (int i = 0; i < length; i++) {
        buf[out++] = digits[i];
        const int left = length - 1 - i;
        if (left > 0 && left % 3 == 0 && digits[i] != '-') buf[out++] = ',';
    }
    buf[out] = '\0';
    return buf;
}
