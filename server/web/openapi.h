/// The description of the API, made from the routes and the messages.
#pragma once

#include <string_view>

namespace needlelab {

/// OpenAPI 3.1 as JSON. Made at the first call; as long as the program lives.
std::string_view openApiText();

}  // namespace needlelab
