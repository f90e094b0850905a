/// The server of the herd: a program on a folder with many stations, killed and started again.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/wire/tls.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

class HerdServer {
 public:
  /// Makes the folder and `stations` keys, then starts the program.
  explicit HerdServer(std::size_t stations);
  /// On the same port as before.
  void start();
  void kill();
  /// SIGTERM; the exit code.
  int stop();
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] const TlsContext& tls() const { return tls_; }
  [[nodiscard]] const std::string& key(std::size_t station) const { return keys_[station]; }
  [[nodiscard]] static std::string nameOf(std::size_t station) { return "herd-" + std::to_string(station); }
  [[nodiscard]] std::string said() const { return process_->said(); }
  [[nodiscard]] pid_t pid() const { return process_->pid(); }

 private:
  TempFolder folder_;
  std::vector<std::string> keys_;
  TlsContext tls_;
  std::unique_ptr<Process> process_;
  std::uint16_t port_ = 0;
};

}  // namespace needlelab::test
