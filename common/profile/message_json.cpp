#include "common/profile/message_json.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "common/base/range.h"
#include "common/base/text/strict_json.h"
#include "needlelab/options.pb.h"

namespace needlelab {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using nlohmann::json;

/// Reports faults: returns the first fault to the caller, or collects all faults in a list while reading
/// continues.
class Faults {
 public:
  explicit Faults(std::vector<Error>* all) : all_(all) {}
  Status take(Status status) {
    if (status.ok() || all_ == nullptr) return status;
    if (all_->size() < kMostFaults) all_->push_back(status.error());
    return {};
  }

 private:
  static constexpr std::size_t kMostFaults = 200;
  std::vector<Error>* all_;
};

std::string join(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& word : words) all += (all.empty() ? "" : ", ") + word;
  return all;
}

/// Describes, for people, the value found instead of the expected one.
std::string found(const json& value) {
  switch (value.type()) {
    case json::value_t::null:
      return "found null";
    case json::value_t::boolean:
      return value.get<bool>() ? "found true" : "found false";
    case json::value_t::string:
      return "found the text " + quotedText(value.get_ref<const std::string&>());
    case json::value_t::object:
      return "found an object";
    case json::value_t::array:
      return "found a list";
    case json::value_t::number_integer:
    case json::value_t::number_unsigned:
    case json::value_t::number_float:
      return "found the number " + numberText(value.get<double>());
    default:
      return "found something else";
  }
}

const FieldDescriptor* fieldNamed(const Descriptor& type, const std::string& key) {
  for (int i = 0; i < type.field_count(); ++i) {
    if (type.field(i)->name() == key || type.field(i)->json_name() == key) return type.field(i);
  }
  return nullptr;
}

std::vector<std::string> fieldNames(const Descriptor& type) {
  std::vector<std::string> names;
  names.reserve(static_cast<std::size_t>(type.field_count()));
  for (int i = 0; i < type.field_count(); ++i) names.push_back(type.field(i)->name());
  return names;
}

bool endsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

/// The names that an author may write: "…_UNSPECIFIED" only marks an absent value.
std::vector<std::string> enumNames(const EnumDescriptor& type) {
  std::vector<std::string> names;
  for (int i = 0; i < type.value_count(); ++i) {
    if (!endsWith(type.value(i)->name(), "_UNSPECIFIED")) names.push_back(type.value(i)->name());
  }
  return names;
}

Result<double> readNumber(const FieldDescriptor& field, const std::string& path, const json& value) {
  if (!value.is_number()) return fieldError(path, "must be a number, " + found(value));
  const double number = value.get<double>() + 0.0;  // −0 becomes 0: one text for one value
  if (field.options().HasExtension(pb::range)) {
    const pb::Range& range = field.options().GetExtension(pb::range);
    const NumberRange allowed{range.min(), range.max(), range.min_open(), range.max_open()};
    if (!allowed.contains(number)) return outOfRange(path, number, allowed);
  }
  return number;
}

/// Reads a whole number within the field's range, or its type's range if it has none.
Result<std::int64_t> readWhole(const FieldDescriptor& field, const std::string& path, const json& value) {
  ASSIGN_OR_RETURN(const double number, readNumber(field, path, value));
  const bool is_signed = field.cpp_type() == FieldDescriptor::CPPTYPE_INT32;
  const NumberRange of_type{is_signed ? static_cast<double>(std::numeric_limits<std::int32_t>::min()) : 0.0,
                            is_signed ? static_cast<double>(std::numeric_limits<std::int32_t>::max())
                                      : static_cast<double>(std::numeric_limits<std::uint32_t>::max())};
  if (!of_type.contains(number)) return outOfRange(path, number, of_type);
  if (number != std::floor(number))
    return fieldError(path, "must be a whole number, found " + numberText(number));
  return static_cast<std::int64_t>(number);
}

