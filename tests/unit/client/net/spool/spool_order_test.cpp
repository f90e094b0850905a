// Tests the order of the spool's disk operations: this program intercepts, records and forwards the calls
// that determine the state after a power cut.
#include <dlfcn.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <mutex>

#include "client/net/spool/spool.h"
#include "client/net/spool/spool_writer.h"
#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

struct Call {
  std::string what;
  std::filesystem::path path;
  friend bool operator==(const Call&, const Call&) = default;
};
std::mutex mutex;
std::vector<Call> calls;
bool noting = false;
bool disk_fails = false;  // fdatasync returns EIO

void note(const std::string& what, const std::filesystem::path& path) {
  const std::scoped_lock lock(mutex);
  if (noting) calls.push_back({what, path});
}

std::filesystem::path pathOf(int fd) {
  char path[PATH_MAX] = "";
  const auto length = ::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof path - 1);
  return length < 0 ? "?" : std::string(path, static_cast<std::size_t>(length));
}

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace
}  // namespace needlelab::test

// replaces libc's function
extern "C" {
int fsync(int fd) {
  needlelab::test::note("sync", needlelab::test::pathOf(fd));
  return needlelab::test::next<int(int)>("fsync")(fd);
}
int fdatasync(int fd) {
  needlelab::test::note("sync", needlelab::test::pathOf(fd));
  if (needlelab::test::disk_fails) {
    errno = EIO;
    return -1;
  }
  return needlelab::test::next<int(int)>("fdatasync")(fd);
}
int rename(const char* from, const char* to) noexcept {
  needlelab::test::note("rename", to);
  return needlelab::test::next<int(const char*, const char*)>("rename")(from, to);
}
int mkdir(const char* path, mode_t mode) noexcept {
  needlelab::test::note("mkdir", path);
  return needlelab::test::next<int(const char*, mode_t)>("mkdir")(path, mode);
}
ssize_t pwrite64(int fd, const void* data, size_t count, off64_t at) {
  needlelab::test::note("write", needlelab::test::pathOf(fd));
  return needlelab::test::next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64")(fd, data, count, at);
}
ssize_t pwrite(int fd, const void* data, size_t count, off_t at) {
  return pwrite64(fd, data, count, at);
}
}

namespace needlelab::test {
namespace {

class SpoolOrder : public testing::Test {
 protected:
  ~SpoolOrder() override { stop(); }
  static void start() {
    const std::scoped_lock lock(mutex);
    calls.clear();
    noting = true;
  }
  static std::vector<Call> stop() {
    const std::scoped_lock lock(mutex);
    noting = false;
    return std::exchange(calls, {});
  }
  // Returns the index of the first such call from `from` on, or the end if there is none.
  static std::size_t find(const std::vector<Call>& in, const std::string& what,
                          const std::filesystem::path& path, std::size_t from = 0) {
    for (std::size_t i = from; i < in.size(); ++i)
      if (in[i].what == what && in[i].path == path) return i;
    return in.size();
  }
  static std::string text(const std::vector<Call>& in) {
    std::string all;
    for (const Call& call : in) all += call.what + " " + call.path.string() + "\n";
    return all;
  }
  // A file created by rename: its bytes are synced before, its folder afterwards.
  static void expectAtomic(const std::vector<Call>& in, const std::filesystem::path& file) {
    const auto renamed = find(in, "rename", file);
    ASSERT_LT(renamed, in.size()) << file << "\n" << text(in);
    bool synced_before = false;
    for (std::size_t i = 0; i < renamed; ++i)
      synced_before =
          synced_before || (in[i].what == "sync" && in[i].path.string().starts_with(file.string() + "."));
    EXPECT_TRUE(synced_before) << text(in);
    EXPECT_LT(find(in, "sync", file.parent_path(), renamed), in.size()) << text(in);
  }
  TempFolder folder_;
};

TEST_F(SpoolOrder, aNewSpoolsOwnNameIsSynced) {
  const auto spool_folder = folder_.path() / "state" / "spool";
  std::filesystem::create_directory(folder_.path() / "state");
  start();
  ASSERT_TRUE(Spool::open(spool_folder).ok());
  const auto seen = stop();
  const auto made = find(seen, "mkdir", spool_folder);
  ASSERT_LT(made, seen.size()) << text(seen);
  EXPECT_LT(find(seen, "sync", spool_folder.parent_path(), made), seen.size()) << text(seen);
  EXPECT_LT(find(seen, "sync", spool_folder, made), seen.size()) << text(seen);
}

TEST_F(SpoolOrder, aSessionIsNamedOnTheDiskBeforeItIsUsed) {
  auto spool = std::move(*Spool::open(folder_.path()));
  start();
  auto session = *spool->create(describeSession(makeUuidV7()));
  const auto seen = stop();
  const auto made = find(seen, "mkdir", session->folder());
  ASSERT_LT(made, seen.size()) << text(seen);
  expectAtomic(seen, session->folder() / "session.json");
  // chunks, tail and lost are created after session.json: the folder is synced again for their names, then
  // its parent.
  const auto wrote = find(seen, "write", session->folder() / "lost");
  ASSERT_LT(wrote, seen.size());
  EXPECT_LT(find(seen, "sync", session->folder() / "lost", wrote), seen.size()) << text(seen);
  const auto names = find(seen, "sync", session->folder(), wrote);
  ASSERT_LT(names, seen.size()) << text(seen);
  EXPECT_LT(find(seen, "sync", folder_.path(), names), seen.size()) << text(seen);
}

TEST_F(SpoolOrder, chunksAreSentAfterTheirSyncAndTheEndLast) {
  auto spool = std::move(*Spool::open(folder_.path()));
  auto session = *spool->create(describeSession(makeUuidV7()));
  const auto chunks = session->folder() / "chunks";
  start();
  ASSERT_TRUE(session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(0, 100)), 100).ok());
  EXPECT_EQ(session->contents().chunks, 0u);
  EXPECT_FALSE(session->readChunk(0).ok()) << "no one gets it to send";
  ASSERT_TRUE(session->sync().ok());
  EXPECT_EQ(session->contents().chunks, 1u);
  ASSERT_TRUE(session->end(false).ok());
  const auto seen = stop();
  const auto wrote = find(seen, "write", chunks);
  const auto synced = find(seen, "sync", chunks, wrote);
  ASSERT_LT(synced, seen.size()) << text(seen);
  EXPECT_GT(find(seen, "rename", session->folder() / "end.json"), synced) << text(seen);
  expectAtomic(seen, session->folder() / "end.json");
}

