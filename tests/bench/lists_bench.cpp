/// What the web console's lists cost as sessions come: every GET route's median and 95th percentile, from the
/// request to the text of its reply, at 219, 20,000 and 120,000 sessions of 3,000 people. Goal: 300 ms.
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/base/uuid.h"
#include "db/assignments.h"
#include "db/credentials.h"
#include "db/people.h"
#include "db/service/bootstrap.h"
#include "db/session_results.h"
#include "db/session_store.h"
#include "server/live/monitor.h"
#include "server/web/routes.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

constexpr int kPeople = 3000, kGroups = 30, kExercises = 8, kSessionsAtOnce = 500;
constexpr double kGoal_ms = 300;
constexpr std::int64_t kBegin_ns = 1'700'000'000'000'000'000, kMinute_ns = 60'000'000'000;

struct ListsSettings {
  std::filesystem::path folder;  ///< empty: a temporary one
  std::string store_url;         ///< empty: SQLite, in the folder
  int rounds = 20;
};

[[noreturn]] void endBench(const std::string& text) {
  std::fprintf(stderr, "lists_bench: %s\n", text.c_str());
  std::_Exit(1);
}
void mustDo(const Status& status) {
  if (!status.ok()) endBench(status.error().message);
}
template <typename T>
T mustHave(Result<T> result) {
  if (!result.ok()) endBench(result.error().message);
  return std::move(*result);
}

std::string personAt(int i) {
  return fmt::format("trainee{:04}", i);
}
std::string exerciseAt(int i) {
  return fmt::format("exercise-{}", i);
}

/// A faculty's database, which grows between two measurements.
class Faculty {
 public:
  explicit Faculty(Store& store) : store_(store) {}

