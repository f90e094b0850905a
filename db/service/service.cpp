#include "db/service/service.h"

#include <fmt/core.h>

#include <cassert>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "common/base/clock.h"
#include "common/base/local_time.h"
#include "db/access_numbers.h"
#include "db/audit.h"
#include "db/credentials.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/person_refs.h"
#include "db/retention_store.h"
#include "db/schema.h"
#include "db/seen_time.h"
#include "db/service/erasures.h"
#include "db/service/handlers.h"
#include "db/service/rescoring.h"
#include "db/session_rows.h"
#include "proto/session_rules.h"

namespace needlelab {
namespace {

/// Clears the flag on destruction.
class Cleared {
 public:
  explicit Cleared(std::atomic<bool>& flag) : flag_(flag) {}
  Cleared(const Cleared&) = delete;
  Cleared& operator=(const Cleared&) = delete;
  ~Cleared() { flag_ = false; }

 private:
  std::atomic<bool>& flag_;
};

/// Permission for one run of retention; the destructor returns it. `run`, guarded by `mutex`, is the current
/// run.
class RetentionTurn {
 public:
  RetentionTurn(std::mutex& mutex, std::optional<RunUnderWay>& run, RunUnderWay wanted)
      : mutex_(mutex), run_(run) {
    const std::lock_guard lock(mutex_);
    other_ = run_;
    if (mine()) run_ = std::move(wanted);
  }
  ~RetentionTurn() {
    if (!mine()) return;
    const std::lock_guard lock(mutex_);
    run_.reset();
  }
  RetentionTurn(const RetentionTurn&) = delete;
  RetentionTurn& operator=(const RetentionTurn&) = delete;

  [[nodiscard]] bool mine() const { return !other_; }
  /// The current run, when another one is in progress.
  [[nodiscard]] const std::optional<RunUnderWay>& other() const { return other_; }

 private:
  std::mutex& mutex_;
  std::optional<RunUnderWay>& run_;
  std::optional<RunUnderWay> other_;
};

/// Staff may look up everybody's name; others read only their own, and names that they wrote.
bool mayReadNames(pb::Role role) {
  return role == pb::INSTRUCTOR || role == pb::CURRICULUM_MANAGER || role == pb::ADMINISTRATOR;
}

/// The message for `who`, with names in the place of refs.
std::string messageFor(Connection& reader, const Principal& who, const std::string& message,
                       std::map<std::string, std::string> names) {
  auto refs = refsIn(message);
  std::erase_if(refs, [&](const std::string& ref) {
    return names.contains(ref) || (!mayReadNames(who.role) && ref != who.name);
  });
  const std::vector<std::string> list(refs.begin(), refs.end());
  if (auto others = namesOfRefs(reader, list)) names.merge(*others);
  return withNames(message, names);
}

/// One text for every reason, so that an attacker cannot find valid names.
Error loginRefused() {
  return {ErrorCode::kDenied, "name or password (for a station: key) is wrong, or access was withdrawn"};
}

}  // namespace

Outcome Service::execute(const Principal& principal, const pb::Request& request) {
  RequestUnderWay under_way;
  for (;;)
    if (auto outcome = executeStep(principal, request, under_way)) return *std::move(outcome);
}

std::optional<Outcome> Service::executeStep(const Principal& principal, const pb::Request& request,
                                            RequestUnderWay& under_way) {
  under_way.more = false;
  const RequestRow* row = requestRow(request.call_case());
  Outcome outcome;
  const auto guarded = [&]() -> Result<pb::Reply> {
    // an unexpected exception fails only this request and must not affect lessons
    try {
      RETURN_IF_ERROR(checkRole(principal, request.call_case()));
      if (!under_way.isDone()) {
        ASSIGN_OR_RETURN(auto reader, readers_.borrow());
        RETURN_IF_ERROR(handlers::checkAccess(*reader, principal));
        if (!under_way.with_refs) {
          const std::shared_ptr<pb::Request> with_refs(new pb::Request(request), [](pb::Request* held) {
            wipeSecrets(*held);
            delete held;
          });
          RETURN_IF_ERROR(toRefs(*reader, *with_refs, under_way.written));
          under_way.with_refs = with_refs;
        }
      }
      return row->handler.run(*this, principal, *under_way.with_refs, under_way);
    } catch (const std::exception& thrown) {
      return Error{
          ErrorCode::kFailed,
          fmt::format("the request '{}' failed inside: {}: please report this as a fault of the program",
                      callName(request.call_case()), thrown.what())};
    }
  };
  auto reply = guarded();
  if (reply && under_way.more) return std::nullopt;
  if (reply) {
    const auto& roles = reply->people_import().roles_changed();
    outcome.roles_changed.assign(roles.begin(), roles.end());
  }
  if (auto reader = readers_.borrow()) {
    if (!reply) {
      Error error = reply.error();
      error.message = messageFor(**reader, principal, error.message, under_way.written);
      reply = std::move(error);
    } else if (const Status named = toNames(**reader, *reply); !named && !under_way.isDone()) {
      reply = named.error();
    }
  }
  outcome.access_changed = under_way.access_changed;
  outcome.with_refs = under_way.with_refs;
  outcome.access_number = under_way.access_number;
  if (reply) {
    assert(reply->result_case() == row->reply);
    outcome.reply = std::move(*reply);
    outcome.server_part = row->server_part;
  } else {
    outcome.error = reply.error();
  }
  outcome.reply.set_id(request.id());
  return outcome;
}

Result<pb::Reply> Service::withReader(
    const Principal& who, std::string_view action,
    const std::function<Result<pb::Reply>(const handlers::Context&)>& work) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return work({who, writer_, *reader, wallNowNs(), action, *exports_, *codes_, &cancelled_, &reference_paths_,
               &disks_, backup_key_ ? &*backup_key_ : nullptr, nullptr, duties_.get()});
}

