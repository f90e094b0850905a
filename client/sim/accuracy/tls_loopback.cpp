#include "client/sim/accuracy/tls_loopback.h"

#include <openssl/bio.h>
#include <openssl/ssl.h>
#include <stdlib.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "common/wire/certificates.h"
#include "common/wire/channel.h"

namespace needlelab {
namespace {

constexpr std::chrono::seconds kPatience{5};

// a private folder, removed by the destructor
struct OwnFolder {
  std::filesystem::path path;
  OwnFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "needlelab-tls-XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path = name;
  }
  ~OwnFolder() {
    std::error_code ignored;  // a left-over does no harm
    if (!path.empty()) std::filesystem::remove_all(path, ignored);
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;
};

}  // namespace

struct TlsLoopback::Ends {
  OwnFolder folder;
  TlsContext server_tls, client_tls;
  asio::io_context io{1};
  std::shared_ptr<Channel> sender, receiver;
  std::optional<Result<pb::Envelope>> got;

  template <typename Done>
  bool runUntil(Done done) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (!done() && std::chrono::steady_clock::now() < deadline) {
      io.restart();
      io.run_one_until(deadline);
    }
    return done();
  }
  Status connect();
  Status makeTls();
};

Status TlsLoopback::Ends::makeTls() {
  if (folder.path.empty())
    return Error{ErrorCode::kFailed, "cannot make a temporary folder for a certificate"};
  const TlsFiles files = tlsFilesIn(folder.path / "tls");
  RETURN_IF_ERROR(ensureTlsFiles(files, {{"127.0.0.1"}}));
  ASSIGN_OR_RETURN(auto server, makeServerTls(files.certificate, files.key));
  ASSIGN_OR_RETURN(auto client, makeClientTls(files.ca_certificate));
  server_tls = server, client_tls = client;
  return {};
}

Status TlsLoopback::Ends::connect() {
  RETURN_IF_ERROR(makeTls());
  boost::system::error_code failed;
  Tcp::acceptor acceptor(io);
  Tcp::socket near(io), far(io);
  const auto address = Tcp::endpoint(asio::ip::address_v4::loopback(), 0);
  static_cast<void>(acceptor.open(address.protocol(), failed));
  if (!failed) static_cast<void>(acceptor.bind(address, failed));
  if (!failed) static_cast<void>(acceptor.listen(1, failed));
  if (!failed) static_cast<void>(near.connect(acceptor.local_endpoint(), failed));
  if (!failed) static_cast<void>(acceptor.accept(far, failed));
  if (failed) return Error{ErrorCode::kUnavailable, "no connection on 127.0.0.1: " + failed.message()};

  ChannelLimits limits;
  limits.live_age = std::chrono::seconds(5);  // a stall of the machine must not drop measured frames
  limits.frame_bytes = kMaxFrameBytes;
  sender = Channel::make(TlsStream(std::move(near), *client_tls), limits);
  receiver = Channel::make(TlsStream(std::move(far), *server_tls), limits);
  int done = 0;
  Status result;
  const auto shake = [&](std::shared_ptr<Channel> channel,
                         asio::ssl::stream_base::handshake_type side) -> Task<> {
    Status status = co_await channel->handshake(side);
    if (!status.ok()) result = std::move(status);
    ++done;
  };
  asio::co_spawn(io, shake(sender, asio::ssl::stream_base::client), rethrow);
  asio::co_spawn(io, shake(receiver, asio::ssl::stream_base::server), rethrow);
  if (!runUntil([&] { return done == 2; }))
    return Error{ErrorCode::kUnavailable, "no TLS connection on 127.0.0.1 within 5 s"};
  sender->established();
  receiver->established();
  return result;
}

TlsLoopback::TlsLoopback() : ends_(std::make_unique<Ends>()) {}

TlsLoopback::~TlsLoopback() {
  // cut both, then let the coroutines end
  if (ends_->sender) ends_->sender->close(CloseReason::kLocal, "done");
  if (ends_->receiver) ends_->receiver->close(CloseReason::kLocal, "done");
  ends_->io.restart();
  ends_->io.poll();
}

Result<std::unique_ptr<TlsLoopback>> TlsLoopback::open() {
  std::unique_ptr<TlsLoopback> loop(new TlsLoopback);
  RETURN_IF_ERROR(loop->ends_->connect());
  return loop;
}

Result<pb::Envelope> TlsLoopback::pass(Frame frame) {
  Ends& ends = *ends_;
  ends.got.reset();
  const auto receive = [](Ends* into) -> Task<> {
    auto envelope = co_await into->receiver->receive();
    into->got.emplace(std::move(envelope));
  };
  asio::co_spawn(ends.io, receive(&ends), rethrow);
  ends.sender->sendLive(std::move(frame), true);
  if (!ends.runUntil([&] { return ends.got.has_value(); }))
    return Error{ErrorCode::kUnavailable, "a live frame did not arrive within 5 s"};
  return *std::exchange(ends.got, std::nullopt);
}

std::uint64_t TlsLoopback::cipherBytes() const {
  return ::BIO_number_written(::SSL_get_wbio(ends_->sender->ssl()));
}

}  // namespace needlelab
