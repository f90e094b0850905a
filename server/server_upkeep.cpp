// A server's periodic work: retention, free memory, the certificate, disk room, clients that have hung up,
// omitted log lines, erasures at other servers, systemd's watchdog.
#include <malloc.h>

#include <boost/asio/post.hpp>
#include <chrono>
#include <functional>
#include <utility>

#include "common/base/time/clock.h"
#include "db/erasure/retention_store.h"
#include "db/store/schema.h"
#include "server/base/log.h"
#include "server/live/port/live_peer.h"
#include "server/live/port/remote_access.h"
#include "server/live/port/request_effects.h"
#include "server/server_parts.h"
#include "server/service_manager.h"

namespace needlelab {
namespace {

/// A read-only server assumes that someone made room when this much more is free than at its start.
constexpr std::uint64_t kMadeRoom = 8u << 20;

constexpr std::chrono::milliseconds kHangUpPeriod{250};
constexpr std::chrono::seconds kLinesPeriod{5};
constexpr std::chrono::seconds kAccessPeriod{1}, kTidyPeriod{60};
constexpr std::chrono::milliseconds kRemotePeriod{50};

}  // namespace

Result<ServerCertificate> currentCertificate(const TlsFiles& files, const CertificateNames& names) {
  ServerCertificate current;
  ASSIGN_OR_RETURN(current.made, ensureTlsFiles(files, names));
  ASSIGN_OR_RETURN(current.tls, makeServerTls(files.certificate, files.key));
  // from the context, not the files: a command may replace them at any time
  ASSIGN_OR_RETURN(const auto facts, shownCertificate(current.tls));
  current.sha256 = facts.sha256;
  current.clock_fault = clockFault(files);
  return current;
}

Task<> ServerParts::retentionLoop() {
  auto wait = options.retention_first;
  // beginStop cancels the timer only once, so a run that ends later must not start it again
  while (!stopping) {
    retention_timer.expires_after(std::exchange(wait, options.retention_every));
    co_await retention_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    std::function<Result<std::optional<pb::RetentionReport>>()> work = [this] {
      yieldThread();
      return store->service().retention().daily();
    };
    const auto ran = co_await offload(retention_workers, std::move(work));
    if (!ran.ok()) {
      logEvent(LogLevel::kWarning, "retention_not_run", {{"text", ran.error().message}});
      continue;
    }
    const std::optional<pb::RetentionReport>& report = *ran;
    if (!report) {
      logEvent(LogLevel::kInfo, "retention_elsewhere", {{"text", "another server does the daily work"}});
      continue;
    }
    logEvent(LogLevel::kInfo, "retention",
             {{"thinned", report->thinned()},
              {"deleted", report->deleted()},
              {"waiting_for_backup", report->waiting_for_backup()},
              {"left_alone", report->left_alone()},
              {"bytes_before", report->bytes_before()},
              {"bytes_after", report->bytes_after()},
              {"stopped", report->stopped() ? "yes" : "no"}});
  }
}

/// Returns free memory to the system. Each burst (many reconnections, a viewer that does not read) takes
/// memory; afterwards the C library keeps the gaps between live blocks, so the heap would stay as large as
/// after the largest burst.
Task<> ServerParts::heapLoop() {
  while (!stopping) {
    heap_timer.expires_after(options.heap_every);
    co_await heap_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    asio::post(workers, [] { ::malloc_trim(0); });
  }
}

/// Renews the certificate in time and loads one that a technician has made (certificates.h). Existing
/// connections keep theirs.
Task<> ServerParts::certificateLoop() {
  std::string fault;
  while (!stopping) {
    certificate_timer.expires_after(options.certificate_every);
    co_await certificate_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    std::function<Result<ServerCertificate>()> work = [this] { return currentCertificate(files, names); };
    const auto now = co_await offload(workers, std::move(work));
    if (stopping) co_return;
    // log each fault once; the old certificate stays in use
    const std::string text = now.ok() ? now->clock_fault : now.error().message;
    if (std::exchange(fault, text) != text && !text.empty())
      logEvent(LogLevel::kWarning, now.ok() ? "authority_not_valid" : "certificate_not_renewed",
               {{"text", text}});
    if (!now.ok()) continue;
    if (std::exchange(certificate_sha256, now->sha256) == now->sha256) continue;
    tls = now->tls;
    if (web) web->useTls(tls);
    logEvent(LogLevel::kInfo, "certificate_taken", {{"sha256", now->sha256}});
  }
}

/// Thread: any; blocks while the disk hangs. Nothing: the system does not report it.
std::optional<DiskRoom::Look> ServerParts::measureRoom() const {
  const auto free = options.free_bytes(options.data);
  if (!free) return std::nullopt;
  DiskRoom::Look look{.disk_bytes = *free};
  if (auto reader = store->readers().borrow(); reader.ok())
    if (const auto space = RetentionStore(**reader).space(); space.ok()) look.file_bytes = space->free_bytes;
  return look;
}

void ServerParts::noteRoom(const std::optional<DiskRoom::Look>& look) {
  if (!look) return;  // the previous look still counts
  DiskRoom& room = context->limits.disk_room;
  const RoomLevel before = room.level();
  room.look(*look);
  if (const RoomLevel now = room.level(); now != before)
    logEvent(now == RoomLevel::kPlenty ? LogLevel::kInfo : LogLevel::kWarning, "disk_room",
             {{"level", nameOf(now)}, {"left_bytes", room.leftBytes()}, {"text", room.text()}});
}

/// Looks at the disk and sets what is refused. A read-only server ends when there is room, so that it is
/// restarted for writing.
Task<> ServerParts::roomLoop() {
  while (!stopping) {
    room_timer.expires_after(options.room_every);
    co_await room_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    using Seen = std::optional<DiskRoom::Look>;
    std::function<Result<Seen>()> look = [this]() -> Result<Seen> {
      (void)store->storeAuditHead();
      (void)store->keepAcknowledged();
      return measureRoom();
    };
    const auto looked = co_await offload(room_worker, std::move(look));
    if (stopping) co_return;
    const Seen seen = looked.ok() ? *looked : std::nullopt;
    noteRoom(seen);
    // a disk that refuses writes although it has room (a quota) would refuse again
    if (!store->readOnly() || !seen || context->limits.disk_room.level() == RoomLevel::kNoChunks ||
        seen->disk_bytes < free_at_start + kMadeRoom)
      continue;
    exit_code = kExitFailed;
    beginStop("there is room on the disk again: start the server again, for writing");
  }
}

/// Detects clients that have hung up, so that work waiting for its turn is not done for them.
Task<> ServerParts::hangUpLoop() {
  while (!stopping) {
    hang_up_timer.expires_after(kHangUpPeriod);
    co_await hang_up_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    for (const auto& [id, connection] : context->connections) {
      if (connection->hasRequests() || connection->isLoggingIn()) connection->checkHangUp();
    }
    if (web) web->checkHangUps();
    // those that wait for room check whether their client is still there
    context->in_flight.reply_room->notify();
    context->in_flight.decoded_room->notify();
  }
}

/// Logs how many lines were omitted, including those of closed connections.
Task<> ServerParts::linesLoop() {
  while (!stopping) {
    lines_timer.expires_after(kLinesPeriod);
    co_await lines_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    const std::int64_t now_ns = steadyNowNs();
    context->limits.lines.reportOmitted(now_ns);
    context->clock_offsets.reportOmitted(now_ns);
  }
}

/// With several servers, each keeps a list of all erasures beside its keys, and reports to its stations
/// backups made at another server.
Task<> ServerParts::erasuresLoop() {
  std::string known;  // when the newest verified backup was made; empty: no backup
  while (!stopping) {
    erasures_timer.expires_after(options.erasures_every);
    co_await erasures_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    std::function<Status()> work = [this] { return store->service().erasures().completeList(); };
    if (const Status done = co_await offload(slow_workers, std::move(work)); !done.ok())
      logEvent(LogLevel::kWarning, "erasures_not_listed", {{"text", done.error().message}});
    std::function<Result<std::string>()> newest = [this]() -> Result<std::string> {
      ASSIGN_OR_RETURN(auto reader, store->readers().borrow());
      ASSIGN_OR_RETURN(const auto made, MetaStore(*reader).get("backup_unix_ns"));
      return made.value_or("");
    };
    const auto backup = co_await offload(workers, std::move(newest));
    if (stopping) co_return;
    if (!backup.ok()) continue;
    if (known != *backup) sendSafe(*context);
    known = *backup;
  }
}

/// For one of several servers on a database: checks all accounts in use while changes are not heard, and
/// removes expired log-in state.
Task<> ServerParts::accessLoop() {
  std::int64_t tidied_ns = steadyNowNs();
  while (!stopping) {
    access_timer.expires_after(kAccessPeriod);
    co_await access_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    stepUnheardAccess(*context, options.token_lifetime);
    if (steadyNowNs() - tidied_ns < std::chrono::nanoseconds(kTidyPeriod).count()) continue;
    tidied_ns = steadyNowNs();
    context->logins.state->tidy();
  }
}

/// Periodic work between this server and the lab's others.
Task<> ServerParts::remoteLoop() {
  while (!stopping) {
    remote_timer.expires_after(kRemotePeriod);
    co_await remote_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    remote->step();
  }
}

/// Reports to systemd that this thread still runs; systemd kills and restarts a server that hangs.
Task<> ServerParts::watchdogLoop(std::chrono::microseconds period) {
  while (!stopping) {
    notifyManager("WATCHDOG=1");
    watchdog_timer.expires_after(period);
    co_await watchdog_timer.async_wait(kUseTuple);
  }
}

}  // namespace needlelab
