#include "tests/soak/soak_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <limits>
#include <memory>
#include <set>
#include <thread>

#include "client/net/link/blocking_client.h"
#include "client/net/spool/spool.h"
#include "common/base/files/files.h"
#include "common/base/text/uuid.h"
#include "common/gesture/chunk.h"
#include "tests/integration/process.h"
#include "tests/support/patience.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
constexpr const char* kPassword = "an hour is long";

std::chrono::milliseconds milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
}

class Soak {
 public:
  explicit Soak(const SoakOptions& options)
      : options_(options), out_(std::filesystem::absolute(options.out)) {}

  Result<SoakData> run() {
    for (const auto step : {&Soak::prepare, &Soak::startServer, &Soak::fillCaches, &Soak::startClients,
                            &Soak::watch, &Soak::conclude})
      RETURN_IF_ERROR((this->*step)());
    return std::move(data_);
  }

 private:
  [[nodiscard]] std::string program(const char* name) const {
    return std::filesystem::absolute(options_.bin / name);
  }
  [[nodiscard]] Error failed(const std::string& what, const Process& process) const {
    std::string said = process.said();
    if (said.size() > 2000) said = said.substr(said.size() - 2000);
    return Error{ErrorCode::kFailed, what + ": " + said};
  }

  Status admin(const std::vector<std::string>& arguments) {
    std::vector<std::string> all = {"--data", out_ / "data"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    Process process(program("needlelab-admin"), all, out_ / "admin.log");
    if (process.wait() != 0) return failed("needlelab-admin " + arguments[0], process);
    return {};
  }

  Status prepare() {
    std::error_code error;
    std::filesystem::create_directories(out_, error);
    if (error || std::filesystem::exists(out_ / "data"))
      return Error{
          ErrorCode::kInvalidInput,
          out_.string() + ": " + (error ? error.message() : "holds an earlier run; name a new folder")};
    std::ofstream(out_ / "password") << kPassword << "\n";
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"user", "add", "ines", "--role", "instructor", "--password-file",
                                   out_ / "password"},
          std::vector<std::string>{"user", "add", "ada", "--role", "administrator", "--password-file",
                                   out_ / "password"},
          std::vector<std::string>{"user", "add", "tom", "--role", "trainee"},
          std::vector<std::string>{"station", "add", "station-1", "--out", out_ / "station.key"}})
      RETURN_IF_ERROR(admin(arguments));
    return {};
  }

  Status startServer() {
    processes_[kServer] =
        std::make_unique<Process>(program("needlelab-server"),
                                  std::vector<std::string>{"--data", out_ / "data", "--listen", "127.0.0.1:0",
                                                           "--port-file", out_ / "port"},
                                  out_ / "server.log");
    ASSIGN_OR_RETURN(port_, portOf(*processes_[kServer], out_ / "port"));
    return reconnect();
  }

  Status reconnect() {
    ClientConfig config;
    config.server.port = port_;
    config.ca_file = out_ / "data" / "tls" / "ca.crt";
    config.program = programText("soak");
    config.login = personLogin("ines", kPassword);
    config.connect_timeout = kPatience;
    ASSIGN_OR_RETURN(auto client, BlockingClient::connect(config));
    client_ = std::make_unique<BlockingClient>(std::move(client));
    pb::Envelope overview;
    overview.mutable_subscribe()->set_subscription(1);
    overview.mutable_subscribe()->set_rate_hz(1);
    return client_->send(overview);
  }

  // SQLite keeps the pages that it wrote, up to 16 MiB. One station fills that within an hour, a hundred
  // within a minute: what grows after that is not a cache.
  Status fillCaches() {
    if (options_.form() == SoakForm::kShort) return {};
    Process load(program("needlelab-load"),
                 {"--server", fmt::format("127.0.0.1:{}", port_), "--ca", out_ / "data" / "tls" / "ca.crt",
                  "--user", "ada", "--password-file", out_ / "password", "--stations", "100", "--viewers",
                  "0", "--seconds", "60", "--quiet"},
                 out_ / "load.log");
    if (load.wait(300s) != 0) return failed("needlelab-load, which fills the server's caches", load);
    return reconnect();
  }

  Status startClients() {
    const std::vector<std::string> server = {"--server", fmt::format("127.0.0.1:{}", port_), "--ca",
                                             out_ / "data" / "tls" / "ca.crt"};
    const auto with = [&](const std::vector<std::string>& more) {
      std::vector<std::string> all = server;
      all.insert(all.end(), more.begin(), more.end());
      return all;
    };
    // a viewer at the full rate; its output lines give the live latency
    processes_[kViewer] =
        std::make_unique<Process>(program("needlelab-instructor"),
                                  with({"--user", "ines", "--password-file", out_ / "password", "--headless",
                                        "--station", "station-1", "--rate", "0", "--json"}),
                                  out_ / "viewer.jsonl");
    char seconds[32], rate[32];
    std::snprintf(seconds, sizeof seconds, "%.3f", options_.seconds);
    std::snprintf(rate, sizeof rate, "%g", options_.rate_hz);
    processes_[kStation] = std::make_unique<Process>(
        program("needlelab-station"),
        with({"--key", out_ / "station.key", "--trainee", "tom", "--exercise", "ball-free-practice",
              "--headless", "--hand-repeat", "0", "--seconds", seconds, "--rate", rate, "--spool",
              out_ / "spool", "--drain", "300", "--json", out_ / "station.json"}),
        out_ / "station.log");
    return {};
  }

  // all messages from the server in the meantime
  void takeNews() {
    for (;;) {
      auto got = client_->receive(1ms);
      if (!got.ok()) {
        if (got.error().code != ErrorCode::kNotFound) static_cast<void>(reconnect());
        return;
      }
      if (!got->has_station_status() || got->station_status().station() != "station-1") continue;
      status_ = got->station_status();
      if (!status_.trouble().empty() && troubles_.insert(status_.trouble()).second)
        data_.troubles.push_back(status_.trouble());
    }
  }
  double askServer() {
    pb::Request request;
    request.mutable_list_stations();
    const auto began = std::chrono::steady_clock::now();
    const auto reply = client_->call(request, kPatience);
    if (!reply.ok()) static_cast<void>(reconnect());
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count();
  }

  Status watch() {
    if (!eventually(
            [&] {
              takeNews();
              return status_.samples() > 0 || processes_[kStation]->wait(0ms);
            },
            60s) ||
        processes_[kStation]->wait(0ms))
      return failed("the station did not begin", *processes_[kStation]);
    const auto began = std::chrono::steady_clock::now();
    // the session began up to a second before the station reported it
    const double end_s = options_.seconds - options_.every_s() - 1.5;
    for (std::uint64_t k = 0;; ++k) {
      // at fixed times, so that sampling does not drift
      std::this_thread::sleep_until(began + milliseconds(options_.every_s() * static_cast<double>(k)));
      takeNews();
      SoakRow row;
      row.time_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
      // exclude the end of the lesson, where the station hashes and closes the session
      if (row.time_s >= end_s || status_.session_id().empty()) break;
      for (std::size_t i = 0; i < kSoakProcesses; ++i) {
        const auto sample = sampleProcess(processes_[i]->pid());
        if (!sample) return failed(std::string("the ") + kSoakNames[i] + " is gone", *processes_[i]);
        row.processes[i] = *sample;
      }
      row.spool_bytes = bytesBelow(out_ / "spool");
      row.data_bytes = bytesBelow(out_ / "data");
      row.request_ms = askServer();
      row.samples = status_.samples();
      row.missed_ticks = status_.missed_ticks();
      row.spool_left = status_.spool_left();
      row.wakeup_p99_us = status_.wakeup_p99_us();
      data_.rows.push_back(row);
      if (!options_.quiet && std::fmod(row.time_s, 60) < options_.every_s())
        std::cerr << "soak: " << static_cast<int>(row.time_s) << " of " << options_.seconds << " s, station "
                  << row.processes[kStation].rss_KiB << " KiB, server " << row.processes[kServer].rss_KiB
                  << " KiB, missed " << row.missed_ticks << " ticks\n";
    }
    return {};
  }

  Status conclude() {
    const auto code = processes_[kStation]->wait(360s);
    if (!code) return failed("the station did not end", *processes_[kStation]);
    data_.station_code = *code;
    auto text = readWholeFile(out_ / "station.json");
    if (!text.ok()) return failed("the station left no summary", *processes_[kStation]);
    data_.summary = nlohmann::json::parse(*text, nullptr, false);
    if (!data_.summary.is_object())
      return failed("the station's summary is not a JSON object", *processes_[kStation]);

    ASSIGN_OR_RETURN(const auto id, parseUuid(data_.summary.value("session_id", "")));
    RETURN_IF_ERROR(reconnect());
    pb::Request request;
    request.mutable_get_session()->set_session_id(id.data(), id.size());
    ASSIGN_OR_RETURN(const auto info, client_->call(request));
    data_.stored_samples = info.session().samples();
    data_.stored_state = pb::SessionState_Name(info.session().state());
    request.mutable_verify_session()->set_session_id(id.data(), id.size());
    const auto verified = client_->call(request);
    data_.verified = verified.ok() && verified->verified().ok();
    client_->finish();

    for (const SoakProcess which : {kViewer, kServer}) processes_[which]->signal(SIGTERM);
    data_.viewer_code = processes_[kViewer]->wait().value_or(-1);
    data_.server_code = processes_[kServer]->wait().value_or(-1);
    return {};
  }

  SoakOptions options_;
  std::filesystem::path out_;
  std::array<std::unique_ptr<Process>, kSoakProcesses> processes_;
  std::uint16_t port_ = 0;
  std::unique_ptr<BlockingClient> client_;
  pb::StationStatus status_;
  std::set<std::string> troubles_;
  SoakData data_;
};

}  // namespace

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(values.size())));
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, values.size()) - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

