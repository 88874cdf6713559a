/* sdmgen config: checks, prints or explains a configuration. */
#include <stdio.h>

#include "commands.h"
#include "inputs/config_shape.h"
#include "report/report_survey.h"
#include "report/terminal.h"
#include "sdm/memory.h"

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
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_status s = cli_open_config(args, &config, &registry, &shape, err);
    if (!s && !args->dump) cli_notice_survey(config, shape);
    if (!s && !args->dump) s = cli_check_memory(config, shape, err);
    if (!s && args->dump) {
        sdm_config_dump(config, &text);
        s = cli_print_text(&text, err);
    } else if (!s) {
        const size_t n = cli_warnings();
        printf("%s: no mistakes", args->files.items[0]);
        if (n) printf(", %zu warning%s", n, n > 1 ? "s" : "");
        printf("\n");
    }
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    sdm_free(config);
    return s;
}
