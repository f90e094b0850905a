#include "common/wire/certificates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "common/wire/authority.h"
#include "common/wire/tls_folder.h"
#include "common/wire/x509.h"
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
  ASSERT_TRUE(*ensureTlsFiles(files, {{"localhost", "::1"}}));
  const auto certificate = *readWholeFile(files.certificate);
  const auto made = ensureTlsFiles(files, {{"localhost"}});
  ASSERT_TRUE(made.ok());
  EXPECT_FALSE(*made);
  EXPECT_EQ(*readWholeFile(files.certificate), certificate);
}

TEST(Certificates, aNewHostNameGivesANewCertificateOfTheSameAuthority) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(*ensureTlsFiles(files, {.hosts = {"localhost"}, .domains = {"skills-lab.example"}}));
  const auto ca = *readWholeFile(files.ca_certificate), certificate = *readWholeFile(files.certificate);
  ASSERT_TRUE(*ensureTlsFiles(files, {{"localhost", "skills-lab.example"}}));
  EXPECT_EQ(*readWholeFile(files.ca_certificate), ca);
  EXPECT_NE(*readWholeFile(files.certificate), certificate);
}

TEST(Certificates, theAuthoritysKeyMayLieElsewhereUntilItIsNeeded) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(*ensureTlsFiles(files, {{"localhost"}}));
  std::filesystem::remove(files.ca_key);
  EXPECT_FALSE(*ensureTlsFiles(files, {{"localhost"}}));
  const auto without = ensureTlsFiles(files, {{"10.0.0.7"}});
  ASSERT_FALSE(without.ok());
  EXPECT_THAT(without.error().message, testing::HasSubstr("ca.key"));
}

TEST(Certificates, withoutTheAuthoritysKeyRequestedNamesMustExist) {
  const TempFolder folder;
  const TlsFiles files = tlsFilesIn(folder.path() / "tls");
  ASSERT_TRUE(ensureTlsFiles(files, {.hosts = {"b.example.org"}, .domains = {"example.org"}}).ok());
  const auto key = folder.path() / "ca.key";
  std::filesystem::rename(files.ca_key, key);
  const auto kept = ensureTlsFiles(files, {.hosts = {"b.example.org"}, .own = {"box.example.org"}});
  ASSERT_TRUE(kept.ok()) << kept.error().message;
  EXPECT_FALSE(*kept);
  const auto refused = ensureTlsFiles(files, {.hosts = {"c.example.org"}, .own = {"box.example.org"}});
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, testing::HasSubstr("is not for"));
  // together with the key it gets the machine's name, too
  std::filesystem::rename(key, files.ca_key);
  EXPECT_TRUE(*ensureTlsFiles(files, {.hosts = {"b.example.org"}, .own = {"box.example.org"}}));
}

TEST(Certificates, anInvalidHostIsRefused) {
  const TempFolder folder;
  for (const char* host : {"", "a b", "x,DNS:y", "evil:1"}) {
    EXPECT_EQ(ensureTlsFiles(tlsFilesIn(folder.path()), {{host}}).error().code, ErrorCode::kInvalidInput)
        << host;
  }
}

TEST(Certificates, theAuthorityMaySignNamesOfItsDomainsAndPrivateAddressesOnly) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  const std::vector<std::string> first = {"needle.lab.example.org", "203.0.113.9"};
  ASSERT_TRUE(*ensureTlsFiles(files, {.hosts = first, .domains = {"lab.example.org"}}));
  const struct {
    const char* host;
    bool may;
  } rows[] = {{"lab.example.org", true},
              {"a.b.LAB.example.org", true},
              {"localhost", true},
              {"10.1.2.3", true},
              {"172.31.0.1", true},
              {"192.168.7.7", true},
              {"::1", true},
              {"fd12::7", true},
              {"203.0.113.9", true},
              {"example.org", false},
              {"xlab.example.org", false},
              {"lab.example.org.evil", false},
              {"203.0.113.10", false},
              {"172.32.0.1", false},
              {"2001:db8::1", false},
              {"accounts.bank.example", false}};
  for (const auto& row : rows) {
    const auto renewed = renewServerCertificate(files, {row.host});
    EXPECT_EQ(renewed.ok(), row.may) << row.host << (renewed.ok() ? "" : ": " + renewed.error().message);
    if (renewed.ok()) continue;
    EXPECT_EQ(renewed.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(renewed.error().message,
                testing::AllOf(testing::HasSubstr(row.host), testing::HasSubstr("lab.example.org"),
                               testing::HasSubstr("certificate authority prepare")));
  }
}

