#include "db/backup/encrypted_backup.h"

#include <gmock/gmock.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

#include "common/base/files/files.h"
#include "db/backup/backup.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// from db/README.md, "Encrypted backups"
constexpr std::size_t kHeader = 56, kTag = 17, kPiece = 65'536;

class EncryptedFile : public testing::Test {
 protected:
  /// Encrypts `bytes` bytes that differ from each other. Returns the file.
  fs::path encrypted(std::size_t bytes, const std::string& name = "x.nlbk") {
    plain_.clear();
    for (std::size_t i = 0; i < bytes; ++i) plain_ += static_cast<char>((i * 2'654'435'761u) >> 13);
    const auto from = folder.write("plain", plain_);
    const auto to = folder.path() / name;
    fs::remove(to);
    const auto hash = encryptFile(from, to, key);
    EXPECT_OK(hash);
    return to;
  }
  /// What a reader received, and the final result.
  struct Read {
    std::string plain;
    Result<PlainHash> end;
  };
  Read read(const fs::path& file, const BackupKey& with) {
    std::string plain;
    auto end = decryptFile(file, with, [&](ByteView bytes) {
      plain += textOf(bytes);
      return Status();
    });
    return {plain, std::move(end)};
  }
  /// The result of reading these bytes as a backup.
  Result<PlainHash> endOf(const std::string& bytes) { return read(folder.write("bad.nlbk", bytes), key).end; }

  test::TempFolder folder;
  const BackupKey key = test::TestDb::must(BackupKey::make(folder.path() / "backup.key"));
  std::string plain_;
};

TEST_F(EncryptedFile, survivesARoundTripAtAnyLength) {
  for (const std::size_t bytes :
       {std::size_t{0}, std::size_t{1}, kPiece - 1, kPiece, kPiece + 1, 3 * kPiece, 200'000ul}) {
    const auto file = encrypted(bytes);
    const std::size_t pieces = bytes == 0 ? 1 : (bytes + kPiece - 1) / kPiece;
    EXPECT_EQ(fs::file_size(file), kHeader + bytes + pieces * kTag);
    const Read back = read(file, key);
    EXPECT_OK(back.end);
    EXPECT_EQ(back.plain, plain_) << bytes;
    EXPECT_TRUE(isEncryptedBackup(file));
    struct stat info {};
    ASSERT_EQ(::stat(file.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777u, 0600u);
  }
}

TEST_F(EncryptedFile, aPipeInItsPlaceIsNotWaitedFor) {
  const auto pipe = folder.path() / "pipe.nlbk";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_FALSE(read(pipe, key).end.ok());
  EXPECT_FALSE(isEncryptedBackup(pipe));
}

TEST_F(EncryptedFile, showsNothingOfItsContentsAndIsNewEachTime) {
  const std::string first = *readWholeFile(encrypted(100'000, "a.nlbk"));
  const std::string second = *readWholeFile(encrypted(100'000, "b.nlbk"));
  EXPECT_EQ(first.find(plain_.substr(1'000, 16)), std::string::npos);
  EXPECT_EQ(first.substr(0, 32), second.substr(0, 32)) << "what says which key it wants";
  EXPECT_NE(first.substr(32), second.substr(32));
}

TEST_F(EncryptedFile, withABitFlippedAnywhereIsRefused) {
  const std::string good = *readWholeFile(encrypted(2 * kPiece + 100));
  const std::size_t second = kHeader + kPiece + kTag, last = second + kPiece + kTag;
  // magic, format, piece size, key id, stream header; then for each piece its tag, body, authenticator
  std::vector<std::size_t> places;
  for (std::size_t at = 0; at < kHeader; ++at) places.push_back(at);
  for (const std::size_t at : {kHeader, second, last})
    for (const std::size_t in : {std::size_t{0}, std::size_t{1}, std::size_t{50}}) places.push_back(at + in);
  for (const std::size_t end : {second, last, good.size()}) places.push_back(end - 1);
  for (const std::size_t at : places) {
    for (const unsigned bit : {0u, 7u}) {
      std::string bad = good;
      bad[at] = static_cast<char>(static_cast<unsigned char>(bad[at]) ^ (1u << bit));
      const auto end = endOf(bad);
      ASSERT_FALSE(end.ok()) << "bit " << bit << " of byte " << at;
      EXPECT_THAT(end.error().message, HasSubstr("bad.nlbk")) << at;
    }
  }
  EXPECT_OK(endOf(good));
}

TEST_F(EncryptedFile, thatIsCutOffOrLongerIsRefused) {
  const std::string good = *readWholeFile(encrypted(2 * kPiece));
  // at each piece boundary, where all remaining pieces are intact, and next to it
  for (const std::size_t at :
       {std::size_t{0}, std::size_t{7}, std::size_t{8}, kHeader - 1, kHeader, kHeader + 1, kHeader + kTag - 1,
        kHeader + kPiece + kTag - 1, kHeader + kPiece + kTag, kHeader + kPiece + kTag + 1, good.size() - kTag,
        good.size() - 1}) {
    const auto end = endOf(good.substr(0, at));
    ASSERT_FALSE(end.ok()) << at;
    EXPECT_EQ(end.error().code, ErrorCode::kCorrupt) << at;
  }
  EXPECT_THAT(endOf(good.substr(0, kHeader + kPiece + kTag)).error().message,
              HasSubstr("is cut off after 65609 bytes"));
  EXPECT_THAT(endOf(good + "x").error().message, HasSubstr("has bytes after its end"));
}

TEST_F(EncryptedFile, withPiecesInAnotherOrderOrOfAnotherBackupIsRefused) {
  const std::string other = *readWholeFile(encrypted(3 * kPiece, "other.nlbk"));
  const std::string good = *readWholeFile(encrypted(3 * kPiece));
  const std::size_t size = kPiece + kTag;
  const auto piece = [&](const std::string& of, std::size_t n) {
    return of.substr(kHeader + n * size, size);
  };
  const std::string header = good.substr(0, kHeader);
  ASSERT_OK(endOf(header + piece(good, 0) + piece(good, 1) + piece(good, 2)));
  for (const std::string& bad :
       {header + piece(good, 1) + piece(good, 0) + piece(good, 2), header + piece(good, 0) + piece(good, 2),
        header + piece(good, 0) + piece(good, 0) + piece(good, 1) + piece(good, 2),
        header + piece(good, 0) + piece(other, 1) + piece(good, 2),
        header + piece(good, 0) + piece(good, 1) + piece(other, 2)})
    EXPECT_EQ(endOf(bad).error().code, ErrorCode::kCorrupt);
}

TEST_F(EncryptedFile, namesTheKeyThatItWants) {
  const auto other = BackupKey::make(folder.path() / "other.key");
  ASSERT_OK(other);
  const Read wrong = read(encrypted(100), *other);
  ASSERT_FALSE(wrong.end.ok());
  EXPECT_EQ(wrong.end.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(wrong.end.error().message, HasSubstr("is encrypted with the key " + key.idText() +
                                                   ", the given one is " + other->idText()));
  EXPECT_EQ(wrong.plain, "");
}

TEST_F(EncryptedFile, aNewerFormatOrInvalidPieceLengthIsRefusedBeforeAllocation) {
  std::string bytes = *readWholeFile(encrypted(100));
  std::string newer = bytes;
  newer[8] = 2;
  EXPECT_EQ(endOf(newer).error().code, ErrorCode::kVersion);
  for (const std::uint32_t length : {0u, 4'095u, (1u << 20) + 1, 0xffff'ffffu}) {
    std::string bad = bytes;
    std::memcpy(bad.data() + 12, &length, sizeof length);
    EXPECT_THAT(endOf(bad).error().message,
                HasSubstr("its pieces have " + std::to_string(length) + " bytes"));
  }
}

TEST_F(EncryptedFile, aKeyIsReadBackAndNeverOverwrittenOrShared) {
  const auto path = folder.path() / "backup.key";
  const std::string text = *readWholeFile(path);
  EXPECT_EQ(text.size(), 65u) << "64 digits and a line's end";
  struct stat info {};
  ASSERT_EQ(::stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0600u);
  EXPECT_EQ(BackupKey::read(path)->id(), key.id());
  EXPECT_EQ(BackupKey::make(path).error().code, ErrorCode::kAlreadyExists);
  EXPECT_EQ(*readWholeFile(path), text);
  EXPECT_EQ(BackupKey::make(folder.path() / "none" / "k").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(BackupKey::read(folder.path() / "none").error().code, ErrorCode::kInvalidInput);
  for (const std::string& bad :
       {std::string(), text.substr(0, 63), text.substr(0, 64) + "00", "x" + text.substr(1)}) {
    const auto file = folder.write("bad.key", bad);
    ASSERT_EQ(::chmod(file.c_str(), 0600), 0);
    EXPECT_THAT(BackupKey::read(file).error().message, HasSubstr("a key is one line of 64 digits")) << bad;
  }
  ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
  EXPECT_THAT(BackupKey::read(path).error().message, HasSubstr("may be read by others: chmod 600"));
}

TEST_F(EncryptedFile, aCredentialOfSystemdIsTheKeyUnlessAnotherIsGiven) {
  const char* const before = std::getenv("CREDENTIALS_DIRECTORY");
  const std::string kept = before != nullptr ? before : "";
  ::setenv("CREDENTIALS_DIRECTORY", folder.path().c_str(), 1);
  EXPECT_EQ(backupKeyFile({}), folder.path() / "backup.key");
  EXPECT_EQ(backupKeyFile("/mine"), "/mine");
  // systemd gives the unit's user access through an ACL, which the mode shows as group permission
  ASSERT_EQ(::chmod((folder.path() / "backup.key").c_str(), 0440), 0);
  EXPECT_OK(BackupKey::read(folder.path() / "backup.key"));
  fs::remove(folder.path() / "backup.key");
  EXPECT_EQ(backupKeyFile({}), "") << "a unit with other credentials";
  ::unsetenv("CREDENTIALS_DIRECTORY");
  EXPECT_EQ(backupKeyFile({}), "");
  if (before != nullptr) ::setenv("CREDENTIALS_DIRECTORY", kept.c_str(), 1);
}

class EncryptedBackup : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK(store.open(test::describe(id), 1));
    for (std::uint64_t seq = 0; seq < 5; ++seq) ASSERT_OK(store.append(id, seq, test::chunkOf(seq)));
    fs::create_directory(target.parent_path());
  }
  test::TestDb db;
  SessionStore store{db.writer};
  Connection reader = db.reader();
  const Uuid id = makeUuidV7();
  const BackupKey key = test::TestDb::must(BackupKey::make(db.folder.path() / "backup.key"));
  const fs::path target = db.folder.path() / "stick" / "copy.nlbk";
};

TEST_F(EncryptedBackup, isTheDatabaseAndLeavesNothingPlainBehind) {
  // every name created on the backup's disk
  const int watch = ::inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  ASSERT_GE(::inotify_add_watch(watch, target.parent_path().c_str(), IN_CREATE | IN_MOVED_TO), 0);
  const auto result = encryptedBackupTo(reader, target, key);
  ASSERT_OK(result);
  alignas(inotify_event) char events[4096] = {};
  const ssize_t count = ::read(watch, events, sizeof events);
  ::close(watch);
  std::vector<std::string> names;
  for (ssize_t at = 0; at < count;) {
    inotify_event event{};
    std::memcpy(&event, events + at, sizeof event);
    names.emplace_back(events + at + sizeof event);
    at += static_cast<ssize_t>(sizeof event + event.len);
  }
  EXPECT_EQ(names, (std::vector<std::string>{"copy.nlbk.partial", "copy.nlbk"}))
      << "no plain copy was ever there";
  EXPECT_EQ(result->chunks_verified, 5u);
  EXPECT_EQ(result->bytes, fs::file_size(target));
  EXPECT_FALSE(fs::exists(plainCopyPath(db.path)));
  EXPECT_FALSE(fs::exists(target.string() + ".partial"));
  ASSERT_EQ(result->covered.size(), 1u);
  EXPECT_EQ(result->covered[0].chunks, 4u) << "as of a plain backup";

  std::string plain;
  ASSERT_OK(decryptFile(target, key, [&](ByteView bytes) {
    plain += textOf(bytes);
    return Status();
  }));
  auto copy = test::TestDb::must(Connection::open(db.folder.write("plain.db", plain), {}));
  EXPECT_EQ(test::dump(copy), test::dump(reader));
}

TEST_F(EncryptedBackup, isNotMadeFromDamageWithoutRoomOrOverAFile) {
  EXPECT_EQ(encryptedBackupTo(reader, target, key, nullptr, kMaxLogBytesOfBackup, std::uint64_t{1} << 60)
                .error()
                .code,
            ErrorCode::kNoRoom);
  const std::atomic<bool> ends = true;
  EXPECT_EQ(encryptedBackupTo(reader, target, key, &ends).error().code, ErrorCode::kUnavailable);
  ASSERT_OK(db.writer.script("UPDATE chunks SET crc = crc + 1 WHERE seq = 3"));
  EXPECT_EQ(encryptedBackupTo(reader, target, key).error().code, ErrorCode::kCorrupt);
  for (const auto& path : {target, fs::path(target.string() + ".partial"), plainCopyPath(db.path)})
    EXPECT_FALSE(fs::exists(path)) << path;
  std::ofstream(target) << "mine";
  EXPECT_EQ(encryptedBackupTo(reader, target, key).error().code, ErrorCode::kAlreadyExists);
  EXPECT_EQ(*readWholeFile(target), "mine");
}

}  // namespace
}  // namespace needlelab