Result<pb::Reply> Service::backup(const Principal& who, const pb::Backup& call) {
  const std::unique_lock one_backup(backup_mutex_, std::try_to_lock);
  if (!one_backup)
    return Error{ErrorCode::kUnavailable, "another backup is under way: try again when it is done"};
  backup_running_ = true;
  const Cleared cleared(backup_running_);
  return withReader(who, callName(pb::Request::kBackup),
                    [&](const handlers::Context& context) { return handlers::backup(context, call); });
}

Result<pb::Reply> Service::erasePerson(const Principal& who, const pb::ErasePerson& call,
                                       RequestUnderWay& under_way) {
  if (under_way.erasure) return eraseOn(under_way);
  return withReader(who, callName(pb::Request::kErasePerson),
                    [&](const handlers::Context& context) -> Result<pb::Reply> {
                      const auto done = std::make_shared<ErasureUnderWay>();
                      ASSIGN_OR_RETURN(done->reply, handlers::erasePerson(context, call));
                      forgetRecordings();
                      under_way.erasure = done;
                      under_way.more = true;
                      return done->reply;
                    });
}

// The erasure is final, whatever becomes of these steps: the reply says what is left.
Result<pb::Reply> Service::eraseOn(RequestUnderWay& under_way) {
  ErasureUnderWay& done = *under_way.erasure;
  pb::Erasure& erasure = *done.reply.mutable_erasure();
  under_way.more = done.chunks.more;
  if (done.chunks.more) {
    done.text_on_chunks = removeErased(retention_pace_, kErasedPiecesAtOnce, done.chunks);
    under_way.more = true;
    return done.reply;
  }
  const std::string log = emptyLogOfErased();
  erasure.set_pending(!log.empty());
  std::string beside;
  if (auto reader = readers_.borrow())
    if (const Status written = writeErasuresBeside(**reader, handlers::backupsFolder(**reader)); !written)
      beside = "The list of erasures beside the backups could not be written (" + written.error().message +
               "): the next backup writes it. ";
  erasure.set_text(done.text_on_chunks + log + beside + erasure.text());
  return done.reply;
}

