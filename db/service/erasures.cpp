// Erases a person's data. Order: checks that may refuse; a look for the name; the line in DIR/erasures; the
// name in remarks and audit lines, a page at a time; the person's sessions, if they are many, a page at a
// time; the transaction. After a crash between the line and the end of the transaction, the next start
// repeats the erasure.
#include "db/service/erasures.h"

#include <fmt/core.h>
#include <sys/stat.h>
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "common/base/local_time.h"
#include "common/base/text.h"
#include "db/audit.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/pseudonyms.h"
#include "db/schema.h"
#include "db/service/handlers.h"
#include "db/service/other_stores.h"

namespace needlelab {

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

Result<std::string> settleErasure(DbWriter& writer, const std::filesystem::path& folder,
                                  const ErasureLine& line, const std::vector<ErasureLine>& before,
                                  const Error& why) {
  bool is_erased = false;
  // by the writer: it begins when the transaction before it has ended
  const Status asked = writer.run([&](Connection& connection) -> Status {
    // an erasure that was repeated has its pseudonym from before
    ASSIGN_OR_RETURN(const auto row,
                     connection
                         .query("SELECT pseudonym FROM erasures WHERE pseudonym = ?1 AND erased_unix_ns = ?2",
                                line.pseudonym, line.unix_ns)
                         .first(firstText));
    is_erased = row.has_value();
    return {};
  });
  if (!asked)
    return Error{why.code,
                 fmt::format("{}; nobody can tell whether '{}' was erased ({}). The list of erasures keeps "
                             "the line, and the next start of the server erases the person if the database "
                             "does not have the erasure",
                             why.message, line.pseudonym, asked.error().message)};
  if (is_erased)
    return "The person is erased, but the answer to the last commit was: " + why.message +
           ". The list of erasures has the line, so a start repeats the erasure where the database lacks "
           "it. ";
  // the person was not erased, so the file must not say so
  if (const Status written = writeErasures(folder, before); !written)
    return Error{why.code, why.message + "; " + written.error().message};
  return why;
}

namespace {

/// One erasure at a time, because the lists are read and written as a whole.
std::mutex& erasureLists() {
  static std::mutex one_at_a_time;
  return one_at_a_time;
}

}  // namespace

Result<bool> completeErasures(Connection& connection) {
  const std::unique_lock lock(erasureLists(), std::try_to_lock);
  if (!lock) return false;
  RETURN_IF_ERROR(ErasureStore(connection).completeList(connection.path().parent_path()));
  return true;
}

}  // namespace needlelab

