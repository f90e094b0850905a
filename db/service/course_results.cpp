// A course's matrix of trainees and exercises, a page at a time.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "db/assignments.h"
#include "db/attempt_sums.h"
#include "db/connection.h"
#include "db/documents.h"
#include "db/people.h"
#include "db/service/handlers.h"
#include "db/service/standing.h"

namespace needlelab::handlers {
namespace {

constexpr std::uint32_t kResultsOfPage = 100, kMostResultsOfPage = 250, kNamesOfPage = 1000;

Result<std::vector<ReadExercise>> exercisesOf(Connection& reader, const StoredCurriculum& course) {
  std::vector<ReadExercise> exercises;
  KnownPrerequisites known;
  for (const StoredExercise& stored : course.exercises) {
    ASSIGN_OR_RETURN(const auto exercise, exerciseOf(stored));
    ASSIGN_OR_RETURN(auto read, readExercise(reader, stored, exercise, known));
    exercises.push_back(std::move(read));
  }
  return exercises;
}

pb::ResultCell cellOf(const ReadExercise& exercise, const ExerciseStanding& standing,
                      std::int64_t now_unix_ns) {
  pb::ResultCell cell;
  cell.set_exercise_id(exercise.stored.id);
  cell.set_attempts(standing.attempts.counted);
  if (standing.attempts.passed) cell.set_passed(*standing.attempts.passed);
  for (const std::string& id : standing.locked_by) cell.add_locked_by(id);
  if (standing.attempts_left) cell.set_attempts_left(*standing.attempts_left);
  cell.set_due_unix_ns(standing.due_unix_ns);
  cell.set_overdue(standing.due_unix_ns != 0 && standing.due_unix_ns < now_unix_ns && !standing.done);
  cell.set_done(standing.done);
  return cell;
}

/// The cells of a trainee: a fixed number of reads, and one for each group that nobody before was in, however
/// many exercises and attempts there are.
Status addCells(const Context& context, const std::vector<ReadExercise>& exercises,
                const std::string& course_id, bool with_best, CourseDates& dates, pb::ResultRow& row) {
  AttemptStore store(context.reader);
  ASSIGN_OR_RETURN(const auto attempts, store.standings(row.trainee()));
  ASSIGN_OR_RETURN(const auto dues_ns, dates.of(row.trainee()));
  std::map<std::string, pb::Attempt> best;
  if (with_best) {
    ASSIGN_OR_RETURN(best, store.best(row.trainee(), course_id));
  }
  for (std::size_t i = 0; i < exercises.size(); ++i) {
    const ReadExercise& exercise = exercises[i];
    const ExerciseStanding standing = standingBy(exercise, attempts, dues_ns[i]);
    pb::ResultCell cell = cellOf(exercise, standing, context.now_unix_ns);
    if (const auto found = best.find(exercise.stored.id); found != best.end()) {
      *cell.mutable_best() = std::move(found->second);
      cell.mutable_best()->set_late(standing.due_unix_ns != 0 &&
                                    cell.best().started_unix_ns() > standing.due_unix_ns);
    }
    *row.add_cells() = std::move(cell);
  }
  return {};
}

/// How many trainees there are on all pages, and how many of them passed.
Status addTotals(CourseTrainees& trainees, pb::Results& results) {
  ASSIGN_OR_RETURN(const auto count, trainees.count());
  results.set_trainees(count);
  ASSIGN_OR_RETURN(const auto passed, trainees.passed());
  for (const std::string& id : results.exercise_ids()) {
    const auto found = passed.find(id);
    results.add_trainees_passed(found == passed.end() ? 0 : found->second);
  }
  return {};
}

}  // namespace

Result<pb::Reply> getResults(const Context& context, const pb::GetResults& call) {
  if (!call.trainee().empty()) RETURN_IF_ERROR(ownOnly(context, call.trainee(), "results"));
  // a station shows one trainee's standing, and a list of names to choose from
  const bool by_station = context.who.role == pb::STATION;
  const bool names_only = by_station && call.trainee().empty();
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  const auto course = CurriculumStore(context.reader).get(call.course_id());
  if (!course) return course.error();
  ASSIGN_OR_RETURN(const auto exercises, exercisesOf(context.reader, *course));
  pb::Reply reply;
  auto* results = reply.mutable_results();
  for (const ReadExercise& exercise : exercises) {
    results->add_exercise_ids(exercise.stored.id);
    results->add_exercise_names(exercise.stored.name);
  }
  const std::uint32_t usual = names_only ? kNamesOfPage : kResultsOfPage;
  const std::uint32_t greatest = names_only ? kNamesOfPage : kMostResultsOfPage;
  const std::size_t most = call.limit() == 0 ? usual : std::min(call.limit(), greatest);
  std::vector<std::string> names;
  if (context.who.role == pb::TRAINEE || !call.trainee().empty()) {
    const std::string& name = context.who.role == pb::TRAINEE ? context.who.name : call.trainee();
    if (name > call.page()) names.push_back(name);
  } else {
    if (!call.group_id().empty()) RETURN_IF_ERROR(GroupStore(context.reader).get(call.group_id()));
    CourseTrainees trainees(context.reader, call.course_id(), call.group_id());
    ASSIGN_OR_RETURN(names, trainees.page(call.page(), most + 1));
    if (!by_station && call.page().empty()) RETURN_IF_ERROR(addTotals(trainees, *results));
  }
  CourseDates dates(context.reader, call.course_id(),
                    {results->exercise_ids().begin(), results->exercise_ids().end()});
  PageRoom room;
  room.take(results->ByteSizeLong() + 1);
  std::string last = call.page();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    if (i == most) {
      results->set_next_page(last);
      break;
    }
    pb::ResultRow row;
    row.set_trainee(name);
    ASSIGN_OR_RETURN(const auto person, PeopleStore(context.reader).find(name));
    if (by_station) {
      ASSIGN_OR_RETURN(const bool known, stationMayKnow(context.reader, person, name));
      if (!known) {
        last = name;
        continue;
      }
    }
    if (person) row.set_full_name(person->full_name);
    if (!names_only) RETURN_IF_ERROR(addCells(context, exercises, call.course_id(), !by_station, dates, row));
    if (!room.take(row.ByteSizeLong())) {
      if (results->rows().empty())
        return Error{ErrorCode::kInvalidInput,
                     "course '" + call.course_id() + "' has too many exercises for one message"};
      results->set_next_page(last);
      break;
    }
    last = name;
    *results->add_rows() = std::move(row);
  }
  return reply;
}

}  // namespace needlelab::handlers
