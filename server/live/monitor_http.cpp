#include "server/live/monitor_http.h"

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <unordered_map>
#include <utility>

namespace needlelab {

namespace beast = boost::beast;
namespace http = beast::http;

namespace {

// the executor by which kUseTuple resumes
using Stream = beast::basic_stream<Tcp, asio::any_io_executor>;

HttpAnswer plain(int status, const std::string& text) {
  return {status, "text/plain; charset=utf-8", text + "\n"};
}

}  // namespace

struct MonitorHttp::State {
  asio::io_context& io;
  Tcp::acceptor acceptor;
  Handler handler;
  Limits limits;
  std::uint16_t port = 0;
  bool stopping = false;
  std::uint64_t next = 0;
  std::unordered_map<std::uint64_t, Stream*> open;  // each takes itself out at its end
};

MonitorHttp::MonitorHttp(std::unique_ptr<State> state) : state_(std::move(state)) {}
MonitorHttp::~MonitorHttp() = default;

std::shared_ptr<MonitorHttp> MonitorHttp::make(asio::io_context& io, Tcp::acceptor acceptor, Handler handler,
                                               Limits limits) {
  const std::uint16_t port = acceptor.local_endpoint().port();
  std::unique_ptr<State> state(
      new State{io, std::move(acceptor), std::move(handler), limits, port, false, 0, {}});
  return std::shared_ptr<MonitorHttp>(new MonitorHttp(std::move(state)));
}

std::uint16_t MonitorHttp::port() const {
  return state_->port;
}

void MonitorHttp::start() {
  asio::co_spawn(state_->io, acceptLoop(shared_from_this()), rethrow);
}

void MonitorHttp::stop() {
  if (std::exchange(state_->stopping, true)) return;
  boost::system::error_code ignored;
  state_->acceptor.close(ignored);
  for (const auto& [id, stream] : state_->open) stream->cancel();
}

Task<> MonitorHttp::acceptLoop(std::shared_ptr<MonitorHttp> self) {
  State& state = *self->state_;
  while (!state.stopping) {
    auto [error, socket] = co_await state.acceptor.async_accept(kUseTuple);
    if (state.stopping) co_return;
    if (error) {
      // no file descriptors or the like: it passes
      asio::steady_timer pause(state.io, std::chrono::milliseconds(100));
      co_await pause.async_wait(kUseTuple);
      continue;
    }
    if (state.open.size() >= state.limits.connections) continue;  // closes it
    asio::co_spawn(state.io, serve(self, state.next++, std::move(socket)), rethrow);
  }
}

Task<> MonitorHttp::serve(std::shared_ptr<MonitorHttp> self, std::uint64_t id, Tcp::socket socket) {
  State& state = *self->state_;
  Stream stream(std::move(socket));
  state.open.emplace(id, &stream);
  // one deadline for all of it: who sends a byte a second is cut as well
  stream.expires_after(state.limits.whole);

  beast::flat_buffer buffer(state.limits.request_bytes);
  http::request_parser<http::empty_body> parser;
  parser.header_limit(static_cast<std::uint32_t>(state.limits.request_bytes));
  parser.body_limit(std::uint64_t{0});
  auto [failed, count] = co_await http::async_read_header(stream, buffer, parser, kUseTuple);
  (void)count;
  const bool gone = failed && failed != http::error::header_limit && failed != http::error::buffer_overflow &&
                    failed.category() != http::make_error_code(http::error::bad_method).category();
  if (!gone) {
    const auto& request = parser.get();
    HttpAnswer answer;
    const bool head = !failed && request.method() == http::verb::head;
    if (failed) {
      answer = plain(400, "not a request that this server knows: " + failed.message());
    } else if (request.method() != http::verb::get && !head) {
      answer = plain(405, "only GET and HEAD");
    } else {
      const std::string_view target(request.target().data(), request.target().size());
      answer = co_await state.handler(std::string(target.substr(0, target.find('?'))));
    }
    http::response<http::string_body> response;
    response.version(11);
    response.result(static_cast<unsigned>(answer.status));
    response.set(http::field::content_type, answer.type);
    response.set(http::field::cache_control, "no-store");
    if (answer.status == 405) response.set(http::field::allow, "GET, HEAD");
    response.keep_alive(false);
    response.content_length(answer.body.size());
    if (!head) response.body() = std::move(answer.body);
    // deadlines end reads and writes only; who stopped us meanwhile must not start a new one
    if (!state.stopping) {
      // a HEAD has the length and not the body: what was promised is not sent
      http::response_serializer<http::string_body> serializer(response);
      if (head) {
        (void)co_await http::async_write_header(stream, serializer, kUseTuple);
      } else {
        (void)co_await http::async_write(stream, serializer, kUseTuple);
      }
      boost::system::error_code ignored;
      stream.socket().shutdown(Tcp::socket::shutdown_send, ignored);
    }
  }
  state.open.erase(id);
}

}  // namespace needlelab
