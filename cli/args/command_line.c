/* Parses the command line according to the tables of option_table.c. */
#include "options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/memory.h"

bool cli_may_repeat(const cli_option *o) { return o->kind == CLI_LIST || o->kind == CLI_FLAG; }

bool cli_option_fits(const cli_option *option, size_t command)
{
    return (option->commands >> command & 1u) != 0;
}

static size_t command_index(const cli_args *args) { return (size_t)(args->command - cli_commands); }

const cli_command *cli_find_command(const char *name, sdm_error *err)
{
    const char *names[CLI_N_COMMANDS];
    for (size_t i = 0; i < CLI_N_COMMANDS; i++) {
        names[i] = cli_commands[i].name;
        if (!strcmp(name, names[i])) return &cli_commands[i];
    }
    const char *near = sdm_nearest_name(name, names, CLI_N_COMMANDS);
    if (near)
        sdm_fail(err, SDM_E_ARG, "unknown command '%s'; did you mean '%s'?", name, near);
    else
        sdm_fail(err, SDM_E_ARG, "unknown command '%s'; see sdmgen --help", name);
    return NULL;
}

/* SDM_E_ARG with the commands that have the option which `args->command` lacks; SDM_OK: none. */
static sdm_status option_of_others(const cli_args *args, const char *name, sdm_error *err)
{
    const char *commands[CLI_N_COMMANDS];
    char list[200];
    size_t n = 0;
    for (size_t c = 0; c < CLI_N_COMMANDS; c++)
        if (cli_find_option(c, name, strlen(name))) commands[n++] = cli_commands[c].name;
    if (!n) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "%s: unknown option --%s; it belongs to the command%s %s (sdmgen %s --help "
                    "lists those of %s)",
                    args->command->name, name, n > 1 ? "s" : "",
                    sdm_list_names(commands, n, list, sizeof list), args->command->name,
                    args->command->name);
}

/* Appends what the command has for a word of other programs: "--spacing MM or --size NX,NY,NZ". */
static void add_aliases(const cli_args *args, const char *word, sdm_text *out)
{
    const bool keys = strstr(args->command->synopsis, "key=value") != NULL;
    size_t row = 0;
    for (const char *name; (name = cli_alias_next(word, &row));) {
        const bool key = strchr(name, '=') != NULL;
        const cli_option *o = key ? NULL : cli_find_option(command_index(args), name, strlen(name));
        if (key ? !keys : !o) continue;
        sdm_text_add(out, "%s", out->data ? " or " : "");
        if (key)
            sdm_text_add(out, "%s", name);
        else if (o->letter)
            sdm_text_add(out, "-%c %s", o->letter, o->value);
        else
            sdm_text_add(out, "--%s %s", name, o->value);
    }
}

static sdm_status unknown_option(const cli_args *args, const char *word, size_t length,
                                 sdm_error *err)
{
    const char *names[128];
    size_t n = 0;
    for (size_t i = 0; i < cli_n_options && n < 128; i++)
        if (cli_option_fits(&cli_options[i], command_index(args))) names[n++] = cli_options[i].name;
    char name[64];
    const size_t cut = length < sizeof name - 1 ? length : sizeof name - 1;
    memcpy(name, word, cut);
    name[cut] = '\0';
    const char *command = args->command->name, *near = sdm_nearest_name(name, names, n);
    sdm_text aliases = {0};
    add_aliases(args, name, &aliases);
    sdm_status s = aliases.data
                       ? sdm_fail(err, SDM_E_ARG, "%s: unknown option --%s; did you mean %s?",
                                  command, name, aliases.data)
                       : SDM_OK;
    sdm_text_dispose(&aliases);
    if (!s) s = option_of_others(args, name, err);
    if (s) return s;
    if (near)
        return sdm_fail(err, SDM_E_ARG, "%s: unknown option --%s; did you mean --%s?", command,
                        name, near);
    return sdm_fail(err, SDM_E_ARG, "%s: unknown option --%s; see sdmgen %s --help%s", command,
                    name, command,
                    strstr(args->command->synopsis, "key=value")
                        ? "; keys of the configuration are given without dashes: train.minutes=3"
                        : "");
}