void Service::forgetRecordings() {
  reference_paths_.forget();
  const std::scoped_lock lock(faults_mutex_);
  unreadable_.clear();
}

Result<pb::Reply> Service::rescoreAllNow(const Principal& who, const pb::RescoreAll& call) {
  ASSIGN_OR_RETURN(auto report, rescoreAll(who.doer(), call));
  pb::Reply reply;
  *reply.mutable_rescore_report() = std::move(report);
  return reply;
}

Result<pb::Reply> Service::runRetentionNow(const Principal& who, const pb::RunRetention& call) {
  // who starts a run says that the clock is right
  if (!call.dry_run())
    RETURN_IF_ERROR(
        writer_.run([](Connection& writer) { return SeenTimeStore(writer).confirm(wallNowNs()); }));
  ASSIGN_OR_RETURN(auto report, retention(who.doer(), call.dry_run()));
  pb::Reply reply;
  *reply.mutable_retention_report() = std::move(report);
  return reply;
}

Result<pb::RetentionReport> Service::retention(const Doer& by_whom, bool dry_run) {
  const std::int64_t now = wallNowNs();
  std::optional<RetentionTurn> turn;
  if (!dry_run) {
    turn.emplace(retention_mutex_, retention_run_, RunUnderWay{by_whom, now});
    if (const auto& other = turn->other()) {
      return Error{ErrorCode::kUnavailable,
                   fmt::format("a run of retention is under way since {} by {}: try again when it is done; a "
                               "dry run says what is left",
                               localTime(other->begun_unix_ns, TimeForm::kZoned), other->by_whom.name)};
    }
  }
  std::optional<DutyLock> duty;
  RetentionTools tools = retentionTools();
  if (!dry_run) {
    ASSIGN_OR_RETURN(duty, duties_->take(Duty::kRetention));
    if (!duty)
      return Error{ErrorCode::kUnavailable,
                   "a run of retention is under way at another server: try again when it is done; a dry run "
                   "says what is left"};
    // another server that got the duty, because this one's connection was lost, does its run first
    tools.hold = [&duty, hold = std::move(tools.hold)] {
      const auto held = duty->isHeld();
      return hold() || (held && !*held);
    };
  }
  auto report = runRetention(tools, by_whom, now, dry_run);
  // an original that is gone has no path, as after a restart; whoever starts runs that remove nothing must
  // not undo others' comparisons
  if (!dry_run && (!report || report->thinned() + report->deleted() > 0)) forgetRecordings();
  return report;
}

Result<pb::RescoreReport> Service::rescoreAll(const Doer& by_whom, const pb::RescoreAll& call) {
  std::unique_lock one_run(rescore_mutex_, std::try_to_lock);
  if (!one_run)
    return Error{ErrorCode::kUnavailable, "another run of rescoring is under way: try again when it is done"};
  std::optional<DutyLock> duty;
  if (!call.dry_run()) {
    ASSIGN_OR_RETURN(duty, duties_->take(Duty::kRescoring));
    if (!duty)
      return Error{ErrorCode::kUnavailable,
                   "a run of rescoring is under way at another server: try again when it is done"};
  }
  const RescoreTools tools{writer_,
                           readers_,
                           [this](Connection& reader, const Uuid& id) { return scoreSession(reader, id); },
                           [this] { return backup_running_.load(std::memory_order_relaxed); },
                           stop_retention_,
                           retention_pace_};
  // a name that nothing has would end as "0 sessions"
  {
    ASSIGN_OR_RETURN(auto reader, readers_.borrow());
    if (auto known = RetentionStore(*reader).checkExercise(call.exercise_id(), "exercise"); !known)
      return Error{ErrorCode::kNotFound, known.error().message};
  }
  return runRescoring(tools, call.exercise_id(), by_whom, call.dry_run());
}

