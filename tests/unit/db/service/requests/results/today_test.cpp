// What needs attention today, compared with each trainee's row of results and with the attempts themselves.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "db/store/schema.h"
#include "db/teaching/assignments.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

constexpr std::int64_t kTodayDay_ns = std::int64_t{86'400} * 1'000'000'000;

class Today : public test::TeachingTest {
 protected:
  pb::Today today(const Principal& who, const std::string& list = "", const std::string& page = "",
                  std::uint32_t limit = 0) {
    pb::Request request;
    request.mutable_get_today()->set_list(list);
    request.mutable_get_today()->set_page(page);
    request.mutable_get_today()->set_limit(limit);
    return get(who, request).today();
  }
  void assignTo(const std::string& trainee, const std::string& group, const std::string& exercise,
                std::int64_t due_ns) {
    pb::Request request;
    auto& assign = *request.mutable_assign();
    assign.set_trainee(trainee);
    assign.set_group_id(group);
    assign.set_exercise_id(exercise);
    if (exercise.empty()) assign.set_course_id("course");
    assign.set_due_unix_ns(due_ns);
    get(manager, request);
  }
  void excuse(const Uuid& id) {
    pb::Request request;
    request.mutable_excuse_attempt()->set_session_id(test::bytesOfId(id));
    request.mutable_excuse_attempt()->set_excused(true);
    get(manager, request);
  }
  /// Adds an attempt at an exercise that requires a force and a time.
  Uuid attemptBy(const std::string& who, const std::string& exercise, bool force, bool time,
                 std::int64_t started_ns) {
    const Uuid id = makeUuidV7();
    const auto row = [](const char* measure, bool passed) {
      return nlohmann::json{
          {"measure", measure}, {"value", 1}, {"unit", ""}, {"words", ""}, {"passed", passed}};
    };
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee(who);
      d.set_exercise_id(exercise);
      d.set_started_unix_ns(started_ns);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      if (auto closed = SessionStore(c).close(test::closeOf(id, 0), 2); !closed) return closed.error();
      auto score =
          test::scoreOf(id, nlohmann::json{row("peak_force_n", force),
                                           row("elapsed_s", time),
                                           {{"measure", "drops"}, {"value", 1}, {"unit", ""}, {"words", ""}}}
                                .dump());
      score.set_passed(force && time);
      return ScoreStore(c).put(score);
    }));
    return id;
  }
  const std::int64_t now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                                  std::chrono::system_clock::now().time_since_epoch())
                                  .count();
  std::mt19937_64 random{69};
  int upTo(int most) { return static_cast<int>(random() % static_cast<unsigned>(most + 1)); }
};

TEST_F(Today, dueAndBehindAreWhatTheRowsOfResultsSayOfWhatIsAssigned) {
  addStation();
  putCourse({{"second", {{"due_unix_ms", (now_ns - 3 * kTodayDay_ns) / 1'000'000}}},
             {"third", {{"requirements", nlohmann::json::array()}}}});
  std::vector<std::string> people;
  for (int i = 0; i < 24; ++i) {
    people.push_back("t" + std::to_string(10 + i));
    makeKnown(people.back());
  }
  for (const std::string group : {"a", "b", "c"}) {
    std::vector<std::string> members;
    for (const std::string& one : people)
      if (upTo(2) == 0) members.push_back(one);
    get(manager, putGroup(group, members, 0));
  }
  const std::int64_t dates_ns[] = {0, now_ns - 2 * kTodayDay_ns, now_ns + 2 * kTodayDay_ns,
                                   now_ns + 20 * kTodayDay_ns};
  const std::string exercises[] = {"", "first", "second", "third"};
  for (const std::string group : {"a", "b", "c"}) {
    assignTo("", group, "", dates_ns[upTo(3)]);
    assignTo("", group, exercises[1 + upTo(2)], dates_ns[upTo(3)]);
  }
  for (int i = 0; i < 16; ++i)
    assignTo(people[static_cast<std::size_t>(upTo(23))], "", exercises[upTo(3)], dates_ns[upTo(3)]);
  for (int i = 0; i < 40; ++i)
    attempt(people[static_cast<std::size_t>(upTo(23))], exercises[1 + upTo(2)], upTo(1) == 0);
  for (const char* gone : {"t11", "t17"}) {
    pb::Request disable;
    disable.mutable_disable_user()->set_name(gone);
    get(admin, disable);
  }

  // by person: the exercises, and the earliest date
  using Expected = std::map<std::string, std::pair<std::set<std::string>, std::int64_t>>;
  Expected due, behind;
  const pb::Results matrix = results(manager);
  for (const pb::ResultRow& row : matrix.rows()) {
    if (row.trainee() == "t11" || row.trainee() == "t17") continue;
    for (const pb::ResultCell& cell : row.cells()) {
      auto reader = store->readers().borrow();
      const auto assigned =
          AssignmentStore(**reader).isAssigned(refOf(row.trainee()), cell.exercise_id(), "course");
      if (!*assigned || cell.done() || cell.due_unix_ns() == 0) continue;
      EXPECT_EQ(cell.overdue(), cell.due_unix_ns() < now_ns);
      if (cell.due_unix_ns() > now_ns + 7 * kTodayDay_ns) continue;
      auto& [ids, first_ns] = (cell.overdue() ? behind : due)[row.trainee()];
      ids.insert(cell.exercise_id());
      first_ns = first_ns == 0 ? cell.due_unix_ns() : std::min(first_ns, cell.due_unix_ns());
    }
  }
  ASSERT_GT(due.size(), 2u);
  ASSERT_GT(behind.size(), 2u);
  const auto rowsOf = [&](const std::string& list) {
    Expected found;
    std::int64_t last_ns = 0;
    std::string page;
    do {  // pages of two rows
      const pb::Today part = today(instructor, list, page, 2);
      EXPECT_LE(part.rows_size(), 2);
      for (const pb::TodayRow& row : part.rows()) {
        EXPECT_GE(row.due_unix_ns(), last_ns) << "by date";
        last_ns = row.due_unix_ns();
        const auto [at, is_new] = found.try_emplace(row.trainee());
        EXPECT_TRUE(is_new) << row.trainee() << " has two rows";
        at->second = {{row.exercise_ids().begin(), row.exercise_ids().end()}, row.due_unix_ns()};
      }
      page = part.next_page();
    } while (!page.empty());
    return found;
  };
  EXPECT_EQ(rowsOf("due"), due);
  EXPECT_EQ(rowsOf("behind"), behind);
  const pb::Today numbers = today(instructor);
  EXPECT_EQ(numbers.due(), due.size());
  EXPECT_EQ(numbers.behind(), behind.size());
  EXPECT_EQ(numbers.rows_size(), 0) << "rows come when a list is asked for";
}