TEST(Certificates, aMachineThatIsRenamedServesOnWithoutItsNewName) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(*ensureTlsFiles(files, {.hosts = {"lab.example.org"}, .own = {"box"}}));
  EXPECT_FALSE(*ensureTlsFiles(files, {.hosts = {"lab.example.org"}, .own = {"crate"}}));
  EXPECT_THAT(readCertificate(files.certificate)->hosts, testing::ElementsAre("box", "lab.example.org"));
}

TEST(Certificates, aRefusedNameMakesNoFile) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path() / "tls");
  const auto refused = ensureTlsFiles(files, {.hosts = {"bank.example"}, .domains = {"lab.example.org"}});
  ASSERT_FALSE(refused.ok());
  EXPECT_FALSE(std::filesystem::exists(files.ca_certificate));
  EXPECT_FALSE(std::filesystem::exists(files.ca_key));
}

// a server compares fingerprints to see whether it must load new files: a fingerprint of the new files with
// the old context would keep it from ever loading them
TEST(Certificates, whatAContextShowsStaysWhenTheFilesAreReplaced) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  const auto before = *readCertificate(files.certificate);
  const auto server = makeServerTls(files.certificate, files.key);
  ASSERT_TRUE(server.ok()) << server.error().message;
  ASSERT_TRUE(renewServerCertificate(files, {"localhost"}).ok());
  EXPECT_NE(readCertificate(files.certificate)->sha256, before.sha256);
  EXPECT_EQ(shownCertificate(*server)->sha256, before.sha256);
  EXPECT_EQ(shownCertificate(*makeServerTls(files.certificate, files.key))->sha256,
            readCertificate(files.certificate)->sha256);
}

TEST(Tls, missingAndWrongFilesAreNamed) {
  const TempFolder folder;
  const auto no_file = makeClientTls(folder.path() / "ca.crt");
  EXPECT_EQ(no_file.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(no_file.error().message, testing::HasSubstr("ca.crt"));
  const auto garbage = folder.write("server.crt", "not a certificate");
  EXPECT_EQ(makeServerTls(garbage, garbage).error().code, ErrorCode::kInvalidInput);
}

/// Runs a handshake between the two; the client expects `host`. Returns the client's status.
Status handshake(const TlsContext& server_tls, const TlsContext& client_tls, const std::string& host) {
  test::Loopback loop;
  auto [far, near] = loop.sockets();
  auto server = Channel::make(TlsStream(std::move(far), *server_tls), {});
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

Status handshakeWith(const TlsContext& client_tls, const std::string& host) {
  return handshake(test::TestTls::get().server, client_tls, host);
}

/// Signs a server's certificate for `host` with the authority's key, bypassing maySign.
void forge(const TlsFiles& files, const std::string& host) {
  const auto authority = loadAuthority(files);
  ASSERT_TRUE(authority.ok());
  X509* const ca = authority->certificate.get();
  const auto key = x509::newKey();
  const auto made = x509::draft(key.get(), host, 10);
  ASSERT_TRUE(made.ok());
  X509* const server = made->get();
  ASSERT_EQ(X509_set_issuer_name(server, X509_get_subject_name(ca)), 1);
  ASSERT_TRUE(x509::addExtension(server, ca, NID_ext_key_usage, "serverAuth"));
  ASSERT_TRUE(x509::addExtension(server, ca, NID_subject_alt_name, "DNS:" + host));
  ASSERT_GT(X509_sign(server, authority->key.get(), EVP_sha256()), 0);
  EXPECT_TRUE(x509::saveKey(files.key, key.get()).ok());
  EXPECT_TRUE(x509::saveCertificates(files.certificate, {server}).ok());
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

// what a thief of ca.key would make: OpenSSL's client refuses the name despite the valid signature
TEST(Tls, everyPeerRefusesANameTheAuthorityMayNotSign) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {.hosts = {"localhost"}, .domains = {"lab.example.org"}}).ok());
  const auto client = makeClientTls(files.ca_certificate);
  EXPECT_TRUE(handshake(*makeServerTls(files.certificate, files.key), *client, "localhost").ok());
  forge(files, "accounts.bank.example");
  const auto refused =
      handshake(*makeServerTls(files.certificate, files.key), *client, "accounts.bank.example");
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, testing::HasSubstr("permitted subtree violation"));
}