std::string Service::finishErasure() {
  RetentionPace at_once = retention_pace_;
  at_once.pause = std::chrono::milliseconds(0);
  at_once.rows = 4096;
  LeftoversSoFar chunks;
  const std::string text = removeErased(at_once, std::numeric_limits<std::size_t>::max(), chunks);
  return text + emptyLogOfErased();
}

std::string Service::removeErased(const RetentionPace& pace, std::size_t most_pieces,
                                  LeftoversSoFar& so_far) {
  const RetentionTurn turn(retention_mutex_, retention_run_, {{"an erasure"}, wallNowNs()});
  if (!turn.mine()) {
    so_far.more = false;
    return "A run of retention is under way: the chunks go with the next one, at the latest tomorrow "
           "(at once by needlelab-admin retention run when this one has ended). ";
  }
  const auto duty = duties_->take(Duty::kRetention);
  if (duty && !*duty) {
    so_far.more = false;
    return "A run of retention is under way at another server: the chunks go with the next one, at the "
           "latest "
           "tomorrow (at once by needlelab-admin retention run when that one has ended). ";
  }
  RetentionTools tools = retentionTools();
  tools.pace = pace;
  const auto removed = removeSomeLeftovers(tools, most_pieces, so_far);
  if (removed && so_far.more && !tools.stop) return {};
  const bool ended = std::exchange(so_far.more, false);
  if (!removed)
    return "Its chunks are not all removed yet (" + removed.error().message +
           "): they go with the next run of retention, at the latest tomorrow (at once by needlelab-admin "
           "retention run). ";
  if (ended) return "The program is ending: the chunks go with the next run of retention. ";
  if (so_far.damaged.empty()) return {};
  return fmt::format(
      "{} recordings are damaged, and what is left of them could not be removed: {} (see needlelab-admin "
      "check). ",
      so_far.damaged.size(), so_far.damaged.begin()->second);
}

std::string Service::emptyLogOfErased() {
  constexpr std::chrono::seconds kPatience{2};
  if (writer_.emptyLog(kPatience)) return {};
  return "Pending: the log beside the database (needlelab.db-wal) still has what was erased, because "
         "somebody "
         "reads (a backup, an export). It is overwritten when that is done, at the latest by the next start. "
         "Until then 'check' says so. ";
}

RetentionTools Service::retentionTools() {
  return {writer_,
          readers_,
          [this](const Uuid& id) -> Status {
            // what it throws (no memory) leaves this recording alone, not all of them
            try {
              return settleRecording(id);
            } catch (const std::exception& thrown) {
              return Error{ErrorCode::kFailed,
                           fmt::format("session {}: scoring failed inside: {}", uuidText(id), thrown.what())};
            }
          },
          [this] { return backup_running_.load(std::memory_order_relaxed); },
          stop_retention_,
          retention_pace_,
          [this]() -> std::optional<std::uint64_t> {
            std::error_code error;
            const auto space = std::filesystem::space(readers_.path().parent_path(), error);
            if (error) return std::nullopt;
            return space.available;
          }};
}

Result<std::optional<pb::RetentionReport>> Service::dailyRetention() {
  ASSIGN_OR_RETURN(const bool is_ours, duties_->isOurs());
  if (!is_ours) {
    // once a day recordings are read again: that server may have removed some
    forgetRecordings();
    return std::optional<pb::RetentionReport>();
  }
  const std::int64_t now = wallNowNs();
  std::int64_t last = 0;
  std::string ahead;
  {
    ASSIGN_OR_RETURN(auto reader, readers_.borrow());
    ASSIGN_OR_RETURN(const auto noted, MetaStore(*reader).get("retention_unix_ns"));
    if (noted) std::from_chars(noted->data(), noted->data() + noted->size(), last);
    // says it also where no run was noted: the server or its first policy is new
    ASSIGN_OR_RETURN(ahead, SeenTimeStore(*reader).aheadText(now));
  }
  if (last != 0 && (now < last || now - last > kMostAhead_ns)) {
    return Error{ErrorCode::kUnavailable,
                 fmt::format("the last run of retention is noted as {} days ago: when the server's clock is "
                             "right, confirm it by: needlelab-admin retention run",
                             (now - last) / 86'400'000'000'000)};
  }
  if (!ahead.empty()) return Error{ErrorCode::kUnavailable, ahead};
  // in a lab where nothing is closed for weeks, the days go by, too
  RETURN_IF_ERROR(writer_.run([now](Connection& writer) { return SeenTimeStore(writer).note(now); }));
  auto report = retention({"retention"}, false);
  // once a day recordings are read again, whatever has become of them
  forgetRecordings();
  if (!report) return report.error();
  return std::optional(std::move(*report));
}

