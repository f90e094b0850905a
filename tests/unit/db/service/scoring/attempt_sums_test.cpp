// Sums of attempts follow every change of sessions, and pages of results equal a full count.
#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "db/service/scoring/session_score.h"
#include "db/teaching/attempt_sums.h"
#include "db/teaching/attempts.h"
#include "tests/support/run_form.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

using Pair = std::pair<std::string, std::string>;  // exercise, trainee
using Sums = std::array<std::int64_t, 5>;          // sessions, attempts, counted, judged, passed

/// A session's row, for the manual count.
struct CountedRow {
  std::int64_t number = 0, started = 0;
  std::string id, trainee, exercise, score;
  bool passed = false, has_verdict = false, excused = false, erased = false, open = false, counts = false;
};

class AttemptSumsTest : public test::TeachingTest {
 protected:
  void SetUp() override {
    addStation();
    putCourse({{"second", {{"prerequisites", {"first"}}, {"attempts", 3}}}});
    ASSERT_OK(change([](Connection& c) {
      return PeopleStore(c).add({"ada", pb::ADMINISTRATOR, "$hash", false, 1});
    }));
  }

  /// A session under this name, closed with a score or without.
  Uuid session(const std::string& who, const std::string& exercise, std::int64_t started, bool closed,
               const std::optional<pb::Score>& score, bool code_checked = true) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee(who);
      d.set_exercise_id(exercise);
      d.set_started_unix_ns(started);
      d.set_code_checked(code_checked);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      if (!closed) return {};
      if (auto done = SessionStore(c).close(test::closeOf(id, 0), 2); !done) return done.error();
      if (!score) return {};
      pb::Score own = *score;
      own.set_session_id(test::bytesOfId(id));
      // a session that arrives after its person was erased is empty
      const Status scored = ScoreStore(c).put(own);
      return scored.ok() || scored.error().code == ErrorCode::kUnavailable ? Status() : scored;
    }));
    return id;
  }
  /// A score that meets `met` of `required`; 0 required: no verdict.
  static pb::Score scoreMeeting(int met, int required, std::uint32_t version = 1) {
    nlohmann::json rows = nlohmann::json::array();
    for (int i = 0; i < required; ++i)
      rows.push_back({{"measure", "m" + std::to_string(i)},
                      {"value", 1},
                      {"passed", i < met},
                      {"words", "says \"passed\":true"}});
    pb::Score score = test::scoreOf(Uuid{}, rows.dump(), version);
    if (required > 0) score.set_passed(met == required);
    return score;
  }

  std::vector<CountedRow> rows() {
    std::map<std::int64_t, bool> waiting;  // by session: whether its code was missing
    std::vector<CountedRow> all;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto wait = c.prepare("SELECT session, code_unchecked FROM unknown_trainees WHERE by_whom IS NULL");
      while (*wait.step()) waiting[wait.integer(0)] = wait.integer(1) != 0;
      auto row = c.prepare(
          "SELECT number, started_unix_ns, id, trainee, exercise_id, score_json, passed, excused, erased, "
          "state"
          " FROM sessions ORDER BY started_unix_ns, number");
      while (*row.step())
        all.push_back({row.integer(0), row.integer(1), row.text(2), row.text(3), row.text(4), row.text(5),
                       row.integer(6) != 0, !row.isNull(6), row.integer(7) != 0, row.integer(8) != 0,
                       row.integer(9) == pb::SESSION_OPEN, false});
      return {};
    }));
    for (CountedRow& row : all) {
      const auto wait = waiting.find(row.number);
      row.counts = wait == waiting.end() || !wait->second;
    }
    return all;
  }
  static std::map<Pair, Sums> countedByHand(const std::vector<CountedRow>& rows) {
    std::map<Pair, Sums> sums;
    for (const CountedRow& row : rows) {
      if (row.erased || row.trainee.empty()) continue;
      Sums& sum = sums[{row.exercise, row.trainee}];
      const bool counted = row.counts && !row.excused;
      sum[0] += 1;
      sum[1] += row.counts;
      sum[2] += counted;
      sum[3] += counted && row.has_verdict;
      sum[4] += counted && row.passed;
    }
    return sums;
  }
  std::map<Pair, Sums> stored() {
    std::map<Pair, Sums> sums;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.prepare(
          "SELECT exercise_id, trainee, sessions, attempts, counted, judged, passed FROM attempt_sums");
      while (*row.step())
        sums[{row.text(0), row.text(1)}] = {row.integer(2), row.integer(3), row.integer(4), row.integer(5),
                                            row.integer(6)};
      return {};
    }));
    return sums;
  }
  /// The best attempt by the rule: passed, then most requirements met, then newest. "": none.
  static std::string bestByHand(const std::vector<CountedRow>& rows, const Pair& pair) {
    const CountedRow* best = nullptr;
    const auto rank = [](const CountedRow& row) {
      return std::tuple(row.passed, verdictsOf(row.score).met, row.started, row.number);
    };
    for (const CountedRow& row : rows) {
      if (Pair(row.exercise, row.trainee) != pair || !row.counts || row.excused || row.open || row.erased)
        continue;
      if (best == nullptr || rank(row) > rank(*best)) best = &row;
    }
    return best == nullptr ? "" : best->id;
  }
  static std::uint32_t placeByHand(const std::vector<CountedRow>& rows, const std::string& id) {
    std::map<Pair, std::uint32_t> places;
    for (const CountedRow& row : rows) {
      if (!row.counts) continue;
      const std::uint32_t place = ++places[{row.exercise, row.trainee}];
      if (row.id == id) return place;
    }
    return 0;
  }

  /// All pages of `limit` rows, combined.
  pb::Results allPages(std::uint32_t limit, const std::string& group = "") {
    pb::Results all;
    pb::Request request;
    request.mutable_get_results()->set_course_id("course");
    request.mutable_get_results()->set_group_id(group);
    request.mutable_get_results()->set_limit(limit);
    for (int page = 0; page < 100; ++page) {
      const pb::Results one = get(instructor, request).results();
      EXPECT_LE(static_cast<std::uint32_t>(one.rows_size()), limit);
      EXPECT_EQ(one.has_trainees(), page == 0) << "totals come with the first page";
      if (page == 0)
        all = one;
      else
        all.MergeFrom([&] {
          pb::Results rest;
          *rest.mutable_rows() = one.rows();
          return rest;
        }());
      if (one.next_page().empty()) break;
      EXPECT_EQ(static_cast<std::uint32_t>(one.rows_size()), limit);
      request.mutable_get_results()->set_page(one.next_page());
    }
    return all;
  }

  void expectResultsByHand(const std::vector<CountedRow>& rows) {
    const auto sums = countedByHand(rows);
    std::map<std::string, std::string> ref_of;  // by the name shown in lists
    std::set<std::string> names;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.prepare("SELECT ref, name FROM called WHERE ref NOT IN (SELECT ref FROM names_taken)");
      while (*row.step()) ref_of[row.text(1)] = row.text(0);
      return {};
    }));
    ref_of["guest"] = "guest";
    for (const auto& [name, ref] : ref_of)
      for (const char* exercise : {"first", "second", "third"})
        if (sums.contains({exercise, ref})) names.insert(name);
    const pb::Results all = allPages(2);
    ASSERT_EQ(all.exercise_ids_size(), 3);
    ASSERT_EQ(all.trainees_passed_size(), 3);
    EXPECT_EQ(all.trainees(), names.size());
    std::vector<std::string> shown;
    std::array<std::uint32_t, 3> passed{};
    for (const pb::ResultRow& row : all.rows()) {
      shown.push_back(row.trainee());
      ASSERT_EQ(row.cells_size(), 3);
      for (int i = 0; i < 3; ++i) {
        const pb::ResultCell& cell = row.cells(i);
        const Pair pair{cell.exercise_id(), ref_of[row.trainee()]};
        const auto found = sums.find(pair);
        const Sums sum = found == sums.end() ? Sums{} : found->second;
        EXPECT_EQ(cell.attempts(), sum[2]);
        EXPECT_EQ(cell.has_passed(), sum[3] > 0);
        EXPECT_EQ(cell.passed(), sum[4] > 0);
        passed[static_cast<std::size_t>(i)] += sum[4] > 0;
        const std::string best = bestByHand(rows, pair);
        EXPECT_EQ(cell.best().session_id(), best) << pair.first << " of " << pair.second;
        if (!best.empty()) {
          EXPECT_EQ(cell.best().number(), placeByHand(rows, best));
        }
      }
    }
    EXPECT_EQ(shown, std::vector<std::string>(names.begin(), names.end()));
    for (int i = 0; i < 3; ++i) EXPECT_EQ(all.trainees_passed(i), passed[static_cast<std::size_t>(i)]);
  }
  std::vector<SumFault> faults() {
    std::vector<SumFault> found;
    EXPECT_OK(change([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(found, AttemptSums(c).faults(100));
      return {};
    }));
    return found;
  }
};

