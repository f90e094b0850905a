// Erases a person. Order: checks that may refuse; the line in DIR/erasures; the transaction. After a crash
// between the last two, the next start erases the person.
#include "db/service/records/erasures.h"

#include <fmt/core.h>

#include <chrono>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "db/audit/audit.h"
#include "db/backup/old_backups.h"
#include "db/erasure/erasure.h"
#include "db/people/person_name.h"
#include "db/service/context/long_work.h"
#include "db/service/records/retention_runs.h"
#include "db/service/scoring/session_scoring.h"
#include "db/store/duties.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

/// For the list, which is read and written as a whole.
std::mutex& listMutex() {
  static std::mutex one_at_a_time;
  return one_at_a_time;
}

std::filesystem::path folderOf(Connection& connection) {
  return connection.path().parent_path();
}

/// What an erasure cannot reach in PostgreSQL's files.
constexpr const char* kTextOnPostgres =
    "PostgreSQL keeps what was erased in free parts of its pages, its log, the archive of the log, standbys, "
    "base backups and dumps until these are overwritten or removed: see FACULTY.md, \"Erasure on "
    "PostgreSQL\". ";

Status checkRoomToErase(Connection& connection, const std::string& ref) {
  // a disk found full within a transaction stops the writer
  constexpr std::uint64_t kOfSession = 64 << 10, kRoomLeft_bytes = 32 << 20;
  ASSIGN_OR_RETURN(const auto rows,
                   connection
                       .query("SELECT count(*), coalesce(sum(length(profile_json) + length(description)"
                              " + coalesce(length(score_json), 0)), 0) FROM sessions WHERE trainee = ?",
                              ref)
                       .first([](const Statement& row) {
                         return std::pair{row.natural(0), row.natural(1)};
                       }));
  const auto [sessions, bytes] = rows.value_or(std::pair<std::uint64_t, std::uint64_t>());
  // once in the log, once more in the database
  const std::uint64_t needed = kRoomLeft_bytes + 2 * (bytes + sessions * kOfSession);
  std::error_code error;
  const auto folder = connection.path().parent_path();
  const auto space = std::filesystem::space(folder, error);
  if (error || space.available >= needed) return {};
  return Error{
      ErrorCode::kNoRoom,
      fmt::format("the disk of {} has {} MiB left, and the erasure of '{}' may write {} MiB: make room "
                  "on it, then erase again",
                  folder.string(), space.available >> 20, ref, (needed >> 20) + 1)};
}

/// Which backups contain the name, and until when.
std::string textOnBackups(Connection& reader) {
  const auto folder = backupsFolder(reader);
  std::vector<std::filesystem::path> backups;
  if (!folder.empty())
    if (auto found = backupsIn(folder)) backups = std::move(*found);
  if (backups.empty()) return "Backups that were made before have the name until somebody removes them. ";
  return fmt::format(
      "{} backups in {}, up to {}, have the name until they are removed: each new backup there with keep = N "
      "leaves N. One that is restored is erased again before anything is served. Backups elsewhere, too, "
      "have the name until somebody removes them. ",
      backups.size(), printable(folder.string()), printable(backups.back().filename().string()));
}

/// After the transaction ended with an error: whether the person is erased nevertheless, because only the
/// COMMIT's answer was lost. Nothing: unknown.
std::optional<bool> isErasedNow(DbWriter& writer, const Uuid& person) {
  bool erased = false;
  const Status asked = writer.run([&](Connection& connection) -> Status {
    ASSIGN_OR_RETURN(erased, isErased(connection, person));
    return {};
  });
  return asked ? std::optional(erased) : std::nullopt;
}

Result<pb::Reply> eraseUpToCommit(const handlers::Context& context, const pb::ErasePerson& call) {
  if (call.confirm() != call.name() || call.name().empty())
    return Error{ErrorCode::kInvalidInput, "confirm: to erase all data of '" + call.name() +
                                               "' for ever, give its name here; found '" + call.confirm() +
                                               "'"};
  if (call.name() == context.who.name)
    return Error{ErrorCode::kDenied, "you cannot erase yourself: ask another administrator"};
  ASSIGN_OR_RETURN(const auto open,
                   ErasureStore(context.reader).openSessions(call.name(), call.with_waiting_sessions()));
  if (!open.empty() && !call.with_open_sessions())
    return Error{ErrorCode::kUnavailable,
                 "'" + call.name() + "' has a session that is open, " + open.front() +
                     (open.size() > 1 ? " and others" : "") +
                     ": let it be ended first, or say that what is still sent of it shall not be kept "
                     "(with_open_sessions)"};

  RETURN_IF_ERROR(checkRoomToErase(context.reader, call.name()));
  const std::scoped_lock lock(listMutex());
  ASSIGN_OR_RETURN(const auto duty, context.parts.long_work.duties->take(Duty::kErasure));
  if (!duty)
    return Error{ErrorCode::kUnavailable,
                 "an erasure is under way at another server: try again when it is done"};
  const auto folder = folderOf(context.reader);
  ASSIGN_OR_RETURN(const auto before, readErasures(folder));
  ASSIGN_OR_RETURN(const auto name, shownName(context.reader, call.name()));
  ASSIGN_OR_RETURN(const auto line, ErasureStore(context.reader).lineOf(call.name(), context.now_unix_ns));
  RETURN_IF_ERROR(addErasures(folder, {line}));
  pb::Erasure erasure;
  const ErasureOrder order{context.who.name, call.reason(), context.now_unix_ns,
                           call.with_waiting_sessions()};
  const Status status = context.writer.run([&](Connection& writer) -> Status {
    RETURN_IF_ERROR(checkAccess(writer, context.who));
    ASSIGN_OR_RETURN(erasure, ErasureStore(writer).erase(call.name(), order));
    std::string detail = fmt::format("{} sessions, {} recordings, {} scores", erasure.sessions(),
                                     erasure.recordings(), erasure.scores());
    if (erasure.waiting_sessions() > 0)
      detail += fmt::format("; {} sessions that wait were left", erasure.waiting_sessions());
    return AuditStore(writer).add(
        {0, context.now_unix_ns, context.who.name, std::string(context.action), call.name(), detail});
  });
  std::string text;
  if (!status) {
    const auto erased = isErasedNow(context.writer, line.person);
    if (!erased)
      return Error{
          status.error().code,
          fmt::format("{}; it is unknown whether '{}' was erased: the next start of the server completes it",
                      status.error().message, call.name())};
    if (!*erased) {
      RETURN_IF_ERROR(writeErasures(folder, before));
      return status.error();
    }
    text = "The person is erased, but the answer to the commit was: " + status.error().message + ". ";
  }
  text += erasure.text();
  if (erasure.waiting_sessions() > 0)
    text += fmt::format(
        "Sessions that wait for a manager under the name '{0}', which were left because they may be another "
        "person's: {1}. Give them to the right person (needlelab-admin session list --unknown-trainee, "
        "session "
        "assign), or erase them, too: needlelab-admin person erase '{0}' --confirm '{0}'. ",
        name, erasure.waiting_sessions());
  if (context.reader.sqlite() == nullptr) text += kTextOnPostgres;
  erasure.set_text(text + textOnBackups(context.reader));
  pb::Reply reply;
  *reply.mutable_erasure() = std::move(erasure);
  return reply;
}

}  // namespace

