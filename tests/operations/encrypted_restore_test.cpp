// The drill: a server makes an encrypted backup; on an empty machine it becomes the same lab again, by its
// key only and only whole.
#include <gmock/gmock.h>

#include <functional>

#include "common/base/files/files.h"
#include "db/backup/backup.h"
#include "db/service/folder/data_folder.h"
#include "tests/unit/db/test_db.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr std::int64_t kThatDay = 1'790'000'000'000'000'000;

class EncryptedRestore : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(BackupKey::make(keyFile()).ok());
    RunningServer server([&](ServerOptions& options) { options.backup_key = keyFile(); });
    server.addStation("station-1");
    ASSERT_TRUE(server.server()
                    .store()
                    .writer()
                    .run([&](Connection& connection) -> Status {
                      SessionStore sessions(connection);
                      RETURN_IF_ERROR(sessions.open(describe(session_), 1));
                      for (std::uint64_t seq = 0; seq < 40; ++seq)
                        RETURN_IF_ERROR(sessions.append(session_, seq, chunkOf(seq)));
                      RETURN_IF_ERROR(sessions.close(closeOf(session_, 40), 2));
                      return {};
                    })
                    .ok());
    pb::Request request;
    request.mutable_backup()->set_path((folder_.path() / "stick").string());
    fs::create_directory(folder_.path() / "stick");
    request.mutable_backup()->set_keep(3);
    const auto done = server.asAdmin(request).backup_done();
    EXPECT_TRUE(done.encrypted());
    backup_ = done.path();
    EXPECT_EQ(backup_.extension(), kEncryptedEnding);
    EXPECT_EQ(done.bytes(), fs::file_size(backup_));
    // a file that is named by a person gets the end that says what it is
    request.mutable_backup()->set_keep(0);
    request.mutable_backup()->set_path((folder_.path() / "stick" / "mine").string());
    EXPECT_EQ(server.asAdmin(request).backup_done().path(),
              (folder_.path() / "stick" / "mine.nlbk").string());
    rows_ = rowsOf(server.folder() / "data" / "needlelab.db");
    EXPECT_FALSE(fs::exists(server.folder() / "data" / "needlelab.db.backup-copy"));
  }
  [[nodiscard]] fs::path keyFile() const { return folder_.path() / "backup.key"; }
  /// The recordings in a database, byte for byte, with their sessions.
  static std::vector<std::string> rowsOf(const fs::path& database) {
    auto reader = Connection::open(database, {.mode = Connection::Mode::kReader});
    if (!reader.ok()) return {reader.error().message};
    std::vector<std::string> rows;
    auto all = reader->prepare(
        "SELECT hex(s.id) || ' ' || s.state || ' ' || s.chunks || ' ' || c.seq || ' ' || hex(c.bytes) FROM "
        "sessions s"
        " JOIN chunks c ON c.session = s.number ORDER BY s.id, c.seq");
    for (auto row = all.step(); row.ok() && *row; row = all.step()) rows.emplace_back(all.text(0));
    return rows;
  }
  /// Checks that a restore into an empty folder is refused and leaves it empty but for the lock.
  void refused(const fs::path& from, const fs::path& key, ErrorCode code, const std::string& words) {
    const fs::path empty = folder_.path() / "empty";
    fs::remove_all(empty);
    fs::create_directory(empty);
    const auto result = restoreFrom(empty, from, kThatDay, key);
    ASSERT_FALSE(result.ok()) << words;
    EXPECT_EQ(result.error().code, code) << result.error().message;
    EXPECT_THAT(result.error().message, HasSubstr(words));
    for (const auto& entry : fs::directory_iterator(empty)) EXPECT_EQ(entry.path().filename(), "lock");
  }
  TempFolder folder_;
  const Uuid session_ = makeUuidV7();
  fs::path backup_;
  std::vector<std::string> rows_;
};

TEST_F(EncryptedRestore, givesAnEmptyMachineTheSameSessions) {
  ASSERT_EQ(rows_.size(), 40u);
  const fs::path machine = folder_.path() / "machine";
  fs::create_directory(machine);
  const auto result = restoreFrom(machine, backup_, kThatDay, keyFile());
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->sessions, 1u);
  EXPECT_EQ(result->chunks, 40u);
  EXPECT_EQ(rowsOf(machine / "needlelab.db"), rows_);
  auto store = Store::open(machine, {});
  ASSERT_TRUE(store.ok()) << store.error().message;
  auto reader = (*store)->readers().borrow();
  EXPECT_TRUE(SessionStore(**reader).verify(session_)->ok);
}

TEST_F(EncryptedRestore, needsTheRightKeyAndRejectsAPlainFile) {
  const fs::path other = folder_.path() / "other.key";
  ASSERT_TRUE(BackupKey::make(other).ok());
  refused(backup_, {}, ErrorCode::kInvalidInput, "is encrypted: give the file of its key (--key FILE)");
  refused(backup_, other, ErrorCode::kInvalidInput, "is encrypted with the key");
  refused(backup_, folder_.path() / "none.key", ErrorCode::kInvalidInput, "none.key");
  // an attacker who can write to the backups puts a forged one there
  const auto forged =
      folder_.write("forged.nlbk", std::string("SQLite format 3\0", 16) + std::string(4'080, '\0'));
  refused(forged, keyFile(), ErrorCode::kInvalidInput, "is not an encrypted backup, but --key was given");
}

TEST_F(EncryptedRestore, refusesEveryDamageAndChangesNothing) {
  const std::string good = *readWholeFile(backup_);
  const auto bad = [&](const std::string& bytes) { return folder_.write("bad.nlbk", bytes); };
  for (const std::size_t left : {std::size_t{20}, std::size_t{56}, good.size() / 2, good.size() - 1})
    refused(bad(good.substr(0, left)), keyFile(), ErrorCode::kCorrupt, "cut off");
  refused(bad(good + "more"), keyFile(), ErrorCode::kCorrupt, "added to");
  // the stream's header, the first piece, the middle, the last authenticator
  for (const std::size_t at : {std::size_t{40}, std::size_t{60}, good.size() / 2, good.size() - 1}) {
    std::string flipped = good;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    refused(bad(flipped), keyFile(), ErrorCode::kCorrupt, "changed or damaged");
  }
}

TEST(EncryptedRestoreServer, refusesAKeyReadableByOthers) {
  TempFolder folder;
  ASSERT_TRUE(BackupKey::make(folder.path() / "backup.key").ok());
  fs::permissions(folder.path() / "backup.key", fs::perms::group_read, fs::perm_options::add);
  ServerOptions options;
  options.data = folder.path() / "data";
  options.listen = "127.0.0.1:0";
  options.backup_key = folder.path() / "backup.key";
  const auto server = Server::start(std::move(options));
  ASSERT_FALSE(server.ok());
  EXPECT_EQ(server.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(server.error().message, HasSubstr("may be read by others"));
  EXPECT_FALSE(fs::exists(folder.path() / "data" / "needlelab.db"));
}

}  // namespace
}  // namespace needlelab
