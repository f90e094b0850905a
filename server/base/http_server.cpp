#include "server/base/http_server.h"

#include <fmt/chrono.h>
#include <fmt/core.h>
#include <poll.h>

#include <algorithm>
#include <atomic>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/string.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <cctype>
#include <cstring>
#include <ctime>
#include <string_view>
#include <utility>

#include "common/base/time/clock.h"
#include "server/base/http_stream.h"
#include "server/base/listen.h"

namespace needlelab {

namespace beast = boost::beast;
namespace bhttp = beast::http;

namespace {

std::string headerOf(const HttpParser& parser, bhttp::field name) {
  const auto value = parser.get()[name];
  return {value.data(), value.size()};
}
std::string headerOf(const HttpParser& parser, const char* name) {
  const auto value = parser.get()[name];
  return {value.data(), value.size()};
}

/// All values of a repeatable header, in order.
std::string allOf(const HttpParser& parser, const char* name) {
  std::string values;
  const auto [first, last] = parser.get().equal_range(name);
  for (auto at = first; at != last; ++at) {
    if (at != first) values += ',';
    values.append(at->value().data(), at->value().size());
  }
  return values;
}

/// True if Transfer-Encoding is anything but "chunked" alone in HTTP/1.1. The parser treats most such
/// requests as having no body, and their body as the next request; a proxy in front may not.
bool isCodedOtherwise(const HttpParser& parser) {
  const auto& message = parser.get();
  const std::size_t codings = message.count(bhttp::field::transfer_encoding);
  if (codings == 0) return false;
  return codings > 1 || message.version() < 11 || message.count(bhttp::field::content_length) > 0 ||
         !beast::iequals(message[bhttp::field::transfer_encoding], "chunked");
}

/// HTTP/1.1 requires exactly one Host (RFC 9112, 3.2).
bool hasWrongHost(const HttpParser& parser) {
  const auto hosts = parser.get().count(bhttp::field::host);
  return hosts > 1 || (hosts == 0 && parser.get().version() >= 11);
}

/// Clients send "https://HOST/PATH" to a proxy; it means the same as "/PATH" (RFC 9112, 3.2.2).
struct AbsoluteTarget {
  std::string_view host, target;  ///< host empty: origin form
};
AbsoluteTarget splitTarget(std::string_view target) {
  for (const std::string_view scheme : {"https://", "http://"}) {
    if (!beast::iequals(beast::string_view(target.substr(0, scheme.size())), beast::string_view(scheme)))
      continue;
    const std::string_view rest = target.substr(scheme.size());
    const std::size_t path = std::min(rest.find_first_of("/?"), rest.size());
    return {rest.substr(0, path), path == rest.size() ? std::string_view("/") : rest.substr(path)};
  }
  return {{}, target};
}

/// A WebSocket's key is 16 bytes in base64 (RFC 6455, 4.1).
bool hasWebSocketKey(const HttpParser& parser) {
  const auto key = parser.get()[bhttp::field::sec_websocket_key];
  return key.size() == 24 && key.ends_with("==") &&
         std::all_of(key.begin(), key.end() - 2,
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == '+' || c == '/'; });
}

/// "Fri, 27 Nov 2026 10:57:14 GMT" (RFC 9110, 5.6.7)
std::string httpDate(std::time_t now) {
  return fmt::format("{:%a, %d %b %Y %H:%M:%S} GMT", fmt::gmtime(now));
}

class StreamConnection : public HttpConnection {
 public:
  StreamConnection(std::shared_ptr<HttpServer> server, std::uint64_t id, std::string address,
                   HttpStream stream)
      : server_(std::move(server)),
        id_(id),
        address_(std::move(address)),
        stream_(std::move(stream)),
        buffer_(server_->limits().header_bytes + (stream_.secure() ? 16u << 10 : 0u)) {}

  void stop() override {
    stopping_ = true;
    if (takeover_) takeover_->stop();
    if (waiting_) plain().cancel();
  }
  void cut() override {
    stopping_ = cut_ = *gone_ = true;
    takeover_ ? takeover_->cut() : plain().close();
  }

