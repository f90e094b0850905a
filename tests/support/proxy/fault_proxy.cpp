#include "tests/support/proxy/fault_proxy.h"

#include <boost/asio/post.hpp>
#include <future>
#include <utility>

#include "tests/support/proxy/fault_connection.h"

namespace needlelab::test {

FaultProxy::FaultProxy(std::uint16_t server_port, std::uint64_t seed, Scripts scripts)
    : acceptor_(io_, Tcp::endpoint(asio::ip::address_v4::loopback(), 0)),
      port_(acceptor_.local_endpoint().port()),
      server_port_(server_port),
      random_(seed),
      scripts_(std::move(scripts)) {
  asio::co_spawn(io_, accept(), rethrow);
  thread_ = std::thread([this] { io_.run(); });
}

FaultProxy::~FaultProxy() {
  // in one go: without an acceptor and connections the thread has nothing to wait for and ends
  onThread([this] {
    boost::system::error_code ignored;
    acceptor_.close(ignored);
    const auto all = open_;
    for (const auto& [id, connection] : all) connection->cut(Cut::kReset);
  });
  io_.stop();
  thread_.join();
}

Task<> FaultProxy::accept() {
  for (;;) {
    auto [error, socket] = co_await acceptor_.async_accept(kUseTuple);
    if (error) co_return;
    const std::uint64_t id = counts_.connections++;
    const ConnectionScript script = scripts_ ? scripts_(id, random_) : ConnectionScript{};
    for (const auto& [older, connection] : open_) connection->overtaken();
    auto connection = std::make_shared<FaultConnection>(*this, id, std::move(socket), script, random_.bits());
    open_.emplace(id, connection);
    asio::co_spawn(io_, FaultConnection::run(std::move(connection), server_port_), rethrow);
  }
}

void FaultProxy::forget(std::uint64_t id) {
  open_.erase(id);
}

void FaultProxy::onThread(const std::function<void()>& work) const {
  std::promise<void> done;
  asio::post(io_, [&] {
    work();
    done.set_value();
  });
  done.get_future().wait();
}

void FaultProxy::setScripts(Scripts scripts) {
  onThread([&] { scripts_ = std::move(scripts); });
}

void FaultProxy::setServer(std::uint16_t server_port) {
  onThread([&] { server_port_ = server_port; });
}

void FaultProxy::cutAll(Cut how) {
  onThread([&] {
    const auto all = open_;  // cutting removes them from the list
    for (const auto& [id, connection] : all) connection->cut(how);
  });
}

void FaultProxy::stallAll(bool stalled) {
  onThread([&] { stalled_ = stalled; });
}

void FaultProxy::refuseAll(bool refused) {
  onThread([&] { refused_ = refused; });
}

ProxyCounts FaultProxy::counts() const {
  ProxyCounts counts;
  onThread([&] {
    counts = counts_;
    counts.open = open_.size();
  });
  return counts;
}

}  // namespace needlelab::test
