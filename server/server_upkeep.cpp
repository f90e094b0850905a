// What a server does by the clock: retention, free memory, its certificate, the disk's room, peers who have
// gone, log lines that were left out, erasures at other servers, systemd's watchdog.
#include <malloc.h>

#include <boost/asio/post.hpp>
#include <chrono>
#include <functional>
#include <utility>

#include "common/base/clock.h"
#include "db/retention_store.h"
#include "db/schema.h"
#include "server/base/log.h"
#include "server/live/connection.h"
#include "server/live/remote_access.h"
#include "server/live/request_effects.h"
#include "server/server_parts.h"
#include "server/service_manager.h"

namespace needlelab {
namespace {

/// A read-only server believes that somebody made room when so much more is free than at its start.
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
  // of the context, not of the files: a command may replace them at any time
  ASSIGN_OR_RETURN(const auto facts, shownCertificate(current.tls));
  current.sha256 = facts.sha256;
  current.clock_fault = clockFault(files);
  return current;
}

Task<> Server::Parts::retentionLoop() {
  auto wait = options.retention_first;
  // beginStop cancels the timer once: a run that ends later must not start it again
  while (!stopping) {
    retention_timer.expires_after(std::exchange(wait, options.retention_every));
    co_await retention_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    std::function<Result<std::optional<pb::RetentionReport>>()> work = [this] {
      yieldToOthers();
      return store->service().dailyRetention();
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
/// memory; afterwards the C library keeps the gaps between live blocks, so that without this the heap would
/// stay as large as after the largest burst.
Task<> Server::Parts::heapLoop() {
  while (!stopping) {
    heap_timer.expires_after(options.heap_every);
    co_await heap_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    asio::post(workers, [] { ::malloc_trim(0); });
  }
}

/// Renews the certificate in time and takes one that a technician made (certificates.h). Connections that are
/// there keep theirs.
Task<> Server::Parts::certificateLoop() {
  std::string fault;
  while (!stopping) {
    certificate_timer.expires_after(options.certificate_every);
    co_await certificate_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    std::function<Result<ServerCertificate>()> work = [this] { return currentCertificate(files, names); };
    const auto now = co_await offload(workers, std::move(work));
    if (stopping) co_return;
    // once for each fault: the old certificate serves on
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

/// Thread: any; blocks while the disk hangs. Nothing: the system does not tell.
std::optional<DiskRoom::Look> Server::Parts::lookAtRoom() const {
  const auto free = options.free_bytes(options.data);
  if (!free) return std::nullopt;
  DiskRoom::Look look{.disk_bytes = *free};
  if (auto reader = store->readers().borrow(); reader.ok())
    if (const auto space = RetentionStore(**reader).space(); space.ok()) look.file_bytes = space->free_bytes;
  return look;
}

void Server::Parts::noteRoom(const std::optional<DiskRoom::Look>& look) {
  if (!look) return;  // what was seen before still counts
  DiskRoom& room = context->disk_room;
  const RoomLevel before = room.level();
  room.look(*look);
  if (const RoomLevel now = room.level(); now != before)
    logEvent(now == RoomLevel::kPlenty ? LogLevel::kInfo : LogLevel::kWarning, "disk_room",
             {{"level", nameOf(now)}, {"left_bytes", room.leftBytes()}, {"text", room.text()}});
}

/// Looks at the disk and sets what is refused. A read-only server ends when there is room: whoever started it
/// starts it again, for writing.
Task<> Server::Parts::roomLoop() {
  while (!stopping) {
    room_timer.expires_after(options.room_every);
    co_await room_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    using Seen = std::optional<DiskRoom::Look>;
    std::function<Result<Seen>()> look = [this]() -> Result<Seen> {
      (void)store->keepAuditHead();
      (void)store->keepAcknowledged();
      return lookAtRoom();
    };
    const auto looked = co_await offload(room_worker, std::move(look));
    if (stopping) co_return;
    const Seen seen = looked.ok() ? *looked : std::nullopt;
    noteRoom(seen);
    // a disk that refuses although it has room (a quota) would refuse again
    if (!store->readOnly() || !seen || context->disk_room.level() == RoomLevel::kNoChunks ||
        seen->disk_bytes < free_at_start + kMadeRoom)
      continue;
    exit_code = kExitFailed;
    beginStop("there is room on the disk again: start the server again, for writing");
  }
}

/// Work that waits for its turn is not done for those who have gone meanwhile: looks for them.
Task<> Server::Parts::hangUpLoop() {
  while (!stopping) {
    hang_up_timer.expires_after(kHangUpPeriod);
    co_await hang_up_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    for (const auto& [id, connection] : context->connections) {
      if (connection->hasRequests() || connection->isLoggingIn()) connection->lookForHangUp();
    }
    if (web) web->lookForHangUps();
    // whoever waits for room looks whether the asker is still there
    context->reply_room->notify();
    context->decoded_room->notify();
  }
}

/// Says how many lines the log was spared, also of those who have gone.
Task<> Server::Parts::linesLoop() {
  while (!stopping) {
    lines_timer.expires_after(kLinesPeriod);
    co_await lines_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    const std::int64_t now_ns = steadyNowNs();
    context->lines.sayLeftOut(now_ns);
    context->clock_offsets.sayLeftOut(now_ns);
  }
}

/// Of servers that work together each keeps a list of all erasures beside its keys, and tells its stations of
/// backups that were made at another one.
Task<> Server::Parts::erasuresLoop() {
  std::string known;  // when the newest verified backup was made; empty: there is none
  while (!stopping) {
    erasures_timer.expires_after(options.erasures_every);
    co_await erasures_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    std::function<Status()> work = [this] { return store->service().completeErasureList(); };
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
    if (known != *backup) tellSafe(*context);
    known = *backup;
  }
}

/// Of a server of several on one database: looks at all accounts in use while nobody tells of changes, and
/// removes log-in state that is over.
Task<> Server::Parts::accessLoop() {
  std::int64_t tidied_ns = steadyNowNs();
  while (!stopping) {
    access_timer.expires_after(kAccessPeriod);
    co_await access_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    stepUnheardAccess(*context, options.token_lifetime);
    if (steadyNowNs() - tidied_ns < std::chrono::nanoseconds(kTidyPeriod).count()) continue;
    tidied_ns = steadyNowNs();
    context->login->tidy();
  }
}

/// What is due between this server and the lab's others.
Task<> Server::Parts::remoteLoop() {
  while (!stopping) {
    remote_timer.expires_after(kRemotePeriod);
    co_await remote_timer.async_wait(kUseTuple);
    if (stopping) co_return;
    remote->step();
  }
}

/// Tells systemd that this thread still runs: systemd kills and restarts a server that hangs.
Task<> Server::Parts::watchdogLoop(std::chrono::microseconds period) {
  while (!stopping) {
    notifyManager("WATCHDOG=1");
    watchdog_timer.expires_after(period);
    co_await watchdog_timer.async_wait(kUseTuple);
  }
}

}  // namespace needlelab
