/// Live data between servers over core NATS, by libnats.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/wire/asio.h"
#include "server/together/live_carrier.h"

namespace needlelab {

struct NatsSettings {
  std::string address;       ///< parseNatsAddress
  std::filesystem::path ca;  ///< with tls://, the authority of the servers' certificates; empty: the system's
  std::filesystem::path user;  ///< readNatsUser; empty: no user
  std::size_t queued_items = 16'384,
              queued_bytes = 4u << 20;  ///< in each direction, for frames and for the rest
};

/// Connects on its own thread and retries without end, so libnats never blocks the network's thread. Each
/// connection is a new one, so that nothing queued in an old one is sent late.
class NatsCarrier : public LiveCarrier {
 public:
  /// Checks the settings and reads the files; does not connect yet. `network`: runs on the network's thread.
  /// Errors: kInvalidInput; always in a build without libnats.
  static Result<std::unique_ptr<NatsCarrier>> make(asio::any_io_executor network, NatsSettings settings);

  /// `lab` and `server` are names in subjects. The listener must outlive stop().
  virtual void start(Listener& listener, const std::string& lab, const std::string& server) = 0;
  /// Sends what was published, for at most a second, and ends the connection; the listener is not called
  /// afterwards. The destructor does the same.
  virtual void stop() = 0;
};

}  // namespace needlelab
