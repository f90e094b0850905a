/// Streams of HTTP connections, and the interface of protocols that take one over. Only for files that
/// compile Beast.
#pragma once

#include <array>
#include <boost/asio/any_completion_handler.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <boost/beast/core/role.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "common/wire/asio.h"
#include "server/base/http_message.h"

namespace needlelab {

// the executor that kUseTuple resumes on
using PlainHttpStream = boost::beast::basic_stream<Tcp, asio::any_io_executor>;

/// TCP with or without TLS, in the form Beast requires. Completion handlers are type-erased, so TLS and TCP
/// are compiled once (http_stream.cpp), not for each of Beast's operations; this halves the compile time and
/// costs one allocation per read or write. Thread: the network's. Must not be moved during an operation.
class HttpStream {
 public:
  using executor_type = PlainHttpStream::executor_type;
  using next_layer_type = PlainHttpStream;  // Beast uses it to find the stream with the deadline
  using Done = asio::any_completion_handler<void(boost::system::error_code, std::size_t)>;
  using Ended = asio::any_completion_handler<void(boost::system::error_code)>;

  explicit HttpStream(Tcp::socket socket);
  HttpStream(Tcp::socket socket, asio::ssl::context& tls);

  bool secure() const { return std::holds_alternative<Secure>(stream_); }
  PlainHttpStream& next_layer();

  executor_type get_executor() { return next_layer().get_executor(); }

  /// Reads into the first buffer that has room.
  template <typename Buffers, typename Token>
  auto async_read_some(const Buffers& buffers, Token&& token) {
    asio::mutable_buffer first;
    const auto end = asio::buffer_sequence_end(buffers);
    for (auto at = asio::buffer_sequence_begin(buffers); at != end && first.size() == 0; ++at) first = *at;
    return asio::async_initiate<Token, void(boost::system::error_code, std::size_t)>(
        [this, first](auto done) { read(first, Done(std::move(done))); }, token);
  }
  /// Writes a part of the first buffers.
  template <typename Buffers, typename Token>
  auto async_write_some(const Buffers& buffers, Token&& token) {
    Pieces pieces;
    const auto end = asio::buffer_sequence_end(buffers);
    for (auto at = asio::buffer_sequence_begin(buffers); at != end && pieces.count < pieces.all.size();
         ++at) {
      const asio::const_buffer piece = *at;
      if (piece.size() > 0) pieces.all[pieces.count++] = piece;
    }
    return asio::async_initiate<Token, void(boost::system::error_code, std::size_t)>(
        [this, pieces](auto done) { write(pieces, Done(std::move(done))); }, token);
  }
  /// The TLS handshake, as the server; only with TLS. False: it failed.
  Task<bool> shakeHands();
  /// With TLS, sends close_notify and waits for the peer's; without, shuts down sending.
  Task<> shutDown();
  /// Called by Beast to end a WebSocket's stream.
  void tearDown(boost::beast::role_type role, Ended ended);

 private:
  using Secure = asio::ssl::stream<PlainHttpStream>;
  struct Pieces {
    std::array<asio::const_buffer, 16> all;
    std::size_t count = 0;

    using value_type = asio::const_buffer;
    using const_iterator = const asio::const_buffer*;
    const_iterator begin() const { return all.data(); }
    const_iterator end() const { return all.data() + count; }
  };
  void read(asio::mutable_buffer buffer, Done done);
  void write(const Pieces& pieces, Done done);

  std::variant<PlainHttpStream, Secure> stream_;
};

/// Found by Beast through argument-dependent lookup.
template <typename Handler>
void async_teardown(boost::beast::role_type role, HttpStream& stream, Handler&& handler) {
  stream.tearDown(role, HttpStream::Ended(std::forward<Handler>(handler)));
}

using HttpParser = boost::beast::http::request_parser<boost::beast::http::string_body>;

/// A request's fields and its body (moved), without the connection's fields.
std::shared_ptr<HttpRequest> requestOf(HttpParser& parser);

/// Another protocol on a connection that began with HTTP, e.g. a WebSocket. Thread: the network's. serve() is
/// not called if the connection ends first.
class HttpTakeover {
 public:
  HttpTakeover() = default;
  virtual ~HttpTakeover() = default;
  HttpTakeover(const HttpTakeover&) = delete;
  HttpTakeover& operator=(const HttpTakeover&) = delete;

  using Upgrade = boost::beast::http::request<boost::beast::http::string_body>;
  /// Runs until the connection ends.
  virtual Task<> serve(HttpStream stream, std::shared_ptr<const Upgrade> request) = 0;
  /// Tells the peer that the server is stopping, and ends. May be called before serve().
  virtual void stop() = 0;
  virtual void cut() = 0;
};

}  // namespace needlelab
