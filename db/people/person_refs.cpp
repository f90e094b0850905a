#include "db/people/person_refs.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/text/text.h"
#include "db/people/person_name.h"
#include "db/store/rows.h"
#include "needlelab/control.pb.h"
#include "needlelab/options.pb.h"

namespace needlelab {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

constexpr std::size_t kMaxFullNameBytes = 200;  // PeopleStore

bool isDigit(char c) {
  return c >= '0' && c <= '9';
}

/// Whether a word may contain this byte.
bool isNameCharacter(char c) {
  return isLetterOrDigit(c) || c == '_' || c == '-' || static_cast<unsigned char>(c) >= 0x80;
}

/// The length of the ref at `at`; 0: none. Parts of a word or an address ("user@10.0.0.1") are not refs.
std::size_t refAt(std::string_view text, std::size_t at) {
  if (at >= text.size() || text[at] != '@' ||
      (at > 0 && (isNameCharacter(text[at - 1]) || text[at - 1] == '.')))
    return 0;
  std::size_t end = at + 1;
  while (end < text.size() && isDigit(text[end])) ++end;
  if (end == at + 1 || (end < text.size() && isNameCharacter(text[end]))) return 0;
  if (end + 1 < text.size() && text[end] == '.' && isNameCharacter(text[end + 1])) return 0;
  return end - at;
}

/// The fields of a message that identify people, and the fields whose messages have such fields.
struct Fields {
  std::vector<std::pair<const FieldDescriptor*, pb::PersonField>> own;
  std::vector<const FieldDescriptor*> inner;
};

/// For all messages in requests and replies.
class FieldTable {
 public:
  FieldTable() {
    add(pb::Request::descriptor());
    add(pb::Reply::descriptor());
    // repeat until nothing changes: a message may be nested in another one that came first
    for (bool more = true; more;) {
      more = false;
      for (auto& [message, fields] : fields_)
        for (int i = 0; i < message->field_count(); ++i) {
          const FieldDescriptor* const field = message->field(i);
          if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
          const Fields& of = fields_.at(field->message_type());
          const bool has = !of.own.empty() || !of.inner.empty();
          if (!has || std::find(fields.inner.begin(), fields.inner.end(), field) != fields.inner.end())
            continue;
          fields.inner.push_back(field);
          more = true;
        }
    }
  }
  [[nodiscard]] const Fields* of(const Descriptor* message) const {
    const auto found = fields_.find(message);
    return found == fields_.end() ? nullptr : &found->second;
  }

 private:
  void add(const Descriptor* message) {
    const auto [at, is_new] = fields_.try_emplace(message);
    if (!is_new) return;
    for (int i = 0; i < message->field_count(); ++i) {
      const FieldDescriptor* const field = message->field(i);
      const auto who = field->options().GetExtension(pb::person);
      if (who != pb::NO_PERSON) at->second.own.emplace_back(field, who);
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) add(field->message_type());
    }
  }
  std::map<const Descriptor*, Fields> fields_;
};

using Visit = std::function<Status(std::string& text, pb::PersonField who)>;

Status visitField(Message& message, const FieldDescriptor* field, pb::PersonField who, const Visit& visit) {
  const auto* const reflection = message.GetReflection();
  const auto visited = [&](const std::string& before, const auto& set) -> Status {
    if (before.empty()) return {};
    std::string text = before;
    RETURN_IF_ERROR(visit(text, who));
    if (text != before) set(std::move(text));
    return {};
  };
  if (!field->is_repeated()) {
    if (field->has_presence() && !reflection->HasField(message, field)) return {};
    return visited(reflection->GetString(message, field),
                   [&](std::string text) { reflection->SetString(&message, field, std::move(text)); });
  }
  for (int i = 0; i < reflection->FieldSize(message, field); ++i)
    RETURN_IF_ERROR(visited(reflection->GetRepeatedString(message, field, i), [&](std::string text) {
      reflection->SetRepeatedString(&message, field, i, std::move(text));
    }));
  return {};
}

const FieldTable& fieldTable() {
  static const FieldTable table;
  return table;
}