TEST_F(AttemptSumsTest, areWhatAFullCountGivesAfterAnyChanges) {
  std::mt19937_64 random(test::seedOr(20261124));
  const auto below = [&](std::uint64_t end) { return random() % end; };
  const std::vector<std::string> names = {"anna", "ben", "cid", "dora", "guest"};
  const std::vector<std::string> exercises = {"first", "second", "third", "elsewhere"};
  std::vector<Uuid> ids;
  const auto anyScore = [&](std::uint32_t version) {
    const int required = static_cast<int>(below(4));
    return scoreMeeting(static_cast<int>(below(static_cast<std::uint64_t>(required) + 1)), required, version);
  };
  std::map<std::uint64_t, int> done;
  const int steps = test::longForm() ? 4000 : 400;
  for (int step = 0; step < steps; ++step) {
    const std::string& who = names[below(names.size())];
    const std::uint64_t operation = below(15);
    const Uuid some = ids.empty() ? Uuid{} : ids[below(ids.size())];
    pb::Request request;
    bool changed = true;
    if (operation < 5) {
      const bool closed = below(4) != 0;
      ids.push_back(session(who, exercises[below(exercises.size())],
                            1'700'000'000'000'000'000 + static_cast<std::int64_t>(below(50)), closed,
                            closed && below(4) != 0 ? std::optional(anyScore(1)) : std::nullopt,
                            below(2) == 0));
    } else if (operation < 8) {  // the first score, or a later one
      const pb::Score score = anyScore(1 + static_cast<std::uint32_t>(below(3)));
      changed = change([&](Connection& c) {
                  pb::Score own = score;
                  own.set_session_id(test::bytesOfId(some));
                  return ScoreStore(c).put(own);
                }).ok();
    } else if (operation < 10) {
      request.mutable_excuse_attempt()->set_session_id(test::bytesOfId(some));
      request.mutable_excuse_attempt()->set_excused(below(3) != 0);
      changed = !ask(instructor, request).error;
    } else if (operation < 12) {
      request.mutable_assign_session()->set_session_id(test::bytesOfId(some));
      request.mutable_assign_session()->set_trainee(who);
      changed = !ask(manager, request).error;
    } else if (operation == 12) {
      request.mutable_add_user()->set_name(who);
      request.mutable_add_user()->set_role(pb::TRAINEE);
      changed = !ask(manager, request).error;
    } else if (operation == 13) {
      changed = change([&](Connection& c) { return PeopleStore(c).setCodeHash(who, "$code"); }).ok();
    } else {
      request.mutable_erase_person()->set_name(who);
      request.mutable_erase_person()->set_confirm(who);
      request.mutable_erase_person()->set_with_open_sessions(true);
      request.mutable_erase_person()->set_with_waiting_sessions(below(2) == 0);
      changed = below(3) == 0 && !ask(admin, request).error;
    }
    done[operation] += changed;
    const auto now = rows();
    ASSERT_EQ(stored(), countedByHand(now)) << "step " << step << ", operation " << operation;
    if (step % 20 == 19) {
      expectResultsByHand(now);
      ASSERT_TRUE(faults().empty()) << faults().front().text;
      if (HasFailure()) return;
    }
  }
  for (const std::uint64_t operation : {0u, 5u, 8u, 10u, 12u, 13u})
    EXPECT_GT(done[operation], 0) << operation;
  EXPECT_GT(done[14], 0);
}

