/* Makes --help and the Markdown reference from the tables of commands and options. */
#include "help.h"

#include <stdio.h>
#include <string.h>

const char *cli_option_form(const cli_option *o, char buf[128])
{
    char letter[8] = "";
    if (o->letter) snprintf(letter, sizeof letter, "-%c, ", o->letter);
    const char *value = o->kind == CLI_CHOICE ? o->choices : o->value;
    snprintf(buf, 128, "%s--%s%s%s", letter, o->name, value ? " " : "", value ? value : "");
    return buf;
}

/* Appends the text, broken at spaces into lines of at most `width` characters. All lines but the
 * first begin with `indent` spaces, which `width` does not count. */
static void add_wrapped(sdm_text *out, const char *text, size_t indent, size_t width)
{
    size_t column = 0;
    while (*text) {
        const size_t word = strcspn(text, " ");
        if (column > 0 && column + 1 + word > width) {
            sdm_text_add(out, "\n%*s", (int)indent, "");
            column = 0;
        }
        sdm_text_add(out, "%s%.*s", column > 0 ? " " : "", (int)word, text);
        column += word + (column > 0);
        text += word + (text[word] == ' ');
    }
    sdm_text_add(out, "\n");
}

void cli_help_all(sdm_text *out)
{
    sdm_text_add(out, "sdmgen %s - fast signed distance maps of parametric shapes\n\n",
                 SDM_VERSION_TEXT);
    sdm_text_add(out, "usage: sdmgen COMMAND [arguments] [options]\n\ncommands:\n");
    for (size_t i = 0; i < CLI_N_COMMANDS; i++)
        sdm_text_add(out, "  %-10s %s\n", cli_commands[i].name, cli_commands[i].summary);
    sdm_text_add(
        out, "\n  sdmgen COMMAND --help   options of a command\n"
             "  sdmgen --version        version\n\n"
             "exit codes: 0 done, 1 failed, 2 usage or configuration, 3 bad input data, 4 "
             "quality not reached,\n"
             "            5 parameters out of range, 6 cases failed or missing, 130 interrupted\n"
             "environment: SDMGEN_PLUGIN_PATH (folders with shape plug-ins), "
             "OMP_NUM_THREADS, NO_COLOR\n");
}

void cli_help_command(const cli_command *c, sdm_text *out)
{
    const size_t command = (size_t)(c - cli_commands);
    sdm_text_add(out, "usage: sdmgen %s %s\n\n%s\n", c->name, c->synopsis, c->summary);
    if (c->details) sdm_text_add(out, "\n%s\n", c->details);
    sdm_text_add(out, "\noptions:\n");
    for (size_t i = 0; i < cli_n_options; i++) {
        if (!cli_option_fits(&cli_options[i], command)) continue;
        char form[128];
        sdm_text_add(out, "  %-28s ", cli_option_form(&cli_options[i], form));
        if (strlen(form) > 28) sdm_text_add(out, "\n%31s", "");
        add_wrapped(out, cli_options[i].help, 31, 88);
    }
    if (c->example) sdm_text_add(out, "\nexample:\n  %s\n", c->example);
}

/* Appends a cell of a Markdown table. Only the bar is escaped: help texts may hold Markdown. */
static void add_cell(sdm_text *out, const char *text)
{
    for (; *text; text++) sdm_text_add(out, *text == '|' ? "\\|" : "%c", *text);
}

/* From so many commands on, an option has its row once, above all commands. */
enum { SHARED_FROM = 6 };

static bool is_shared(const cli_option *o)
{
    int n = 0;
    for (size_t command = 0; command < CLI_N_COMMANDS; command++) n += cli_option_fits(o, command);
    return n >= SHARED_FROM;
}

static void add_row(sdm_text *out, const cli_option *o)
{
    char form[128];
    sdm_text_add(out, "| `");
    add_cell(out, cli_option_form(o, form));
    sdm_text_add(out, "` | ");
    add_cell(out, o->help);
    sdm_text_add(out, " |\n");
}

static void add_shared(sdm_text *out)
{
    sdm_text_add(out, "## Options of many commands\n\nEach command below names those that it "
                      "has.\n\n| option | meaning |\n|---|---|\n");
    for (size_t i = 0; i < cli_n_options; i++)
        if (is_shared(&cli_options[i])) add_row(out, &cli_options[i]);
    sdm_text_add(out, "\n");
}

/* The options of one command: a table of its own, and the names of those of add_shared(). */
static void add_options(sdm_text *out, size_t command)
{
    size_t own = 0, shared = 0;
    for (size_t i = 0; i < cli_n_options; i++) {
        const cli_option *o = &cli_options[i];
        if (!cli_option_fits(o, command) || is_shared(o)) continue;
        if (!own++) sdm_text_add(out, "\n| option | meaning |\n|---|---|\n");
        add_row(out, o);
    }
    for (size_t i = 0; i < cli_n_options; i++) {
        const cli_option *o = &cli_options[i];
        if (!cli_option_fits(o, command) || !is_shared(o)) continue;
        sdm_text_add(out, shared++ ? ", `--%s`" : "\nOptions of many commands: `--%s`", o->name);
    }
    if (shared) sdm_text_add(out, ".\n");
}

void cli_help_markdown(sdm_text *out)
{
    add_shared(out);
    for (size_t command = 0; command < CLI_N_COMMANDS; command++) {
        const cli_command *c = &cli_commands[command];
        sdm_text_add(out, "## %s\n\n```\nsdmgen %s %s\n```\n\n%c%s.\n", c->name, c->name,
                     c->synopsis, c->summary[0] - 'a' + 'A', c->summary + 1);
        if (c->details) sdm_text_add(out, "%s\n", c->details);
        add_options(out, command);
        if (c->example) sdm_text_add(out, "\n```\n%s\n```\n", c->example);
        if (command + 1 < CLI_N_COMMANDS) sdm_text_add(out, "\n");
    }
}
