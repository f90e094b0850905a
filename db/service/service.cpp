#include "db/service/service.h"

#include <array>
#include <charconv>
#include <ctime>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>

#include "common/base/clock.h"
#include "db/credentials.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/schema.h"
#include "db/service/handlers.h"
#include "db/service/rescoring.h"
#include "db/service/roles.h"

namespace needlelab {
namespace {

Result<pb::Reply> dispatch(const handlers::Context& context, const pb::Request& request) {
  switch (request.call_case()) {
    case pb::Request::kAddUser:
      return handlers::addUser(context, request.add_user());
    case pb::Request::kSetPassword:
      return handlers::setPassword(context, request.set_password());
    case pb::Request::kDisableUser:
      return handlers::disableUser(context, request.disable_user());
    case pb::Request::kListUsers:
      return handlers::listUsers(context, request.list_users());
    case pb::Request::kAddStation:
      return handlers::addStation(context, request.add_station());
    case pb::Request::kRevokeStation:
      return handlers::revokeStation(context, request.revoke_station());
    case pb::Request::kListStations:
      return handlers::listStations(context, request.list_stations());
    case pb::Request::kImportProfile:
      return handlers::importProfile(context, request.import_profile());
    case pb::Request::kGetProfile:
      return handlers::getProfile(context, request.get_profile());
    case pb::Request::kListProfiles:
      return handlers::listProfiles(context, request.list_profiles());
    case pb::Request::kImportCurriculum:
      return handlers::importCurriculum(context, request.import_curriculum());
    case pb::Request::kGetCurriculum:
      return handlers::getCurriculum(context, request.get_curriculum());
    case pb::Request::kListCurricula:
      return handlers::listCurricula(context, request.list_curricula());
    case pb::Request::kAssign:
      return handlers::assign(context, request.assign());
    case pb::Request::kRemoveAssignment:
      return handlers::removeAssignment(context, request.remove_assignment());
    case pb::Request::kListAssignments:
      return handlers::listAssignments(context, request.list_assignments());
    case pb::Request::kGetLesson:
      return handlers::getLesson(context, request.get_lesson());
    case pb::Request::kListSessions:
      return handlers::listSessions(context, request.list_sessions());
    case pb::Request::kGetSession:
      return handlers::getSession(context, request.get_session());
    case pb::Request::kReadChunks:
      return handlers::readChunks(context, request.read_chunks());
    case pb::Request::kSeekSession:
      return handlers::seekSession(context, request.seek_session());
    case pb::Request::kVerifySession:
      return handlers::verifySession(context, request.verify_session());
    case pb::Request::kListEvents:
      return handlers::listEvents(context, request.list_events());
    case pb::Request::kAnnotate:
      return handlers::annotate(context, request.annotate());
    case pb::Request::kListAnnotations:
      return handlers::listAnnotations(context, request.list_annotations());
    case pb::Request::kBackup:
      return handlers::backup(context, request.backup());
    case pb::Request::kCheck:
      return handlers::check(context, request.check());
    case pb::Request::kListAudit:
      return handlers::listAudit(context, request.list_audit());
    case pb::Request::kListRetention:
      return handlers::listRetention(context, request.list_retention());
    case pb::Request::kSetRetention:
      return handlers::setRetention(context, request.set_retention());
    case pb::Request::kRunRetention:
      break;  // execute() does it: it borrows its readers itself
    case pb::Request::kTraineeMessage:
      return handlers::traineeMessage(context, request.trainee_message());
    case pb::Request::kNextExercise:
      return handlers::nextExercise(context, request.next_exercise());
    case pb::Request::kSetAids:
      return handlers::setAids(context, request.set_aids());
    case pb::Request::kStopLesson:
      return handlers::stopLesson(context, request.stop_lesson());
    case pb::Request::kGetUser:
      return handlers::getUser(context, request.get_user());
    case pb::Request::kChangeUser:
      return handlers::changeUser(context, request.change_user());
    case pb::Request::kSetConsent:
      return handlers::setConsent(context, request.set_consent());
    case pb::Request::kListConsents:
      return handlers::listConsents(context, request.list_consents());
    case pb::Request::kImportPeople:
      return handlers::importPeople(context, request.import_people());
    case pb::Request::kExportPerson:
      return handlers::exportPerson(context, request.export_person());
    case pb::Request::kErasePerson:
      return handlers::erasePerson(context, request.erase_person());
    case pb::Request::kPutGroup:
      return handlers::putGroup(context, request.put_group());
    case pb::Request::kGetGroup:
      return handlers::getGroup(context, request.get_group());
    case pb::Request::kListGroups:
      return handlers::listGroups(context, request.list_groups());
    case pb::Request::kRemoveGroup:
      return handlers::removeGroup(context, request.remove_group());
    case pb::Request::kListProfileRevisions:
      return handlers::profileRevisions(context, request.list_profile_revisions());
    case pb::Request::kListCurriculumRevisions:
      return handlers::curriculumRevisions(context, request.list_curriculum_revisions());
    case pb::Request::kCheckText:
      return handlers::checkJson(context, request.check_text());
    case pb::Request::kPreviewProfile:
      return handlers::previewProfile(context, request.preview_profile());
    case pb::Request::kListExercises:
      return handlers::listExercises(context, request.list_exercises());
    case pb::Request::kListMeasures:
      return handlers::listMeasures(context, request.list_measures());
    case pb::Request::kGetResults:
      return handlers::getResults(context, request.get_results());
    case pb::Request::kGetProgress:
      return handlers::getProgress(context, request.get_progress());
    case pb::Request::kExcuseAttempt:
      return handlers::excuseAttempt(context, request.excuse_attempt());
    case pb::Request::kGetScore:
      return handlers::getScore(context, request.get_score());
    case pb::Request::kListScores:
      return handlers::listScores(context, request.list_scores());
    case pb::Request::kSetReference:
      return handlers::setReference(context, request.set_reference());
    case pb::Request::kGetReference:
      return handlers::getReference(context, request.get_reference());
    case pb::Request::kExportStudy:
      return handlers::exportStudy(context, request.export_study());
    case pb::Request::kReadStudyRecording:
      return handlers::readStudyRecording(context, request.read_study_recording());
    case pb::Request::kExportAll:
      return handlers::exportAll(context, request.export_all());
    case pb::Request::kImportAll:
      return handlers::importAll(context, request.import_all());
    case pb::Request::kRescoreSession:
    case pb::Request::kRescoreAll:
    case pb::Request::CALL_NOT_SET:
      break;  // execute() does the first
  }
  return Error{ErrorCode::kInvalidInput, "the request holds no call"};
}

Outcome::ServerPart serverPartOf(pb::Request::CallCase call) {
  switch (call) {
    case pb::Request::kListStations:
      return Outcome::ServerPart::kFillStations;
    case pb::Request::kTraineeMessage:
    case pb::Request::kNextExercise:
    case pb::Request::kSetAids:
    case pb::Request::kStopLesson:
      return Outcome::ServerPart::kDeliver;
    default:
      return Outcome::ServerPart::kNone;
  }
}

/// Cleared at the end, whatever that is.
class Cleared {
 public:
  explicit Cleared(std::atomic<bool>* flag) : flag_(flag) {}
  Cleared(const Cleared&) = delete;
  Cleared& operator=(const Cleared&) = delete;
  ~Cleared() {
    if (flag_ != nullptr) *flag_ = false;
  }