  void checkHangUp() override {
    if (!answering_ || *gone_) return;
    pollfd asked{plain().socket().native_handle(), POLLRDHUP, 0};
    if (::poll(&asked, 1, 0) > 0) *gone_ = true;
  }

  Task<> serve() override {
    const HttpLimits& limits = server_->limits();
    if (limits.whole) plain().expires_after(*limits.whole);
    if (co_await shakeHands()) {
      for (std::size_t served = 0; served < limits.requests_per_connection; ++served) {
        const bool last = served + 1 == limits.requests_per_connection;
        if (!co_await oneRequest(last)) break;
      }
      co_await close();
    } else {
      server_->handshakeFailed();
    }
    if (!takeover_) plain().close();
    server_->ended(id_);
  }

 private:
  PlainHttpStream& plain() { return stream_.next_layer(); }
  /// Sets the deadline for the current step to `time` from now, unless one deadline covers the whole
  /// connection.
  void limit(std::chrono::milliseconds time) {
    if (!server_->limits().whole) plain().expires_after(time);
  }
  void noLimit() {
    if (!server_->limits().whole) plain().expires_never();
  }

  Task<bool> shakeHands() {
    if (!stream_.secure()) co_return true;
    boost::system::error_code ignored;
    plain().socket().set_option(Tcp::no_delay(true), ignored);
    limit(server_->limits().handshake_timeout);
    co_return co_await stream_.shakeHands();
  }

  /// False: the connection ends.
  Task<bool> oneRequest(bool last) {
    const HttpLimits& limits = server_->limits();
    if (buffer_.size() == 0 && !co_await firstBytes()) co_return false;
    // one deadline from the header's first byte to its last: also cuts a client that sends a byte a second
    HttpParser parser;
    parser.header_limit(static_cast<std::uint32_t>(limits.header_bytes));
    parser.body_limit(limits.body_bytes);
    limit(limits.header_timeout);
    auto [failed, count] = co_await bhttp::async_read_header(stream_, buffer_, parser, kUseTuple);
    (void)count;
    const std::int64_t begun_ns = steadyNowNs();
    if (!failed && isCodedOtherwise(parser))
      failed = bhttp::make_error_code(bhttp::error::bad_transfer_encoding);
    const bool wrong_host = !failed && hasWrongHost(parser);
    if (!failed && !wrong_host && !parser.is_done() && limits.body_bytes > 0)
      failed = co_await readBody(parser);
    if (failed || wrong_host) {
      auto answer = wrong_host ? errorAnswer(400, "invalid_input", "Host: must be there, once")
                               : server_->unreadable(failed);
      if (!answer || cut_) co_return false;
      answer->close = true;
      HttpRequest unread;
      unread.connection = id_;
      unread.address = address_;
      unread.method = unread.target = "?";
      (void)co_await write(*answer, false, unread, begun_ns);
      co_await drain();
      co_return false;
    }
    auto request = requestOf(parser);
    request->connection = id_;
    request->address = address_;
    request->gone = [gone = gone_] { return gone->load(); };
    if (!request->body.empty()) wipeBuffer();
    noLimit();
    answering_ = true;
    HttpAnswer answer = co_await server_->answer(request);
    answering_ = false;
    if (cut_) co_return false;
    if (answer.takeover) {
      co_await handOverStream(parser, answer, *request, begun_ns);
      co_return false;
    }
    if (last || stopping_ || server_->stopping() || !parser.keep_alive()) answer.close = true;
    const bool head = request->method == "HEAD";
    const bool sent = co_await write(answer, head, *request, begun_ns);
    co_return sent && !answer.close;
  }

  Task<> handOverStream(HttpParser& parser, HttpAnswer& answer, const HttpRequest& request,
                        std::int64_t begun_ns) {
    if (!stream_.secure()) co_return;
    note(101, request, true, begun_ns);
    auto upgrade = std::make_shared<const HttpTakeover::Upgrade>(parser.release());
    takeover_ = std::move(answer.takeover);
    if (stopping_) takeover_->stop();
    co_await takeover_->serve(std::move(stream_), std::move(upgrade));
  }

