#include "db/service/start/bootstrap.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <thread>
#include <tuple>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "db/audit/audit_head.h"
#include "db/backup/database_files.h"
#include "db/backup/store_copy.h"
#include "db/erasure/erasure.h"
#include "db/people/person_name.h"
#include "db/people/pseudonyms.h"
#include "db/service/records/erasures.h"
#include "db/service/requests/lessons/lesson_texts.h"
#include "db/sessions/seen_time.h"
#include "db/store/connection.h"
#include "db/store/duties.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"
#include "needlelab/types.pb.h"

namespace needlelab {
namespace {

/// Loads the samples into a new database, in one transaction: after a crash the next start repeats it.
Status fillNewDatabase(Connection& connection) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  MetaStore meta(connection);
  ASSIGN_OR_RETURN(const auto created, meta.get("created_unix_ns"));
  if (!created) {
    const std::int64_t now = wallNowNs();
    RETURN_IF_ERROR(storeSamples(connection, now));
    RETURN_IF_ERROR(meta.set("created_unix_ns", std::to_string(now)));
  }
  // a PostgreSQL database got it when its folder claimed it
  ASSIGN_OR_RETURN(const auto lab, meta.get(kLabKey));
  if (!lab) RETURN_IF_ERROR(meta.set(kLabKey, uuidText(makeUuidV7())));
  ASSIGN_OR_RETURN(const auto engine, meta.get("engine_version"));
  if (engine != programVersion()) {
    RETURN_IF_ERROR(meta.set("engine_version", programVersion()));
  }
  return transaction.commit();
}

/// kNotFound if there is no database and none may be created.
Status requireDatabase(const std::filesystem::path& folder, const Store::Options& options) {
  std::error_code ignored;
  if (options.create || !options.store_url.empty() ||
      std::filesystem::exists(folder / kDatabaseFile, ignored) ||
      std::filesystem::exists(folder / kRestorePending, ignored) ||
      std::filesystem::exists(folder / kStoreFile, ignored))
    return {};
  return Error{ErrorCode::kNotFound, folder.string() +
                                         ": there is no needlelab.db here; start needlelab-server on it, or "
                                         "add the first user or station, to make one"};
}

/// How long a starting server that works with others waits for a duty.
constexpr std::chrono::milliseconds kWaitForDuty{5000};
constexpr int kTriesForDuty = 100;

/// kUnavailable: others work on the database, and its schema version is not this program's.
Status requireNothingToMigrate(Connection& connection) {
  ASSIGN_OR_RETURN(const int found, schemaVersion(connection));
  if (found >= newestSchemaVersion()) return {};
  return Error{
      ErrorCode::kUnavailable,
      fmt::format("--together: the schema of this database has version {}, and this program makes it {}, "
                  "which wants the database for itself: end the other servers, start this one, then "
                  "start the others in this version",
                  found, newestSchemaVersion())};
}

Status refreshNames(Connection& connection) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(refreshNameKeys(connection));
  return transaction.commit();
}

/// The writer's connection, with the newest schema. Sets `address.lab`.
Result<Connection> openToWrite(StoreAddress& address, Durability least) {
  ASSIGN_OR_RETURN(auto connection, openToServe(address, least));
  RETURN_IF_ERROR(requireRights(connection));
  // a killed change may have left a log that takes the space needed now
  (void)connection.emptyLog(0);
  if (!connection.isAlone()) RETURN_IF_ERROR(requireNothingToMigrate(connection));
  RETURN_IF_ERROR(migrate(connection));
  RETURN_IF_ERROR(refuseUnfinishedCopy(connection));
  if (address.isPostgres()) {
    ASSIGN_OR_RETURN(std::string lab, claimStore(connection, address));
    address.lab = {.lab = std::move(lab), .schema_version = newestSchemaVersion()};
    connection.stayWith(*address.lab);
  }
  RETURN_IF_ERROR(leaveCopyMarks(connection));
  RETURN_IF_ERROR(fillNewDatabase(connection));
  RETURN_IF_ERROR(refreshNames(connection));
  // an invalid key is refused here, not by the first change
  RETURN_IF_ERROR(beginAuditHead(connection, wallNowNs()));
  return connection;
}

