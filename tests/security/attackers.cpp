#include "tests/security/attackers.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <deque>
#include <memory>
#include <random>

#include "client/net/link/connect.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"

namespace needlelab::test {
namespace {

/// Connects from an address of this machine. Returns the socket, or −1 if the server did not accept.
class Socket {
 public:
  Socket(const std::string& from, std::uint16_t port)
      : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const timeval limit{2, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    ::setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    if (fd_ >= 0 && (!address(from, 0, ::bind) || !address("127.0.0.1", port, ::connect))) {
      ::close(fd_);
      fd_ = -1;
    }
  }
  ~Socket() {
    if (fd_ >= 0) ::close(fd_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  [[nodiscard]] bool ok() const { return fd_ >= 0; }
  [[nodiscard]] int fd() const { return fd_; }
  bool write(const std::string& bytes) const {
    return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
  }

 private:
  template <typename Call>
  [[nodiscard]] bool address(const std::string& host, std::uint16_t port, Call call) const {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = inet_addr(host.c_str());
    return call(fd_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  int fd_;
};

/// TLS on the socket by direct OpenSSL calls. A closed connection is not an error here.
class TlsPeer {
 public:
  TlsPeer(const std::string& from, std::uint16_t port, const TlsContext& tls)
      : socket_(from, port), ssl_(SSL_new(tls->native_handle()), &SSL_free) {
    ok_ = socket_.ok() && SSL_set_fd(ssl_.get(), socket_.fd()) == 1 && SSL_connect(ssl_.get()) == 1;
  }
  [[nodiscard]] bool ok() const { return ok_; }
  bool write(const std::string& bytes) {
    ok_ = ok_ && SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size())) > 0;
    return ok_;
  }
  bool send(const pb::Envelope& envelope) {
    const std::string body = envelope.SerializeAsString();
    std::string bytes;
    appendFrameHeader(bytes, body.size());
    return write(bytes + body);
  }
  /// Reads any bytes. Returns false at the end of the connection.
  bool readSome() {
    char room[4096];
    ok_ = ok_ && SSL_read(ssl_.get(), room, sizeof room) > 0;
    return ok_;
  }
  bool hello() {
    pb::Envelope envelope;
    *envelope.mutable_hello()->mutable_version() = ourVersion();
    return send(envelope) && readSome();
  }
  bool logIn(const pb::Login& login) {
    pb::Envelope envelope;
    *envelope.mutable_login() = login;
    return hello() && send(envelope) && readSome();
  }

 private:
  Socket socket_;
  std::unique_ptr<SSL, void (*)(SSL*)> ssl_;
  bool ok_ = false;
};

TlsContext clientTls(const std::filesystem::path& ca) {
  auto tls = makeClientTls(ca);
  return tls.ok() ? *tls : nullptr;
}

}  // namespace

Attackers::Attackers(std::filesystem::path ca, std::uint16_t port, StolenKey first, StolenKey second)
    : ca_(std::move(ca)), port_(port), first_(std::move(first)), second_(std::move(second)) {
  // OpenSSL may write to sockets that the server has closed.
  std::signal(SIGPIPE, SIG_IGN);
  for (const auto attack :
       {&Attackers::garbage, &Attackers::halfOpen, &Attackers::slowLoris, &Attackers::oversized,
        &Attackers::oversizedLoggedIn, &Attackers::guesses, &Attackers::churn, &Attackers::pings})
    threads_.emplace_back(attack, this);
}

Attackers::~Attackers() {
  over_ = true;
  for (auto& thread : threads_) thread.join();
}

bool Attackers::goOn(int pause_ms) const {
  std::this_thread::sleep_for(std::chrono::milliseconds(pause_ms));
  return !over_;
}

void Attackers::garbage() {
  std::minstd_rand random(1);
  while (goOn(10)) {
    const Socket socket("127.0.0.2", port_);
    std::string bytes(1 + random() % 2000, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    // Every second connection begins like a TLS record.
    if (random() % 2 == 0) bytes.replace(0, 3, "\x16\x03\x01");
    if (!socket.ok() || !socket.write(bytes)) ++counts_.turned_away;
    ++counts_.garbage;
  }
}

void Attackers::halfOpen() {
  std::deque<std::unique_ptr<Socket>> held;
  while (goOn(2)) {
    // the first bytes of a ClientHello, with an announced record size of 512 bytes
    auto socket = std::make_unique<Socket>("127.0.0.3", port_);
    if (socket->ok() && socket->write(std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11)))
      held.push_back(std::move(socket));
    else
      ++counts_.turned_away;
    ++counts_.half_open;
    if (held.size() > 1500) held.pop_front();
  }
}

void Attackers::slowLoris() {
  const TlsContext tls = clientTls(ca_);
  pb::Envelope envelope;
  envelope.mutable_hello()->set_program(std::string(2000, 'x'));
  std::string bytes;
  appendFrameHeader(bytes, envelope.ByteSizeLong());
  bytes += envelope.SerializeAsString();
  std::deque<std::pair<std::unique_ptr<TlsPeer>, std::size_t>> peers;
  while (goOn(20)) {
    if (peers.size() < 30) peers.emplace_back(std::make_unique<TlsPeer>("127.0.0.4", port_, tls), 0);
    for (auto& [peer, at] : peers) {
      if (!peer->ok() || !peer->write(bytes.substr(at++ % bytes.size(), 1))) continue;
      ++counts_.slow;
    }
    std::erase_if(peers,
                  [this](const auto& entry) { return !entry.first->ok() && ++counts_.turned_away > 0; });
  }
}

void Attackers::oversized() {
  const TlsContext tls = clientTls(ca_);
  while (goOn(50)) {
    TlsPeer peer("127.0.0.5", port_, tls);
    // announces 2 GiB, then sends a part of it
    if (!peer.write(std::string("\x7f\xff\xff\xff", 4) + std::string(60'000, 'x'))) ++counts_.turned_away;
    while (peer.readSome()) {
    }
    ++counts_.oversized;
  }
}

void Attackers::oversizedLoggedIn() {
  const TlsContext tls = clientTls(ca_);
  while (goOn(100)) {
    TlsPeer peer("127.0.0.6", port_, tls);
    if (!peer.logIn(stationLogin(first_.first, first_.second)) ||
        !peer.write(std::string("\x00\x10\x00\x01", 4) + std::string(60'000, 'x')))
      ++counts_.turned_away;
    while (peer.readSome()) {
    }
    ++counts_.oversized_in;
  }
}

void Attackers::guesses() {
  const TlsContext tls = clientTls(ca_);
  for (unsigned n = 0; goOn(20); ++n) {
    // from 20 addresses, alternating the administrator's name and other names
    TlsPeer peer("127.0.1." + std::to_string(1 + n % 20), port_, tls);
    const std::string name = n % 2 == 0 ? "load" : "user" + std::to_string(n);
    if (!peer.logIn(personLogin(name, "guess number " + std::to_string(n)))) ++counts_.turned_away;
    ++counts_.guesses;
  }
}

void Attackers::churn() {
  for (unsigned n = 0; goOn(2); ++n) {
    const Socket socket("127.0.2." + std::to_string(1 + n % 50), port_);
    if (!socket.ok()) ++counts_.turned_away;
    ++counts_.churn;
  }
}

void Attackers::pings() {
  const TlsContext tls = clientTls(ca_);
  pb::Envelope ping;
  ping.mutable_ping()->set_id(1);
  const std::string body = ping.SerializeAsString();
  std::string many;
  for (int i = 0; i < 200; ++i) {
    appendFrameHeader(many, body.size());
    many += body;
  }
  while (goOn(50)) {
    TlsPeer peer("127.0.0.7", port_, tls);
    if (!peer.logIn(stationLogin(second_.first, second_.second))) {
      ++counts_.turned_away;
      continue;
    }
    // at most 20,000 per second; occasionally reads the answers
    while (peer.write(many) && goOn(10)) {
      counts_.pings += 200;
      (void)peer.readSome();
    }
    ++counts_.turned_away;
  }
}

}  // namespace needlelab::test
