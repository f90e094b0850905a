// What needs attention today: who has something due, who is behind, who struggles, what waits for a manager.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "common/scoring/measures/measures.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/lessons/standing.h"
#include "db/sessions/unknown_trainees.h"
#include "db/store/connection.h"
#include "db/store/schema.h"
#include "db/teaching/documents.h"
#include "db/teaching/today.h"

namespace needlelab::handlers {
namespace {

constexpr std::int64_t kDay_ns = std::int64_t{86'400} * 1'000'000'000;
constexpr std::int64_t kDueWithin_ns = 7 * kDay_ns, kTriedWithin_ns = 28 * kDay_ns;
constexpr std::uint32_t kFailuresInARow = 3;

/// A person's rows follow each other in `left`.
struct DueLists {
  std::vector<pb::TodayRow> due, behind;
};

void addDue(std::vector<pb::TodayRow>& rows, const LeftExercise& left, std::int64_t due_unix_ns) {
  if (rows.empty() || rows.back().trainee() != left.trainee) {
    rows.emplace_back().set_trainee(left.trainee);
    rows.back().set_trainee_full_name(left.trainee);
  }
  pb::TodayRow& row = rows.back();
  if (row.due_unix_ns() == 0 || due_unix_ns < row.due_unix_ns()) row.set_due_unix_ns(due_unix_ns);
  row.add_exercise_ids(left.exercise_id);
}

Result<DueLists> dueLists(Connection& reader, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto all, TodayStore(reader).left());
  std::map<std::string, pb::Exercise> exercises;
  DueLists lists;
  for (const LeftExercise& left : all) {
    auto exercise = exercises.find(left.exercise_id);
    if (exercise == exercises.end()) {
      ASSIGN_OR_RETURN(const auto stored, CurriculumStore(reader).exercise(left.exercise_id));
      ASSIGN_OR_RETURN(auto read, exerciseOf(stored));
      exercise = exercises.emplace(left.exercise_id, std::move(read)).first;
    }
    const std::int64_t due_unix_ns =
        left.due_unix_ns != 0 ? left.due_unix_ns
                              : static_cast<std::int64_t>(exercise->second.due_unix_ms()) * 1'000'000;
    if (due_unix_ns == 0 || due_unix_ns > now_unix_ns + kDueWithin_ns) continue;
    if (isDone({.counted = left.counted, .all = left.counted, .passed = {}}, exercise->second)) continue;
    addDue(due_unix_ns < now_unix_ns ? lists.behind : lists.due, left, due_unix_ns);
  }
  const auto by_date = [](const pb::TodayRow& a, const pb::TodayRow& b) {
    return a.due_unix_ns() < b.due_unix_ns();
  };
  std::stable_sort(lists.due.begin(), lists.due.end(), by_date);
  std::stable_sort(lists.behind.begin(), lists.behind.end(), by_date);
  return lists;
}

/// The first requirement that all of these scores failed; empty: there is none.
Result<std::string> failedInAll(const std::vector<std::string>& scores) {
  std::vector<std::string> failed;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    ASSIGN_OR_RETURN(const auto measures, parseScore(scores[i]));
    const auto fails = [&](const std::string& name) {
      return std::any_of(measures.begin(), measures.end(),
                         [&](const Measure& m) { return m.name == name && m.passed == false; });
    };
    if (i == 0)
      for (const Measure& measure : measures) failed.push_back(measure.name);
    std::erase_if(failed, [&](const std::string& name) { return !fails(name); });
  }
  return failed.empty() ? std::string() : failed.front();
}

Result<std::vector<pb::TodayRow>> strugglingRows(Connection& reader, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto all, TodayStore(reader).inVain(kFailuresInARow, now_unix_ns - kTriedWithin_ns));
  std::vector<pb::TodayRow> rows;
  for (const TriedInVain& one : all) {
    ASSIGN_OR_RETURN(auto measure, failedInAll(one.score_json));
    if (measure.empty()) continue;
    pb::TodayRow& row = rows.emplace_back();
    row.set_trainee(one.trainee);
    row.set_trainee_full_name(one.trainee);
    row.add_exercise_ids(one.exercise_id);
    row.set_measure(std::move(measure));
  }
  return rows;
}

/// Adds a page of `rows` to the reply; a page's token is the number of rows before it.
Status addPage(const std::vector<pb::TodayRow>& rows, const pb::GetToday& call, pb::Today& today) {
  ASSIGN_OR_RETURN(const auto from, numberOfPage(call.page()));
  PageRoom room;
  for (std::size_t i = from; i < rows.size(); ++i) {
    const bool is_full = call.limit() != 0 && i - from == call.limit();
    if (is_full || !room.take(rows[i])) {
      today.set_next_page(std::to_string(i));
      break;
    }
    *today.add_rows() = rows[i];
  }
  return {};
}

}  // namespace

Result<pb::Reply> getToday(const Context& context, const pb::GetToday& call) {
  const std::string& list = call.list();
  if (!list.empty() && list != "due" && list != "behind" && list != "struggling")
    return Error{ErrorCode::kInvalidInput,
                 "list: '" + printable(list) + "', allowed are due, behind, struggling"};
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  ASSIGN_OR_RETURN(const auto dates, dueLists(context.reader, context.now_unix_ns));
  ASSIGN_OR_RETURN(const auto struggling, strugglingRows(context.reader, context.now_unix_ns));
  pb::Reply reply;
  pb::Today& today = *reply.mutable_today();
  today.set_due(static_cast<std::uint32_t>(dates.due.size()));
  today.set_behind(static_cast<std::uint32_t>(dates.behind.size()));
  today.set_struggling(static_cast<std::uint32_t>(struggling.size()));
  if (context.who.role != pb::INSTRUCTOR) {
    ASSIGN_OR_RETURN(const auto waiting,
                     context.reader.query("SELECT count(*) FROM " + std::string(kWaitingSessions) + " AS w")
                         .first([](const Statement& row) { return row.natural32(0); }));
    today.set_waiting(waiting.value_or(0));
    ASSIGN_OR_RETURN(const auto backup, MetaStore(context.reader).get("backup_unix_ns"));
    today.set_backup_unix_ns(backup ? std::strtoll(backup->c_str(), nullptr, 10) : 0);
  }
  if (list.empty()) return reply;
  const auto& rows = list == "due" ? dates.due : list == "behind" ? dates.behind : struggling;
  RETURN_IF_ERROR(addPage(rows, call, today));
  return reply;
}

}  // namespace needlelab::handlers