  /// Waits for the first bytes of a request.
  Task<bool> firstBytes() {
    if (stopping_ || server_->stopping()) co_return false;
    limit(server_->limits().idle_timeout);
    waiting_ = true;
    auto [error, count] = co_await stream_.async_read_some(
        buffer_.prepare(std::min<std::size_t>(4096, buffer_.max_size())), kUseTuple);
    waiting_ = false;
    buffer_.commit(count);
    co_return !error;
  }

  Task<boost::system::error_code> readBody(HttpParser& parser) {
    const auto method = parser.get().method_string(), target = parser.get().target();
    const std::size_t most =
        server_->bodyLimit({method.data(), method.size()}, splitTarget({target.data(), target.size()}).target,
                           headerOf(parser, bhttp::field::cookie));
    // refuse a declared length before reading anything
    if (const auto length = parser.content_length(); length && *length > most)
      co_return bhttp::make_error_code(bhttp::error::body_limit);
    parser.body_limit(most);
    limit(server_->limits().body_timeout);
    // the client waits for this before it sends the body (RFC 9110, 10.1.1)
    if (buffer_.size() == 0 && parser.get().version() >= 11 &&
        beast::iequals(parser.get()[bhttp::field::expect], "100-continue")) {
      static constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";
      auto [failed, sent] = co_await asio::async_write(stream_, asio::buffer(kContinue), kUseTuple);
      (void)sent;
      if (failed) co_return failed;
    }
    auto [error, count] = co_await bhttp::async_read(stream_, buffer_, parser, kUseTuple);
    (void)count;
    co_return error;
  }

  /// False: sending failed. `answer` must outlive it.
  Task<bool> write(HttpAnswer& answer, bool head, const HttpRequest& request, std::int64_t begun_ns) {
    bhttp::response<bhttp::string_body> response;
    response.version(11);
    response.result(answer.status);
    response.set(bhttp::field::date, httpDate(std::time(nullptr)));
    response.set(bhttp::field::content_type, answer.type);
    // a 401 needs this header (RFC 9110, 11.6.1); browsers show no prompt for an unknown scheme
    if (answer.status == 401) response.set(bhttp::field::www_authenticate, "Session realm=\"needlelab\"");
    for (const auto& [name, value] : server_->commonHeaders()) response.set(name, value);
    response.set(bhttp::field::cache_control, answer.no_store ? "no-store" : "no-cache");
    for (const auto& [name, value] : answer.headers) response.insert(name, value);
    response.keep_alive(!answer.close);
    bool sent = false;
    limit(server_->limits().write_timeout);
    if (answer.pieces) {
      response.chunked(true);
      bhttp::response_serializer<bhttp::string_body> serializer(response);
      auto [error, count] = co_await bhttp::async_write_header(stream_, serializer, kUseTuple);
      (void)count;
      sent = !error && (head || co_await writePieces(answer, request));
    } else {
      const std::string& body = answer.shared_body ? *answer.shared_body : answer.body;
      if (answer.status != 304) response.content_length(body.size());
      // send a small header and body together, but do not copy a shared body for that
      if (!head) response.body() = answer.shared_body ? body : std::move(answer.body);
      bhttp::response_serializer<bhttp::string_body> serializer(response);
      if (head || answer.status == 304) {
        auto [error, count] = co_await bhttp::async_write_header(stream_, serializer, kUseTuple);
        (void)count;
        sent = !error;
      } else {
        auto [error, count] = co_await bhttp::async_write(stream_, serializer, kUseTuple);
        (void)count;
        sent = !error;
      }
    }
    note(answer.status, request, sent, begun_ns);
    co_return sent;
  }

