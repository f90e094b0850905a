// A course's matrix of trainees and exercises, a page at a time.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "db/assignments.h"
#include "db/attempt_sums.h"
#include "db/connection.h"
#include "db/documents.h"
#include "db/people.h"
#include "db/person_refs.h"
#include "db/service/handlers.h"
#include "db/service/standing.h"

namespace needlelab::handlers {
namespace {

constexpr std::uint32_t kResultsOfPage = 100, kMostResultsOfPage = 250, kNamesOfPage = 1000;
constexpr std::size_t kCellsAtOnce = 2000;

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

/// The cells of some trainees after others: a fixed number of reads for as many as have kCellsAtOnce cells,
/// and one more where there are groups that nobody before was in, however many attempts there are.
class Cells {
 public:
  Cells(const Context& context, std::vector<ReadExercise> exercises, std::string course_id, bool with_best)
      : context_(context),
        exercises_(std::move(exercises)),
        course_id_(std::move(course_id)),
        with_best_(with_best),
        dates_(context.reader, course_id_, idsOf(exercises_)) {
    std::set<std::string> ids;
    for (const ReadExercise& exercise : exercises_) {
      ids.insert(exercise.stored.id);
      for (const auto& before : exercise.prerequisites) ids.insert(before.id);
    }
    looked_at_.assign(ids.begin(), ids.end());
  }
  static std::vector<std::string> idsOf(const std::vector<ReadExercise>& exercises) {
    std::vector<std::string> ids;
    for (const ReadExercise& exercise : exercises) ids.push_back(exercise.stored.id);
    return ids;
  }
  /// Of how many trainees read() reads at once.
  [[nodiscard]] std::size_t traineesAtOnce() const {
    return std::max<std::size_t>(1, kCellsAtOnce / std::max<std::size_t>(1, looked_at_.size()));
  }
  Status read(std::span<const std::string> trainees) {
    AttemptStore store(context_.reader);
    ASSIGN_OR_RETURN(standings_, store.standingsOf(trainees, looked_at_));
    RETURN_IF_ERROR(dates_.readFor(trainees));
    if (!with_best_) return {};
    ASSIGN_OR_RETURN(best_, store.best(trainees, course_id_));
    return {};
  }
  /// `row`: of one of the trainees that were read.
  Status addTo(pb::ResultRow& row) {
    ASSIGN_OR_RETURN(const auto dues_ns, dates_.of(row.trainee()));
    auto& best = best_[row.trainee()];
    for (std::size_t i = 0; i < exercises_.size(); ++i) {
      const ReadExercise& exercise = exercises_[i];
      const ExerciseStanding standing = standingBy(exercise, standings_[row.trainee()], dues_ns[i]);
      pb::ResultCell cell = cellOf(exercise, standing, context_.now_unix_ns);
      if (const auto found = best.find(exercise.stored.id); found != best.end()) {
        *cell.mutable_best() = std::move(found->second);
        cell.mutable_best()->set_late(standing.due_unix_ns != 0 &&
                                      cell.best().started_unix_ns() > standing.due_unix_ns);
      }
      *row.add_cells() = std::move(cell);
    }
    return {};
  }

 private:
  const Context& context_;
  const std::vector<ReadExercise> exercises_;
  const std::string course_id_;
  const bool with_best_;
  std::vector<std::string> looked_at_;  ///< ids of the exercises and of what comes before them
  CourseDates dates_;
  AttemptStore::Standings standings_;
  AttemptStore::BestAttempts best_;
};

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
  ASSIGN_OR_RETURN(auto exercises, exercisesOf(context.reader, *course));
  pb::Reply reply;
  auto* results = reply.mutable_results();
  for (const ReadExercise& exercise : exercises) {
    results->add_exercise_ids(exercise.stored.id);
    results->add_exercise_names(exercise.stored.name);
  }
  const std::uint32_t usual = names_only ? kNamesOfPage : kResultsOfPage;
  const std::uint32_t greatest = names_only ? kNamesOfPage : kMostResultsOfPage;
  const std::size_t most = call.limit() == 0 ? usual : std::min(call.limit(), greatest);
  // a page's token: the last row's name and ref
  const std::string_view token = call.page();
  const std::size_t cut = std::min(token.find('\n'), token.size());
  const CourseTrainee after{std::string(token.substr(std::min(cut + 1, token.size()))),
                            std::string(token.substr(0, cut))};
  std::vector<CourseTrainee> trainees_of_page;
  if (context.who.role == pb::TRAINEE || !call.trainee().empty()) {
    const std::string& name = context.who.role == pb::TRAINEE ? context.who.name : call.trainee();
    if (call.page().empty()) trainees_of_page.push_back({name, name});
  } else {
    if (!call.group_id().empty()) RETURN_IF_ERROR(GroupStore(context.reader).get(call.group_id()));
    CourseTrainees trainees(context.reader, call.course_id(), call.group_id());
    ASSIGN_OR_RETURN(trainees_of_page, trainees.page(after, most + 1));
    if (!by_station && call.page().empty()) RETURN_IF_ERROR(addTotals(trainees, *results));
  }
  std::vector<std::string> names;
  for (const CourseTrainee& one : trainees_of_page) names.push_back(one.ref);
  Cells cells(context, std::move(exercises), call.course_id(), !by_station);
  const std::span shown(names.data(), std::min(names.size(), most));
  ASSIGN_OR_RETURN(const auto people, PeopleStore(context.reader).findAll(shown));
  std::map<std::string, std::string> outer_refs;
  if (by_station) {
    ASSIGN_OR_RETURN(outer_refs, outerRefs(context.reader, shown));
  }
  PageRoom room;
  room.take(results->ByteSizeLong() + 1);
  std::string last = call.page();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    const std::string token_here = trainees_of_page[i].name + "\n" + name;
    if (i == most) {
      results->set_next_page(last);
      break;
    }
    if (!names_only && i % cells.traineesAtOnce() == 0)
      RETURN_IF_ERROR(cells.read(shown.subspan(i, std::min(cells.traineesAtOnce(), shown.size() - i))));
    pb::ResultRow row;
    row.set_trainee(name);
    const auto found = people.find(name);
    const auto person = found == people.end() ? std::optional<Person>() : std::optional(found->second);
    if (by_station) {
      ASSIGN_OR_RETURN(const bool known, stationMayKnow(context.reader, person, name));
      if (!known) {
        last = token_here;
        continue;
      }
    }
    if (person) {
      row.set_full_name(person->full_name);
      if (by_station) row.set_person_ref(outer_refs[name]);
    }
    if (!names_only) RETURN_IF_ERROR(cells.addTo(row));
    if (!room.take(row)) {
      if (results->rows().empty())
        return Error{ErrorCode::kInvalidInput,
                     "course '" + call.course_id() + "' has too many exercises for one message"};
      results->set_next_page(last);
      break;
    }
    last = token_here;
    *results->add_rows() = std::move(row);
  }
  return reply;
}

}  // namespace needlelab::handlers
