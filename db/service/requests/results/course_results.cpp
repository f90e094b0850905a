// A course's matrix of trainees and exercises, page by page.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/base/text/uuid.h"
#include "common/scoring/measures/measures.h"
#include "db/people/look_alikes.h"
#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/lessons/standing.h"
#include "db/service/scoring/held_results.h"
#include "db/store/connection.h"
#include "db/teaching/assignments.h"
#include "db/teaching/attempt_sums.h"
#include "db/teaching/attempts.h"
#include "db/teaching/documents.h"

namespace needlelab::handlers {
namespace {

constexpr std::uint32_t kResultsOfPage = 100, kMaxResultsOfPage = 250, kNamesOfPage = 1000;
constexpr std::size_t kCellsAtOnce = 2000;
constexpr std::size_t kScoresAtOnce = 200;  // about 6 KB each

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

/// `held_until_unix_ns`: as WithheldResults::until().
pb::ResultCell cellOf(const ReadExercise& exercise, const ExerciseStanding& standing,
                      std::int64_t now_unix_ns, std::int64_t held_until_unix_ns) {
  pb::ResultCell cell;
  cell.set_exercise_id(exercise.stored.id);
  cell.set_attempts(standing.attempts.counted);
  const bool is_held = held_until_unix_ns != 0;
  const bool done = is_held ? standing.attempts.counted > 0 : standing.done;
  if (standing.attempts.passed && !is_held) cell.set_passed(*standing.attempts.passed);
  cell.set_results_from_unix_ns(held_until_unix_ns);
  for (const std::string& id : standing.locked_by) cell.add_locked_by(id);
  if (standing.attempts_left) cell.set_attempts_left(*standing.attempts_left);
  cell.set_due_unix_ns(standing.due_unix_ns);
  cell.set_overdue(standing.due_unix_ns != 0 && standing.due_unix_ns < now_unix_ns && !done);
  cell.set_done(done);
  return cell;
}

/// The measures required by the exercises, each once; a time limit is a requirement on the elapsed time.
std::vector<std::string> requiredMeasures(const std::vector<ReadExercise>& exercises) {
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const ReadExercise& exercise : exercises) {
    for (const auto& requirement : exercise.exercise.requirements()) add(requirement.measure());
    if (exercise.exercise.has_time_limit_s()) add(std::string(measureOf(MeasureRole::kTime).name));
  }
  return names;
}

/// Which part of the best attempt is wanted.
enum class Best : std::uint8_t { kNothing, kAttempt, kMeasures };

/// The cells of successive trainees. A fixed number of reads covers as many trainees as have kCellsAtOnce
/// cells (kScoresAtOnce cells, with measures), plus one read if there are groups not seen before; independent
/// of the number of attempts.
class Cells {
 public:
  Cells(const Context& context, std::vector<ReadExercise> exercises, std::string course_id, Best wanted)
      : context_(context),
        exercises_(std::move(exercises)),
        course_id_(std::move(course_id)),
        wanted_(wanted),
        measures_(requiredMeasures(exercises_)),
        held_(context),
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
  /// Number of trainees per read().
  [[nodiscard]] std::size_t traineesAtOnce() const {
    const std::size_t cells = wanted_ == Best::kMeasures ? kScoresAtOnce : kCellsAtOnce;
    return std::max<std::size_t>(1, cells / std::max<std::size_t>(1, looked_at_.size()));
  }
  Status read(std::span<const std::string> trainees) {
    AttemptStore store(context_.reader);
    ASSIGN_OR_RETURN(standings_, store.standingsOf(trainees, looked_at_));
    RETURN_IF_ERROR(dates_.readFor(trainees));
    if (wanted_ == Best::kNothing) return {};
    ASSIGN_OR_RETURN(best_, store.best(trainees, course_id_, wanted_ == Best::kMeasures));
    return {};
  }
  /// `row`: of one of the trainees that were read.
  Status addTo(pb::ResultRow& row) {
    ASSIGN_OR_RETURN(const auto dues_ns, dates_.of(row.trainee()));
    auto& best = best_[row.trainee()];
    for (std::size_t i = 0; i < exercises_.size(); ++i) {
      const ReadExercise& exercise = exercises_[i];
      const ExerciseStanding standing = standingBy(exercise, standings_[row.trainee()], dues_ns[i]);
      ASSIGN_OR_RETURN(const auto held_until, held_.until(exercise.stored.id));
      pb::ResultCell cell = cellOf(exercise, standing, context_.now_unix_ns, held_until);
      if (wanted_ == Best::kMeasures) cell.set_excused(standing.attempts.all - standing.attempts.counted);
      if (const auto found = best.find(exercise.stored.id); found != best.end() && held_until == 0) {
        *cell.mutable_best() = std::move(found->second);
        cell.mutable_best()->set_late(standing.due_unix_ns != 0 &&
                                      cell.best().started_unix_ns() > standing.due_unix_ns);
        RETURN_IF_ERROR(keepRequiredMeasures(*cell.mutable_best()));
      }
      *row.add_cells() = std::move(cell);
    }
    return {};
  }

