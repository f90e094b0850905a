/// needlelab-server: everything between a listening socket and the store. Protocol: proto/README.md; threads:
/// server/README.md.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/time_source.h"
#include "common/wire/channel.h"
#include "server/live/context.h"
#include "server/live/monitor.h"
#include "server/nats/nats_carrier.h"
#include "server/web/web_server.h"

namespace needlelab {

/// Live data between the servers of a lab (server/live/remote_live.h).
struct LiveServersOptions {
  NatsSettings nats;  ///< an empty address: the lab has one server
  std::string lab;    ///< the lab's name in subjects; empty: the database's id (PostgreSQL)
  std::string name;   ///< this server's among the lab's; empty: the machine's name
};

struct ServerOptions {
  std::filesystem::path data;  ///< DIR: database, tls/, lock
  std::string store_url;       ///< as Store::Options
  bool together = false;       ///< as Store::Options
  /// What an ack must survive. kDiskLoss: an ack makes a chunk Safe, too.
  Durability least_durability = Durability::kNothing;
  AccessListener::Settings access;        ///< of a server that works together with others
  std::string listen = "127.0.0.1:7750";  ///< HOST:PORT; port 0 picks one
  int listen_fd = -1;                     ///< use this listening socket instead of `listen`; takes ownership
  std::string metrics;                    ///< HOST:PORT for GET /metrics and /healthz; empty: none
  std::filesystem::path metrics_port_file;  ///< written with the port of `metrics`; empty: none
  WebSettings web;                          ///< the port for browsers
  bool web_optional = false;                ///< when the port of `web` is taken, the server runs without it
  /// Room on the folder's disk. With less, no chunk is stored; with less than four times as much, no session
  /// is begun; with less than an eighth at the start, the database is opened read-only. A new folder needs it
  /// whole. 0: nothing is refused (server/live/disk_room.h).
  std::uint64_t min_free_bytes = 64u << 20;
  FreeBytes free_bytes = freeBytesOf;           ///< for tests: how much is free
  std::chrono::milliseconds room_every{1'000};  ///< between two looks at the disk
  StationQuotas::Settings quotas;
  PeopleShares::Settings shares;
  MonitorSettings monitor;
  std::filesystem::path backup_key;     ///< the file of the key that encrypts backups; empty: none
  std::filesystem::path port_file;      ///< written after listening; empty: none
  std::vector<std::string> host_names;  ///< for the certificate, in addition to those found automatically
  std::vector<std::string> ca_domains;  ///< for an authority that is made now (CertificateNames::domains)
  std::chrono::milliseconds certificate_every{60'000};  ///< between two looks at the certificate; 0: none
  bool handle_signals = false;                          ///< SIGTERM and SIGINT end run()
  std::size_t max_connections = 4096;
  std::chrono::milliseconds drain{10'000};  ///< at the end; then the server cuts the remaining connections
  ChannelLimits limits;
  ConnectionBounds bounds;
  HubSettings hub;
  LoginGuard::Settings guard;
  Admission::Settings admission;  ///< its max_connections is the one above
  HandshakeTurns::Settings handshakes;
  std::chrono::milliseconds token_lifetime = TokenLimits{}.lifetime;
  TimeSource* token_time = &machineTime();  ///< by which tokens end that are here; outlives the server
  DbWriter::Options writer;
  std::chrono::milliseconds erasures_every{60'000};  ///< between two looks for others' erasures (together)
  LiveServersOptions live;                           ///< the lab's other servers; without an address: none
  std::chrono::milliseconds heap_every{60'000};   ///< interval at which free memory is returned to the system
  std::chrono::minutes retention_first{10};       ///< from the start to the first run of retention
  std::chrono::minutes retention_every{24 * 60};  ///< between two runs; 0: only on request
};

class Server {
 public:
  /// Creates or opens the folder, makes certificates, listens, writes the port file. Errors: kInvalidInput
  /// (options), kUnavailable (port taken, folder in use), and those of Store::open.
  static Result<std::unique_ptr<Server>> start(ServerOptions options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Serves until stop(), a signal, or a failure of the store. Returns the exit code. Call it once.
  int run();

  /// Stops accepting, commits the received chunks, sends Bye; then run() returns. Thread: any. May be called
  /// repeatedly.
  void stop();

  [[nodiscard]] std::uint16_t port() const;
  /// The port of `metrics`; 0: not served.
  [[nodiscard]] std::uint16_t metricsPort() const;
  /// The port of `web`; 0: not served.
  [[nodiscard]] std::uint16_t webPort() const;
  [[nodiscard]] std::filesystem::path caFile() const;
  /// For tests, before run() or after it.
  [[nodiscard]] Store& store();
  [[nodiscard]] const ServerCounters& counters() const;
  [[nodiscard]] const WebCounters& webCounters() const;

 private:
  struct Parts;
  explicit Server(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace needlelab
