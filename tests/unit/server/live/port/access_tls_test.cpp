// The TLS settings, and the files in the server's folder.
#include <openssl/ssl.h>
#include <sodium.h>
#include <sys/stat.h>

#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/support/store/password_cost.h"
#include "tests/unit/server/live/raw_peer.h"

namespace needlelab {
namespace {

using namespace test;

TEST(AccessTls, nothingOlderThan13) {
  RunningServer server;
  for (const int version : {TLS1_VERSION, TLS1_1_VERSION, TLS1_2_VERSION}) {
    asio::io_context io;
    asio::ssl::context tls(asio::ssl::context::tls_client);
    SSL_CTX_set_min_proto_version(tls.native_handle(), 0);
    SSL_CTX_set_max_proto_version(tls.native_handle(), version);
    SSL_CTX_set_security_level(tls.native_handle(), 0);
    TlsStream stream(io, tls);
    stream.next_layer().connect({asio::ip::address_v4::loopback(), server.server().port()});
    boost::system::error_code error;
    stream.handshake(asio::ssl::stream_base::client, error);
    EXPECT_TRUE(error) << version;
  }
}

int tickets = 0;

TEST(AccessTls, noTicketsNoResumptionNoEarlyData) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  tickets = 0;
  RawPeer peer(server);
  SSL_CTX* const context = SSL_get_SSL_CTX(peer.ssl());
  SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_CLIENT);
  SSL_CTX_sess_set_new_cb(context, [](SSL*, SSL_SESSION*) { return ++tickets, 0; });
  // Tickets arrive after the handshake, with the first bytes read.
  ASSERT_TRUE(peer.logIn(stationLogin("bench-1", key)).has_welcome());
  EXPECT_EQ(tickets, 0);
  SSL_SESSION* const session = SSL_get1_session(peer.ssl());
  EXPECT_EQ(SSL_SESSION_is_resumable(session), 0);
  EXPECT_EQ(SSL_SESSION_get_max_early_data(session), 0u);
  EXPECT_EQ(SSL_version(peer.ssl()), TLS1_3_VERSION);
  EXPECT_EQ(SSL_renegotiate(peer.ssl()), 0) << "TLS 1.3 has none";
  SSL_SESSION_free(session);
}

std::string hexOf(const std::string& bytes) {
  std::string hex(2 * bytes.size() + 1, '\0');
  sodium_bin2hex(hex.data(), hex.size(), reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  hex.pop_back();
  return hex;
}

std::string base64Of(const std::string& bytes) {
  std::string text(sodium_base64_encoded_len(bytes.size(), sodium_base64_VARIANT_ORIGINAL), '\0');
  sodium_bin2base64(text.data(), text.size(), reinterpret_cast<const unsigned char*>(bytes.data()),
                    bytes.size(), sodium_base64_VARIANT_ORIGINAL);
  return text.substr(0, text.find('='));
}

TEST(AccessFiles, secretFilesAreSeparateAndPrivate) {
  const test::ProductPasswordCost product;
  RunningServer server;
  const std::string key = server.addStation("bench-1"), password = "planted password 7431";
  server.addUser("anna", pb::ADMINISTRATOR, password);
  auto anna = server.connect(personLogin("anna", password));
  ASSERT_TRUE(anna.ok());
  ASSERT_TRUE(server.connect(stationLogin("bench-1", key)).ok());
  pb::Request backup;
  backup.mutable_backup()->set_path((server.folder() / "data" / "copy.db").string());
  EXPECT_EQ(anna->call(backup).ok(), !onPostgres()) << "on SQLite only";
  const std::string token = anna->welcome().token();
  std::vector<std::string> secrets = {password, key, token};
  for (const std::string& secret : {key, token}) {
    secrets.push_back(hexOf(secret));
    secrets.push_back(base64Of(secret));
  }
  // while it runs (the database's log exists), and after its end
  for (int round = 0; round < 2; ++round) {
    int files = 0, hashes = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(server.folder() / "data")) {
      struct stat info {};
      if (::stat(entry.path().c_str(), &info) != 0) {
        EXPECT_EQ(errno, ENOENT) << entry.path() << " was neither read nor removed meanwhile";
        continue;
      }
      if (entry.is_directory()) {
        EXPECT_EQ(info.st_mode & 0777, 0700u) << entry.path();
        continue;
      }
      ++files;
      const bool certificate = entry.path().extension() == ".crt";
      EXPECT_EQ(info.st_mode & 0777, certificate ? 0644u : 0600u) << entry.path();
      std::ostringstream text;
      text << std::ifstream(entry.path(), std::ios::binary).rdbuf();
      for (const std::string& secret : secrets)
        EXPECT_EQ(text.str().find(secret), std::string::npos) << "a secret lies in " << entry.path();
      hashes += text.str().find("$argon2id$v=19$m=65536,t=2,p=1$") != std::string::npos ? 1 : 0;
    }
    EXPECT_GE(files, 6);
    EXPECT_GE(hashes, onPostgres() ? 0 : 1) << "passwords are kept as argon2id, 64 MiB";
    if (round == 0) {
      EXPECT_EQ(server.stop(), 0);
    }
  }
  struct stat info {};
  ASSERT_EQ(::stat((server.folder() / "data").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
}

}  // namespace
}  // namespace needlelab
