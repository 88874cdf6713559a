/* Names the plug-in when its code ends the program: a crash, abort() or exit() in a callback. */
#pragma once

/* Call it once, at the start of the program. A plug-in that crashes or calls exit() then gives one
 * line on stderr with its name, the callback and the parameters, and the exit code of bad input.
 * Crashes outside of plug-ins end the program as ever, and so does a stack overflow of a plug-in in
 * a thread other than the main one. */
void cli_guard_callbacks(void);
