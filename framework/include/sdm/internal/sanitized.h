/* Whether the program is built with a sanitizer that needs terabytes of addresses: limits of the
 * address space then end it. */
#pragma once

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SDM_SANITIZED 1 // gcc
#elif defined(__has_feature)
#define SDM_SANITIZED (__has_feature(address_sanitizer) || __has_feature(thread_sanitizer)) // clang
#else
#define SDM_SANITIZED 0
#endif
