# Embeds text files in a program, so that the program needs no files beside it.
# needlelab_embed(OUT FUNCTION FILE ...): writes a source file and sets OUT to its path. The source file defines
#   std::span<const needlelab::EmbeddedFile> needlelab::FUNCTION();      (common/base/program.h)
# This file is also the script that writes the source file:
#   cmake -DFILES="a;b" -DOUT=x.cpp -DFUNCTION=name -P NeedlelabEmbed.cmake
if(NOT CMAKE_SCRIPT_MODE_FILE)
  set(needlelab_embed_script "${CMAKE_CURRENT_LIST_FILE}")
  function(needlelab_embed out function)
    set(source "${CMAKE_CURRENT_BINARY_DIR}/${function}.cpp")
    add_custom_command(
      OUTPUT "${source}"
      COMMAND ${CMAKE_COMMAND} "-DFILES=${ARGN}" "-DOUT=${source}" "-DFUNCTION=${function}" -P "${needlelab_embed_script}"
      DEPENDS ${ARGN} "${needlelab_embed_script}"
      VERBATIM)
    set(${out} "${source}" PARENT_SCOPE)
  endfunction()
  return()
endif()

set(arrays "")
set(entries "")
set(number 0)
foreach(path IN LISTS FILES)
  get_filename_component(name "${path}" NAME)
  file(READ "${path}" hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(APPEND arrays "constexpr unsigned char kFile${number}_${FUNCTION}[] = {${bytes}0};\n")
  string(APPEND entries "    {\"${name}\", {reinterpret_cast<const char*>(kFile${number}_${FUNCTION}), sizeof(kFile${number}_${FUNCTION}) - 1}},\n")
  math(EXPR number "${number} + 1")
endforeach()
if(number EQUAL 0)
  set(body "std::span<const EmbeddedFile> ${FUNCTION}() { return {}; }")
else()
  set(body "std::span<const EmbeddedFile> ${FUNCTION}() {\n  static const EmbeddedFile kFiles[] = {\n${entries}  };\n  return kFiles;\n}")
endif()
file(WRITE "${OUT}.new" "#include <span>\n\n#include \"common/base/program.h\"\n\nnamespace needlelab {\nnamespace {\n${arrays}}  // namespace\n${body}\n}  // namespace needlelab\n")
file(COPY_FILE "${OUT}.new" "${OUT}" ONLY_IF_DIFFERENT)
file(REMOVE "${OUT}.new")
