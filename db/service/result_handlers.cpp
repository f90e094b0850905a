// Who is how far: the matrix of a course, the attempts of a trainee.
#include <algorithm>
#include <optional>
#include <set>
#include <vector>

#include "common/scoring/progress.h"
#include "db/assignments.h"
#include "db/connection.h"
#include "db/documents.h"
#include "db/people.h"
#include "db/service/handlers.h"
#include "db/service/page.h"
#include "db/service/score_rows.h"
#include "db/service/standing.h"
#include "db/session_results.h"

namespace needlelab::handlers {
namespace {

struct CourseExercise {
  StoredExercise stored;
  pb::Exercise exercise;
};

/// Members of the group; or all whom the course, or an exercise of it, is assigned to, or who tried one.
Result<std::set<std::string>> traineesOf(Connection& reader, const std::string& course_id,
                                         const std::string& group_id) {
  std::set<std::string> names;
  if (!group_id.empty()) {
    const auto group = GroupStore(reader).get(group_id);
    if (!group) return group.error();
    names.insert(group->members().begin(), group->members().end());
    return names;
  }
  const auto tried = AttemptStore(reader).trainees(course_id);
  if (!tried) return tried.error();
  names.insert(tried->begin(), tried->end());
  const auto assignments = AssignmentStore(reader).list({"", course_id, ""});
  if (!assignments) return assignments.error();
  for (const auto& assignment : *assignments) {
    if (!assignment.trainee().empty()) names.insert(assignment.trainee());
    if (assignment.group_id().empty()) continue;
    const auto group = GroupStore(reader).get(assignment.group_id());
    if (!group) return group.error();
    names.insert(group->members().begin(), group->members().end());
  }
  return names;
}

/// Of those that count: passed before not passed, then the most requirements met, then the newest.
const pb::Attempt* bestOf(const std::vector<pb::Attempt>& attempts) {
  const pb::Attempt* best = nullptr;
  std::uint32_t best_met = 0;
  for (const pb::Attempt& attempt : attempts) {
    if (attempt.state() == pb::SESSION_OPEN || attempt.excused()) continue;
    const std::uint32_t met = verdictsOf(attempt.score_json()).met;
    const bool better = best == nullptr || attempt.passed() > best->passed() ||
                        (attempt.passed() == best->passed() && met >= best_met);
    if (!better) continue;
    best = &attempt;
    best_met = met;
  }
  return best;
}

Result<pb::ResultCell> cellOf(Connection& reader, const std::string& trainee, const CourseExercise& course,
                              std::int64_t now_unix_ns) {
  pb::ResultCell cell;
  cell.set_exercise_id(course.stored.id);
  const auto standing = standingOf(reader, trainee, course.stored, course.exercise);
  if (!standing) return standing.error();
  cell.set_attempts(standing->attempts.counted);
  if (standing->attempts.passed) cell.set_passed(*standing->attempts.passed);
  for (const std::string& id : standing->locked_by) cell.add_locked_by(id);
  if (standing->attempts_left) cell.set_attempts_left(*standing->attempts_left);
  cell.set_due_unix_ns(standing->due_unix_ns);
  cell.set_overdue(standing->due_unix_ns != 0 && standing->due_unix_ns < now_unix_ns && !standing->done);
  if (standing->attempts.all == 0) return cell;
  const auto attempts = AttemptStore(reader).list(trainee, course.stored.id, true);
  if (!attempts) return attempts.error();
  if (const pb::Attempt* best = bestOf(*attempts)) {
    *cell.mutable_best() = *best;
    cell.mutable_best()->clear_score_json();
    cell.mutable_best()->set_late(standing->due_unix_ns != 0 &&
                                  best->started_unix_ns() > standing->due_unix_ns);
  }
  return cell;
}

/// How the measures of one exercise went over these attempts, as JSON; attempts that do not count, or have no
/// score of the newest version that any of them has, are gaps.
Result<std::string> measuresOver(Connection& reader, const std::vector<pb::Attempt>& attempts) {
  constexpr std::size_t kMost = 300;
  std::vector<std::optional<pb::Score>> scores(attempts.size());
  std::uint32_t newest = 0;
  for (std::size_t i = attempts.size() - std::min(attempts.size(), kMost); i < attempts.size(); ++i) {
    if (attempts[i].excused() || attempts[i].state() == pb::SESSION_OPEN) continue;
    const auto id = sessionId(attempts[i].session_id());
    if (!id) return id.error();
    auto score = ScoreStore(reader).get(*id, 0);
    if (!score && score.error().code == ErrorCode::kNotFound) continue;
    if (!score) return score.error();
    newest = std::max(newest, score->definition_version());
    scores[i] = std::move(*score);
  }
  std::vector<std::vector<Measure>> measures(attempts.size());
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (!scores[i] || scores[i]->definition_version() != newest) continue;
    auto rows = parseScore(scores[i]->measures_json());
    if (!rows) return rows.error();
    measures[i] = std::move(*rows);
  }
  return newest == 0 ? std::string() : progressJson(progressOf(measures));
}

}  // namespace

