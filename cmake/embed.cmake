# sdm_embed(OUTPUT FOLDER FILE...): writes OUTPUT, lines {"FILE", "content", SIZE}, of a C table of files. A file that changes is read again
# by the next build. The content is an array of numbers, because C compilers need not accept long string literals, with a zero behind it.
# Files that the build makes are embedded by a command: cmake -DOUTPUT=... -DFOLDER=... -DFILES=... -P embed.cmake.
function(sdm_embed output folder)
  set(table "")
  foreach(file ${ARGN})
    if(NOT CMAKE_SCRIPT_MODE_FILE)
      set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${folder}/${file})
    endif()
    file(READ ${folder}/${file} bytes HEX)
    string(REGEX REPLACE "^(1f8b08..)........" "\\100000000" bytes "${bytes}") # the time in the header of gzip
    file(SIZE ${folder}/${file} size)
    string(REGEX REPLACE "(..)" "0x\\1," bytes "${bytes}")
    string(APPEND table "{\"${file}\", (const char *)(const unsigned char[]){${bytes}0}, ${size}},\n")
  endforeach()
  file(CONFIGURE OUTPUT ${output} CONTENT "${table}" @ONLY)
endfunction()

if(CMAKE_SCRIPT_MODE_FILE)
  sdm_embed(${OUTPUT} ${FOLDER} ${FILES})
endif()
