/* SPDX-License-Identifier: MIT
 *
 * The subcommands of `saga` have one file each.
 */
#ifndef SAGA_COMMANDS_H
#define SAGA_COMMANDS_H

#include "cli.h"

extern const saga_command saga_command_compare;
extern const saga_command saga_command_cut;
extern const saga_command saga_command_check;
extern const saga_command saga_command_devices;
extern const saga_command saga_command_encode;
extern const saga_command saga_command_eval;
extern const saga_command saga_command_export;
extern const saga_command saga_command_import;
extern const saga_command saga_command_info;
extern const saga_command saga_command_join;
extern const saga_command saga_command_mux;
extern const saga_command saga_command_render;
extern const saga_command saga_command_report;
extern const saga_command saga_command_synth;
extern const saga_command saga_command_verify;
extern const saga_command saga_command_view;
extern const saga_command saga_command_volume;

#endif
