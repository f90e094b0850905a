/// The description of the API (openapi.json beside this file), as it travels inside the program.
#pragma once

#include <span>
#include <string_view>

#include "common/base/program.h"

namespace needlelab {

/// openapi.json. Written at build time (deploy/cmake/NeedlelabEmbed.cmake).
std::span<const EmbeddedFile> embeddedApi();

/// OpenAPI 3.1 as JSON.
inline std::string_view openApiText() {
  return embeddedApi().front().text;
}

}  // namespace needlelab
