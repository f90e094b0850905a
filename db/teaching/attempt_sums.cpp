#include "db/teaching/attempt_sums.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

/// Assignments of the course ?1, or of one of its exercises.
constexpr std::string_view kOfCourse =
    "(course_id = ?1 OR exercise_id IN (SELECT id FROM exercises WHERE curriculum_id = ?1))";

/// Both counts of each pair: the sums as positive numbers, the full count as negative ones. A non-zero total
/// is a difference.
constexpr std::string_view kDifferences =
    "SELECT exercise_id, trainee, CAST(sum(sessions) AS BIGINT), CAST(sum(attempts) AS BIGINT),"
    " CAST(sum(counted) AS BIGINT), CAST(sum(judged) AS BIGINT), CAST(sum(passed) AS BIGINT) FROM"
    " (SELECT exercise_id, trainee, sessions, attempts, counted, judged, passed FROM attempt_sums"
    " UNION ALL SELECT exercise_id, trainee, -1, -attempts, -counted, -judged, -passed FROM attempt_shares)"
    " AS both_counts GROUP BY exercise_id, trainee HAVING sum(sessions) <> 0 OR sum(attempts) <> 0 OR"
    " sum(counted) <> 0 OR sum(judged) <> 0 OR sum(passed) <> 0"
    " ORDER BY exercise_id, trainee LIMIT ?";

std::pair<std::string, std::uint32_t> countOfExercise(const Statement& row) {
  return {row.text(0), row.natural32(1)};
}

}  // namespace

Result<bool> CourseTrainees::isAssignedOnly() {
  ASSIGN_OR_RETURN(const auto found, connection_
                                         .query("SELECT id FROM exercises WHERE curriculum_id = ?"
                                                " AND assigned_only <> 0 LIMIT 1",
                                                course_id_)
                                         .first(firstText));
  return found.has_value();
}

Result<std::vector<CourseTrainee>> CourseTrainees::page(const CourseTrainee& after, std::size_t most) {
  ASSIGN_OR_RETURN(const bool assigned_only, isAssignedOnly());
  // in name order, because most names match: the conditions are checked per name
  const std::string of_group =
      "EXISTS (SELECT 1 FROM group_members m WHERE m.person = c.ref AND m.group_id = ?1)";
  const std::string of_course = fmt::format(
      "(EXISTS (SELECT 1 FROM attempt_sums a WHERE a.trainee = c.ref{1} AND a.exercise_id IN"
      " (SELECT id FROM exercises WHERE curriculum_id = ?1))"
      " OR EXISTS (SELECT 1 FROM group_members m WHERE m.person = c.ref AND m.group_id IN"
      " (SELECT group_id FROM assignments WHERE group_id IS NOT NULL AND {0}))"
      " OR EXISTS (SELECT 1 FROM assignments WHERE trainee = c.ref AND {0}))"
      " AND c.ref NOT IN (SELECT ref FROM names_taken)",
      kOfCourse, assigned_only ? " AND a.attempts > 0" : "");
  ASSIGN_OR_RETURN(
      auto page, connection_
                     .query(fmt::format("SELECT c.ref, c.name FROM called c WHERE c.name >= ?2 AND"
                                        " (c.name > ?2 OR c.ref > ?3) AND {} ORDER BY c.name, c.ref LIMIT ?4",
                                        group_id_.empty() ? of_course : of_group),
                            group_id_.empty() ? course_id_ : group_id_, after.name, after.ref,
                            static_cast<std::uint64_t>(most))
                     .all([](const Statement& row) {
                       return CourseTrainee{row.text(0), row.text(1)};
                     }));
  const CourseTrainee guest{std::string(kGuestName), std::string(kGuestName)};
  if (!group_id_.empty() || assigned_only || !(after < guest)) return page;
  ASSIGN_OR_RETURN(const auto tried,
                   connection_
                       .query("SELECT 1 FROM attempt_sums WHERE trainee = ?2 AND exercise_id IN"
                              " (SELECT id FROM exercises WHERE curriculum_id = ?1) LIMIT 1",
                              course_id_, kGuestName)
                       .first(firstText));
  if (!tried) return page;
  page.insert(std::lower_bound(page.begin(), page.end(), guest), guest);
  if (page.size() > most) page.pop_back();
  return page;
}

Result<std::uint32_t> CourseTrainees::count() {
  ASSIGN_OR_RETURN(const bool assigned_only, isAssignedOnly());
  auto row =
      group_id_.empty()
          ? connection_.query(
                fmt::format(
                    "SELECT count(*) FROM (SELECT trainee AS name FROM attempt_sums WHERE exercise_id IN"
                    " (SELECT id FROM exercises WHERE curriculum_id = ?1){1}"
                    " UNION SELECT person FROM group_members WHERE group_id IN"
                    " (SELECT group_id FROM assignments WHERE {0})"
                    " UNION SELECT trainee FROM assignments WHERE trainee IS NOT NULL AND {0}) AS refs"
                    " WHERE name NOT IN (SELECT ref FROM names_taken)",
                    kOfCourse,
                    assigned_only ? fmt::format(" AND attempts > 0 AND trainee <> '{}'", kGuestName) : ""),
                course_id_)
          : connection_.query("SELECT count(*) FROM group_members WHERE group_id = ?", group_id_);
  ASSIGN_OR_RETURN(const bool there, row.step());
  return there ? row.natural32(0) : 0;
}

Result<std::map<std::string, std::uint32_t>> CourseTrainees::passed() {
  constexpr std::string_view kPassed =
      "SELECT a.exercise_id, count(*) FROM attempt_sums a {} a.exercise_id IN"
      " (SELECT id FROM exercises WHERE curriculum_id = ?1) AND a.passed > 0"
      " AND a.trainee NOT IN (SELECT ref FROM names_taken){} GROUP BY a.exercise_id";
  ASSIGN_OR_RETURN(const bool assigned_only, isAssignedOnly());
  const std::string no_guest = assigned_only ? fmt::format(" AND a.trainee <> '{}'", kGuestName) : "";
  auto rows =
      group_id_.empty()
          ? connection_.query(fmt::format(kPassed, "WHERE", no_guest), course_id_)
          : connection_.query(
                fmt::format(kPassed, "JOIN group_members m ON m.person = a.trainee WHERE m.group_id = ?2 AND",
                            no_guest),
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
            "{:+} that count, {:+} with a verdict, {:+} passed; `needlelab-admin scores rescore` makes them "
            "new",
            printable(row.text(1)), printable(row.text(0)), row.integer(2), row.integer(3), row.integer(4),
            row.integer(5), row.integer(6))};
  });
}

Status AttemptSums::recount(std::string_view exercise_id, std::string_view trainee) {
  RETURN_IF_ERROR(connection_.run("DELETE FROM attempt_sums WHERE exercise_id = ? AND trainee = ?",
                                  exercise_id, trainee));
  return connection_.run(
      "INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed)"
      " SELECT exercise_id, trainee, count(*), sum(attempts), sum(counted), sum(judged), sum(passed)"
      " FROM attempt_shares WHERE exercise_id = ? AND trainee = ? GROUP BY exercise_id, trainee",
      exercise_id, trainee);
}

}  // namespace needlelab
