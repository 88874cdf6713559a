/* C++ libraries that run out of memory. */
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

/* From now on the program ends with one line and the exit code 1 where memory ends in a thread or a
 * destructor of a C++ library, which cannot report it; it would abort. */
void cli_end_by_message(void);

#ifdef __cplusplus
}
#endif
