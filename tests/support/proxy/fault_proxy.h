/// A bad network in front of a server, in the test's own process. The proxy forwards every connection on its
/// port to the server; a script defines the faults.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <thread>

#include "common/wire/asio.h"
#include "tests/support/proxy/connection_script.h"

namespace needlelab::test {

class FaultConnection;

/// Counters so far.
struct ProxyCounts {
  std::uint64_t connections = 0;               ///< accepted
  std::uint64_t open = 0;                      ///< of these, open now; including half-open ones
  std::uint64_t bytes_up = 0, bytes_down = 0;  ///< passed on
  std::uint64_t cuts = 0;                      ///< by the proxy: scripts and cutAll together
  std::uint64_t silent = 0;                    ///< … of them half-open
  std::uint64_t stalls = 0, corrupted = 0, refused = 0, late = 0, duplicates = 0;
};

/// Thread: its own; all public functions from any thread.
class FaultProxy {
 public:
  /// `script(n, random)` gives the script of the n-th connection, from 0. `seed` drives the jitter and the
  /// scripts' random choices.
  using Scripts = std::function<ConnectionScript(std::uint64_t n, Random& random)>;
  explicit FaultProxy(std::uint16_t server_port, std::uint64_t seed = 1, Scripts scripts = {});
  ~FaultProxy();
  FaultProxy(const FaultProxy&) = delete;
  FaultProxy& operator=(const FaultProxy&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// Sets the script for new connections.
  void setScripts(Scripts scripts);
  /// Sets the server's address for new connections: the server may have moved.
  void setServer(std::uint16_t server_port);
  /// Ends all open connections; returns when this is done.
  void cutAll(Cut how);
  /// While true nothing passes on any connection, and none ends.
  void stallAll(bool stalled);
  /// While true new connections are reset at once.
  void refuseAll(bool refused);
  [[nodiscard]] ProxyCounts counts() const;

 private:
  friend class FaultConnection;
  Task<> accept();
  void forget(std::uint64_t id);
  void onThread(const std::function<void()>& work) const;

  mutable asio::io_context io_{1};
  Tcp::acceptor acceptor_;
  std::uint16_t port_, server_port_;
  Random random_;
  Scripts scripts_;
  bool stalled_ = false, refused_ = false;
  ProxyCounts counts_;
  std::map<std::uint64_t, std::shared_ptr<FaultConnection>> open_;
  std::thread thread_;
};

}  // namespace needlelab::test
