/// A skills lab of real programs over TLS on loopback: one server on a fresh folder, one station, and access
/// to the stored sessions.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/net/link/blocking_client.h"
#include "client/net/spool/spool.h"
#include "common/gesture/chunk.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {

/// A session as stored in the database.
struct StoredSession {
  pb::SessionInfo info;
  std::vector<std::string> chunks;
  std::vector<GestureSample> samples;
};

class Lab {
 public:
  /// `store`: the address of its database, as for --store; empty: in its folder.
  explicit Lab(const std::string& store = {});
  ~Lab() = default;

  /// More arguments for the next start of the server.
  std::vector<std::string> server_arguments;
  std::string listen_host = "127.0.0.1";
  void startServer();
  void killServer();
  /// SIGSTOP: the server hangs, SIGCONT: it continues.
  void signalServer(int number) { server_->signal(number); }
  /// Sends SIGTERM; returns the exit code.
  int stopServer();
  /// Command line for a station of this lab, plus these arguments; `spool` replaces the lab's own.
  [[nodiscard]] std::vector<std::string> stationArguments(const std::vector<std::string>& more,
                                                          const std::filesystem::path& spool = {}) const;
  /// Starts a station of this lab for trainee tom, plus these arguments; its log is `name`.log.
  std::unique_ptr<Process> startStation(const std::string& name, const std::vector<std::string>& more);
  /// That station's final summary.
  [[nodiscard]] nlohmann::json summary(const std::string& name) const;

  [[nodiscard]] Result<BlockingClient> instructor() const;
  /// Newest first.
  [[nodiscard]] std::vector<pb::SessionInfo> sessions() const;
  [[nodiscard]] StoredSession stored(const std::string& session_id) const;
  /// The server's own check of a session's chunks and hash.
  [[nodiscard]] bool verifies(const std::string& session_id) const;

  /// Runs needlelab-admin on the stopped server's folder with these arguments; returns the exit code.
  [[nodiscard]] int admin(const std::vector<std::string>& arguments) const;

  /// A session as recorded in the spool.
  [[nodiscard]] static std::vector<std::string> spooledChunks(const std::filesystem::path& spool,
                                                              const std::string& session_id);
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }

 private:
  [[nodiscard]] pb::Reply ask(const pb::Request& request) const;
  TempFolder folder_;
  std::unique_ptr<Process> server_;
  int port_ = 0;
};

/// A measure from a row of a summary or results file; -1 if missing.
[[nodiscard]] double scoreOf(const nlohmann::json& row, const std::string& measure);

}  // namespace needlelab::test