Result<std::string> readText(const FieldDescriptor& field, const std::string& path, const json& value) {
  if (!value.is_string()) return fieldError(path, "must be a text, " + found(value));
  const auto& text = value.get_ref<const std::string&>();
  const bool is_name = field.options().HasExtension(pb::max_length);
  if (is_name) {
    const std::size_t longest = field.options().GetExtension(pb::max_length);
    if (text.empty() || text.size() > longest) {
      return fieldError(path, fmt::format("has {} bytes, allowed are 1 to {}", text.size(), longest));
    }
  }
  // terminals and tables show these texts: no control characters, except line breaks in long texts
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_break = c == '\n' || c == '\r' || c == '\t';
    if (byte == 0x7f || (byte < 0x20 && (is_name || !is_break)))
      return fieldError(path, "has control characters");
  }
  return text;
}

Result<int> readEnum(const FieldDescriptor& field, const std::string& path, const json& value) {
  const EnumDescriptor& type = *field.enum_type();
  const std::string allowed = "one of " + join(enumNames(type));
  if (!value.is_string()) return fieldError(path, "must be " + allowed + "; " + found(value));
  const auto& name = value.get_ref<const std::string&>();
  const auto* known = endsWith(name, "_UNSPECIFIED") ? nullptr : type.FindValueByName(name);
  if (known == nullptr) return fieldError(path, quotedText(name) + " is not " + allowed);
  return known->number();
}

Status readObject(const json& value, const std::string& path, Message& message, Faults& faults);

/// One value of a field: a single field, or an item of a list.
Status readValue(const FieldDescriptor& field, const std::string& path, const json& value, Message& message,
                 Faults& faults) {
  const auto& reflection = *message.GetReflection();
  const bool is_list = field.is_repeated();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE: {
      ASSIGN_OR_RETURN(const double number, readNumber(field, path, value));
      is_list ? reflection.AddDouble(&message, &field, number)
              : reflection.SetDouble(&message, &field, number);
      return {};
    }
    case FieldDescriptor::CPPTYPE_INT32:
    case FieldDescriptor::CPPTYPE_UINT32: {
      ASSIGN_OR_RETURN(const std::int64_t number, readWhole(field, path, value));
      assert(!is_list && "lists of whole numbers are not supported");
      if (field.cpp_type() == FieldDescriptor::CPPTYPE_INT32)
        reflection.SetInt32(&message, &field, static_cast<std::int32_t>(number));
      else
        reflection.SetUInt32(&message, &field, static_cast<std::uint32_t>(number));
      return {};
    }
    case FieldDescriptor::CPPTYPE_INT64:
    case FieldDescriptor::CPPTYPE_UINT64: {
      // kept as an integer: a double does not have enough digits
      assert(!is_list && "lists of whole numbers are not supported");
      const bool is_signed = field.cpp_type() == FieldDescriptor::CPPTYPE_INT64;
      // JSON has one type of number: the parser may deliver a positive number as either type
      const bool is_large = value.is_number_unsigned() && value.get<std::uint64_t>() > INT64_MAX;
      const bool is_negative =
          value.is_number_integer() && !value.is_number_unsigned() && value.get<std::int64_t>() < 0;
      const bool fits = value.is_number_integer() && !(is_signed ? is_large : is_negative);
      if (!fits)
        return fieldError(path, std::string("must be a whole number") +
                                    (is_signed ? "" : " that is not negative") + ", " + found(value));
      is_signed ? reflection.SetInt64(&message, &field, value.get<std::int64_t>())
                : reflection.SetUInt64(&message, &field, value.get<std::uint64_t>());
      return {};
    }
    case FieldDescriptor::CPPTYPE_BOOL: {
      if (!value.is_boolean()) return fieldError(path, "must be true or false, " + found(value));
      assert(!is_list && "lists of booleans are not supported");
      reflection.SetBool(&message, &field, value.get<bool>());
      return {};
    }
    case FieldDescriptor::CPPTYPE_STRING: {
      if (field.type() == FieldDescriptor::TYPE_BYTES) return fieldError(path, "cannot be given here");
      ASSIGN_OR_RETURN(const std::string text, readText(field, path, value));
      is_list ? reflection.AddString(&message, &field, text) : reflection.SetString(&message, &field, text);
      return {};
    }
    case FieldDescriptor::CPPTYPE_ENUM: {
      ASSIGN_OR_RETURN(const int number, readEnum(field, path, value));
      is_list ? reflection.AddEnumValue(&message, &field, number)
              : reflection.SetEnumValue(&message, &field, number);
      return {};
    }
    case FieldDescriptor::CPPTYPE_MESSAGE: {
      Message& part =
          is_list ? *reflection.AddMessage(&message, &field) : *reflection.MutableMessage(&message, &field);
      return readObject(value, path, part, faults);
    }
    default:
      // programmer error: profile.proto has a type that this reader does not support
      assert(false && "field type not supported");
      return fieldError(path, "has a type that this program cannot read");
  }
}

