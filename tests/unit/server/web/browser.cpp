#include "tests/unit/server/web/browser.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

namespace needlelab::test {
namespace {

std::string lowerText(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(c));
  return text;
}

}  // namespace

WebWire::WebWire(std::uint16_t port, bool shake_hands) {
  // OpenSSL writes without MSG_NOSIGNAL
  std::signal(SIGPIPE, SIG_IGN);
  fd_ = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  waitAtMost(kPatience);
  if (::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 || !shake_hands)
    return;
  context_ = SSL_CTX_new(TLS_client_method());
  SSL_CTX_set_min_proto_version(context_, TLS1_3_VERSION);
  SSL_CTX_set_options(context_, SSL_OP_IGNORE_UNEXPECTED_EOF);
  ssl_ = SSL_new(context_);
  SSL_set_fd(ssl_, fd_);
  if (SSL_connect(ssl_) == 1) return;
  SSL_free(ssl_);
  ssl_ = nullptr;
}

WebWire::~WebWire() {
  if (ssl_ != nullptr) SSL_free(ssl_);
  if (context_ != nullptr) SSL_CTX_free(context_);
  if (fd_ >= 0) ::close(fd_);
}

void WebWire::waitAtMost(std::chrono::milliseconds limit) {
  timeval time{limit.count() / 1000, limit.count() % 1000 * 1000};
  if (time.tv_sec == 0 && time.tv_usec == 0) time.tv_usec = 1000;
  ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
  ::setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &time, sizeof time);
}

bool WebWire::send(const std::string& bytes) {
  if (ssl_ == nullptr) return false;
  std::size_t done = 0;
  while (done < bytes.size()) {
    const int count = SSL_write(ssl_, bytes.data() + done, static_cast<int>(bytes.size() - done));
    if (count <= 0) return false;
    done += static_cast<std::size_t>(count);
  }
  return true;
}

bool WebWire::changeKeys() {
  return ssl_ != nullptr && SSL_key_update(ssl_, SSL_KEY_UPDATE_NOT_REQUESTED) == 1 &&
         SSL_do_handshake(ssl_) == 1;
}

void WebWire::keepLittle() {
  const int bytes = 4096;
  ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
}

bool WebWire::sendPlain(const std::string& bytes) {
  return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
}

std::string WebWire::receivePlain() {
  std::string all, room(16384, '\0');
  for (;;) {
    const ssize_t count = ::recv(fd_, room.data(), room.size(), 0);
    if (count <= 0) return all;
    all.append(room, 0, static_cast<std::size_t>(count));
  }
}

bool WebWire::fill() {
  if (ssl_ == nullptr) return false;
  std::string room(16384, '\0');
  const int count = SSL_read(ssl_, room.data(), static_cast<int>(room.size()));
  if (count <= 0) return false;
  pending_.append(room, 0, static_cast<std::size_t>(count));
  return true;
}

std::string WebWire::receive(std::size_t most) {
  if (pending_.empty() && !fill()) return {};
  const std::string got = pending_.substr(0, most);
  pending_.erase(0, got.size());
  return got;
}

bool WebWire::ends() {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  std::string room(16384, '\0');
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) return false;
    pollfd ready{fd_, POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(left.count())) <= 0) return false;
    if (::recv(fd_, room.data(), room.size(), 0) <= 0) return true;
  }
}

WebReply WebWire::readHeader() {
  WebReply reply;
  std::size_t end = 0;
  while ((end = pending_.find("\r\n\r\n")) == std::string::npos) {
    if (!fill()) return reply;
  }
  const std::string head = pending_.substr(0, end);
  pending_.erase(0, end + 4);
  if (head.size() > 12) reply.status = std::atoi(head.c_str() + 9);
  std::size_t at = head.find("\r\n");
  while (at != std::string::npos) {
    const std::size_t next = head.find("\r\n", at + 2);
    const std::string line = head.substr(at + 2, next == std::string::npos ? next : next - at - 2);
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos) reply.headers[lowerText(line.substr(0, colon))] = line.substr(colon + 2);
    at = next;
  }
  return reply;
}

std::optional<std::string> WebWire::readChunk(bool& broken) {
  broken = true;
  std::size_t end = 0;
  while ((end = pending_.find("\r\n")) == std::string::npos) {
    if (!fill()) return std::nullopt;
  }
  const std::size_t size = std::stoul(pending_.substr(0, end), nullptr, 16);
  while (pending_.size() < end + 2 + size + 2) {
    if (!fill()) return std::nullopt;
  }
  std::string chunk = pending_.substr(end + 2, size);
  pending_.erase(0, end + 2 + size + 2);
  broken = false;
  if (size == 0) return std::nullopt;
  return chunk;
}

WebReply WebWire::read(bool head) {
  WebReply reply = readHeader();
  if (reply.status == 0 || head || reply.status == 304 || reply.status == 101) return reply;
  if (reply.header("transfer-encoding") == "chunked") {
    bool broken = false;
    while (const auto chunk = readChunk(broken)) reply.body += *chunk;
    if (broken) reply.status = 0;
    return reply;
  }
  const std::size_t length = std::stoul("0" + reply.header("content-length"));
  while (pending_.size() < length) {
    if (!fill()) {
      reply.status = 0;
      return reply;
    }
  }
  reply.body = pending_.substr(0, length);
  pending_.erase(0, length);
  return reply;
}

