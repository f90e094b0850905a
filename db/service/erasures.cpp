// Erases a person's data. Order: checks that may refuse; the line in DIR/erasures; the transaction. After a
// crash between the last two, the erasure is reported as to be repeated and never forgotten.
#include "db/service/erasures.h"

#include <fmt/core.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string_view>
#include <utility>

#include "common/base/text.h"
#include "db/audit.h"
#include "db/encrypted_backup.h"
#include "db/erasure.h"
#include "db/free_parts.h"
#include "db/people.h"
#include "db/pseudonyms.h"
#include "db/schema.h"
#include "db/service/handlers.h"
#include "db/session_rows.h"

namespace needlelab::handlers {
namespace {

/// Whether a database that lies aside names the person as somebody's name; true also when that cannot be
/// read, as in an encrypted backup.
bool namesPerson(const std::filesystem::path& path, const std::string& name) {
  if (isEncryptedBackup(path)) return true;
  std::error_code error;
  const std::filesystem::path memory = path.string() + "-shm", log = path.string() + "-wal";
  const bool had_memory = std::filesystem::exists(memory, error);
  const bool had_log = std::filesystem::exists(log, error);
  bool names = true;
  if (auto opened = Connection::open(path, {.mode = Connection::Mode::kReader, .busy_timeout_ms = 0})) {
    const auto found = opened
                           ->query(
                               "SELECT 1 FROM people WHERE name = ?1"
                               " UNION ALL SELECT 1 FROM sessions WHERE trainee = ?1"
                               " UNION ALL SELECT 1 FROM audit WHERE who = ?1 OR subject = ?1 LIMIT 1",
                               name)
                           .step();
    names = !found || *found;
  }
  // a replaced database makes them when it is read
  if (!had_memory) std::filesystem::remove(memory, error);
  if (!had_log) std::filesystem::remove(log, error);
  return names;
}

/// What SQLite or a backup put beside a database: its name ends with one of these.
constexpr std::array<std::string_view, 2> kLogs = {"-wal", "-journal"};

bool isDatabase(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::array<char, 16> start{};
  in.read(start.data(), start.size());
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  return std::string_view(start.data(), start.size()) == kMagic || isEncryptedBackup(path);
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

/// Databases below the folder of the one in use, and where the last backup was put, that name the person:
/// replaced ones and backups, each with its log. Unfinished copies of backups, and logs whose database is
/// gone, are listed unread.
std::vector<std::filesystem::path> filesThatName(const std::filesystem::path& folder,
                                                 const std::filesystem::path& backups,
                                                 const std::string& name) {
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
  for (const auto& path : databases)
    if (namesPerson(path, name)) naming.insert(path);
  for (const auto& path : logs) {
    const std::string text = path.string();
    const std::filesystem::path of = text.substr(0, text.rfind('-'));
    std::error_code ignored;
    const bool orphan = !std::filesystem::exists(of, ignored) &&
                        (of.filename().string().starts_with("needlelab") || isUnfinishedCopy(of.string()));
    // a journal may have been rolled back into its database, which was read
    if ((naming.contains(of) || orphan) && std::filesystem::exists(path, ignored)) naming.insert(path);
  }
  return {naming.begin(), naming.end()};
}

/// What the erasure of a name that nobody had does not reach.
std::string textOnLater(const std::string& name) {
  return fmt::format(
      "Nobody has the name '{0}', so sessions under it that stations deliver from now on are kept, also "
      "older "
      "ones: erase '{0}' again once all stations have delivered theirs. ",
      name);
}

/// kNoRoom unless the disk has room for what the erasure's transaction writes to the person's sessions. For
/// what others wrote of the person ErasureStore::erase() asks as it goes on.
Status checkRoomToErase(Connection& connection, const std::string& name) {
  constexpr std::uint64_t kOfSession = 64 << 10;
  ASSIGN_OR_RETURN(const auto rows,
                   connection
                       .query("SELECT count(*), coalesce(sum(length(profile_json) + length(description)"
                              " + coalesce(length(score_json), 0)), 0) FROM sessions WHERE trainee = ?",
                              name)
                       .first([](const Statement& row) {
                         return std::pair{row.natural(0), row.natural(1)};
                       }));
  const auto [sessions, bytes] = rows.value_or(std::pair<std::uint64_t, std::uint64_t>());
  // in the log, and once more in the database
  const std::uint64_t needed = ErasureStore::kRoomLeft_bytes + 2 * (bytes + sessions * kOfSession);
  std::error_code error;
  const auto folder = connection.path().parent_path();
  const auto space = std::filesystem::space(folder, error);
  if (error || space.available >= needed) return {};
  return Error{
      ErrorCode::kNoRoom,
      fmt::format("the disk of {} has {} MiB left, and the erasure of '{}' may write {} MiB: make room "
                  "on it, then erase again",
                  folder.string(), space.available >> 20, name, (needed >> 20) + 1)};
}

/// What to do with sessions that wait under the name; empty: there are none.
std::string textOnWaiting(const std::string& name, std::uint64_t sessions) {
  if (sessions == 0) return {};
  return fmt::format(
      "Sessions that wait for a manager under the name '{0}', which were left because they may be another "
      "person's: {1}. Give them to the right person (needlelab-admin session list --unknown-trainee, session "
      "assign), or erase them, too: needlelab-admin person erase '{0}' --confirm '{0}'. ",
      name, sessions);
}

}  // namespace

Result<pb::Reply> erasePerson(const Context& context, const pb::ErasePerson& call) {
  if (call.confirm() != call.name() || call.name().empty())
    return Error{ErrorCode::kInvalidInput, "confirm: to erase all data of '" + call.name() +
                                               "' for ever, give its name here; found '" + call.confirm() +
                                               "'"};
  if (call.name() == context.who.name)
    return Error{ErrorCode::kDenied, "nobody erases itself: let another administrator do it"};
  const auto open = ErasureStore(context.reader).openSessions(call.name(), call.with_waiting_sessions());
  if (!open) return open.error();
  if (!open->empty() && !call.with_open_sessions())
    return Error{ErrorCode::kUnavailable,
                 "'" + call.name() + "' has a session that is open, " + open->front() +
                     (open->size() > 1 ? " and others" : "") +
                     ": let it be ended first, or say that what is still sent of it shall not be kept "
                     "(with_open_sessions)"};
  RETURN_IF_ERROR(checkRoomToErase(context.reader, call.name()));
  const auto folder = context.reader.path().parent_path();
  ASSIGN_OR_RETURN(const auto key, ErasureStore(context.reader).key());

  // one at a time, because the file is read and written as a whole
  static std::mutex one_erasure;
  const std::scoped_lock lock(one_erasure);
  ASSIGN_OR_RETURN(auto lines, readErasures(folder));
  const auto before = lines;
  const auto hash = key.nameHash(call.name());
  // an erasure repeated after a restore keeps its pseudonym
  ASSIGN_OR_RETURN(const auto repeat, ErasureStore(context.reader).toRepeat(folder));
  const auto again = std::find_if(repeat.begin(), repeat.end(),
                                  [&](const auto& erasure) { return erasure.name == call.name(); });
  ASSIGN_OR_RETURN(const auto person, PeopleStore(context.reader).find(call.name()));
  ErasureLine unsealed{newErasurePseudonym(), hash, context.now_unix_ns, call.with_waiting_sessions()};
  unsealed.without_account = !person;
  if (again != repeat.end()) {
    unsealed.pseudonym = again->line.pseudonym;
    unsealed.without_account = !person && again->line.without_account;
  }
  const ErasureLine line = sealed(std::move(unsealed), key);
  std::erase_if(lines, [&](const ErasureLine& other) { return other.pseudonym == line.pseudonym; });
  lines.push_back(line);
  sealOld(lines, key);
  RETURN_IF_ERROR(writeErasures(folder, lines));

  pb::Erasure erasure;
  bool keeps_later = false;
  const auto status = context.writer.run([&](Connection& writer) -> Status {
    ASSIGN_OR_RETURN(auto done,
                     ErasureStore(writer).erase(call.name(), line, context.who.name, call.reason(),
                                                context.now_unix_ns, call.with_waiting_sessions()));
    erasure = std::move(done);
    ASSIGN_OR_RETURN(const auto owner,
                     ErasureStore(writer).ownerOf(call.name(), context.now_unix_ns, context.now_unix_ns));
    keeps_later = !owner.pseudonym;
    std::string detail = fmt::format("{} sessions, {} recordings, {} scores", erasure.sessions(),
                                     erasure.recordings(), erasure.scores());
    if (erasure.waiting_sessions() > 0)
      detail += fmt::format("; {} sessions that wait were left", erasure.waiting_sessions());
    return AuditStore(writer).add(
        {0, context.now_unix_ns, context.who.name, std::string(context.action), line.pseudonym, detail});
  });
  if (!status) {
    // nothing was erased, so the file must not say so
    RETURN_IF_ERROR(writeErasures(folder, before));
    // what was undone keeps its room in the log
    if (status.error().code == ErrorCode::kNoRoom)
      (void)context.writer.emptyLog(std::chrono::milliseconds::zero());
    return status.error();
  }
  const auto backup = MetaStore(context.reader).get("backup_path");
  const std::filesystem::path backups =
      backup && *backup ? std::filesystem::path(**backup).parent_path() : std::filesystem::path();
  // a restore of one of them on another machine must know, too; a stick that is not there learns it from the
  // next backup
  if (std::error_code missing; std::filesystem::is_directory(backups, missing))
    (void)addErasures(backups, lines, kErasuresCopy, &key);
  const auto files = filesThatName(folder, backups, call.name());
  std::string named;
  for (const auto& file : files) {
    erasure.add_files(file.string());
    named += (named.empty() ? "" : ", ") + file.string();
  }
  erasure.set_text(
      (keeps_later ? textOnLater(call.name()) : "") + textOnWaiting(call.name(), erasure.waiting_sessions()) +
      erasure.text() +
      (files.empty()
           ? std::string("No backup and no replaced database that this machine knows of names this "
                         "person. ")
           : fmt::format("These still hold this person's data: {}. Remove them; a backup among them "
                         "that is restored is erased anew before it serves. ",
                         named)) +
      "Backups elsewhere hold it until they are removed; the server's own log files go by their rotation.");
  pb::Reply reply;
  *reply.mutable_erasure() = std::move(erasure);
  return reply;
}

}  // namespace needlelab::handlers

namespace needlelab {

Result<std::size_t> repeatErasures(Connection& writer, std::int64_t now_unix_ns) {
  ErasureStore store(writer);
  const auto repeat = store.toRepeat(writer.path().parent_path());
  // the server's log and `check` report a missing key or a broken list
  if (!repeat && repeat.error().code == ErrorCode::kCorrupt) return std::size_t{0};
  if (!repeat) return repeat.error();
  std::size_t count = 0;
  std::set<std::string> stay;
  for (const ErasureToRepeat& one : *repeat) {
    if (!one.restored) continue;
    (void)writer.emptyLog(0);  // a start before this one may have been killed, and its log has the room
    RETURN_IF_ERROR(handlers::checkRoomToErase(writer, one.name));
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
    const auto done = store.erase(one.name, one.line, kServerName, "repeated after a restore", now_unix_ns,
                                  one.line.with_waiting);
    // the last administrator, or a name that an erasure before this one took: they stay as they are
    if (!done && (done.error().code == ErrorCode::kDenied || done.error().code == ErrorCode::kNotFound)) {
      if (done.error().code == ErrorCode::kDenied) stay.insert(one.line.pseudonym);
      continue;
    }
    if (!done) return done.error();
    RETURN_IF_ERROR(
        AuditStore(writer).add({0, now_unix_ns, kServerName, "person erase", one.line.pseudonym,
                                fmt::format("repeated after a restore: {} sessions, {} recordings, {} scores",
                                            done->sessions(), done->recordings(), done->scores())}));
    RETURN_IF_ERROR(transaction.commit());
    ++count;
  }
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(store.rememberList(writer.path().parent_path(), stay));
  RETURN_IF_ERROR(transaction.commit());
  return count;
}

namespace {

/// Numbers and descriptions of the sessions that were erased and have their profile.
Result<std::vector<std::pair<std::int64_t, std::string>>> keepingProfiles(
    const std::filesystem::path& database) {
  ASSIGN_OR_RETURN(auto reader, Connection::open(database, {.mode = Connection::Mode::kReader}));
  return reader
      .query("SELECT number, description FROM sessions WHERE erased = 1 AND profile_json <> ?",
             kErasedProfile)
      .all([](const Statement& row) {
        return std::pair{row.integer(0), std::string(textOf(row.bytes(1)))};
      });
}

}  // namespace

Result<std::size_t> clearOlderErasures(Connection& writer, std::int64_t now_unix_ns) {
  constexpr std::string_view kCleared = "erased_profiles_cleared";
  ASSIGN_OR_RETURN(const auto cleared, MetaStore(writer).get(kCleared));
  if (cleared) return std::size_t{0};
  // with a connection of its own: a page that cannot be read must not stop the writer, and `check` says it
  const auto sessions = keepingProfiles(writer.path());
  if (!sessions) return std::size_t{0};
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
  for (const auto& [number, stored] : *sessions) {
    pb::SessionDescription description;
    const bool is_read = description.ParseFromString(stored);  // if not, `check` says it
    clearDeviceWords(description);
    RETURN_IF_ERROR(writer.run("UPDATE sessions SET description = ?, profile_json = ? WHERE number = ?",
                               viewOf(is_read ? description.SerializeAsString() : stored), kErasedProfile,
                               number));
  }
  if (!sessions->empty()) {
    RETURN_IF_ERROR(MetaStore(writer).set(kFreePartsKey, "1"));
    RETURN_IF_ERROR(AuditStore(writer).add(
        {0, now_unix_ns, kServerName, "person erase", "",
         fmt::format("completed: {} sessions that an earlier version erased had kept their profiles",
                     sessions->size())}));
  }
  RETURN_IF_ERROR(MetaStore(writer).set(kCleared, "1"));
  RETURN_IF_ERROR(transaction.commit());
  return sessions->size();
}

namespace {

std::string textOfField(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && found->is_string() ? found->get<std::string>() : std::string();
}
std::int64_t timeOfField(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && found->is_number_integer() ? found->get<std::int64_t>() : 0;
}

/// The fields for the person who did something, and the time.
struct DoerField {
  const char* doer;
  const char* when;
};
constexpr DoerField kDoerFields[] = {{"changed_by", "changed_unix_ns"}, {"recorded_by", "unix_ns"},
                                     {"author", "created_unix_ns"},     {"by_whom", "created_unix_ns"},
                                     {"by_whom", "changed_unix_ns"},    {"by_whom", "erased_unix_ns"},
                                     {"by_whom", "assigned_unix_ns"}};

/// As clearOlderErasures(): an export by an earlier version has what it left in an erased session.
void clearErased(RecordJson& record) {
  if (textOfField(record, "profile_json") == kErasedProfile) return;
  record["profile_json"] = kErasedProfile;
  const auto bytes = bytesOfHex(textOfField(record, "description"));
  pb::SessionDescription description;
  if (!bytes || !description.ParseFromString(*bytes)) return;  // the import refuses it, or `check` says it
  clearDeviceWords(description);
  record["description"] = hexDigitsOf(description.SerializeAsString());
}

}  // namespace

Result<ImportErasures> ImportErasures::open(Connection& writer) {
  ImportErasures all(writer);
  const auto folder = writer.path().parent_path();
  ASSIGN_OR_RETURN(auto lines, readErasures(folder));
  all.lines_ = std::move(lines);
  auto rows = writer.prepare("SELECT pseudonym, name_hash, erased_unix_ns FROM erasures");
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, rows.step());
    if (!row) break;
    ErasureLine line{rows.text(0), {}, rows.integer(2)};
    const auto bytes = rows.bytes(1);
    if (bytes.size() == line.name_hash.size()) {
      std::copy(bytes.begin(), bytes.end(), line.name_hash.begin());
      all.lines_.push_back(std::move(line));
    }
  }
  if (all.lines_.empty()) return all;
  ASSIGN_OR_RETURN(auto key, ErasureStore(writer).key());
  all.key_ = key;
  dropFaulty(all.lines_, key);
  return all;
}