Result<Principal> Service::loginPerson(const std::string& user, const std::string& password) {
  std::optional<Person> person;
  std::optional<std::int64_t> number;
  {
    ASSIGN_OR_RETURN(auto reader, readers_.borrow());
    ASSIGN_OR_RETURN(const auto ref, findPerson(*reader, user));
    // read before the account: with what came in between the number is too old, and not the account
    ASSIGN_OR_RETURN(number, numberNow(*reader, AccessWhat::kPerson, ref.value_or("")));
    ASSIGN_OR_RETURN(auto found, PeopleStore(*reader).find(ref.value_or("")));
    person = std::move(found);
  }
  // also for unknown names, so that the time is the same
  ASSIGN_OR_RETURN(const bool right,
                   verifyPassword(person ? person->password_hash : std::string(), password));
  if (!right || !person || person->disabled) return loginRefused();
  return Principal{person->ref, person->role, true, number, person->name};
}

Result<std::optional<Principal>> Service::principalOf(const std::string& name) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto person, PeopleStore(*reader).findNamed(name));
  if (!person) return std::optional<Principal>();
  return std::optional(Principal{person->ref, person->role, true, {}, person->name});
}

Result<std::string> Service::shownNameOf(const std::string& ref) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return shownName(*reader, ref);
}

Result<Principal> Service::loginStation(const std::string& station, const std::string& key) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto number, numberNow(*reader, AccessWhat::kStation, station));
  ASSIGN_OR_RETURN(const auto right, StationStore(*reader).checkKey(station, key));
  if (!right) return loginRefused();
  return Principal{station, pb::STATION, true, number};
}

Result<std::optional<std::int64_t>> Service::numberNow(Connection& reader, AccessWhat what,
                                                       const std::string& name) const {
  if (shared_ == nullptr) return std::optional<std::int64_t>();
  ASSIGN_OR_RETURN(const std::int64_t number, AccessNumberStore(reader).of(what, name));
  return std::optional(number);
}

Result<bool> Service::isKnownStation(const std::string& name) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  ASSIGN_OR_RETURN(const auto found, StationStore(*reader).find(name));
  return found.has_value();
}

Result<bool> Service::stillAllowed(const Principal& principal) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return handlers::accessHolds(*reader, principal);
}

Status Service::completeErasureList() {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return completeErasures(*reader);
}

Result<std::vector<bool>> Service::stillAllowed(const std::vector<Principal>& all) {
  ASSIGN_OR_RETURN(auto reader, readers_.borrow());
  return handlers::accessHoldsOf(*reader, all);
}

Status Service::note(const std::string& who, const std::string& action, const std::string& subject,
                     const std::string& detail) {
  return writer_.run([&](Connection& writer) {
    return AuditStore(writer).add({0, wallNowNs(), who, action, subject, detail});
  });
}

void Service::noteSoon(const Doer& who, const std::string& action, const std::string& subject,
                       const std::string& detail, std::function<void(const Error&)> failed) {
  addSoon({{0, wallNowNs(), who.name, action, subject, detail}, std::move(failed)});
}

