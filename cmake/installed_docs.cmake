# Run by the installation: copies the documentation to TO and turns links to files of the source tree into links to installed
# files, or into plain text where the file is not installed. SOURCE: the source tree; EXAMPLES, INCLUDE: the paths of the installed
# examples and headers relative to the folder of README.md; DOCS: the path of this folder relative to that of the examples. The
# examples are copied to TO_EXAMPLES.
file(REMOVE_RECURSE "${TO}")
file(COPY "${SOURCE}/docs" "${SOURCE}/README.md" "${SOURCE}/CHANGELOG.md" DESTINATION "${TO}")
file(GLOB_RECURSE pages RELATIVE "${TO}" "${TO}/*.md")
foreach(page IN LISTS pages)
  # the way up from the page to the folder of README.md, in the source tree and in the installation
  get_filename_component(folder "${page}" DIRECTORY)
  string(REGEX REPLACE "[^/]+" ".." up "${folder}")
  if(up)
    string(APPEND up "/")
  endif()
  string(REPLACE "." "[.]" up_pattern "${up}")
  file(READ "${TO}/${page}" text)
  string(REGEX REPLACE "\\]\\(${up_pattern}(examples|configs)([/)])" "](${up}${EXAMPLES}/\\1\\2" text "${text}")
  string(REGEX REPLACE "\\]\\(${up_pattern}(framework|runtime|trainer)/include/sdm/([a-z_]+[.]h)\\)"
                       "](${up}${INCLUDE}/sdm/\\2)" text "${text}")
  string(REGEX REPLACE "\\[([^]]*)\\]\\(${up_pattern}(bench|cli|cmake|framework|page|python|runtime|shapes|tests|trainer)[^)]*\\)"
                       "\\1" text "${text}")
  file(WRITE "${TO}/${page}" "${text}")
endforeach()
file(REMOVE_RECURSE "${TO_EXAMPLES}")
file(COPY "${SOURCE}/configs" "${SOURCE}/examples" DESTINATION "${TO_EXAMPLES}")
file(GLOB pages "${TO_EXAMPLES}/examples/*/*.md")
foreach(page IN LISTS pages)
  file(READ "${page}" text)
  string(REPLACE "](../../docs/" "](../../${DOCS}/docs/" text "${text}")
  file(WRITE "${page}" "${text}")
endforeach()
