/* Writes a configuration as YAML, and the table of all keys. */
#include <stdio.h>
#include <string.h>

#include "config_parse.h"
#include "kinds.h"
#include "schema.h"

static const char *field_type_name(const sdm_field *f)
{
    static const char *const NAMES[] = {"integer", "integer", "integer", "number",
                                        "name",    "text",    "special"};
    return f->shown_type ? f->shown_type : NAMES[f->type];
}

/* Appends the value of a field in YAML syntax. */
static void field_dump(const sdm_config *c, const sdm_field *f, sdm_text *out)
{
    const char *at = (const char *)c + f->offset;
    char buf[SDM_NAME_MAX];
    switch (f->type) {
    case SDM_FIELD_INT:
        sdm_text_add(out, "%d", *(const int *)at);
        break;
    case SDM_FIELD_INT64:
        sdm_text_add(out, "%lld", (long long)*(const int64_t *)at);
        break;
    case SDM_FIELD_UINT64:
        sdm_text_add(out, "%llu", (unsigned long long)*(const uint64_t *)at);
        break;
    case SDM_FIELD_REAL:
        sdm_text_add(out, "%s", sdm_format_plain(*(const double *)at, buf));
        break;
    case SDM_FIELD_CHOICE:
        if (sdm_choice_name(f->choices, *(const int *)at, buf)) sdm_text_add(out, "%s", buf);
        break;
    case SDM_FIELD_TEXT:
        sdm_dump_text(at, out);
        break;
    case SDM_FIELD_SPECIAL:
        f->dump(c, out);
        break;
    }
}

void sdm_config_dump(const sdm_config *c, sdm_text *out)
{
    size_t n = 0;
    const sdm_section *sections = sdm_config_sections(&n);
    sdm_text_add(
        out,
        "# every key of this kind of network with its value; reads back to the same "
        "configuration. What was left to auto has the values that the run chose; of two kinds that "
        "were trained, train.minutes is the part of this one\n");
    for (size_t s = 0; s < n; s++) {
        const bool nested = *sections[s].name != 0;
        bool begun = !nested;
        for (size_t k = 0; k < sections[s].n_fields; k++) {
            const sdm_field *f = &sections[s].fields[k];
            if (f->type == SDM_FIELD_SPECIAL && !f->dump) continue;
            if (!sdm_kind_has(f, (int)c->network.kind)) continue;
            // an empty text means that the key was not set
            if (f->type == SDM_FIELD_TEXT && !*((const char *)c + f->offset)) continue;
            if (f->has && !f->has(c)) continue;
            if (!begun) sdm_text_add(out, "%s:\n", sections[s].name);
            begun = true;
            sdm_text_add(out, "%s%s: ", nested ? "  " : "", f->key);
            field_dump(c, f, out);
            sdm_text_add(out, "\n");
        }
    }
}

// A row of the table of all keys; CELL is the size of a cell's text in bytes.
enum { COLUMNS = 6, CELL = 400 };
typedef char table_row[COLUMNS][CELL];

static void fill_row(const sdm_section *section, const sdm_field *f, bool markdown, table_row row)
{
    const char *quote = markdown ? "`" : "";
    char names[CELL / 2];
    const char *def = f->shown_def   ? f->shown_def
                      : f->kind_defs ? sdm_kind_defaults(f, names, sizeof names)
                      : f->def       ? f->def
                                     : "required";
    snprintf(row[0], CELL, "%s%s%s%s%s", quote, section->name, *section->name ? "." : "", f->key,
             quote);
    snprintf(row[1], CELL, "%s", field_type_name(f));
    sdm_field_range(f, row[2], CELL);
    snprintf(row[3], CELL, "%s", def);
    snprintf(row[4], CELL, "%s", f->unit);
    snprintf(row[5], CELL, f->kinds ? "%s; %s only" : "%s", f->help,
             sdm_kind_names(f, names, sizeof names));
}

static void print_row(table_row row, const int width[COLUMNS], bool markdown, sdm_text *out)
{
    for (int i = 0; i < COLUMNS; i++) {
        if (markdown)
            sdm_text_add(out, "%s%s |", i ? " " : "| ", row[i]);
        else
            sdm_text_add(out, "%-*s%s", i + 1 < COLUMNS ? width[i] : 0, row[i],
                         i + 1 < COLUMNS ? "  " : "");
    }
    sdm_text_add(out, "\n");
}

void sdm_config_describe(bool markdown, sdm_text *out)
{
    size_t n = 0;
    const sdm_section *sections = sdm_config_sections(&n);
    sdm_fields_describe(sections, n, markdown, out);
}

void sdm_fields_describe(const sdm_section *sections, size_t n, bool markdown, sdm_text *out)
{
    static const char *const HEAD[COLUMNS] = {"Key", "Type", "Range", "Default", "Unit", "Meaning"};
    table_row row;
    int width[COLUMNS];

    // first pass: the widths of the columns of the aligned text
    for (int i = 0; i < COLUMNS; i++) width[i] = (int)strlen(HEAD[i]);
    for (size_t s = 0; s < n; s++) {
        for (size_t k = 0; k < sections[s].n_fields; k++) {
            fill_row(&sections[s], &sections[s].fields[k], markdown, row);
            for (int i = 0; i < COLUMNS; i++)
                if ((int)strlen(row[i]) > width[i]) width[i] = (int)strlen(row[i]);
        }
    }

    for (int i = 0; i < COLUMNS; i++) snprintf(row[i], CELL, "%s", HEAD[i]);
    print_row(row, width, markdown, out);
    if (markdown) sdm_text_add(out, "|---|---|---|---|---|---|\n");
    for (size_t s = 0; s < n; s++) {
        for (size_t k = 0; k < sections[s].n_fields; k++) {
            fill_row(&sections[s], &sections[s].fields[k], markdown, row);
            print_row(row, width, markdown, out);
        }
    }
}
