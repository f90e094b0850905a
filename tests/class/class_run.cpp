#include "tests/class/class_run.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <thread>

#include "client/station/run/loop/signals.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kLineEvery = 36;  // attempts, where no terminal shows each

/// A quoted cell: commas and quotes in it do not separate cells.
std::string cellOf(const std::string& text) {
  std::string cell = "\"";
  for (const char c : text) cell += c == '"' ? std::string("\"\"") : std::string(1, c == '\n' ? ' ' : c);
  return cell + "\"";
}

template <typename Number>
Status within(const char* option, Number value, Number low, Number high, bool low_allowed = true) {
  if (value <= high && (low_allowed ? value >= low : value > low)) return {};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("{}: {}, allowed is {}{} to {}", option, std::to_string(value),
                           low_allowed ? "" : "above ", std::to_string(low), std::to_string(high))};
}

}  // namespace

Status checkClass(const ClassOptions& options) {
  const TimetableOptions& t = options.timetable;
  RETURN_IF_ERROR(within<std::size_t>("--attempts", t.attempts, 1, 50));
  RETURN_IF_ERROR(within("--weeks", t.weeks, 0.0, 520.0, false));
  RETURN_IF_ERROR(within("--practice", t.practice, 0.0, 0.5));
  if (options.keys.size() > 32)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("--key: {} stations, at most 32 run in one program", options.keys.size())};
  return {};
}

Result<std::vector<ClassSession>> runClass(const ClassOptions& options,
                                           const std::vector<ClassTrainee>& trainees,
                                           const sigset_t& stop_signals) {
  const auto server = parseEndpoint(options.server);
  if (!server.ok()) return Error{server.error().code, "--server " + server.error().message};
  TimetableOptions timetable = options.timetable;
  timetable.exercises = options.exercises.size();
  const auto plan = planClass(trainees, timetable, wallNowNs());

  std::atomic<std::size_t> done{0};
  std::atomic<bool> stop{false};
  const std::size_t n = options.keys.size();
  std::vector<std::unique_ptr<ClassStation>> stations;
  std::vector<std::vector<ClassSession>> work(n);
  std::vector<Status> ends(n);
  for (const PlannedAttempt& attempt : plan)
    work[attempt.trainee % n].push_back({attempt, "", 0, {}, {}, {}, {}});
  for (std::size_t i = 0; i < n; ++i) {
    const ClassPlace place{*server, options.ca, options.keys[i],
                           std::filesystem::path(options.spool) / fmt::format("station-{}", i + 1)};
    stations.push_back(
        std::make_unique<ClassStation>(place, trainees, options.exercises, [&done] { ++done; }));
    RETURN_IF_ERROR(stations.back()->connect());
  }

  std::atomic<std::size_t> working{n};
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < n; ++i) {
    threads.emplace_back([&, i] {
      ends[i] = stations[i]->practise(work[i], [&stop] { return stop.load(); });
      // a failing station ends the others: otherwise the class would have unplanned gaps
      if (!ends[i].ok()) stop = true;
      --working;
    });
  }
  const bool shows = ::isatty(STDERR_FILENO) == 1;
  std::size_t told = 0;
  while (working > 0) {
    if (signalWithin(stop_signals, 100ms) != 0) stop = true;
    const std::size_t now = done;
    if (shows ? now != told : now >= told + kLineEvery) {
      std::fprintf(stderr, shows ? "\r%zu of %zu attempts" : "%zu of %zu attempts\n", now, plan.size());
      told = now;
    }
  }
  if (shows) std::fprintf(stderr, "\r%zu of %zu attempts\n", done.load(), plan.size());
  for (std::thread& thread : threads) thread.join();
  // reports the error of the station that failed first, not of those stopped because of it
  const Status* fault = nullptr;
  for (const Status& end : ends) {
    if (end.ok()) continue;
    if (fault == nullptr || fault->error().message == "stopped") fault = &end;
  }
  if (fault != nullptr) return fault->error();

  std::vector<ClassSession> sessions;
  for (auto& some : work)
    sessions.insert(sessions.end(), std::make_move_iterator(some.begin()),
                    std::make_move_iterator(some.end()));
  std::stable_sort(sessions.begin(), sessions.end(), [](const ClassSession& a, const ClassSession& b) {
    return a.plan.trainee < b.plan.trainee;
  });
  return sessions;
}

std::string classTable(const std::vector<ClassSession>& sessions, const std::vector<ClassTrainee>& trainees,
                       const std::vector<std::string>& exercises) {
  std::string text = "session,trainee,exercise,attempt,skill,started_unix_s,samples,closed,passed,trouble\n";
  for (const ClassSession& s : sessions) {
    char numbers[96];
    std::snprintf(numbers, sizeof numbers, "%zu,%.4f,%lld,%llu,%d,%s,", s.plan.number + 1, s.plan.skill,
                  static_cast<long long>(s.plan.started_unix_ns / 1'000'000'000),
                  static_cast<unsigned long long>(s.samples), s.closed ? 1 : 0,
                  s.passed ? (*s.passed ? "1" : "0") : "");
    text += s.session_id + "," + trainees[s.plan.trainee].name + "," + exercises[s.plan.exercise] + "," +
            numbers + (s.trouble.empty() ? "" : cellOf(s.trouble)) + "\n";
  }
  return text;
}

std::string classText(const std::vector<ClassSession>& sessions, const std::vector<ClassTrainee>& trainees,
                      const std::vector<std::string>& exercises) {
  std::vector<double> skills;
  for (const ClassTrainee& trainee : trainees) skills.push_back(trainee.skill);
  std::sort(skills.begin(), skills.end());
  const double middle = skills[skills.size() / 2];
  std::string text = "EXERCISE                    passed/attempts: less skilled  more skilled  not begun\n";
  for (std::size_t e = 0; e < exercises.size(); ++e) {
    std::size_t made[2] = {0, 0}, passed[2] = {0, 0}, locked = 0;
    for (const ClassSession& s : sessions) {
      if (s.plan.exercise != e) continue;
      const int half = trainees[s.plan.trainee].skill >= middle ? 1 : 0;
      if (s.locked) ++locked;
      if (s.session_id.empty()) continue;
      ++made[half];
      passed[half] += s.passed.value_or(false) ? 1 : 0;
    }
    char line[160];
    std::snprintf(line, sizeof line, "%-27s %22zu/%-6zu %8zu/%-6zu %8zu\n", exercises[e].c_str(), passed[0],
                  made[0], passed[1], made[1], locked);
    text += line;
  }
  return text;
}

}  // namespace needlelab
