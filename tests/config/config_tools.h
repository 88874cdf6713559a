/* Functions for tests of configurations (included): a text is read, or has a mistake. Include
 * cmocka.h first. */
#pragma once

#include <string.h>

#include "sdm/internal/config.h"

#define BASE "shape: {name: ball}\ngrid: {size: [4, 5, 6], spacing: 1}\ntrain: {steps: 10}\n"

static sdm_config config; /* too large for some stacks */
static sdm_error err;

static sdm_status parse(const char *text, const char *const *overrides, size_t n)
{
    memset(&err, 0, sizeof err);
    return sdm_config_parse("x.yaml", text, strlen(text), overrides, n, &config, &err);
}

static void expect_ok(const char *text, const char *override)
{
    sdm_status s = parse(text, &override, override != NULL);
    if (s) fail_msg("%s: %s", override ? override : text, err.text);
}

static void expect_mistake(const char *text, const char *override, const char *message)
{
    assert_int_equal(parse(text, &override, override != NULL), SDM_E_CONFIG);
    assert_int_equal(err.status, SDM_E_CONFIG);
    assert_string_equal(err.text, message);
}