namespace needlelab::handlers {
namespace {

/// What the erasure of a name that nobody had does not reach.
std::string textOnLater(const std::string& name) {
  return fmt::format(
      "Nobody has the name '{0}', so sessions under it that stations deliver from now on are kept, also "
      "older "
      "ones: erase '{0}' again once all stations have delivered theirs. ",
      name);
}

/// What no erasure reaches in PostgreSQL's files.
constexpr const char* kTextOnPostgres =
    "PostgreSQL keeps what was erased in free parts of its pages, its log, the archive of the log, standbys, "
    "base backups and dumps until these are overwritten or removed: see deploy/OPERATIONS.md, \"Erasure on "
    "PostgreSQL\". ";

/// The list beside the backups lacks this erasure.
std::string textOnListBeside(const std::filesystem::path& backups, const std::filesystem::path& folder,
                             const Error& why) {
  return fmt::format(
      "Pending: the list of erasures beside the backups could not be written ({}), so a backup there that is "
      "restored on another machine brings this person back. When that is mended, the next backup writes the "
      "list; or copy {} to {}. `check` goes on saying it. ",
      why.message, (folder / kErasuresFile).string(), (backups / kErasuresCopy).string());
}

/// For the error of an erasure that ended before its transaction; empty: nothing was done.
std::string textOnDone(const FoundNames& found, const std::string& pseudonym) {
  const ReplacedWords& replaced = found.replaced;
  std::string text;
  if (replaced.remarks + replaced.lines > 0)
    text = fmt::format(
        "; '{}' stands in the place of the name in {} remarks and {} lines of the audit log already",
        pseudonym, replaced.remarks, replaced.lines);
  if (found.sessions.sessions() > 0)
    text += fmt::format("; {} of the person's sessions are erased already", found.sessions.sessions());
  return text;
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

FilesInText filesInText(const FilesFound& found, std::size_t most_bytes, bool with_times) {
  FilesInText in;
  std::map<std::filesystem::path, std::uint64_t> others = found.others;
  for (const auto& path : found.named) {
    // a name may have any bytes, and a message with what is no UTF-8 is read by nobody
    std::string file = printable(path.string());
    struct stat info {};
    if (with_times && ::lstat(path.c_str(), &info) == 0)
      file += " (" + utcTime(info.st_mtim.tv_sec * std::int64_t{1'000'000'000}) + ")";
    if (in.text.size() + file.size() > most_bytes) {
      ++others[path.parent_path()];
      continue;
    }
    in.text += (in.text.empty() ? "" : ", ") + file;
    in.files.push_back(file);
  }
  std::string text;
  std::uint64_t elsewhere = 0;
  for (const auto& [folder, count] : others) {
    const std::string counted = fmt::format("{} others in {}", count, printable(folder.string()));
    if (text.size() + counted.size() > most_bytes)
      elsewhere += count;
    else
      text += (text.empty() ? "" : ", ") + counted;
  }
  if (elsewhere > 0) text += (text.empty() ? "" : ", ") + fmt::format("{} others elsewhere", elsewhere);
  if (!text.empty()) in.text += (in.text.empty() ? "" : ", and ") + text;
  return in;
}

std::filesystem::path backupsFolder(Connection& reader) {
  const auto backup = MetaStore(reader).get("backup_path");
  if (!backup || !*backup) return {};
  auto folder = std::filesystem::path(**backup).parent_path();
  std::error_code missing;
  return std::filesystem::is_directory(folder, missing) ? folder : std::filesystem::path();
}

Result<pb::Reply> erasePerson(const Context& context, const pb::ErasePerson& call, ErasedRows& done) {
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

  const std::scoped_lock lock(erasureLists());
  std::optional<DutyLock> duty;
  if (context.duties != nullptr) {
    ASSIGN_OR_RETURN(duty, context.duties->take(Duty::kErasure));
    if (!duty)
      return Error{ErrorCode::kUnavailable,
                   "an erasure is under way at another server: try again when it is done"};
  }
  // the asker may have been erased while this one waited; from here on nobody is
  RETURN_IF_ERROR(checkAccess(context.reader, context.who));
  ASSIGN_OR_RETURN(auto lines, readErasures(folder));
  const auto before = lines;
  const auto hash = key.nameHash(call.name());
  // an erasure repeated after a restore keeps its pseudonym
  ASSIGN_OR_RETURN(const auto repeat, ErasureStore(context.reader).toRepeat(folder));
  const auto again = std::find_if(repeat.begin(), repeat.end(),
                                  [&](const auto& erasure) { return erasure.name == call.name(); });
  ASSIGN_OR_RETURN(const auto person, PeopleStore(context.reader).find(call.name()));
  ASSIGN_OR_RETURN(const auto unix_ns,
                   ErasureStore(context.reader).erasedAt(call.name(), context.now_unix_ns));
  ErasureLine unsealed{newErasurePseudonym(), hash, unix_ns, call.with_waiting_sessions()};
  unsealed.without_account = !person;
  if (again != repeat.end()) {
    unsealed.pseudonym = again->line.pseudonym;
    unsealed.without_account = !person && again->line.without_account;
  }
  const ErasureLine line = sealed(std::move(unsealed), key);
  // the writer looks at none of what lies there for long: remarks and audit lines have up to some GB
  ASSIGN_OR_RETURN(auto found, [&]() -> Result<FoundNames> {
    const CancelScope may_end(context.reader, context.cancelled);
    return ErasureStore(context.reader).lookForNames(call.name(), line, call.with_waiting_sessions());
  }());
  std::erase_if(lines, [&](const ErasureLine& other) { return other.pseudonym == line.pseudonym; });
  lines.push_back(line);
  RETURN_IF_ERROR(writeErasures(folder, lines));

  bool keeps_later = false;
  Status status;
  for (std::size_t i = 0; status.ok() && i < found.pages.size(); ++i)
    status = context.writer.run(
        [&](Connection& writer) { return ErasureStore(writer).replaceNames(found, found.pages[i]); });
  for (bool more = true; status.ok() && more;)
    status = context.writer.run([&](Connection& writer) -> Status {
      ASSIGN_OR_RETURN(more, ErasureStore(writer).eraseSomeSessions(call.name(), line, context.who.name,
                                                                    context.now_unix_ns,
                                                                    call.with_waiting_sessions(), found));
      return {};
    });
  const bool is_at_end = status.ok();
  if (is_at_end)
    status = context.writer.run([&](Connection& writer) -> Status {
      ASSIGN_OR_RETURN(
          done, ErasureStore(writer).eraseRows(call.name(), line, context.who.name, call.reason(),
                                               context.now_unix_ns, call.with_waiting_sessions(), &found));
      ASSIGN_OR_RETURN(const auto owner,
                       ErasureStore(writer).ownerOf(call.name(), context.now_unix_ns, context.now_unix_ns));
      keeps_later = !owner.pseudonym;
      const pb::Erasure& erased = done.erasure;
      std::string detail = fmt::format("{} sessions, {} recordings, {} scores", erased.sessions(),
                                       erased.recordings(), erased.scores());
      if (erased.waiting_sessions() > 0)
        detail += fmt::format("; {} sessions that wait were left", erased.waiting_sessions());
      return AuditStore(writer).add(
          {0, context.now_unix_ns, context.who.name, std::string(context.action), line.pseudonym, detail});
    });
  std::string text_on_commit;
  if (!status) {
    Result<std::string> settled = status.error();
    if (is_at_end)
      settled = settleErasure(context.writer, folder, line, before, status.error());
    else
      RETURN_IF_ERROR(writeErasures(folder, before));
    if (!settled) {
      // what was undone keeps its room in the log
      if (settled.error().code == ErrorCode::kNoRoom)
        (void)context.writer.emptyLog(std::chrono::milliseconds::zero());
      return Error{settled.error().code, settled.error().message + textOnDone(found, line.pseudonym)};
    }
    text_on_commit = *settled;
  }
  pb::Reply reply;
  *reply.mutable_erasure() = done.erasure;
  reply.mutable_erasure()->set_text(text_on_commit +
                                    (context.reader.sqlite() == nullptr ? kTextOnPostgres : "") +
                                    (keeps_later ? textOnLater(call.name()) : "") +
                                    textOnWaiting(call.name(), done.erasure.waiting_sessions()));
  return reply;
}

void addWhatIsLeft(Connection& reader, const std::atomic<bool>* cancelled, const ErasedRows& erased,
                   pb::Erasure& erasure) {
  // a restore of a backup there on another machine must know, too; a stick that is not there learns it from
  // the next backup
  std::string beside;
  const auto folder = reader.path().parent_path(), backups = backupsFolder(reader);
  if (!backups.empty()) {
    const auto added = [&]() -> Result<std::string> {
      const std::scoped_lock lock(erasureLists());
      ASSIGN_OR_RETURN(const auto lines, readErasures(folder));
      ASSIGN_OR_RETURN(const auto key, ErasureStore(reader).key());
      return addErasuresBeside(backups, lines, &key);
    }();
    beside =
        !added ? textOnListBeside(backups, folder, added.error()) : *added + (added->empty() ? "" : ". ");
  }
  const auto left = [&] {
    const CancelScope may_end(reader, cancelled);
    return ErasureStore(reader).reportOf(erased);
  }();
  erasure.set_text(beside + erasure.text() +
                   (left ? *left
                         : "Where else the name stands could not be looked up (" + left.error().message +
                               "): look for it by hand. "));
}

std::string nameFilesOfErased(const FilesFound& found, const std::filesystem::path& folder,
                              const ErasedRows& erased, pb::Erasure& erasure) {
  constexpr std::size_t kOfReply_bytes = 64 << 10, kOfLine_bytes = 400;  // of kMaxFrameBytes; of AuditStore's
  const FilesInText in = filesInText(found, kOfReply_bytes);
  for (const std::string& file : in.files) erasure.add_files(file);
  const auto others = readOtherStores(folder);
  const auto textOfOthers = [&](std::size_t most_bytes) {
    return others ? otherStoresInText(*others, most_bytes) : others.error().message;
  };
  const std::string databases = textOfOthers(kOfReply_bytes);
  if (others)
    for (const OtherStore& store : *others) erasure.add_files(printable(store.url));
  erasure.set_text(
      erasure.text() +
      (in.text.empty()
           ? std::string("No backup and no replaced database in a file that this machine knows of names this "
                         "person. ")
           : fmt::format("These still hold this person's data, or nobody can tell: {}. Remove databases "
                         "and their logs; look into the others yourself, and remove what has the person. A "
                         "backup among them that is restored here is erased anew before it serves, but only "
                         "what stands there under the name '{}', not under one that stations gave. ",
                         in.text, erased.names.name)) +
      (databases.empty()
           ? std::string()
           : fmt::format("This erasure does not reach other databases on PostgreSQL, which may hold this "
                         "person's data: {}. Remove each (dropdb), then say so: needlelab-admin --data {} "
                         "store forget URL. ",
                         databases, printable(folder.string()))) +
      "Backups elsewhere hold it until they are removed; the server's own log files go by their rotation.");
  std::string line;
  if (!databases.empty())
    line = "other databases may hold this person's data: " + textOfOthers(kOfLine_bytes);
  if (!in.text.empty())
    line += (line.empty() ? "" : "; ") +
            ("hold this person's data, or nobody can tell: " + filesInText(found, kOfLine_bytes).text);
  return line.empty() ? line : withoutNames(line, erased.names, true);
}

}  // namespace needlelab::handlers
