# sdm_embed(OUTPUT FOLDER FILE...): writes OUTPUT, lines {"FILE", "content"}, of a C table of text files. A file that changes is read again
# by the next build. The content is an array of numbers, because C compilers need not accept long string literals.
function(sdm_embed output folder)
  set(table "")
  foreach(file ${ARGN})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${folder}/${file})
    file(READ ${folder}/${file} bytes HEX)
    string(REGEX REPLACE "(..)" "0x\\1," bytes "${bytes}")
    string(APPEND table "{\"${file}\", (const char[]){${bytes}0}},\n")
  endforeach()
  file(CONFIGURE OUTPUT ${output} CONTENT "${table}" @ONLY)
endfunction()