Result<std::size_t> agreeOnErasures(Connection& writer, std::int64_t now_unix_ns) {
  const std::scoped_lock lock(listMutex());
  ASSIGN_OR_RETURN(const auto lines, readErasures(folderOf(writer)));
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(writer, Transaction::Kind::kWrite));
  ASSIGN_OR_RETURN(const auto erased, ErasureStore(writer).repeat(lines, now_unix_ns));
  if (erased > 0)
    RETURN_IF_ERROR(AuditStore(writer).add({0, now_unix_ns, "server", "person erase", "",
                                            fmt::format("{} people of the list of erasures, whom a restored "
                                                        "backup had brought back",
                                                        erased)}));
  ASSIGN_OR_RETURN(const auto known, ErasureStore(writer).known());
  RETURN_IF_ERROR(transaction.commit());
  RETURN_IF_ERROR(addErasures(folderOf(writer), known));
  return erased;
}

Status completeErasures(Connection& connection) {
  const std::scoped_lock lock(listMutex());
  ASSIGN_OR_RETURN(const auto known, ErasureStore(connection).known());
  return addErasures(folderOf(connection), known);
}

Status writeErasuresNextToBackups(Connection& connection, const std::filesystem::path& backups) {
  if (backups.empty()) return {};
  const std::scoped_lock lock(listMutex());
  ASSIGN_OR_RETURN(const auto lines, readErasures(folderOf(connection)));
  return lines.empty() ? Status() : addErasures(backups, lines, kErasuresCopy);
}

std::filesystem::path backupsFolder(Connection& reader) {
  const auto backup = MetaStore(reader).get("backup_path");
  if (!backup || !*backup) return {};
  auto folder = std::filesystem::path(**backup).parent_path();
  std::error_code missing;
  return std::filesystem::is_directory(folder, missing) ? folder : std::filesystem::path();
}

Result<pb::Reply> Erasures::begin(const handlers::Context& context, const pb::ErasePerson& call) {
  const auto done = std::make_shared<ErasureUnderWay>();
  ASSIGN_OR_RETURN(done->reply, eraseUpToCommit(context, call));
  scoring_.forgetRecordings();
  context.under_way.erasure = done;
  context.under_way.more = true;
  return done->reply;
}

// The erasure is final regardless of these steps: the reply says what is left.
Result<pb::Reply> Erasures::goOn(RequestUnderWay& under_way) {
  ErasureUnderWay& done = *under_way.erasure;
  pb::Erasure& erasure = *done.reply.mutable_erasure();
  under_way.more = done.chunks.more;
  if (done.chunks.more) {
    done.text_on_chunks = retention_.removeErased(long_work_.pace, kErasedPiecesAtOnce, done.chunks);
    under_way.more = true;
    return done.reply;
  }
  const std::string log = emptyLog();
  erasure.set_pending(!log.empty());
  std::string beside;
  if (auto reader = readers_.borrow())
    if (const Status written = writeErasuresNextToBackups(**reader, backupsFolder(**reader)); !written)
      beside = "The list of erasures beside the backups could not be written (" + written.error().message +
               "): the next backup writes it. ";
  erasure.set_text(done.text_on_chunks + log + beside + erasure.text());
  return done.reply;
}

std::string Erasures::finish() {
  RetentionPace at_once = long_work_.pace;
  at_once.pause = std::chrono::milliseconds(0);
  at_once.rows = 4096;
  LeftoversSoFar chunks;
  const std::string text = retention_.removeErased(at_once, std::numeric_limits<std::size_t>::max(), chunks);
  return text + emptyLog();
}

std::string Erasures::emptyLog() {
  constexpr std::chrono::seconds kPatience{2};
  if (writer_.emptyLog(kPatience)) return {};
  return "Pending: the log beside the database (needlelab.db-wal) still has what was erased, because "
         "somebody "
         "reads (a backup, an export). It is overwritten when that is done, at the latest by the next start. "
         "Until then 'check' says so. ";
}

Status Erasures::completeList() {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return completeErasures(*reader);
}

}  // namespace needlelab