Status visitAll(Message& message, const Visit& visit) {
  const Fields* const fields = fieldTable().of(message.GetDescriptor());
  if (fields == nullptr) return {};
  for (const auto& [field, who] : fields->own) RETURN_IF_ERROR(visitField(message, field, who, visit));
  const auto* const reflection = message.GetReflection();
  for (const FieldDescriptor* const field : fields->inner) {
    if (!field->is_repeated()) {
      if (reflection->HasField(message, field))
        RETURN_IF_ERROR(visitAll(*reflection->MutableMessage(&message, field), visit));
      continue;
    }
    for (int i = 0; i < reflection->FieldSize(message, field); ++i)
      RETURN_IF_ERROR(visitAll(*reflection->MutableRepeatedMessage(&message, field, i), visit));
  }
  return {};
}

}  // namespace

bool isPersonRef(std::string_view text) {
  return !text.empty() && refAt(text, 0) == text.size();
}

std::string erasedName(std::string_view ref) {
  return "erased person " + std::string(ref.substr(1));
}

Result<std::string> addTypedName(Connection& connection, std::string_view name, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto id,
                   connection.insert("INSERT INTO people (uuid, role, created_unix_ns, changed_unix_ns)"
                                     " VALUES (?, 0, ?, ?) RETURNING id",
                                     ByteView(makeUuidV7()), now_unix_ns, now_unix_ns));
  RETURN_IF_ERROR(addNameOf(connection, id, name, "", true));
  return "@" + std::to_string(id);
}

Status addNameOf(Connection& connection, std::int64_t person, std::string_view name,
                 std::string_view full_name, bool typed) {
  return connection.run("INSERT INTO names (person, name, folded, full_name, typed) VALUES (?,?,?,?,?)",
                        person, name, nameKey(name), full_name, typed);
}

Result<std::optional<std::string>> findPerson(Connection& connection, std::string_view named, Named among) {
  if (named.starts_with('@')) {
    if (isPersonRef(named))
      return connection.query("SELECT ref FROM people WHERE ref = ?", named).first(firstText);
    const auto uuid = parseUuid(named.substr(1));
    if (!uuid) return std::optional<std::string>();
    return connection.query("SELECT ref FROM people WHERE uuid = ?", ByteView(*uuid)).first(firstText);
  }
  return connection
      .query("SELECT ref FROM called WHERE folded = ? AND typed <= ? ORDER BY typed LIMIT 1",
             nameKey(trimmedName(named)), among == Named::kAccountOrTyped)
      .first(firstText);
}

Result<std::optional<std::string>> outerRef(Connection& connection, std::string_view ref) {
  const std::string one(ref);
  ASSIGN_OR_RETURN(const auto found, outerRefs(connection, std::span(&one, 1)));
  return found.empty() ? std::optional<std::string>() : found.begin()->second;
}

Result<std::map<std::string, std::string>> outerRefs(Connection& connection,
                                                     std::span<const std::string> refs) {
  std::map<std::string, std::string> found;
  if (refs.empty()) return found;
  Statement rows = connection.prepare("SELECT ref, uuid FROM people WHERE ref" + amongTexts(connection, 1));
  bindTexts(connection, rows, refs);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return found;
    found.emplace(rows.text(0), "@" + uuidText(uuidOf(textOf(rows.bytes(1))).value_or(Uuid{})));
  }
}

Result<std::map<std::string, std::string>> namesOfRefs(Connection& connection,
                                                       std::span<const std::string> refs,
                                                       std::map<std::string, std::string>* full_names) {
  std::map<std::string, std::string> names;
  if (refs.empty()) return names;
  Statement rows = connection.prepare(
      "SELECT p.ref, n.name, n.full_name FROM people p LEFT JOIN names n ON n.person = p.id WHERE p.ref" +
      amongTexts(connection, 1));
  bindTexts(connection, rows, refs);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return names;
    names.emplace(rows.text(0), rows.isNull(1) ? erasedName(rows.text(0)) : rows.text(1));
    if (full_names != nullptr && !rows.isNull(2)) full_names->emplace(rows.text(0), rows.text(2));
  }
}

