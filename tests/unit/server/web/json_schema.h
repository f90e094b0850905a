/// Implements the part of JSON Schema used by the API description: type, enum, $ref, properties, required,
/// additionalProperties, items, minimum, maxProperties, format uuid. Anything else in a schema is an error.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace needlelab::test {

/// Returns the mismatch, beginning with its path, or an empty string if the value fits. `root` resolves $ref.
std::string schemaFault(const nlohmann::json& schema, const nlohmann::json& value, const nlohmann::json& root,
                        const std::string& path = "$");

/// Returns the schema of a reply from the API description, or null if there is none. `pattern` excludes the
/// base path.
nlohmann::json replySchema(const nlohmann::json& api, const std::string& method, const std::string& pattern,
                           int status);

}  // namespace needlelab::test
