// `server join`: the data folder of a further server on one database.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "common/base/files/files.h"
#include "common/wire/certificates.h"
#include "db/audit/audit_chain.h"
#include "db/erasure/erasure.h"
#include "db/people/pseudonyms.h"
#include "db/store/store_address.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class ServerJoin : public test::AdminTest {
 protected:
  /// A folder as left by a server that works with others.
  void SetUp() override {
    fs::create_directory(from());
    ASSERT_OK(writeStoreFile(from(), {"postgresql://needlelab@db/lab", "the-lab"}));
    ASSERT_OK(AuditKey::ofFolder(from()));
    ASSERT_OK(PseudonymKey::ofFolder(from()));
    ASSERT_OK(writeErasures(from(), {{makeUuidV7(), makeUuidV7(), 5}}));
    ASSERT_OK(
        ensureTlsFiles(tlsFilesIn(from() / "tls"), {.hosts = {"a.example.org"}, .domains = {"example.org"}}));
    // files that belong to that server alone
    for (const char* const own : {"lock", "acknowledged"}) write(own, "1\n");
  }
  [[nodiscard]] fs::path from() const { return folder.path() / "first"; }
  [[nodiscard]] fs::path to() const { return folder.path() / "second"; }
  void write(const std::string& name, const std::string& text) const { std::ofstream(from() / name) << text; }

  Run join(std::vector<std::string> more = {"--host-name", "b.example.org"}) const {
    std::vector<std::string> all = {"--data", to().string(), "server", "join", "--from", from().string()};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  }
  static std::vector<std::string> filesIn(const fs::path& in) {
    std::vector<std::string> all;
    for (const auto& entry : fs::recursive_directory_iterator(in))
      all.push_back(entry.path().lexically_relative(in));
    std::sort(all.begin(), all.end());
    return all;
  }
  static unsigned modeOf(const fs::path& path) {
    struct stat info {};
    EXPECT_EQ(::lstat(path.c_str(), &info), 0) << path;
    return info.st_mode & 07777;
  }
  /// Expects a refusal that leaves everything as it was.
  void refuses(const std::string& words,
               std::vector<std::string> more = {"--host-name", "b.example.org"}) const {
    const auto before = filesIn(folder.path());
    const Run result = join(std::move(more));
    EXPECT_EQ(result.code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_EQ(filesIn(folder.path()), before) << words << ": something was written";
  }
};

