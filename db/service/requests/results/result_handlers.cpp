// Assignments and progress: a trainee's attempts, and their standing in an exercise.
#include <fmt/core.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/time/clock.h"
#include "common/profile/profile.h"
#include "common/scoring/attempts/progress.h"
#include "db/people/people.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/lessons/standing.h"
#include "db/service/scoring/held_results.h"
#include "db/store/connection.h"
#include "db/teaching/assignments.h"
#include "db/teaching/attempts.h"
#include "db/teaching/documents.h"

namespace needlelab::handlers {
namespace {

/// The measures of one exercise over the newest attempts, as JSON. There are gaps for attempts that do not
/// count, and for those without a score of the newest version among them.
Result<std::string> measuresOver(Connection& reader, const std::string& trainee,
                                 const std::string& exercise_id) {
  constexpr std::size_t kMost = 300;
  ASSIGN_OR_RETURN(const auto scores, AttemptStore(reader).newestScores(trainee, exercise_id, kMost));
  std::uint32_t newest = 0;
  for (const NewestScore& score : scores) newest = std::max(newest, score.version);
  const std::uint32_t first = scores.empty() ? 1 : std::max(1u, scores.front().number);
  std::vector<std::vector<Measure>> measures(kMost);
  for (const NewestScore& score : scores) {
    const std::size_t place = score.number - first;
    if (score.version != newest || place >= kMost) continue;
    ASSIGN_OR_RETURN(measures[place], parseScore(score.measures_json));
  }
  return newest == 0 ? std::string() : progressJson(progressOf(measures, first - 1));
}

/// The rest follows on the next page: each attempt is read with its score.
constexpr std::size_t kMaxAttemptsOfPage = 200;

Error badProgressPage() {
  return {ErrorCode::kInvalidInput,
          "page: give back the next_page of the reply before; if you did, the list has changed meanwhile: "
          "start again"};
}

/// The trainee's due date for the exercise; 0: never, also for a removed exercise.
Result<std::int64_t> dueOf(Connection& reader, const std::string& trainee, const std::string& exercise_id) {
  const auto stored = CurriculumStore(reader).exercise(exercise_id);
  if (!stored && stored.error().code == ErrorCode::kNotFound) return std::int64_t{0};
  if (!stored) return stored.error();
  ASSIGN_OR_RETURN(const auto exercise, exerciseOf(*stored));
  return dueOf(reader, trainee, *stored, exercise);
}

}  // namespace

Result<pb::Reply> getProgress(const Context& context, const pb::GetProgress& call) {
  RETURN_IF_ERROR(requireOwnData(context, call.trainee(), "progress"));
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  // a page begins after an attempt, wherever that is now: late sessions from an offline station may move it
  const bool is_first = call.page().empty();
  std::optional<Uuid> after;
  if (!is_first) {
    const auto id = sessionId(call.page());
    if (!id) return badProgressPage();
    after = *id;
  }
  if (call.newest_first() && call.exercise_id().empty())
    return Error{ErrorCode::kInvalidInput,
                 "exercise_id: is missing: attempts of all exercises come oldest first"};
  AttemptStore store(context.reader);
  WithheldResults held(context);
  auto attempts = call.newest_first()
                      ? store.newestPage(call.trainee(), call.exercise_id(), after, kMaxAttemptsOfPage + 1)
                      : store.page(call.trainee(), call.exercise_id(), after, kMaxAttemptsOfPage + 1);
  if (!attempts) return attempts.error().code == ErrorCode::kNotFound ? badProgressPage() : attempts.error();
  pb::Reply reply;
  auto* list = reply.mutable_progress();
  PageRoom room;
  if (is_first && !call.exercise_id().empty()) {
    ASSIGN_OR_RETURN(const auto held_until, held.until(call.exercise_id()));
    if (held_until == 0) {
      ASSIGN_OR_RETURN(auto measures, measuresOver(context.reader, call.trainee(), call.exercise_id()));
      room.take(measures.size() + 1);
      list->set_measures_json(std::move(measures));
    }
  }
  std::map<std::string, std::int64_t> due;  // by exercise
  for (pb::Attempt& attempt : *attempts) {
    auto date = due.find(attempt.exercise_id());
    if (date == due.end()) {
      ASSIGN_OR_RETURN(const auto read, dueOf(context.reader, call.trainee(), attempt.exercise_id()));
      date = due.emplace(attempt.exercise_id(), read).first;
    }
    attempt.set_late(date->second != 0 && attempt.started_unix_ns() > date->second);
    RETURN_IF_ERROR(held.leaveOutOf(attempt));
    const bool is_full = list->attempts_size() == static_cast<int>(kMaxAttemptsOfPage);
    if (is_full || (!room.take(attempt) && list->attempts_size() > 0)) {
      list->set_next_page(list->attempts().rbegin()->session_id());
      break;
    }
    *list->add_attempts() = std::move(attempt);
  }
  return reply;
}

Result<pb::Reply> listTried(const Context& context, const pb::ListTried& call) {
  constexpr std::size_t kMost = 1000;
  RETURN_IF_ERROR(requireOwnData(context, call.trainee(), "progress"));
  ASSIGN_OR_RETURN(const auto tried, AttemptStore(context.reader).tried(call.trainee(), kMost));
  pb::Reply reply;
  auto* list = reply.mutable_tried_exercises();
  for (const TriedExercise& one : tried) {
    auto* row = list->add_exercises();
    row->set_exercise_id(one.exercise_id);
    row->set_attempts(one.attempts);
    row->set_newest_unix_ns(one.newest_unix_ns);
  }
  return reply;
}

Result<pb::Reply> getAttempt(const Context& context, const pb::GetAttempt& call) {
  ASSIGN_OR_RETURN(const auto id, sessionId(call.session_id()));
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  AttemptStore store(context.reader);
  ASSIGN_OR_RETURN(auto attempt, store.get(id));
  RETURN_IF_ERROR(requireOwnData(context, attempt.trainee(), "attempts"));
  ASSIGN_OR_RETURN(const bool waits, store.isUncounted(id));
  if (waits)
    return Error{ErrorCode::kNotFound,
                 "session " + uuidText(id) + " waits for its trainee: it is not an attempt"};
  ASSIGN_OR_RETURN(const auto due_ns, dueOf(context.reader, attempt.trainee(), attempt.exercise_id()));
  attempt.set_late(due_ns != 0 && attempt.started_unix_ns() > due_ns);
  attempt.clear_score_json();
  RETURN_IF_ERROR(WithheldResults(context).leaveOutOf(attempt));
  pb::Reply reply;
  *reply.mutable_attempt() = std::move(attempt);
  return reply;
}

Result<pb::Reply> excuseAttempt(const Context& context, const pb::ExcuseAttempt& call) {
  ASSIGN_OR_RETURN(const auto id, sessionId(call.session_id()));
  pb::Reply reply;
  const Status written =
      write(context, uuidText(id), (call.excused() ? "does not count: " : "counts again: ") + call.reason(),
            [&](Connection& writer) -> Status {
              RETURN_IF_ERROR(AttemptStore(writer).excuse(id, call.excused()));
              ASSIGN_OR_RETURN(*reply.mutable_attempt(), AttemptStore(writer).get(id));
              return {};
            });
  if (!written) return written.error();
  return reply;
}

namespace {

/// For the audit log: "course basics for group a, due 2026-…".
std::string assignmentText(const pb::Assignment& a) {
  return (a.course_id().empty() ? "exercise " + a.exercise_id() : "course " + a.course_id()) + " for " +
         (a.group_id().empty() ? a.trainee() : "group " + a.group_id()) +
         (a.due_unix_ns() == 0 ? "" : ", due " + utcTime(a.due_unix_ns()));
}

std::string assignmentSubject(const pb::Assignment& a) {
  return a.group_id().empty() ? a.trainee() : a.group_id();
}

/// The trainees to whom assignments are given individually.
std::vector<std::string> traineesOf(const std::vector<pb::Assignment>& assignments) {
  std::set<std::string> names;
  for (const pb::Assignment& one : assignments)
    if (!one.trainee().empty()) names.insert(one.trainee());
  return {names.begin(), names.end()};
}

}  // namespace

Result<pb::Reply> assign(const Context& context, const pb::Assign& call) {
  pb::Assignment assignment;
  assignment.set_trainee(call.trainee());
  assignment.set_exercise_id(call.exercise_id());
  assignment.set_course_id(call.course_id());
  assignment.set_group_id(call.group_id());
  assignment.set_due_unix_ns(call.due_unix_ns());
  assignment.set_by(context.who.name);
  assignment.set_created_unix_ns(context.now_unix_ns);
  RETURN_IF_ERROR(
      write(context, assignmentSubject(assignment), assignmentText(assignment), [&](Connection& writer) {
        auto stored = AssignmentStore(writer).put(assignment);
        if (!stored) return Status(stored.error());
        assignment = std::move(*stored);
        return Status();
      }));
  pb::Reply reply;
  *reply.mutable_assignments()->add_assignments() = std::move(assignment);
  return reply;
}

Result<pb::Reply> removeAssignment(const Context& context, const pb::RemoveAssignment& call) {
  std::string subject, detail;
  RETURN_IF_ERROR(write(context, subject, detail, [&](Connection& writer) {
    const auto removed = AssignmentStore(writer).remove(call.id());
    if (!removed) return Status(removed.error());
    subject = assignmentSubject(*removed);
    detail = assignmentText(*removed);
    return Status();
  }));
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

Result<pb::Reply> listAssignments(const Context& context, const pb::ListAssignments& call) {
  const bool own = context.who.role == pb::TRAINEE;
  if (own && !call.trainee().empty() && call.trainee() != context.who.name) {
    return Error{ErrorCode::kDenied, "a trainee sees own assignments only"};
  }
  ASSIGN_OR_RETURN(const auto from, numberOfPage(call.page()));
  const bool by_station = context.who.role == pb::STATION;
  pb::Reply reply;
  auto* list = reply.mutable_assignments();
  if (by_station && !call.trainee().empty()) {
    // groups' assignments would also reveal that there is such an account
    ASSIGN_OR_RETURN(const auto person, PeopleStore(context.reader).find(call.trainee()));
    ASSIGN_OR_RETURN(const bool known, stationMayKnow(context.reader, person, call.trainee()));
    if (!known) return reply;
  }
  constexpr std::uint64_t kMost = 500, kReadAtOnce = 500;
  const std::uint64_t most = call.limit() == 0 ? UINT32_MAX : std::min<std::uint64_t>(call.limit(), kMost);
  AssignmentStore store(context.reader);
  AssignmentStore::Filter filter{own ? context.who.name : call.trainee(), call.course_id(), call.group_id()};
  // newest ids first; the page token is the last id, so that additions and removals do not shift rows
  filter.below = from;
  PageRoom room;
  for (;;) {
    // one more than fits on the page shows whether there is a next one
    const auto left = most - static_cast<std::uint64_t>(list->assignments_size());
    filter.most = std::min(left + 1, kReadAtOnce);
    ASSIGN_OR_RETURN(auto assignments, store.list(filter));
    std::map<std::string, Person> people;
    if (by_station) {
      ASSIGN_OR_RETURN(people, PeopleStore(context.reader).findAll(traineesOf(assignments)));
    }
    for (pb::Assignment& assignment : assignments) {
      if (by_station && !assignment.trainee().empty()) {
        const auto found = people.find(assignment.trainee());
        const auto person = found == people.end() ? std::optional<Person>() : std::optional(found->second);
        ASSIGN_OR_RETURN(const bool known, stationMayKnow(context.reader, person, assignment.trainee()));
        if (!known) {
          filter.below = assignment.id();
          continue;
        }
      }
      const bool is_full = static_cast<std::uint64_t>(list->assignments_size()) == most;
      if (is_full || !room.take(assignment)) {
        list->set_next_page(std::to_string(filter.below));
        return reply;
      }
      filter.below = assignment.id();
      *list->add_assignments() = std::move(assignment);
    }
    if (assignments.size() < filter.most) return reply;
  }
}

}  // namespace needlelab::handlers

namespace needlelab {

Result<pb::Exercise> exerciseOf(const StoredExercise& stored) {
  auto exercise = parseExercise(stored.json, "exercise '" + stored.id + "'");
  if (!exercise) return Error{ErrorCode::kCorrupt, exercise.error().message};
  return exercise;
}

namespace {

bool hasNoRequirements(const pb::Exercise& exercise) {
  return exercise.requirements().empty() && !exercise.has_time_limit_s();
}

bool isDoneBy(const AttemptStanding& attempts, bool needs_no_pass) {
  return needs_no_pass ? attempts.counted > 0 : attempts.passed.value_or(false);
}

/// The exercise's own date; 0: none.
std::int64_t ownDue(const pb::Exercise& exercise) {
  return exercise.has_due_unix_ms() ? static_cast<std::int64_t>(exercise.due_unix_ms()) * 1'000'000 : 0;
}

}  // namespace

bool isDone(const AttemptStanding& attempts, const pb::Exercise& exercise) {
  return isDoneBy(attempts, hasNoRequirements(exercise));
}

Result<std::int64_t> dueOf(Connection& connection, const std::string& trainee, const StoredExercise& stored,
                           const pb::Exercise& exercise) {
  return AssignmentStore(connection).dueOf(trainee, stored.id, stored.curriculum_id, ownDue(exercise));
}

Result<ReadExercise> readExercise(Connection& connection, const StoredExercise& stored,
                                  const pb::Exercise& exercise, KnownPrerequisites& known) {
  ReadExercise read{stored, exercise, {}};
  for (const std::string& before : exercise.prerequisites()) {
    auto found = known.find(before);
    if (found == known.end()) {
      const auto other = CurriculumStore(connection).exercise(before);
      if (!other && other.error().code != ErrorCode::kNotFound) return other.error();
      bool needs_no_pass = false;
      if (other) {
        ASSIGN_OR_RETURN(const auto text, exerciseOf(*other));
        needs_no_pass = hasNoRequirements(text) || other->rules.exam_attempts.has_value();
      }
      found = known.emplace(before, needs_no_pass).first;
    }
    read.prerequisites.push_back({before, found->second});
  }
  return read;
}

ExerciseStanding standingBy(const ReadExercise& read, const std::map<std::string, AttemptStanding>& attempts,
                            std::int64_t assigned_due_unix_ns) {
  const auto attemptsAt = [&](const std::string& id) {
    const auto found = attempts.find(id);
    return found == attempts.end() ? AttemptStanding{} : found->second;
  };
  ExerciseStanding standing;
  standing.attempts = attemptsAt(read.stored.id);
  standing.done = isDone(standing.attempts, read.exercise);
  if (read.exercise.has_attempts()) {
    const std::uint32_t used = std::min(read.exercise.attempts(), standing.attempts.counted);
    standing.attempts_left = read.exercise.attempts() - used;
  }
  for (const ReadExercise::Before& before : read.prerequisites) {
    if (!isDoneBy(attemptsAt(before.id), before.needs_no_pass)) standing.locked_by.push_back(before.id);
  }
  standing.due_unix_ns = assigned_due_unix_ns != 0 ? assigned_due_unix_ns : ownDue(read.exercise);
  return standing;
}

Result<ExerciseStanding> standingOf(Connection& connection, const std::string& trainee,
                                    const StoredExercise& stored, const pb::Exercise& exercise) {
  KnownPrerequisites known;
  ASSIGN_OR_RETURN(const auto read, readExercise(connection, stored, exercise, known));
  ASSIGN_OR_RETURN(const auto attempts, AttemptStore(connection).standings(trainee));
  ASSIGN_OR_RETURN(const auto due_ns,
                   AssignmentStore(connection).dueOf(trainee, stored.id, stored.curriculum_id, 0));
  return standingBy(read, attempts, due_ns);
}

Result<std::optional<std::string>> whyNot(Connection& connection, const pb::Exercise& exercise,
                                          const CourseRules& rules, const ExerciseStanding& standing) {
  if (!standing.locked_by.empty()) {
    std::string names;
    for (const std::string& id : standing.locked_by) {
      const auto other = CurriculumStore(connection).exercise(id);
      if (!other && other.error().code != ErrorCode::kNotFound) return other.error();
      names += (names.empty() ? "\"" : ", \"") + (other ? other->name : id) + "\"";
    }
    return std::optional("\"" + exercise.name() + "\" is still locked: " +
                         (rules.exam_attempts ? "take " : "pass ") + names + " first");
  }
  if (standing.attempts_left == 0u) {
    const std::string used = exercise.attempts() == 1
                                 ? "the one attempt has been used"
                                 : fmt::format("all {} attempts have been used", exercise.attempts());
    return std::optional("\"" + exercise.name() + "\": " + used +
                         "; ask your instructor, who can give one back");
  }
  return std::optional<std::string>();
}

}  // namespace needlelab
