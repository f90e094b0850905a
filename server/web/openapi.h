/// The API's OpenAPI description, generated from the routes and the messages.
#pragma once

#include <string_view>

namespace needlelab {

/// OpenAPI 3.1 as JSON. Generated on the first call; valid until the program ends.
std::string_view openApiText();

}  // namespace needlelab
