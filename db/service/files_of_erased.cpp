#include "db/service/files_of_erased.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <iterator>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/base/files.h"
#include "common/base/result.h"
#include "db/encrypted_backup.h"
#include "db/erasure_list.h"
#include "db/service/data_folder.h"
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

/// What SQLite or a backup put beside a database: its name ends with one of these.
constexpr std::array<std::string_view, 3> kLogs = {"-wal", "-journal", "-shm"};

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

}  // namespace

/// An opened file, of which the rows are looked at one after the other.
class RowsOfFile {
 public:
  static Result<std::unique_ptr<RowsOfFile>> begin(Connection opened, const ErasedRows& erased) {
    std::unique_ptr<RowsOfFile> rows(new RowsOfFile(std::move(opened), erased));
    ASSIGN_OR_RETURN(const auto column, rows->database_
                                            .prepare("SELECT name FROM pragma_table_info('sessions')"
                                                     " WHERE name = 'erased'")
                                            .first(firstText));
    // of a schema that knows erasures; each row is asked for, so that none takes long
    rows->queries_.push_back(
        {std::string("SELECT id, ") + (column ? "erased" : "0") + " FROM sessions NOT INDEXED", 0});
    ASSIGN_OR_RETURN(const auto tables, textTables(rows->database_));
    for (const TextTable& table : tables) {
      std::string columns;
      for (const std::string& name : table.columns)
        columns += (columns.empty() ? "\"" : ", \"") + name + "\"";
      rows->queries_.push_back({"SELECT " + columns + " FROM \"" + table.name + "\" NOT INDEXED",
                                static_cast<int>(table.columns.size())});
    }
    return rows;
  }

  /// Whether the file has the person; nothing: there is more to look at, and `time` is past `until_ns`.
  Result<std::optional<bool>> readOn(TimeSource& time, std::int64_t until_ns) {
    for (; at_ < queries_.size(); ++at_, rows_.reset()) {
      if (!rows_) rows_.emplace(database_.prepare(queries_[at_].sql));
      for (;;) {
        if (time.nowNs() >= until_ns) return std::optional<bool>();
        ASSIGN_OR_RETURN(const bool more, rows_->step());
        if (!more) break;
        if (hasErased(queries_[at_])) return std::optional(true);
      }
    }
    return std::optional(false);
  }
  /// As Connection::readUntil(): the end of all turns, within a row, too.
  void readUntil(std::int64_t until_ns) { database_.readUntil(until_ns); }

 private:
  struct Query {
    std::string sql;
    int texts = 0;  ///< columns; 0: id of a session, and whether it was erased
  };
  RowsOfFile(Connection opened, const ErasedRows& erased)
      : database_(std::move(opened)), erased_(erased), names_(erased.names) {
    // given names, too, but no parts of full names
    names_.full_names.insert(names_.full_names.end(), names_.given.begin(), names_.given.end());
  }
  [[nodiscard]] bool hasErased(const Query& query) const {
    if (query.texts == 0)
      return rows_->integer(1) == 0 && erased_.session_ids.contains(sessionText(rows_->text(0)));
    for (int i = 0; i < query.texts; ++i) {
      const std::string text = rows_->text(i);
      if (text == names_.name || withoutNames(text, names_, false) != text) return true;
    }
    return false;
  }

  Connection database_;
  const ErasedRows& erased_;
  ErasedNames names_;
  std::vector<Query> queries_;
  std::size_t at_ = 0;
  std::optional<Statement> rows_;  ///< of queries_[at_]
};

LookAtFiles::LookAtFiles(const std::filesystem::path& folder, const std::filesystem::path& backups,
                         const ErasedRows& erased, const std::atomic<bool>* cancelled,
                         std::chrono::nanoseconds most_time, TimeSource& time, std::int64_t newest_unix_ns)
    : erased_(erased),
      cancelled_(cancelled),
      time_(time),
      in_use_(folder / "needlelab.db"),
      newest_unix_ns_(newest_unix_ns),
      left_ns_(most_time.count()) {
  constexpr int kDeepest = 16;
  roots_.push_back({folder, kDeepest});
  const std::filesystem::path own = folder / "backups";
  std::error_code ignored;
  // it may be a link to another disk
  if (std::filesystem::is_symlink(own, ignored)) roots_.push_back({own, kDeepest});
  if (!backups.empty() && !std::filesystem::equivalent(backups, own, ignored) &&
      !std::filesystem::equivalent(backups, folder, ignored))
    roots_.push_back({backups, 0});
}

LookAtFiles::~LookAtFiles() = default;

bool LookAtFiles::goOn() {
  const std::int64_t until_ns = time_.nowNs() + std::chrono::nanoseconds(kTurnOfFiles).count();
  if (!listOn(until_ns)) return false;
  const std::uint64_t opened_before = opened_;
  while (!files_.empty()) {
    const bool goes_on = rows_ != nullptr;
    const auto first = files_.begin();
    const auto kind = goes_on || left_ns_ > 0 ? read(first->second, until_ns) : std::optional(Kind::kUntold);
    if (!kind) return false;
    if (*kind != Kind::kWithout) name(*kind, *first);
    files_.erase(first);
    if (goes_on || opened_ > opened_before || time_.nowNs() >= until_ns) break;
  }
  return files_.empty();
}

