/* Makes the completion scripts for bash, zsh and fish from the tables of commands and options. */
#include <stdio.h>
#include <string.h>

#include "help.h"

/* What the value of an option is completed by. */
typedef enum value_words { NO_WORDS, FILES, CHOICES, SHAPES } value_words;

static value_words words_of(const cli_option *o)
{
    if (o->kind == CLI_CHOICE) return CHOICES;
    if (!strcmp(o->name, "shape")) return SHAPES;
    return o->value && (strstr(o->value, "FILE") || !strcmp(o->value, "DIR")) ? FILES : NO_WORDS;
}

/* Appends the words of a choice with spaces between them. */
static void add_choices(sdm_text *out, const cli_option *o)
{
    for (const char *at = o->choices; *at; at++) sdm_text_add(out, "%c", *at == '|' ? ' ' : *at);
}

/* Appends the text for a string in single quotes of a shell, where a quote ends the string, is
 * escaped, and begins it again; with `special`, a backslash precedes each of these characters. */
static void add_quoted(sdm_text *out, const char *text, const char *special)
{
    for (; *text; text++) {
        if (strchr(special, *text)) sdm_text_add(out, "\\");
        sdm_text_add(out, *text == '\'' ? "'\\''" : "%c", *text);
    }
}

/* ---- bash ---- */

