/// As much of JSON Schema as the description of the API uses: type, enum, $ref, properties, required,
/// additionalProperties, items, minimum, maxProperties, format uuid. Anything else in a schema is a fault.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace needlelab::test {

/// What does not fit, beginning with its path; empty: it fits. `root`: where $ref looks.
std::string schemaFault(const nlohmann::json& schema, const nlohmann::json& value, const nlohmann::json& root,
                        const std::string& path = "$");

/// The schema of a reply in the description of the API, null when there is none; `pattern` without the base.
nlohmann::json replySchema(const nlohmann::json& api, const std::string& method, const std::string& pattern,
                           int status);

}  // namespace needlelab::test
