#include "db/service/files_of_erased.h"

#include <fcntl.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"
#include "db/encrypted_backup.h"
#include "db/session_rows.h"

namespace needlelab {
namespace {

/// A table's columns of text.
struct TextTable {
  std::string name;
  std::vector<std::string> columns;
};

/// Profiles and courses, which an erasure leaves as they are, and says so (ErasureStore::reportOf). Those of
/// erased sessions are found by the session.
bool isDocument(std::string_view table, std::string_view column) {
  using Place = std::pair<std::string_view, std::string_view>;
  constexpr std::array kDocuments = {Place{"sessions", "profile_json"}, Place{"profiles", "json"},
                                     Place{"curricula", "json"}};
  return std::find(kDocuments.begin(), kDocuments.end(), Place{table, column}) != kDocuments.end();
}

/// Of a schema that is needlelab's, of any version.
Result<std::vector<TextTable>> textTables(Connection& database) {
  std::vector<TextTable> tables;
  ASSIGN_OR_RETURN(const auto names, database
                                         .prepare("SELECT name FROM sqlite_schema WHERE type = 'table'"
                                                  " AND name NOT LIKE 'sqlite\\_%' ESCAPE '\\' ORDER BY name")
                                         .all(firstText));
  for (const std::string& name : names) {
    ASSIGN_OR_RETURN(
        const auto columns,
        database.query("SELECT name FROM pragma_table_info(?) WHERE type = 'TEXT'", name).all(firstText));
    TextTable table{name, {}};
    for (const std::string& column : columns)
      if (!isDocument(name, column)) table.columns.push_back(column);
    if (!table.columns.empty()) tables.push_back(std::move(table));
  }
  return tables;
}

/// As namesErased(), of a file that can be read.
Result<bool> hasErased(Connection& database, const ErasedRows& erased) {
  ErasedNames whole = erased.names;  // given names, too, but no parts of full names
  whole.full_names.insert(whole.full_names.end(), whole.given.begin(), whole.given.end());
  const auto isNamed = [&](const std::string& text) {
    return text == whole.name || withoutNames(text, whole, false) != text;
  };
  ASSIGN_OR_RETURN(const auto tables, textTables(database));
  bool has_erased = false;  // of a schema that knows erasures
  {
    ASSIGN_OR_RETURN(const auto column,
                     database.prepare("SELECT name FROM pragma_table_info('sessions') WHERE name = 'erased'")
                         .first(firstText));
    has_erased = column.has_value();
  }
  auto sessions = database.prepare(std::string("SELECT id FROM sessions NOT INDEXED") +
                                   (has_erased ? " WHERE erased = 0" : ""));
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, sessions.step());
    if (!more) break;
    if (erased.session_ids.contains(sessionText(sessions.text(0)))) return true;
  }
  for (const TextTable& table : tables) {
    std::string columns;
    for (const std::string& column : table.columns)
      columns += (columns.empty() ? "\"" : ", \"") + column + "\"";
    auto rows = database.prepare("SELECT " + columns + " FROM \"" + table.name + "\" NOT INDEXED");
    for (;;) {
      ASSIGN_OR_RETURN(const bool more, rows.step());
      if (!more) break;
      for (int at = 0; at < static_cast<int>(table.columns.size()); ++at)
        if (isNamed(rows.text(at))) return true;
    }
  }
  return false;
}

/// What SQLite or a backup put beside a database: its name ends with one of these.
constexpr std::array<std::string_view, 2> kLogs = {"-wal", "-journal"};

bool isDatabase(const std::filesystem::path& path) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  std::array<char, 16> start{};
  // a pipe that somebody puts in its place would never answer
  const int fd = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_CLOEXEC);
  const ssize_t got = fd < 0 ? -1 : ::read(fd, start.data(), start.size());
  if (fd >= 0) ::close(fd);
  if (got < 0) return true;  // nobody can tell
  return std::string_view(start.data(), static_cast<std::size_t>(got)) == kMagic || isEncryptedBackup(path);
}

/// A copy that a backup has not finished. It is no database yet: SQLite writes the first page last.
bool isUnfinishedCopy(std::string_view file) {
  return file.ends_with(".partial") || file.ends_with(".backup-copy");
}

/// The regular files below `place` that are not empty, in folders of at most `deepest` levels below it. No
/// symbolic link below it is followed.
std::vector<std::filesystem::path> filesBelow(const std::filesystem::path& place, int deepest) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  constexpr auto kSkip = std::filesystem::directory_options::skip_permission_denied;
  for (auto at = std::filesystem::recursive_directory_iterator(place, kSkip, error);
       !error && at != std::filesystem::recursive_directory_iterator(); at.increment(error)) {
    std::error_code ignored;
    const auto type = at->symlink_status(ignored).type();
    if (type == std::filesystem::file_type::directory && at.depth() >= deepest) {
      at.disable_recursion_pending();
    } else if (type == std::filesystem::file_type::regular && at->file_size(ignored) > 0 && !ignored) {
      files.push_back(at->path());
    }
  }
  return files;
}

}  // namespace

bool namesErased(const std::filesystem::path& path, const ErasedRows& erased,
                 const std::atomic<bool>* cancelled, std::chrono::nanoseconds most_time) {
  if (isEncryptedBackup(path)) return true;
  auto opened = openForeign(path, cancelled, most_time);
  if (!opened) return true;
  const auto named = hasErased(*opened, erased);
  return !named || *named;
}

std::vector<std::filesystem::path> filesThatName(const std::filesystem::path& folder,
                                                 const std::filesystem::path& backups,
                                                 const ErasedRows& erased, const std::atomic<bool>* cancelled,
                                                 std::chrono::nanoseconds most_time) {
  using Clock = std::chrono::steady_clock;
  const auto until = Clock::now() + most_time;
  std::set<std::filesystem::path> databases, naming, logs;
  struct Place {
    std::filesystem::path path;
    int deepest = 0;
  };
  constexpr int kDeepest = 16;
  // `backups` may be a link to another disk
  for (const auto& [place, deepest] :
       {Place{folder, kDeepest}, Place{folder / "backups", kDeepest}, Place{backups, 0}}) {
    for (const auto& path : filesBelow(place, deepest)) {
      const std::string file = path.filename().string();
      std::error_code ignored;
      // the one in use is not even opened: closing it again would give up SQLite's locks
      if (file.ends_with("-shm") || std::filesystem::equivalent(path, folder / "needlelab.db", ignored))
        continue;
      if (std::any_of(kLogs.begin(), kLogs.end(), [&](std::string_view end) { return file.ends_with(end); }))
        logs.insert(path);
      else if (isUnfinishedCopy(file))
        naming.insert(path);
      else if (isDatabase(path))
        databases.insert(path);
    }
  }
  for (const auto& path : databases) {
    const auto left = until - Clock::now();
    if (left <= Clock::duration::zero() ||
        namesErased(path, erased, cancelled, std::min<std::chrono::nanoseconds>(left, kMostTimeOfForeign)))
      naming.insert(path);
  }
  for (const auto& path : logs) {
    const std::string text = path.string();
    const std::filesystem::path of = text.substr(0, text.rfind('-'));
    std::error_code ignored;
    const bool orphan = !std::filesystem::exists(of, ignored) &&
                        (of.filename().string().starts_with("needlelab") || isUnfinishedCopy(of.string()));
    if (naming.contains(of) || orphan) naming.insert(path);
  }
  return {naming.begin(), naming.end()};
}

}  // namespace needlelab
