/* The description of a module, which Slicer turns into a panel. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "slicer.h"

/* Appends the text with the characters that XML reserves as references; a line feed is a space. */
static void add_text(sdm_text *out, const char *text)
{
    for (; *text; text++) {
        const char *name = *text == '&'    ? "&amp;"
                           : *text == '<'  ? "&lt;"
                           : *text == '>'  ? "&gt;"
                           : *text == '"'  ? "&quot;"
                           : *text == '\n' ? " "
                                           : NULL;
        if (name)
            sdm_text_add(out, "%s", name);
        else
            sdm_text_add(out, "%c", *text);
    }
}

static void add_element(sdm_text *out, const char *indent, const char *tag, const char *text)
{
    sdm_text_add(out, "%s<%s>", indent, tag);
    add_text(out, text);
    sdm_text_add(out, "</%s>\n", tag);
}

/* An identifier: Slicer makes variables of the names of parameters. */
static void add_name(sdm_text *out, const char *flag)
{
    sdm_text_add(out, "      <name>");
    for (; *flag; flag++) sdm_text_add(out, "%c", *flag == '-' ? '_' : *flag);
    sdm_text_add(out, "</name>\n");
}

/* "start-centre": "Start centre" */
static void add_label(sdm_text *out, const char *flag)
{
    sdm_text_add(out, "      <label>%c", toupper((unsigned char)*flag));
    for (flag++; *flag; flag++) sdm_text_add(out, "%c", *flag == '-' ? ' ' : *flag);
    sdm_text_add(out, "</label>\n");
}

static void add_file(sdm_text *out, const slicer_file *f)
{
    sdm_text_add(out, "    <%s", f->tag);
    if (f->type) sdm_text_add(out, " type=\"%s\"", f->type);
    if (f->extensions) sdm_text_add(out, " fileExtensions=\"%s\"", f->extensions);
    sdm_text_add(out, ">\n");
    add_name(out, f->flag);
    add_element(out, "      ", "label", f->label);
    add_element(out, "      ", "description", f->help);
    add_element(out, "      ", "longflag", f->flag);
    add_element(out, "      ", "channel", f->is_output ? "output" : "input");
    sdm_text_add(out, "    </%s>\n", f->tag);
}

/* Slicer passes numbers always, but a text or a vector only where it is not empty. An option that
 * may be missing is therefore a text, unless it is a vector or a place. */
static const char *tag_of(const cli_option *o)
{
    switch (o->kind) {
    case CLI_FLAG:
        return "boolean";
    case CLI_CHOICE:
        return "string-enumeration";
    case CLI_INT3:
        return "integer-vector";
    case CLI_REAL3:
        return strcmp(o->name, "start-centre") ? "double-vector" : "point";
    case CLI_REAL6:
        return "region";
    case CLI_REAL2:
    case CLI_REAL9:
        return "double-vector";
    default:
        return o->value && !strncmp(o->value, "FILE", 4) ? "file" : "string";
    }
}

static void add_choices(sdm_text *out, const char *choices)
{
    sdm_text_add(out, "      <default>default</default>\n      <element>default</element>\n");
    for (const char *at = choices; at; at = strchr(at, '|') ? strchr(at, '|') + 1 : NULL)
        sdm_text_add(out, "      <element>%.*s</element>\n", (int)strcspn(at, "|"), at);
}

static void add_option(sdm_text *out, const cli_option *o)
{
    const char *tag = tag_of(o);
    const bool place = !strcmp(tag, "point") || !strcmp(tag, "region");
    sdm_text_add(out, "    <%s%s>\n", tag, place ? " coordinateSystem=\"lps\"" : "");
    add_name(out, o->name);
    add_label(out, o->name);
    sdm_text_add(out, "      <description>");
    add_text(out, o->help);
    if (o->kind == CLI_LIST) sdm_text_add(out, "; several are separated by semicolons");
    if (o->value && o->kind != CLI_FLAG) {
        sdm_text_add(out, " [");
        add_text(out, o->value);
        sdm_text_add(out, "]");
    }
    sdm_text_add(out, "</description>\n");
    add_element(out, "      ", "longflag", o->name);
    if (place || !strcmp(tag, "file")) add_element(out, "      ", "channel", "input");
    if (o->kind == CLI_FLAG) add_element(out, "      ", "default", "false");
    if (o->kind == CLI_CHOICE) add_choices(out, o->choices);
    sdm_text_add(out, "    </%s>\n", tag);
}

static void open_group(sdm_text *out, const char *label, const char *help, bool advanced)
{
    sdm_text_add(out, "  <parameters%s>\n", advanced ? " advanced=\"true\"" : "");
    add_element(out, "    ", "label", label);
    add_element(out, "    ", "description", help);
}

static void add_options(sdm_text *out, const slicer_module *m, bool basic)
{
    for (size_t i = 0; i < cli_n_options; i++) {
        const cli_option *o = &cli_options[i];
        if (slicer_has_option(m, o) && slicer_has_word(m->basic, o->name) == basic)
            add_option(out, o);
    }
}

static void add_files(sdm_text *out, const slicer_module *m, bool outputs)
{
    for (size_t i = 0; i < slicer_n_files; i++) {
        const slicer_file *f = &slicer_files[i];
        if (f->is_output == outputs && f == slicer_find_file(m, f->flag, strlen(f->flag)))
            add_file(out, f);
    }
}

static void add_results(sdm_text *out, const slicer_module *m)
{
    for (size_t i = 0; i < slicer_n_results; i++) {
        const slicer_result *r = &slicer_results[i];
        if (!(r->modules >> (m - slicer_modules) & 1u)) continue;
        sdm_text_add(out, "    <string>\n");
        add_name(out, r->name);
        add_element(out, "      ", "label", r->label);
        add_element(out, "      ", "description", r->help);
        add_element(out, "      ", "channel", "output");
        sdm_text_add(out, "    </string>\n");
    }
}

void slicer_describe(const slicer_module *m, sdm_text *out)
{
    const cli_command *c = &cli_commands[m->command];
    sdm_text_add(out, "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<executable>\n");
    add_element(out, "  ", "category", "Shape models");
    add_element(out, "  ", "title", m->title);
    add_element(out, "  ", "description", c->details ? c->details : c->summary);
    add_element(out, "  ", "version", SDM_VERSION_TEXT);
    add_element(out, "  ", "documentation-url", "");
    add_element(out, "  ", "license", "");
    add_element(out, "  ", "contributor", "the authors of sdmgen");
    open_group(out, "Files", "What is read and written; LPS mm.", false);
    add_files(out, m, false);
    add_files(out, m, true);
    sdm_text_add(out, "  </parameters>\n");
    open_group(out, "Shape and start", "An empty field takes the default.", false);
    add_options(out, m, true);
    sdm_text_add(out, "  </parameters>\n");
    open_group(out, "All other options", "An empty field takes the default.", true);
    add_options(out, m, false);
    sdm_text_add(out, "  </parameters>\n");
    open_group(out, "Results", "Filled in when the module has ended.", false);
    add_results(out, m);
    sdm_text_add(out, "  </parameters>\n</executable>\n");
}
