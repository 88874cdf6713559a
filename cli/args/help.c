/* Makes --help, the manual page, the Markdown reference and the bash completion from the tables of
 * commands and options. */
#include "help.h"

#include <stdio.h>
#include <string.h>

/* Writes the option as in --help, "-o, --output FILE", into buf and returns buf. */
static const char *option_form(const cli_option *o, char buf[128])
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
    sdm_text_add(out, "\n  sdmgen COMMAND --help   options of a command\n"
                      "  sdmgen --version        version\n\n"
                      "exit codes: 0 done, 1 failed, 2 usage or configuration, 3 bad input data, 4 "
                      "quality not reached,\n"
                      "            5 parameters out of range, 130 interrupted\n"
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
        sdm_text_add(out, "  %-28s ", option_form(&cli_options[i], form));
        if (strlen(form) > 28) sdm_text_add(out, "\n%31s", "");
        add_wrapped(out, cli_options[i].help, 31, 88);
    }
    if (c->example) sdm_text_add(out, "\nexample:\n  %s\n", c->example);
}

/* ---- manual page ---- */

/* Appends the text escaped for roff: a hyphen becomes \-, a backslash \e, and \& precedes a dot or
 * a quote at the start of a line. */
static void add_roff(sdm_text *out, const char *text)
{
    bool line_start = true;
    for (; *text; text++) {
        if (line_start && (*text == '.' || *text == '\'')) sdm_text_add(out, "\\&");
        line_start = *text == '\n';
        if (*text == '-')
            sdm_text_add(out, "\\-");
        else if (*text == '\\')
            sdm_text_add(out, "\\e");
        else
            sdm_text_add(out, "%c", *text);
    }
}

static void add_man_command(sdm_text *out, size_t command)
{
    const cli_command *c = &cli_commands[command];
    // heading, summary and details
    sdm_text_add(out, ".SS \"");
    add_roff(out, c->name);
    sdm_text_add(out, " ");
    add_roff(out, c->synopsis);
    sdm_text_add(out, "\"\n");
    add_roff(out, c->summary);
    sdm_text_add(out, ".\n");
    if (c->details) {
        sdm_text_add(out, ".PP\n");
        add_roff(out, c->details);
        sdm_text_add(out, "\n");
    }
    for (size_t i = 0; i < cli_n_options; i++) {
        if (!cli_option_fits(&cli_options[i], command)) continue;
        // an option
        char form[128];
        sdm_text_add(out, ".TP\n.B \"");
        add_roff(out, option_form(&cli_options[i], form));
        sdm_text_add(out, "\"\n");
        add_roff(out, cli_options[i].help);
        sdm_text_add(out, "\n");
    }
    if (!c->example) return;
    sdm_text_add(out, ".PP\nExample:\n.PP\n.nf\n    ");
    add_roff(out, c->example);
    sdm_text_add(out, "\n.fi\n");
}

void cli_help_man(sdm_text *out)
{
    sdm_text_add(out, ".TH SDMGEN 1 \"\" \"sdmgen %s\" \"User Commands\"\n", SDM_VERSION_TEXT);
    sdm_text_add(out, ".SH NAME\nsdmgen \\- fast signed distance maps of parametric shapes\n"
                      ".SH SYNOPSIS\n.B sdmgen\n.I command\n[arguments] [options]\n"
                      ".SH DESCRIPTION\nTrains networks that give the signed distance map of a "
                      "parametric shape, makes maps with\n"
                      "them, and computes exact maps. Lengths are mm, angles rad, the distance is "
                      "negative inside, the frame is "
                      "LPS.\n.SH COMMANDS\n");
    for (size_t i = 0; i < CLI_N_COMMANDS; i++) add_man_command(out, i);
    sdm_text_add(
        out,
        ".SH EXIT STATUS\n"
        ".TP\n0\ndone\n.TP\n1\nfailed\n.TP\n2\nusage or configuration\n.TP\n3\nbad input data\n"
        ".TP\n4\nquality not reached\n.TP\n5\nparameters out of range\n.TP\n130\ninterrupted\n"
        ".SH ENVIRONMENT\n.TP\n.B SDMGEN_PLUGIN_PATH\nfolders with shape plug-ins, separated by "
        "colons\n"
        ".TP\n.B OMP_NUM_THREADS\nthreads, unless \\-\\-threads is given\n"
        ".TP\n.B NO_COLOR\nno colours when set\n");
}

/* ---- Markdown ---- */

/* Appends a cell of a Markdown table. Only the bar is escaped: help texts may hold Markdown. */
static void add_cell(sdm_text *out, const char *text)
{
    for (; *text; text++) sdm_text_add(out, *text == '|' ? "\\|" : "%c", *text);
}

