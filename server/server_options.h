/// The options that a server is started with.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/time/time_source.h"
#include "common/wire/channel.h"
#include "db/service/start/bootstrap.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/admission.h"
#include "server/live/limits/disk_room.h"
#include "server/live/limits/handshake_turns.h"
#include "server/live/limits/limits.h"
#include "server/live/limits/quotas.h"
#include "server/live/login/login_guard.h"
#include "server/live/login/tokens.h"
#include "server/live/monitor/monitor.h"
#include "server/nats/nats_carrier.h"
#include "server/together/access_listener.h"
#include "server/web/web_server.h"

namespace needlelab {

/// Live data between the servers of a lab (server/together/remote_live.h).
struct LiveServersOptions {
  NatsSettings nats;  ///< without an address: the lab has one server
  std::string lab;    ///< the lab's name in subjects; empty: the database's id (PostgreSQL)
  std::string name;   ///< this server's name in the lab; empty: the machine's name
};

struct ServerOptions {
  std::filesystem::path data;  ///< DIR: database, tls/, lock
  std::string store_url;       ///< as in Store::Options
  bool together = false;       ///< as in Store::Options
  /// What an ack must survive. With kDiskLoss, an ack also makes a chunk Safe.
  Durability min_durability = Durability::kNothing;
  AccessListener::Settings access;        ///< for a server that works together with others
  std::string listen = "127.0.0.1:7750";  ///< HOST:PORT; port 0 picks one
  int listen_fd = -1;                     ///< use this listening socket instead of `listen`; takes ownership
  std::string metrics;                    ///< HOST:PORT for GET /metrics and /healthz; empty: not served
  std::filesystem::path metrics_port_file;  ///< the port of `metrics` is written to it; empty: no file
  WebSettings web;                          ///< the port for browsers
  bool web_optional = false;                ///< if the port of `web` is taken, run without it
  /// Room on the folder's disk. With less, no chunk is stored; with less than four times as much, no session
  /// is started; with less than an eighth at the start, the database is opened read-only. A new folder needs
  /// all of it. 0: nothing is refused (server/live/limits/disk_room.h).
  std::uint64_t min_free_bytes = 64u << 20;
  FreeBytes free_bytes = freeBytesOf;           ///< replaced by tests
  std::chrono::milliseconds room_every{1'000};  ///< between two looks at the disk
  StationQuotas::Settings quotas;
  PeopleShares::Settings shares;
  MonitorSettings monitor;
  std::filesystem::path backup_key;     ///< the file with the key that encrypts backups; empty: no encryption
  std::filesystem::path port_file;      ///< written after listening; empty: no file
  std::vector<std::string> host_names;  ///< for the certificate, in addition to those found automatically
  std::vector<std::string> ca_domains;  ///< for an authority created now (CertificateNames::domains)
  std::chrono::milliseconds certificate_every{60'000};  ///< between two checks of the certificate; 0: never
  bool handle_signals = false;                          ///< SIGTERM and SIGINT end run()
  std::size_t max_connections = 4096;
  std::chrono::milliseconds drain{10'000};  ///< at the end; then the remaining connections are cut
  ChannelLimits limits;
  ConnectionBounds bounds;
  HubSettings hub;
  LoginGuard::Settings guard;
  Admission::Settings admission;  ///< max_connections is taken from above
  HandshakeTurns::Settings handshakes;
  std::chrono::milliseconds token_lifetime = TokenLimits{}.lifetime;
  TimeSource* token_time = &machineTime();  ///< the clock for tokens kept in memory; must outlive the server
  DbWriter::Options writer;
  std::chrono::milliseconds erasures_every{60'000};  ///< between two checks for others' erasures (together)
  LiveServersOptions live;                           ///< the lab's other servers; without an address: none
  std::chrono::milliseconds heap_every{60'000};   ///< interval at which free memory is returned to the system
  std::chrono::minutes retention_first{10};       ///< from the start to the first retention run
  std::chrono::minutes retention_every{24 * 60};  ///< between two runs; 0: only on request
};

}  // namespace needlelab
