#include "db/teaching/today.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <utility>

namespace needlelab {
namespace {

/// The dates that a group's or a person's assignments set for an exercise; 0: none.
struct GivenDates {
  std::int64_t exercise_ns = 0, course_ns = 0;
};
/// By exercise.
using Given = std::map<std::string, GivenDates>;

/// By group's id, or person's ref.
Result<std::map<std::string, Given>> givenBy(Connection& connection, std::string_view whose) {
  std::map<std::string, Given> all;
  Statement row = connection.query(fmt::format(
      "SELECT a.{0}, e.id, a.course_id IS NULL, coalesce(a.due_unix_ns, 0) FROM assignments a JOIN exercises e"
      " ON e.curriculum_id = a.course_id OR e.id = a.exercise_id WHERE a.{0} IS NOT NULL",
      whose));
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, row.step());
    if (!more) return all;
    GivenDates& dates = all[row.text(0)][row.text(1)];
    (row.integer(2) != 0 ? dates.exercise_ns : dates.course_ns) = row.integer(3);
  }
}

/// By exercise. A date for one person is an exception from the groups', one for an exercise from its
/// course's; of several groups the latest counts (AssignmentStore::dueOf).
std::map<std::string, std::int64_t> datesOf(const Given* own, const std::vector<const Given*>& groups) {
  Given latest;
  for (const Given* group : groups) {
    for (const auto& [exercise, dates] : *group) {
      GivenDates& kept = latest[exercise];
      kept = {std::max(kept.exercise_ns, dates.exercise_ns), std::max(kept.course_ns, dates.course_ns)};
    }
  }
  std::map<std::string, std::int64_t> due;
  for (const auto& [exercise, dates] : latest)
    due[exercise] = dates.exercise_ns != 0 ? dates.exercise_ns : dates.course_ns;
  if (own == nullptr) return due;
  for (const auto& [exercise, dates] : *own) {
    std::int64_t& kept = due[exercise];
    if (const auto date = dates.exercise_ns != 0 ? dates.exercise_ns : dates.course_ns; date != 0)
      kept = date;
  }
  return due;
}

/// The conditions that need another table are checked for few rows.
constexpr std::string_view kInVain =
    "SELECT s.trainee, s.exercise_id FROM attempt_sums s WHERE s.passed = 0 AND s.judged >= ?1"
    " AND EXISTS (SELECT 1 FROM exercises e WHERE e.id = s.exercise_id)"
    " AND EXISTS (SELECT 1 FROM accounts c WHERE c.ref = s.trainee AND c.disabled = 0)"
    " AND EXISTS (SELECT 1 FROM sessions t WHERE t.trainee = s.trainee AND t.exercise_id = s.exercise_id"
    " AND t.started_unix_ns >= ?2)";

constexpr std::string_view kNewestScores =
    "SELECT started_unix_ns, score_json FROM sessions WHERE trainee = ?1 AND exercise_id = ?2"
    " AND excused = 0 AND passed IS NOT NULL AND erased = 0"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)"
    " ORDER BY started_unix_ns DESC, number DESC LIMIT ?3";

}  // namespace

Result<std::vector<LeftExercise>> TodayStore::left() {
  ASSIGN_OR_RETURN(const auto of_groups, givenBy(connection_, "group_id"));
  ASSIGN_OR_RETURN(const auto of_people, givenBy(connection_, "trainee"));
  // attempts that count, by trainee and exercise; nothing: one of them passed
  std::unordered_map<std::string, std::unordered_map<std::string, std::optional<std::uint32_t>>> tried;
  Statement sums =
      connection_.query("SELECT trainee, exercise_id, counted, passed FROM attempt_sums WHERE counted > 0");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, sums.step());
    if (!more) break;
    auto& one = tried[sums.text(0)][sums.text(1)];
    if (sums.integer(3) == 0) one = sums.natural32(2);
  }
  // each person once for each group, without a group once
  ASSIGN_OR_RETURN(
      const auto people,
      connection_
          .query("SELECT c.ref, coalesce(m.group_id, '') FROM accounts c LEFT JOIN group_members m"
                 " ON m.person = c.ref WHERE c.disabled = 0 ORDER BY c.name, c.ref")
          .all([](const Statement& row) { return std::pair(row.text(0), row.text(1)); }));
  std::vector<LeftExercise> left;
  for (std::size_t i = 0; i < people.size();) {
    const std::string& ref = people[i].first;
    const auto own = of_people.find(ref);
    std::vector<const Given*> groups;
    for (; i < people.size() && people[i].first == ref; ++i)
      if (const auto group = of_groups.find(people[i].second); group != of_groups.end())
        groups.push_back(&group->second);
    auto& attempts = tried[ref];
    for (const auto& [exercise, due_ns] : datesOf(own == of_people.end() ? nullptr : &own->second, groups)) {
      const auto found = attempts.find(exercise);
      if (found == attempts.end())
        left.push_back({ref, exercise, due_ns, 0});
      else if (found->second)
        left.push_back({ref, exercise, due_ns, *found->second});
    }
  }
  return left;
}

Result<std::vector<TriedInVain>> TodayStore::inVain(std::uint32_t in_a_row, std::int64_t since_unix_ns) {
  ASSIGN_OR_RETURN(
      auto all,
      connection_.query(kInVain, std::uint64_t{in_a_row}, since_unix_ns).all([](const Statement& row) {
        return TriedInVain{row.text(0), row.text(1), 0, {}};
      }));
  for (TriedInVain& one : all) {
    Statement row = connection_.query(kNewestScores, one.trainee, one.exercise_id, std::uint64_t{in_a_row});
    for (;;) {
      ASSIGN_OR_RETURN(const bool more, row.step());
      if (!more) break;
      one.newest_unix_ns = std::max(one.newest_unix_ns, row.integer(0));
      one.score_json.push_back(row.text(1));
    }
  }
  // the newest attempt may be one without a verdict
  std::erase_if(all, [&](const TriedInVain& one) {
    return one.newest_unix_ns < since_unix_ns || one.score_json.size() < in_a_row;
  });
  std::sort(all.begin(), all.end(), [](const TriedInVain& a, const TriedInVain& b) {
    return std::tie(b.newest_unix_ns, a.trainee, a.exercise_id) <
           std::tie(a.newest_unix_ns, b.trainee, b.exercise_id);
  });
  return all;
}

}  // namespace needlelab
