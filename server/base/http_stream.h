/// Streams of HTTP connections, and the interface of protocols that take one over. Only for files that
/// compile Beast.
#pragma once

#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>
#include <string>

#include "common/wire/asio.h"
#include "server/base/http_message.h"

namespace needlelab {

// the executor that kUseTuple resumes on
using PlainHttpStream = boost::beast::basic_stream<Tcp, asio::any_io_executor>;
using SecureHttpStream = asio::ssl::stream<PlainHttpStream>;

using HttpParser = boost::beast::http::request_parser<boost::beast::http::string_body>;

/// A request's fields and its body (moved), without the connection's fields.
std::shared_ptr<HttpRequest> requestOf(HttpParser& parser);

/// Another protocol on a connection that began with HTTP, e.g. a WebSocket. Thread: the network's. serve() is
/// never called when the connection ends first.
class HttpTakeover {
 public:
  HttpTakeover() = default;
  virtual ~HttpTakeover() = default;
  HttpTakeover(const HttpTakeover&) = delete;
  HttpTakeover& operator=(const HttpTakeover&) = delete;

  using Upgrade = boost::beast::http::request<boost::beast::http::string_body>;
  /// Runs until the connection ends.
  virtual Task<> serve(SecureHttpStream stream, std::shared_ptr<const Upgrade> request) = 0;
  /// Tells the peer that the server is stopping, and ends. May be called before serve().
  virtual void stop() = 0;
  virtual void cut() = 0;
};

}  // namespace needlelab
