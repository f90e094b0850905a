/// The run's own nats-server, a child process: core NATS without TLS and users, as the servers of one
/// machine.
#pragma once

#include <memory>
#include <string>

#include "common/base/result.h"
#include "tests/load/process_use.h"

namespace needlelab::test {

class NatsServerProcess;

/// Thread: one.
class OwnNats {
 public:
  OwnNats();
  ~OwnNats();
  /// On free ports. Errors: kFailed: it is not installed, or did not start.
  Status start();
  [[nodiscard]] std::string url() const;
  /// Since it began.
  [[nodiscard]] ProcessUse use() const;

 private:
  std::unique_ptr<NatsServerProcess> process_;
};

}  // namespace needlelab::test
