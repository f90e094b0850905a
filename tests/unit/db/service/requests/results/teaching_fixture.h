/// A course of three exercises, attempts with verdicts, classes.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "db/sessions/session_results.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab::test {

class TeachingTest : public ServiceTest {
 protected:
  /// Returns a course of three exercises on the knee. `with` is merged into each exercise by its id.
  void putCourse(const nlohmann::json& with = nlohmann::json::object()) {
    nlohmann::json course{{"id", "course"}, {"name", "A course"}, {"exercises", nlohmann::json::array()}};
    for (const char* id : {"first", "second", "third"}) {
      nlohmann::json exercise{{"id", id}, {"name", std::string("The ") + id}, {"profile_id", "knee-adult"}};
      exercise["requirements"] = {{{"measure", "peak_force_n"}, {"max", 5}}};
      if (with.contains(id)) exercise.update(with[id]);
      course["exercises"].push_back(exercise);
    }
    pb::Request request;
    request.mutable_import_curriculum()->set_json(course.dump());
    get(manager, request);
  }
  std::optional<Error> lesson(const std::string& exercise, const std::string& who = "anna") {
    pb::Request request;
    request.mutable_get_lesson()->set_exercise_id(exercise);
    request.mutable_get_lesson()->set_trainee(who);
    makeKnown(who);
    return ask(station, request).error;
  }
  /// Adds the person unless already there.
  void makeKnown(const std::string& who) {
    EXPECT_OK(change([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(const auto person, PeopleStore(c).find(who));
      return person || who.empty() ? Status() : PeopleStore(c).add({who, pb::TRAINEE, "", false, 1});
    }));
  }
  /// Adds an attempt with a verdict.
  Uuid attempt(const std::string& who, const std::string& exercise, bool passed, std::int64_t started = 0) {
    return attemptWith(who, exercise, passed, passed ? "3" : "8", started);
  }
  /// `peak_force_N` as JSON writes it; at most 5 is required. `more_rows` of the score begin with a comma.
  Uuid attemptWith(const std::string& who, const std::string& exercise, bool passed,
                   const std::string& peak_force_N, std::int64_t started = 0,
                   const std::string& more_rows = "") {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee(who);
      d.set_exercise_id(exercise);
      d.set_started_unix_ns(started != 0 ? started : ++clock_);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      if (auto closed = SessionStore(c).close(test::closeOf(id, 0), 2); !closed) return closed.error();
      auto score = test::scoreOf(id, R"([{"measure":"peak_force_n","value":)" + peak_force_N +
                                         R"(,"unit":"N","max":5,"passed":)" + (passed ? "true" : "false") +
                                         R"(,"words":""})" + more_rows + "]");
      score.set_passed(passed);
      return ScoreStore(c).put(score);
    }));
    return id;
  }
  pb::Results results(const Principal& who, const std::string& group = "") {
    pb::Request request;
    request.mutable_get_results()->set_course_id("course");
    request.mutable_get_results()->set_group_id(group);
    return get(who, request).results();
  }
  pb::Request putGroup(const std::string& id, const std::vector<std::string>& members, std::uint32_t base) {
    pb::Request request;
    auto* put = request.mutable_put_group();
    put->mutable_group()->set_id(id);
    put->mutable_group()->set_name(id);
    for (const auto& name : members) put->mutable_group()->add_members(name);
    put->set_base_revision(base);
    return request;
  }
  pb::PeopleImport importPeople(const std::string& csv, bool dry_run = false,
                                const Principal* who = nullptr) {
    pb::Request request;
    request.mutable_import_people()->set_csv(csv);
    request.mutable_import_people()->set_dry_run(dry_run);
    return get(who != nullptr ? *who : manager, request).people_import();
  }
  std::int64_t count(const std::string& sql) {
    std::int64_t found = -1;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.prepare(sql);
      if (*row.step()) found = row.integer(0);
      return {};
    }));
    return found;
  }
  const Principal researcher{"rea", pb::RESEARCHER};
  std::int64_t clock_ = 1'700'000'000'000'000'000;
};

}  // namespace needlelab::test