void Service::addSoon(SoonNoted::Line line) {
  std::optional<Error> refused;
  {
    const std::lock_guard lock(soon_noted_->mutex);
    if (!soon_noted_->open) {
      const auto item = std::make_shared<SoonNoted::Item>();
      const Status posted = SoonNoted::post(writer_, soon_noted_, item);
      if (posted.ok()) {
        soon_noted_->open = item;
      } else {
        refused = posted.error();
      }
    }
    if (!refused) soon_noted_->open->push_back(std::move(line));
  }
  if (refused) line.failed(*refused);
}

Status Service::SoonNoted::post(DbWriter& writer, const std::shared_ptr<SoonNoted>& noted,
                                const std::shared_ptr<Item>& item) {
  const auto line_failed = std::make_shared<bool>(false);
  return writer.post(
      [noted, item, line_failed](Connection& connection) -> Status {
        noted->end(item);
        const auto store = [&]() -> Status {
          for (const Line& each : *item) {
            if (each.wanted) {
              ASSIGN_OR_RETURN(const bool wanted, each.wanted(connection));
              if (!wanted) continue;
            }
            RETURN_IF_ERROR(AuditStore(connection).add(each.row));
          }
          return {};
        };
        const Status stored = store();
        *line_failed = !stored.ok();
        return stored;
      },
      [&writer, noted, item, line_failed](const Status& stored) {
        noted->end(item);  // also where the work did not begin
        if (stored.ok()) return;
        for (Line& each : *item) {
          // one person's line must not take another's with it
          if (*line_failed && item->size() > 1) {
            const auto alone = std::make_shared<Item>(1, each);
            if (post(writer, noted, alone).ok()) continue;
          }
          each.failed(stored.error());
        }
      },
      DbWriter::Places::kKept);
}

void Service::SoonNoted::end(const std::shared_ptr<Item>& item) {
  const std::lock_guard lock(mutex);
  if (open == item) open.reset();
}

Status Service::noteLogin(const Principal& who, const std::string& host) {
  const std::string what = "log-in\n" + host;
  if (who.role == pb::TRAINEE || !exports_->isNew(who, what, wallNowNs())) return {};
  AuditRow line{0, wallNowNs(), who.name, "log-in", "", std::string(roleName(who.role)) + " from " + host};
  Status noted = writer_.run([&](Connection& writer) -> Status {
    ASSIGN_OR_RETURN(const bool is_new, exports_->isNewElsewhere(writer, who, what));
    return is_new ? AuditStore(writer).add(line) : Status();
  });
  if (!noted.ok()) exports_->takeBack(who, what);
  return noted;
}

void Service::noteWatching(const Principal& who, const std::string& station, const std::string& session,
                           std::function<void(const Error&)> failed) {
  if ((station.empty() && session.empty()) || writer_.failed()) return;
  const std::int64_t now_unix_ns = wallNowNs();
  const std::string what = "watch\n" + station + "\n" + session;
  if (!exports_->isNew(who, what, now_unix_ns)) return;
  // without the line watching goes on: nobody may wait on the network's thread
  SoonNoted::Line line;
  line.row = {0,
              now_unix_ns,
              who.name,
              "watch live",
              session.empty() ? station : sessionText(session),
              session.empty() ? "a station" : "a session"};
  line.failed = [exports = exports_, who, what, failed = std::move(failed)](const Error& error) {
    exports->takeBack(who, what);
    failed(error);
  };
  line.wanted = [exports = exports_, who, what, station, session](Connection& writer) -> Result<bool> {
    auto known = session.empty() ? writer.query("SELECT 1 FROM stations WHERE name = ?", station)
                                 : writer.query("SELECT 1 FROM sessions WHERE id = ? AND state = ?",
                                                viewOf(session), static_cast<int>(pb::SESSION_OPEN));
    ASSIGN_OR_RETURN(const bool found, known.step());
    if (!found) return false;
    return exports->isNewElsewhere(writer, who, what);
  };
  addSoon(std::move(line));
}

}  // namespace needlelab
