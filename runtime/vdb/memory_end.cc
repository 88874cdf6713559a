/* Calls a function of the program where a C++ library has no memory and cannot report it. */
#include <cstdlib>
#include <cxxabi.h>
#include <exception>
#include <new>
#include <typeinfo>

#include "sdm/internal/vdb_memory.h"

namespace
{

void (*end_of_program)();

[[noreturn]] void terminate()
{
    const std::type_info *what = abi::__cxa_current_exception_type();
    if (what && *what == typeid(std::bad_alloc)) end_of_program();
    std::abort();
}

} // namespace

void sdm_vdb_on_memory_end(void (*end)())
{
    end_of_program = end;
    std::set_terminate(terminate);
}