FilesFound LookAtFiles::found() const {
  FilesFound found{{}, others_};
  for (const auto& [kind, file] : named_) found.named.push_back(file.second);
  return found;
}

bool LookAtFiles::listOn(std::int64_t until_ns) {
  if (is_listed_) return true;
  // one walk, because files may move between the places, too
  if (!walk_) walk_.emplace(roots_);
  for (;;) {
    if (time_.nowNs() >= until_ns) return false;
    const auto entry = walk_->next();
    if (!entry) break;
    const File file{entry->owner != ::geteuid(), entry->path};
    if (entry->kind == FolderWalk::Kind::kFile) sortIn(file);
    // the server's own are written and renamed all the time
    if (entry->kind == FolderWalk::Kind::kVanished && !isOwnFile(in_use_.parent_path(), entry->path))
      walk_->noteVanished();
    if (entry->kind == FolderWalk::Kind::kUnread && !isForOldOnes()) name(Kind::kUnread, file);
  }
  walk_.reset();
  is_listed_ = true;
  return true;
}

std::optional<LookAtFiles::Identity> LookAtFiles::identityOf(const std::filesystem::path& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0) return std::nullopt;
  const auto ns = [](const timespec& at) { return at.tv_sec * std::int64_t{1'000'000'000} + at.tv_nsec; };
  return Identity{info.st_dev, info.st_ino, static_cast<std::int64_t>(info.st_size), ns(info.st_mtim),
                  ns(info.st_ctim)};
}

void LookAtFiles::sortIn(const File& file) {
  const std::filesystem::path& path = file.second;
  const std::string last = path.filename().string();
  std::error_code ignored;
  // the one in use is not even opened: closing it again would give up SQLite's locks
  if (isOwnFile(in_use_.parent_path(), path) || std::filesystem::equivalent(path, in_use_, ignored)) return;
  const auto identity = identityOf(path);
  if (!identity && errno == ENOENT) {
    walk_->noteVanished();
    return;
  }
  // nobody can tell: its path may be too long
  if (!identity) {
    name(Kind::kUntold, file);
    return;
  }
  if (std::get<3>(*identity) > newest_unix_ns_) return;
  if (std::any_of(kLogs.begin(), kLogs.end(), [&](std::string_view end) { return last.ends_with(end); })) {
    name(Kind::kLog, file);
  } else if (isUnfinishedCopy(last)) {
    name(Kind::kUnfinished, file);
  } else if (!isDatabase(path)) {
    // a list beside backups has no names
    if (last != kErasuresCopy && !isTemporaryNameOf(kErasuresCopy, last)) name(Kind::kOther, file);
  } else if (files_.insert(file).second && files_.size() > kMostFilesRead) {
    const auto least = std::prev(files_.end());
    countOther(least->second);
    files_.erase(least);
  }
}

void LookAtFiles::name(Kind kind, const File& file) {
  if (!named_.insert({kind, file}).second || named_.size() <= kMostFilesNamed) return;
  const auto least = std::prev(named_.end());
  countOther(least->second.second);
  named_.erase(least);
}

void LookAtFiles::countOther(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.parent_path();
  if (others_.contains(folder) || others_.size() < kMostFoldersCounted) {
    ++others_[folder];
    return;
  }
  const auto root = std::find_if(roots_.rbegin(), roots_.rend(), [&](const FolderWalk::Root& place) {
    return path.string().starts_with(place.path.string());
  });
  ++others_[root == roots_.rend() ? roots_.front().path : root->path];
}

std::optional<LookAtFiles::Kind> LookAtFiles::read(const std::filesystem::path& path, std::int64_t until_ns) {
  const std::int64_t began_ns = time_.nowNs();
  std::optional<Kind> kind;
  if (!rows_) {
    // a log belongs to one of the file's names
    if (isEncryptedBackup(path) || !requireAlone(path)) return Kind::kUntold;
    identity_ = identityOf(path);
    const auto known = identity_ ? known_.find(*identity_) : known_.end();
    if (known != known_.end()) return known->second;
    ++opened_;
    left_of_file_ns_ = std::chrono::nanoseconds(kMostTimeOfForeign).count();
    const std::chrono::nanoseconds most_time(std::min(left_ns_, left_of_file_ns_));
    if (auto opened = openForeign(path, cancelled_, most_time, time_))
      if (auto rows = RowsOfFile::begin(std::move(*opened), erased_)) rows_ = std::move(*rows);
    if (!rows_) kind = Kind::kUntold;
  } else {
    rows_->readUntil(began_ns + std::min(left_ns_, left_of_file_ns_));
  }
  if (rows_) {
    const auto has_person = rows_->readOn(time_, until_ns);
    if (!has_person)
      kind = Kind::kUntold;
    else if (*has_person)
      kind = **has_person ? Kind::kHasPerson : Kind::kWithout;
  }
  const std::int64_t used_ns = time_.nowNs() - began_ns;
  left_ns_ -= used_ns;
  left_of_file_ns_ -= used_ns;
  if (!kind && (left_ns_ <= 0 || left_of_file_ns_ <= 0)) kind = Kind::kUntold;
  if (!kind) return kind;
  rows_.reset();
  if (identity_) known_[*identity_] = *kind;
  return kind;
}

}  // namespace needlelab