TEST(Tls, anAuthorityIsFollowedByAnotherWithoutABreak) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  const auto shakes = [&](const TlsContext& client) {
    return handshake(*makeServerTls(files.certificate, files.key), client, "localhost").ok();
  };
  const auto before = *makeClientTls(files.ca_certificate);
  EXPECT_TRUE(prepareAuthority(files, {"lab.example.org"}).ok());
  EXPECT_FALSE(prepareAuthority(files, {"lab.example.org"}).ok()) << "one at a time";
  const auto between = *makeClientTls(files.ca_certificate);
  EXPECT_TRUE(shakes(before));
  EXPECT_TRUE(shakes(between));
  EXPECT_TRUE(switchAuthority(files).ok());
  EXPECT_FALSE(shakes(before)) << "a client without the new ca.crt";
  EXPECT_TRUE(shakes(between));
  EXPECT_FALSE(*ensureTlsFiles(files, {{"localhost"}})) << "a start finds nothing to do";
  EXPECT_TRUE(dropOldAuthorities(files).ok());
  const auto after = *makeClientTls(files.ca_certificate);
  EXPECT_TRUE(shakes(after));
  EXPECT_EQ(readCertificates(files.ca_certificate)->size(), 1u);
  EXPECT_TRUE(renewServerCertificate(files, {"desk.lab.example.org"}).ok());
  EXPECT_TRUE(shakes(after));
}

TEST(Certificates, aPreparationThatWasCutOffIsRepeatedBeforeTheSwitch) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  const auto old = *readWholeFile(files.ca_certificate);
  ASSERT_TRUE(prepareAuthority(files, {}).ok());
  folder.write("ca.crt", old);  // the last step is missing
  const auto refused = switchAuthority(files);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, testing::HasSubstr("prepare` was cut off"));
  ASSERT_TRUE(prepareAuthority(files, {}).ok());
  EXPECT_EQ(readCertificates(files.ca_certificate)->size(), 2u);
  EXPECT_TRUE(switchAuthority(files).ok());
}

/// An authority that is valid from `begin_days` to `end_days`, counted from now.
Authority authorityOf(long begin_days, long end_days) {
  auto made = makeAuthority(*permittedNames({}, {"localhost"}));
  EXPECT_TRUE(made.ok());
  X509* const certificate = made->certificate.get();
  X509_gmtime_adj(X509_getm_notBefore(certificate), begin_days * 86'400);
  X509_gmtime_adj(X509_getm_notAfter(certificate), end_days * 86'400);
  EXPECT_GT(X509_sign(certificate, made->key.get(), EVP_sha256()), 0);
  return std::move(*made);
}

// The clock was ahead when it was made, or is behind now: impossible to tell here, and peers have their own
// clocks.
TEST(Certificates, anAuthorityInvalidByThisClockIsNamedAndCertificatesStay) {
  const struct {
    long begin_days, end_days;
    std::vector<std::string> words;
  } kCases[] = {{400, 4000, {"is valid from", "it was ahead when the authority was made: move the folder"}},
                {-400, -1, {"has expired on", "If it is right, move the folder"}}};
  for (const auto& [begin_days, end_days, words] : kCases) {
    SCOPED_TRACE(begin_days);
    const TempFolder folder;
    const auto files = tlsFilesIn(folder.path());
    const Authority authority = authorityOf(begin_days, end_days);
    ASSERT_TRUE(x509::saveKey(files.ca_key, authority.key.get()).ok());
    ASSERT_TRUE(x509::saveCertificates(files.ca_certificate, {authority.certificate.get()}).ok());
    EXPECT_TRUE(*ensureTlsFiles(files, {{"localhost"}})) << "a peer whose clock is another accepts it";
    const auto before = *readWholeFile(files.certificate);
    EXPECT_FALSE(*ensureTlsFiles(files, {{"localhost", "10.0.0.7"}}));
    const auto renewed = renewServerCertificate(files, {"localhost"});
    ASSERT_FALSE(renewed.ok());
    EXPECT_EQ(renewed.error().code, ErrorCode::kFailed);
    for (const std::string& text : {clockFault(files), renewed.error().message}) {
      for (const std::string& part : words) EXPECT_THAT(text, testing::HasSubstr(part));
      EXPECT_THAT(text, testing::HasSubstr(files.ca_certificate.string()));
    }
    EXPECT_EQ(*readWholeFile(files.certificate), before);
  }
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  EXPECT_EQ(clockFault(files), "") << "no authority yet";
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  EXPECT_EQ(clockFault(files), "");
}

TEST(Certificates, aPreparedAuthorityThatNoPeerAcceptsYetIsNotSwitchedTo) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  const auto old = x509::loadCertificate(files.ca_certificate);
  ASSERT_TRUE(old.ok());
  const Authority next = authorityOf(400, 4000);
  ASSERT_TRUE(x509::saveKey(files.next_ca_key, next.key.get()).ok());
  ASSERT_TRUE(x509::saveCertificates(files.next_ca_certificate, {next.certificate.get()}).ok());
  ASSERT_TRUE(x509::saveCertificates(files.ca_certificate, {old->get(), next.certificate.get()}).ok());
  const auto refused = switchAuthority(files);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, testing::HasSubstr("then `certificate authority drop`"));
  EXPECT_FALSE(*ensureTlsFiles(files, {{"localhost"}})) << "the old one serves on";
  // following the text's advice
  std::filesystem::remove(files.next_ca_certificate);
  std::filesystem::remove(files.next_ca_key);
  EXPECT_TRUE(dropOldAuthorities(files).ok());
  EXPECT_EQ(readCertificates(files.ca_certificate)->size(), 1u);
  EXPECT_TRUE(prepareAuthority(files, {}).ok());
  EXPECT_TRUE(switchAuthority(files).ok());
}