Result<pb::Reply> getResults(const Context& context, const pb::GetResults& call) {
  const auto view = Transaction::begin(context.reader, Transaction::Kind::kRead);
  if (!view) return view.error();
  const auto course = CurriculumStore(context.reader).get(call.course_id());
  if (!course) return course.error();
  pb::Reply reply;
  auto* results = reply.mutable_results();
  std::vector<CourseExercise> exercises;
  for (const StoredExercise& stored : course->exercises) {
    auto exercise = exerciseOf(stored);
    if (!exercise) return exercise.error();
    results->add_exercise_ids(stored.id);
    results->add_exercise_names(stored.name);
    exercises.push_back({stored, std::move(*exercise)});
  }
  std::set<std::string> names;
  if (context.who.role == pb::TRAINEE) {
    names.insert(context.who.name);
  } else {
    auto found = traineesOf(context.reader, call.course_id(), call.group_id());
    if (!found) return found.error();
    names = std::move(*found);
  }
  PageRoom room;
  room.take(results->ByteSizeLong() + 1);
  for (const std::string& name : names) {
    if (name <= call.page()) continue;
    pb::ResultRow row;
    row.set_trainee(name);
    const auto person = PeopleStore(context.reader).find(name);
    if (!person) return person.error();
    if (*person) row.set_full_name((*person)->full_name);
    for (const CourseExercise& exercise : exercises) {
      auto cell = cellOf(context.reader, name, exercise, context.now_unix_ns);
      if (!cell) return cell.error();
      *row.add_cells() = std::move(*cell);
    }
    if (!room.take(row.ByteSizeLong())) {
      if (results->rows().empty())
        return Error{ErrorCode::kInvalidInput,
                     "course '" + call.course_id() + "' has too many exercises for one message"};
      results->set_next_page(results->rows().rbegin()->trainee());
      break;
    }
    *results->add_rows() = std::move(row);
  }
  return reply;
}

Result<pb::Reply> getProgress(const Context& context, const pb::GetProgress& call) {
  if (auto own = ownOnly(context, call.trainee(), "progress"); !own) return own.error();
  const auto view = Transaction::begin(context.reader, Transaction::Kind::kRead);
  if (!view) return view.error();
  auto attempts = AttemptStore(context.reader).list(call.trainee(), call.exercise_id(), true);
  if (!attempts) return attempts.error();
  // a page is the attempt before it, wherever that stands by now: sessions of a station that was away move
  // those behind
  auto next = attempts->begin();
  if (!call.page().empty()) {
    next = std::find_if(attempts->begin(), attempts->end(),
                        [&](const pb::Attempt& attempt) { return attempt.session_id() == call.page(); });
    if (next == attempts->end())
      return Error{ErrorCode::kInvalidInput,
                   "page: give back the next_page of the reply before; if you did, the list "
                   "has changed meanwhile: begin anew"};
    ++next;
  }
  pb::Reply reply;
  auto* list = reply.mutable_progress();
  PageRoom room;
  if (call.page().empty() && !call.exercise_id().empty()) {
    auto measures = measuresOver(context.reader, *attempts);
    if (!measures) return measures.error();
    room.take(measures->size() + 1);
    list->set_measures_json(std::move(*measures));
  }
  for (; next != attempts->end(); ++next) {
    pb::Attempt& attempt = *next;
    // an exercise that is gone was never due
    const auto stored = CurriculumStore(context.reader).exercise(attempt.exercise_id());
    if (!stored && stored.error().code != ErrorCode::kNotFound) return stored.error();
    if (stored) {
      const auto exercise = exerciseOf(*stored);
      if (!exercise) return exercise.error();
      const auto standing = standingOf(context.reader, call.trainee(), *stored, *exercise);
      if (!standing) return standing.error();
      attempt.set_late(standing->due_unix_ns != 0 && attempt.started_unix_ns() > standing->due_unix_ns);
    }
    if (!room.take(attempt.ByteSizeLong()) && list->attempts_size() > 0) {
      list->set_next_page(list->attempts().rbegin()->session_id());
      break;
    }
    *list->add_attempts() = std::move(attempt);
  }
  return reply;
}

Result<pb::Reply> excuseAttempt(const Context& context, const pb::ExcuseAttempt& call) {
  const auto id = sessionId(call.session_id());
  if (!id) return id.error();
  const auto status =
      write(context, uuidText(*id), (call.excused() ? "does not count: " : "counts again: ") + call.reason(),
            [&](Connection& writer) {
              const auto changed = AttemptStore(writer).excuse(*id, call.excused());
              return changed ? Status() : Status(changed.error());
            });
  if (!status) return status.error();
  auto attempt = AttemptStore(context.reader).get(*id);
  if (!attempt) return attempt.error();
  pb::Reply reply;
  *reply.mutable_attempt() = std::move(*attempt);
  return reply;
}

}  // namespace needlelab::handlers