TEST_F(SpoolOrder, afterAFailedSyncTheBytesAreWrittenAgainBeforeTheNext) {
  // The kernel may drop the dirty pages and then report success for the next sync.
  auto spool = std::move(*Spool::open(folder_.path()));
  auto session = *spool->create(describeSession(makeUuidV7()));
  const auto chunks = session->folder() / "chunks";
  ASSERT_TRUE(session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(0, 100)), 100).ok());
  disk_fails = true;
  const Status failed = session->sync();
  disk_fails = false;
  ASSERT_FALSE(failed.ok());
  EXPECT_THAT(failed.error().message, testing::HasSubstr("Input/output error"));
  EXPECT_EQ(session->contents().chunks, 0u) << "no one may send it";
  start();
  ASSERT_TRUE(session->sync().ok());
  const auto seen = stop();
  const auto wrote = find(seen, "write", chunks);
  ASSERT_LT(wrote, seen.size()) << text(seen);
  EXPECT_LT(find(seen, "sync", chunks, wrote), seen.size()) << text(seen);
  EXPECT_EQ(session->contents().chunks, 1u);
}

TEST_F(SpoolOrder, failedSyncsAreRetriedEveryHalfSecondBeforeDurability) {
  constexpr std::int64_t kHalfSecond_ns = 500'000'000;
  FakeTime time;
  auto spool = std::move(*Spool::open(folder_.path()));
  auto session = *spool->create(describeSession(makeUuidV7()));
  SampleRing ring;
  int durable = 0;
  std::vector<std::string> troubles;
  SpoolWriter writer(ring, session, {.time = &time, .threads = false},
                     {{}, [&] { ++durable; }, [&](const std::string& text) { troubles.push_back(text); }});
  EXPECT_EQ(writer.syncPass(), SpoolWriter::kNotDue_ns) << "nothing is written yet";
  for (std::uint64_t tick = 0; tick < 1000; ++tick) ring.push(sampleAt(tick));
  writer.writePass();
  disk_fails = true;
  for (std::uint64_t tries = 1; tries <= 3; ++tries) {
    EXPECT_EQ(writer.syncPass(), time.nowNs() + kHalfSecond_ns);
    EXPECT_EQ(writer.counts().disk_errors, tries);
    time.advance(kHalfSecond_ns - 1);
    EXPECT_EQ(writer.syncPass(), time.nowNs() + 1) << "not before it is due";
    EXPECT_EQ(writer.counts().disk_errors, tries);
    time.advance(1);
  }
  disk_fails = false;
  EXPECT_EQ(durable, 0);
  EXPECT_EQ(session->contents().chunks, 0u);
  EXPECT_EQ(writer.syncPass(), SpoolWriter::kNotDue_ns);
  EXPECT_EQ(durable, 1);
  EXPECT_EQ(session->contents().chunks, 1u);
  EXPECT_EQ(troubles.size(), 1u) << "said, not repeated";
}

// `finish` syncs once, then every 100 ms.
TEST_F(SpoolOrder, theEndWaitsItsPatienceForADiskThatDoesNotSync) {
  FakeTime time;
  auto spool = std::move(*Spool::open(folder_.path()));
  auto session = *spool->create(describeSession(makeUuidV7()));
  SampleRing ring;
  SpoolWriter writer(ring, session, {.time = &time, .threads = false}, {});
  for (std::uint64_t tick = 0; tick < 1000; ++tick) ring.push(sampleAt(tick));
  const std::int64_t began_ns = time.nowNs();
  disk_fails = true;
  start();
  const Status status = writer.finish(std::chrono::milliseconds(450));
  const auto seen = stop();
  disk_fails = false;
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(time.nowNs() - began_ns, 500'000'000) << "the try that begins within the patience ends after it";
  EXPECT_EQ(std::count(seen.begin(), seen.end(), Call{"sync", session->folder() / "chunks"}), 6)
      << text(seen);
  EXPECT_FALSE(session->contents().ended);
}

TEST_F(SpoolOrder, whatACrashLeftIsSyncedBeforeTheSessionIsCalledEnded) {
  std::filesystem::path session_folder;
  {
    auto spool = std::move(*Spool::open(folder_.path()));
    auto session = *spool->create(describeSession(makeUuidV7()));
    session_folder = session->folder();
    ASSERT_TRUE(session->appendPiece(0, encodeChunk(Resolution::standard(), samplesFrom(0, 20))).ok());
  }
  start();
  auto spool = std::move(*Spool::open(folder_.path()));
  const auto seen = stop();
  const auto wrote = find(seen, "write", session_folder / "chunks");
  const auto synced = find(seen, "sync", session_folder / "chunks", wrote);
  ASSERT_LT(synced, seen.size()) << text(seen);
  EXPECT_GT(find(seen, "rename", session_folder / "end.json"), synced) << text(seen);
  expectAtomic(seen, session_folder / "end.json");
}

}  // namespace
}  // namespace needlelab::test
