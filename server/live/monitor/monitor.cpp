#include "server/live/monitor/monitor.h"

#include <fmt/core.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>

#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/wire/certificates.h"
#include "db/erasure/retention_store.h"
#include "db/sessions/seen_time.h"
#include "db/sessions/session_store.h"
#include "db/store/schema.h"
#include "server/base/log.h"
#include "server/live/limits/server_limits.h"
#include "server/together/remote_live.h"
#include "server/together/server_together.h"

namespace needlelab {

namespace {

std::string fileText(const char* path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Boot time of this machine, seconds since 1970.
double bootTime() {
  std::istringstream stat(fileText("/proc/stat"));
  double seconds = 0;
  for (std::string line; std::getline(stat, line);)
    if (line.starts_with("btime ")) seconds = std::stod(line.substr(6));
  return seconds;
}

}  // namespace

ProcessFacts processFacts() {
  ProcessFacts facts;
  // the name is in parentheses and may contain any character: count fields after the last one (proc(5))
  const std::string stat = fileText("/proc/self/stat");
  const auto end = stat.rfind(')');
  if (end != std::string::npos) {
    const auto ticks_per_s = static_cast<double>(::sysconf(_SC_CLK_TCK));
    std::istringstream fields(stat.substr(end + 1));
    std::string field;
    for (int number = 3; fields >> field; ++number) {
      if (number == 14 || number == 15) facts.cpu_s += std::stod(field) / ticks_per_s;
      if (number == 20) facts.threads = std::stoull(field);
      if (number == 22) facts.started_unix_s = bootTime() + std::stod(field) / ticks_per_s;
      if (number == 24)
        facts.rss_bytes = std::stoull(field) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    }
  }
  std::error_code error;
  for (auto at = std::filesystem::directory_iterator("/proc/self/fd", error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error))
    ++facts.open_files;
  // exclude the descriptor that reads the folder
  if (facts.open_files > 0) --facts.open_files;
  const struct mallinfo2 heap = ::mallinfo2();
  facts.heap_live_bytes = heap.uordblks + heap.hblkhd;
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) facts.max_files = limit.rlim_cur;
  return facts;
}

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kTryWriteAfter = 10 * kSecond;  // without a commit

/// Reads a number from a single row; reports a fault when that fails.
std::uint64_t oneNumber(Connection& reader, std::string_view sql, std::string& fault) {
  auto rows = reader.prepare(sql);
  const auto row = rows.step();
  if (!row.ok()) {
    fault = row.error().message;
    return 0;
  }
  return *row ? rows.natural(0) : 0;
}

}  // namespace

StoreFacts readStoreFacts(Store& store, const std::filesystem::path& certificate, bool acks_are_safe) {
  StoreFacts facts;
  const std::filesystem::path path = store.databasePath();
  std::error_code error;
  const auto size = [&](const std::filesystem::path& file) {
    const auto bytes = std::filesystem::file_size(file, error);
    return error ? 0 : static_cast<std::uint64_t>(bytes);
  };
  facts.database_bytes = size(path);  // 0 with PostgreSQL, which is queried below
  facts.wal_bytes = size(path.string() + "-wal");
  const auto space = std::filesystem::space(path.parent_path(), error);
  if (error) {
    facts.fault = path.parent_path().string() + ": " + error.message();
  } else {
    facts.free_bytes = space.available;
    facts.disk_bytes = space.capacity;
  }
  facts.process = processFacts();
  facts.durability = store.writer().durability();
  if (const auto read = readCertificate(certificate); read.ok())
    facts.certificate_end_unix_s = read->not_after_unix_s;

  auto reader = store.readers().borrow();
  if (!reader.ok()) {
    facts.fault = reader.error().message;
    return facts;
  }
  if ((*reader)->sqlite() == nullptr) {
    const auto room = RetentionStore(**reader).space();
    if (room.ok()) facts.database_bytes = room->database_bytes;
    if (!room.ok()) facts.fault = room.error().message;
  }
  facts.sessions_open = oneNumber(**reader, "SELECT count(*) FROM sessions WHERE state = 1", facts.fault);
  const auto unsafe = SessionStore(**reader).unsafeChunks(acks_are_safe);
  if (unsafe.ok()) facts.unsafe_chunks = *unsafe;
  if (!unsafe.ok()) facts.fault = unsafe.error().message;
  if (const auto when = MetaStore(**reader).get("backup_unix_ns"); !when.ok()) {
    facts.fault = when.error().message;
  } else if (*when) {
    facts.backup_unix_ns = std::strtoll((*when)->c_str(), nullptr, 10);
  }
  if (const auto ahead = SeenTimeStore(**reader).aheadText(wallNowNs()); !ahead.ok())
    facts.fault = ahead.error().message;
  else
    facts.clock_ahead = !ahead->empty();
  return facts;
}