Result<SoakMinutes> minutesOf(const SoakData& data, const SoakOptions& options) {
  const double minute_s = options.minute_s();
  SoakMinutes minutes(static_cast<std::size_t>(std::ceil(options.seconds / minute_s)));
  const auto indexOf = [&](double time_s) {
    const auto index = static_cast<std::size_t>(std::max(0.0, time_s) / minute_s);
    return std::min(index, minutes.size() - 1);
  };
  std::vector<std::vector<double>> ticks(minutes.size()), requests(minutes.size()), live(minutes.size());

  // the recording
  ASSIGN_OR_RETURN(auto file, SpoolFile::open(options.out / "spool" /
                                              data.summary.value("session_id", "none") / "chunks"));
  std::uint64_t next_tick = 0;
  Status broken;
  const auto end = file.scan([&](const SpoolRecord& record) {
    const auto samples = decodeChunk(record.data);
    if (!samples.ok()) {
      broken = samples.error();
      return false;
    }
    for (const GestureSample& sample : *samples) {
      const std::size_t index = indexOf(static_cast<double>(sample.tick) / options.rate_hz);
      ++minutes[index].samples;
      minutes[index].missed_ticks += sample.tick - next_tick;
      next_tick = sample.tick + 1;
      ticks[index].push_back(1e-3 *
                             (static_cast<double>(sample.device_ns) + static_cast<double>(sample.engine_ns)));
    }
    return true;
  });
  if (!end.ok()) return end.error();
  if (!broken.ok()) return broken.error();

  // our own questions to the server
  for (const SoakRow& row : data.rows) {
    requests[indexOf(row.time_s)].push_back(row.request_ms);
    minutes[indexOf(row.time_s)].wakeup_p99_us = static_cast<double>(row.wakeup_p99_us);
  }

  // the viewer's lines
  std::ifstream lines(options.out / "viewer.jsonl");
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (!json.is_object() || !json.contains("latency_ms") || !json["latency_ms"].is_number()) continue;
    live[indexOf(json.value("time_s", 0.0))].push_back(json["latency_ms"].get<double>());
  }

  for (std::size_t i = 0; i < minutes.size(); ++i) {
    minutes[i].end_s = std::min(options.seconds, static_cast<double>(i + 1) * minute_s);
    minutes[i].tick_p99_us = quantile(std::move(ticks[i]), 0.99);
    minutes[i].request_p99_ms = quantile(std::move(requests[i]), 0.99);
    minutes[i].live_p99_ms = quantile(std::move(live[i]), 0.99);
  }
  return minutes;
}

const char* formText(SoakForm form) {
  return form == SoakForm::kShort ? "short form (losses, handles, threads)"
                                  : "nightly form (losses, handles, threads, memory)";
}

double SoakOptions::every_s() const {
  return std::clamp(seconds / 3600, 0.25, 5.0);
}
double SoakOptions::warmUp_s() const {
  return std::min(300.0, seconds / 4);
}
double SoakOptions::minute_s() const {
  return std::min(60.0, seconds / 5);
}

Result<SoakData> runSoak(const SoakOptions& options) {
  return Soak(options).run();
}

}  // namespace needlelab::test