Result<std::string> shownName(Connection& connection, std::string_view ref) {
  if (!isPersonRef(ref)) return std::string(ref);
  const std::string one(ref);
  ASSIGN_OR_RETURN(const auto names, namesOfRefs(connection, std::span(&one, 1)));
  return names.empty() ? one : names.begin()->second;
}

std::set<std::string> refsIn(std::string_view text) {
  std::set<std::string> refs;
  for (std::size_t at = text.find('@'); at != std::string_view::npos; at = text.find('@', at + 1))
    if (const std::size_t length = refAt(text, at); length > 0) refs.emplace(text.substr(at, length));
  return refs;
}

std::string withNames(std::string_view text, const std::map<std::string, std::string>& names) {
  std::string with;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = refAt(text, at);
    const auto name = length > 0 ? names.find(std::string(text.substr(at, length))) : names.end();
    const std::size_t taken = std::max<std::size_t>(length, 1);
    with += name == names.end() ? text.substr(at, taken) : std::string_view(name->second);
    at += taken;
  }
  return with;
}

Status toRefs(Connection& connection, Message& message, std::map<std::string, std::string>& names) {
  return visitAll(message, [&](std::string& text, pb::PersonField who) -> Status {
    if (who == pb::TEXT_ABOUT_PERSONS || who == pb::FULL_NAME) return {};
    ASSIGN_OR_RETURN(
        const auto ref,
        findPerson(connection, text, who == pb::PERSON_OR_TYPED ? Named::kAccountOrTyped : Named::kAccount));
    if (!ref) return {};
    names.emplace(*ref, text);
    text = *ref;
    return {};
  });
}

std::size_t roomForNames(const Message& message) {
  const Fields* const fields = fieldTable().of(message.GetDescriptor());
  if (fields == nullptr) return 0;
  const auto* const reflection = message.GetReflection();
  std::size_t refs = 0, full_names = 0;
  const auto count = [&](const std::string& text, pb::PersonField who) {
    if (who == pb::TEXT_ABOUT_PERSONS)
      refs += static_cast<std::size_t>(std::count(text.begin(), text.end(), '@'));
    else if (isPersonRef(text))
      ++(who == pb::FULL_NAME ? full_names : refs);
  };
  std::string scratch;
  for (const auto& [field, who] : fields->own)
    for (int i = 0; i < (field->is_repeated() ? reflection->FieldSize(message, field) : 1); ++i)
      count(field->is_repeated() ? reflection->GetRepeatedStringReference(message, field, i, &scratch)
                                 : reflection->GetStringReference(message, field, &scratch),
            who);
  std::size_t bytes = refs * kMaxNameBytes + full_names * kMaxFullNameBytes;
  for (const FieldDescriptor* const field : fields->inner) {
    if (!field->is_repeated()) {
      if (reflection->HasField(message, field)) bytes += roomForNames(reflection->GetMessage(message, field));
      continue;
    }
    for (int i = 0; i < reflection->FieldSize(message, field); ++i)
      bytes += roomForNames(reflection->GetRepeatedMessage(message, field, i));
  }
  return bytes;
}

Status toNames(Connection& connection, Message& message) {
  std::set<std::string> refs;
  RETURN_IF_ERROR(visitAll(message, [&](std::string& text, pb::PersonField who) -> Status {
    if (who == pb::TEXT_ABOUT_PERSONS)
      refs.merge(refsIn(text));
    else if (isPersonRef(text))
      refs.insert(text);
    return {};
  }));
  const std::vector<std::string> list(refs.begin(), refs.end());
  std::map<std::string, std::string> full_names;
  ASSIGN_OR_RETURN(const auto names, namesOfRefs(connection, list, &full_names));
  return visitAll(message, [&](std::string& text, pb::PersonField who) -> Status {
    if (who == pb::FULL_NAME) {
      const auto full = full_names.find(text);
      text = full == full_names.end() ? std::string() : full->second;
    } else if (who == pb::TEXT_ABOUT_PERSONS) {
      text = withNames(text, names);
    } else if (const auto name = names.find(text); name != names.end()) {
      text = name->second;
    }
    return {};
  });
}

}  // namespace needlelab