static void add_bash_value(sdm_text *out, const cli_option *o)
{
    const value_words words = words_of(o);
    if (words == CHOICES) {
        sdm_text_add(out, "    --%s) COMPREPLY=($(compgen -W \"", o->name);
        add_choices(out, o);
        sdm_text_add(out, "\" -- \"$current\")); return ;;\n");
        return;
    }
    char letter[8] = "";
    if (o->letter) snprintf(letter, sizeof letter, "|-%c", o->letter);
    const char *reply = words == FILES ? "COMPREPLY=($(compgen -f -- \"$current\"))"
                        : words == SHAPES
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

void cli_complete_bash(sdm_text *out)
{
    sdm_text_add(
        out, "# bash completion of sdmgen; made by: sdmgen help --completion bash\n_sdmgen()\n{\n"
             "    local current=\"${COMP_WORDS[COMP_CWORD]}\" "
             "previous=\"${COMP_WORDS[COMP_CWORD-1]}\" options=\"\"\n"
             "    if [ \"$COMP_CWORD\" -eq 1 ]; then\n        COMPREPLY=($(compgen -W \"");
    for (size_t i = 0; i < CLI_N_COMMANDS; i++) sdm_text_add(out, "%s ", cli_commands[i].name);
    sdm_text_add(out, "--help --version\" -- \"$current\"))\n        return\n    fi\n    case "
                      "\"$previous\" in\n");
    for (size_t i = 0; i < cli_n_options; i++)
        if (cli_options[i].kind != CLI_FLAG && is_first_of_name(i))
            add_bash_value(out, &cli_options[i]);
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

/* ---- zsh ---- */

/* Appends one argument of _arguments: '(-o --output)'{-o,--output}'[help]:VALUE:action'. */
static void add_zsh_option(sdm_text *out, const cli_option *o)
{
    const bool repeated = o->kind == CLI_LIST;
    sdm_text_add(out, "            ");
    if (o->letter && !repeated) sdm_text_add(out, "'(-%c --%s)'", o->letter, o->name);
    if (repeated) sdm_text_add(out, "'*'");
    if (o->letter)
        sdm_text_add(out, "{-%c,--%s}", o->letter, o->name);
    else
        sdm_text_add(out, "--%s", o->name);
    sdm_text_add(out, "'[");
    add_quoted(out, o->help, "[]");
    sdm_text_add(out, "]");
    if (o->kind != CLI_FLAG) {
        sdm_text_add(out, ":");
        add_quoted(out, o->value ? o->value : o->name, ":");
        sdm_text_add(out, ":");
        switch (words_of(o)) {
        case FILES:
            sdm_text_add(out, "_files");
            break;
        case CHOICES:
            sdm_text_add(out, "(");
            add_choices(out, o);
            sdm_text_add(out, ")");
            break;
        case SHAPES:
            sdm_text_add(out, "_sdmgen_shapes");
            break;
        case NO_WORDS:
            break;
        }
    }
    sdm_text_add(out, "' \\\n");
}

void cli_complete_zsh(sdm_text *out)
{
    sdm_text_add(out, "#compdef sdmgen\n"
                      "# zsh completion of sdmgen; made by: sdmgen help --completion zsh\n"
                      "_sdmgen_shapes()\n{\n"
                      "    local -a names\n"
                      "    names=(${(f)\"$(sdmgen shapes 2>/dev/null | cut -d' ' -f1)\"})\n"
                      "    compadd -a names\n}\n"
                      "_sdmgen()\n{\n    local -a commands\n    commands=(\n");
    for (size_t i = 0; i < CLI_N_COMMANDS; i++) {
        sdm_text_add(out, "        '%s:", cli_commands[i].name);
        add_quoted(out, cli_commands[i].summary, ":");
        sdm_text_add(out, "'\n");
    }
    sdm_text_add(out, "    )\n    if (( CURRENT == 2 )); then\n"
                      "        _describe command commands\n        return\n    fi\n"
                      "    local command=$words[2]\n    shift words\n    (( CURRENT-- ))\n"
                      "    case $command in\n");
    for (size_t command = 0; command < CLI_N_COMMANDS; command++) {
        sdm_text_add(out, "    %s)\n        _arguments \\\n", cli_commands[command].name);
        for (size_t i = 0; i < cli_n_options; i++)
            if (cli_option_fits(&cli_options[i], command)) add_zsh_option(out, &cli_options[i]);
        sdm_text_add(out, "            '*:file:_files' ;;\n");
    }
    sdm_text_add(out, "    esac\n}\n_sdmgen \"$@\"\n");
}

/* ---- fish ---- */

static void add_fish_option(sdm_text *out, const cli_option *o)
{
    // the commands that have the option
    sdm_text_add(out, "complete -c sdmgen -n '__fish_seen_subcommand_from");
    for (size_t command = 0; command < CLI_N_COMMANDS; command++)
        if (cli_option_fits(o, command)) sdm_text_add(out, " %s", cli_commands[command].name);
    sdm_text_add(out, "' -l %s", o->name);
    if (o->letter) sdm_text_add(out, " -s %c", o->letter);
    // the values
    if (o->kind != CLI_FLAG) switch (words_of(o)) {
        case FILES:
            sdm_text_add(out, " -r -F");
            break;
        case CHOICES:
            sdm_text_add(out, " -x -a '");
            add_choices(out, o);
            sdm_text_add(out, "'");
            break;
        case SHAPES:
            sdm_text_add(out, " -x -a \"(sdmgen shapes 2>/dev/null | string split -f1 ' ')\"");
            break;
        case NO_WORDS:
            sdm_text_add(out, " -x");
            break;
        }
    sdm_text_add(out, " -d '");
    for (const char *at = o->help; *at; at++)
        sdm_text_add(out, *at == '\'' || *at == '\\' ? "\\%c" : "%c", *at);
    sdm_text_add(out, "'\n");
}

void cli_complete_fish(sdm_text *out)
{
    sdm_text_add(out, "# fish completion of sdmgen; made by: sdmgen help --completion fish\n");
    for (size_t i = 0; i < CLI_N_COMMANDS; i++)
        sdm_text_add(out, "complete -c sdmgen -n __fish_use_subcommand -f -a %s -d '%s'\n",
                     cli_commands[i].name, cli_commands[i].summary);
    for (size_t i = 0; i < cli_n_options; i++) add_fish_option(out, &cli_options[i]);
}