/* -o is most often meant for --out where a command writes a folder. */
static sdm_status unknown_letter(const cli_args *args, char letter, sdm_error *err)
{
    const char *command = args->command->name;
    if (letter == 'o' && cli_find_option(command_index(args), "out", 3))
        return sdm_fail(err, SDM_E_ARG, "%s: unknown option -o; did you mean --out DIR?", command);
    return sdm_fail(err, SDM_E_ARG, "%s: unknown option -%c; see sdmgen %s --help", command, letter,
                    command);
}

const cli_option *cli_find_option(size_t command, const char *name, size_t length)
{
    for (size_t i = 0; i < cli_n_options; i++) {
        const cli_option *o = &cli_options[i];
        if (cli_option_fits(o, command) && strlen(o->name) == length &&
            !strncmp(o->name, name, length))
            return o;
    }
    return NULL;
}

static const cli_option *find_letter(const cli_args *args, char letter)
{
    for (size_t i = 0; i < cli_n_options; i++)
        if (cli_options[i].letter == letter &&
            cli_option_fits(&cli_options[i], command_index(args)))
            return &cli_options[i];
    return NULL;
}

/* ---- values ---- */

static bool is_choice(const char *choices, const char *value)
{
    const size_t length = strlen(value);
    if (length == 0 || strchr(value, '|')) return false;
    for (const char *at = choices; at; at = strchr(at, '|') ? strchr(at, '|') + 1 : NULL)
        if (!strncmp(at, value, length) && (at[length] == '|' || at[length] == '\0')) return true;
    return false;
}

static bool in_range(const cli_option *o, double v) { return v >= o->min && v <= o->max; }

/* A range that ends here or beyond says nothing to a user. */
#define UNLIMITED 1e12

/* Number of numbers in the value of an option of real numbers; 0: another option. */
static size_t count_reals(const cli_option *o)
{
    return o->kind == CLI_REAL                             ? 1
           : o->kind == CLI_REAL2                          ? 2
           : o->kind == CLI_REAL3 || o->kind == CLI_REAL13 ? 3
           : o->kind == CLI_REAL6                          ? 6
           : o->kind == CLI_REAL9                          ? 9
                                                           : 0;
}

/* The end of the message about a value whose numbers have decimal commas: their commas make twice
 * as many whole numbers of them. "": other values. */
static const char *comma_hint(const cli_option *o, const char *value, char hint[64])
{
    const size_t wanted = count_reals(o);
    size_t parts = 1;
    *hint = '\0';
    if (wanted == 1 || o->kind == CLI_REAL13) sdm_comma_hint(value, hint);
    if (*hint || strspn(value, "0123456789,+-") != strlen(value)) return hint;
    for (const char *at = value; (at = strchr(at, ',')) != NULL; at++) parts++;
    if (wanted > 1 && parts == 2 * wanted)
        snprintf(hint, 64, "; a decimal number has a point: 0.5, not 0,5");
    return hint;
}

static sdm_status bad_value(const cli_option *o, const char *value, sdm_error *err)
{
    if (o->kind == CLI_CHOICE)
        return sdm_fail(err, SDM_E_ARG, "--%s '%s': need one of %s", o->name, value, o->choices);
    char two[64];
    snprintf(two, sizeof two, "two numbers %.20s%s", o->value,
             o->value && !strcmp(o->value, "DEG,MM") ? " (degrees and mm)" : "");
    const char *form = o->kind == CLI_INT     ? "a whole number"
                       : o->kind == CLI_INT3  ? "three whole numbers X,Y,Z"
                       : o->kind == CLI_REAL  ? "a number"
                       : o->kind == CLI_REAL2 ? two
                       : o->kind == CLI_REAL3 ? "three numbers X,Y,Z"
                       : o->kind == CLI_REAL6 ? "six numbers"
                       : o->kind == CLI_REAL9 ? "nine numbers"
                                              : "one number or three";
    char low[32], high[32], hint[64];
    if (o->max == CLI_TURN)
        return sdm_fail(err, SDM_E_ARG,
                        "--%s '%s': need %s in radians, at most a turn of 6.2832 (90 degrees are "
                        "1.5708)%s",
                        o->name, value, form, comma_hint(o, value, hint));
    const char *comma = comma_hint(o, value, hint);
    if (o->max >= UNLIMITED && o->min <= -UNLIMITED)
        return sdm_fail(err, SDM_E_ARG, "--%s '%s': need %s%s", o->name, value, form, comma);
    if (o->max >= UNLIMITED)
        return sdm_fail(err, SDM_E_ARG, "--%s '%s': need %s, at least %s%s", o->name, value, form,
                        sdm_format_real(o->min, low), comma);
    return sdm_fail(err, SDM_E_ARG, "--%s '%s': need %s in %s .. %s%s", o->name, value, form,
                    sdm_format_real(o->min, low), sdm_format_real(o->max, high), comma);
}

