/* Names the plug-in when its code ends the program: a crash, abort() or exit() in a callback; and
 * OpenVDB when that crashes, as it does where some allocations fail. */
#pragma once

#include <stdbool.h>

/* Call it once, at the start of the program. A plug-in that crashes or calls exit() then gives one
 * line on stderr with its name, the callback and the parameters, and the exit code of bad input.
 * A crash inside OpenVDB gives one line with its file and the exit code 1; no temporary file stays.
 * Other crashes end the program as ever, and so does a stack overflow in a thread other than the
 * main one. plugins: other files with code are loaded into this process; a crash elsewhere then
 * gives a line about --isolate. */
void cli_guard_callbacks(bool plugins);
