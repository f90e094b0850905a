#include "server/base/http_stream.h"

#include <boost/asio/bind_executor.hpp>
#include <boost/beast/websocket/ssl.hpp>

namespace needlelab {

HttpStream::HttpStream(Tcp::socket socket)
    : stream_(std::in_place_type<PlainHttpStream>, std::move(socket)) {}
HttpStream::HttpStream(Tcp::socket socket, asio::ssl::context& tls)
    : stream_(std::in_place_type<Secure>, PlainHttpStream(std::move(socket)), tls) {}

PlainHttpStream& HttpStream::next_layer() {
  if (auto* const secure = std::get_if<Secure>(&stream_)) return secure->next_layer();
  return std::get<PlainHttpStream>(stream_);
}

// Beast posts to the handler's executor, but any_completion_handler provides it only in a form that cannot be
// posted to. So all handlers run on the stream's executor.
void HttpStream::read(asio::mutable_buffer buffer, Done done) {
  std::visit(
      [&](auto& stream) {
        stream.async_read_some(buffer, asio::bind_executor(get_executor(), std::move(done)));
      },
      stream_);
}

void HttpStream::write(const Pieces& pieces, Done done) {
  std::visit(
      [&](auto& stream) {
        stream.async_write_some(pieces, asio::bind_executor(get_executor(), std::move(done)));
      },
      stream_);
}

Task<bool> HttpStream::shakeHands() {
  auto [failed] =
      co_await std::get<Secure>(stream_).async_handshake(asio::ssl::stream_base::server, kUseTuple);
  co_return !failed;
}

Task<> HttpStream::shutDown() {
  if (auto* const secure = std::get_if<Secure>(&stream_)) {
    (void)co_await secure->async_shutdown(kUseTuple);
  } else {
    boost::system::error_code ignored;
    next_layer().socket().shutdown(Tcp::socket::shutdown_send, ignored);
  }
}

void HttpStream::tearDown(boost::beast::role_type role, Ended ended) {
  using boost::beast::websocket::async_teardown;
  std::visit(
      [&](auto& stream) {
        async_teardown(role, stream, asio::bind_executor(get_executor(), std::move(ended)));
      },
      stream_);
}

}  // namespace needlelab
