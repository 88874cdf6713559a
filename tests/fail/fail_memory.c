/* Makes memory allocations of a program fail: preload this file (LD_PRELOAD). Calls of malloc(),
   calloc(), realloc(), memalign(), aligned_alloc() and posix_memalign() count, hence those of C++'s
   operator new, from the beginning of main() on.
     FAIL_AT=n         the n-th allocation, from 1, fails; 0: none
     FAIL_MODE=lasting all later ones fail, too
     FAIL_OWN=1        only calls from the program itself count, none of shared libraries
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
#include <unistd.h>

/* glibc's own names of the functions that this file replaces */
void *__libc_malloc(size_t n);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *block, size_t n);
void *__libc_memalign(size_t alignment, size_t n);
int __libc_start_main(int (*begin)(int, char **, char **), int argc, char **argv,
                      void (*init)(void), void (*fini)(void), void (*rtld_fini)(void),
                      void *stack_end);

static atomic_long allocations;
static atomic_bool started; /* main() runs */
static long fail_at;
static bool lasting, own;
static uintptr_t program_begin, program_end;

static bool fails(const void *caller)
{
    const uintptr_t at = (uintptr_t)caller;
    if (!started || (own && (at < program_begin || at >= program_end))) return false;
    const long n = atomic_fetch_add(&allocations, 1) + 1;
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

/* Finds the first object of the list, the program itself. */
static int find_program(struct dl_phdr_info *info, size_t size, void *user)
{
    (void)size, (void)user;
    program_begin = UINTPTR_MAX;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];
        const uintptr_t begin = info->dlpi_addr + part->p_vaddr;
        if (part->p_type != PT_LOAD) continue;
        if (begin < program_begin) program_begin = begin;
        if (begin + part->p_memsz > program_end) program_end = begin + part->p_memsz;
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
    const int n = snprintf(text, sizeof text, "%ld\n", (long)allocations),
              fd = open(name, O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (fd >= 0 && write(fd, text, (size_t)n) == n) close(fd);
}

static int (*program_main)(int, char **, char **);

static int counted_main(int argc, char **argv, char **environment)
{
    const char *n = getenv("FAIL_AT"), *mode = getenv("FAIL_MODE");
    fail_at = n ? atol(n) : 0;
    lasting = mode && !strcmp(mode, "lasting");
    own = getenv("FAIL_OWN") != NULL;
    dl_iterate_phdr(find_program, NULL);
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
