/// The objects of one server, for server.cpp (start, run, end) and server_upkeep.cpp (periodic work). Private
/// to this folder.
#pragma once

#include <boost/asio/signal_set.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "common/base/program.h"
#include "common/base/result.h"
#include "common/wire/asio.h"
#include "common/wire/certificates.h"
#include "common/wire/tls.h"
#include "common/wire/tls_folder.h"
#include "server/live/limits/disk_room.h"
#include "server/live/monitor/monitor.h"
#include "server/live/port/server_state.h"
#include "server/nats/nats_carrier.h"
#include "server/server_options.h"
#include "server/together/remote_live.h"

namespace needlelab {

struct ServerCertificate {
  TlsContext tls;
  std::string sha256;
  bool made = false;
  std::string clock_fault;  ///< clockFault()
};

/// The certificate in the files, created or renewed if necessary. Thread: any.
Result<ServerCertificate> currentCertificate(const TlsFiles& files, const CertificateNames& names);

/// Destroyed in reverse order: the pools (joined) before the store, the store (drained) before the
/// io_context.
struct ServerParts {
  explicit ServerParts(ServerOptions given) : options(std::move(given)) {}

  ServerOptions options;
  asio::io_context io{1};
  TlsContext tls;  // for new connections
  TlsFiles files;
  CertificateNames names;
  std::string certificate_sha256;
  std::unique_ptr<Store> store;
  // one of the retention threads runs retention; the other answers further requests and makes dry runs
  asio::thread_pool passwords{1}, logins{kLoginThreads}, parsers{1}, workers{kWorkerThreads},
      closers{kCloserThreads}, views{kViewThreads}, slow_workers{kSlowThreads}, retention_workers{2};
  asio::thread_pool room_worker{1};  // looks at the disk, which may hang
  std::unique_ptr<ServerState> state;
  ServerContext* context = nullptr;      // part of state
  std::unique_ptr<NatsCarrier> carrier;  // with --live
  std::unique_ptr<RemoteLive> remote;    // with --live
  std::optional<Tcp::acceptor> acceptor;
  std::unique_ptr<Monitor> monitor;
  std::shared_ptr<MonitorPort> monitor_port;
  std::shared_ptr<WebServer> web;
  asio::signal_set signals{io};
  asio::steady_timer watchdog_timer{io};
  asio::steady_timer drain_timer{io};
  asio::steady_timer retention_timer{io};
  asio::steady_timer heap_timer{io};
  asio::steady_timer certificate_timer{io};
  asio::steady_timer room_timer{io};
  asio::steady_timer hang_up_timer{io};
  asio::steady_timer lines_timer{io};
  asio::steady_timer erasures_timer{io};
  asio::steady_timer access_timer{io};
  asio::steady_timer remote_timer{io};
  std::uint16_t port = 0;
  std::uint64_t next_id = 1;
  bool stopping = false;
  int exit_code = kExitDone;
  std::uint64_t refused_unlogged = 0;
  std::int64_t refused_logged_ns = 0;
  std::uint64_t free_at_start = 0;

  Task<> signalLoop();
  Task<> drainLoop();
  Task<> watchdogLoop(std::chrono::microseconds period);
  void beginLogins();
  Status startMonitor();
  Task<> retentionLoop();
  Task<> heapLoop();
  Task<> certificateLoop();
  [[nodiscard]] std::optional<DiskRoom::Look> measureRoom() const;
  void noteRoom(const std::optional<DiskRoom::Look>& look);
  Task<> roomLoop();
  Task<> hangUpLoop();
  Task<> linesLoop();
  Task<> erasuresLoop();
  Task<> accessLoop();
  Task<> remoteLoop();
  Status startRemote();
  void accepted(Tcp::socket socket);
  void refuseConnection(const std::string& host);
  void beginStop(const std::string& reason);
};

}  // namespace needlelab
