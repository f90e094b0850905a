/// Live data between servers over core NATS, by libnats.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/wire/asio.h"
#include "server/live/live_carrier.h"

namespace needlelab {

struct NatsSettings {
  std::string address;         ///< parseNatsAddress
  std::filesystem::path ca;    ///< with tls://, who may sign the servers' certificates; empty: the system's
  std::filesystem::path user;  ///< readNatsUser; empty: none
  std::size_t queued_items = 16'384,
              queued_bytes = 4u << 20;  ///< in each direction, of frames and of the rest
};

/// Connects on a thread of its own, again and again for as long as it takes; whatever libnats waits for, the
/// network's thread does not. Each connection is a new one, so that nothing of an old one is sent late.
class NatsCarrier : public LiveCarrier {
 public:
  /// Checks the settings and reads the files; connects to nobody yet. `network`: its thread is the network's.
  /// Errors: kInvalidInput, in a build without libnats always.
  static Result<std::unique_ptr<NatsCarrier>> make(asio::any_io_executor network, NatsSettings settings);

  /// `lab` and `server` are names in subjects. The listener outlives stop().
  virtual void start(Listener& listener, const std::string& lab, const std::string& server) = 0;
  /// Sends what was published, within a second, and ends the connection; the listener hears nothing more.
  /// The destructor does the same.
  virtual void stop() = 0;
};

}  // namespace needlelab