/* Splits the text at commas. Returns the number of values in out; 0 when a part is not a number or
 * there are more than 9 parts. */
static size_t split_numbers(const char *text, bool whole, double out[9])
{
    size_t n = 0;
    for (const char *at = text; at; n++) {
        const char *comma = strchr(at, ',');
        const size_t length = comma ? (size_t)(comma - at) : strlen(at);
        char word[64];
        if (n == 9 || length >= sizeof word) return 0;
        memcpy(word, at, length);
        word[length] = '\0';
        int64_t integer = 0;
        if (whole ? !sdm_parse_int(word, &integer) : !sdm_parse_real(word, &out[n])) return 0;
        if (whole) out[n] = (double)integer;
        at = comma ? comma + 1 : NULL;
    }
    return n;
}

/* The value of a CLI_INT3 or CLI_REAL* option other than CLI_REAL. */
static sdm_status store_vector(const cli_option *o, const char *value, void *field, sdm_error *err)
{
    double v[9];
    const size_t n = split_numbers(value, o->kind == CLI_INT3, v);
    const size_t wanted = o->kind == CLI_INT3 ? 3 : count_reals(o);
    if (n != wanted && !(n == 1 && o->kind == CLI_REAL13)) return bad_value(o, value, err);
    for (size_t i = 0; i < wanted; i++) {
        const double x = n == 1 ? v[0] : v[i];
        if (!in_range(o, x)) return bad_value(o, value, err);
        if (o->kind == CLI_INT3)
            ((int64_t *)field)[i] = (int64_t)x;
        else
            ((double *)field)[i] = x;
    }
    return SDM_OK;
}

static sdm_status store_value(cli_args *args, const cli_option *o, const char *value,
                              sdm_error *err)
{
    void *field = (char *)args + o->offset;
    int64_t integer = 0;
    double real = 0;
    switch (o->kind) {
    // texts
    case CLI_FLAG:
        *(bool *)field = true;
        return SDM_OK;
    case CLI_TEXT:
        *(const char **)field = value;
        return SDM_OK;
    case CLI_LIST: {
        cli_list *list = field;
        list->items[list->n++] = value;
        return SDM_OK;
    }
    case CLI_CHOICE:
        if (!is_choice(o->choices, value)) return bad_value(o, value, err);
        *(const char **)field = value;
        return SDM_OK;
    // numbers
    case CLI_INT:
        if (!sdm_parse_int(value, &integer) || !in_range(o, (double)integer))
            return bad_value(o, value, err);
        *(int64_t *)field = integer;
        return SDM_OK;
    case CLI_REAL:
        if (!sdm_parse_real(value, &real) || !in_range(o, real)) return bad_value(o, value, err);
        *(double *)field = real;
        return SDM_OK;
    default:
        return store_vector(o, value, field, err);
    }
}

/* ---- the command line ---- */

