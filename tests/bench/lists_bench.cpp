/// What the web console's lists cost as sessions come: every GET route's median and 95th percentile, from the
/// request to the text of its reply, at 219, 20,000 and 120,000 sessions of 3,000 people (goal: 300 ms), and
/// what an erasure costs among the most sessions. A folder that is given keeps its database, in which `ada`
/// logs in: for tests/web/console/large.mjs, which needs no measurements (--rounds 0).
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "db/login/credentials.h"
#include "db/people/people.h"
#include "db/service/start/bootstrap.h"
#include "db/sessions/session_results.h"
#include "db/sessions/session_store.h"
#include "server/live/monitor/monitor.h"
#include "server/web/routes.h"
#include "tests/bench/result_folder.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

constexpr int kPeople = 3000, kGroups = 30, kExercises = 8, kSessionsAtOnce = 500;
constexpr double kGoal_ms = 300;
constexpr std::int64_t kMinute_ns = 60'000'000'000;
/// One session a minute until now: GET /today reads what was tried within weeks.
const std::int64_t kBegin_ns = wallNowNs() - 120'000 * kMinute_ns;

struct ListsSettings {
  std::filesystem::path folder;   ///< empty: a temporary one
  std::string store_url;          ///< empty: SQLite, in the folder
  int rounds = 20;                ///< 0: the largest database is built, nothing is measured
  std::filesystem::path results;  ///< empty: only printed
  std::string commit;
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
      ASSIGN_OR_RETURN(const auto hash, hashPassword("correct horse battery"));
      RETURN_IF_ERROR(PeopleStore(c).add({"ada", pb::ADMINISTRATOR, hash, false, 1}));
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
  const Principal admin_{"@1", pb::ADMINISTRATOR};  // ada
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
      ASSIGN_OR_RETURN(auto stream, route.how.stream(service, route, call));
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

struct Measured {
  std::size_t bytes = 0;
  double median_ms = 0, p95_ms = 0;
};
/// A size's figures by route.
using Table = std::map<std::string, Measured>;

void say(const std::string& text) {
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

void measureRoute(Service& service, const WebRoute& route, const WebCall& call, const std::string& name,
                  int rounds, Table& table) {
  std::vector<double> ms;
  Measured measured;
  double all_ms = 0;
  for (int round = 0; round < rounds && all_ms < 5000; ++round) {
    const auto from = std::chrono::steady_clock::now();
    const auto text = textOfReply(service, route, call);
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - from).count());
    all_ms += ms.back();
    if (!text) endBench(name + ": " + text.error().message);
    measured.bytes = text->size();
  }
  measured.median_ms = quantileOf(ms, 0.5);
  measured.p95_ms = quantileOf(ms, 0.95);
  say(fmt::format("| {:<48} | {:>9} | {:>9.2f} | {:>9.2f} |{}", name, measured.bytes, measured.median_ms,
                  measured.p95_ms, measured.p95_ms > kGoal_ms ? " missed" : ""));
  table[name] = measured;
}

/// Every GET route, without a query and with those that matter. Not the section through a body: these
/// sessions have none, and its cost does not depend on their number.
Table measureAll(Store& store, const Faculty& faculty, int rounds) {
  using Query = std::map<std::string, std::string>;
  const std::map<std::string_view, std::vector<Query>> queries = {
      {"/results",
       {{{"course", "everybody"}},
        {{"course", "everybody"}, {"limit", "250"}},
        {{"course", "everybody"}, {"group", "class-07"}}}},
      {"/people", {{}, {{"limit", "500"}}, {{"search", "number 2"}}, {{"role", "trainee"}}}},
      {"/people/{name}/progress",
       {{}, {{"exercise", exerciseAt(3)}}, {{"exercise", exerciseAt(3)}, {"newest_first", "yes"}}}},
      {"/groups", {{}, {{"brief", "yes"}}, {{"search", "class-1"}, {"brief", "yes"}}}},
      {"/sessions",
       {{},
        {{"trainee", personAt(17)}},
        {{"search", "number 17"}},
        {{"exercise", exerciseAt(3)}},
        {{"verdict", "passed"}},
        {{"limit", "1000"}}}},
      {"/assignments", {{}, {{"trainee", personAt(17)}}}},
      {"/today", {{}, {{"list", "behind"}, {"limit", "100"}}, {{"list", "struggling"}}}},
      {"/scores.csv", {{{"course", "everybody"}}, {{"course", "everybody"}, {"group", "class-07"}}}},
  };
  Table table;
  for (const WebRoute& route : webRoutes()) {
    const WebAction action = route.how.action;
    if (route.method != "GET" || route.call == pb::Request::CALL_NOT_SET || action == WebAction::kLive ||
        route.pattern == "/sessions/{id}/section")
      continue;
    const auto found = queries.find(route.pattern);
    for (const Query& query : found == queries.end() ? std::vector<Query>{{}} : found->second) {
      WebCall call;
      call.who = {"@1", pb::ADMINISTRATOR};
      call.target.query = query;
      call.parts = partsOf(route, faculty.someSession());
      std::string name(route.pattern);
      for (const auto& [key, value] : query)
        name += (name.find('?') == std::string::npos ? "?" : "&") + key + "=" + value;
      measureRoute(store.service(), route, call, name, rounds, table);
      // the guest's attempts are one in twenty of all
      if (route.pattern != "/people/{name}/progress" && route.pattern != "/people/{name}/exercises") continue;
      call.parts = {"guest"};
      measureRoute(store.service(), route, call, name + " of guest", rounds, table);
    }
  }
  return table;
}