HttpAnswer healthAnswer(const Health& health, const StoreFacts& facts, std::int64_t now_unix_ns) {
  const auto tenths = [](double value) { return std::round(value * 10) / 10; };
  nlohmann::ordered_json json;
  json["healthy"] = health.problems.empty();
  json["database_writable"] = health.writable;
  json["last_commit_age_s"] = nullptr;
  if (health.last_commit_age_s >= 0) json["last_commit_age_s"] = tenths(health.last_commit_age_s);
  json["ack_survives"] = durabilityText(facts.durability);
  if (health.access_heard_s) json["access_heard_s"] = tenths(*health.access_heard_s);
  json["disk_free_bytes"] = facts.free_bytes;
  json["backup_age_s"] = nullptr;
  if (facts.backup_unix_ns)
    json["backup_age_s"] = tenths(static_cast<double>(now_unix_ns - *facts.backup_unix_ns) / 1e9);
  const double days =
      (static_cast<double>(facts.certificate_end_unix_s) - static_cast<double>(now_unix_ns) / 1e9) / 86'400;
  json["certificate_days_left"] = tenths(days);
  if (health.live) {
    json["live_between_servers"] = health.live->trouble.empty() ? "up" : health.live->trouble;
    json["live_servers"] = health.live->servers;
  }
  json["problems"] = health.problems;
  // a path that is not UTF-8 must not throw
  const std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  return {health.problems.empty() ? 200u : 503u, "application/json", text};
}

Monitor::Monitor(ServerContext& context, std::filesystem::path certificate, MonitorSettings settings)
    : context_(context),
      certificate_(std::move(certificate)),
      settings_(settings),
      read_(context.io.get_executor()),
      written_(context.io.get_executor()) {}

Monitor::~Monitor() = default;

void Monitor::join() {
  worker_.join();
}

Task<HttpAnswer> Monitor::answer(std::string path) {
  if (path != "/metrics" && path != "/healthz") co_return plainAnswer(404, "there is /metrics and /healthz");
  const StoreFacts facts = co_await this->facts();
  if (path == "/metrics")
    co_return HttpAnswer{200, "text/plain; version=0.0.4; charset=utf-8", metricsText(context_, facts)};
  if (!facts.answered) {
    // skip the test write: it would wait as well, and the report would use an old reading
    Health health;
    health.live = live();
    health.last_commit_age_s =
        last_commit_ns_ == 0 ? -1 : static_cast<double>(steadyNowNs() - last_commit_ns_) / 1e9;
    health.problems.push_back(facts.fault);
    co_return healthAnswer(health, facts, wallNowNs());
  }
  const Health health = co_await this->health(facts);
  co_return healthAnswer(health, facts, wallNowNs());
}