/* Refuses a second value of an option that may not be repeated; a flag says the same twice. */
static sdm_status check_once(const cli_args *args, const cli_option *o, const char *value,
                             sdm_error *err)
{
    if (cli_may_repeat(o)) return SDM_OK;
    for (size_t i = 0; i < args->n_given; i++)
        if (args->given[i].option == o)
            return sdm_fail(err, SDM_E_ARG,
                            "%s: --%s is given twice, with '%.60s' and with '%.60s': give it once",
                            args->command->name, o->name, args->given[i].value, value);
    return SDM_OK;
}

/* Refuses a blank in place of the '=' of -p and -O, or beside it: next[] are the arguments that
 * follow, NULL: none. */
static sdm_status check_equals(const cli_option *o, const char *value, char **next, sdm_error *err)
{
    if (!o->value || strcmp(o->value, "name=value")) return SDM_OK;
    const char *equals = strchr(value, '=');
    if (equals && (equals[1] || o->letter == 'O')) return SDM_OK; // the text of an option may be ""
    const int length = equals ? (int)(equals - value) : (int)strlen(value);
    const char *word = next ? *next + strspn(*next, "=") : "";
    if (next && !*word && next[1]) word = next[1];
    double number;
    // other words are options and files
    const bool is_value =
        sdm_parse_real(word, &number) || (o->letter == 'O' && *word && !strpbrk(word, "-./"));
    if (!is_value) return SDM_OK; // the command refuses what is no name=value
    return sdm_fail(err, SDM_E_ARG,
                    "-%c '%.200s': need name=value, without blanks: -%c %.*s=%.100s", o->letter,
                    value, o->letter, length, value, word);
}

/* Parses the option at argv[*i]. Its value is in the same argument or the next one, which
 * advances *i. */
static sdm_status parse_option(int argc, char **argv, int *i, cli_args *args, sdm_error *err)
{
    const char *word = argv[*i], *value = NULL;
    const cli_option *o;
    if (word[1] == '-') {
        const char *name = word + 2, *equals = strchr(name, '=');
        const size_t length = equals ? (size_t)(equals - name) : strlen(name);
        o = cli_find_option(command_index(args), name, length);
        if (!o) return unknown_option(args, name, length, err);
        if (equals) value = equals + 1;
    } else {
        o = find_letter(args, word[1]);
        if (!o) return unknown_letter(args, word[1], err);
        if (word[2]) value = word + 2;
    }
    if (o->kind == CLI_FLAG && value)
        return sdm_fail(err, SDM_E_ARG, "%s: --%s takes no value%s", word, o->name,
                        strcmp(o->name, "measure") ? "" : ", it prints all measures");
    if (o->kind != CLI_FLAG && !value) {
        if (*i + 1 >= argc) return sdm_fail(err, SDM_E_ARG, "%s needs a value", word);
        value = argv[++*i];
    }
    if (value && !*value) return sdm_fail(err, SDM_E_ARG, "--%s: empty value", o->name);
    sdm_status s = check_once(args, o, value, err);
    if (!s) s = check_equals(o, value, argc > *i + 1 ? argv + *i + 1 : NULL, err);
    if (s) return s;
    args->given[args->n_given++] = (cli_given){o, value ? value : o->name};
    return store_value(args, o, value, err);
}

static void set_phantom_defaults(cli_phantom_args *p)
{
    const cli_phantom_args none = {.random_pose = {NAN, NAN},
                                   .frame = {NAN, NAN, NAN},
                                   .crop = {NAN, NAN, NAN},
                                   .inside = {NAN, NAN},
                                   .outside = {NAN, NAN},
                                   .air = {NAN, NAN},
                                   .air_cells = {NAN, NAN, NAN},
                                   .blur = {NAN, NAN, NAN},
                                   .texture = NAN,
                                   .noise = NAN,
                                   .surface_noise = NAN,
                                   .type = "int16"};
    *p = none;
}

