#include "db/copy_marks.h"

#include <fmt/core.h>

#include "db/schema.h"

namespace needlelab {
namespace {

constexpr std::string_view kCopyingWord = "copying ", kComparedWord = "compared ";

/// "copying ID"
std::optional<CopyMark> parseCopyMark(std::string_view text) {
  const bool compared = text.starts_with(kComparedWord);
  const std::string_view word = compared ? kComparedWord : kCopyingWord;
  if (!text.starts_with(word) || text.size() == word.size()) return std::nullopt;
  return CopyMark{std::string(text.substr(word.size())), compared};
}

/// A key of `meta`, where there is a schema.
Result<std::optional<std::string>> metaOfAny(Connection& connection, std::string_view key) {
  ASSIGN_OR_RETURN(const int version, schemaVersion(connection));
  if (version == 0) return std::optional<std::string>();
  // another program's file has a version, too
  if (connection.sqlite() != nullptr) {
    auto table = connection.prepare("SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = 'meta'");
    ASSIGN_OR_RETURN(const bool there, table.step());
    if (!there) return std::optional<std::string>();
  }
  return MetaStore(connection).get(key);
}

}  // namespace

Result<std::optional<CopyMark>> readCopyMark(Connection& connection) {
  ASSIGN_OR_RETURN(const auto text, metaOfAny(connection, kCopyMarkKey));
  if (!text) return std::optional<CopyMark>();
  auto mark = parseCopyMark(*text);
  if (!mark)
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: its table meta has the key {} with the value '{}', which no copy writes",
                             connection.origin().string(), kCopyMarkKey, *text)};
  return mark;
}

Status writeCopyMark(Connection& connection, const CopyMark& mark) {
  return MetaStore(connection)
      .set(kCopyMarkKey, std::string(mark.compared ? kComparedWord : kCopyingWord) + mark.id);
}

Result<std::optional<std::string>> copyBegunOf(Connection& connection) {
  return metaOfAny(connection, kCopiedToKey);
}

Status refuseUnfinishedCopy(Connection& connection) {
  ASSIGN_OR_RETURN(const auto mark, readCopyMark(connection));
  if (!mark || mark->compared) return {};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("{}: this database is an unfinished copy of another one: give the command "
                           "needlelab-admin store copy again, which goes on where it stopped; until then "
                           "the lab works with the database that is copied",
                           connection.sqlite() != nullptr ? connection.origin().string() : "--store")};
}

Status leaveCopyMarks(Connection& connection) {
  ASSIGN_OR_RETURN(const auto mark, readCopyMark(connection));
  ASSIGN_OR_RETURN(const auto begun, copyBegunOf(connection));
  if (!mark && !begun) return {};
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(connection.run("DELETE FROM meta WHERE key = ? OR key = ?", kCopyMarkKey, kCopiedToKey));
  return transaction.commit();
}

}  // namespace needlelab