Task<> Monitor::read(Monitor& self) {
  std::function<Result<StoreFacts>()> work = [&store = self.context_.store, file = self.certificate_,
                                              safe = self.context_.acks_are_safe]() -> Result<StoreFacts> {
    return readStoreFacts(store, file, safe);
  };
  auto read = co_await offload(self.worker_, std::move(work));
  if (read.ok()) {
    self.facts_ = std::move(*read);
  } else {
    if (!self.facts_) self.facts_.emplace();
    self.facts_->fault = read.error().message;
  }
  self.facts_ns_ = steadyNowNs();
  self.reading_ = false;
  self.read_.notify();
}

Task<StoreFacts> Monitor::facts() {
  // at most one read per second, because it costs disk reads; more frequent requests share it
  const std::int64_t asked_ns = steadyNowNs();
  const auto fresh = [&] { return facts_ && facts_ns_ >= asked_ns - kSecond; };
  const std::int64_t patience_ns = std::chrono::nanoseconds(settings_.read_patience).count();
  while (!fresh()) {
    // a hanging disk may block its reader, but not the requests for health and metrics
    const std::int64_t left_ns = patience_ns - (steadyNowNs() - asked_ns);
    if (left_ns <= 0) {
      StoreFacts last = facts_.value_or(StoreFacts{});
      last.fault = fmt::format("the disk does not answer: nothing was read within {:.1f} s",
                               static_cast<double>(patience_ns) / 1e9);
      last.answered = false;
      co_return last;
    }
    if (!std::exchange(reading_, true)) asio::co_spawn(context_.io, read(*this), rethrow);
    asio::steady_timer patience(context_.io, std::chrono::nanoseconds(left_ns));
    patience.async_wait([this](const boost::system::error_code& stopped) {
      if (!stopped) read_.notify();
    });
    co_await read_.wait();
  }
  co_return *facts_;
}

/// Tests that the database accepts writes, unless a recent commit has shown it and none was refused since.
Task<> Monitor::tryWrite(Monitor& self) {
  DbWriter::Work work = [](Connection& writer) {
    return MetaStore(writer).set("health_unix_ns", std::to_string(wallNowNs()));
  };
  const Status status = co_await commit(self.context_.store.writer(), std::move(work));
  self.writing_ = false;
  if (!status.ok()) logEvent(LogLevel::kWarning, "trial_write_failed", {{"text", status.error().message}});
  self.written_.notify();
}

std::optional<Health::Live> Monitor::live() const {
  const RemoteLive* const remote = context_.together.remote;
  if (remote == nullptr) return std::nullopt;
  std::string trouble = remote->trouble();
  if (const std::string taken = remote->duplicateName(); !taken.empty())
    trouble += (trouble.empty() ? "" : "; ") + taken;
  return Health::Live{std::move(trouble), remote->servers()};
}