TEST_F(AttemptSumsTest, inconsistentSumsAreReportedByACheckAndFixedByRescoring) {
  addPerson("anna", pb::TRAINEE);
  attempt("anna", "first", true);
  attempt("ben", "second", false);
  ASSERT_OK(change([](Connection& c) -> Status {
    RETURN_IF_ERROR(c.run(
        "UPDATE attempt_sums SET passed = 7 WHERE trainee = (SELECT ref FROM called WHERE name = 'anna')"));
    RETURN_IF_ERROR(
        c.run("DELETE FROM attempt_sums WHERE trainee = (SELECT ref FROM called WHERE name = 'ben')"));
    return c.run("INSERT INTO attempt_sums VALUES ('first', 'nobody', 1, 1, 1, 0, 0)");
  }));
  pb::Request check;
  check.mutable_check();
  const auto report = get(admin, check).check_report();
  EXPECT_FALSE(report.ok());
  std::string all;
  for (const std::string& fault : report.faults()) all += fault + "\n";
  for (const char* part : {"'anna' at exercise 'first'", "+6 passed", "'ben' at exercise 'second'",
                           "by -1 sessions", "'nobody' at exercise 'first'", "scores rescore"})
    EXPECT_NE(all.find(part), std::string::npos) << part << " in " << all;

  pb::Request rescore;
  rescore.mutable_rescore_all()->set_dry_run(true);
  get(admin, rescore);
  EXPECT_EQ(faults().size(), 3u) << "a dry run changes nothing";
  rescore.mutable_rescore_all()->set_dry_run(false);
  get(admin, rescore);
  EXPECT_TRUE(faults().empty());
  EXPECT_EQ(stored(), countedByHand(rows()));
  EXPECT_TRUE(get(admin, check).check_report().ok());
  EXPECT_EQ(count("SELECT count(*) FROM audit WHERE action = 'rescore all' AND detail LIKE '%3 sums%'"), 1);
}

