/* The table of options and the parser: an option that may not be repeated is refused when it is
 * given twice, for every option of every command; decimal commas; words of other programs.
 * Tests: command_line.c, option_aliases.c, option_table.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "args/options.h"

/* Writes a value that the option accepts: as many numbers as its kind needs, each in its range. */
static void write_value(const cli_option *o, char value[512])
{
    static const size_t counts[] = {
        [CLI_INT] = 1,   [CLI_REAL] = 1,  [CLI_INT3] = 3,  [CLI_REAL2] = 2,
        [CLI_REAL3] = 3, [CLI_REAL6] = 6, [CLI_REAL9] = 9, [CLI_REAL13] = 3};
    const size_t n = (size_t)o->kind < sizeof counts / sizeof *counts ? counts[o->kind] : 0;
    size_t used = 0;
    if (o->kind == CLI_CHOICE)
        snprintf(value, 512, "%.*s", (int)strcspn(o->choices, "|"), o->choices);
    else if (n == 0)
        snprintf(value, 512, "text");
    for (size_t i = 0; i < n; i++)
        used += (size_t)snprintf(value + used, 512 - used, "%s%.17g", i ? "," : "", o->min);
}

/* Parses "sdmgen COMMAND FILE... WORD...": `words` follow the least number of files. */
static sdm_status parse(size_t command, const char *const words[4], sdm_error *err)
{
    char *argv[16];
    int argc = 0;
    cli_args args;
    argv[argc++] = (char *)(uintptr_t) "sdmgen";
    argv[argc++] = (char *)(uintptr_t)cli_commands[command].name;
    for (size_t i = 0; i < cli_commands[command].min_files; i++)
        argv[argc++] = (char *)(uintptr_t) "file";
    for (size_t i = 0; i < 4 && words[i]; i++) argv[argc++] = (char *)(uintptr_t)words[i];
    *err = (sdm_error){0};
    const sdm_status s = cli_parse(argc, argv, &args, err);
    cli_args_dispose(&args);
    return s;
}

static void only_lists_and_flags_may_repeat(void **state)
{
    (void)state;
    size_t refused = 0, lists = 0;
    for (size_t c = 0; c < CLI_N_COMMANDS; c++)
        for (size_t i = 0; i < cli_n_options; i++) {
            const cli_option *o = &cli_options[i];
            if (!cli_option_fits(o, c) || !strcmp(o->name, "help")) continue;
            char value[512], word[600], twice[128];
            sdm_error err;
            write_value(o, value);
            snprintf(word, sizeof word, "--%s%s%s", o->name, o->kind == CLI_FLAG ? "" : "=",
                     o->kind == CLI_FLAG ? "" : value);
            // once
            if (parse(c, (const char *[4]){word}, &err)) fail_msg("%s: %s", word, err.text);
            // twice
            const bool list = o->kind == CLI_LIST, flag = o->kind == CLI_FLAG;
            assert_int_equal(cli_may_repeat(o), list || flag);
            const sdm_status s = parse(c, (const char *[4]){word, word}, &err);
            if (list || flag) {
                if (s) fail_msg("%s twice: %s", word, err.text);
                lists += list;
                continue;
            }
            snprintf(twice, sizeof twice, "%s: --%s is given twice", cli_commands[c].name, o->name);
            assert_int_equal(s, SDM_E_ARG);
            if (!strstr(err.text, twice)) fail_msg("%s twice: %s", word, err.text);
            refused++;
        }
    assert_true(refused > 100 && lists > 10);
}

static void both_values_are_named(void **state)
{
    (void)state;
    sdm_error err;
    assert_int_equal(parse(CLI_PHANTOM, (const char *[4]){"--blur", "1", "--blur=2"}, &err),
                     SDM_E_ARG);
    assert_string_equal(err.text,
                        "phantom: --blur is given twice, with '1' and with '2': give it once");
    // the short form is the same option
    assert_int_equal(parse(CLI_EXACT, (const char *[4]){"-p", "a=1", "--param=b=1"}, &err), SDM_OK);
}

static void decimal_commas_are_told(void **state)
{
    (void)state;
    static const struct {
        size_t command;
        const char *word, *wanted; // NULL: no word about a comma
    } cases[] = {{CLI_EXACT, "--spacing=0,5", "; a decimal number has a point: 0.5"},
                 {CLI_EXACT, "--spacing=0,5,0,5,0,5", "a decimal number has a point: 0.5, not 0,5"},
                 {CLI_EXACT, "--narrow=2,5", "; a decimal number has a point: 2.5"},
                 {CLI_EXACT, "--origin=0,5,1,5,-2,5", "a decimal number has a point"},
                 {CLI_FIT, "--inside=40,5,170,5", "a decimal number has a point"},
                 {CLI_FIT, "--prior-rotation=0,5", "; a decimal number has a point: 0.5"},
                 {CLI_EXACT, "--spacing=1,2,3,4", NULL},
                 {CLI_EXACT, "--spacing=x", NULL},
                 {CLI_EXACT, "--size=1,2", NULL},
                 {CLI_EXACT, "--origin=1,2", NULL}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_error err;
        assert_int_equal(parse(cases[i].command, (const char *[4]){cases[i].word}, &err),
                         SDM_E_ARG);
        if (!strstr(err.text, cases[i].wanted ? cases[i].wanted : "a decimal number") ==
            (cases[i].wanted != NULL))
            fail_msg("%s: %s", cases[i].word, err.text);
    }
}

static void words_of_other_programs_are_known(void **state)
{
    (void)state;
    static const struct {
        size_t command;
        const char *word, *message;
    } cases[] = {
        {CLI_FIT, "--center=1,2,3", "option --center; did you mean --start-centre X,Y,Z?"},
        {CLI_FIT, "--start", "did you mean --start-centre X,Y,Z or --start-axis X,Y,Z?"},
        {CLI_FIT, "--fix", "did you mean --keep WHAT?"},
        {CLI_FIT, "--resolution=2", "did you mean --spacing MM?"},
        {CLI_EXACT, "--voxelsize", "did you mean --spacing MM?"},
        {CLI_FIT, "--out", "did you mean -o FILE?"},
        {CLI_TRAIN, "--output=x", "did you mean --out DIR?"},
        {CLI_TRAIN, "--budget=3", "did you mean train.minutes=3?"},
        {CLI_TRAIN, "--voxel", "did you mean grid.spacing=0.5?"},
        // the command has nothing for the word, and no option is like it
        {CLI_EXACT, "--center", "unknown option --center; see sdmgen exact --help"},
        {CLI_EXACT, "--budget", "unknown option --budget; see sdmgen exact --help"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_error err;
        assert_int_equal(parse(cases[i].command, (const char *[4]){cases[i].word}, &err),
                         SDM_E_ARG);
        if (!strstr(err.text, cases[i].message)) fail_msg("%s: %s", cases[i].word, err.text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_lists_and_flags_may_repeat),
        cmocka_unit_test(both_values_are_named),
        cmocka_unit_test(decimal_commas_are_told),
        cmocka_unit_test(words_of_other_programs_are_known),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