 private:
  /// Keeps the required measures of the attempt's score, if it was read, without their sentences.
  Status keepRequiredMeasures(pb::Attempt& best) const {
    if (best.score_json().empty()) return {};
    ASSIGN_OR_RETURN(const auto id, sessionId(best.session_id()));
    auto measures = parseScore(best.score_json());
    if (!measures)
      return Error{measures.error().code, "session " + uuidText(id) + ": " + measures.error().message};
    std::erase_if(*measures, [&](const Measure& measure) {
      return std::find(measures_.begin(), measures_.end(), measure.name) == measures_.end();
    });
    for (Measure& measure : *measures) measure.words.clear();
    best.set_score_json(scoreJson(*measures));
    return {};
  }

  const Context& context_;
  const std::vector<ReadExercise> exercises_;
  const std::string course_id_;
  const Best wanted_;
  const std::vector<std::string> measures_;  ///< required by the course
  WithheldResults held_;
  std::vector<std::string> looked_at_;  ///< ids of the exercises and of their prerequisites
  CourseDates dates_;
  AttemptStore::Standings standings_;
  AttemptStore::BestAttempts best_;
};

/// Number of trainees on all pages, and how many of them passed.
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
  if (!call.trainee().empty()) RETURN_IF_ERROR(requireOwnData(context, call.trainee(), "results"));
  // a station shows one trainee's standing, and a list of names to choose from
  const bool by_station = context.who.role == pb::STATION;
  const bool names_only = by_station && call.trainee().empty();
  const bool with_measures = call.with_measures() && !by_station;
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  const auto course = CurriculumStore(context.reader).get(call.course_id());
  if (!course && !by_station && context.who.role != pb::TRAINEE)
    RETURN_IF_ERROR(requireThing(context.reader, Thing::kCourse, call.course_id()));
  if (!course) return course.error();
  RETURN_IF_ERROR(requireVisible(context.reader, *course, context.who.name, context.who.role));
  ASSIGN_OR_RETURN(auto exercises, exercisesOf(context.reader, *course));
  pb::Reply reply;
  auto* results = reply.mutable_results();
  for (const ReadExercise& exercise : exercises) {
    results->add_exercise_ids(exercise.stored.id);
    results->add_exercise_names(exercise.stored.name);
  }
  if (with_measures)
    for (std::string& name : requiredMeasures(exercises)) results->add_required_measures(std::move(name));
  const std::uint32_t usual = names_only ? kNamesOfPage : kResultsOfPage;
  const std::uint32_t greatest = names_only ? kNamesOfPage : kMaxResultsOfPage;
  const std::size_t most = call.limit() == 0 ? usual : std::min(call.limit(), greatest);
  // the page token is the last row's name and ref
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
  if (with_measures && context.who.role != pb::TRAINEE)
    RETURN_IF_ERROR(
        noteRead(context, call.course_id(), call.group_id().empty() ? "" : "of group " + call.group_id()));
  std::vector<std::string> names;
  for (const CourseTrainee& one : trainees_of_page) names.push_back(one.ref);
  Cells cells(context, std::move(exercises), call.course_id(),
              with_measures ? Best::kMeasures
              : by_station  ? Best::kNothing
                            : Best::kAttempt);
  const std::span shown(names.data(), std::min(names.size(), most));
  ASSIGN_OR_RETURN(const auto people, PeopleStore(context.reader).findAll(shown));
  std::map<std::string, std::string> outer_refs;
  if (by_station) {
    ASSIGN_OR_RETURN(outer_refs, outerRefs(context.reader, shown));
  }
  std::map<std::string, std::vector<std::string>> groups;
  if (with_measures) {
    ASSIGN_OR_RETURN(groups, GroupStore(context.reader).groupsOfMany(shown));
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
    for (std::string& group : groups[name]) row.add_groups(std::move(group));
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
