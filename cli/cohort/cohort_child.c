/* Runs the fit of one case in a child process. */
#define _GNU_SOURCE // strsignal()
#include "cohort.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "report/terminal.h"
#include "sdm/internal/child.h"
#include "sdm/internal/clock.h"

#define KILL_SECONDS 20 /* after an interrupt, a fit that does not end by itself is killed */

/* ---- in the child ---- */

/* Sends stdout and stderr to the log. */
static void open_log(const char *folder)
{
    char path[CLI_CASE_PATH_MAX + 16];
    snprintf(path, sizeof path, "%s/" CLI_CASE_LOG, folder);
    const int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0666);
    if (fd < 0) return;
    dup2(fd, STDOUT_FILENO);
    dup2(fd, STDERR_FILENO);
    close(fd);
}

/* Runs the fit, prints its error into the log and sends it to the parent. Returns the exit code. */
static int run_fit(const cli_words *w, const char *folder, cli_cohort_fit *fit, int answer)
{
    char json[CLI_CASE_PATH_MAX + 16];
    cli_args args = {0};
    sdm_error err = {0};
    snprintf(json, sizeof json, "%s/" CLI_CASE_FIT, folder);
    cli_set_form(NULL);
    sdm_status s = cli_parse(w->argc, w->argv, &args, &err);
    if (!s) s = fit(&args, json, &err);
    err.status = s;
    const int code = s ? cli_report(&err) : CLI_EXIT_DONE;
    const size_t length = s ? strlen(err.text) : 0;
    if (length && write(answer, err.text, length) < 0) return CLI_EXIT_FAILED;
    if (fflush(stdout) && !code) return CLI_EXIT_FAILED;
    return code;
}

/* ---- in the parent ---- */

/* Waits for the child, renews the lease, and hands an interrupt on. Returns its wait status. */
static int wait_for(pid_t child, cli_lease *lease)
{
    int status = 0;
    double stopped = 0;
    long pause = 1000000; // ns, up to 20 ms
    while (waitpid(child, &status, WNOHANG) == 0) {
        const struct timespec time = {0, pause};
        nanosleep(&time, NULL);
        if (pause < 20000000) pause += pause / 4;
        cli_lease_renew(lease);
        if (cli_is_interrupted() && stopped == 0) {
            stopped = sdm_clock();
            kill(child, SIGTERM);
        } else if (stopped > 0 && sdm_clock() - stopped > KILL_SECONDS) {
            kill(child, SIGKILL);
        }
    }
    return status;
}

/* Reads what the child sent, one line. */
static void read_answer(int fd, char reason[SDM_ERROR_TEXT_MAX])
{
    const ssize_t n = read(fd, reason, SDM_ERROR_TEXT_MAX - 1);
    reason[n > 0 ? n : 0] = '\0';
    for (char *at = reason; *at; at++)
        if (*at == '\n') *at = ' ';
    cli_name_options(reason);
}

static void judge(int status, cli_case_end *end)
{
    if (WIFSIGNALED(status)) {
        const int number = WTERMSIG(status);
        end->exit_code = 128 + number;
        snprintf(end->reason, sizeof end->reason, "the fit was ended by signal %d (%s)%s", number,
                 strsignal(number), number == SIGKILL ? "; was there too little memory?" : "");
    } else {
        end->exit_code = WEXITSTATUS(status);
    }
    if (end->exit_code && !*end->reason)
        snprintf(end->reason, sizeof end->reason, "exit code %d; " CLI_CASE_LOG " tells more",
                 end->exit_code);
    end->state = end->exit_code == CLI_EXIT_DONE      ? CLI_CASE_ACCEPTED
                 : end->exit_code == CLI_EXIT_QUALITY ? CLI_CASE_REFUSED
                                                      : CLI_CASE_FAILED;
}

sdm_status cli_cohort_child(const cli_words *w, const char *folder, cli_cohort_fit *fit,
                            cli_lease *lease, cli_case_end *end, sdm_error *err)
{
    int answer[2];
    const double begin = sdm_clock();
    const pid_t parent = getpid();
    if (pipe(answer)) return sdm_fail(err, SDM_E_IO, "cannot make a pipe: %s", strerror(errno));
    fflush(stdout);
    const pid_t child = sdm_child_fork();
    if (child == 0) {
        close(answer[0]);
        sdm_child_ends_with(parent); // only the parent renews the lease of the case
        open_log(folder);
        _exit(run_fit(w, folder, fit, answer[1]));
    }
    close(answer[1]);
    if (child < 0) {
        close(answer[0]);
        return sdm_fail(err, SDM_E_IO, "cannot start a process: %s", strerror(errno));
    }
    const int status = wait_for(child, lease);
    fcntl(answer[0], F_SETFL, O_NONBLOCK);
    read_answer(answer[0], end->reason);
    close(answer[0]);
    judge(status, end);
    end->seconds = sdm_clock() - begin;
    if (cli_is_interrupted() || end->exit_code == CLI_EXIT_INTERRUPTED)
        return sdm_fail(err, SDM_E_CANCELLED, "interrupted");
    return SDM_OK;
}
