#include "db/service/start/store_move.h"

#include <fmt/core.h>

#include <algorithm>
#include <optional>
#include <system_error>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/text/uuid.h"
#include "db/backup/database_files.h"
#include "db/service/folder/data_folder.h"
#include "db/service/start/bootstrap.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"

namespace needlelab {
namespace {

constexpr const char* kMoveHolder = "needlelab-admin store copy";

class StoreMover {
 public:
  explicit StoreMover(const StoreMove& move)
      : move_(move),
        database_(move.folder / kDatabaseFile),
        copying_(move.folder / kCopyingDatabase),
        on_postgres_(database_, move.url) {}

  Result<StoreMoved> run() {
    RETURN_IF_ERROR(takeFolder());
    if (moved_.was_done) return moved_;
    RETURN_IF_ERROR(openCopy());
    RETURN_IF_ERROR(openSource());
    ASSIGN_OR_RETURN(moved_.copied, copyRows(*from_, *to_, move_.copy));
    ASSIGN_OR_RETURN(moved_.compared, compareRows(*from_, *to_, move_.copy));
    RETURN_IF_ERROR(endCopy(*to_, *mark_));
    RETURN_IF_ERROR(move_.to_postgres ? endOnPostgres() : endOnSqlite());
    return moved_;
  }

 private:
  [[nodiscard]] std::string sourceText() const { return move_.to_postgres ? database_.string() : move_.url; }
  [[nodiscard]] std::string copyText() const { return move_.to_postgres ? move_.url : copying_.string(); }

  Status lockFolder() {
    ASSIGN_OR_RETURN(auto lock, FolderLock::take(move_.folder, kMoveHolder));
    lock_.emplace(std::move(lock));
    return {};
  }

  /// Locks the folder, completes what was decided earlier, and determines its database.
  Status takeFolder() {
    std::error_code error;
    if (!std::filesystem::is_directory(move_.folder, error))
      return Error{ErrorCode::kInvalidInput, move_.folder.string() + ": is not a folder"};
    RETURN_IF_ERROR(checkOwnFiles(move_.folder));
    RETURN_IF_ERROR(lockFolder());
    RETURN_IF_ERROR(finishRestore(move_.folder));
    RETURN_IF_ERROR(finishStoreSwitch(move_.folder));
    ASSIGN_OR_RETURN(const auto file, readStoreFile(move_.folder));
    const bool has_database = std::filesystem::exists(database_, error);
    return move_.to_postgres ? checkSqliteTarget(has_database, file)
                             : checkPostgresTarget(has_database, file);
  }

  Status checkSqliteTarget(bool has_database, const std::optional<StoreFile>& file) {
    moved_.was_done = !has_database && file && file->url == move_.url;
    if (moved_.was_done || (has_database && !file)) return {};
    return Error{
        ErrorCode::kInvalidInput,
        file ? fmt::format("--from {0}: its database is on PostgreSQL ({0}/{1}), from where PostgreSQL's "
                           "own tools take it to another database (pg_dump)",
                           move_.folder.string(), kStoreFile)
             : fmt::format("--from {}: there is no needlelab.db here", move_.folder.string())};
  }

  /// Whether the folder has worked with --from: a move back has kept its address.
  [[nodiscard]] bool hasMoved() const {
    std::error_code error;
    for (std::filesystem::directory_iterator at(move_.folder, error), end; !error && at != end;
         at.increment(error)) {
      const std::string name = at->path().filename().string();
      if (!name.starts_with(kReplacedStoreFile)) continue;
      const auto file = readStoreFile(move_.folder, name.c_str());
      if (file.ok() && *file && (*file)->url == move_.url) return true;
    }
    return false;
  }

  Status checkPostgresTarget(bool has_database, const std::optional<StoreFile>& file) {
    if (has_database) {
      moved_.was_done = !file && hasMoved();
      if (moved_.was_done) return {};
    }
    if (has_database || !file)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("--to {}: {}: give the data folder of the lab whose database is at --from, or "
                               "a copy of it",
                               move_.folder.string(),
                               has_database ? "has a database of its own, needlelab.db"
                                            : "has no file store. The lab's keys lie in that folder, and the "
                                              "audit log cannot be checked without them")};
    lab_ = file->lab;
    return {};
  }

  /// Opens the copy's place, and reads what an earlier call left there.
  Status openCopy() {
    if (move_.to_postgres) {
      ASSIGN_OR_RETURN(auto opened, openToServe(on_postgres_, Durability::kNothing));
      to_.emplace(std::move(opened));
      RETURN_IF_ERROR(requireRights(*to_));
    } else {
      if (move_.begin_again) RETURN_IF_ERROR(removeDatabase(copying_));
      RETURN_IF_ERROR(makeDatabaseFile(copying_));
      ASSIGN_OR_RETURN(auto opened,
                       Connection::open(copying_, {.mode = Connection::Mode::kWriter, .create = true}));
      to_.emplace(std::move(opened));
    }
    ASSIGN_OR_RETURN(mark_, readCopyMark(*to_));
    ASSIGN_OR_RETURN(const int version, schemaVersion(*to_));
    // a lab's own database must not be changed
    if (!mark_ && version != 0) RETURN_IF_ERROR(requireNewestSchema(*to_));
    RETURN_IF_ERROR(migrate(*to_));
    if (mark_ && move_.begin_again) {
      RETURN_IF_ERROR(emptyCopy(*to_));
      mark_.reset();
    }
    if (mark_) return {};
    ASSIGN_OR_RETURN(const bool empty, isEmptyStore(*to_));
    if (empty) return {};
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("--to {}: is not empty, and no unfinished copy: {}", copyText(),
                             move_.to_postgres ? "make an empty database for the copy (createdb)"
                                               : "move that file away")};
  }