/// How long it takes until a trainee with 1/3000 of the sessions is erased, for some of them.
std::string measureErasures(Faculty& faculty, int rounds) {
  std::vector<double> ms;
  for (int i = 0; i < rounds; ++i) {
    pb::Request erase;
    erase.mutable_erase_person()->set_name(personAt(100 + i));
    erase.mutable_erase_person()->set_confirm(personAt(100 + i));
    const auto from = std::chrono::steady_clock::now();
    const auto reply = faculty.ask(erase);
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - from).count());
    if (reply.erasure().pending()) endBench("an erasure is pending");
  }
  return fmt::format("{} people erased, one after the other: median {:.0f} ms, 95 % {:.0f} ms", rounds,
                     quantileOf(ms, 0.5), quantileOf(ms, 0.95));
}

std::string loadText() {
  std::ifstream in("/proc/loadavg");
  std::string one, five;
  in >> one >> five;
  return one + " and " + five;
}

constexpr int kSizes[] = {219, 20'000, 120'000};

/// A row for each route, its columns by size.
std::string tableText(const std::vector<Table>& tables) {
  std::string text = "| route | bytes |";
  for (const int size : kSizes) text += fmt::format(" median, p95 ms at {} |", size);
  text += "\n|---|---:|---:|---:|---:|\n";
  for (const auto& [name, last] : tables.back()) {
    text += fmt::format("| `{}` | {} |", name, last.bytes);
    for (const Table& table : tables) {
      const Measured& one = table.at(name);
      text += fmt::format(" {:.1f}, {}{:.1f}{} |", one.median_ms, one.p95_ms > kGoal_ms ? "**" : "",
                          one.p95_ms, one.p95_ms > kGoal_ms ? "**" : "");
    }
    text += "\n";
  }
  return text;
}

int runLists(const ListsSettings& settings) {
  const TempFolder temporary;
  Store::Options options;
  options.store_url = settings.store_url;
  const std::string engine = settings.store_url.empty() ? "SQLite" : "PostgreSQL";
  const auto store = mustHave(
      Store::open((settings.folder.empty() ? temporary.path() : settings.folder) / "lists", options));
  Faculty faculty(*store);
  faculty.addPeople();
  if (settings.rounds == 0) {
    faculty.growTo(kSizes[2]);
    say(fmt::format("built: {} sessions, {} people, on {}", kSizes[2], kPeople, engine));
    return 0;
  }
  std::vector<Table> tables;
  std::string loads, memory;
  for (const int sessions : kSizes) {
    faculty.growTo(sessions);
    say(fmt::format("\n{} sessions, {} people, on {}, load {}\n| {:<48} | {:>9} | {:>9} | {:>9} |", sessions,
                    kPeople, engine, loadText(), "route", "bytes", "median ms", "p95 ms"));
    loads += fmt::format("{}{}", loads.empty() ? "" : "; ", loadText());
    tables.push_back(measureAll(*store, faculty, settings.rounds));
    memory = fmt::format("{:.0f} MiB", static_cast<double>(processFacts().rss_bytes) / (1u << 20));
    say("resident memory of this process: " + memory);
  }
  const std::string erased = measureErasures(faculty, settings.rounds);
  say(erased);
  std::size_t missed = 0;
  for (const auto& [name, one] : tables.back()) missed += one.p95_ms > kGoal_ms ? 1 : 0;
  say(fmt::format("\n{} beyond {:.0f} ms at the largest size", missed, kGoal_ms));
  if (!settings.results.empty()) {
    const std::string text = fmt::format(
        "# What the console's lists cost on {0}\n\n{1}; {2}{3}; load (1 and 5 min) at the beginning of each "
        "size: {4}.\n\nWritten by `cmake --build build/release --target record_lists_bench`: GET routes, "
        "first "
        "page or piece, from the request to the reply's text, at most {5} rounds or 5 s each, by an "
        "administrator; {6} people in {7} groups with one course, sessions with scores and without samples, "
        "one "
        "in twenty of guest. Bold: beyond the goal of {8:.0f} ms (p95). Bytes, and the resident memory of "
        "this "
        "process (writer, readers and requests of the server, no connections), {9}, are those at {10} "
        "sessions. {11}.\n\n{12}",
        engine, machineText(), nowText(), settings.commit.empty() ? "" : "; commit " + settings.commit, loads,
        settings.rounds, kPeople, kGroups, kGoal_ms, memory, kSizes[2], erased, tableText(tables));
    const auto folder = settings.results / folderName(machineText());
    std::error_code ignored;
    std::filesystem::create_directories(folder, ignored);
    const auto file = folder / (settings.store_url.empty() ? "lists_sqlite.md" : "lists_postgres.md");
    mustDo(writeFileAtomically(file, viewOf(text)));
    say("written: " + file.string());
  }
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
      settings.rounds = std::max(0, std::atoi(value.c_str()));
    else if (name == "--results")
      settings.results = value;
    else if (name == "--commit")
      settings.commit = value;
    else
      return std::fprintf(stderr, "lists_bench: unknown option %s\n", name.c_str()), 2;
  }
  return needlelab::test::runLists(settings);
}
