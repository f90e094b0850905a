#include "tests/load/load_run.h"

#include <fmt/core.h>
#include <sys/resource.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <thread>

#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "tests/bench/result_folder.h"
#include "tests/load/load_options.h"
#include "tests/load/load_viewer.h"
#include "tests/load/server/own_server.h"
#include "tests/load/station_crowd.h"
#include "tests/nats/nats_server.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

constexpr double kLiveEvery_s = 10;
constexpr double kSpread_s = 1;         // the stations begin within this time
constexpr double kConnect_per_s = 400;  // log-ins of stations before streaming

double seconds(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-9;
}

double ownCpu_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto of = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return of(usage.ru_utime) + of(usage.ru_stime);
}

void raiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  static_cast<void>(setrlimit(RLIMIT_NOFILE, &limit));
}

std::string diskOf(const std::filesystem::path& folder) {
  struct statfs about {};
  if (statfs(folder.c_str(), &about) != 0) return "unknown";
  switch (static_cast<unsigned long>(about.f_type)) {
    case 0xEF53:
      return "ext4";
    case 0x01021994:
      return "tmpfs";
    case 0x58465342:
      return "xfs";
    case 0x9123683E:
      return "btrfs";
    case 0x794c7630:
      return "overlay";
    default:
      return fmt::format("type 0x{:x}", static_cast<unsigned long>(about.f_type));
  }
}

class LoadRun {
 public:
  LoadRun(const LoadOptions& options, const std::atomic<bool>& interrupt)
      : options_(options), interrupt_(interrupt) {
    result_.options = options;
    result_.when = nowText();
  }

  Result<LoadResult> run() {
    raiseFileLimit();
    for (const auto step :
         {&LoadRun::prepare, &LoadRun::connectAll, &LoadRun::stream, &LoadRun::drain, &LoadRun::compare})
      RETURN_IF_ERROR((this->*step)());
    return std::move(result_);
  }

 private:
  void log(const std::string& text) const {
    if (!options_.quiet) std::fprintf(stderr, "needlelab-load: %s\n", text.c_str());
  }
  [[nodiscard]] bool stopAsked() const { return interrupt_.load(std::memory_order_relaxed); }

  Status prepare() {
    ASSIGN_OR_RETURN(auto pool, makeGesturePool(options_.seed, options_.gestures));
    pool_ = std::move(pool);
    shared_.pool = &pool_;
    shared_.seed = options_.seed;
    shared_.ticks = static_cast<std::uint64_t>(options_.seconds * 1000 + 0.5);
    shared_.client.program = programText("load");
    shared_.client.connect_timeout = 60s;
    shared_.stations = std::vector<StationPlan>(options_.stations);
    const Status enrolled = options_.server.empty() ? enrolHere() : enrolThere();
    if (!enrolled.ok()) return enrolled;
    ASSIGN_OR_RETURN(auto tls,
                     makeClientTls(servers_.empty() ? options_.ca_file : servers_.front().caFile()));
    shared_.client.tls = tls;
    for (std::size_t i = 0; i < options_.stations; ++i) {
      shared_.stations[i].session = makeUuidV7();
      shared_.stations[i].first_server = firstServerOf(i, options_.viewers, shared_.client.servers().size());
    }
    return {};
  }

  Status enrolHere() {
    const std::filesystem::path folder = temporary_.emplace().path();
    std::error_code error;
    result_.database_disk = options_.store.empty() ? diskOf(folder) : "PostgreSQL";
    std::filesystem::create_directories(ownFolder(folder, 0), error);
    const std::filesystem::path data = ownFolder(folder, 0) / "data";
    ASSIGN_OR_RETURN(auto enrolled, enrol(data, options_.stations, options_.store));
    for (std::size_t i = 0; i < options_.stations; ++i) {
      shared_.stations[i].name = enrolled.stations[i].first;
      shared_.stations[i].key = enrolled.stations[i].second;
    }
    login_ = personLogin(enrolled.user, enrolled.password);
    if (!options_.store.empty()) {
      ASSIGN_OR_RETURN(auto postgres, openAt(database(data), Connection::Mode::kReader));
      postgres_.emplace(std::move(postgres));
    }
    return startServers(folder);
  }

  // data and log folder of one of the run's own servers
  [[nodiscard]] std::filesystem::path ownFolder(const std::filesystem::path& folder, std::size_t i) const {
    return options_.servers.empty() ? folder : folder / options_.servers[i];
  }

