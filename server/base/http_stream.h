/// The streams of HTTP connections, and what may take one over. Only for the files that compile Beast.
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

// the executor by which kUseTuple resumes
using PlainHttpStream = boost::beast::basic_stream<Tcp, asio::any_io_executor>;
using SecureHttpStream = asio::ssl::stream<PlainHttpStream>;

using HttpParser = boost::beast::http::request_parser<boost::beast::http::string_body>;

/// A request's fields and its body, which is moved; without the connection's part.
std::shared_ptr<HttpRequest> requestOf(HttpParser& parser);

/// Another protocol on a connection that began with HTTP, e.g. a WebSocket. Thread: the network's. When the
/// connection ends before serve(), serve() is never called.
class HttpTakeover {
 public:
  HttpTakeover() = default;
  virtual ~HttpTakeover() = default;
  HttpTakeover(const HttpTakeover&) = delete;
  HttpTakeover& operator=(const HttpTakeover&) = delete;

  using Upgrade = boost::beast::http::request<boost::beast::http::string_body>;
  /// Until the end of the connection.
  virtual Task<> serve(SecureHttpStream stream, std::shared_ptr<const Upgrade> request) = 0;
  /// Says that the server goes, and ends. May come before serve().
  virtual void stop() = 0;
  virtual void cut() = 0;
};

}  // namespace needlelab
