#include "db/people/person_name.h"

#include <fmt/core.h>
#include <utf8proc.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "db/people/pseudonyms.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

constexpr std::string_view kUnicode = "names_unicode";

constexpr std::string_view kGuest = "guest";
/// Names in the audit log, in sessions and beside removed recordings that do not belong to a person.
constexpr std::string_view kOwnNames[] = {kServerName, kGuest, "local", "retention", "erasure"};

constexpr utf8proc_int32_t kNonJoiner = 0x200c, kJoiner = 0x200d, kBrailleBlank = 0x2800;

struct CodePoint {
  utf8proc_int32_t value = -1;  ///< -1: not UTF-8
  std::size_t bytes = 1;
};

CodePoint codePointAt(std::string_view text, std::size_t at) {
  utf8proc_int32_t value = -1;
  const auto bytes = utf8proc_iterate(reinterpret_cast<const utf8proc_uint8_t*>(text.data()) + at,
                                      static_cast<utf8proc_ssize_t>(text.size() - at), &value);
  if (bytes <= 0) return {};
  return {value, static_cast<std::size_t>(bytes)};
}

/// Unicode's property White_Space.
bool isWhiteSpace(utf8proc_int32_t c) {
  if ((c >= 0x09 && c <= 0x0d) || c == 0x85) return true;
  const auto category = c < 0 ? UTF8PROC_CATEGORY_CN : utf8proc_category(c);
  return category == UTF8PROC_CATEGORY_ZS || category == UTF8PROC_CATEGORY_ZL ||
         category == UTF8PROC_CATEGORY_ZP;
}

/// Hyphens, dashes and minus, of which keyboards have one; word processors put the others.
bool isDash(utf8proc_int32_t c) {
  return (c >= 0x2010 && c <= 0x2015) || c == 0x2212 || c == 0xfe58 || c == 0xfe63 || c == 0xff0d;
}

/// Each run of white space as one space, each dash as '-'.
std::string withPlainSpacesAndDashes(std::string_view text) {
  std::string plain;
  bool in_space = false;
  for (std::size_t at = 0; at < text.size();) {
    const CodePoint c = codePointAt(text, at);
    const bool is_space = isWhiteSpace(c.value);
    if (is_space && !in_space) plain += ' ';
    if (!is_space) plain += isDash(c.value) ? "-" : text.substr(at, c.bytes);
    in_space = is_space;
    at += c.bytes;
  }
  return plain;
}

Error invalidName(std::string_view field, std::string_view what) {
  return {ErrorCode::kInvalidInput, fmt::format("{}: {}", field, what)};
}

struct FreeMemory {
  void operator()(utf8proc_uint8_t* memory) const { std::free(memory); }
};

std::string mapped(std::string_view text, int options) {
  utf8proc_uint8_t* made = nullptr;
  const auto bytes = utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(text.data()),
                                  static_cast<utf8proc_ssize_t>(text.size()), &made,
                                  static_cast<utf8proc_option_t>(options));
  const std::unique_ptr<utf8proc_uint8_t, FreeMemory> memory(made);
  if (bytes < 0) return std::string(text);
  return {reinterpret_cast<const char*>(made), static_cast<std::size_t>(bytes)};
}

/// kInvalidInput: the name of the server itself, of guests or of an erased person, in any spelling.
Status checkNotReserved(std::string_view field, std::string_view name) {
  const std::string key = nameKey(name);
  if (std::find(std::begin(kOwnNames), std::end(kOwnNames), key) != std::end(kOwnNames))
    return invalidName(field, fmt::format("'{}' is the name {}: take another one", printable(name),
                                          key == kGuest ? "of those who practise without one"
                                                        : "under which the server itself writes"));
  if (key.starts_with("local:"))
    return invalidName(field,
                       fmt::format("'{}' begins with 'local:', as the audit log calls those who work on "
                                   "the data folder: take another one",
                                   printable(name)));
  return {};
}

}  // namespace

std::string_view trimmedName(std::string_view name) {
  std::size_t begin = name.size(), end = 0;
  for (std::size_t at = 0; at < name.size();) {
    const CodePoint c = codePointAt(name, at);
    if (!isWhiteSpace(c.value)) {
      begin = std::min(begin, at);
      end = at + c.bytes;
    }
    at += c.bytes;
  }
  return begin < end ? name.substr(begin, end - begin) : std::string_view();
}

