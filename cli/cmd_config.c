/* sdmgen config: checks, prints or explains a configuration. */
#include <stdio.h>

#include "commands.h"
#include "inputs/config_shape.h"
#include "inputs/setup.h"
#include "report/report_survey.h"
#include "report/terminal.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

/* Checks the parts of the configuration that need the shape: its name and options, and the
 * ranges and distributions of its parameters. */
static sdm_status check_shape(const cli_args *args, sdm_config *c, sdm_error *err)
{
    double min[SDM_MAX_PARAMS], max[SDM_MAX_PARAMS];
    sdm_distribution distribution[SDM_MAX_PARAMS];
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    size_t n = 0;
    sdm_status s = cli_open_registry(args, &registry, err);
    if (!s) s = cli_config_shape(c, registry, &shape, err);
    if (!s) sdm_instance_params(shape, &n);
    if (!s && n > SDM_MAX_PARAMS)
        s = sdm_fail(err, SDM_E_CONFIG, "shape '%s' has %zu parameters, at most %d can be trained",
                     c->shape.name, n, SDM_MAX_PARAMS);
    if (!s) s = sdm_train_ranges(c, shape, min, max, err);
    if (!s) s = sdm_train_distributions(c, shape, min, max, distribution, err);
    if (!s && !args->dump) cli_notice_survey(c, shape);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s;
}

sdm_status cmd_config(const cli_args *args, sdm_error *err)
{
    sdm_text text = {0};
    if (args->keys) {
        if (args->files.n > 0 || args->dump)
            return sdm_fail(err, SDM_E_ARG,
                            "config: --keys stands alone, without CONFIG and --dump");
        sdm_config_describe(args->markdown, &text);
        return cli_print_text(&text, err);
    }
    if (args->files.n == 0)
        return sdm_fail(err, SDM_E_ARG, "usage: sdmgen config CONFIG [key=value ...], or --keys");
    sdm_config *config = NULL;
    sdm_status s = cli_read_config(args, &config, err);
    if (!s) s = check_shape(args, config, err);
    if (!s && args->dump) {
        sdm_config_dump(config, &text);
        s = cli_print_text(&text, err);
    } else if (!s) {
        printf("%s: no mistakes\n", args->files.items[0]);
    }
    sdm_free(config);
    return s;
}
