#include "common/wire/certificates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "common/base/files.h"
#include "tests/unit/common/wire/loopback.h"

namespace needlelab {
namespace {

using test::TempFolder;

TEST(Certificates, keysAreForTheOwnerOnly) {
  const auto& files = test::TestTls::get().files;
  using std::filesystem::perms;
  for (const auto& key : {files.key, files.ca_key}) {
    EXPECT_EQ(std::filesystem::status(key).permissions(), perms::owner_read | perms::owner_write) << key;
  }
}

TEST(Certificates, whatIsThereIsKept) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(*ensureTlsFiles(files, {"localhost", "::1"}));
  const auto certificate = *readWholeFile(files.certificate);
  const auto made = ensureTlsFiles(files, {"localhost"});
  ASSERT_TRUE(made.ok());
  EXPECT_FALSE(*made);
  EXPECT_EQ(*readWholeFile(files.certificate), certificate);
}

TEST(Certificates, aNewHostNameGivesANewCertificateOfTheSameAuthority) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(*ensureTlsFiles(files, {"localhost"}));
  const auto ca = *readWholeFile(files.ca_certificate), certificate = *readWholeFile(files.certificate);
  ASSERT_TRUE(*ensureTlsFiles(files, {"localhost", "skills-lab.example"}));
  EXPECT_EQ(*readWholeFile(files.ca_certificate), ca);
  EXPECT_NE(*readWholeFile(files.certificate), certificate);
}

TEST(Certificates, theAuthoritysKeyMayLieElsewhereUntilItIsNeeded) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(*ensureTlsFiles(files, {"localhost"}));
  std::filesystem::remove(files.ca_key);
  EXPECT_FALSE(*ensureTlsFiles(files, {"localhost"}));
  const auto without = ensureTlsFiles(files, {"other.example"});
  ASSERT_FALSE(without.ok());
  EXPECT_THAT(without.error().message, testing::HasSubstr("ca.key"));
}

TEST(Certificates, aHostThatIsNoneIsRefused) {
  const TempFolder folder;
  for (const char* host : {"", "a b", "x,DNS:y", "evil:1"}) {
    EXPECT_EQ(ensureTlsFiles(tlsFilesIn(folder.path()), {host}).error().code, ErrorCode::kInvalidInput)
        << host;
  }
}

TEST(Tls, missingAndWrongFilesAreNamed) {
  const TempFolder folder;
  const auto no_file = makeClientTls(folder.path() / "ca.crt");
  EXPECT_EQ(no_file.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(no_file.error().message, testing::HasSubstr("ca.crt"));
  const auto garbage = folder.write("server.crt", "not a certificate");
  EXPECT_EQ(makeServerTls(garbage, garbage).error().code, ErrorCode::kInvalidInput);
}

/// Runs a handshake with a client that trusts `ca` and expects `host`. Returns the client's status.
Status handshakeWith(const TlsContext& client_tls, const std::string& host) {
  test::Loopback loop;
  auto [far, near] = loop.sockets();
  auto server = Channel::make(TlsStream(std::move(far), *test::TestTls::get().server), {});
  TlsStream stream(std::move(near), *client_tls);
  if (auto named = requireHost(stream, host); !named.ok()) return named;
  auto client = Channel::make(std::move(stream), {});
  std::optional<Status> result;
  const auto shake = [](std::shared_ptr<Channel> channel, asio::ssl::stream_base::handshake_type side,
                        std::optional<Status>* out) -> Task<> {
    auto status = co_await channel->handshake(side);
    if (out != nullptr) out->emplace(std::move(status));
  };
  asio::co_spawn(loop.io, shake(server, asio::ssl::stream_base::server, nullptr), rethrow);
  asio::co_spawn(loop.io, shake(client, asio::ssl::stream_base::client, &result), rethrow);
  EXPECT_TRUE(loop.runUntil([&] { return result.has_value(); }));
  return *result;
}

TEST(Tls, theServersNameOrAddressMustBeInItsCertificate) {
  const auto& tls = test::TestTls::get();
  EXPECT_TRUE(handshakeWith(tls.client, "localhost").ok());
  EXPECT_TRUE(handshakeWith(tls.client, "127.0.0.1").ok());
  for (const char* host : {"127.0.0.2", "other.example", "localhost.evil.example"}) {
    const auto refused = handshakeWith(tls.client, host);
    ASSERT_FALSE(refused.ok()) << host;
    EXPECT_EQ(refused.error().code, ErrorCode::kDenied) << refused.error().message;
  }
}

TEST(Tls, anotherAuthoritysServerIsRefused) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {"localhost"}).ok());
  const auto refused = handshakeWith(*makeClientTls(files.ca_certificate), "localhost");
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kDenied) << refused.error().message;
}

TEST(Tls, olderThan13IsRefused) {
  test::Loopback loop;
  auto [far, near] = loop.sockets();
  auto server = Channel::make(TlsStream(std::move(far), *test::TestTls::get().server), {});
  asio::ssl::context old(asio::ssl::context::tls_client);
  ASSERT_EQ(SSL_CTX_set_max_proto_version(old.native_handle(), TLS1_2_VERSION), 1);
  TlsStream client(std::move(near), old);
  std::optional<boost::system::error_code> error;
  client.async_handshake(asio::ssl::stream_base::client,
                         [&](const boost::system::error_code& ec) { error = ec; });
  std::optional<Status> refused;
  const auto shake = [](std::shared_ptr<Channel> channel, std::optional<Status>* out) -> Task<> {
    auto status = co_await channel->handshake(asio::ssl::stream_base::server);
    out->emplace(std::move(status));
  };
  asio::co_spawn(loop.io, shake(server, &refused), rethrow);
  ASSERT_TRUE(loop.runUntil([&] { return error.has_value() && refused.has_value(); }));
  EXPECT_TRUE(*error);
  EXPECT_FALSE(refused->ok());
}

}  // namespace
}  // namespace needlelab
