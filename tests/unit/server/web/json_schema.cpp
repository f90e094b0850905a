#include "tests/unit/server/web/json_schema.h"

#include <algorithm>
#include <set>

namespace needlelab::test {
namespace {

using nlohmann::json;

bool isOfType(const std::string& type, const json& value) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "null") return value.is_null();
  if (type == "integer") return value.is_number_integer();
  return type == "number" && value.is_number();
}

std::string objectFault(const json& schema, const json& value, const json& root, const std::string& path) {
  for (const json& name : schema.value("required", json::array())) {
    if (!value.contains(name.get<std::string>())) return path + "." + name.get<std::string>() + " is missing";
  }
  if (schema.contains("maxProperties") && value.size() > schema["maxProperties"].get<std::size_t>())
    return path + " has members";
  const json known = schema.value("properties", json::object());
  for (const auto& [key, item] : value.items()) {
    std::string fault;
    if (known.contains(key)) {
      fault = schemaFault(known[key], item, root, path + "." + key);
    } else if (schema.contains("additionalProperties")) {
      const json& other = schema["additionalProperties"];
      if (other.is_boolean() && !other.get<bool>()) return path + "." + key + " is not described";
      if (other.is_object()) fault = schemaFault(other, item, root, path + "." + key);
    }
    if (!fault.empty()) return fault;
  }
  return {};
}

}  // namespace

std::string schemaFault(const json& schema, const json& value, const json& root, const std::string& path) {
  static const std::set<std::string> kUnderstood = {
      "type",  "enum",    "$ref",          "properties", "required",   "additionalProperties",
      "items", "minimum", "maxProperties", "format",     "description"};
  for (const auto& [key, rule] : schema.items()) {
    if (!kUnderstood.contains(key)) return path + ": the schema has '" + key + "', which is not understood";
  }
  if (schema.contains("$ref")) {
    const json::json_pointer where(schema["$ref"].get<std::string>().substr(1));
    return root.contains(where) ? schemaFault(root[where], value, root, path)
                                : path + ": " + schema["$ref"].get<std::string>() + " is not there";
  }
  if (schema.contains("type")) {
    const json types = schema["type"].is_array() ? schema["type"] : json::array({schema["type"]});
    const bool fits = std::any_of(types.begin(), types.end(),
                                  [&](const json& type) { return isOfType(type.get<std::string>(), value); });
    if (!fits) return path + " is " + value.dump().substr(0, 60) + ", not of type " + types.dump();
  }
  if (schema.contains("enum")) {
    const json& all = schema["enum"];
    if (std::find(all.begin(), all.end(), value) == all.end())
      return path + " is " + value.dump() + ", none of " + all.dump();
  }
  if (schema.contains("minimum") && value.is_number() && value < schema["minimum"])
    return path + " is too small";
  if (schema.value("format", "") == "uuid" && value.is_string() && !value.get<std::string>().empty() &&
      value.get<std::string>().size() != 36)
    return path + " is not a UUID: " + value.dump();
  if (value.is_object()) return objectFault(schema, value, root, path);
  if (value.is_array() && schema.contains("items")) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      const auto fault = schemaFault(schema["items"], value[i], root, path + "[" + std::to_string(i) + "]");
      if (!fault.empty()) return fault;
    }
  }
  return {};
}

json replySchema(const json& api, const std::string& method, const std::string& pattern, int status) {
  std::string lower = method;
  for (char& c : lower) c = static_cast<char>(std::tolower(c));
  if (!api["paths"].contains(pattern) || !api["paths"][pattern].contains(lower)) return nullptr;
  const json& replies = api["paths"][pattern][lower]["responses"];
  const std::string key = std::to_string(status);
  const json& reply = replies.contains(key) ? replies[key] : replies["default"];
  if (status >= 200 && status < 300 && !replies.contains(key)) return nullptr;
  if (!reply.contains("content") || !reply["content"].contains("application/json")) return nullptr;
  return reply["content"]["application/json"].value("schema", json(nullptr));
}

}  // namespace needlelab::test