  /// People in classes, a course that all of them have.
  void addPeople() {
    change([](Connection& c) -> Status {
      RETURN_IF_ERROR(StationStore(c).add("station-1", StationKeyBytes{}, 1));
      RETURN_IF_ERROR(PeopleStore(c).add({"ada", pb::ADMINISTRATOR, "$hash", false, 1}));
      for (int i = 0; i < kPeople; ++i)
        RETURN_IF_ERROR(PeopleStore(c).add(
            {personAt(i), pb::TRAINEE, "", false, kBegin_ns, fmt::format("Person Number {}", i)}));
      return {};
    });
    pb::Request request;
    nlohmann::json course{
        {"id", "everybody"}, {"name", "What all take"}, {"exercises", nlohmann::json::array()}};
    for (int i = 0; i < kExercises; ++i) {
      nlohmann::json exercise{{"id", exerciseAt(i)},
                              {"name", "Exercise " + std::to_string(i)},
                              {"profile_id", "knee-adult"},
                              {"attempts", 200},
                              {"requirements", {{{"measure", "peak_force_n"}, {"max", 5}}}}};
      if (i > 0) exercise["prerequisites"] = {exerciseAt(i - 1)};
      course["exercises"].push_back(exercise);
    }
    request.mutable_import_curriculum()->set_json(course.dump());
    ask(request);
    for (int group = 0; group < kGroups; ++group) {
      pb::Request put;
      put.mutable_put_group()->mutable_group()->set_id(fmt::format("class-{:02}", group));
      put.mutable_put_group()->mutable_group()->set_name("A class");
      for (int i = group; i < kPeople; i += kGroups)
        put.mutable_put_group()->mutable_group()->add_members(personAt(i));
      ask(put);
      pb::Request assign;
      assign.mutable_assign()->set_course_id("everybody");
      assign.mutable_assign()->set_group_id(fmt::format("class-{:02}", group));
      assign.mutable_assign()->set_due_unix_ns(kBegin_ns + 100'000 * kMinute_ns);
      ask(assign);
    }
  }

  /// Closed sessions with scores, one in twenty of guest, until there are so many.
  void growTo(int sessions) {
    pb::Request get;
    get.mutable_get_profile()->set_id("knee-adult");
    const std::string profile = ask(get).profile().json();
    while (sessions_ < sessions) {
      const int end = std::min(sessions, sessions_ + kSessionsAtOnce);
      change([&](Connection& c) -> Status {
        for (; sessions_ < end; ++sessions_) RETURN_IF_ERROR(addSession(c, profile));
        return {};
      });
    }
    // as PostgreSQL's own statistician does after a while
    change([](Connection& c) { return c.sqlite() != nullptr ? Status() : c.script("ANALYZE"); });
  }

  pb::Reply ask(const pb::Request& request) {
    Outcome outcome = store_.service().execute(admin_, request);
    if (outcome.error) endBench(outcome.error->message);
    return std::move(outcome.reply);
  }
  [[nodiscard]] const std::string& someSession() const { return some_session_; }

 private:
  void change(const DbWriter::Work& work) { mustDo(store_.writer().run(work)); }

  Status addSession(Connection& c, const std::string& profile) {
    const int i = sessions_;
    const Uuid id = makeUuidV7();
    pb::SessionDescription d;
    d.set_session_id(std::string(id.begin(), id.end()));
    d.set_station("station-1");
    d.set_trainee(i % 20 == 0 ? "guest" : personAt(static_cast<int>(random_() % kPeople)));
    d.set_exercise_id(exerciseAt(static_cast<int>(random_() % kExercises)));
    d.set_profile_id("knee-adult");
    d.set_profile_revision(1);
    d.set_profile_json(profile);
    d.set_engine_version("bench");
    d.set_rate_hz(1000);
    d.set_started_unix_ns(kBegin_ns + i * kMinute_ns);
    d.mutable_resolution()->set_length_m(1e-6);
    RETURN_IF_ERROR(SessionStore(c).open(d, kBegin_ns));
    pb::CloseSession close;
    close.set_session_id(d.session_id());
    const Digest nothing = SessionHash().digest();
    close.set_hash(nothing.data(), nothing.size());
    RETURN_IF_ERROR(SessionStore(c).close(close, kBegin_ns));
    some_session_ = uuidText(id);
    nlohmann::json measures = nlohmann::json::array();
    bool passed = true;
    for (int m = 0; m < 24; ++m) {
      const bool met = random_() % 8 != 0;
      nlohmann::json row{{"measure", m == 0 ? "peak_force_n" : fmt::format("measure_{}", m)},
                         {"value", static_cast<double>(random_() % 1000) / 37},
                         {"unit", "N"},
                         {"words", "what a person reads of this measure on the screens"}};
      if (m < 3) row["passed"] = met;
      if (m < 3) passed = passed && met;
      measures.push_back(std::move(row));
    }
    pb::Score score;
    score.set_session_id(d.session_id());
    score.set_definition_version(1);
    score.set_measures_json(measures.dump());
    score.set_passed(passed);
    score.set_engine_version("bench");
    score.set_made_unix_ns(kBegin_ns);
    return ScoreStore(c).put(score);
  }

  Store& store_;
  const Principal admin_{"ada", pb::ADMINISTRATOR};
  std::mt19937_64 random_{7};
  int sessions_ = 0;
  std::string some_session_;
};

/// What the address's {…} are.
std::vector<std::string> partsOf(const WebRoute& route, const std::string& session) {
  const std::pair<std::string_view, std::string> kNames[] = {
      {"/people/", personAt(17)}, {"/groups/", "class-07"},       {"/profiles/", "knee-adult"},
      {"/courses/", "everybody"}, {"/exercises/", exerciseAt(3)}, {"/sessions/", session},
      {"/studies/", "a-study"},
  };
  if (route.pattern.find('{') == std::string_view::npos) return {};
  for (const auto& [begin, value] : kNames)
    if (route.pattern.starts_with(begin)) return {value};
  endBench("no value for " + std::string(route.pattern));
}

/// The text of the reply's beginning: of a stream its first piece.
Result<std::string> textOfReply(Service& service, const WebRoute& route, const WebCall& given) {
  WebCall call = given;
  switch (route.how.action) {
    case WebAction::kRequest: {
      ASSIGN_OR_RETURN(auto request, route.how.build(route, call));
      call.request = std::make_shared<const pb::Request>(std::move(request));
      ASSIGN_OR_RETURN(const auto reply, replyOf(service, call, *call.request));
      return route.how.shape(call, reply).dump();
    }
    case WebAction::kWork: {
      ASSIGN_OR_RETURN(const auto json, route.how.work(service, call));
      return json.dump();
    }
    case WebAction::kSteps: {
      ASSIGN_OR_RETURN(auto steps, route.how.steps(service, call));
      for (;;) {
        ASSIGN_OR_RETURN(const auto json, steps.step());
        if (json) return json->dump();
      }
    }
    case WebAction::kStream: {
      ASSIGN_OR_RETURN(auto stream, route.how.stream(service, call));
      for (;;) {
        ASSIGN_OR_RETURN(auto piece, stream.next());
        if (piece) return *std::move(piece);
      }
    }
    default:
      return std::string();
  }
}

double quantileOf(std::vector<double> sorted, double q) {
  std::sort(sorted.begin(), sorted.end());
  const double at = q * static_cast<double>(sorted.size() - 1);
  return sorted[static_cast<std::size_t>(at + 0.5)];
}

/// Prints a route's line; false: the goal is missed.
bool measureRoute(Service& service, const WebRoute& route, const WebCall& call, const std::string& name,
                  int rounds) {
  std::vector<double> ms;
  std::size_t bytes = 0;
  double all_ms = 0;
  for (int round = 0; round < rounds && all_ms < 5000; ++round) {
    const auto from = std::chrono::steady_clock::now();
    const auto text = textOfReply(service, route, call);
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - from).count());
    all_ms += ms.back();
    if (!text) {
      std::printf("| %-48s | %s |\n", name.c_str(), text.error().message.c_str());
      return true;
    }
    bytes = text->size();
  }
  const double p95 = quantileOf(ms, 0.95);
  std::printf("| %-48s | %9zu | %9.2f | %9.2f |%s\n", name.c_str(), bytes, quantileOf(ms, 0.5), p95,
              p95 > kGoal_ms ? " missed" : "");
  std::fflush(stdout);
  return p95 <= kGoal_ms;
}

