/* Prints what a phantom shows: voxels, values of the tissues, noise, blur, files. */
#include "phantom_command.h"
#include "report/terminal.h"

static void print_files(const cli_phantom *p)
{
    const cli_phantom_args *a = &p->args->phantom;
    if (p->args->outputs.n && a->label) cli_print("; labels in %s", a->label);
    if (a->truth) cli_print("; truth in %s", a->truth);
}

static void print_tissues(const sdm_phantom_opts *o)
{
    cli_print("; values inside %g, outside %g (texture %g and %g)", o->inside.mean, o->outside.mean,
              o->inside.sd, o->outside.sd);
    if (o->air_share > 0) cli_print(", air %g", o->air.mean);
    cli_print(", noise %g%s, blur %g x %g x %g mm", o->noise,
              o->noise > 0 && !o->noise_is_blurred ? " (white)" : "", o->blur[0], o->blur[1],
              o->blur[2]);
}

void cli_phantom_summary(const cli_phantom *p, size_t inside)
{
    const sdm_grid *g = &p->grid;
    const bool image = p->args->outputs.n > 0;
    const char *path = image ? p->args->outputs.items[0] : p->args->phantom.label;
    if (!path || p->args->json || cli_is_quiet()) return;
    cli_print("%s: %s, %lld x %lld x %lld voxels of %.4g x %.4g x %.4g mm, %zu of them inside",
              path, p->args->shape, (long long)g->n[0], (long long)g->n[1], (long long)g->n[2],
              g->spacing[0], g->spacing[1], g->spacing[2], inside);
    if (image) print_tissues(&p->opts);
    print_files(p);
    cli_print("\n");
}
