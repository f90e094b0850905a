#include "tests/netfaults/herd_server.h"

#include "common/base/files.h"
#include "server/server.h"

namespace needlelab::test {

using namespace std::chrono_literals;

HerdServer::HerdServer(std::size_t stations) {
  {
    ServerOptions options;
    options.data = folder_.path() / "data";
    options.listen = "127.0.0.1:0";
    auto server = Server::start(std::move(options));
    if (!server.ok()) throw std::runtime_error(server.error().message);
    for (std::size_t i = 0; i < stations; ++i) {
      pb::Request request;
      request.mutable_add_station()->set_name(nameOf(i));
      Outcome outcome = (*server)->store().service().execute({"root", pb::ADMINISTRATOR}, request);
      if (outcome.error) throw std::runtime_error(outcome.error->message);
      keys_.push_back(outcome.reply.station_key().key());
    }
    tls_ = *makeClientTls((*server)->caFile());
  }
  start();
}

void HerdServer::start() {
  const auto file = folder_.path() / "port";
  std::filesystem::remove(file);
  process_ =
      std::make_unique<Process>("needlelab-server",
                                std::vector<std::string>{"--data", folder_.path() / "data", "--listen",
                                                         "127.0.0.1:" + std::to_string(port_), "--port-file",
                                                         file, "--log-level", "warning"},
                                folder_.path() / "server.log");
  std::string text;
  const bool up = eventually(
      [&] {
        auto read = readWholeFile(file);
        if (read.ok()) text = *read;
        return !text.empty();
      },
      60s);
  if (!up) throw std::runtime_error("the server did not start: " + process_->said());
  port_ = static_cast<std::uint16_t>(std::stoi(text));
}

void HerdServer::kill() {
  process_->signal(SIGKILL);
  (void)process_->wait(10s);
}

int HerdServer::stop() {
  process_->signal(SIGTERM);
  return process_->wait(60s).value_or(-1000);
}

}  // namespace needlelab::test
