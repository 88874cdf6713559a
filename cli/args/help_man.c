/* Makes the manual pages sdmgen(1) and sdmgen-COMMAND(1) from the tables of commands and options.
 */
#include <ctype.h>

#include "help.h"

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

/* Appends the title line of a page; `command` is NULL for sdmgen(1). */
static void add_title(sdm_text *out, const char *command)
{
    sdm_text_add(out, ".TH SDMGEN%s", command ? "\\-" : "");
    for (const char *at = command ? command : ""; *at; at++)
        sdm_text_add(out, "%c", toupper((unsigned char)*at));
    sdm_text_add(out, " 1 \"\" \"sdmgen %s\" \"User Commands\"\n", SDM_VERSION_TEXT);
}

static void add_option(sdm_text *out, const cli_option *o)
{
    char form[128];
    sdm_text_add(out, ".TP\n.B \"");
    add_roff(out, cli_option_form(o, form));
    sdm_text_add(out, "\"\n");
    add_roff(out, o->help);
    sdm_text_add(out, "\n");
}

static void add_exit_codes(sdm_text *out)
{
    sdm_text_add(
        out,
        ".SH EXIT STATUS\n"
        ".TP\n0\ndone\n.TP\n1\nfailed\n.TP\n2\nusage or configuration\n.TP\n3\nbad input data\n"
        ".TP\n4\nquality not reached\n.TP\n5\nparameters out of range\n.TP\n6\ncases of a cohort "
        "failed or missing\n.TP\n130\n"
        "interrupted\n");
}

void cli_man(sdm_text *out)
{
    add_title(out, NULL);
    sdm_text_add(out, ".SH NAME\nsdmgen \\- fast signed distance maps of parametric shapes\n"
                      ".SH SYNOPSIS\n.B sdmgen\n.I command\n[arguments] [options]\n"
                      ".SH DESCRIPTION\nTrains networks that give the signed distance map of a "
                      "parametric shape, makes maps with\n"
                      "them, computes exact maps, and fits shapes to images. Lengths are mm, "
                      "angles rad, the distance is negative\n"
                      "inside, the frame is LPS.\n.SH COMMANDS\n");
    for (size_t i = 0; i < CLI_N_COMMANDS; i++) {
        sdm_text_add(out, ".TP\n.BR sdmgen\\-%s (1)\n", cli_commands[i].name);
        add_roff(out, cli_commands[i].summary);
        sdm_text_add(out, "\n");
    }
    add_exit_codes(out);
    sdm_text_add(out, ".SH ENVIRONMENT\n.TP\n.B SDMGEN_PLUGIN_PATH\nfolders with shape plug-ins, "
                      "separated by colons\n"
                      ".TP\n.B OMP_NUM_THREADS\nthreads, unless \\-\\-threads is given\n"
                      ".TP\n.B NO_COLOR\nno colours when set\n");
}

void cli_man_command(const cli_command *c, sdm_text *out)
{
    add_title(out, c->name);
    sdm_text_add(out, ".SH NAME\nsdmgen\\-%s \\- ", c->name);
    add_roff(out, c->summary);
    sdm_text_add(out, "\n.SH SYNOPSIS\n.B sdmgen %s\n", c->name);
    add_roff(out, c->synopsis);
    sdm_text_add(out, "\n");
    if (c->details) {
        sdm_text_add(out, ".SH DESCRIPTION\n");
        add_roff(out, c->details);
        sdm_text_add(out, "\n");
    }
    sdm_text_add(out, ".SH OPTIONS\n");
    for (size_t i = 0; i < cli_n_options; i++)
        if (cli_option_fits(&cli_options[i], (size_t)(c - cli_commands)))
            add_option(out, &cli_options[i]);
    add_exit_codes(out);
    if (c->example) {
        sdm_text_add(out, ".SH EXAMPLES\n.nf\n");
        add_roff(out, c->example);
        sdm_text_add(out, "\n.fi\n");
    }
    sdm_text_add(out, ".SH SEE ALSO\n.BR sdmgen (1)\n");
}
