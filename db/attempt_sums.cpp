#include "db/attempt_sums.h"

#include <fmt/core.h>

#include <set>
#include <utility>

#include "common/base/text.h"

namespace needlelab {
namespace {

/// Assignments that give the course ?1, or one of its exercises.
constexpr std::string_view kOfCourse =
    "(course_id = ?1 OR exercise_id IN (SELECT id FROM exercises WHERE curriculum_id = ?1))";

/// Both counts of a pair, the sums as positive numbers and the full count as negative ones: what is left
/// differs.
constexpr std::string_view kDifferences =
    "SELECT exercise_id, trainee, CAST(sum(sessions) AS BIGINT), CAST(sum(attempts) AS BIGINT),"
    " CAST(sum(counted) AS BIGINT), CAST(sum(judged) AS BIGINT), CAST(sum(passed) AS BIGINT),"
    " CAST(sum(waiting_attempts) AS BIGINT), CAST(sum(waiting_counted) AS BIGINT),"
    " CAST(sum(waiting_judged) AS BIGINT), CAST(sum(waiting_passed) AS BIGINT) FROM"
    " (SELECT exercise_id, trainee, sessions, attempts, counted, judged, passed, waiting_attempts,"
    " waiting_counted, waiting_judged, waiting_passed FROM attempt_sums"
    " UNION ALL SELECT exercise_id, trainee, -1, -attempts, -counted, -judged, -passed, -waiting_attempts,"
    " -waiting_counted, -waiting_judged, -waiting_passed FROM attempt_shares)"
    " AS both_counts GROUP BY exercise_id, trainee HAVING sum(sessions) <> 0 OR sum(attempts) <> 0 OR"
    " sum(counted) <> 0 OR sum(judged) <> 0 OR sum(passed) <> 0 OR sum(waiting_attempts) <> 0 OR"
    " sum(waiting_counted) <> 0 OR sum(waiting_judged) <> 0 OR sum(waiting_passed) <> 0"
    " ORDER BY exercise_id, trainee LIMIT ?";

std::pair<std::string, std::uint32_t> countOfExercise(const Statement& row) {
  return {row.text(0), row.natural32(1)};
}

}  // namespace

Result<std::vector<std::string>> CourseTrainees::page(std::string_view after, std::size_t most) {
  const auto most_rows = static_cast<std::uint64_t>(most);
  const auto members = [&](const std::string& group) {
    return connection_
        .query("SELECT person FROM group_members WHERE group_id = ? AND person > ? ORDER BY person LIMIT ?",
               group, after, most_rows)
        .all(firstText);
  };
  if (!group_id_.empty()) return members(group_id_);
  // each source gives its next names: the next ones of all are among them
  std::set<std::string> names;
  ASSIGN_OR_RETURN(
      const auto exercises,
      connection_.query("SELECT id FROM exercises WHERE curriculum_id = ?", course_id_).all(firstText));
  for (const std::string& exercise : exercises) {
    ASSIGN_OR_RETURN(const auto tried,
                     connection_
                         .query("SELECT trainee FROM attempt_sums WHERE exercise_id = ? AND trainee > ?"
                                " ORDER BY trainee LIMIT ?",
                                exercise, after, most_rows)
                         .all(firstText));
    names.insert(tried.begin(), tried.end());
  }
  ASSIGN_OR_RETURN(
      const auto groups,
      connection_
          .query(fmt::format("SELECT DISTINCT group_id FROM assignments WHERE group_id IS NOT NULL"
                             " AND {}",
                             kOfCourse),
                 course_id_)
          .all(firstText));
  for (const std::string& group : groups) {
    ASSIGN_OR_RETURN(const auto joined, members(group));
    names.insert(joined.begin(), joined.end());
  }
  ASSIGN_OR_RETURN(const auto assigned,
                   connection_
                       .query(fmt::format("SELECT DISTINCT trainee FROM assignments WHERE trainee > ?2 AND {}"
                                          " ORDER BY trainee LIMIT ?3",
                                          kOfCourse),
                              course_id_, after, most_rows)
                       .all(firstText));
  names.insert(assigned.begin(), assigned.end());
  std::vector<std::string> page;
  for (auto name = names.begin(); name != names.end() && page.size() < most; ++name) page.push_back(*name);
  return page;
}

Result<std::uint32_t> CourseTrainees::count() {
  auto row =
      group_id_.empty()
          ? connection_.query(
                fmt::format(
                    "SELECT count(*) FROM (SELECT trainee AS name FROM attempt_sums WHERE exercise_id IN"
                    " (SELECT id FROM exercises WHERE curriculum_id = ?1)"
                    " UNION SELECT person FROM group_members WHERE group_id IN"
                    " (SELECT group_id FROM assignments WHERE {0})"
                    " UNION SELECT trainee FROM assignments WHERE trainee IS NOT NULL AND {0}) AS names",
                    kOfCourse),
                course_id_)
          : connection_.query("SELECT count(*) FROM group_members WHERE group_id = ?", group_id_);
  ASSIGN_OR_RETURN(const bool there, row.step());
  return there ? row.natural32(0) : 0;
}

Result<std::map<std::string, std::uint32_t>> CourseTrainees::passed() {
  constexpr std::string_view kPassed =
      "SELECT a.exercise_id, count(*) FROM attempt_counts a {} a.exercise_id IN"
      " (SELECT id FROM exercises WHERE curriculum_id = ?1) AND a.passed > 0 GROUP BY a.exercise_id";
  auto rows = group_id_.empty()
                  ? connection_.query(fmt::format(kPassed, "WHERE"), course_id_)
                  : connection_.query(
                        fmt::format(kPassed,
                                    "JOIN group_members m ON m.person = a.trainee WHERE m.group_id = ?2 AND"),
                        course_id_, group_id_);
  ASSIGN_OR_RETURN(auto counts, rows.all(countOfExercise));
  return std::map<std::string, std::uint32_t>(std::make_move_iterator(counts.begin()),
                                              std::make_move_iterator(counts.end()));
}

Result<std::vector<SumFault>> AttemptSums::faults(std::size_t most) {
  return connection_.query(kDifferences, static_cast<std::uint64_t>(most)).all([](const Statement& row) {
    return SumFault{
        row.text(0), row.text(1),
        fmt::format(
            "the sums of '{}' at exercise '{}' differ from the sessions: by {:+} sessions, {:+} attempts, "
            "{:+} that count, {:+} with a verdict, {:+} passed, of those that wait for their trainee {:+}, "
            "{:+}, {:+}, {:+}; `needlelab-admin scores rescore` makes them new",
            printable(row.text(1)), printable(row.text(0)), row.integer(2), row.integer(3), row.integer(4),
            row.integer(5), row.integer(6), row.integer(7), row.integer(8), row.integer(9), row.integer(10))};
  });
}

Status AttemptSums::recount(std::string_view exercise_id, std::string_view trainee) {
  RETURN_IF_ERROR(connection_.run("DELETE FROM attempt_sums WHERE exercise_id = ? AND trainee = ?",
                                  exercise_id, trainee));
  return connection_.run(
      "INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed,"
      " waiting_attempts, waiting_counted, waiting_judged, waiting_passed)"
      " SELECT exercise_id, trainee, count(*), sum(attempts), sum(counted), sum(judged), sum(passed),"
      " sum(waiting_attempts), sum(waiting_counted), sum(waiting_judged), sum(waiting_passed)"
      " FROM attempt_shares WHERE exercise_id = ? AND trainee = ? GROUP BY exercise_id, trainee",
      exercise_id, trainee);
}

}  // namespace needlelab
