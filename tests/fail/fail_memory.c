/* Makes memory allocations of a program fail: preload this file (LD_PRELOAD). Calls of malloc(),
   calloc(), realloc(), memalign(), aligned_alloc() and posix_memalign() count, hence those of C++'s
   operator new, from the beginning of main() on.
     FAIL_AT=n         the n-th allocation, from 1, fails; 0: none
     FAIL_MODE=lasting all later ones fail, too
     FAIL_IN=name      only calls from this shared library count, e.g. libcairo.so; "program": only
                       those from the program itself
     FAIL_COUNT=file   file.memory receives the number of allocations at the exit */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* glibc's own names of the functions that this file replaces */
void *__libc_malloc(size_t n);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *block, size_t n);
void *__libc_memalign(size_t alignment, size_t n);
int __libc_start_main(int (*begin)(int, char **, char **), int argc, char **argv,
                      void (*init)(void), void (*fini)(void), void (*rtld_fini)(void),
                      void *stack_end);

static atomic_long *allocations; /* shared with child processes */
static atomic_bool started;      /* main() runs */
static long fail_at;
static bool lasting;
static const char *where;            /* FAIL_IN; NULL: everywhere */
static uintptr_t first_byte, beyond; /* addresses of that object */

static bool fails(const void *caller)
{
    const uintptr_t at = (uintptr_t)caller;
    if (!started || (where && (at < first_byte || at >= beyond))) return false;
    const long n = atomic_fetch_add(allocations, 1) + 1;
    if (!fail_at || n < fail_at || (n > fail_at && !lasting)) return false;
    errno = ENOMEM;
    return true;
}

#define FAILS fails(__builtin_return_address(0))
void *malloc(size_t n) { return FAILS ? NULL : __libc_malloc(n); }
void *calloc(size_t n, size_t size) { return FAILS ? NULL : __libc_calloc(n, size); }
void *realloc(void *block, size_t n) { return n && FAILS ? NULL : __libc_realloc(block, n); }
void *memalign(size_t alignment, size_t n) { return FAILS ? NULL : __libc_memalign(alignment, n); }
void *aligned_alloc(size_t alignment, size_t n)
{
    return FAILS ? NULL : __libc_memalign(alignment, n);
}
int posix_memalign(void **block, size_t alignment, size_t n)
{
    void *new = FAILS ? NULL : __libc_memalign(alignment, n);
    if (new) *block = new;
    return new ? 0 : ENOMEM;
}

/* Finds the addresses of the object that FAIL_IN names; the program itself is the first one of the
 * list. */
static int find_object(struct dl_phdr_info *info, size_t size, void *user)
{
    (void)size, (void)user;
    if (strcmp(where, "program") && !strstr(info->dlpi_name, where)) return 0;
    first_byte = UINTPTR_MAX;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];
        const uintptr_t begin = info->dlpi_addr + part->p_vaddr;
        if (part->p_type != PT_LOAD) continue;
        if (begin < first_byte) first_byte = begin;
        if (begin + part->p_memsz > beyond) beyond = begin + part->p_memsz;
    }
    return 1;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("FAIL_COUNT");
    started = false;
    if (!path) return;
    char text[32], name[4096];
    snprintf(name, sizeof name, "%s.memory", path);
    const int n = snprintf(text, sizeof text, "%ld\n", allocations ? (long)*allocations : 0),
              fd = open(name, O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (fd >= 0 && write(fd, text, (size_t)n) == n) close(fd);
}

static int (*program_main)(int, char **, char **);

static int counted_main(int argc, char **argv, char **environment)
{
    const char *n = getenv("FAIL_AT"), *mode = getenv("FAIL_MODE");
    fail_at = n ? atol(n) : 0;
    lasting = mode && !strcmp(mode, "lasting");
    where = getenv("FAIL_IN");
    if (where) dl_iterate_phdr(find_object, NULL);
    allocations =
        mmap(NULL, sizeof *allocations, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (allocations == MAP_FAILED) _exit(99);
    started = true;
    return program_main(argc, argv, environment);
}

int __libc_start_main(int (*begin)(int, char **, char **), int argc, char **argv,
                      void (*init)(void), void (*fini)(void), void (*rtld_fini)(void),
                      void *stack_end)
{
    const __typeof__(&__libc_start_main) real =
        (__typeof__(&__libc_start_main))dlsym(RTLD_NEXT, "__libc_start_main");
    program_main = begin;
    return real(counted_main, argc, argv, init, fini, rtld_fini, stack_end);
}