  // core NATS without TLS and users, for servers on one machine
  Status startNats() {
    if (::access(NEEDLELAB_NATS_SERVER, X_OK) != 0)
      return Error{ErrorCode::kFailed,
                   NEEDLELAB_NATS_SERVER " is missing: install it with deploy/setup --faculty"};
    nats_.emplace("http: \"127.0.0.1:-1\"\n");
    nats_->start();
    return {};
  }

  Status startServers(const std::filesystem::path& folder) {
    if (!options_.servers.empty()) RETURN_IF_ERROR(startNats());
    const std::size_t count = std::max<std::size_t>(1, options_.servers.size());
    Endpoints all;
    for (std::size_t i = 0; i < count; ++i) {
      const std::filesystem::path own = ownFolder(folder, i);
      std::vector<std::string> arguments;
      if (!options_.servers.empty())
        arguments = {"--together",       "--web", "off", "--live", nats_->url(), "--live-name",
                     options_.servers[i]};
      if (i > 0) {
        std::error_code error;
        std::filesystem::create_directories(own, error);
        RETURN_IF_ERROR(joinServer(options_.bin, servers_.front().data(), own / "data", options_.servers[i]));
      }
      servers_.emplace_back(options_.bin / "needlelab-server", own, std::move(arguments));
      RETURN_IF_ERROR(servers_.back().start());
      all.push_back({.host = "127.0.0.1", .port = servers_.back().port()});
    }
    ++starts_;
    shared_.client.setServers(all);
    return {};
  }

  [[nodiscard]] StoreAddress database(const std::filesystem::path& data) const {
    return {data / "needlelab.db", options_.store};
  }

