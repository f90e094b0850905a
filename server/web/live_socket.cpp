#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>
#include <utility>

#include "server/base/http_stream.h"
#include "server/live/counters.h"
#include "server/live/login/login_state.h"
#include "server/web/live_board.h"
#include "server/web/web_server.h"

namespace needlelab {

namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;

namespace {

constexpr std::size_t kMaxFromViewer = 4096;
constexpr std::chrono::milliseconds kGoodbye{1000};

class Viewer : public HttpTakeover, public std::enable_shared_from_this<Viewer> {
 public:
  Viewer(std::shared_ptr<WebServer> server, std::string token, std::string who)
      : server_(std::move(server)),
        token_(std::move(token)),
        who_(std::move(who)),
        deadline_(server_->context().io) {}
  ~Viewer() override { server_->onViewerLeft(who_); }

  void stop() override {
    stopping_ = true;
    server_->board().wakeAll();
  }
  void cut() override {
    stopping_ = cut_ = true;
    if (socket_) plain().close();
    server_->board().wakeAll();
  }

  Task<> serve(HttpStream stream, std::shared_ptr<const Upgrade> request) override {
    socket_.emplace(std::move(stream));
    plain().expires_never();
    websocket::stream_base::timeout times =
        websocket::stream_base::timeout::suggested(beast::role_type::server);
    times.idle_timeout = server_->settings().live_idle_timeout;
    times.keep_alive_pings = true;
    socket_->set_option(times);
    socket_->read_message_max(kMaxFromViewer);
    auto [failed] = co_await socket_->async_accept(*request, kUseTuple);
    if (failed) co_return;
    WebCounters& web = server_->context().web;
    ++web.live_open;
    server_->board().onViewerJoined();
    reading_ = true;
    asio::co_spawn(server_->context().io, readAll(shared_from_this()), rethrow);
    co_await sendAll();
    // the reader ends when the socket closes
    while (reading_) {
      asio::steady_timer pause(server_->context().io, std::chrono::milliseconds(20));
      co_await pause.async_wait(kUseTuple);
    }
    server_->board().onViewerLeft();
    --web.live_open;
  }

 private:
  PlainHttpStream& plain() { return socket_->next_layer().next_layer(); }

  /// Reads, which also handles pings, pongs and the close. Any message means that a person is looking at the
  /// page, and extends the session.
  Task<> readAll(std::shared_ptr<Viewer> /*kept alive by it*/) {
    beast::flat_buffer buffer(kMaxFromViewer);
    for (;;) {
      buffer.clear();
      auto [error, count] = co_await socket_->async_read(buffer, kUseTuple);
      (void)count;
      if (error) break;
      server_->context().logins.state->renew(token_);
    }
    over_ = true;
    reading_ = false;
    server_->board().wakeAll();
  }

  Task<> sendAll() {
    LiveBoard& board = server_->board();
    std::uint64_t sent = 0;
    websocket::close_reason reason(websocket::close_code::going_away, "the server is shutting down");
    socket_->text(true);
    while (!stopping_ && !over_) {
      const std::chrono::nanoseconds left = co_await server_->context().logins.state->left(token_);
      if (stopping_ || over_) break;
      if (left.count() <= 0) {
        reason = websocket::close_reason(websocket::close_code::policy_error, "the session has ended");
        break;
      }
      const auto text = board.newest();
      if (text == nullptr || board.number() == sent) {
        co_await board.wait();
        continue;
      }
      sent = board.number();
      arm(server_->settings().live_write_timeout, true);
      auto [error, count] = co_await socket_->async_write(asio::buffer(*text), kUseTuple);
      (void)count;
      deadline_.cancel();
      if (error) over_ = true;
    }
    if (over_ || cut_) {
      plain().close();
      co_return;
    }
    // do not wait for a viewer that does not answer the close
    arm(kGoodbye, false);
    (void)co_await socket_->async_close(reason, kUseTuple);
    deadline_.cancel();
    plain().close();
  }

  /// Cuts the connection unless there is activity within `limit`.
  void arm(std::chrono::milliseconds limit, bool slow) {
    deadline_.expires_after(limit);
    deadline_.async_wait([this, slow, alive = weak_](const boost::system::error_code& error) {
      if (error || alive.expired()) return;
      if (slow) {
        ++server_->context().web.live_dropped;
        server_->note(who_, PeerLine::kLiveViewerDropped,
                      {{"who", who_}, {"text", "it did not take a message in time"}});
      }
      cut();
    });
  }

  const std::shared_ptr<WebServer> server_;
  const std::string token_, who_;
  std::optional<websocket::stream<HttpStream>> socket_;  // from serve() on
  asio::steady_timer deadline_;
  std::shared_ptr<int> alive_ = std::make_shared<int>(0);
  std::weak_ptr<int> weak_ = alive_;
  bool reading_ = false, over_ = false, stopping_ = false, cut_ = false;
};

}  // namespace

std::shared_ptr<HttpTakeover> makeLiveSocket(std::shared_ptr<WebServer> server, std::string token,
                                             std::string who) {
  return std::make_shared<Viewer>(std::move(server), std::move(token), std::move(who));
}

}  // namespace needlelab