/// Why a start ends: nothing is served while erased people are back in the database.
Error pendingErasureError(const std::filesystem::path& folder, const Error& why) {
  return {why.code,
          fmt::format("{}: people are in this database again who were erased, and are erased again before "
                      "anything is served, which failed: {}. Make room on the disk, then start again",
                      folder.string(), why.message)};
}

/// The connection of a store that writes nothing. `why`: the reason.
Result<Connection> openFrozen(const std::filesystem::path& path, const Error& why) {
  ASSIGN_OR_RETURN(auto connection, Connection::open(path, {.mode = Connection::Mode::kFrozen}));
  ASSIGN_OR_RETURN(const int found, schemaVersion(connection));
  // also an empty file, which an earlier start on the full disk left
  if (found < newestSchemaVersion())
    return Error{ErrorCode::kNoRoom,
                 fmt::format("{}: its schema has version {} and must become {} before anything can be read, "
                             "which needs room: {}",
                             path.string(), found, newestSchemaVersion(), why.message)};
  RETURN_IF_ERROR(requireNewestSchema(connection));
  ASSIGN_OR_RETURN(const auto lines, readErasures(path.parent_path()));
  ASSIGN_OR_RETURN(const bool is_back, ErasureStore(connection).isAnyBack(lines));
  if (is_back) return pendingErasureError(path.parent_path(), why);
  return connection;
}

}  // namespace

Store::~Store() {
  if (!writer_) return;
  stopWriting();
  (void)storeAuditHead();
}

Status Store::keepAcknowledged() {
  if (!acknowledged_) return {};
  acknowledged_->post(*writer_);
  return acknowledged_->keep();
}

void Store::stopWriting() {
  if (acknowledged_) acknowledged_->post(*writer_);
  writer_->stop();
  // on failure the file claims fewer acknowledgements, which is not wrong
  if (acknowledged_) (void)acknowledged_->keep();
}

Status Store::shareLogins(Connection& writer, const StoreAddress& address) {
  ASSIGN_OR_RETURN(const auto lab, PseudonymKey::ofFolder(writer.path().parent_path()));
  const LoginKey key(lab);
  RETURN_IF_ERROR(claimLoginKey(writer, key));
  logins_ = std::make_unique<SharedLogins>(address, key, address.server);
  address_ = address;
  return {};
}

std::unique_ptr<AccessFeed> Store::accessFeed() const {
  return address_ ? makeAccessFeed(*address_) : nullptr;
}

Status Store::storeAuditHead() {
  if (read_only_) return {};
  ASSIGN_OR_RETURN(auto reader, readers_->borrow());
  return advanceAuditHead(*reader);
}

Result<std::unique_ptr<Store>> Store::open(const std::filesystem::path& folder, const Options& options) {
  auto opened = openUnlessWrong(folder, options);
  if (!opened) return wrongStore(opened.error());
  return opened;
}

