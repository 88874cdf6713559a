# Installs five shared libraries (libsdmgen: libc, libm and OpenMP alone; libsdmgen_image: zlib; libsdmgen_picture: cairo;
# libsdmgen_vdb: OpenVDB; libsdmgen_training: libyaml, cairo), the public headers, a CMake package, pkg-config files, configs and
# documentation.
include(CMakePackageConfigHelpers)

# folders of the headers, for users of the installed package and of the build folder
set(SDM_USER_HEADERS $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
foreach(folder framework runtime shapes trainer)
  list(APPEND SDM_USER_HEADERS $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/${folder}/include>)
endforeach()

# sdm_library(TARGET LANGUAGE OUTPUT NAME EXPORT NAME PARTS ... LINK ...): shared library
# libOUTPUT.so from the object files of the parts, exported as sdmgen::EXPORT
function(sdm_library target language)
  cmake_parse_arguments(LIB "" "OUTPUT;EXPORT" "PARTS;LINK" ${ARGN})
  list(TRANSFORM LIB_PARTS REPLACE "(.+)" "$<TARGET_OBJECTS:\\1>" OUTPUT_VARIABLE objects)
  add_library(${target} SHARED ${objects})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${LIB_OUTPUT} EXPORT_NAME ${LIB_EXPORT}
    LINKER_LANGUAGE ${language} VERSION ${PROJECT_VERSION}
    SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} INSTALL_RPATH "$ORIGIN"
    BUILD_RPATH_USE_ORIGIN ON) # the files of the build folder can be copied, too
  target_include_directories(${target} INTERFACE ${SDM_USER_HEADERS})
  target_link_libraries(${target} PRIVATE sdm_flags ${LIB_LINK})
  if(NOT SDM_SANITIZE)
    target_link_options(${target} PRIVATE LINKER:--no-undefined)
  endif()
  install(TARGETS ${target} EXPORT sdmgenTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
endfunction()

set(parts sdm_core sdm_geom sdm_nn sdm_io sdm_shape sdm_shapes sdm_runtime)
if(SDM_SHARED)
  sdm_library(sdmgen_shared C OUTPUT sdmgen EXPORT sdmgen PARTS ${parts} LINK ${SDM_LIBM}
    ${CMAKE_DL_LIBS} ${SDM_THREADS})
  # programs that use the library mostly call functions of math.h themselves
  target_link_libraries(sdmgen_shared INTERFACE ${SDM_LIBM})
endif()
if(TARGET sdm_image)
  sdm_library(sdmgen_image C OUTPUT sdmgen_image EXPORT image PARTS sdm_image LINK sdmgen_shared
    ZLIB::ZLIB ${SDM_LIBM})
  target_link_libraries(sdmgen_image INTERFACE sdmgen_shared)
endif()
if(SDM_PICTURE)
  sdm_library(sdmgen_picture C OUTPUT sdmgen_picture EXPORT picture PARTS sdm_picture LINK sdmgen_shared PkgConfig::CAIRO ${SDM_LIBM})
  target_link_libraries(sdmgen_picture INTERFACE sdmgen_shared)
endif()
if(SDM_VDB)
  sdm_library(sdmgen_vdb CXX OUTPUT sdmgen_vdb EXPORT vdb PARTS sdm_vdb LINK sdmgen_shared
    OpenVDB::openvdb)
  target_link_libraries(sdmgen_vdb INTERFACE sdmgen_shared)
endif()
if(TARGET sdm_trainer)
  # the training needs functions that libsdmgen does not export: it has its own, hidden copies of them
  sdm_library(sdmgen_training C OUTPUT sdmgen_training EXPORT training PARTS sdm_config sdm_trainer
    LINK sdmgen_shared sdm_picture sdm_shape sdm_io sdm_geom sdm_nn sdm_core PkgConfig::YAML ${SDM_LIBM})
  target_link_options(sdmgen_training PRIVATE LINKER:--exclude-libs,ALL)
  target_link_libraries(sdmgen_training INTERFACE sdmgen_shared)
endif()

# the same object files as a static library
if(SDM_STATIC)
  list(TRANSFORM parts REPLACE "(.+)" "$<TARGET_OBJECTS:\\1>" OUTPUT_VARIABLE objects)
  add_library(sdmgen_static STATIC ${objects})
  set_target_properties(sdmgen_static PROPERTIES OUTPUT_NAME sdmgen EXPORT_NAME static
    LINKER_LANGUAGE C)
  target_include_directories(sdmgen_static INTERFACE ${SDM_USER_HEADERS})
  target_link_libraries(sdmgen_static INTERFACE m ${CMAKE_DL_LIBS} ${SDM_THREADS}
    $<$<BOOL:${SDM_OPENMP}>:OpenMP::OpenMP_C>)
  if(CMAKE_SYSTEM_PROCESSOR STREQUAL wasm32)
    # the linker's default stack of 64 KiB is too small for the blocks of the matrix product; with
    # the stack first in memory an overflow traps
    target_link_options(sdmgen_static INTERFACE LINKER:-z,stack-size=1048576 LINKER:--stack-first)
    target_link_libraries(sdmgen_static INTERFACE wasi-emulated-getpid)
  endif()
  install(TARGETS sdmgen_static EXPORT sdmgenTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endif()

# plug-ins need only a header, no library
add_library(sdmgen_plugin INTERFACE)
set_target_properties(sdmgen_plugin PROPERTIES EXPORT_NAME plugin)
target_include_directories(sdmgen_plugin INTERFACE ${SDM_USER_HEADERS})
target_compile_features(sdmgen_plugin INTERFACE c_std_11)
install(TARGETS sdmgen_plugin EXPORT sdmgenTargets)

# headers for users; those in internal/ are between the parts of the project
foreach(folder framework runtime shapes trainer)
  if(IS_DIRECTORY ${PROJECT_SOURCE_DIR}/${folder}/include/sdm)
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder}/include/sdm
      DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h"
      PATTERN internal EXCLUDE PATTERN vdb.h EXCLUDE PATTERN train_file.h EXCLUDE)
  endif()
