/* sdmgen config: checks, prints or explains a configuration. */
#include <stdio.h>

#include "commands.h"
#include "inputs/config_shape.h"
#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/memory.h"
#include "survey/report_survey.h"

/* Names that the lists below leave out, for sdm_config_changed_keys(). */
static const char NETWORK[] = " kind depth rank levels block modes degree fine weights skip output "
                              "channels dropout ",
                  TRAIN[] =
                      " minutes steps samples batch points learning_rate warmup loss clamp_mm "
                      "eikonal near_weight near_mm refine patience average evaluate_seconds "
                      "checkpoint_seconds ";

/* Tells of the changed keys of `section` but those that `but` names. */
static void tell(const sdm_config *c, const char *section, const char *but, const char *why)
{
    sdm_text keys = {0};
    sdm_config_changed_keys(c, section, but, &keys);
    if (keys.size && !keys.failed) cli_notice("%s: %s", why, keys.data);
    sdm_text_dispose(&keys);
}

/* Without a correction a template is not trained. */
static void tell_template(const sdm_config *c)
{
    sdm_text keys = {0};
    sdm_config_changed_keys(c, "network", " kind weights fine ", &keys);
    sdm_config_changed_keys(c, "data", " holdout memory_gb workers ", &keys);
    sdm_config_changed_keys(c, "train", " minutes steps samples near_mm clamp_mm ", &keys);
    if (keys.size && !keys.failed)
        cli_notice("these keys are for the correction of a template, which only a single body that "
                   "deforms has; else they have no effect: %s",
                   keys.data);
    sdm_text_dispose(&keys);
}

/* One notice for each reason: the keys with other values than their defaults that have no effect
 * since another key switches their part off; of a template, those that have one only where it is
 * corrected, which the training finds out. */
static void tell_vain_keys(const sdm_config *c)
{
    const sdm_network_kind kind = c->network.kind;
    if (c->dropped[0])
        cli_notice("the kind of network on the command line has no such keys, so these of %s have "
                   "no effect: %s",
                   c->file, c->dropped);
    if (kind == SDM_NETWORK_TEMPLATE) {
        tell_template(c);
        return;
    }
    if ((kind == SDM_NETWORK_POD || kind == SDM_NETWORK_AUTO) && !c->network.depth)
        tell(c, "network", NETWORK, "network.depth is 0, so these keys have no effect");
    if (!(c->train.refine > 0))
        tell(c, "train", TRAIN, "train.refine is 0, so these keys have no effect");
}

/* The last line. of_shape: so many of the warnings are about the shape, not about the file. */
static void print_verdict(const char *file, size_t of_shape)
{
    const size_t n = cli_warnings() - of_shape;
    printf("%s: no mistakes%s", file, of_shape ? " in the file" : "");
    if (n) printf(", %zu warning%s", n, n > 1 ? "s" : "");
    if (of_shape) printf("; the shape has %zu (above)", of_shape);
    printf("\n");
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
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    size_t of_shape = 0;
    sdm_status s = cli_open_config(args, &config, &registry, &shape, err);
    if (!s && !args->dump) tell_vain_keys(config);
    if (!s && !args->dump)
        of_shape = cli_notice_survey(config, shape, cli_other_process(args, registry, shape), NULL);
    if (!s && !args->dump) s = cli_check_memory(config, shape, err);
    if (!s && args->dump) {
        sdm_config_dump(config, &text);
        s = cli_print_text(&text, err);
    } else if (!s) {
        print_verdict(args->files.items[0], of_shape);
    }
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    sdm_free(config);
    return s;
}
