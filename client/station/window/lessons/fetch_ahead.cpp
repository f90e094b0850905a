#include "client/station/window/lessons/fetch_ahead.h"

#include <algorithm>
#include <utility>

#include "client/net/spool/lesson_cache.h"
#include "client/station/window/lessons/start_choice.h"

namespace needlelab {
namespace {

// Longer: the data are older when the server is away. Shorter: each station asks about each trainee more
// often.
constexpr std::int64_t kAgain_ns = 3'600'000'000'000;
// the file holds all standings, so it is not written after each one
constexpr std::int64_t kKeepAgain_ns = 10'000'000'000;

bool isAssigned(const StartLists& lists, const ServerExercise& exercise) {
  return lists.assigned_courses.contains(exercise.course_id) ||
         lists.assigned_exercises.contains(exercise.exercise_id);
}

}  // namespace

std::optional<PrefetchItem> FetchAhead::wanted(const StartLists& lists, std::int64_t now_unix_ns) const {
  using Kind = PrefetchItem::Kind;
  const auto mayAsk = [&](const PrefetchItem& one) {
    const auto refused = refused_unix_ns_.find(one);
    return refused == refused_unix_ns_.end() || now_unix_ns - refused->second >= kAgain_ns;
  };
  std::optional<PrefetchItem> old;
  std::int64_t oldest_ns = now_unix_ns - kAgain_ns;
  // returns whether it is missing; keeps the oldest so far in `old`
  const auto isMissing = [&](const PrefetchItem& one, std::int64_t fetched_unix_ns) {
    if (!mayAsk(one)) return false;
    if (fetched_unix_ns == 0) return true;
    if (fetched_unix_ns <= oldest_ns) {
      oldest_ns = fetched_unix_ns;
      old = one;
    }
    return false;
  };
  for (const ServerExercise& exercise : lists.curriculum->exercises) {
    if (!isAssigned(lists, exercise)) continue;
    const auto listed =
        std::find_if(lists.exercises.begin(), lists.exercises.end(),
                     [&](const ListedExercise& one) { return one.exercise_id == exercise.exercise_id; });
    const bool kept = listed != lists.exercises.end() && listed->cached_revision;
    const PrefetchItem lesson{Kind::kLesson, exercise.exercise_id};
    if (isMissing(lesson, kept ? listed->fetched_unix_ns : 0)) return lesson;
  }
  for (const KnownTrainee& trainee : lists.curriculum->trainees) {
    const auto known = lists.curriculum->standings.find(trainee.name);
    const std::int64_t as_of_ns =
        known != lists.curriculum->standings.end() ? known->second.as_of_unix_ns : 0;
    const PrefetchItem standing{Kind::kStanding, trainee.name};
    if (isMissing(standing, as_of_ns < assigned_unix_ns_ ? 0 : as_of_ns)) return standing;
  }
  return old;
}

Result<bool> FetchAhead::step(StartLists& lists, const AskServer& ask, std::int64_t now_unix_ns) {
  if (!lists.curriculum || lists.assignments == 0) return false;  // no report from the server yet
  if (lists.assignments != assignments_) {
    // also the first time: what was kept before this program began may belong to other assignments
    assignments_ = lists.assignments;
    assigned_unix_ns_ = now_unix_ns;
  }
  const auto next = wanted(lists, now_unix_ns);
  if (!next) {
    RETURN_IF_ERROR(keep(lists, now_unix_ns));
    return false;
  }
  const bool is_lesson = next->kind == PrefetchItem::Kind::kLesson;
  const Status fetched = is_lesson ? fetchLesson(lists, next->id, ask, now_unix_ns)
                                   : addStanding(lists, next->id, ask, now_unix_ns);
  if (!fetched.ok()) {
    const ErrorCode code = fetched.error().code;
    if (code != ErrorCode::kUnavailable && code != ErrorCode::kFailed) refused_unix_ns_[*next] = now_unix_ns;
    return fetched.error();
  }
  refused_unix_ns_.erase(*next);
  unkept_ = unkept_ || !is_lesson;
  if (now_unix_ns - kept_unix_ns_ >= kKeepAgain_ns) RETURN_IF_ERROR(keep(lists, now_unix_ns));
  return true;
}

Status FetchAhead::fetchLesson(StartLists& lists, const std::string& id, const AskServer& ask,
                               std::int64_t now_unix_ns) {
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id(id);
  ASSIGN_OR_RETURN(const auto reply, ask(request));
  RETURN_IF_ERROR(LessonCache(options_.spool).keep(id, reply.lesson()));
  for (ListedExercise& listed : lists.exercises) {
    if (listed.exercise_id != id) continue;
    listed.cached_revision = reply.lesson().profile_revision();
    listed.fetched_unix_ns = now_unix_ns;
    listed.trouble.clear();
  }
  return {};
}

Status FetchAhead::keep(const StartLists& lists, std::int64_t now_unix_ns) {
  if (!std::exchange(unkept_, false) || !lists.curriculum) return {};
  kept_unix_ns_ = now_unix_ns;
  return CurriculumCache(options_.spool, options_.key_file).keep(*lists.curriculum);
}

}  // namespace needlelab