Result<std::unique_ptr<Store>> Store::openUnlessWrong(const std::filesystem::path& folder,
                                                      const Options& options) {
  const auto path = folder / kDatabaseFile;
  std::error_code ignored;
  // a copy may be about to become the database
  if (!std::filesystem::exists(folder / kCopyingDatabase, ignored))
    RETURN_IF_ERROR(requireDatabase(folder, options));
  std::optional<BackupKey> backup_key;
  if (!options.backup_key.empty()) {
    ASSIGN_OR_RETURN(backup_key, BackupKey::read(options.backup_key));
  }
  RETURN_IF_ERROR(makeFolder(folder));
  RETURN_IF_ERROR(checkOwnFiles(folder));
  ASSIGN_OR_RETURN(auto lock, FolderLock::take(folder, options.holder));
  RETURN_IF_ERROR(finishStoreSwitch(folder));
  RETURN_IF_ERROR(requireDatabase(folder, options));
  ASSIGN_OR_RETURN(auto address, addressOf(folder, options.store_url));
  // before the database is opened: a half-replaced database would be opened with the old one's log
  if (!address.isPostgres()) RETURN_IF_ERROR(finishRestore(folder));
  if (options.together) {
    if (!address.isPostgres())
      return Error{
          ErrorCode::kInvalidInput,
          fmt::format("--together: the database of {} is an SQLite file, which one server has for "
                      "itself: leave --together out, or move to PostgreSQL (needlelab-admin store copy)",
                      folder.string())};
    ASSIGN_OR_RETURN(address.server, serverNameOf(folder));
  }
  // also before opening a database read-only: it frees space
  auto leftovers = removeFolderLeftovers(folder);
  if (!address.isPostgres()) RETURN_IF_ERROR(makeDatabaseFile(path));

  std::unique_ptr<Store> store(new Store(std::move(lock)));
  store->leftovers_ = std::move(leftovers);
  std::string read_only_because;
  if (!address.isPostgres() && options.read_only_because) read_only_because = options.read_only_because();
  auto connection = read_only_because.empty()
                        ? openToWrite(address, options.min_durability)
                        : Result<Connection>(Error{ErrorCode::kNoRoom, read_only_because});
  bool unfinished = false;
  if (connection) {
    // before anything is served: a restored backup does not know later erasures, and a log from before the
    // last end may still contain erased data
    const std::int64_t now_unix_ns = wallNowNs();
    const bool is_alone = connection->isAlone();
    std::optional<DutyLock> duty;
    if (!is_alone) {
      // other servers continue serving and wait for each erasure as usual; another starting server is done
      // soon
      for (int tries = 0; !duty && tries < kTriesForDuty; ++tries) {
        if (tries > 0) std::this_thread::sleep_for(kWaitForDuty / kTriesForDuty);
        ASSIGN_OR_RETURN(duty, Duties(address).take(Duty::kErasure));
      }
      if (!duty)
        return Error{
            ErrorCode::kUnavailable,
            "--together: an erasure is under way at another server, and a start completes those of its "
            "own folder first: start again when it is done"};
    }
    const auto repeated = agreeOnErasures(*connection, now_unix_ns);
    if (!repeated) {
      // its log takes the space that this attempt used
      (void)connection->emptyLog(0);
      return repeated.error().code == ErrorCode::kNoRoom ? pendingErasureError(folder, repeated.error())
                                                         : repeated.error();
    }
    duty.reset();
    ASSIGN_OR_RETURN(store->clock_behind_, SeenTimeStore(*connection).behindText(now_unix_ns));
    ASSIGN_OR_RETURN(store->clock_ahead_, SeenTimeStore(*connection).aheadText(now_unix_ns));
    RETURN_IF_ERROR(SeenTimeStore(*connection).note(now_unix_ns));
    const auto emptied = connection->emptyLog(0);
    if (!emptied) return emptied.error();
    unfinished = *repeated > 0;
    store->erasures_repeated_ = *repeated;
    DbWriter::Options writer = options.writer;
    if (address.isPostgres()) {
      ASSIGN_OR_RETURN(auto mark, AcknowledgedMark::atStart(*connection));
      store->acknowledged_.emplace(std::move(mark));
      writer.lack_at_start = store->acknowledged_->lack();
      // what requires exclusive use of the database is done
      RETURN_IF_ERROR(connection->admitOthers());
    } else {
      // belongs to a database elsewhere, of which this one may be a copy: the next one there starts over
      std::filesystem::remove(folder / kAcknowledgedFile, ignored);
    }
    RETURN_IF_ERROR(options.together ? store->shareLogins(*connection, address)
                                     : removeSharedLogins(*connection));
    store->readers_ = std::make_unique<ReaderPool>(address);
    store->writer_ = std::make_unique<DbWriter>(std::move(*connection), writer, options.on_fatal);
  } else {
    if (connection.error().code != ErrorCode::kNoRoom || address.isPostgres()) return connection.error();
    store->read_only_ = connection.error();
    ASSIGN_OR_RETURN(auto frozen, openFrozen(path, connection.error()));
    constexpr std::size_t kMostIdle = 8;
    store->readers_ = std::make_unique<ReaderPool>(path, kMostIdle, Connection::Mode::kFrozen);
    store->writer_ = std::make_unique<DbWriter>(std::move(frozen), connection.error());
  }
  store->service_ = store->logins_
                        ? std::make_unique<Service>(*store->writer_, *store->readers_, *store->logins_)
                        : std::make_unique<Service>(*store->writer_, *store->readers_, *options.time);
  if (backup_key) store->service_->backups().setKey(std::move(*backup_key));
  store->shared_server_name_ = address.server;
  if (options.together) store->service_->shareDuties(address);
  if (unfinished) (void)store->service_->erasures().finish();
  return store;
}