  /// Makes each piece only after the previous one was sent, so a slow reader costs no memory.
  Task<bool> writePieces(HttpAnswer& answer, const HttpRequest& request) {
    for (;;) {
      noLimit();
      answering_ = true;
      const auto piece = co_await answer.pieces();
      answering_ = false;
      if (*gone_) co_return false;
      if (!piece.ok()) {
        server_->streamFailed(request, piece.error());
        co_return false;  // without the last chunk: the browser notices that the body is incomplete
      }
      limit(server_->limits().write_timeout);
      if (piece->empty()) {
        auto [error, count] = co_await asio::async_write(stream_, bhttp::make_chunk_last(), kUseTuple);
        (void)count;
        co_return !error;
      }
      auto [error, count] =
          co_await asio::async_write(stream_, bhttp::make_chunk(asio::buffer(*piece)), kUseTuple);
      (void)count;
      if (error) co_return false;
    }
  }

  void note(unsigned status, const HttpRequest& request, bool sent, std::int64_t begun_ns) {
    server_->answered({request, status, sent, static_cast<double>(steadyNowNs() - begun_ns) * 1e-9});
  }

  /// Wipes the bytes already read, which may contain a password. Keeps the bytes after the request.
  void wipeBuffer() {
    if (buffer_.size() > 0 || buffer_.capacity() == 0) return;
    const auto room = buffer_.prepare(buffer_.capacity());
    std::memset(room.data(), 0, room.size());
  }

  /// Briefly reads and drops the peer's remaining bytes; otherwise the peer's kernel would discard our
  /// answer.
  Task<> drain() {
    if (server_->limits().whole) co_return;
    limit(std::chrono::seconds(1));
    std::size_t taken = 0;
    while (taken < (2u << 20) && !cut_) {
      buffer_.clear();
      auto [error, count] = co_await stream_.async_read_some(buffer_.prepare(4096), kUseTuple);
      taken += count;
      if (error) co_return;
    }
  }

  Task<> close() {
    if (cut_ || takeover_) co_return;
    if (stream_.secure()) limit(std::chrono::seconds(1));
    co_await stream_.shutDown();
  }

  const std::shared_ptr<HttpServer> server_;
  const std::uint64_t id_;
  const std::string address_;
  HttpStream stream_;
  std::shared_ptr<HttpTakeover> takeover_;  // the new owner of the stream
  beast::flat_buffer buffer_;
  bool waiting_ = false;    // for the next request
  bool answering_ = false;  // an answer or one of its pieces is being made
  const std::shared_ptr<std::atomic<bool>> gone_ = std::make_shared<std::atomic<bool>>(false);
  bool stopping_ = false, cut_ = false;
};

Task<> serve(std::shared_ptr<HttpConnection> connection) {
  co_await connection->serve();
}

std::string textOf(const Tcp::endpoint& peer) {
  const std::string host = peer.address().to_string();
  return fmt::format("{}:{}", (peer.address().is_v6() ? "[" + host + "]" : host), peer.port());
}

}  // namespace

std::shared_ptr<HttpRequest> requestOf(HttpParser& parser) {
  auto request = std::make_shared<HttpRequest>();
  auto& message = parser.get();
  request->method = std::string(message.method_string().data(), message.method_string().size());
  const auto target = splitTarget({message.target().data(), message.target().size()});
  request->target = std::string(target.target);
  request->host = target.host.empty() ? headerOf(parser, bhttp::field::host) : std::string(target.host);
  request->origin = headerOf(parser, bhttp::field::origin);
  request->fetch_site = headerOf(parser, "Sec-Fetch-Site");
  request->cookie = headerOf(parser, bhttp::field::cookie);
  request->content_type = headerOf(parser, bhttp::field::content_type);
  request->if_match = headerOf(parser, bhttp::field::if_match);
  request->if_none_match = headerOf(parser, bhttp::field::if_none_match);
  request->csrf = headerOf(parser, "X-CSRF-Token");
  request->forwarded = allOf(parser, "Forwarded");
  request->x_forwarded_for = allOf(parser, "X-Forwarded-For");
  request->is_http_1_1 = message.version() == 11;
  request->upgrade = beast::websocket::is_upgrade(message) && hasWebSocketKey(parser);
  request->body = std::move(message.body());
  return request;
}

bool isBadRequest(const boost::system::error_code& error) {
  return error.category() == bhttp::make_error_code(bhttp::error::bad_method).category();
}

std::optional<HttpAnswer> unreadableAnswer(const boost::system::error_code& error) {
  if (error == bhttp::error::header_limit || error == bhttp::error::buffer_overflow)
    return errorAnswer(431, "too_large", "the request's header is too large");
  if (error == bhttp::error::bad_transfer_encoding)
    return errorAnswer(400, "invalid_input",
                       "Transfer-Encoding: must be \"chunked\" alone, once, in HTTP/1.1 and without "
                       "Content-Length");
  if (error == bhttp::error::body_limit) return errorAnswer(413, "too_large", "the body is too large");
  if (error == beast::error::timeout) return errorAnswer(408, "timeout", "the request did not come in time");
  const bool cut_off = error == bhttp::error::end_of_stream || error == bhttp::error::partial_message;
  if (isBadRequest(error) && !cut_off)
    return errorAnswer(400, "invalid_input", "this is not an HTTP request: " + error.message());
  return std::nullopt;
}

HttpServer::HttpServer(asio::io_context& io, Tcp::acceptor acceptor, std::optional<TlsContext> tls,
                       HttpLimits limits)
    : io_(io),
      acceptor_(std::move(acceptor)),
      port_(acceptor_.local_endpoint().port()),
      tls_(std::move(tls)),
      limits_(limits) {}

HttpServer::~HttpServer() = default;

void HttpServer::beginAccepting() {
  const auto alive = shared_from_this();
  asio::co_spawn(io_,
                 acceptLoop(acceptor_, "web_accept_failed",
                            [alive](Tcp::socket socket) { alive->accepted(std::move(socket)); }),
                 rethrow);
}

void HttpServer::accepted(Tcp::socket socket) {
  boost::system::error_code gone;
  const auto peer = socket.remote_endpoint(gone);
  if (gone) return;
  const std::uint64_t id = next_id_++;
  if (!admit(id, peer)) return;  // closes the socket
  auto connection = std::make_shared<StreamConnection>(
      shared_from_this(), id, textOf(peer),
      tls_ ? HttpStream(std::move(socket), **tls_) : HttpStream(std::move(socket)));
  connections_.emplace(id, connection);
  asio::co_spawn(io_, serve(std::move(connection)), rethrow);
}

void HttpServer::stop() {
  if (std::exchange(stopping_, true)) return;
  boost::system::error_code ignored;
  acceptor_.close(ignored);
  const auto all = connections_;
  for (const auto& [id, weak] : all) {
    if (const auto connection = weak.lock()) connection->stop();
  }
}

void HttpServer::cut() {
  const auto all = connections_;
  for (const auto& [id, weak] : all) cut(id);
}

void HttpServer::cut(std::uint64_t id) {
  const auto found = connections_.find(id);
  if (const auto connection = found == connections_.end() ? nullptr : found->second.lock()) connection->cut();
}

void HttpServer::checkHangUps() {
  for (const auto& [id, weak] : connections_) {
    if (const auto connection = weak.lock()) connection->checkHangUp();
  }
}

void HttpServer::ended(std::uint64_t id) {
  if (connections_.erase(id) > 0) left(id);
}

std::size_t HttpServer::bodyLimit(std::string_view /*method*/, std::string_view /*target*/,
                                  const std::string& /*cookie*/) const {
  return limits_.body_bytes;
}

const HttpHeaders& HttpServer::commonHeaders() const {
  static const HttpHeaders none;
  return none;
}

void HttpServer::answered(const HttpExchange& /*exchange*/) {}
void HttpServer::streamFailed(const HttpRequest& /*request*/, const Error& /*error*/) {}

}  // namespace needlelab
