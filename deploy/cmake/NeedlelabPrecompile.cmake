# A build from nothing reads the same headers in every batch of files. With NEEDLELAB_UNITY they are read four times in
# all: for programs and for tests (whose own code is not optimised), each with the wire's headers and without.
# `dev` does without, so a missing #include shows there; so do the fuzzers, as what is passed here is GCC's.
#
# needlelab_precompile(FOLDER ...): to be called after every target of the FOLDERs is known

set(needlelab_std_headers
  <algorithm> <array> <atomic> <chrono> <cmath> <condition_variable> <cstdint> <cstdio> <cstdlib> <cstring> <deque>
  <filesystem> <fstream> <functional> <future> <iostream> <limits> <map> <memory> <mutex> <numbers> <optional> <random>
  <set> <span> <sstream> <string> <string_view> <thread> <unordered_map> <utility> <variant> <vector>
  <nlohmann/json.hpp>)
set(needlelab_wire_headers
  <boost/asio/any_io_executor.hpp> <boost/asio/awaitable.hpp> <boost/asio/co_spawn.hpp> <boost/asio/detached.hpp>
  <boost/asio/io_context.hpp> <boost/asio/ip/tcp.hpp> <boost/asio/post.hpp> <boost/asio/ssl.hpp>
  <boost/asio/steady_timer.hpp> <boost/asio/use_awaitable.hpp> <boost/asio/write.hpp>
  <needlelab/envelope.pb.h>)
set(needlelab_test_headers <gmock/gmock.h>)

# all that TARGET links, directly or not, goes to OUT
function(needlelab_closure target out)
  set(known)
  set(open ${target})
  while(open)
    list(POP_FRONT open next)
    if(NOT TARGET ${next})
      continue()
    endif()
    get_target_property(real ${next} ALIASED_TARGET)
    if(real)
      set(next ${real})
    endif()
    if(next IN_LIST known)
      continue()
    endif()
    list(APPEND known ${next})
    foreach(property LINK_LIBRARIES INTERFACE_LINK_LIBRARIES)
      get_target_property(links ${next} ${property})
      if(links)
        list(TRANSFORM links REPLACE "^[$]<LINK_ONLY:(.*)>$" "\\1")
        list(APPEND open ${links})
      endif()
    endforeach()
  endwhile()
  set(${out} ${known} PARENT_SCOPE)
endfunction()

# the target that compiles the headers for its KIND (program, test), WIRE or not
function(needlelab_precompile_host kind wire out)
  set(host needlelab_headers_${kind}${wire})
  set(${out} ${host} PARENT_SCOPE)
  if(TARGET ${host})
    return()
  endif()
  set(source "${CMAKE_BINARY_DIR}/precompiled/${host}.cpp")
  file(CONFIGURE OUTPUT "${source}" CONTENT "// for the headers' sake\n")
  add_library(${host} OBJECT "${source}")
  target_link_libraries(${host} PRIVATE needlelab_flags needlelab_warnings)
  set(headers ${needlelab_std_headers})
  if(wire)
    # not the wire itself, which is compiled with these headers, too
    target_link_libraries(${host} PRIVATE needlelab::proto Boost::headers OpenSSL::SSL)
    target_compile_definitions(${host} PRIVATE $<TARGET_PROPERTY:needlelab_wire,INTERFACE_COMPILE_DEFINITIONS>)
    list(APPEND headers ${needlelab_wire_headers})
  endif()
  if(kind STREQUAL "test")
    target_link_libraries(${host} PRIVATE GTest::gmock)
    target_compile_options(${host} PRIVATE ${needlelab_test_options})
    list(APPEND headers ${needlelab_test_headers})
  endif()
  # ccache wants to see it in the preprocessed text
  target_compile_options(${host} PRIVATE -fpch-preprocess)
  target_precompile_headers(${host} PRIVATE ${headers})
endfunction()

function(needlelab_precompile)
  get_directory_property(everywhere COMPILE_OPTIONS)
  foreach(folder ${ARGN})
    get_directory_property(below DIRECTORY "${folder}" SUBDIRECTORIES)
    needlelab_precompile(${below})
    get_directory_property(targets DIRECTORY "${folder}" BUILDSYSTEM_TARGETS)
    foreach(target ${targets})
      get_target_property(type ${target} TYPE)
      get_target_property(independent ${target} POSITION_INDEPENDENT_CODE)
      get_target_property(options ${target} COMPILE_OPTIONS)
      list(REMOVE_ITEM options ${everywhere} NOTFOUND options-NOTFOUND)
      get_target_property(links ${target} LINK_LIBRARIES)
      # a target with options of its own would need headers of its own
      if(NOT type MATCHES "^(STATIC_LIBRARY|EXECUTABLE)$" OR independent OR NOT "needlelab_warnings" IN_LIST links)
        continue()
      elseif(NOT options)
        set(kind program)
      elseif("${options}" STREQUAL "${needlelab_test_options}")
        set(kind test)
      else()
        continue()
      endif()
      needlelab_closure(${target} closure)
      set(wire "")
      if(needlelab_wire IN_LIST closure)
        set(wire _wire)
      endif()
      needlelab_precompile_host(${kind} "${wire}" host)
      target_compile_options(${target} PRIVATE -fpch-preprocess)
      target_precompile_headers(${target} REUSE_FROM ${host})
    endforeach()
  endforeach()
endfunction()