 private:
  std::atomic<bool>* flag_;
};

std::string timeOf(std::int64_t unix_ns) {
  const std::time_t seconds = unix_ns / 1'000'000'000;
  std::tm parts{};
  std::array<char, 40> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", ::gmtime_r(&seconds, &parts));
  return text.data();
}

/// The turn of one run of retention, given back at its end. `run` is guarded by `mutex` and names the run
/// that is under way.
class RetentionTurn {
 public:
  RetentionTurn(std::mutex& mutex, std::string& run, std::string words) : mutex_(mutex), run_(run) {
    const std::lock_guard lock(mutex_);
    mine_ = run_.empty();
    if (mine_)
      run_ = std::move(words);
    else
      other_ = run_;
  }
  ~RetentionTurn() {
    if (!mine_) return;
    const std::lock_guard lock(mutex_);
    run_.clear();
  }
  RetentionTurn(const RetentionTurn&) = delete;
  RetentionTurn& operator=(const RetentionTurn&) = delete;

  [[nodiscard]] bool mine() const { return mine_; }
  /// Words of the run that has it instead.
  [[nodiscard]] const std::string& other() const { return other_; }

 private:
  std::mutex& mutex_;
  std::string& run_;
  std::string other_;
  bool mine_ = false;
};

/// One text for every reason, so that names cannot be tried out.
Error loginRefused() {
  return {ErrorCode::kDenied, "name or password (for a station: key) is wrong, or access was withdrawn"};
}

}  // namespace

Outcome Service::execute(const Principal& principal, const pb::Request& request) {
  const auto run = [&]() -> Result<pb::Reply> {
    if (auto allowed = checkRole(principal, request.call_case()); !allowed) return allowed.error();
    if (request.call_case() == pb::Request::kRunRetention) {
      auto report = retention(principal.name, request.run_retention().dry_run());
      if (!report) return report.error();
      pb::Reply reply;
      *reply.mutable_retention_report() = std::move(*report);
      return reply;
    }
    if (request.call_case() == pb::Request::kRescoreAll) {
      auto report = rescoreAll(principal.name, request.rescore_all());
      if (!report) return report.error();
      pb::Reply reply;
      *reply.mutable_rescore_report() = std::move(*report);
      return reply;
    }
    if (request.call_case() == pb::Request::kRescoreSession)
      return rescore(principal, request.rescore_session());
    std::unique_lock<std::mutex> one_backup;
    if (request.call_case() == pb::Request::kBackup) {
      one_backup = std::unique_lock(backup_mutex_, std::try_to_lock);
      if (!one_backup)
        return Error{ErrorCode::kUnavailable, "another backup is under way: try again when it is done"};
      backup_running_ = true;
    }
    const Cleared cleared(one_backup.owns_lock() ? &backup_running_ : nullptr);
    auto reader = readers_.borrow();
    if (!reader) return reader.error();
    auto reply = dispatch({principal, writer_, **reader, wallNowNs(), callName(request.call_case()), exports_,
                           &cancelled_, &reference_paths_},
                          request);
    // what an erasure has given up goes at once; while a run of retention is under way, the next one takes it
    if (reply && request.call_case() == pb::Request::kErasePerson) {
      reference_paths_.forget();
      // the erasure is done and stays so, whatever comes of this: its reply says what is left
      auto* erasure = reply->mutable_erasure();
      erasure->set_text(removeErased() + erasure->text());
    }
    return reply;
  };
  const auto guarded = [&]() -> Result<pb::Reply> {
    // a request is never worth the lessons of others: what no handler foresaw is this request's fault alone
    try {
      return run();
    } catch (const std::exception& thrown) {
      return Error{ErrorCode::kFailed, "the request '" + std::string(callName(request.call_case())) +
                                           "' failed inside: " + thrown.what() +
                                           ": please report this as a fault of the program"};
    }
  };
  Outcome outcome;
  auto reply = guarded();
  if (reply) {
    outcome.reply = std::move(*reply);
    outcome.server_part = serverPartOf(request.call_case());
  } else {
    outcome.error = reply.error();
  }
  outcome.reply.set_id(request.id());
  return outcome;
}

Result<pb::RetentionReport> Service::retention(const std::string& by_whom, bool dry_run) {
  const std::int64_t now = wallNowNs();
  std::optional<RetentionTurn> turn;
  if (!dry_run) {
    turn.emplace(retention_mutex_, retention_run_, "since " + timeOf(now) + " by " + by_whom);
    if (!turn->mine())
      return Error{ErrorCode::kUnavailable, "a run of retention is under way " + turn->other() +
                                                ": try again when it is done; a dry run says what is left"};
  }
  return runRetention(retentionTools(), by_whom, now, dry_run);
}

Result<pb::RescoreReport> Service::rescoreAll(const std::string& by_whom, const pb::RescoreAll& call) {
  std::unique_lock one_run(rescore_mutex_, std::try_to_lock);
  if (!one_run)
    return Error{ErrorCode::kUnavailable, "another run of rescoring is under way: try again when it is done"};
  const RescoreTools tools{writer_,
                           readers_,
                           [this](Connection& reader, const Uuid& id) { return scoreSession(reader, id); },
                           [this] { return backup_running_.load(std::memory_order_relaxed); },
                           stop_retention_,
                           retention_pace_};
  return runRescoring(tools, call.exercise_id(), by_whom, call.dry_run());
}

std::string Service::removeErased() {
  const RetentionTurn turn(retention_mutex_, retention_run_,
                           "since " + timeOf(wallNowNs()) + " by an erasure");
  if (!turn.mine())
    return "A run of retention is under way: the chunks go with the next one, at the latest tomorrow "
           "(at once by needlelab-admin retention run when this one has ended). ";
  const auto removed = removeLeftovers(retentionTools());
  if (removed && removed->stopped())
    return "The program is ending: the chunks go with the next run of retention. ";
  if (!removed)
    return "Its chunks are not all removed yet (" + removed.error().message +
           "): they go with the next run of retention, at the latest tomorrow (at once by needlelab-admin "
           "retention run). ";
  if (removed->steps().empty()) return {};
  return std::to_string(removed->left_alone()) +
         " recordings are damaged, and what is left of them could not be removed: " +
         removed->steps(0).text() + " (see needlelab-admin check). ";
}

RetentionTools Service::retentionTools() {
  return {writer_,
          readers_,
          [this](const Uuid& id) { return settleRecording(id); },
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

Result<pb::RetentionReport> Service::dailyRetention() {
  constexpr std::int64_t kMostApart_ns = 31LL * 86'400 * 1'000'000'000;
  std::int64_t last = 0;
  {
    auto reader = readers_.borrow();
    if (!reader) return reader.error();
    const auto noted = MetaStore(**reader).get("retention_unix_ns");
    if (!noted) return noted.error();
    if (*noted) std::from_chars((*noted)->data(), (*noted)->data() + (*noted)->size(), last);
  }
  const std::int64_t now = wallNowNs();
  if (last != 0 && (now < last || now - last > kMostApart_ns)) {
    return Error{ErrorCode::kUnavailable,
                 "the last run of retention is noted as " +
                     std::to_string((now - last) / 86'400'000'000'000) +
                     " days ago: when the server's clock is right, say so by: needlelab-admin retention run"};
  }
  return retention("retention", false);
}

Result<Principal> Service::loginPerson(const std::string& user, const std::string& password) {
  std::optional<Person> person;
  {
    auto reader = readers_.borrow();
    if (!reader) return reader.error();
    auto found = PeopleStore(**reader).find(user);
    if (!found) return found.error();
    person = std::move(*found);
  }
  // for unknown names, too: it takes the same time
  const bool right = verifyPassword(person ? person->password_hash : std::string(), password);
  if (!right || !person || person->disabled) return loginRefused();
  return Principal{person->name, person->role};
}

Result<Principal> Service::loginStation(const std::string& station, const std::string& key) {
  auto reader = readers_.borrow();
  if (!reader) return reader.error();
  const auto right = StationStore(**reader).checkKey(station, key);
  if (!right) return right.error();
  if (!*right) return loginRefused();
  return Principal{station, pb::STATION};
}

Result<bool> Service::stillAllowed(const Principal& principal) {
  auto reader = readers_.borrow();
  if (!reader) return reader.error();
  if (principal.role == pb::STATION) {
    const auto station = StationStore(**reader).find(principal.name);
    if (!station) return station.error();
    return *station && !(*station)->revoked;
  }
  const auto person = PeopleStore(**reader).find(principal.name);
  if (!person) return person.error();
  return *person && !(*person)->disabled && (*person)->role == principal.role;
}

Result<std::vector<std::string>> Service::erasuresToRepeat() {
  auto reader = readers_.borrow();
  if (!reader) return reader.error();
  const auto erasures = ErasureStore(**reader).toRepeat(readers_.path().parent_path());
  // a file of its own that is missing or broken is to be said, too, and no reason to give no lessons
  if (!erasures && erasures.error().code == ErrorCode::kCorrupt) return std::vector{erasures.error().message};
  if (!erasures) return erasures.error();
  std::vector<std::string> texts;
  for (const ErasureToRepeat& erasure : *erasures) texts.push_back(erasureToRepeatText(erasure));
  return texts;
}

Status Service::note(const std::string& who, const std::string& action, const std::string& subject,
                     const std::string& detail) {
  return writer_.run([&](Connection& writer) {
    return AuditStore(writer).add({0, wallNowNs(), who, action, subject, detail});
  });
}

}  // namespace needlelab