Task<Health> Monitor::health(const StoreFacts& facts) {
  DbWriter& writer = context_.store.writer();
  const auto look = [&] {
    if (const auto commits = writer.counters().commits; commits != seen_commits_) {
      seen_commits_ = commits;
      last_commit_ns_ = steadyNowNs();
    }
    return last_commit_ns_ != 0 && steadyNowNs() - last_commit_ns_ < kTryWriteAfter &&
           writer.standing().refused.empty();
  };
  Health health;
  health.live = live();
  const bool room = facts.free_bytes >= settings_.min_free_bytes;
  health.writable = look();
  // skip the test write when space is low: a failed write would stop the writer for good
  if (!health.writable && room && !writer.failed()) {
    if (!std::exchange(writing_, true)) asio::co_spawn(context_.io, tryWrite(*this), rethrow);
    asio::steady_timer patience(context_.io, settings_.write_patience);
    patience.async_wait([this](const boost::system::error_code& stopped) {
      if (!stopped) written_.notify();
    });
    co_await written_.wait();
    health.writable = look();
  }
  health.last_commit_age_s =
      last_commit_ns_ == 0 ? -1 : static_cast<double>(steadyNowNs() - last_commit_ns_) / 1e9;

  const std::int64_t now_ns = wallNowNs();
  if (const auto& why = context_.store.readOnly()) {
    health.problems.push_back("the server is read-only: " + why->message);
  } else if (const auto failed = writer.failed()) {
    health.writable = false;
    health.problems.push_back("the database writer has stopped: " + failed->message);
  } else if (const std::string full = context_.limits.disk_room.text(); !full.empty()) {
    health.problems.push_back(full);
  } else if (!room) {
    health.problems.push_back(fmt::format("the disk of the data folder has {} MiB left, wanted are {}",
                                          facts.free_bytes >> 20, settings_.min_free_bytes >> 20));
  } else if (!health.writable) {
    health.problems.emplace_back("a trial write was not committed in time");
    if (const std::string refused = writer.standing().refused; !refused.empty())
      health.problems.push_back("the last change was refused: " + refused);
  }
  // a test write may be small enough to succeed, and its table may have room, while recordings do not
  if (const std::string full = writer.full(DbWriter::kReportedFor); !full.empty()) {
    health.writable = false;
    health.problems.push_back("no room: " + full);
  }
  if (const std::string failed = writer.failedItem(DbWriter::kReportedFor); !failed.empty()) {
    health.writable = false;
    health.problems.push_back("not all is stored: " + failed);
  }
  if (std::string lack = writer.lack(); !lack.empty()) health.problems.push_back(std::move(lack));
  if (context_.together.access_listener) {
    const auto hearing = context_.together.access_listener->hearing();
    health.access_heard_s = hearing.silence_s;
    if (!hearing.fault.empty()) health.problems.push_back(hearing.fault);
    if (hearing.is_deaf && hearing.fault.empty())
      health.problems.emplace_back("the database has not said for some seconds what other servers changed");
  }
  if (!facts.fault.empty()) health.problems.push_back("the database cannot be read: " + facts.fault);
  if (facts.certificate_end_unix_s != 0 && facts.certificate_end_unix_s < now_ns / kSecond)
    health.problems.emplace_back(
        "the server's certificate has expired: the server's log says why it was not renewed "
        "(certificate_not_renewed)");
  if (settings_.max_backup_age.count() > 0) {
    if (!facts.backup_unix_ns) {
      health.problems.emplace_back("there was never a verified backup");
    } else if ((now_ns - *facts.backup_unix_ns) / kSecond > settings_.max_backup_age.count()) {
      health.problems.push_back(fmt::format("the last verified backup is {:.1f} h old",
                                            static_cast<double>(now_ns - *facts.backup_unix_ns) / 3.6e12));
    }
  }
  co_return health;
}

MonitorPort::MonitorPort(asio::io_context& io, Tcp::acceptor acceptor, Monitor& monitor)
    : HttpServer(io, std::move(acceptor), std::nullopt,
                 {.header_bytes = 4096,
                  .body_bytes = 0,
                  .requests_per_connection = 1,
                  .whole = monitor.settings().connection_time}),
      monitor_(monitor) {}

void MonitorPort::stop() {
  HttpServer::stop();
  cut();
}

bool MonitorPort::admit(std::uint64_t /*id*/, const Tcp::endpoint& /*peer*/) {
  constexpr std::size_t kMaxConnections = 16;
  return connections() < kMaxConnections;
}

Task<HttpAnswer> MonitorPort::answer(std::shared_ptr<HttpRequest> request) {
  if (request->method == "GET" || request->method == "HEAD")
    co_return co_await monitor_.answer(request->target.substr(0, request->target.find('?')));
  HttpAnswer answer = plainAnswer(405, "only GET and HEAD");
  answer.headers.emplace_back("Allow", "GET, HEAD");
  co_return answer;
}

std::optional<HttpAnswer> MonitorPort::unreadable(const boost::system::error_code& error) {
  if (!isBadRequest(error)) return std::nullopt;
  return plainAnswer(400, "not a request that this server knows: " + error.message());
}

}  // namespace needlelab
