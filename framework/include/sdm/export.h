/* Version of sdmgen, and macros for the visibility of public symbols and for the format check of
   printf-like functions. */
#ifndef SDM_EXPORT_H
#define SDM_EXPORT_H

#define SDM_VERSION_MAJOR 0
#define SDM_VERSION_MINOR 1
#define SDM_VERSION_PATCH 0
#define SDM_VERSION_TEXT "0.1.0"

#if defined(__GNUC__)
#define SDM_API __attribute__((visibility("default")))
#define SDM_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))
#else
#define SDM_API
#define SDM_PRINTF(fmt, args)
#endif

#endif