static void set_fit_defaults(cli_fit_args *f)
{
    const cli_fit_args none = {.image_model = "partial",
                               .mirror = "auto",
                               .start_centre = {NAN, NAN, NAN},
                               .start_axis = {NAN, NAN, NAN},
                               .region = {NAN, NAN, NAN, NAN, NAN, NAN},
                               .inside = {NAN, NAN},
                               .outside = {NAN, NAN},
                               .air = {NAN, NAN},
                               .blur = NAN,
                               .l_ref = NAN,
                               .point_sd = NAN,
                               .margin = NAN,
                               .cavity = NAN,
                               .tissue_field = NAN,
                               .label_close = NAN,
                               .least_inside = NAN,
                               .tolerance = NAN,
                               .beside = NAN,
                               .prior_sd = NAN,
                               .prior_rotation = NAN,
                               .prior_translation = NAN,
                               .eps = NAN};
    *f = none;
}

static void set_defaults(cli_args *args)
{
    args->seed = -1;
    args->samples = -1;
    args->maps = -1;
    args->naive = 2;
    args->origin[0] = args->origin[1] = args->origin[2] = NAN;
    args->direction[0] = NAN;
    args->outside = "refuse";
    args->max_mse = INFINITY;
    args->policy = "refuse";
    args->method = "exact";
    args->sign = "auto";
    args->pose = (cli_pose_args){{NAN, NAN, NAN}, {NAN, NAN, NAN}};
    set_phantom_defaults(&args->phantom);
    set_fit_defaults(&args->fit);
}

/* One block holds the items of all lists: no list has more than argc of them. */
static sdm_status make_lists(int argc, cli_args *args, sdm_error *err)
{
    cli_list *lists[] = {&args->files,
                         &args->plugins,
                         &args->params,
                         &args->options,
                         &args->outputs,
                         &args->fit.labels,
                         &args->fit.reference_labels,
                         &args->fit.keep};
    const size_t n_lists = sizeof lists / sizeof *lists;
    sdm_status s = SDM_ALLOC(&args->memory, (size_t)argc * n_lists, "command line", err);
    if (!s) s = SDM_ALLOC(&args->given, (size_t)argc, "command line", err);
    if (s) return s;
    for (size_t i = 0; i < n_lists; i++) lists[i]->items = args->memory + i * (size_t)argc;
    return SDM_OK;
}

static bool asks_for_help(int argc, char **argv)
{
    for (int i = 2; i < argc && strcmp(argv[i], "--"); i++)
        if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h")) return true;
    return false;
}

sdm_status cli_parse(int argc, char **argv, cli_args *args, sdm_error *err)
{
    // the command
    memset(args, 0, sizeof *args);
    set_defaults(args);
    args->argc = argc;
    args->argv = argv;
    if (argc < 2) return sdm_fail(err, SDM_E_ARG, "a command is needed; see sdmgen --help");
    args->command = cli_find_command(argv[1], err);
    if (!args->command) return SDM_E_ARG;
    if (asks_for_help(argc, argv)) {
        args->help = true;
        return SDM_OK;
    }
    // options and positional arguments; after "--" all arguments are positional
    sdm_status s = make_lists(argc, args, err);
    bool options_end = false;
    for (int i = 2; i < argc && !s; i++) {
        if (!options_end && !strcmp(argv[i], "--"))
            options_end = true;
        else if (!options_end && argv[i][0] == '-' && argv[i][1])
            s = parse_option(argc, argv, &i, args, err);
        else
            args->files.items[args->files.n++] = argv[i];
    }
    if (s) return s;

    // check the number of positional arguments
    const cli_command *c = args->command;
    if (args->files.n < c->min_files)
        return sdm_fail(err, SDM_E_ARG, "usage: sdmgen %s %s", c->name, c->synopsis);
    if (args->files.n > c->max_files && args->measure)
        return sdm_fail(err, SDM_E_ARG,
                        "%s: unexpected argument '%s': --measure has no value, it prints all "
                        "measures",
                        c->name, args->files.items[c->max_files]);
    if (args->files.n > c->max_files)
        return sdm_fail(err, SDM_E_ARG, "%s: unexpected argument '%s'; usage: sdmgen %s %s",
                        c->name, args->files.items[c->max_files], c->name, c->synopsis);
    return SDM_OK;
}

void cli_args_dispose(cli_args *args)
{
    sdm_free(args->given);
    sdm_free((void *)args->memory);
    memset(args, 0, sizeof *args);
}