void ImportErasures::foresee(const RecordJson& record) {
  const auto text = [&](const char* field) {
    const auto found = record.find(field);
    return found != record.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (!key_ || !record.is_object()) return;
  if (text("kind") == "unknown_trainee" && text("by_whom").empty()) waiting_.insert(text("session"));
  if (text("kind") == "erasure") exported_.insert(text("pseudonym"));
}

bool ImportErasures::wasLeft(const std::string& id_digits, const std::string& name,
                             const std::string& pseudonym) const {
  const bool account =
      std::any_of(met_.begin(), met_.end(), [&](const ErasedNames& names) { return names.name == name; });
  return waiting_.contains(id_digits) && (account || exported_.contains(pseudonym));
}

std::optional<std::string> ImportErasures::pseudonymOf(const std::string& name,
                                                       std::int64_t made_unix_ns) const {
  if (!key_ || name.empty()) return std::nullopt;
  const auto hash = key_->nameHash(name);
  for (const ErasureLine& line : lines_) {
    if (line.name_hash == hash && line.unix_ns >= made_unix_ns) return line.pseudonym;
  }
  return std::nullopt;
}

Result<bool> ImportErasures::isOfErasedSession(const std::string& id_digits) {
  const auto known = sessions_.find(id_digits);
  if (known != sessions_.end()) return known->second;
  const auto bytes = bytesOfHex(id_digits);
  if (!bytes) return false;
  auto row = writer_.query("SELECT erased FROM sessions WHERE id = ?", viewOf(*bytes));
  ASSIGN_OR_RETURN(const auto found, row.step());
  const bool erased = found && row.integer(0) != 0;
  sessions_.emplace(id_digits, erased);
  if (erased) session_texts_.insert(sessionText(*bytes));
  return erased;
}

Result<bool> ImportErasures::isOfErased(const RecordTable& table, const RecordJson& record) {
  const auto owner = [&](const char* name, const char* when) {
    return pseudonymOf(textOfField(record, name), timeOfField(record, when));
  };
  if (table.kind == "person") {
    const auto pseudonym = owner("name", "created_unix_ns");
    if (!pseudonym) return false;
    ErasedNames names{textOfField(record, "name"), {}, {}, *pseudonym, {}};
    if (const std::string full_name = textOfField(record, "full_name"); !full_name.empty())
      names.full_names.push_back(full_name);
    RETURN_IF_ERROR(addOthers(writer_, names));
    met_.push_back(std::move(names));
    return true;
  }
  if (table.kind == "consent") return owner("person", "unix_ns").has_value();
  if (table.kind == "assignment") return owner("trainee", "created_unix_ns").has_value();
  if (table.kind == "group_member") {
    // the record has no time: decide by whether the person existed before it
    const std::string name = textOfField(record, "person");
    return std::any_of(met_.begin(), met_.end(), [&](const auto& names) { return names.name == name; });
  }
  if (table.kind == "session") {
    const std::string id = textOfField(record, "id");
    const auto pseudonym = owner("trainee", "received_unix_ns");
    const bool erased = pseudonym && !wasLeft(id, textOfField(record, "trainee"), *pseudonym);
    if (!erased && timeOfField(record, "erased") != 0) return false;  // an exported pseudonym
    if (erased) {
      sessions_[id] = true;
      owners_[id] = textOfField(record, "trainee");
      if (const auto bytes = bytesOfHex(id)) session_texts_.insert(sessionText(*bytes));
      return true;
    }
    return isOfErasedSession(id);
  }
  if (table.kind == "unknown_trainee") {
    if (const auto owner_of = owners_.find(textOfField(record, "session")); owner_of != owners_.end()) {
      for (ErasedNames& names : met_)
        if (names.name == owner_of->second) names.given.push_back(textOfField(record, "given"));
    }
  }
  if (record.contains("session") && (table.kind == "score" || table.kind == "event" ||
                                     table.kind == "annotation" || table.kind == "unknown_trainee"))
    return isOfErasedSession(textOfField(record, "session"));
  return false;
}

void ImportErasures::replaceDoer(RecordJson& record, const char* doer, const char* when) const {
  if (!record.contains(doer) || !record.contains(when)) return;
  if (const auto pseudonym = pseudonymOf(textOfField(record, doer), timeOfField(record, when)))
    record[doer] = *pseudonym;
}

Status ImportErasures::replaceGiven(RecordJson& record) {
  const auto bytes = bytesOfHex(textOfField(record, "session"));
  if (!bytes) return {};
  ASSIGN_OR_RETURN(const auto received_unix_ns,
                   writer_.query("SELECT received_unix_ns FROM sessions WHERE id = ?", viewOf(*bytes))
                       .first([](const Statement& row) { return row.integer(0); }));
  if (!received_unix_ns) return {};  // the import says that it is not there
  const auto pseudonym = pseudonymOf(textOfField(record, "given"), *received_unix_ns);
  if (!pseudonym) return {};
  if (wasLeft(textOfField(record, "session"), textOfField(record, "given"), *pseudonym)) return {};
  // remarks and lines of the audit log, which come later, may have it too
  ErasedNames names{textOfField(record, "given"), {}, {}, *pseudonym, {}};
  RETURN_IF_ERROR(addOthers(writer_, names));
  met_.push_back(std::move(names));
  record["given"] = *pseudonym;
  return {};
}

Result<ImportErasures::Verdict> ImportErasures::look(const RecordTable& table, RecordJson& record) {
  if (table.kind == "session" && timeOfField(record, "erased") != 0) clearErased(record);
  if (!key_) return Verdict::kTake;
  ASSIGN_OR_RETURN(const auto left_out, isOfErased(table, record));
  if (left_out) return Verdict::kLeftOut;
  for (const DoerField& field : kDoerFields) replaceDoer(record, field.doer, field.when);
  if (table.kind == "unknown_trainee") RETURN_IF_ERROR(replaceGiven(record));
  if (table.kind == "annotation") {
    for (const ErasedNames& names : met_)
      record["text"] = withoutNames(textOfField(record, "text"), names, false);
  }
  if (table.kind == "group") {
    for (const ErasedNames& names : met_)
      if (pseudonymOf(names.name, timeOfField(record, "changed_unix_ns")))
        record["name"] = withoutNames(textOfField(record, "name"), names, false);
  }
  if (table.kind == "audit") {
    AuditRow line{0,
                  timeOfField(record, "unix_ns"),
                  textOfField(record, "who"),
                  textOfField(record, "action"),
                  textOfField(record, "subject"),
                  textOfField(record, "detail")};
    for (const ErasedNames& names : met_) {
      if (pseudonymOf(names.name, line.unix_ns)) line = withoutNames(line, names, session_texts_);
    }
    // an erased person without a record in this import, as far as the line shows it
    for (std::string* name : {&line.who, &line.subject}) {
      const auto pseudonym = pseudonymOf(*name, line.unix_ns);
      if (!pseudonym) continue;
      const ErasedNames names{*name, {}, {}, *pseudonym, {}};
      line = withoutNames(line, names, session_texts_);
    }
    record["who"] = line.who;
    record["subject"] = line.subject;
    record["detail"] = line.detail;
  }
  return Verdict::kTake;
}

bool ImportErasures::isErasuresWork(const RecordTable& table, const RecordJson& there,
                                    const RecordJson& record) const {
  if (!key_) return false;
  RecordJson a = there, b = record;
  // a removed member gives the group another revision; a remark and a group's name have a pseudonym in place
  // of a name
  if (table.kind == "group" && timeOfField(a, "revision") > timeOfField(b, "revision")) {
    a["revision"] = b["revision"];
    if (textOfField(a, "name").find("erased-") != std::string::npos) a["name"] = b["name"];
  }
  if (table.kind == "annotation" && textOfField(a, "text").find("erased-") != std::string::npos)
    a["text"] = b["text"];
  if (table.kind == "unknown_trainee" && textOfField(a, "given").starts_with("erased-"))
    a["given"] = b["given"];
  return a == b;
}

}  // namespace needlelab
