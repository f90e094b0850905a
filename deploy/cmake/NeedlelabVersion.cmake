# Writes the program's version into a source file: "1.0.0~git20261129.4bd1e890", from git or, in an archive of the sources
# (git archive, a source package), from deploy/version.txt. The script runs at each build; the file changes with the version.
if(NOT CMAKE_SCRIPT_MODE_FILE)
  set(needlelab_version_command ${CMAKE_COMMAND} -D SOURCE=${CMAKE_SOURCE_DIR} -D NUMBER=${PROJECT_VERSION}
    -D FILE=${CMAKE_BINARY_DIR}/program_version.cpp -P ${CMAKE_CURRENT_LIST_FILE})
  execute_process(COMMAND ${needlelab_version_command} COMMAND_ERROR_IS_FATAL ANY)
  add_custom_target(needlelab_version COMMAND ${needlelab_version_command}
    BYPRODUCTS "${CMAKE_BINARY_DIR}/program_version.cpp" COMMENT "" VERBATIM)
  return()
endif()

set(version "${NUMBER}")
file(READ "${SOURCE}/deploy/version.txt" commit)
set(changed "")
if(EXISTS "${SOURCE}/.git")
  # another user's clone is fine: nothing of it is run
  set(git git -c safe.directory=* -C "${SOURCE}")
  execute_process(COMMAND ${git} log -1 "--format=%cs %H" OUTPUT_VARIABLE commit ERROR_QUIET)
  execute_process(COMMAND ${git} status --porcelain -uno -- CMakeLists.txt client common db proto server deploy/cmake
    OUTPUT_VARIABLE changed ERROR_QUIET)
endif()
if(commit MATCHES "^([0-9]+)-([0-9]+)-([0-9]+) ([0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f])")
  string(APPEND version "~git${CMAKE_MATCH_1}${CMAKE_MATCH_2}${CMAKE_MATCH_3}.${CMAKE_MATCH_4}")
endif()
if(changed)
  string(APPEND version "+changed")
endif()
if(NOT FILE)
  message("${version}")
  return()
endif()
set(text "#include \"common/base/program.h\"

namespace needlelab {

std::string programVersion() {
  return \"${version}\";
}

}  // namespace needlelab
")
set(before "")
if(EXISTS "${FILE}")
  file(READ "${FILE}" before)
endif()
if(NOT before STREQUAL text)
  file(WRITE "${FILE}" "${text}")
endif()