std::string nameKey(std::string_view name) {
  // folding can leave form C, and composing can make something that folds again
  std::string key(name);
  for (int pass = 0; pass < 3; ++pass) {
    std::string next = withPlainSpacesAndDashes(
        mapped(key, UTF8PROC_STABLE | UTF8PROC_COMPOSE | UTF8PROC_CASEFOLD | UTF8PROC_IGNORE));
    if (next == key) break;
    key = std::move(next);
  }
  return key;
}

Status checkNewPersonName(std::string_view field, std::string_view name) {
  RETURN_IF_ERROR(checkNewName(field, name));
  if (trimmedName(name) != name) return invalidName(field, "begins or ends with a space");
  if (name.starts_with('@')) return invalidName(field, "begins with '@', as ids do: take it away");
  for (std::size_t at = 0; at < name.size();) {
    const CodePoint c = codePointAt(name, at);
    at += c.bytes;
    // checkNewName() has allowed these two between letters of scripts that join
    if (c.value == kNonJoiner || c.value == kJoiner) continue;
    if (utf8proc_get_property(c.value)->ignorable || c.value == kBrailleBlank)
      return invalidName(
          field, fmt::format("contains U+{:04X}, which is invisible: type it again without that character",
                             static_cast<unsigned>(c.value)));
  }
  return checkNotReserved(field, name);
}

std::string sameNameQuestion(std::string_view there, std::string_view typed) {
  if (there == typed) return fmt::format("there is already a person named '{}'", there);
  return fmt::format(
      "there is already a person named '{}', which is the same name as '{}': is it the same "
      "person? Then write '{}', else take another name",
      there, typed, there);
}

Status refreshNameKeys(Connection& connection) {
  MetaStore meta(connection);
  ASSIGN_OR_RETURN(const auto computed_with, meta.get(kUnicode));
  const std::string now = fmt::format("{}, one space, one dash", utf8proc_unicode_version());
  if (computed_with == now) return {};
  struct Row {
    std::string key, name;
    auto operator<=>(const Row&) const = default;
  };
  ASSIGN_OR_RETURN(auto rows,
                   connection.prepare("SELECT name FROM names WHERE typed = 0").all([](const Statement& row) {
                     return Row{nameKey(row.text(0)), row.text(0)};
                   }));
  std::sort(rows.begin(), rows.end());
  const auto one =
      std::adjacent_find(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.key == b.key; });
  if (one != rows.end())
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("'{}' and '{}' are one name by Unicode {}, this program's rule; the database was "
                    "last used with Unicode {}: start the earlier program, erase one of the two or "
                    "move its sessions, and start this one again",
                    one->name, std::next(one)->name, now, computed_with.value_or("?"))};
  // first set unused keys: until the end, a new key may still be another name's. Two typed names that have
  // become the same keep such a key
  ASSIGN_OR_RETURN(const auto all,
                   connection.prepare("SELECT person, name, typed FROM names").all([](const Statement& row) {
                     return std::tuple{row.integer(0), row.text(1), row.integer(2)};
                   }));
  RETURN_IF_ERROR(connection.run("UPDATE names SET folded = ' ' || person"));
  for (const auto& [person, name, typed] : all)
    RETURN_IF_ERROR(
        connection.run("UPDATE names SET folded = ?1 WHERE person = ?2 AND NOT EXISTS"
                       " (SELECT 1 FROM names WHERE folded = ?1 AND typed = ?3)",
                       nameKey(name), person, typed));
  return meta.set(kUnicode, now);
}

Result<bool> wasErased(Connection& connection, std::string_view name, std::int64_t started_unix_ns,
                       std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto any, connection.prepare("SELECT 1 FROM erased_names LIMIT 1").first(firstText));
  if (!any) return false;
  ASSIGN_OR_RETURN(const auto key, PseudonymKey::ofFolder(connection.path().parent_path()));
  ASSIGN_OR_RETURN(const auto found,
                   connection
                       .query("SELECT 1 FROM erased_names WHERE hash = ? AND until_unix_ns > ?"
                              " AND until_unix_ns - ? > ?",
                              ByteView(key.nameHash(nameKey(trimmedName(name)))), now_unix_ns,
                              kErasedNamesKept_ns, started_unix_ns)
                       .first(firstText));
  return found.has_value();
}

Result<bool> isErased(Connection& connection, const Uuid& person) {
  ASSIGN_OR_RETURN(
      const auto found,
      connection.query("SELECT 1 FROM erasures WHERE uuid = ?", ByteView(person)).first(firstText));
  return found.has_value();
}

}  // namespace needlelab
