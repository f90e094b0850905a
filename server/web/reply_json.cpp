#include <fmt/core.h>
#include <cmath>
#include <utility>

#include "common/base/text/strict_json.h"
#include "common/base/text/uuid.h"
#include "common/profile/message_json.h"
#include "server/web/web_call.h"

namespace needlelab {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

constexpr std::string_view kNsSuffix = "_unix_ns", kMsSuffix = "_unix_ms", kJsonSuffix = "_json";

std::string hexText(const std::string& bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

WebJson bytesJson(const FieldDescriptor& field, const std::string& bytes) {
  if (field.name() == "next_page") return base64Url(bytes);
  Uuid id;
  const bool is_session = field.name() == "session_id" || field.name() == "session_ids";
  if (!is_session || bytes.size() != id.size()) return hexText(bytes);
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return uuidText(id);
}

WebJson numberJson(double value) {
  return std::isfinite(value) ? WebJson(value) : WebJson(nullptr);
}

WebJson fieldJson(const Message& message, const FieldDescriptor& field, int index) {
  const auto& reflection = *message.GetReflection();
  const bool is_list = field.is_repeated();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return numberJson(is_list ? reflection.GetRepeatedDouble(message, &field, index)
                                : reflection.GetDouble(message, &field));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return numberJson(static_cast<double>(is_list ? reflection.GetRepeatedFloat(message, &field, index)
                                                    : reflection.GetFloat(message, &field)));
    case FieldDescriptor::CPPTYPE_INT32:
      return is_list ? reflection.GetRepeatedInt32(message, &field, index)
                     : reflection.GetInt32(message, &field);
    case FieldDescriptor::CPPTYPE_UINT32:
      return is_list ? reflection.GetRepeatedUInt32(message, &field, index)
                     : reflection.GetUInt32(message, &field);
    case FieldDescriptor::CPPTYPE_INT64:
      return is_list ? reflection.GetRepeatedInt64(message, &field, index)
                     : reflection.GetInt64(message, &field);
    case FieldDescriptor::CPPTYPE_UINT64:
      return is_list ? reflection.GetRepeatedUInt64(message, &field, index)
                     : reflection.GetUInt64(message, &field);
    case FieldDescriptor::CPPTYPE_BOOL:
      return is_list ? reflection.GetRepeatedBool(message, &field, index)
                     : reflection.GetBool(message, &field);
    case FieldDescriptor::CPPTYPE_ENUM:
      return (is_list ? reflection.GetRepeatedEnum(message, &field, index)
                      : reflection.GetEnum(message, &field))
          ->name();
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string text = is_list ? reflection.GetRepeatedString(message, &field, index)
                                       : reflection.GetString(message, &field);
      return field.type() == FieldDescriptor::TYPE_BYTES ? bytesJson(field, text) : WebJson(text);
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return jsonOf(is_list ? reflection.GetRepeatedMessage(message, &field, index)
                            : reflection.GetMessage(message, &field));
  }
  return nullptr;
}

/// Parses a text that contains JSON.
WebJson innerJson(const std::string& text) {
  WebJson inner = readShallowJson<WebJson>(text);
  if (!inner.is_discarded()) return inner;
  return text.empty() ? WebJson(nullptr) : WebJson(text);
}

void addField(WebJson& object, const Message& message, const FieldDescriptor& field) {
  const auto& reflection = *message.GetReflection();
  const std::string& name = field.name();
  if (field.is_repeated()) {
    WebJson list = WebJson::array();
    const int size = reflection.FieldSize(message, &field);
    const bool of_json = name == "records";
    for (int i = 0; i < size; ++i) {
      list.push_back(of_json ? innerJson(reflection.GetRepeatedString(message, &field, i))
                             : fieldJson(message, field, i));
    }
    object[name] = std::move(list);
    return;
  }
  // omit absent fields; numbers and texts without presence are always written
  if (field.has_presence() && !reflection.HasField(message, &field)) return;
  // includes the name "unix_ns"
  if (field.cpp_type() == FieldDescriptor::CPPTYPE_INT64 && ("_" + name).ends_with(kNsSuffix)) {
    const std::int64_t ns = reflection.GetInt64(message, &field);
    // 0: has not happened
    object[name.substr(0, name.size() - 2) + "ms"] =
        ns == 0 ? WebJson(nullptr) : WebJson(static_cast<double>(ns) / 1e6);
    return;
  }
  if (field.type() == FieldDescriptor::TYPE_STRING && (name == "json" || name.ends_with(kJsonSuffix))) {
    object[name == "json" ? name : name.substr(0, name.size() - kJsonSuffix.size())] =
        innerJson(reflection.GetString(message, &field));
    return;
  }
  object[name] = fieldJson(message, field, 0);
}

Status timesToNs(nlohmann::json& value, const std::string& path) {
  if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      RETURN_IF_ERROR(timesToNs(value[i], fmt::format("{}[{}]", path, i)));
    }
    return {};
  }
  if (!value.is_object()) return {};
  std::vector<std::string> times;
  for (auto& [key, item] : value.items()) {
    const std::string at = path.empty() ? key : path + "." + key;
    if (key.ends_with(kMsSuffix)) times.push_back(key);
    RETURN_IF_ERROR(timesToNs(item, at));
  }
  for (const std::string& key : times) {
    const std::string at = path.empty() ? key : path + "." + key;
    const nlohmann::json& item = value[key];
    if (item.is_null()) {  // never happens
      value.erase(key);
      continue;
    }
    // ns reach only to the year 2262
    if (!item.is_number() || !(std::abs(item.get<double>()) < 9.2e12))
      return Error{ErrorCode::kInvalidInput, at + ": must be a time in milliseconds since 1970"};
    const auto ns = static_cast<std::int64_t>(std::llround(item.get<double>() * 1e6));
    value.erase(key);
    value[key.substr(0, key.size() - 2) + "ns"] = ns;
  }
  return {};
}

}  // namespace

WebJson jsonOf(const Message& message) {
  WebJson object = WebJson::object();
  const auto& type = *message.GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) addField(object, message, *type.field(i));
  return object;
}

Status messageOf(nlohmann::json body, Message& message) {
  RETURN_IF_ERROR(timesToNs(body, ""));
  return readMessage(body, message);
}

Result<std::string> sessionBytesOf(const std::string& text) {
  const auto id = parseUuid(text);
  if (!id) return Error{ErrorCode::kNotFound, "there is no session '" + text.substr(0, 60) + "'"};
  return std::string(id->begin(), id->end());
}

Result<std::string> pageOf(const std::string& text) {
  auto bytes = bytesOfBase64Url(text);
  if (!bytes) return Error{ErrorCode::kInvalidInput, "page: give back the next_page of the reply before"};
  return std::move(*bytes);
}

}  // namespace needlelab
