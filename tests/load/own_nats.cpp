#include "tests/load/own_nats.h"

#include <unistd.h>

#include <exception>

#include "tests/nats/nats_server.h"
#include "tests/operations/prometheus_text.h"

namespace needlelab::test {

OwnNats::OwnNats() = default;
OwnNats::~OwnNats() = default;

Status OwnNats::start() {
  if (::access(NEEDLELAB_NATS_SERVER, X_OK) != 0)
    return Error{ErrorCode::kFailed,
                 NEEDLELAB_NATS_SERVER " is missing: install it with deploy/setup --faculty"};
  try {
    process_ = std::make_unique<NatsServerProcess>("http: \"127.0.0.1:-1\"\n");
    process_->start();
  } catch (const std::exception& error) {
    return Error{ErrorCode::kFailed, error.what()};
  }
  return {};
}

std::string OwnNats::url() const {
  return process_->url();
}

ProcessUse OwnNats::use() const {
  ProcessUse use = useOf(process_->pid());
  use.name = "NATS";
  addVarz(use, httpSend(static_cast<std::uint16_t>(process_->monitoringPort()),
                        "GET /varz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n",
                        std::chrono::seconds(5))
                   .body);
  return use;
}

}  // namespace needlelab::test
