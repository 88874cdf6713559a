/* sdmgen report: writes a page of a model, of a run or of a fit, to be looked at in a browser. */
#include "commands.h"
#include "page/page.h"
#include "report/files.h"

static sdm_status check_arguments(const cli_args *args, sdm_error *err)
{
    if (args->outputs.n != 1 || !cli_ends_with_any(args->outputs.items[0], ".html .htm"))
        return sdm_fail(err, SDM_E_ARG, "report: need one output: -o FILE.html");
    if (!args->no_model && !cli_page_has_runtime())
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "report: this program was built without WebAssembly, so its pages cannot "
                        "run a model: use --no-model (pictures alone), or install clang-14, "
                        "lld-14, wasi-libc and libclang-rt-14-dev-wasm32 and build again");
    return cli_check_files(args, NULL, err);
}

sdm_status cmd_report(const cli_args *args, sdm_error *err)
{
    const sdm_status s = check_arguments(args, err);
    if (s) return s;
    return cli_page_report(args, args->files.items[0], !args->no_model, args->outputs.items[0],
                           err);
}
