/// A running server on the test's data folder, and needlelab-admin logged in to it.
#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/server.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab::test {

/// Every user has the password in the file `password_`.
class AdminServerTest : public AdminTest {
 protected:
  void TearDown() override { stop(); }
  void addPerson(const std::string& name, const std::string& role) const {
    good({"user", "add", name, "--role", role, "--password-file", password_});
  }
  void start() {
    ServerOptions options;
    options.data = data();
    options.listen = "127.0.0.1:0";
    auto server = Server::start(options);
    ASSERT_OK(server);
    server_ = std::move(*server);
    address_ = "127.0.0.1:" + std::to_string(server_->port());
    ca_ = server_->caFile().string();
    thread_ = std::thread([this] { EXPECT_EQ(server_->run(), 0); });
  }
  /// Does nothing when no server runs.
  void stop() {
    if (server_) server_->stop();
    if (thread_.joinable()) thread_.join();
    server_.reset();
  }
  /// Asks the server that was started last, with `password_`.
  Run as(const std::string& user, std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(),
                     {"--server", address_, "--ca", ca_, "--user", user, "--password-file", password_});
    return run(arguments);
  }

  std::string password_ = folder.write("pw", "correct horse").string();
  std::unique_ptr<Server> server_;
  std::string address_, ca_;

 private:
  std::thread thread_;
};

}  // namespace needlelab::test
