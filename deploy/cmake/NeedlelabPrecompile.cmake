# A clean build parses the standard library, JSON, Asio, the messages and gmock in hundreds of files. These two targets
# compile them once, for the programs and for the tests; needlelab_library, needlelab_program and needlelab_test reuse
# them. The preset `dev` does not use precompiled headers, so it finds a missing #include.
# ccache needs them
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  set(needlelab_precompile_options "SHELL:-Xclang -fno-pch-timestamp")
else()
  set(needlelab_precompile_options -fpch-preprocess)
endif()
function(needlelab_headers name)
  cmake_parse_arguments(ARG "" "" "OPTIONS;DEPS;HEADERS" ${ARGN})
  set(source "${CMAKE_BINARY_DIR}/precompiled/${name}.cpp")
  file(CONFIGURE OUTPUT "${source}" CONTENT "// compiled for its headers\n")
  add_library(${name} OBJECT "${source}")
  target_link_libraries(${name} PRIVATE needlelab_flags needlelab_warnings fmt::fmt needlelab::proto ${ARG_DEPS})
  target_compile_options(${name} PRIVATE ${ARG_OPTIONS} ${needlelab_precompile_options})
  target_precompile_headers(${name} PRIVATE
    <algorithm> <array> <atomic> <chrono> <cmath> <condition_variable> <cstdint> <cstdio> <cstdlib> <cstring> <deque>
    <filesystem> <fstream> <functional> <future> <iostream> <limits> <map> <memory> <mutex> <numbers> <optional> <random>
    <set> <span> <sstream> <string> <string_view> <thread> <unordered_map> <utility> <variant> <vector>
    <fmt/core.h> <nlohmann/json.hpp> "${CMAKE_SOURCE_DIR}/common/wire/asio.h" <needlelab/envelope.pb.h> ${ARG_HEADERS})
endfunction()

# TARGET has the compile options of HEADERS and reuses its precompiled headers.
function(needlelab_reuse_headers target headers)
  if(NEEDLELAB_PRECOMPILE)
    target_compile_options(${target} PRIVATE ${needlelab_precompile_options})
    target_precompile_headers(${target} REUSE_FROM ${headers})
    # what the headers' definitions and static objects need
    target_link_libraries(${target} PRIVATE fmt::fmt needlelab::asio needlelab::proto)
  endif()
endfunction()

if(NEEDLELAB_PRECOMPILE)
  needlelab_headers(needlelab_program_headers)
  if(NEEDLELAB_BUILD_TESTS)
    needlelab_headers(needlelab_test_headers OPTIONS ${needlelab_test_options} DEPS GTest::gmock HEADERS <gmock/gmock.h>)
  endif()
endif()