TEST(Certificates, aServersShortNameGoesWithItToTheNewAuthority) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {.hosts = {"needle.example.org"}, .own = {"box", "localhost"}}).ok());
  EXPECT_EQ(prepareAuthority(files, {"other.example"}).error().code, ErrorCode::kInvalidInput);
  EXPECT_FALSE(std::filesystem::exists(files.next_ca_certificate));
  ASSERT_TRUE(prepareAuthority(files, {"example.org"}).ok());
  ASSERT_TRUE(switchAuthority(files).ok());
  EXPECT_THAT(readCertificate(files.certificate)->hosts,
              testing::UnorderedElementsAre("box", "localhost", "needle.example.org"));
}

TEST(Tls, aCutOffSwitchServesAtEachStepAndIsRepeated) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  EXPECT_TRUE(prepareAuthority(files, {}).ok());
  const auto bundle = *readWholeFile(files.ca_certificate), next = *readWholeFile(files.next_ca_certificate);
  const auto next_key = *readWholeFile(files.next_ca_key), old_key = *readWholeFile(files.ca_key);
  const auto client = *makeClientTls(files.ca_certificate);
  EXPECT_TRUE(switchAuthority(files).ok());
  const auto serves = [&] {
    const auto made = ensureTlsFiles(files, {{"localhost"}});
    return made.ok() && !*made &&
           handshake(*makeServerTls(files.certificate, files.key), client, "localhost").ok();
  };
  // after the server's certificate, and after the key
  folder.write("ca.crt", bundle);
  folder.write("ca-next.crt", next);
  EXPECT_TRUE(serves());
  folder.write("ca-next.key", next_key);
  folder.write("ca.key", old_key);
  for (const auto& key : {files.ca_key, files.next_ca_key})
    std::filesystem::permissions(key, std::filesystem::perms(0600));
  EXPECT_TRUE(serves());
  EXPECT_TRUE(switchAuthority(files).ok());
  EXPECT_TRUE(serves());
  EXPECT_FALSE(std::filesystem::exists(files.next_ca_key));
  EXPECT_FALSE(std::filesystem::exists(files.next_ca_certificate));
}

TEST(Certificates, theMovedKeyIsTheSameAndNothingIsWrittenOver) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path() / "tls");
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  const auto key = *readWholeFile(files.ca_key);
  const auto there = folder.write("there", "a letter");
  EXPECT_EQ(moveAuthorityKey(files, there).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(*readWholeFile(there), "a letter");
  EXPECT_TRUE(moveAuthorityKey(files, folder.path() / "stick.key").ok());
  EXPECT_EQ(*readWholeFile(folder.path() / "stick.key"), key);
  EXPECT_FALSE(std::filesystem::exists(files.ca_key));
  EXPECT_FALSE(*ensureTlsFiles(files, {{"localhost"}})) << "the server starts without it";
}