std::optional<std::string> WebWire::readText(std::chrono::milliseconds limit) {
  const auto end = std::chrono::steady_clock::now() + limit;
  const auto need = [&](std::size_t count) {
    while (pending_.size() < count) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      if (left.count() <= 0) return false;
      waitAtMost(left);
      if (!fill()) return false;
    }
    return true;
  };
  for (;;) {
    if (!need(2)) return std::nullopt;
    const int opcode = pending_[0] & 15;
    std::size_t size = static_cast<unsigned char>(pending_[1]) & 127, header = 2;
    const std::size_t more = size == 126 ? 2 : size == 127 ? 8 : 0;
    if (!need(2 + more)) return std::nullopt;
    if (more != 0) {
      size = 0;
      for (std::size_t i = 0; i < more; ++i) size = size * 256 + static_cast<unsigned char>(pending_[2 + i]);
      header += more;
    }
    if (!need(header + size)) return std::nullopt;
    std::string payload = pending_.substr(header, size);
    pending_.erase(0, header + size);
    if (opcode == 1) return payload;
    if (opcode == 9) sendFrame(10, payload);
    if (opcode == 8) {
      if (payload.size() >= 2)
        close_code_ = static_cast<unsigned char>(payload[0]) * 256 + static_cast<unsigned char>(payload[1]);
      sendFrame(8, payload.substr(0, 2));
      return std::nullopt;
    }
  }
}

bool WebWire::sendFrame(int opcode, const std::string& payload) {
  std::string frame;
  frame += static_cast<char>(0x80 | opcode);
  if (payload.size() < 126) {
    frame += static_cast<char>(0x80 | payload.size());
  } else {
    frame += static_cast<char>(0x80 | 126);
    frame += static_cast<char>(payload.size() >> 8);
    frame += static_cast<char>(payload.size() & 255);
  }
  frame += std::string(4, '\0');  // a mask of zeros changes nothing
  return send(frame + payload);
}

std::string requestText(const std::string& method, const std::string& path, const std::string& body,
                        const WebHeaders& headers) {
  std::string text = method + " " + path + " HTTP/1.1\r\n";
  const auto given = [&](const std::string& name) {
    return std::any_of(headers.begin(), headers.end(),
                       [&](const auto& h) { return lowerText(h.first) == name; });
  };
  if (!given("host")) text += "Host: localhost\r\n";
  if (!body.empty() && !given("content-type")) text += "Content-Type: application/json\r\n";
  if ((!body.empty() || method == "POST") && !given("content-length") && !given("transfer-encoding"))
    text += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  for (const auto& [name, value] : headers) text += name + ": " + value + "\r\n";
  return text + "\r\n" + body;
}

WebHeaders Browser::own(const std::string& method) const {
  WebHeaders headers;
  if (!cookie.empty()) headers.emplace_back("Cookie", "__Host-needlelab=" + cookie);
  if (!csrf.empty() && method != "GET" && method != "HEAD") headers.emplace_back("X-CSRF-Token", csrf);
  return headers;
}

WebReply Browser::ask(const std::string& method, const std::string& path, const std::string& body,
                      WebHeaders headers) {
  for (const auto& header : own(method)) {
    const bool given =
        std::any_of(headers.begin(), headers.end(), [&](const auto& h) { return h.first == header.first; });
    if (!given) headers.push_back(header);
  }
  const std::string text = requestText(method, path, body, headers);
  // Keeps the connection, and replaces it if the server has closed it in the meantime.
  for (int tries = 0; tries < 2; ++tries) {
    const bool kept = wire_ != nullptr;
    if (!kept) wire_ = std::make_unique<WebWire>(port_);
    WebReply reply;
    if (wire_->send(text)) reply = wire_->read(method == "HEAD");
    if (reply.status == 0 || reply.header("connection") == "close") wire_.reset();
    if (reply.status != 0 || !kept) return reply;
  }
  return {};
}

WebReply Browser::logIn(const std::string& name, const std::string& password) {
  cookie.clear();
  csrf.clear();
  const nlohmann::json body = {{"name", name}, {"password", password}};
  const WebReply reply = ask("POST", "/api/v1/session", body.dump(), {{"Origin", "https://localhost"}});
  const std::string set = reply.header("set-cookie");
  const std::string prefix = "__Host-needlelab=";
  if (reply.status == 200 && set.starts_with(prefix)) {
    cookie = set.substr(prefix.size(), set.find(';') - prefix.size());
    csrf = reply.json().value("csrf_token", "");
  }
  return reply;
}

std::unique_ptr<WebWire> Browser::live(WebReply* refused, const std::string& origin) {
  auto wire = std::make_unique<WebWire>(port_);
  WebHeaders headers = own("GET");
  headers.emplace_back("Upgrade", "websocket");
  headers.emplace_back("Connection", "Upgrade");
  headers.emplace_back("Sec-WebSocket-Version", "13");
  headers.emplace_back("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ==");
  if (!origin.empty()) headers.emplace_back("Origin", origin);
  WebReply reply;
  if (wire->send(requestText("GET", "/api/v1/live", "", headers))) reply = wire->read();
  if (refused != nullptr) *refused = reply;
  // RFC 6455 §1.3 gives the answer to that key
  if (reply.status == 101 && reply.header("sec-websocket-accept") == "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=")
    return wire;
  return nullptr;
}

}  // namespace needlelab::test