endforeach()
if(SDM_VDB)
  install(FILES ${PROJECT_SOURCE_DIR}/runtime/include/sdm/vdb.h
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sdm)
endif()
if(TARGET sdmgen_training)
  install(FILES ${PROJECT_SOURCE_DIR}/trainer/include/sdm/train_file.h
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sdm)
endif()

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/sdmgen)
install(EXPORT sdmgenTargets NAMESPACE sdmgen:: DESTINATION ${package})
# find_package(sdmgen) also finds the build folder
export(EXPORT sdmgenTargets NAMESPACE sdmgen:: FILE ${PROJECT_BINARY_DIR}/sdmgenTargets.cmake)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/sdmgenConfig.cmake.in
  ${PROJECT_BINARY_DIR}/sdmgenConfig.cmake
  INSTALL_DESTINATION ${package} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sdmgenConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sdmgenConfig.cmake
  ${PROJECT_BINARY_DIR}/sdmgenConfigVersion.cmake DESTINATION ${package})

# sdm_pkgconfig(NAME LIBRARY DESCRIPTION REQUIRES): writes and installs one pkg-config file
cmake_path(SET pkgconfig_folder NORMALIZE "/${CMAKE_INSTALL_LIBDIR}/pkgconfig")
cmake_path(RELATIVE_PATH pkgconfig_folder BASE_DIRECTORY "/" OUTPUT_VARIABLE pkgconfig_folder)
file(RELATIVE_PATH SDM_PC_UP "/${pkgconfig_folder}" "/")
string(REGEX REPLACE "/$" "" SDM_PC_UP "${SDM_PC_UP}")
function(sdm_pkgconfig SDM_PC_NAME SDM_PC_LIBRARY SDM_PC_DESCRIPTION SDM_PC_REQUIRES)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/sdmgen.pc.in ${PROJECT_BINARY_DIR}/${SDM_PC_NAME}.pc
    @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/${SDM_PC_NAME}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endfunction()
sdm_pkgconfig(sdmgen sdmgen "${PROJECT_DESCRIPTION}" "")
if(TARGET sdmgen_image)
  sdm_pkgconfig(sdmgen-image sdmgen_image "Image files of signed distance maps" sdmgen)
endif()
if(SDM_PICTURE)
  sdm_pkgconfig(sdmgen-picture sdmgen_picture "Pictures of signed distance maps" sdmgen)
endif()
if(SDM_VDB)
  sdm_pkgconfig(sdmgen-vdb sdmgen_vdb "OpenVDB level sets from signed distance maps" sdmgen)
endif()
if(TARGET sdmgen_training)
  sdm_pkgconfig(sdmgen-training sdmgen_training "Training of networks for signed distance maps" sdmgen)
endif()

# the Python package: it finds libsdmgen.so in the folder lib that it lies in, or on the system's path
if(SDM_SHARED)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/python/sdmgen DESTINATION lib/python3/dist-packages
    FILES_MATCHING PATTERN "*.py" PATTERN py.typed PATTERN __pycache__ EXCLUDE)
endif()

# the documentation and the examples, whose links lead to installed files
file(RELATIVE_PATH SDM_DOC_TO_DATA ${CMAKE_INSTALL_FULL_DOCDIR} ${CMAKE_INSTALL_FULL_DATADIR}/sdmgen)
file(RELATIVE_PATH SDM_DATA_TO_DOC ${CMAKE_INSTALL_FULL_DATADIR}/sdmgen ${CMAKE_INSTALL_FULL_DOCDIR})
file(RELATIVE_PATH SDM_DOC_TO_INCLUDE ${CMAKE_INSTALL_FULL_DOCDIR} ${CMAKE_INSTALL_FULL_INCLUDEDIR})
install(CODE "set(SOURCE \"${PROJECT_SOURCE_DIR}\")
set(TO \"${PROJECT_BINARY_DIR}/installed_docs\")
set(TO_EXAMPLES \"${PROJECT_BINARY_DIR}/installed_examples\")
set(DOCS \"${SDM_DATA_TO_DOC}\")
set(EXAMPLES \"${SDM_DOC_TO_DATA}\")
set(INCLUDE \"${SDM_DOC_TO_INCLUDE}\")
include(\"${PROJECT_SOURCE_DIR}/cmake/installed_docs.cmake\")")
install(DIRECTORY ${PROJECT_BINARY_DIR}/installed_docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY ${PROJECT_BINARY_DIR}/installed_examples/ DESTINATION ${CMAKE_INSTALL_DATADIR}/sdmgen
  PATTERN *.slurm PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

# bill of materials in SPDX 2.3; its time is SOURCE_DATE_EPOCH where that is set
string(TIMESTAMP SDM_SPDX_TIME "%Y-%m-%dT%H:%M:%SZ" UTC)
configure_file(${PROJECT_SOURCE_DIR}/cmake/sdmgen.spdx.in ${PROJECT_BINARY_DIR}/sdmgen.spdx @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/sdmgen.spdx DESTINATION ${CMAKE_INSTALL_DOCDIR})
