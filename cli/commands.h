/* The commands of sdmgen, one file each. A command writes results to stdout and notices to stderr.
 * On failure it returns a status, which determines the exit code, and its message in *err. */
#pragma once

#include "args/options.h"

sdm_status cmd_train(const cli_args *args, sdm_error *err);
sdm_status cmd_dataset(const cli_args *args, sdm_error *err);
sdm_status cmd_generate(const cli_args *args, sdm_error *err);
sdm_status cmd_exact(const cli_args *args, sdm_error *err);
sdm_status cmd_mesh(const cli_args *args, sdm_error *err);
sdm_status cmd_eval(const cli_args *args, sdm_error *err);
sdm_status cmd_report(const cli_args *args, sdm_error *err);
sdm_status cmd_shapes(const cli_args *args, sdm_error *err);
sdm_status cmd_info(const cli_args *args, sdm_error *err);
sdm_status cmd_verify(const cli_args *args, sdm_error *err);
sdm_status cmd_config(const cli_args *args, sdm_error *err);
sdm_status cmd_bench(const cli_args *args, sdm_error *err);
sdm_status cmd_experiment(const cli_args *args, sdm_error *err);
sdm_status cmd_phantom(const cli_args *args, sdm_error *err);
sdm_status cmd_fit(const cli_args *args, sdm_error *err);
sdm_status cmd_collect(const cli_args *args, sdm_error *err);
sdm_status cmd_export(const cli_args *args, sdm_error *err);
sdm_status cmd_import(const cli_args *args, sdm_error *err);
sdm_status cmd_slicer(const cli_args *args, sdm_error *err);
sdm_status cmd_help(const cli_args *args, sdm_error *err);
