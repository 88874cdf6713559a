/* Ends the program with one line where a C++ library has no memory and cannot report it. */
#include "cpp_end.h"

#include <cstdlib>
#include <cxxabi.h>
#include <exception>
#include <new>
#include <typeinfo>
#include <unistd.h>

#include "sdm/internal/file.h"

namespace
{

// called in any thread, without memory
[[noreturn]] void end()
{
    static const char line[] = "sdmgen: error: out of memory in OpenVDB\n";
    const std::type_info *what = abi::__cxa_current_exception_type();
    if (!what || *what != typeid(std::bad_alloc)) std::abort();
    const ssize_t put = write(STDERR_FILENO, line, sizeof line - 1);
    (void)put;
    sdm_outfile_remove_temps();
    _exit(1);
}

} // namespace

void cli_end_by_message() { std::set_terminate(end); }