namespace {

/// A person's or a station's row.
struct AccessRow {
  std::string secret;  ///< hash of the password or key
  bool shut = false;
  int role = 0;
  std::string name{};  ///< display name; the key is a person's ref
};

Result<std::map<std::string, AccessRow>> accessRows(Connection& connection, bool stations) {
  std::map<std::string, AccessRow> all;
  auto rows = connection.prepare(stations ? "SELECT name, key_hash, revoked, 0, name FROM stations"
                                          : "SELECT ref, coalesce(password_hash, ''), disabled, role, name"
                                            " FROM accounts");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return all;
    all[rows.text(0)] = {std::string(textOf(rows.bytes(1))), rows.integer(2) != 0,
                         static_cast<int>(rows.integer(3)), rows.text(4)};
  }
}

/// Why an access of the restored database was no longer valid in the replaced one; empty: it was valid.
std::string accessEnded(const AccessRow& restored, const AccessRow* replaced, bool station) {
  if (restored.shut || restored.secret.empty()) return {};
  if (replaced == nullptr) return "is not in the replaced database";
  if (replaced->shut) return station ? "its key was revoked" : "was disabled";
  if (replaced->secret != restored.secret)
    return station ? "had got a new key; the old one is valid again, the new one is not"
                   : "had a new password; the old one is valid again";
  if (replaced->role != restored.role)
    return "had become " + pb::Role_Name(replaced->role) + ", is " + pb::Role_Name(restored.role) + " again";
  return {};
}

}  // namespace

Result<std::vector<RestoredAccess>> noteAccessValidAgain(Store& store, const std::filesystem::path& kept) {
  // kFrozen: nothing is written beside it
  ASSIGN_OR_RETURN(auto replaced, Connection::open(kept, {.mode = Connection::Mode::kFrozen}));
  std::vector<RestoredAccess> all;
  {
    ASSIGN_OR_RETURN(auto restored, store.readers().borrow());
    for (const bool station : {false, true}) {
      ASSIGN_OR_RETURN(const auto before, accessRows(replaced, station));
      ASSIGN_OR_RETURN(const auto now, accessRows(*restored, station));
      for (const auto& [name, row] : now) {
        const auto found = before.find(name);
        const std::string why = accessEnded(row, found == before.end() ? nullptr : &found->second, station);
        if (!why.empty())
          all.push_back(
              {row.name, name, station, std::string(station ? "station " : "user ") + row.name + ": " + why});
      }
    }
  }
  std::sort(all.begin(), all.end(), [](const RestoredAccess& a, const RestoredAccess& b) {
    return std::tie(a.station, a.name) < std::tie(b.station, b.name);
  });
  for (const RestoredAccess& one : all)
    RETURN_IF_ERROR(store.service().notes().note(
        "local", "access valid again", one.ref,
        (one.station ? "station " : "user ") + one.ref + one.text.substr(one.text.find(": "))));
  return all;
}

}  // namespace needlelab
