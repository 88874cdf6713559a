/* What it means that a signal ended a callback. */
#include <signal.h>

#include "sdm/internal/callback.h"

const char *sdm_callback_crash_reason(int signal_number)
{
    switch (signal_number) {
    case SIGSEGV:
        return "the plug-in used memory that is not its own (segmentation fault)";
    case SIGBUS:
        return "the plug-in used memory that does not exist (bus error)";
    case SIGFPE:
        return "the plug-in divided an integer by zero";
    case SIGILL:
        return "the plug-in ran an instruction that this processor does not have";
    default:
        return "the plug-in called abort(), or damaged memory";
    }
}
