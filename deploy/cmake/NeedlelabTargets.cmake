# needlelab_library(NAME [OPTIMISED | TOOL] [INSTALLED] SOURCES ... DEPS ...)  -> needlelab_NAME, alias needlelab::NAME
#   OPTIMISED: runs in the haptic tick or computes for long: -O2 in a release build (others: -O1) and a quick one (others:
#   -O0), -O1 under a sanitizer (others: -O0). It has options of its own, so it cannot reuse precompiled headers.
#   TOOL: only tests use it and time nothing with it, so it is compiled like a test
#   INSTALLED: also part of a shared library (common/library): position-independent, its symbols hidden. No precompiled
#   headers: they put symbols of Asio and OpenSSL into each object
# needlelab_program(NAME [TOOL] SOURCES ... DEPS ...)       -> executable NAME in bin/
# needlelab_test(NAME LABEL unit [threads] SOURCES ... DEPS ...)  -> GoogleTest program, one test of ctest: a start takes longer than
#   most tests
#   LANE n: of the programs that start others (net without unit) one runs at a time in each lane [1]
#   SHARDS n: n tests of ctest with every n-th test each; for programs of more than a minute
#   SHORT: the tests (patterns) that deploy/test runs; NAME_whole runs all of them in the nightly (ctest -C Long)
#   NUMBERS: tests (patterns) that repeat the same code for the sake of numbers, minutes under a sanitizer: there only
#   deploy/test --asan runs them, as NAME_numbers
#   OPTIMISED: its own code computes for long, so it is compiled like a library
#   COST: instead of TIMEOUT, if a long form needs the limit: tests that may take longest begin first
#   Tests of an area with the same labels share a program (DECISIONS.md).
#   labels: unit, net, determinism give the kind of test; threads: runs under ThreadSanitizer in .ci/run; memory: runs under
#   AddressSanitizer and UBSan there (code that reads or keeps bytes from outside, or works on the haptic thread)
# needlelab_missing(NAME REASON)  -> a test that is skipped for REASON, instead of tests that cannot be built or run here
#
# Headers are included by their path from the top, "common/haptics/engine.h". ARCHITECTURE.md lists the includes that are
# allowed between folders, and tests/structure checks them.

function(needlelab_optimise target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:RelWithDebInfo,Quick>:-O2>)
  if(NEEDLELAB_SANITIZE)
    target_compile_options(${target} PRIVATE -O1)
  endif()
endfunction()

function(needlelab_install_in_library target)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
endfunction()

function(needlelab_library name)
  cmake_parse_arguments(ARG "OPTIMISED;TOOL;INSTALLED" "" "SOURCES;DEPS" ${ARGN})
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "needlelab_library(${name}): unknown ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  set(target needlelab_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(needlelab::${name} ALIAS ${target})
  target_link_libraries(${target} PUBLIC needlelab_flags ${ARG_DEPS} PRIVATE needlelab_warnings)
  if(ARG_INSTALLED)
    needlelab_install_in_library(${target})
  endif()
  if(ARG_OPTIMISED)
    needlelab_optimise(${target})
  elseif(ARG_TOOL AND TARGET GTest::gmock)
    needlelab_compile_as_test(${target})
  elseif(NOT ARG_INSTALLED)
    needlelab_reuse_headers(${target} needlelab_program_headers)
  endif()
endfunction()

function(needlelab_program name)
  cmake_parse_arguments(ARG "TOOL" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE needlelab_flags needlelab_warnings ${ARG_DEPS})
  if(ARG_TOOL AND TARGET GTest::gmock)
    needlelab_compile_as_test(${name})
  else()
    needlelab_reuse_headers(${name} needlelab_program_headers)
  endif()
endfunction()

function(needlelab_missing name reason)
  add_test(NAME ${name} COMMAND sh -c "echo \"skipped: $0\"; exit 77" "${reason}")
  set_tests_properties(${name} PROPERTIES LABELS unit SKIP_RETURN_CODE 77)
endfunction()

# A test's own code runs briefly: without optimisation it compiles in two thirds of the time, without line tables in
# four fifths of that. The tested code keeps its -O2.
set(needlelab_test_options $<$<CONFIG:RelWithDebInfo>:-O0> $<$<CONFIG:RelWithDebInfo>:-g0>
  $<$<CONFIG:RelWithDebInfo>:-U_FORTIFY_SOURCE>)  # it wants an optimised build
