/* Signal handlers and an exit handler that name the plug-in whose callback, or the library whose
 * crash ended the program. */
#define _XOPEN_SOURCE 700 // sigaltstack()
#include "crash_guard.h"

#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sdm/internal/callback.h"
#include "sdm/internal/file.h"
#include "sdm/internal/foreign.h"
#include "terminal.h"

/* Where two threads crash at once, one tells it; the other waits for the end. */
static void wait_unless_first(void)
{
    static atomic_flag told = ATOMIC_FLAG_INIT;
    while (atomic_flag_test_and_set(&told)) pause();
}

/* Prints "sdmgen: error: shape 'mug', mesh() at r=2 h=3: REASON" and ends the program. snprintf()
 * is no function for signal handlers by the standard; the C libraries' own work there for short
 * texts without locks or memory, and the alternative is a message without numbers. */
static void end_program(const sdm_callback *c, const char *reason)
{
    wait_unless_first();
    char line[1024];
    // names hold no characters that JSON escapes
    const bool json = cli_get_form() == CLI_FORM_JSON;
    size_t n = (size_t)snprintf(line, sizeof line, "%sshape '%s', %s()",
                                json ? "{\"error\": \"" : "sdmgen: error: ", c->shape, c->function);
    for (size_t i = 0; i < c->n && n + 200 < sizeof line; i++)
        n += (size_t)snprintf(line + n, sizeof line - n, "%s %.32s=%.6g", i ? "" : " at",
                              c->params[i].name, c->values[i]);
    n += (size_t)snprintf(line + n, sizeof line - n, ": %s%s\n", reason, json ? "\"}" : "");
    const ssize_t put = write(STDERR_FILENO, line, n < sizeof line ? n : sizeof line - 1);
    (void)put;
    sdm_outfile_remove_temps();
    _exit(CLI_EXIT_INPUT);
}

/* Prints "sdmgen: error: x.vdb: out of memory, and OpenVDB crashed" and ends the program. */
static void end_in_library(const sdm_foreign *f, bool starved)
{
    wait_unless_first();
    sdm_error err = {0};
    sdm_fail(&err, SDM_E_NOMEM, "%.1000s%s%s%s crashed%s", f->path ? f->path : "",
             f->path ? ": " : "", starved ? "out of memory, and " : "", f->library,
             starved ? "" : ": it does so where memory ends, else this is a fault of the library");
    cli_report(&err);
    sdm_outfile_remove_temps();
    _exit(CLI_EXIT_FAILED);
}

static bool plugins_loaded;

/* A plug-in that writes beyond its arrays damages memory, and the program crashes later: one line
 * tells how to find it. */
static void hint_at_plugins(void)
{
    static const char text[] = "sdmgen: error: the program crashed; a plug-in that has written "
                               "beyond its arrays may be the reason: --isolate finds it\n",
                      json[] = "{\"error\": \"the program crashed; a plug-in that has written "
                               "beyond its arrays may be the reason: --isolate finds it\"}\n";
    static atomic_flag told = ATOMIC_FLAG_INIT;
    if (!plugins_loaded || atomic_flag_test_and_set(&told)) return;
    const bool is_json = cli_get_form() == CLI_FORM_JSON;
    const ssize_t put =
        write(STDERR_FILENO, is_json ? json : text, is_json ? sizeof json - 1 : sizeof text - 1);
    (void)put;
}

static const int signals[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
enum { N_SIGNALS = sizeof signals / sizeof *signals };
static struct sigaction before[N_SIGNALS]; // what the signals did before

static void on_crash(int signal_number, siginfo_t *info, void *context)
{
    const bool starved = errno == ENOMEM;
    (void)context;
    const sdm_callback *c = sdm_callback_running();
    if (c) end_program(c, sdm_callback_crash_reason(signal_number));
    const sdm_foreign f = sdm_foreign_running();
    // not a signal that another process sent
    if (f.library && (info->si_code > 0 || info->si_pid == getpid())) end_in_library(&f, starved);
    hint_at_plugins();
    // neither a plug-in nor a library: the instruction runs into the fault again, as ever; a signal
    // that was sent does not come again by itself
    for (size_t i = 0; i < N_SIGNALS; i++)
        if (signals[i] == signal_number) sigaction(signal_number, &before[i], NULL);
    if (info->si_code <= 0) raise(signal_number);
}

static void on_exit_call(void)
{
    const sdm_callback *c = sdm_callback_running();
    if (c) end_program(c, "the plug-in called exit(), which it must not: it returns an error");
}

void cli_guard_callbacks(bool plugins)
{
    plugins_loaded = plugins;
    static char stack[1 << 17]; // of the main thread's handler, whose own stack may have overflowed
    const stack_t own = {.ss_sp = stack, .ss_size = sizeof stack};
    sigaltstack(&own, NULL);
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_crash;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK;
    sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < N_SIGNALS; i++) sigaction(signals[i], &action, &before[i]);
    (void)atexit(on_exit_call);
}