TEST_F(AttemptSumsTest, aPageOfResultsFiltersByGroupAndGivesTheTotal) {
  for (const char* name : {"anna", "ben", "cid", "dora", "eve"}) addPerson(name, pb::TRAINEE);
  get(manager, putGroup("class", {"ben", "cid", "eve"}, 0));
  attempt("anna", "first", true);
  attempt("ben", "first", true);
  attempt("cid", "first", false);
  const pb::Results of_group = allPages(1, "class");
  ASSERT_EQ(of_group.rows_size(), 3);
  EXPECT_EQ(of_group.rows(2).trainee(), "eve") << "also who has not begun";
  EXPECT_EQ(of_group.trainees(), 3u);
  EXPECT_EQ(of_group.trainees_passed(0), 1u);
  EXPECT_EQ(allPages(2).trainees(), 3u) << "those who tried";
  pb::Request assign;
  assign.mutable_assign()->set_exercise_id("third");
  assign.mutable_assign()->set_group_id("class");
  get(manager, assign);
  assign.mutable_assign()->set_trainee("dora");
  assign.mutable_assign()->clear_group_id();
  get(manager, assign);
  EXPECT_EQ(allPages(2).trainees(), 5u);
  EXPECT_EQ(allPages(2).rows_size(), 5);
  EXPECT_EQ(allPages(2).trainees_passed(0), 2u);
  // neither a station nor a trainee gets others' totals
  EXPECT_FALSE(results(station).has_trainees());
  EXPECT_FALSE(results(trainee).has_trainees());
  pb::Request of_names;
  of_names.mutable_get_results()->set_course_id("course");
  of_names.mutable_get_results()->set_limit(2);
  ASSERT_OK(change([](Connection& c) { return PeopleStore(c).setDisabled("ben", true); }));
  const pb::Results first = get(station, of_names).results();
  ASSERT_EQ(first.rows_size(), 1) << "without the one whose access has ended";
  of_names.mutable_get_results()->set_page(first.next_page());
  EXPECT_EQ(get(station, of_names).results().rows(0).trainee(), "cid");
}

TEST_F(AttemptSumsTest, aPageOfResultsReadsABoundedAmount) {
  if (test::onPostgres()) return;  // counts SQLite's instructions
  for (const char* name : {"anna", "ben", "cid"}) addPerson(name, pb::TRAINEE);
  const auto stepsOfAPage = [&] {
    int steps = 0;
    EXPECT_OK(change([&](Connection& c) -> Status {
      CourseTrainees trainees(c, "course", "");
      const auto ask = [&]() -> Status {
        RETURN_IF_ERROR(trainees.page({}, 3));
        RETURN_IF_ERROR(trainees.count());
        RETURN_IF_ERROR(trainees.passed());
        for (const char* name : {"anna", "ben", "cid"}) RETURN_IF_ERROR(AttemptStore(c).standings(name));
        return {};
      };
      RETURN_IF_ERROR(ask());
      (void)test::stepsOfStatements(c);
      RETURN_IF_ERROR(ask());
      steps = test::stepsOfStatements(c);
      return {};
    }));
    return steps;
  };
  for (const char* name : {"anna", "ben", "cid"}) attempt(name, "first", true);
  const int few = stepsOfAPage();
  for (int i = 0; i < 60; ++i)
    for (const char* name : {"anna", "ben", "cid"}) attempt(name, "first", i % 2 == 0);
  EXPECT_EQ(stepsOfAPage(), few);
}

}  // namespace
}  // namespace needlelab