Status readList(const FieldDescriptor& field, const std::string& path, const json& value, Message& message,
                Faults& faults) {
  if (!value.is_array()) return fieldError(path, "must be a list, " + found(value));
  const auto& options = field.options();
  const std::size_t least = options.GetExtension(pb::min_items);
  const std::size_t most =
      options.HasExtension(pb::max_items) ? options.GetExtension(pb::max_items) : value.max_size();
  if (value.size() < least || value.size() > most) {
    return fieldError(path, fmt::format("has {} items, allowed are {} to {}", value.size(), least, most));
  }
  for (std::size_t i = 0; i < value.size(); ++i) {
    RETURN_IF_ERROR(faults.take(readValue(field, path + fmt::format("[{}]", i), value[i], message, faults)));
  }
  return {};
}

/// Checks that required fields are present, and exactly one field of each oneof.
Status checkPresence(const Descriptor& type, const std::string& path,
                     const std::vector<const FieldDescriptor*>& seen, Faults& faults) {
  const auto given = [&](const FieldDescriptor* field) {
    return std::find(seen.begin(), seen.end(), field) != seen.end();
  };
  const std::string prefix = path.empty() ? "" : path + ".";
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor* field = type.field(i);
    if (field->options().GetExtension(pb::required) && !given(field)) {
      RETURN_IF_ERROR(faults.take(fieldError(prefix + field->name(), "is missing")));
    }
  }
  for (int i = 0; i < type.real_oneof_decl_count(); ++i) {
    const auto& choice = *type.oneof_decl(i);
    std::vector<std::string> names, present;
    for (int j = 0; j < choice.field_count(); ++j) {
      names.push_back(choice.field(j)->name());
      if (given(choice.field(j))) present.push_back(choice.field(j)->name());
    }
    if (present.size() != 1) {
      Status status =
          faults.take(fieldError(path, "give exactly one of " + join(names) + "; found " +
                                           (present.empty() ? std::string("none") : join(present))));
      if (!status) return status;
    }
  }
  return {};
}

Status readObject(const json& value, const std::string& path, Message& message, Faults& faults) {
  if (!value.is_object()) return fieldError(path, "must be an object, " + found(value));
  const Descriptor& type = *message.GetDescriptor();
  const std::string prefix = path.empty() ? "" : path + ".";
  std::vector<const FieldDescriptor*> seen;

  for (const auto& [key, item] : value.items()) {
    const FieldDescriptor* field = fieldNamed(type, key);
    if (field == nullptr) {
      Status status = faults.take(
          fieldError(path, "unknown field " + quotedText(key) + "; known are " + join(fieldNames(type))));
      if (!status) return status;
      continue;
    }
    const std::string field_path = prefix + field->name();
    if (std::find(seen.begin(), seen.end(), field) != seen.end()) {
      RETURN_IF_ERROR(faults.take(
          fieldError(field_path, "is given twice, as " + field->name() + " and as " + field->json_name())));
      continue;
    }
    seen.push_back(field);
    RETURN_IF_ERROR(faults.take(field->is_repeated() ? readList(*field, field_path, item, message, faults)
                                                     : readValue(*field, field_path, item, message, faults)));
  }
  return checkPresence(type, path, seen, faults);
}

// ---- writing ----

constexpr std::size_t kLineLength = 110;

std::string textJson(const std::string& text) {
  return json(text).dump(-1, ' ', false, json::error_handler_t::replace);
}

/// One line if it is short and contains no line breaks, else one line per item.
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

Status readMessage(const json& value, Message& message) {
  Faults first(nullptr);
  return readObject(value, "", message, first);
}

std::vector<Error> messageFaults(const json& value, Message& message) {
  std::vector<Error> all;
  Faults faults(&all);
  (void)faults.take(readObject(value, "", message, faults));
  return all;
}

std::string writeMessage(const Message& message) {
  return objectJson(message, 0) + "\n";
}

}  // namespace needlelab