  Status openSource() {
    moved_.went_on = mark_.has_value();
    if (!moved_.went_on) RETURN_IF_ERROR(startSource());
    const StoreAddress address = move_.to_postgres ? StoreAddress(database_) : on_postgres_;
    ASSIGN_OR_RETURN(auto opened, openToServe(address, Durability::kNothing));
    from_.emplace(std::move(opened));
    RETURN_IF_ERROR(requireNewestSchema(*from_));
    ASSIGN_OR_RETURN(const auto id, MetaStore(*from_).get(kLabKey));
    const std::string found = id.value_or("");
    if (!move_.to_postgres && found != lab_)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("--from: {} belongs to the lab {}, and this database to {}: check the address",
                               move_.folder.string(), lab_, found.empty() ? "none" : found)};
    lab_ = found;
    return moved_.went_on ? requireSourceAsItWas() : beginFrom();
  }

  /// Does what a server does at start-up, so that nothing of the source's is left to do in the copy.
  Status startSource() {
    lock_.reset();
    {
      Store::Options options;
      options.holder = kMoveHolder;
      options.create = false;
      if (!move_.to_postgres) options.store_url = move_.url;
      ASSIGN_OR_RETURN(const auto store, Store::open(move_.folder, options));
      RETURN_IF_ERROR(store->service().notes().note(
          move_.by, "store copy", move_.to_postgres ? move_.url : move_.folder.string(),
          move_.to_postgres ? "from SQLite to PostgreSQL" : "from PostgreSQL to SQLite"));
    }
    return lockFolder();
  }

  Status requireSourceAsItWas() {
    ASSIGN_OR_RETURN(const auto begun, copyBegunOf(*from_));
    if (begun == mark_->id) {
      // repeat the comparison made before the failed switch
      mark_->compared = false;
      return beginCopy(*to_, *mark_);
    }
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("--to {}: is an unfinished copy, but not of {} as it is now: a program has worked "
                    "with that since (a server was started), or it is another lab's. --begin-again "
                    "empties the copy, and copies everything",
                    copyText(), sourceText())};
  }

  Status beginFrom() {
    mark_ = CopyMark{uuidText(makeUuidV7())};
    {
      ASSIGN_OR_RETURN(auto transaction, Transaction::begin(*from_, Transaction::Kind::kWrite));
      MetaStore meta(*from_);
      if (lab_.empty()) {
        lab_ = uuidText(makeUuidV7());
        RETURN_IF_ERROR(meta.set(kLabKey, lab_));
      }
      RETURN_IF_ERROR(meta.set(kCopiedToKey, mark_->id));
      RETURN_IF_ERROR(transaction.commit());
    }
    return beginCopy(*to_, *mark_);
  }

  /// Each switch is one rename; finishStoreSwitch() does the rest.
  Status endOnPostgres() {
    const auto emptied = from_->emptyLog(0);
    if (!emptied) return emptied.error();
    from_.reset();
    const std::string kept = freeNameIn(move_.folder, kReplacedDatabase, move_.now_unix_ns);
    RETURN_IF_ERROR(writeStoreFile(move_.folder, {move_.url, lab_, kept}));
    RETURN_IF_ERROR(finishStoreSwitch(move_.folder));
    moved_.kept = move_.folder / kept;
    return leaveCopyMarks(*to_);
  }

  Status endOnSqlite() {
    RETURN_IF_ERROR(closeIntoOneFile(*std::move(to_)));
    moved_.kept = move_.folder / freeNameIn(move_.folder, kReplacedStoreFile, move_.now_unix_ns);
    RETURN_IF_ERROR(renameInFolder(move_.folder / kStoreFile, moved_.kept));
    RETURN_IF_ERROR(syncFolder(move_.folder));
    RETURN_IF_ERROR(finishStoreSwitch(move_.folder));
    ASSIGN_OR_RETURN(auto opened, Connection::open(database_, {.mode = Connection::Mode::kWriter}));
    return leaveCopyMarks(opened);
  }

  const StoreMove& move_;
  const std::filesystem::path database_, copying_;
  const StoreAddress on_postgres_;
  std::optional<FolderLock> lock_;  // destroyed last
  std::optional<Connection> from_, to_;
  std::optional<CopyMark> mark_;
  std::string lab_;
  StoreMoved moved_;
};

}  // namespace

Result<StoreMoved> moveStore(const StoreMove& move) {
  auto moved = StoreMover(move).run();
  if (!moved) return wrongStore(moved.error());
  return moved;
}

}  // namespace needlelab
