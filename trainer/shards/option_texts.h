/* The options of a shape as texts, for the files that a training writes. */
#pragma once

#include "sdm/internal/config.h"
#include "sdm/registry.h"

/* Names and values of all options of a shape, as a model file states them. An option whose value is
   a file is followed by an entry NAME.crc64, the checksum of the file. */
typedef struct option_texts {
    const char *names[2 * SDM_MAX_OPTIONS], *values[2 * SDM_MAX_OPTIONS];
    bool is_path[2 * SDM_MAX_OPTIONS];            // a file whose checksum is the next entry
    char texts[SDM_MAX_OPTIONS][32];              // texts of numbers and of checksums
    char sums[SDM_MAX_OPTIONS][SDM_NAME_MAX + 8]; // names of the checksum entries
    size_t n;
} option_texts;

/* sums[SDM_MAX_OPTIONS] = CRC-64 of the data files that options name; 0: the option names no file
   that can be read (a plug-in may accept a folder, for example). */
void trainer_option_sums(const sdm_instance *instance, uint64_t *sums);

/* Fills *o, all zero before; its pointers refer to the instance and to *o. sums: as
   trainer_option_sums() computed them. file[SDM_MAX_OPTIONS]: names to state in place of the paths
   of options that are files; NULL: the paths. */
void trainer_option_texts(const sdm_instance *instance, const uint64_t *sums,
                          const char *const *file, option_texts *o);
