/* Whether a folder is free for a run, and the lock with which a run takes it. */
#define _DEFAULT_SOURCE // flock(), gethostname()
#include "train_folder.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "sdm/internal/file.h"
#include "sdm/internal/train.h"

sdm_status sdm_train_check_folder(const char *folder, bool resume, bool force, sdm_error *err)
{
    static const struct {
        const char *name, *content;
    } files[] = {{"model.sdm", "a trained model"},
                 {"checkpoint.sdmc", "the checkpoint of a training"}};
    if (resume && force)
        return sdm_fail(err, SDM_E_ARG, "train: --resume and --force exclude each other");
    bool there[2];
    for (size_t i = 0; i < 2; i++) {
        char path[SDM_PATH_TEXT_MAX + 32];
        snprintf(path, sizeof path, "%s/%s", folder, files[i].name);
        there[i] = !access(path, F_OK);
    }
    if (force || (!there[0] && !there[1])) return SDM_OK;
    if (!there[1])
        return sdm_fail(err, SDM_E_ARG,
                        "%s holds %s%s: --force replaces it, --out DIR writes into another folder",
                        folder, files[0].content,
                        resume ? " and no checkpoint from which --resume can go on" : "");
    if (resume) return SDM_OK;
    return sdm_fail(
        err, SDM_E_ARG,
        "%s holds %s: continue with --resume, start again with --force, or choose --out DIR",
        folder, files[there[0] ? 0 : 1].content);
}

/* The files of a run, which alone writes them. */
static const char *const run_files[] = {"model.sdm",       "model-pod.sdm", "model-template.sdm",
                                        "checkpoint.sdmc", "metrics.jsonl", "config.yaml",
                                        "loss.png",        "slices.png"};

static void path_in(const char *folder, const char *name, char path[SDM_PATH_TEXT_MAX + 300])
{
    snprintf(path, SDM_PATH_TEXT_MAX + 300, "%s/%s", folder, name);
}

/* Whether a file of this name is the temporary file of a run, also of a copy of a data file of the
   shape (shape.OPTION.ENDING). */
static bool is_leftover(const char *name)
{
    char of[256];
    bool is = false;
    for (size_t i = 0; i < sizeof run_files / sizeof *run_files; i++)
        is = is || sdm_outfile_is_temp(name, run_files[i]);
    const size_t copy = strlen("shape.");
    for (size_t n = copy; !is && !strncmp(name, "shape.", copy) && name[n]; n++)
        is = snprintf(of, sizeof of, "%.*s", (int)n, name) < (int)sizeof of &&
             sdm_outfile_is_temp(name, of);
    return is;
}

/* Removes the temporary files of runs that were killed. What cannot be removed harms nobody. */
static void remove_leftovers(const char *folder)
{
    DIR *list = opendir(folder);
    if (!list) return;
    for (const struct dirent *one; (one = readdir(list));) {
        char path[SDM_PATH_TEXT_MAX + 300];
        if (!is_leftover(one->d_name)) continue;
        path_in(folder, one->d_name, path);
        unlink(path);
    }
    closedir(list);
}

/* Locks the file. A process that a killed run has begun may hold the lock a moment longer: the call
 * waits for it, at most about a second. Returns 0 or the error number. */
static int lock_file(int fd)
{
    const struct timespec pause = {0, 50000000};
    int code = 0;
    for (int i = 0; i < 20; i++) {
        code = flock(fd, LOCK_EX | LOCK_NB) ? errno : 0;
        if (code != EWOULDBLOCK) break;
        nanosleep(&pause, NULL);
    }
    return code;
}

static sdm_status fail_taken(const char *folder, int fd, sdm_error *err)
{
    char who[200] = "";
    const ssize_t n = pread(fd, who, sizeof who - 1, 0);
    who[n > 0 ? n : 0] = '\0';
    who[strcspn(who, "\n")] = '\0';
    return sdm_fail(err, SDM_E_ARG,
                    "%s: another training writes into this folder%s%s%s: wait for its end, or "
                    "choose --out DIR",
                    folder, *who ? " (" : "", who, *who ? ")" : "");
}

/* Writes process and host into the lock, for the message of fail_taken() alone. */
static void sign_lock(int fd)
{
    char host[100] = "", text[160];
    gethostname(host, sizeof host - 1);
    const int n = snprintf(text, sizeof text, "process %ld on %s\n", (long)getpid(), host);
    if (ftruncate(fd, 0) || pwrite(fd, text, (size_t)n, 0) != n) return;
}

/* true unless the run that had the lock removed the file after it was opened here. */
static bool is_in_place(const char *path, int fd)
{
    struct stat mine, there;
    return !fstat(fd, &mine) && !stat(path, &there) && mine.st_ino == there.st_ino &&
           mine.st_dev == there.st_dev;
}

sdm_status trainer_folder_take(const char *folder, int *lock, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 300];
    path_in(folder, "run.lock", path);
    for (*lock = -1; *lock < 0;) {
        const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
        if (fd < 0) return sdm_fail(err, SDM_E_IO, "%s: cannot write: %s", path, strerror(errno));
        const int code = lock_file(fd);
        const sdm_status s = code == EWOULDBLOCK ? fail_taken(folder, fd, err) : SDM_OK;
        if (!code && is_in_place(path, fd)) {
            *lock = fd;
            continue;
        }
        if (code && !s) unlink(path); // no locks here
        close(fd);
        if (s || code) return s;
    }
    sign_lock(*lock);
    remove_leftovers(folder);
    return SDM_OK;
}

void trainer_folder_leave(const char *folder, int lock)
{
    char path[SDM_PATH_TEXT_MAX + 300];
    if (lock < 0) return;
    path_in(folder, "run.lock", path);
    unlink(path); // before others can take it
    close(lock);
}