# UBSan doubles the compile time of a test's own code, so only the tested code gets it; ASan covers both.
if(NEEDLELAB_SANITIZE MATCHES "undefined")
  list(APPEND needlelab_test_options -fno-sanitize=undefined)
endif()
function(needlelab_compile_as_test target)
  target_compile_options(${target} PRIVATE ${needlelab_test_options})
  target_link_libraries(${target} PRIVATE GTest::gmock)  # what the precompiled headers need
  needlelab_reuse_headers(${target} needlelab_test_headers)
endfunction()
add_custom_target(needlelab_threaded_tests)
add_custom_target(needlelab_memory_tests)
add_custom_target(needlelab_determinism_tests)
function(needlelab_test name)
  cmake_parse_arguments(ARG "OPTIMISED" "TIMEOUT;COST;SHARDS;LANE" "LABEL;SHORT;NUMBERS;SOURCES;DEPS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  if(NOT ARG_COST)
    set(ARG_COST ${ARG_TIMEOUT})
  endif()
  # A machine four times slower keeps the TIMEOUT too: only a hang misses it.
  math(EXPR ARG_TIMEOUT "4 * ${ARG_TIMEOUT}")
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE needlelab_flags needlelab_warnings ${ARG_DEPS} GTest::gmock GTest::gtest_main)
  if(ARG_OPTIMISED)
    needlelab_optimise(${name})
  else()
    needlelab_compile_as_test(${name})
  endif()
  if("threads" IN_LIST ARG_LABEL)
    add_dependencies(needlelab_threaded_tests ${name})
  endif()
  if("memory" IN_LIST ARG_LABEL)
    add_dependencies(needlelab_memory_tests ${name})
  endif()
  if("determinism" IN_LIST ARG_LABEL)
    add_dependencies(needlelab_determinism_tests ${name})
  endif()
  # One label such as unit-net-threads: ctest selects by regular expression.
  string(JOIN "-" label ${ARG_LABEL})
  if(NEEDLELAB_SANITIZE)
    math(EXPR ARG_TIMEOUT "10 * ${ARG_TIMEOUT}")
  endif()
  # OpenBLAS's threads spin while they wait for each other: beside the other tests they take more of the processor than
  # the test. Whole programs (net) run as users run them, and wait more than they compute: they begin first, one in each lane.
  if("net" IN_LIST ARG_LABEL AND NOT "unit" IN_LIST ARG_LABEL)
    if(NOT ARG_LANE)
      set(ARG_LANE 1)
    endif()
    math(EXPR ARG_COST "3000 + ${ARG_COST}")
    set(properties RESOURCE_LOCK lane-${ARG_LANE})
  elseif(NOT "net" IN_LIST ARG_LABEL)
    set(properties ENVIRONMENT OPENBLAS_NUM_THREADS=1)
  endif()
  # Tests that may take longest begin first, or they would run alone at the end.
  list(APPEND properties LABELS "${label}" TIMEOUT ${ARG_TIMEOUT} COST ${ARG_COST})
  set(filter "")
  if(ARG_SHORT)
    string(JOIN ":" short ${ARG_SHORT})
    set(filter "--gtest_filter=${short}")
    add_test(NAME ${name}_whole CONFIGURATIONS Long COMMAND ${name})
    set_tests_properties(${name}_whole PROPERTIES ${properties})
  endif()
  if(ARG_NUMBERS AND NEEDLELAB_SANITIZE)
    string(JOIN ":" numbers ${ARG_NUMBERS})
    set(filter "--gtest_filter=-${numbers}")
    add_test(NAME ${name}_numbers CONFIGURATIONS Numbers COMMAND ${name} "--gtest_filter=${numbers}")
    set_tests_properties(${name}_numbers PROPERTIES ${properties})
  endif()
  if(NOT ARG_SHARDS)
    add_test(NAME ${name} COMMAND ${name} ${filter})
    set_tests_properties(${name} PROPERTIES ${properties})
    return()
  endif()
  math(EXPR last "${ARG_SHARDS} - 1")
  foreach(shard RANGE ${last})
    add_test(NAME ${name}.${shard} COMMAND ${CMAKE_COMMAND} -E env GTEST_TOTAL_SHARDS=${ARG_SHARDS} GTEST_SHARD_INDEX=${shard} $<TARGET_FILE:${name}> ${filter})
    set_tests_properties(${name}.${shard} PROPERTIES ${properties})
  endforeach()
endfunction()
