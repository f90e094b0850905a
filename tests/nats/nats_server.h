/// A nats-server of the test's own on a free loopback port: started, killed, started again.
#pragma once

#include <csignal>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "tests/integration/process.h"
#include "tests/support/patience.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

class NatsServerProcess {
 public:
  /// `config`: of nats-server, without a port; empty: anybody may do anything. Does not start it.
  explicit NatsServerProcess(const std::string& config = {}) {
    if (!config.empty()) folder_.write("nats.conf", config);
  }

  /// Its first start picks a free port, which it keeps.
  void start() {
    std::vector<std::string> arguments = {
        "-a",          "127.0.0.1", "-p", port_ == 0 ? "-1" : std::to_string(port_), "--ports_file_dir",
        folder_.path()};
    if (exists(folder_.path() / "nats.conf"))
      arguments.insert(arguments.end(), {"-c", folder_.path() / "nats.conf"});
    process_ = std::make_unique<Process>(NEEDLELAB_NATS_SERVER, arguments, folder_.path() / "nats.log");
    // written once it listens
    const auto file = folder_.path() / ("nats-server_" + std::to_string(process_->pid()) + ".ports");
    nlohmann::json ports;
    const bool up = eventually([&] {
      const auto text = readWholeFile(file);
      if (!text.ok()) return false;
      ports = nlohmann::json::parse(*text, nullptr, false);
      return ports.is_object() && ports.contains("nats");
    });
    if (!up) throw std::runtime_error("nats-server did not start: " + said());
    port_ = portOf(ports["nats"][0]);
    if (ports.contains("monitoring")) monitoring_port_ = portOf(ports["monitoring"][0]);
  }
  /// SIGKILL.
  void kill() { process_.reset(); }
  void signal(int number) { process_->signal(number); }

  [[nodiscard]] pid_t pid() const { return process_->pid(); }
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] int monitoringPort() const { return monitoring_port_; }  ///< 0: `config` has none
  [[nodiscard]] std::string url(const std::string& scheme = "nats") const {
    return scheme + "://127.0.0.1:" + std::to_string(port_);
  }
  [[nodiscard]] std::string said() const { return process_ ? process_->said() : std::string(); }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }
  TempFolder& files() { return folder_; }

 private:
  static int portOf(const std::string& url) { return std::stoi(url.substr(url.rfind(':') + 1)); }
  TempFolder folder_;
  std::unique_ptr<Process> process_;
  int port_ = 0, monitoring_port_ = 0;
};

}  // namespace needlelab::test
