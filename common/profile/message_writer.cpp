#include "common/base/range.h"
#include "common/profile/message_json.h"
#include "needlelab/options.pb.h"

namespace needlelab {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using nlohmann::json;

constexpr std::size_t kLineLength = 110;

std::string textJson(const std::string& text) {
  return json(text).dump(-1, ' ', false, json::error_handler_t::replace);
}

/// One line when that is short and nothing in it is broken already, else one item a line.
std::string wrapped(char open, char close, const std::vector<std::string>& items, std::size_t indent) {
  if (items.empty()) return {open, close};
  std::size_t length = indent + 2;
  bool broken = false;
  for (const std::string& item : items) {
    length += item.size() + 2;
    broken = broken || item.find('\n') != std::string::npos;
  }
  const bool one_line = !broken && length <= kLineLength;
  const std::string between = one_line ? ", " : ",\n" + std::string(indent + 2, ' ');
  std::string all = one_line ? "" : "\n" + std::string(indent + 2, ' ');
  for (std::size_t i = 0; i < items.size(); ++i) all += (i == 0 ? "" : between) + items[i];
  return open + all + (one_line ? "" : "\n" + std::string(indent, ' ')) + close;
}

std::string objectJson(const Message& message, std::size_t indent);

/// A single field, or item `index` of a list.
std::string valueJson(const Message& message, const FieldDescriptor& field, int index, std::size_t indent) {
  const auto& reflection = *message.GetReflection();
  const bool is_list = field.is_repeated();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return numberText(is_list ? reflection.GetRepeatedDouble(message, &field, index)
                                : reflection.GetDouble(message, &field) + 0.0);
    case FieldDescriptor::CPPTYPE_INT32:
      return std::to_string(reflection.GetInt32(message, &field));
    case FieldDescriptor::CPPTYPE_UINT32:
      return std::to_string(reflection.GetUInt32(message, &field));
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection.GetBool(message, &field) ? "true" : "false";
    case FieldDescriptor::CPPTYPE_STRING:
      return textJson(is_list ? reflection.GetRepeatedString(message, &field, index)
                              : reflection.GetString(message, &field));
    case FieldDescriptor::CPPTYPE_ENUM:
      return textJson(
          (is_list ? reflection.GetRepeatedEnum(message, &field, index) : reflection.GetEnum(message, &field))
              ->name());
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return objectJson(is_list ? reflection.GetRepeatedMessage(message, &field, index)
                                : reflection.GetMessage(message, &field),
                        indent);
    default:
      assert(false && "field type not supported");
      return "null";
  }
}

std::string listJson(const Message& message, const FieldDescriptor& field, std::size_t indent) {
  std::vector<std::string> items;
  const int size = message.GetReflection()->FieldSize(message, &field);
  items.reserve(static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) items.push_back(valueJson(message, field, i, indent + 2));
  return wrapped('[', ']', items, indent);
}

bool isWritten(const Message& message, const FieldDescriptor& field) {
  const auto& reflection = *message.GetReflection();
  if (!field.is_repeated()) return reflection.HasField(message, &field);
  return reflection.FieldSize(message, &field) > 0 || field.options().GetExtension(pb::required);
}

std::string objectJson(const Message& message, std::size_t indent) {
  std::vector<std::string> members;
  const auto& type = *message.GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    if (!isWritten(message, field)) continue;
    members.push_back("\"" + field.name() + "\": " +
                      (field.is_repeated() ? listJson(message, field, indent + 2)
                                           : valueJson(message, field, 0, indent + 2)));
  }
  return wrapped('{', '}', members, indent);
}

}  // namespace

std::string writeMessage(const Message& message) {
  return objectJson(message, 0) + "\n";
}

}  // namespace needlelab