TEST_F(ServerJoin, theFolderHasTheLabsKeysAndItsOwnCertificate) {
  const Run result = join({"--host-name", "b.example.org", "--name", "b"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("the server 'b'"));
  EXPECT_THAT(filesIn(to()), ElementsAre("audit.key", "erasures", "pseudonym.key", "server", "store", "tls",
                                         "tls/ca.crt", "tls/server.crt", "tls/server.key"));
  for (const char* const same : {"audit.key", "pseudonym.key", "erasures", "store", "tls/ca.crt"})
    EXPECT_EQ(*readWholeFile(to() / same), *readWholeFile(from() / same)) << same;
  EXPECT_EQ(test::TestDb::must(serverNameOf(to())), "b");
  EXPECT_EQ(test::TestDb::must(serverNameOf(from())), kFirstServer);
  const auto facts = test::TestDb::must(readCertificate(to() / "tls/server.crt"));
  EXPECT_THAT(facts.hosts, testing::IsSupersetOf({"b.example.org", "localhost", "127.0.0.1"}));
  EXPECT_NE(*readWholeFile(to() / "tls/server.key"), *readWholeFile(from() / "tls/server.key"));
  // others cannot read the keys
  EXPECT_EQ(modeOf(to()), 0700u);
  EXPECT_EQ(modeOf(to() / "tls"), 0700u);
  for (const char* const own : {"audit.key", "pseudonym.key", "erasures", "store", "tls/server.key"})
    EXPECT_EQ(modeOf(to() / own), 0600u) << own;
  EXPECT_EQ(modeOf(to() / "tls/ca.crt"), 0644u);
  EXPECT_FALSE(fs::exists(to().string() + ".joining"));
}

TEST_F(ServerJoin, theAuthorityComesAlongWhereItIsAskedFor) {
  fs::create_directory(to());  // an empty folder counts as missing
  const Run result = join({"--with-authority"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(*readWholeFile(to() / "tls/ca.key"), *readWholeFile(from() / "tls/ca.key"));
  EXPECT_EQ(modeOf(to() / "tls/ca.key"), 0600u);
  EXPECT_FALSE(fs::exists(to() / "tls/server.key")) << "its first start makes one, for its own names";
  EXPECT_THAT(result.out, HasSubstr("certificate move-key"));
  EXPECT_NE(test::TestDb::must(serverNameOf(to())), kFirstServer);
}

TEST_F(ServerJoin, wrongPlacesAreRefused) {
  refuses("server join: give each --host-name", {});
  refuses("is another server's name", {"--host-name", "b.example.org", "--name", "first"});
  refuses("letters, digits and '-'", {"--host-name", "b.example.org", "--name", "b c"});
  // the lab's authority may not sign this name
  refuses("elsewhere.net", {"--host-name", "b.elsewhere.net"});
  fs::create_directory(to());
  std::ofstream(to() / "something") << "x";
  refuses("is not empty: a server that joins gets a folder of its own");
  fs::remove(to() / "something");
  fs::remove(to());
  std::ofstream(to().string()) << "x";
  refuses("is not a folder");
  fs::remove(to());
  Run inside = run({"--data", (from() / "b").string(), "server", "join", "--from", from().string(),
                    "--host-name", "b.example.org"});
  EXPECT_EQ(inside.code, 2);
  EXPECT_THAT(inside.err, HasSubstr("lies in the other server's folder"));
  Run nowhere = run({"--data", file("none/b"), "server", "join", "--from", from().string(), "--host-name",
                     "b.example.org"});
  EXPECT_EQ(nowhere.code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("the folder above it is not there"));
}

TEST_F(ServerJoin, wrongSourcesAreRefused) {
  const auto without = [&](const std::string& name, const std::string& words) {
    fs::rename(from() / name, folder.path() / "kept");
    refuses(words);
    fs::rename(folder.path() / "kept", from() / name);
  };
  without("audit.key", "start that server once with --together, then join");
  without("pseudonym.key", "start that server once with --together, then join");
  without("tls/ca.key", "put it back (chmod 600) for this command");
  without("tls/ca.crt", "start that server once, then join");
  without("store", "is not a server's data folder");
  fs::rename(from() / "store", folder.path() / "kept");
  write("needlelab.db", "");
  refuses("its database is an SQLite file, which one server has for itself");
  fs::remove(from() / "needlelab.db");
  fs::rename(folder.path() / "kept", from() / "store");
  ASSERT_OK(writeStoreFile(from(), {"postgresql://needlelab@db/lab", "the-lab", "needlelab.db.replaced-1"}));
  refuses("its move to PostgreSQL is not done");
  ASSERT_OK(writeStoreFile(from(), {"postgresql://needlelab@db/lab", "the-lab"}));
  write("erasures", "no list\n");
  const Run broken = join();
  EXPECT_NE(broken.code, 0);
  EXPECT_FALSE(fs::exists(to()));
  EXPECT_FALSE(fs::exists(to().string() + ".joining"));
}

// leftovers of a killed command do no harm
TEST_F(ServerJoin, aHalfMadeFolderIsReplaced) {
  fs::create_directories(to().string() + ".joining/tls");
  std::ofstream(to().string() + ".joining/audit.key") << "half";
  const Run result = join();
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(*readWholeFile(to() / "audit.key"), *readWholeFile(from() / "audit.key"));
  EXPECT_FALSE(fs::exists(to().string() + ".joining"));
}

}  // namespace
}  // namespace needlelab
