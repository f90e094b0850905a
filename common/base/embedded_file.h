/// Text files that were put into the binary at build time (deploy/cmake/NeedlelabEmbed.cmake).
#pragma once

#include <string_view>

namespace needlelab {

struct EmbeddedFile {
  std::string_view name;  ///< without folder
  std::string_view text;
};

}  // namespace needlelab
