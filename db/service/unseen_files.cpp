#include "db/service/unseen_files.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "common/base/text.h"
#include "common/base/time_source.h"
#include "db/audit.h"
#include "db/erasure.h"
#include "db/person_name.h"
#include "db/schema.h"
#include "db/service/files_of_erased.h"
#include "db/service/handlers.h"

namespace needlelab {
namespace {

/// As kFilesUnseenKey, once a start has told it: until when files count, ns since 1970.
constexpr std::string_view kUnseenToldKey = "files_unseen_told ";

struct UnseenNote {
  std::string pseudonym;
  std::int64_t until_unix_ns = 0;
};

/// Files that were changed last up to this time may hold a person whose erasure began at `erased_unix_ns`.
std::int64_t lastSuspectTime(std::int64_t erased_unix_ns, std::int64_t now_unix_ns) {
  constexpr std::int64_t kDay_ns = 86'400'000'000'000;
  const std::int64_t day_after = erased_unix_ns > INT64_MAX - kDay_ns ? INT64_MAX : erased_unix_ns + kDay_ns;
  // the clock may be behind
  return now_unix_ns < erased_unix_ns ? day_after : std::min(now_unix_ns, day_after);
}

/// The notes under one of the keys, with its number.
Result<std::vector<UnseenNote>> unseenNotes(Connection& connection, std::string_view key) {
  return connection
      .query(
          "SELECT substr(key, length(?1) + 1), value FROM meta WHERE substr(key, 1, length(?1)) = ?1"
          " ORDER BY key",
          key)
      .all([](const Statement& row) {
        UnseenNote note{row.text(0), 0};
        const std::string value = row.text(1);
        std::from_chars(value.data(), value.data() + value.size(), note.until_unix_ns);
        return note;
      });
}

/// All notes.
struct UnseenFiles {
  std::vector<UnseenNote> told, untold;
  [[nodiscard]] bool empty() const { return told.empty() && untold.empty(); }
  /// The newest time of them.
  [[nodiscard]] std::int64_t until() const {
    std::int64_t newest = INT64_MIN;
    for (const auto* notes : {&told, &untold})
      for (const UnseenNote& note : *notes) newest = std::max(newest, note.until_unix_ns);
    return newest;
  }
};

Result<UnseenFiles> unseenFiles(Connection& connection, std::int64_t now_unix_ns) {
  UnseenFiles all;
  ASSIGN_OR_RETURN(all.told, unseenNotes(connection, kUnseenToldKey));
  ASSIGN_OR_RETURN(all.untold, unseenNotes(connection, kFilesUnseenKey));
  for (UnseenNote& note : all.untold) note.until_unix_ns = lastSuspectTime(note.until_unix_ns, now_unix_ns);
  return all;
}

struct SuspectFiles {
  FilesFound found;
  bool all = true;  ///< false: there was no time to list the others
  [[nodiscard]] std::uint64_t count() const {
    std::uint64_t sum = found.named.size();
    for (const auto& [folder, others] : found.others) sum += others;
    return sum;
  }
};

/// Lists, in at most so many turns, the files that were changed last up to `until_unix_ns`.
SuspectFiles suspectFiles(Connection& connection, std::int64_t until_unix_ns, std::size_t most_turns,
                          const std::atomic<bool>* cancelled) {
  const ErasedRows nobody;
  LookAtFiles files(connection.path().parent_path(), handlers::backupsFolder(connection), nobody, nullptr,
                    std::chrono::nanoseconds(0), machineTime(), until_unix_ns);
  bool all = false;
  for (std::size_t i = 0; !all && i < most_turns && !(cancelled && *cancelled); ++i) all = files.goOn();
  return {files.found(), all};
}

/// Whether the disk of the backups is there, or none is known.
Result<bool> seesLastBackup(Connection& connection) {
  ASSIGN_OR_RETURN(const auto backup, MetaStore(connection).get("backup_path"));
  std::error_code ignored;
  return !backup || std::filesystem::exists(*backup, ignored);
}

/// For a line of the audit log.
std::string suspectCountText(Connection& connection, const SuspectFiles& suspect) {
  const auto folder = connection.path().parent_path(), backups = handlers::backupsFolder(connection);
  std::string where = printable(folder.string());
  if (!backups.empty() && backups != folder) where += " and " + printable(backups.string());
  if (suspect.all && suspect.count() == 0)
    return "nobody looked for files that still hold this person; none from before is in " + where;
  return fmt::format(
      "nobody looked which files still hold this person: {}{} from before may, see `needlelab-admin check`, "
      "in "
      "{}",
      suspect.all ? "" : "at least ", suspect.count(), where);
}

Status setMeta(Connection& writer, std::string_view key, const UnseenNote& note) {
  return MetaStore(writer).set(std::string(key) + note.pseudonym, std::to_string(note.until_unix_ns));
}

Status dropMeta(Connection& writer, std::string_view key, const std::string& pseudonym) {
  return writer.run("DELETE FROM meta WHERE key = ?", std::string(key) + pseudonym);
}

}  // namespace

Status noteFilesSeen(Connection& writer, const std::string& pseudonym) {
  RETURN_IF_ERROR(dropMeta(writer, kFilesUnseenKey, pseudonym));
  return dropMeta(writer, kUnseenToldKey, pseudonym);
}

Status tellUnseenFiles(Connection& writer, std::int64_t now_unix_ns) {
  constexpr std::size_t kTurnsOfStart = 4;
  ASSIGN_OR_RETURN(const auto unseen, unseenFiles(writer, now_unix_ns));
  if (unseen.empty()) return {};
  const SuspectFiles suspect = suspectFiles(writer, unseen.until(), kTurnsOfStart, nullptr);
  ASSIGN_OR_RETURN(const bool sees_backups, seesLastBackup(writer));
  const bool is_over = suspect.all && suspect.count() == 0 && sees_backups;
  if (unseen.untold.empty() && !is_over) return {};
  const std::string text = suspectCountText(writer, suspect);
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
  for (const UnseenNote& note : unseen.untold) {
    RETURN_IF_ERROR(dropMeta(writer, kFilesUnseenKey, note.pseudonym));
    if (!is_over) RETURN_IF_ERROR(setMeta(writer, kUnseenToldKey, note));
    RETURN_IF_ERROR(
        AuditStore(writer).add({0, now_unix_ns, kServerName, "person erase", note.pseudonym, text}));
  }
  if (is_over)
    for (const UnseenNote& note : unseen.told)
      RETURN_IF_ERROR(dropMeta(writer, kUnseenToldKey, note.pseudonym));
  return transaction.commit();
}

Result<std::string> unseenFilesText(Connection& reader, std::int64_t now_unix_ns,
                                    const std::atomic<bool>* cancelled) {
  constexpr std::size_t kTurnsOfCheck = 120, kMostPeople = 20, kOfFault_bytes = 64 << 10;
  ASSIGN_OR_RETURN(const auto unseen, unseenFiles(reader, now_unix_ns));
  if (unseen.empty()) return std::string();
  const SuspectFiles suspect = suspectFiles(reader, unseen.until(), kTurnsOfCheck, cancelled);
  if (suspect.all && suspect.count() == 0) return std::string();
  std::string people;
  std::size_t count = 0;
  for (const auto* notes : {&unseen.told, &unseen.untold})
    for (const UnseenNote& note : *notes)
      if (++count <= kMostPeople) people += (people.empty() ? "" : ", ") + note.pseudonym;
  if (count > kMostPeople) people += fmt::format(" and {} others", count - kMostPeople);
  const std::string files = handlers::filesInText(suspect.found, kOfFault_bytes, true).text;
  return fmt::format(
      "nobody has looked which files still hold {}: the erasure is under way, was killed, or was repeated at "
      "a "
      "start. From before it, or from the day after it began, are: {}{}. They may hold this person: remove "
      "them, then this is said no more",
      people, files, suspect.all ? "" : (files.empty() ? "too many to list" : ", and others"));
}

}  // namespace needlelab