TEST_F(Today, aTraineeStrugglesWhoseLastThreeAttemptsFailedTheSameRequirement) {
  addStation();
  putCourse();
  struct Tried {
    std::int64_t started_ns;
    bool force, time, counts;
  };
  std::map<std::pair<std::string, std::string>, std::vector<Tried>> all;
  for (int i = 0; i < 12; ++i) {
    const std::string who = "t" + std::to_string(10 + i);
    makeKnown(who);
    for (const std::string exercise : {"first", "second"}) {
      auto& attempts = all[{who, exercise}];
      const std::int64_t newest_ns = now_ns - (upTo(3) == 0 ? 40 : 1 + upTo(20)) * kTodayDay_ns;
      for (int k = upTo(6); k > 0; --k) {
        const Tried one{newest_ns - k * kTodayDay_ns, upTo(3) == 0, upTo(3) == 0, upTo(5) != 0};
        attempts.push_back(one);
        const Uuid id = attemptBy(who, exercise, one.force, one.time, one.started_ns);
        if (!one.counts) excuse(id);
      }
    }
  }
  using Row = std::tuple<std::string, std::string, std::string>;
  std::set<Row> expected;
  for (auto& [of, attempts] : all) {
    std::erase_if(attempts, [](const Tried& one) { return !one.counts; });
    const bool passed =
        std::any_of(attempts.begin(), attempts.end(), [](const Tried& one) { return one.force && one.time; });
    if (passed || attempts.size() < 3 || attempts.back().started_ns < now_ns - 28 * kTodayDay_ns) continue;
    bool force = true, time = true;
    for (std::size_t k = attempts.size() - 3; k < attempts.size(); ++k) {
      force = force && !attempts[k].force;
      time = time && !attempts[k].time;
    }
    if (force || time) expected.emplace(of.first, of.second, force ? "peak_force_n" : "elapsed_s");
  }
  ASSERT_GT(expected.size(), 1u);
  ASSERT_LT(expected.size(), all.size());
  const pb::Today found = today(instructor, "struggling");
  std::set<Row> rows;
  for (const pb::TodayRow& row : found.rows()) {
    ASSERT_EQ(row.exercise_ids_size(), 1);
    rows.emplace(row.trainee(), row.exercise_ids(0), row.measure());
  }
  EXPECT_EQ(rows, expected);
  EXPECT_EQ(found.struggling(), expected.size());
}

TEST_F(Today, managersAlsoSeeWhatWaitsAndTheLastBackup) {
  addStation();
  putCourse();
  attempt("nobody-knows", "first", true);
  attempt("another-name", "first", false);
  const pb::Today first = today(manager);
  EXPECT_EQ(first.waiting(), 2u);
  EXPECT_EQ(first.backup_unix_ns(), 0);
  ASSERT_OK(change([](Connection& c) { return MetaStore(c).set("backup_unix_ns", "1700000000000000005"); }));
  EXPECT_EQ(today(admin).backup_unix_ns(), 1'700'000'000'000'000'005);
  const pb::Today of_instructor = today(instructor);
  EXPECT_FALSE(of_instructor.has_waiting());
  EXPECT_FALSE(of_instructor.has_backup_unix_ns());
  pb::Request unknown;
  unknown.mutable_get_today()->set_list("all");
  EXPECT_EQ(refusal(instructor, unknown), ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab
