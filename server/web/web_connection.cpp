#include "server/web/web_connection.h"

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <cstring>
#include <utility>

#include "common/base/clock.h"
#include "server/live/log.h"
#include "server/web/live_socket.h"
#include "server/web/web_parser.h"
#include "server/web/web_server.h"

namespace needlelab {

namespace beast = boost::beast;
namespace bhttp = beast::http;

namespace {

/// Why a request cannot be read, as an answer; nothing when the peer is gone or too slow.
std::optional<WebAnswer> unreadable(const boost::system::error_code& error) {
  if (error == bhttp::error::header_limit || error == bhttp::error::buffer_overflow)
    return errorAnswer(431, "too_large", "the request's header is too large");
  if (error == bhttp::error::body_limit) return errorAnswer(413, "too_large", "the body is too large");
  if (error == beast::error::timeout) return errorAnswer(408, "timeout", "the request did not come in time");
  if (error.category() == bhttp::make_error_code(bhttp::error::bad_method).category() &&
      error != bhttp::error::end_of_stream && error != bhttp::error::partial_message)
    return errorAnswer(400, "invalid_input", "this is no HTTP request: " + error.message());
  return std::nullopt;
}

class BrowserConnection : public WebConnection {
 public:
  BrowserConnection(std::shared_ptr<WebServer> server, std::uint64_t id, Tcp::socket socket,
                    std::string address, std::string host_key)
      : server_(std::move(server)),
        id_(id),
        address_(std::move(address)),
        host_key_(std::move(host_key)),
        stream_(PlainWebStream(std::move(socket)), *server_->tls()),
        buffer_(server_->settings().header_bytes + (16u << 10)) {}

  void stop() override {
    stopping_ = true;
    if (live_) live_->stop();
    if (waiting_) plain().cancel();
  }
  void cut() override {
    stopping_ = cut_ = true;
    live_ ? live_->cut() : plain().close();
  }

 protected:
  Task<> serve() override {
    const WebSettings& settings = server_->settings();
    boost::system::error_code ignored;
    plain().socket().set_option(Tcp::no_delay(true), ignored);
    plain().expires_after(settings.handshake_timeout);
    auto [failed] = co_await stream_.async_handshake(asio::ssl::stream_base::server, kUseTuple);
    if (failed) {
      ++server_->context().web.handshakes_failed;
    } else {
      for (std::size_t served = 0; served < settings.requests_per_connection; ++served) {
        const bool last = served + 1 == settings.requests_per_connection;
        if (!co_await oneRequest(last)) break;
      }
      co_await close();
    }
    if (!live_) plain().close();
    server_->left(id_, host_key_);
  }

 private:
  PlainWebStream& plain() { return stream_.next_layer(); }

  /// False: the connection ends.
  Task<bool> oneRequest(bool last) {
    const WebSettings& settings = server_->settings();
    if (buffer_.size() == 0 && !co_await firstBytes()) co_return false;
    // one deadline from the header's first byte to its last: who sends a byte a second is cut as well
    WebParser parser;
    parser.header_limit(static_cast<std::uint32_t>(settings.header_bytes));
    parser.body_limit(settings.body_bytes);
    plain().expires_after(settings.header_timeout);
    auto [failed, count] = co_await bhttp::async_read_header(stream_, buffer_, parser, kUseTuple);
    (void)count;
    const std::int64_t begun_ns = steadyNowNs();
    if (!failed && !parser.is_done()) failed = co_await readBody(parser);
    auto trace = std::make_shared<WebTrace>();
    if (failed) {
      auto answer = unreadable(failed);
      if (!answer || cut_) co_return false;
      answer->close = true;
      (void)co_await write(*answer, false, *trace, "?", "?", begun_ns);
      co_await drain();
      co_return false;
    }
    auto request = requestOf(parser);
    request->connection = id_;
    request->address = address_;
    request->gone = [this] { return cut_; };
    if (!request->body.empty()) wipeBuffer();
    const std::string method = request->method, path = request->target.substr(0, request->target.find('?'));
    plain().expires_never();
    WebAnswer answer;
    if (parser.get().version() != 11) {
      answer = errorAnswer(505, "version", "only HTTP/1.1");
      answer.close = true;
    } else {
      answer = co_await answerTo(server_, request, trace);
    }
    if (cut_) {
      if (!answer.live_token.empty()) server_->viewerLeft(trace->who);  // its place was taken
      co_return false;
    }
    if (!answer.live_token.empty()) {
      co_await goLive(parser, answer, *trace, begun_ns);
      co_return false;
    }
    if (last || stopping_ || server_->stopping() || !parser.keep_alive()) answer.close = true;
    const bool sent = co_await write(answer, method == "HEAD", *trace, method, path, begun_ns);
    co_return sent && !answer.close;
  }

  Task<> goLive(WebParser& parser, WebAnswer& answer, const WebTrace& trace, std::int64_t begun_ns) {
    note(101, trace, "GET", "/api/v1/live", true, begun_ns);
    auto request = std::make_shared<const LiveSocket::Upgrade>(parser.release());
    live_ = LiveSocket::make(server_, std::move(stream_), answer.live_token, trace.who);
    if (stopping_) live_->stop();
    co_await LiveSocket::run(live_, std::move(request));
    server_->viewerLeft(trace.who);
  }

  /// Waits for a request to begin.
  Task<bool> firstBytes() {
    if (stopping_ || server_->stopping()) co_return false;
    plain().expires_after(server_->settings().idle_timeout);
    waiting_ = true;
    auto [error, count] = co_await stream_.async_read_some(buffer_.prepare(4096), kUseTuple);
    waiting_ = false;
    buffer_.commit(count);
    co_return !error;
  }

  Task<boost::system::error_code> readBody(WebParser& parser) {
    const std::size_t most = bodyLimitOf(*server_, headerOf(parser, bhttp::field::cookie));
    // a length that is said is judged before anything is read
    if (const auto length = parser.content_length(); length && *length > most)
      co_return bhttp::make_error_code(bhttp::error::body_limit);
    parser.body_limit(most);
    plain().expires_after(server_->settings().body_timeout);
    auto [error, count] = co_await bhttp::async_read(stream_, buffer_, parser, kUseTuple);
    (void)count;
    co_return error;
  }

  /// False: it could not be sent. `answer` must outlive it.
  Task<bool> write(WebAnswer& answer, bool head, const WebTrace& trace, std::string method, std::string path,
                   std::int64_t begun_ns) {
    bhttp::response<bhttp::string_body> response;
    response.version(11);
    response.result(answer.status);
    response.set(bhttp::field::content_type, answer.type);
    // nothing but this server's own files and data; no other page may frame it or learn of it
    response.set("Content-Security-Policy",
                 "default-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'; "
                 "object-src 'none'");
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.set("Cross-Origin-Opener-Policy", "same-origin");
    response.set("Strict-Transport-Security", "max-age=31536000");
    response.set(bhttp::field::cache_control, answer.no_store ? "no-store" : "no-cache");
    for (const auto& [name, value] : answer.headers) response.insert(name, value);
    response.keep_alive(!answer.close);
    bool sent = false;
    plain().expires_after(server_->settings().write_timeout);
    if (answer.pieces) {
      response.chunked(true);
      bhttp::response_serializer<bhttp::string_body> serializer(response);
      auto [error, count] = co_await bhttp::async_write_header(stream_, serializer, kUseTuple);
      (void)count;
      sent = !error && (head || co_await writePieces(answer));
    } else {
      const std::string& body = answer.shared_body ? *answer.shared_body : answer.body;
      if (answer.status != 304) response.content_length(body.size());
      // header and body in one go where that is small; a body that is shared is not copied for it
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
    note(answer.status, trace, method, path, sent, begun_ns);
    co_return sent;
  }

  /// The next piece is made when the last one has gone: a slow reader costs no memory.
  Task<bool> writePieces(WebAnswer& answer) {
    for (;;) {
      plain().expires_never();
      const auto piece = co_await answer.pieces();
      if (!piece.ok()) {
        logEvent(LogLevel::kWarning, "web_stream_failed", {{"conn", id_}, {"text", piece.error().message}});
        co_return false;  // without the last chunk: the browser sees that it is not whole
      }
      if (cut_) co_return false;
      plain().expires_after(server_->settings().write_timeout);
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

  void note(unsigned status, const WebTrace& trace, const std::string& method, const std::string& path,
            bool sent, std::int64_t begun_ns) {
    const double seconds = static_cast<double>(steadyNowNs() - begun_ns) * 1e-9;
    WebCounters& web = server_->context().web;
    ++web.requests[trace.route][status];
    web.latency_sum_s += seconds;
    std::size_t bucket = 0;
    while (bucket < WebCounters::kLatency_s.size() && seconds > WebCounters::kLatency_s[bucket]) ++bucket;
    ++web.latency[bucket];
    // neither query nor header: names that are looked for, cookies and tokens are nobody's business
    logEvent(trace.route == "file" ? LogLevel::kDebug : LogLevel::kInfo, "web_request",
             {{"conn", id_},
              {"peer", address_},
              {"who", trace.who},
              {"method", method},
              {"path", path},
              {"status", status},
              {"ms", static_cast<std::int64_t>(seconds * 1000)},
              {"sent", sent ? "yes" : "no"}});
  }

  /// There may have been a password in what was read. What is behind the request stays.
  void wipeBuffer() {
    if (buffer_.size() > 0 || buffer_.capacity() == 0) return;
    const auto room = buffer_.prepare(buffer_.capacity());
    std::memset(room.data(), 0, room.size());
  }

  /// Takes what the peer still sends, for a moment: else its kernel would throw our answer away.
  Task<> drain() {
    plain().expires_after(std::chrono::seconds(1));
    std::size_t taken = 0;
    while (taken < (2u << 20) && !cut_) {
      buffer_.clear();
      auto [error, count] = co_await stream_.async_read_some(buffer_.prepare(4096), kUseTuple);
      taken += count;
      if (error) co_return;
    }
  }

  Task<> close() {
    if (cut_ || live_) co_return;
    plain().expires_after(std::chrono::seconds(1));
    (void)co_await stream_.async_shutdown(kUseTuple);
  }

  const std::shared_ptr<WebServer> server_;
  const std::uint64_t id_;
  const std::string address_, host_key_;
  SecureWebStream stream_;
  std::shared_ptr<LiveSocket> live_;  // has taken the stream
  beast::flat_buffer buffer_;
  bool waiting_ = false;  // for the next request
  bool stopping_ = false, cut_ = false;
};

}  // namespace

std::shared_ptr<WebConnection> WebConnection::make(std::shared_ptr<WebServer> server, std::uint64_t id,
                                                   Tcp::socket socket, std::string address,
                                                   std::string host_key) {
  return std::make_shared<BrowserConnection>(std::move(server), id, std::move(socket), std::move(address),
                                             std::move(host_key));
}

Task<> WebConnection::run(std::shared_ptr<WebConnection> self) {
  co_await self->serve();
}

}  // namespace needlelab
