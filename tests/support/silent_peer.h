/// Peers that begin a TLS handshake and then send nothing more.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

namespace needlelab::test {

/// A connection to a server on this machine, from an address of this machine (127.0.0.2 …), that sends one
/// message and then nothing.
class SilentPeer {
 public:
  /// Throws std::runtime_error if the server does not accept.
  SilentPeer(const std::string& from, std::uint16_t port, const std::string& bytes)
      : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = ::inet_addr(from.c_str());
    bool ok = ::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    address.sin_addr.s_addr = ::inet_addr("127.0.0.1");
    address.sin_port = htons(port);
    ok = ok && ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ok = ok && ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
    if (ok) return;
    ::close(fd_);
    throw std::runtime_error("cannot connect to the test's server");
  }
  ~SilentPeer() { ::close(fd_); }
  SilentPeer(const SilentPeer&) = delete;
  SilentPeer& operator=(const SilentPeer&) = delete;

  /// Whether the server's answer begins within `limit`: then it has given this peer a turn.
  [[nodiscard]] bool isAnswered(std::chrono::milliseconds limit) const {
    pollfd waits{fd_, POLLIN, 0};
    char byte = 0;
    return ::poll(&waits, 1, static_cast<int>(limit.count())) == 1 && ::recv(fd_, &byte, 1, MSG_PEEK) == 1;
  }
  /// Whether the server has kept it open.
  [[nodiscard]] bool isOpen() const {
    pollfd asked{fd_, POLLRDHUP, 0};
    return ::poll(&asked, 1, 0) == 0;
  }

 private:
  int fd_;
};

/// The first message of a TLS client, complete.
inline std::string clientHello() {
  const std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context(SSL_CTX_new(TLS_client_method()), SSL_CTX_free);
  const std::unique_ptr<SSL, void (*)(SSL*)> ssl(SSL_new(context.get()), SSL_free);
  BIO* const out = BIO_new(BIO_s_mem());
  SSL_set_bio(ssl.get(), BIO_new(BIO_s_mem()), out);
  (void)SSL_connect(ssl.get());
  std::string bytes(4096, '\0');
  bytes.resize(static_cast<std::size_t>(BIO_read(out, bytes.data(), static_cast<int>(bytes.size()))));
  return bytes;
}

}  // namespace needlelab::test
