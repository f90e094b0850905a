/// needlelab-server: everything between a listening socket and the store. Protocol: proto/README.md; threads:
/// server/README.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "common/base/result.h"
#include "server/live/counters.h"
#include "server/server_options.h"

namespace needlelab {

struct ServerParts;

class Server {
 public:
  /// Creates or opens the folder, makes certificates, listens, writes the port file. Errors: kInvalidInput
  /// (options), kUnavailable (port taken, folder in use), and those of Store::open.
  static Result<std::unique_ptr<Server>> start(ServerOptions options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Serves until stop(), a signal, or a failure of the store. Returns the exit code. Call only once.
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
  /// For tests, before or after run().
  [[nodiscard]] Store& store();
  [[nodiscard]] const ServerCounters& counters() const;
  [[nodiscard]] const WebCounters& webCounters() const;

 private:
  explicit Server(std::unique_ptr<ServerParts> parts);
  std::unique_ptr<ServerParts> parts_;
};

}  // namespace needlelab