void cli_help_markdown(sdm_text *out)
{
    for (size_t command = 0; command < CLI_N_COMMANDS; command++) {
        const cli_command *c = &cli_commands[command];
        sdm_text_add(out, "## %s\n\n```\nsdmgen %s %s\n```\n\n%c%s.\n", c->name, c->name,
                     c->synopsis, c->summary[0] - 'a' + 'A', c->summary + 1);
        if (c->details) sdm_text_add(out, "%s\n", c->details);
        sdm_text_add(out, "\n| option | meaning |\n|---|---|\n");
        for (size_t i = 0; i < cli_n_options; i++) {
            if (!cli_option_fits(&cli_options[i], command)) continue;
            char form[128];
            sdm_text_add(out, "| `");
            add_cell(out, option_form(&cli_options[i], form));
            sdm_text_add(out, "` | ");
            add_cell(out, cli_options[i].help);
            sdm_text_add(out, " |\n");
        }
        if (c->example) sdm_text_add(out, "\n```\n%s\n```\n", c->example);
        if (command + 1 < CLI_N_COMMANDS) sdm_text_add(out, "\n");
    }
}

/* ---- bash completion ---- */

/* Appends the completion of an option's value: file names, the words of a choice, the names of the
 * shapes, or nothing for numbers and other texts. */
static void add_completion_value(sdm_text *out, const cli_option *o)
{
    const bool file = o->value && (strstr(o->value, "FILE") || !strcmp(o->value, "DIR"));
    if (o->kind == CLI_CHOICE) {
        sdm_text_add(out, "    --%s) COMPREPLY=($(compgen -W \"", o->name);
        for (const char *at = o->choices; *at; at++)
            sdm_text_add(out, "%c", *at == '|' ? ' ' : *at);
        sdm_text_add(out, "\" -- \"$current\")); return ;;\n");
        return;
    }
    char letter[8] = "";
    if (o->letter) snprintf(letter, sizeof letter, "|-%c", o->letter);
    const char *reply = file ? "COMPREPLY=($(compgen -f -- \"$current\"))"
                        : !strcmp(o->name, "shape")
                            ? "COMPREPLY=($(compgen -W \"$(sdmgen shapes 2>/dev/null | cut -d' ' "
                              "-f1)\" -- \"$current\"))"
                            : "COMPREPLY=()";
    sdm_text_add(out, "    --%s%s) %s; return ;;\n", o->name, letter, reply);
}

static bool is_first_of_name(size_t index)
{
    for (size_t i = 0; i < index; i++)
        if (!strcmp(cli_options[i].name, cli_options[index].name)) return false;
    return true;
}

void cli_help_completion(sdm_text *out)
{
    sdm_text_add(out,
                 "# bash completion of sdmgen; made by: sdmgen help --completion\n_sdmgen()\n{\n"
                 "    local current=\"${COMP_WORDS[COMP_CWORD]}\" "
                 "previous=\"${COMP_WORDS[COMP_CWORD-1]}\" options=\"\"\n"
                 "    if [ \"$COMP_CWORD\" -eq 1 ]; then\n        COMPREPLY=($(compgen -W \"");
    for (size_t i = 0; i < CLI_N_COMMANDS; i++) sdm_text_add(out, "%s ", cli_commands[i].name);
    sdm_text_add(out, "--help --version\" -- \"$current\"))\n        return\n    fi\n    case "
                      "\"$previous\" in\n");
    for (size_t i = 0; i < cli_n_options; i++)
        if (cli_options[i].kind != CLI_FLAG && is_first_of_name(i))
            add_completion_value(out, &cli_options[i]);
    sdm_text_add(out, "    esac\n    case \"${COMP_WORDS[1]}\" in\n");
    for (size_t command = 0; command < CLI_N_COMMANDS; command++) {
        sdm_text_add(out, "    %s) options=\"", cli_commands[command].name);
        for (size_t i = 0; i < cli_n_options; i++)
            if (cli_option_fits(&cli_options[i], command))
                sdm_text_add(out, "--%s ", cli_options[i].name);
        sdm_text_add(out, "\" ;;\n");
    }
    sdm_text_add(out, "    esac\n"
                      "    case \"$current\" in\n"
                      "    -*) COMPREPLY=($(compgen -W \"$options\" -- \"$current\")) ;;\n"
                      "    *) COMPREPLY=($(compgen -f -- \"$current\")) ;;\n"
                      "    esac\n}\ncomplete -o filenames -F _sdmgen sdmgen\n");
}