/// Every GET route, without a query and with those that matter. Returns how many missed the goal.
int measureAll(Store& store, const Faculty& faculty, int rounds) {
  using Query = std::map<std::string, std::string>;
  const std::map<std::string_view, std::vector<Query>> queries = {
      {"/results",
       {{{"course", "everybody"}},
        {{"course", "everybody"}, {"limit", "250"}},
        {{"course", "everybody"}, {"group", "class-07"}}}},
      {"/people", {{}, {{"limit", "500"}}, {{"search", "number 2"}}, {{"role", "trainee"}}}},
      {"/people/{name}/progress", {{}, {{"exercise", exerciseAt(3)}}}},
      {"/sessions",
       {{},
        {{"trainee", personAt(17)}},
        {{"search", "number 17"}},
        {{"exercise", exerciseAt(3)}},
        {{"verdict", "passed"}},
        {{"limit", "1000"}}}},
      {"/assignments", {{}, {{"trainee", personAt(17)}}}},
      {"/scores.csv", {{{"course", "everybody"}}, {{"course", "everybody"}, {"group", "class-07"}}}},
  };
  int missed = 0;
  for (const WebRoute& route : webRoutes()) {
    const WebAction action = route.how.action;
    if (route.method != "GET" || route.call == pb::Request::CALL_NOT_SET || action == WebAction::kLive)
      continue;
    const auto found = queries.find(route.pattern);
    for (const Query& query : found == queries.end() ? std::vector<Query>{{}} : found->second) {
      WebCall call;
      call.who = {"ada", pb::ADMINISTRATOR};
      call.target.query = query;
      call.parts = partsOf(route, faculty.someSession());
      std::string name(route.pattern);
      for (const auto& [key, value] : query)
        name += (name.find('?') == std::string::npos ? "?" : "&") + key + "=" + value;
      missed += measureRoute(store.service(), route, call, name, rounds) ? 0 : 1;
      // the guest's attempts are one in twenty of all
      if (route.pattern != "/people/{name}/progress") continue;
      call.parts = {"guest"};
      missed += measureRoute(store.service(), route, call, name + " of guest", rounds) ? 0 : 1;
    }
  }
  return missed;
}

int runLists(const ListsSettings& settings) {
  const TempFolder temporary;
  Store::Options options;
  options.store_url = settings.store_url;
  const auto store = mustHave(
      Store::open((settings.folder.empty() ? temporary.path() : settings.folder) / "lists", options));
  Faculty faculty(*store);
  faculty.addPeople();
  int missed = 0;
  for (const int sessions : {219, 20'000, 120'000}) {
    faculty.growTo(sessions);
    std::printf("\n%d sessions, %d people, on %s\n| %-48s | %9s | %9s | %9s |\n", sessions, kPeople,
                settings.store_url.empty() ? "SQLite" : "PostgreSQL", "route", "bytes", "median ms",
                "p95 ms");
    missed += measureAll(*store, faculty, settings.rounds);
    std::printf("resident memory of this process: %.0f MiB\n",
                static_cast<double>(processFacts().rss_bytes) / (1u << 20));
  }
  std::printf("\n%d beyond %.0f ms\n", missed, kGoal_ms);
  return missed == 0 ? 0 : 1;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::test::ListsSettings settings;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--folder")
      settings.folder = value;
    else if (name == "--store")
      settings.store_url = value;
    else if (name == "--rounds")
      settings.rounds = std::max(1, std::atoi(value.c_str()));
    else
      return std::fprintf(stderr, "lists_bench: unknown option %s\n", name.c_str()), 2;
  }
  return needlelab::test::runLists(settings);
}