TEST(Certificates, aLostAuthorityIsNeverReplaced) {
  for (const auto kept : {&TlsFiles::certificate, &TlsFiles::key}) {
    const TempFolder folder;
    const auto files = tlsFilesIn(folder.path() / "tls");
    ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
    const auto authority = *readWholeFile(files.ca_certificate), key = *readWholeFile(files.ca_key);
    std::filesystem::remove(files.ca_certificate);
    std::filesystem::remove(kept == &TlsFiles::key ? files.certificate : files.key);
    const auto refused = ensureTlsFiles(files, {{"localhost"}});
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(refused.error().message, testing::HasSubstr(files.ca_certificate.string() + " is lost"));
    EXPECT_THAT(refused.error().message, testing::HasSubstr((files.*kept).string()));
    EXPECT_THAT(refused.error().message, testing::HasSubstr("put ca.crt back"));
    EXPECT_FALSE(std::filesystem::exists(files.ca_certificate));
    EXPECT_EQ(*readWholeFile(files.ca_key), key);
    // a station's copy repairs it for all others, too
    folder.write("tls/ca.crt", authority);
    EXPECT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
    EXPECT_EQ(*readWholeFile(files.ca_key), key);
  }
}

TEST(Tls, anInterruptedFirstStartsKeyIsReused) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path() / "tls");
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  const auto key = *readWholeFile(files.ca_key);
  const auto client = *makeClientTls(files.ca_certificate);
  for (const auto& gone : {files.ca_certificate, files.certificate, files.key}) std::filesystem::remove(gone);
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  EXPECT_EQ(*readWholeFile(files.ca_key), key);
  EXPECT_TRUE(handshake(*makeServerTls(files.certificate, files.key), client, "localhost").ok())
      << "a client that trusts the earlier authority continues";
}

/// A writer of `path` that is killed before it finishes.
void leaveCutOff(const std::filesystem::path& path) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto file = GrowingFile::create(path);
    if (file.ok()) (void)file->append(viewOf(std::string_view("half a key")));
    ::_exit(0);  // like a kill: no clean-up
  }
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
}

std::set<std::string> namesIn(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) names.insert(entry.path().filename());
  return names;
}

TEST(TlsFolder, aPipeInTheFilesPlacesIsRefusedByName) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path() / "tls");
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  for (const auto& path : {files.ca_certificate, files.ca_key, files.certificate, files.key,
                           files.next_ca_certificate, files.next_ca_key}) {
    SCOPED_TRACE(path);
    const auto aside = folder.path() / "aside";
    const bool was = std::filesystem::exists(path);
    if (was) std::filesystem::rename(path, aside);
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
    const auto refused = ensureTlsFiles(files, {{"localhost"}});
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(refused.error().message.find(path.string() + ": is a pipe"), std::string::npos)
        << refused.error().message;
    std::filesystem::remove(path);
    if (was) std::filesystem::rename(aside, path);
    EXPECT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  }
}

TEST(TlsFolder, whatAKilledWriterLeavesIsRemovedAndNothingElse) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path() / "tls");
  EXPECT_TRUE(removeTlsLeftovers(files)->empty()) << "without a folder";
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  // names that a person may have chosen, a folder, and links
  for (const char* name :
       {"ca.key.backup", "ca.key.202611", "ca.key.being-written-a-b_cd", "other.key.being-written-Ab12Cd",
        "ca.keyXAb12Cd", "ca.key.being-written-Ab12Cd.crt", "being-written-Ab12Cd"})
    folder.write(std::string("tls/") + name, "kept");
  std::filesystem::create_directory(folder.path() / "tls/server.key.being-written-Ab12Cd");
  std::filesystem::create_symlink(files.ca_key, folder.path() / "tls/ca.crt.being-written-Ab12Cd");
  const auto before = namesIn(folder.path() / "tls");
  for (const auto& path : {files.ca_key, files.ca_key, files.ca_certificate, files.key, files.certificate,
                           files.next_ca_key, files.next_ca_certificate})
    leaveCutOff(path);
  std::vector<std::string> left;
  for (const std::string& name : namesIn(folder.path() / "tls"))
    if (!before.contains(name)) left.push_back((folder.path() / "tls" / name).string());
  ASSERT_EQ(left.size(), 7u);
  using std::filesystem::perms;
  for (const std::string& path : left)
    EXPECT_EQ(std::filesystem::status(path).permissions(), perms::owner_read | perms::owner_write) << path;
  {
    const TlsFolderUse somebody_writes(files);
    const TlsFolderUse and_another(files);
    EXPECT_TRUE(removeTlsLeftovers(files)->empty());
  }
  EXPECT_EQ(*removeTlsLeftovers(files), left);
  EXPECT_EQ(namesIn(folder.path() / "tls"), before);
  EXPECT_TRUE(removeTlsLeftovers(files)->empty());
}

TEST(Tls, anotherAuthoritysServerIsRefused) {
  const TempFolder folder;
  const auto files = tlsFilesIn(folder.path());
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
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
