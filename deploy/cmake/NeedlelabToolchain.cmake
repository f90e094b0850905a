# Compiler, warnings, sanitizers, ccache and linker: the settings of every target.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")
# Most of the code waits for a disk, a network or a person: -O1 is enough, and compiles a little faster than -O2. Processor
# time of net, db, service and server_live: 102.2 s instead of 108.6 s (6 %); of service alone 56.6 s instead of 57.9 s. Code
# in the haptic tick or that computes for long is marked OPTIMISED (NeedlelabTargets.cmake) and gets -O2.
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1 -DNDEBUG")
set(CMAKE_CXX_FLAGS_DEBUG "-O0 -g1")
# For a clone's demo and the tests, which compile more than they run. OPTIMISED code is that of a release.
set(CMAKE_CXX_FLAGS_QUICK "-O0 -DNDEBUG")
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # valgrind 3.19 cannot read the version 5 of Clang 14. Alone, -gdwarf-4 would mean -g2: server_live
  # took 41.6 s at -O0 instead of 20.7 s
  add_compile_options("$<$<NOT:$<CONFIG:Quick>>:-gdwarf-4;-g1>")
  string(APPEND CMAKE_CXX_FLAGS_RELWITHDEBINFO " -gno-inline-line-tables")  # a fifth of a file's compile time
endif()
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "" FORCE)
endif()

# A release: no path of the computer that built it, a check of the stack and of copies into buffers, addresses that are
# bound before the program starts.
add_compile_options("$<$<CONFIG:RelWithDebInfo>:-ffile-prefix-map=${CMAKE_SOURCE_DIR}/=;-fstack-protector-strong>")
add_compile_definitions($<$<CONFIG:RelWithDebInfo>:_FORTIFY_SOURCE=2>)
add_link_options("$<$<CONFIG:RelWithDebInfo>:-Wl,-z,relro,-z,now>" -Wl,--as-needed)

find_program(NEEDLELAB_CCACHE ccache)
if(NEEDLELAB_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # Without these, ccache does not cache files that use precompiled headers (none of our sources uses __TIME__).
  set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env CCACHE_SLOPPINESS=pch_defines,time_macros "${NEEDLELAB_CCACHE}")
endif()
find_program(NEEDLELAB_MOLD mold)
if(NEEDLELAB_MOLD)
  add_link_options(-fuse-ld=mold "$<$<CONFIG:RelWithDebInfo>:-Wl,--gc-sections,--icf=safe>")
endif()

add_library(needlelab_flags INTERFACE)
target_include_directories(needlelab_flags INTERFACE "${CMAKE_SOURCE_DIR}")
# common/wire/asio_impl.cpp compiles Asio once; all other files only see declarations.
target_compile_definitions(needlelab_flags INTERFACE BOOST_ASIO_SEPARATE_COMPILATION BOOST_ASIO_NO_DEPRECATED)
# Same inputs, same bits: no contraction into fused multiply-adds, no fast-math.
target_compile_options(needlelab_flags INTERFACE -ffp-contract=off)
add_library(needlelab_warnings INTERFACE)
target_compile_options(needlelab_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wold-style-cast -Wformat=2
  -Wdouble-promotion -Wcast-qual -Wimplicit-fallthrough)
option(NEEDLELAB_WARNINGS_AS_ERRORS "A warning fails the build; OFF for compilers that warn of more than GCC 12" ON)
if(NEEDLELAB_WARNINGS_AS_ERRORS)
  target_compile_options(needlelab_warnings INTERFACE -Werror)
endif()
# When GCC 12 optimises, it wrongly warns of mismatched new/delete for Asio's coroutine frames, which have their own
# allocator (GCC bug 103993 and similar ones).
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(needlelab_warnings INTERFACE -Wno-mismatched-new-delete)
endif()

# The presets that build a fresh checkout compile the files of a target in batches (CMAKE_UNITY_BUILD) and reuse
# precompiled headers (DECISIONS.md). `dev` does neither, so it finds a missing #include.
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # A batch allocates a gigabyte: with a larger heap from the start GCC collects garbage less often.
  add_compile_options(--param=ggc-min-heapsize=600000 --param=ggc-min-expand=400)
  # GCC gives this warning for each coroutine frame with a local type when a batch includes the file.
  target_compile_options(needlelab_warnings INTERFACE -Wno-subobject-linkage)
endif()
option(NEEDLELAB_PRECOMPILE "Compile the headers that most files read once" OFF)
if(NEEDLELAB_PRECOMPILE AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC 12 wrongly reports a buffer overrun in operator+ of <string> (GCC bug 105651); when the header is precompiled,
  # it no longer treats it as a system header.
  target_compile_options(needlelab_warnings INTERFACE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
endif()

if(NEEDLELAB_SANITIZE)
  # At -O0 a file of db/service compiles in 26 s instead of 37 s. Targets that compute for long are marked OPTIMISED and
  # get -O1.
  add_compile_options(-fsanitize=${NEEDLELAB_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${NEEDLELAB_SANITIZE})
  # ASan already finds accesses through a null pointer or beyond an object, and we hardly cast classes. Without UBSan's checks
  # for these, OPTIMISED code compiles in 89 % of the time and runs in 96 % (haptics_test); for other code nothing changes.
  if(NEEDLELAB_SANITIZE MATCHES "undefined")
    add_compile_options(-fno-sanitize=null,object-size,vptr)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    # Coroutines and Clang 14's check of function types do not work together.
    add_compile_options(-fno-sanitize=function)
  else()
    # The branches of the checks make GCC report uninitialised members in <regex> and similar headers; the release
    # build looks for real ones.
    target_compile_options(needlelab_warnings INTERFACE -Wno-maybe-uninitialized)
    if(NEEDLELAB_SANITIZE MATCHES "thread")
      target_compile_options(needlelab_warnings INTERFACE -Wno-tsan)
    endif()
  endif()
endif()

# Every file is instrumented, so that the fuzzer sees its coverage; asserts stay on. Function types: as above.
if(NEEDLELAB_FUZZ STREQUAL "coverage")
  add_compile_options(-fprofile-instr-generate -fcoverage-mapping -O1 -UNDEBUG)
  add_link_options(-fprofile-instr-generate -fuse-ld=bfd)
elseif(NEEDLELAB_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize=function -fno-sanitize-recover=all
    -fno-omit-frame-pointer -O1 -UNDEBUG)
  add_link_options(-fsanitize=address,undefined -fuse-ld=bfd)
endif()
