# Compiler flags of all targets, and sdm_part(NAME SOURCES ... LINK ... INCLUDE ...): a static
# library from one part of the project.
set(SDM_WARNINGS -Wall -Wextra -Wpedantic -Wshadow -Wvla -Wwrite-strings
    $<$<COMPILE_LANGUAGE:C>:-Wconversion -Wstrict-prototypes -Wmissing-prototypes>)
if(SDM_WERROR)
  list(APPEND SDM_WARNINGS -Werror)
endif()

add_library(sdm_flags INTERFACE)
target_compile_options(sdm_flags INTERFACE ${SDM_WARNINGS}
  $<$<COMPILE_LANGUAGE:C>:-fno-math-errno -ffp-contract=off>)
target_compile_definitions(sdm_flags INTERFACE _POSIX_C_SOURCE=200809L)
if(SDM_SANITIZE)
  target_compile_options(sdm_flags INTERFACE -fsanitize=${SDM_SANITIZE} -fno-sanitize-recover=all
    -fno-omit-frame-pointer)
  target_link_options(sdm_flags INTERFACE -fsanitize=${SDM_SANITIZE})
endif()
if(SDM_OPENMP)
  target_link_libraries(sdm_flags INTERFACE OpenMP::OpenMP_C)
else()
  # without OpenMP, variables and functions that only pragmas use cause warnings
  target_compile_options(sdm_flags INTERFACE -Wno-unknown-pragmas -Wno-unused-function
    -Wno-unused-parameter)
endif()

function(sdm_part name)
  cmake_parse_arguments(PART "" "" "SOURCES;LINK;INCLUDE" ${ARGN})
  add_library(${name} STATIC ${PART_SOURCES})
  target_include_directories(${name} PUBLIC ${PART_INCLUDE} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE sdm_flags PUBLIC ${PART_LINK})
endfunction()

# gcc 12.2 for 64-bit ARM fails ("internal compiler error: in vect_transform_reduction") on loops that
# compute the maximum of differences. The options of a source file with such a loop; empty elsewhere.
set(SDM_MAXIMUM_LOOP)
if(CMAKE_C_COMPILER_ID STREQUAL GNU AND CMAKE_C_COMPILER_VERSION VERSION_LESS 12.3 AND
   CMAKE_SYSTEM_PROCESSOR STREQUAL aarch64)
  set(SDM_MAXIMUM_LOOP -fno-tree-loop-vectorize)
endif()