  // names unused by earlier runs: they identify a session's station
  Status enrolThere() {
    ASSIGN_OR_RETURN(auto password, readPassword(options_.password_file, ""));
    login_ = personLogin(options_.user, password);
    shared_.client.setServers(options_.server);
    shared_.client.ca_file = options_.ca_file;
    ASSIGN_OR_RETURN(auto client, asAdministrator());
    const auto run = static_cast<unsigned long long>(wallNowNs() / 1'000'000'000);
    for (std::size_t i = 0; i < options_.stations; ++i) {
      pb::Request request;
      request.mutable_add_station()->set_name(fmt::format("load-{:x}-{:04}", run, i + 1));
      ASSIGN_OR_RETURN(auto reply, client.call(request));
      shared_.stations[i].name = reply.station_key().name();
      shared_.stations[i].key = reply.station_key().key();
    }
    return {};
  }

  Result<BlockingClient> asAdministrator() const {
    ClientConfig config = shared_.client;
    config.login = login_;
    return BlockingClient::connect(config);
  }

  Status connectAll() {
    const std::int64_t begin_ns = steadyNowNs();
    crowd_.emplace(shared_);
    viewers_.emplace(shared_, login_, options_.viewers);
    crowd_->connect(kConnect_per_s);
    viewers_->connect();
    const double limit_s = 60 + static_cast<double>(options_.stations) / kConnect_per_s;
    for (;;) {
      const CrowdState state = crowd_->state();
      const std::size_t watching = viewers_->watching();
      // a viewer at another server requests it through NATS
      const std::size_t watched = options_.viewers > 0 ? options_.stations : 0;
      if (state.opened == options_.stations && watching == options_.viewers && state.watched >= watched)
        break;
      if (stopAsked()) return Error{ErrorCode::kFailed, "interrupted before the streaming began"};
      if (seconds(steadyNowNs() - begin_ns) > limit_s)
        return Error{
            ErrorCode::kUnavailable,
            fmt::format("only {} of {} stations and {} of {} viewers are connected after {:.0f} s, "
                        "{} stations are watched; ",
                        state.opened, options_.stations, watching, options_.viewers, limit_s, state.watched) +
                state.trouble + " " + viewers_->lastError()};
      std::this_thread::sleep_for(50ms);
    }
    result_.connect_s = seconds(steadyNowNs() - begin_ns);
    log(fmt::format("{} stations and {} viewers connected in {:.1f} s", options_.stations, options_.viewers,
                    result_.connect_s));
    return {};
  }

  Status stream() {
    const std::int64_t begin_ns = steadyNowNs() + 100'000'000;
    for (std::size_t i = 0; i < shared_.stations.size(); ++i)
      shared_.stations[i].start_ns =
          begin_ns + static_cast<std::int64_t>(1e9 * kSpread_s * static_cast<double>(i) /
                                               static_cast<double>(shared_.stations.size()));
    ASSIGN_OR_RETURN(const std::vector<ProcessUse> before, uses());
    FaultPlan faults(options_);
    crowd_->stream();
    std::int64_t next_row_ns = begin_ns;
    for (bool told = false;;) {
      const CrowdState state = crowd_->state();
      const double time_s = seconds(steadyNowNs() - begin_ns);
      if (state.ended == options_.stations) break;
      if (stopAsked() && !std::exchange(told, true)) {
        log("ending before its time");
        result_.interrupted = true;
        crowd_->endNow();
      }
      if (steadyNowNs() >= next_row_ns) {
        next_row_ns += 1'000'000'000;
        sampleServers(time_s);
        progress(time_s, state);
        for (OwnServer& server : servers_)
          if (!server.running())
            return Error{ErrorCode::kFailed,
                         "the server has ended by itself; its log: " + endOf(server.log())};
      }
      if (options_.faults && time_s < options_.seconds) RETURN_IF_ERROR(fault(faults.at(time_s)));
      std::this_thread::sleep_for(20ms);
    }
    result_.streamed_s = seconds(steadyNowNs() - begin_ns);
    result_.stations_at.resize(shared_.client.servers().size());
    for (const StationPlan& plan : shared_.stations) ++result_.stations_at[plan.server];
    ASSIGN_OR_RETURN(const std::vector<ProcessUse> after, uses());
    for (std::size_t i = 0; i < after.size(); ++i)
      result_.processes.push_back(useBetween(before[i], after[i]));
    for (std::size_t i = 0; i < servers_.size(); ++i)
      result_.server_cpu_s += result_.processes[i].cpu_s.value_or(0);
    result_.generator_cpu_s = result_.processes.back().cpu_s.value_or(0);
    return {};
  }

  // since each began: the run's own servers, then PostgreSQL; the generator last
  Result<std::vector<ProcessUse>> uses() {
    std::vector<ProcessUse> all;
    for (std::size_t i = 0; i < servers_.size(); ++i) {
      const OwnServer& server = servers_[i];
      // with faults only CPU time is known: a killed server loses its other counters
      ProcessUse use = options_.faults ? ProcessUse() : useOf(server.pid());
      if (!options_.faults) addScrape(use, server.scrape());
      const auto now = server.sample();
      use.cpu_s = server.earlierCpu_s() + (now ? now->cpu_s : 0);
      use.name = options_.servers.empty() ? "server" : "server " + options_.servers[i];
      all.push_back(std::move(use));
    }
    if (postgres_) {
      ASSIGN_OR_RETURN(const PostgresUse postgres, postgresUse(*postgres_));
      all.push_back(postgres.use);
    }
    if (!options_.standby.empty()) {
      ASSIGN_OR_RETURN(ProcessUse use, standbyUse(options_.standby));
      all.push_back(std::move(use));
    }
    if (nats_) {
      ProcessUse use = useOf(nats_->pid());
      use.name = "NATS";
      addVarz(use, httpSend(static_cast<std::uint16_t>(nats_->monitoringPort()),
                            "GET /varz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", kPatience)
                       .body);
      all.push_back(std::move(use));
    }
    ProcessUse own;
    own.name = "generator";
    own.cpu_s = ownCpu_s();
    all.push_back(std::move(own));
    return all;
  }

  Status fault(const std::optional<PlannedFault>& planned) {
    if (!planned) return {};
    switch (planned->kind) {
      case PlannedFault::Kind::kCut:
        for (const std::size_t station : planned->who) crowd_->cut(station);
        result_.cuts += planned->who.size();
        return {};
      case PlannedFault::Kind::kSlowViewer:
        for (const std::size_t viewer : planned->who) viewers_->pause(viewer, planned->time);
        result_.pauses += planned->who.size();
        return {};
      case PlannedFault::Kind::kKillServer:
        log("kill -9 of the server");
        servers_.front().kill();
        ++result_.kills;
        std::this_thread::sleep_for(planned->time);
        RETURN_IF_ERROR(servers_.front().start());
        ++starts_;
        return {};
    }
    return {};
  }

  // waits until all samples are acknowledged and all sessions closed
  Status drain() {
    const std::int64_t begin_ns = steadyNowNs();
    std::int64_t moved_ns = begin_ns;
    std::uint64_t before = 0;
    CrowdState state;
    for (;;) {
      state = crowd_->state();
      if (state.finished == options_.stations) break;
      const std::uint64_t now = state.samples_acked + state.finished;
      if (now != std::exchange(before, now)) moved_ns = steadyNowNs();
      if (seconds(steadyNowNs() - moved_ns) > 60) {
        result_.troubles.push_back(
            fmt::format("{} of {} sessions were not closed: nothing has moved for 60 s; ",
                        options_.stations - state.finished, options_.stations) +
            state.trouble);
        break;
      }
      std::this_thread::sleep_for(20ms);
    }
    result_.drain_s = seconds(steadyNowNs() - begin_ns);
    result_.stations_closed = state.closed;
    if (state.closed < options_.stations) result_.troubles.push_back(state.trouble);
    log(fmt::format("all sent and closed in {:.1f} s", result_.drain_s));
    viewers_->stop();
    crowd_->stop();
    ticks_ = crowd_->ticks();
    for (const std::uint64_t ticks : ticks_) result_.samples_made += ticks;
    result_.stations = crowd_->totals();
    result_.viewers = viewers_->totals();
    return {};
  }

  Status compare() {
    const std::int64_t begin_ns = steadyNowNs();
    std::int64_t said_ns = begin_ns;
    const CheckProgress progress = [&](std::size_t done) {
      if (steadyNowNs() - said_ns < 2'000'000'000) return;
      said_ns = steadyNowNs();
      log(fmt::format("{} of {} sessions compared", done, options_.stations));
    };
    if (!servers_.empty()) {
      for (OwnServer& server : servers_)
        if (Status status = server.stop(); !status.ok()) result_.troubles.push_back(status.error().message);
      const std::filesystem::path data = servers_.front().data();
      ASSIGN_OR_RETURN(auto check, checkDatabase(database(data), shared_, ticks_, progress));
      result_.stored = std::move(check);
      result_.database_bytes = bytesBelow(data);
      if (postgres_) {
        ASSIGN_OR_RETURN(const PostgresUse end, postgresUse(*postgres_));
        result_.database_bytes = end.database_bytes;
      }
    } else {
      ASSIGN_OR_RETURN(auto client, asAdministrator());
      ASSIGN_OR_RETURN(auto check, checkThroughServer(client, shared_, ticks_, progress));
      result_.stored = std::move(check);
    }
    result_.check_s = seconds(steadyNowNs() - begin_ns);
    log(fmt::format("{} stored samples compared in {:.1f} s", result_.stored.samples.stored,
                    result_.check_s));
    return {};
  }

  void sampleServers(double time_s) {
    if (servers_.empty()) return;
    for (const OwnServer& server : servers_) {
      const auto seen = server.sample();
      if (!seen) continue;
      result_.server_rss_KiB = std::max(result_.server_rss_KiB, seen->rss_KiB);
      result_.server_handles = std::max(result_.server_handles, seen->handles);
    }
    const OwnServer& first = servers_.front();
    const auto sample = first.sample();
    if (!sample) return;
    // for its metrics the server reads its database
    if (options_.faults && time_s >= live_due_s_) {
      live_due_s_ = time_s + kLiveEvery_s;
      if (const auto live = first.liveHeapBytes()) live_ = {starts_, *live / 1024};
    }
    const std::uint64_t live_KiB = live_.first == starts_ ? live_.second : 0;
    result_.rows.push_back({time_s, *sample, starts_, bytesBelow(first.data()), live_KiB});
  }

  void progress(double time_s, const CrowdState& state) const {
    if (result_.rows.size() % 5 != 1) return;
    log(fmt::format("{:4.0f} s: {:.1f} million samples, {:.1f} million acknowledged", std::max(0.0, time_s),
                    static_cast<double>(state.samples_made) * 1e-6,
                    static_cast<double>(state.samples_acked) * 1e-6));
  }

  static std::string endOf(const std::filesystem::path& log) {
    auto text = readWholeFile(log);
    if (!text.ok()) return log;
    return text->size() > 1000 ? text->substr(text->size() - 1000) : *text;
  }

  const LoadOptions options_;
  const std::atomic<bool>& interrupt_;
  LoadResult result_;
  GesturePool pool_;
  LoadShared shared_;
  pb::Login login_;
  std::optional<TempFolder> temporary_;
  std::optional<NatsServerProcess> nats_;  // with several servers
  std::vector<OwnServer> servers_;         // empty: they already run
  std::optional<Connection> postgres_;     // with --store: for its sizes
  std::uint64_t starts_ = 0;
  std::pair<std::uint64_t, std::uint64_t> live_;  // server's number, KiB
  double live_due_s_ = 0;
  std::optional<StationCrowd> crowd_;
  std::optional<ViewerCrowd> viewers_;
  MadeTicks ticks_;
};

}  // namespace

bool LoadResult::good() const {
  return stored.clean() && troubles.empty() && stations_closed == options.stations && viewers.corrupt == 0;
}

Result<LoadResult> runLoad(const LoadOptions& options, const std::atomic<bool>& interrupt) {
  RETURN_IF_ERROR(checkOptions(options));
  return LoadRun(options, interrupt).run();
}

}  // namespace needlelab::test
