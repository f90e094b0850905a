// What a spool keeps of sessions, also of programs that died, and when it deletes it.
#include "client/net/spool/spool.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <random>

#include "client/net/spool/spool_json.h"
#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/spool/spool_sessions.h"

namespace {

/// While it exists, a disk of 1 GiB with only the files of one folder.
class SmallDisk {
 public:
  explicit SmallDisk(std::filesystem::path folder) : folder_(std::move(folder)) { mounted = this; }
  ~SmallDisk() { mounted = nullptr; }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  [[nodiscard]] std::uintmax_t freeBytes() const {
    std::uintmax_t used = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_))
      if (entry.is_regular_file()) used += entry.file_size();
    return (std::uintmax_t{1} << 30) - used;
  }
  static const SmallDisk* mounted;

 private:
  std::filesystem::path folder_;
};
const SmallDisk* SmallDisk::mounted = nullptr;

}  // namespace

/// Replaces the C library's function in this program; std::filesystem::space calls it.
extern "C" int statvfs(const char* path, struct statvfs* facts) noexcept {
  using Real = int (*)(const char*, struct statvfs*);
  static const auto real = reinterpret_cast<Real>(::dlsym(RTLD_NEXT, "statvfs"));
  const int result = real(path, facts);
  if (result == 0 && SmallDisk::mounted != nullptr) {
    facts->f_frsize = 1;
    facts->f_bavail = facts->f_bfree = SmallDisk::mounted->freeBytes();
  }
  return result;
}

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The tests of this program open thousands of spools with syncs, so they use a memory file system if
// available. They test crashes of the program, for which syncs do not matter.
[[maybe_unused]] const bool kInMemory = [] {
  return fs::is_directory("/dev/shm") && ::access("/dev/shm", W_OK) == 0 &&
         ::setenv("TMPDIR", "/dev/shm", 0) == 0;
}();

TEST(Spool, anEndedSessionIsReadBackUnchanged) {
  const TempFolder folder;
  const Uuid id = makeUuidV7();
  std::vector<Bytes> chunks = {coded(0, 1000), coded(1000, 1000), coded(2000, 123)};
  {
    auto spool = opened(folder.path());
    auto session = spool->create(describeSession(id));
    ASSERT_TRUE(session.ok());
    for (const Bytes& chunk : chunks)
      ASSERT_TRUE((*session)->appendChunk(chunk, inspectChunk(chunk)->count).ok());
    EXPECT_EQ((*session)->contents().chunks, 0u) << "not synced yet: nothing may be sent";
    ASSERT_TRUE((*session)->sync().ok());
    EXPECT_EQ((*session)->contents().chunks, 3u);
    ASSERT_TRUE((*session)->end(false).ok());
  }
  const Recovered found = recover(folder.path());
  EXPECT_TRUE(found.contents.ended);
  EXPECT_FALSE(found.contents.interrupted);
  EXPECT_EQ(found.chunks, chunks);
  auto spool = opened(folder.path());
  EXPECT_EQ(spool->unfinished()[0]->description().SerializeAsString(),
            describeSession(id).SerializeAsString());
}

TEST(Spool, oneProgramAtATime) {
  const TempFolder folder;
  auto first = opened(folder.path());
  auto second = Spool::open(folder.path());
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().message, HasSubstr("another station"));
}

TEST(Spool, newFoldersArePrivateWhateverTheUmask) {
  const TempFolder folder;
  const fs::path place = folder.path() / "above" / "spool", given = folder.path() / "given";
  const mode_t before = ::umask(0);
  fs::create_directory(given);
  std::vector<fs::path> made;
  for (const auto& path : {place, given}) {
    auto spool = opened(path);
    made.insert(made.end(), {path / "lessons", (*spool->create(describeSession(makeUuidV7())))->folder()});
  }
  ::umask(before);
  made.insert(made.end(), {place, place.parent_path()});
  for (const auto& path : made) EXPECT_EQ(fs::status(path).permissions(), fs::perms::owner_all) << path;
  EXPECT_EQ(fs::status(given).permissions(), fs::perms::all) << "somebody else chose its permissions";
}

TEST(Spool, aDeletedSpoolIsNotRecreatedByTheNextSession) {
  const TempFolder folder;
  auto spool = opened(folder.path() / "spool");
  fs::remove_all(folder.path() / "spool");
  const auto session = spool->create(describeSession(makeUuidV7()));
  ASSERT_FALSE(session.ok());
  EXPECT_EQ(session.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(session.error().message, HasSubstr("cannot make the folder"));
  EXPECT_FALSE(fs::exists(folder.path() / "spool"));
}

TEST(Spool, aFolderThatCannotBeMadeIsRefusedByName) {
  const TempFolder folder;
  const auto file = folder.write("file", "x");
  auto spool = Spool::open(file / "spool");
  ASSERT_FALSE(spool.ok());
  EXPECT_THAT(spool.error().message, HasSubstr((file / "spool").string()));
}

TEST(Spool, whatNoServerWouldTakeIsRefusedBeforeItIsRecorded) {
  const TempFolder folder;
  auto spool = opened(folder.path());
  for (const std::string& trainee : {std::string(65, 'n'), std::string("a\tb"), std::string("\xff\xfe")}) {
    auto description = describeSession(makeUuidV7());
    description.set_trainee(trainee);
    const auto made = spool->create(description);
    ASSERT_FALSE(made.ok());
    EXPECT_EQ(made.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(made.error().message.find("trainee"), std::string::npos) << made.error().message;
  }
  // practice without a key: the station's name is set at upload
  auto nameless = describeSession(makeUuidV7());
  nameless.clear_station();
  EXPECT_TRUE(spool->create(nameless).ok());
}

// The files after a crash, with two chunks and three pieces of the third one written.
fs::path cutOffSession(const TempFolder& folder) {
  auto spool = opened(folder.path());
  auto session = *spool->create(describeSession(makeUuidV7()));
  EXPECT_TRUE(session->appendChunk(coded(0, 20), 20).ok());
  EXPECT_TRUE(session->appendChunk(coded(20, 20), 20).ok());
  EXPECT_TRUE(session->sync().ok());
  for (std::uint64_t piece = 0; piece < 3; ++piece)
    EXPECT_TRUE(session->appendPiece(2, coded(40 + 4 * piece, 4)).ok());
  return session->folder();
}

TEST(Spool, theTailOfACutOffSessionBecomesItsLastChunk) {
  const TempFolder folder;
  cutOffSession(folder);
  const Recovered found = recover(folder.path());
  EXPECT_EQ(found.contents.chunks, 3u);
  EXPECT_TRUE(found.contents.ended);
  EXPECT_TRUE(found.contents.interrupted);
  ASSERT_EQ(found.samples.size(), 52u);
  expectTicksFromZero(found.samples);
  // Opening it again changes nothing.
  EXPECT_EQ(recover(folder.path()).chunks, found.chunks);
}

TEST(Spool, everyTruncationKeepsWholeDataAndCountsTheRest) {
  const TempFolder original;
  const fs::path session = cutOffSession(original);
  for (const char* name : {"chunks", "tail"}) {
    const auto size = fs::file_size(session / name);
    for (std::uintmax_t cut = 0; cut < size; ++cut) {
      const TempFolder copy;
      fs::copy(original.path(), copy.path(), fs::copy_options::recursive);
      fs::resize_file(copy.path() / session.filename() / name, cut);
      const Recovered found = recover(copy.path());
      ASSERT_TRUE(found.contents.interrupted) << name << " cut at " << cut;
      ASSERT_NO_FATAL_FAILURE(expectTicksButTheMissing(found)) << name << " cut at " << cut;
      // All whole records before the cut survive, and so does the tail behind missing chunks.
      const std::size_t most = 40 + 12;
      const std::size_t least = name == std::string("tail") ? 40 : 12;
      ASSERT_GE(found.samples.size(), least);
      ASSERT_LE(found.samples.size(), most);
      ASSERT_EQ(found.samples.size() % 4, 0u);
    }
  }
}

TEST(Spool, everyFlippedByteOfTheTailIsNoticed) {
  const TempFolder original;
  const fs::path session = cutOffSession(original);
  auto tail = readWholeFile(session / "tail");
  ASSERT_TRUE(tail.ok());
  for (std::size_t at = 0; at < tail->size(); at += 3) {
    const TempFolder copy;
    fs::copy(original.path(), copy.path(), fs::copy_options::recursive);
    std::string damaged = *tail;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    std::ofstream(copy.path() / session.filename() / "tail", std::ios::binary) << damaged;
    const Recovered found = recover(copy.path());
    ASSERT_NO_FATAL_FAILURE(expectTicksButTheMissing(found)) << at;
    ASSERT_EQ(found.samples.size(), 48u) << "one piece of four samples is damaged, the others are not";
  }
}

TEST(Spool, aTailWhoseChunkIsAlreadyThereIsNotDoubled) {
  const TempFolder folder;
  {
    auto spool = opened(folder.path());
    auto session = *spool->create(describeSession(makeUuidV7()));
    // The program died after it wrote the chunk and before it restarted the tail.
    for (std::uint64_t piece = 0; piece < 5; ++piece)
      ASSERT_TRUE(session->appendPiece(0, coded(20 * piece, 20)).ok());
    ASSERT_TRUE(session->appendChunk(coded(0, 100), 100).ok());
    ASSERT_TRUE(session->sync().ok());
  }
  const Recovered found = recover(folder.path());
  EXPECT_EQ(found.contents.chunks, 1u);
  EXPECT_EQ(found.samples.size(), 100u);
}

TEST(Spool, aTailOfTwoChunksSurvivesASecondCrash) {
  const TempFolder folder;
  fs::path session;
  {
    auto spool = opened(folder.path());
    auto made = *spool->create(describeSession(makeUuidV7()));
    session = made->folder();
    // a power cut left two pieces of an earlier tail but lost the chunk made from them; the third piece lies
    // under a piece of the next tail
    for (const std::uint64_t first : {0, 10}) ASSERT_TRUE(made->appendPiece(0, coded(first, 10)).ok());
    for (const std::uint64_t first : {30, 40}) ASSERT_TRUE(made->appendPiece(1, coded(first, 10)).ok());
  }
  const auto tail = *readWholeFile(session / "tail");
  const auto expectBoth = [&](const char* when) {
    const Recovered found = recover(folder.path());
    EXPECT_EQ(found.contents.chunks, 2u) << when;
    EXPECT_EQ(found.samples.size(), 40u) << when;
    EXPECT_EQ(found.contents.damage, (SpoolDamage{0, 10, 20})) << when;
    expectTicksButTheMissing(found);
  };
  expectBoth("after the first crash");
  // the second one came after one or both of the first two became chunks, and the end was not written
  const auto chunks = *readWholeFile(session / "chunks");
  const auto second = chunks.find("NLS1", 1);
  ASSERT_NE(second, std::string::npos);
  for (const auto size : {std::size_t{0}, second, chunks.size()}) {
    fs::remove(session / "end.json");
    fs::resize_file(session / "chunks", size);
    std::ofstream(session / "tail", std::ios::binary) << tail;
    expectBoth(("with " + std::to_string(size) + " bytes of chunks").c_str());
  }
}

TEST(Spool, anEndWithNumbersThatNoSessionHasIsNotBelieved) {
  // 12 days at the rate of 1 kHz
  constexpr std::uint64_t kMost = (std::uint64_t{1} << 20) * 1000;
  for (const std::uint64_t lost : {std::uint64_t{10}, kMost, kMost + 1, UINT64_MAX}) {
    SCOPED_TRACE(lost);
    const TempFolder folder;
    const fs::path session = sessionOfThreeChunks(folder.path(), true);
    auto end = readSpoolJson(session / "end.json");
    ASSERT_TRUE(end.ok());
    (*end)["tail_damage"] = {{"chunks", 0}, {"samples", lost}, {"from_tick", 300}};
    ASSERT_TRUE(writeSpoolJson(session / "end.json", *end).ok());
    const Recovered found = recover(folder.path());
    EXPECT_EQ(found.samples.size(), 300u);
    EXPECT_EQ(found.contents.damage.samples, lost <= kMost ? lost : 0);
    EXPECT_EQ(found.contents.interrupted, lost > kMost) << "a session whose end cannot be read";
  }
}

TEST(Spool, aTailGapWithImpossibleNumbersIsNotCounted) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), false);
  fs::remove(session / "end.json");
  const auto gap = [](std::uint64_t samples) {
    return nlohmann::json{{"seq", 1}, {"samples", samples}, {"from_tick", 100}};
  };
  ASSERT_TRUE(
      writeSpoolJson(session / "tail.json", {{"chunks", {gap(UINT64_MAX), gap(5), gap(UINT64_MAX - 3)}}})
          .ok());
  EXPECT_EQ(recover(folder.path()).contents.damage, (SpoolDamage{0, 5, 100}));
}

TEST(Spool, aPipeInPlaceOfAFileParksItsSession) {
  for (const char* name :
       {"session.json", "session.copy.json", "chunks", "tail", "end.json", "acked.json", "lost"}) {
    const TempFolder folder;
    const fs::path file = sessionOfThreeChunks(folder.path(), false) / name;
    fs::remove(file);
    ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
    const auto spool = opened(folder.path());
    const bool needed =
        name == std::string("chunks") || name == std::string("tail") || name == std::string("end.json");
    ASSERT_EQ(spool->unfinished().size(), needed ? 0u : 1u) << name;
    if (needed) {
      EXPECT_THAT(spool->notes(),
                  testing::Contains(testing::AllOf(HasSubstr(file.string() + ": is not a regular file"),
                                                   HasSubstr("left as it is"))));
    } else {
      EXPECT_EQ(spool->unfinished()[0]->contents().samples, 300u) << name;
    }
    EXPECT_TRUE(fs::is_fifo(file)) << name;
  }
}

TEST(Spool, foldersThatAreNoSessionsAreLeftAloneAndNamed) {
  const TempFolder folder;
  const std::string id = uuidText(makeUuidV7()), empty = uuidText(makeUuidV7()),
                    wrong = uuidText(makeUuidV7());
  fs::create_directory(folder.path() / id);
  folder.write(id + "/chunks", "something");
  fs::create_directory(folder.path() / empty);
  fs::create_directory(folder.path() / wrong);
  folder.write(wrong + "/session.json", "{\"session_id\": 7");
  fs::create_directory(folder.path() / "notes of a technician");
  auto spool = opened(folder.path());
  EXPECT_TRUE(spool->unfinished().empty());
  EXPECT_THAT(spool->notes(), testing::UnorderedElementsAre(HasSubstr(id), HasSubstr(wrong)));
  EXPECT_TRUE(fs::exists(folder.path() / id / "chunks"));
  EXPECT_TRUE(fs::exists(folder.path() / wrong));
  EXPECT_FALSE(fs::exists(folder.path() / empty)) << "died before anything was recorded";
  EXPECT_TRUE(fs::exists(folder.path() / "notes of a technician"));
}

TEST(Spool, aClosedSessionIsNotOfferedAgainAndLeavesByPolicy) {
  const TempFolder folder;
  const std::int64_t now_ns = 1'000'000'000'000'000'000;
  const auto day_ns = std::int64_t{86'400} * 1'000'000'000;
  std::vector<std::string> ids;
  {
    auto spool = opened(folder.path());
    for (int i = 0; i < 4; ++i) {
      auto session = *spool->create(describeSession(makeUuidV7()));
      ids.push_back(session->idText());
      ASSERT_TRUE(session->appendChunk(coded(0, 100), 100).ok());
      ASSERT_TRUE(session->sync().ok());
      ASSERT_TRUE(session->end(false).ok());
      // 0: closed 20 days ago; 1: closed and safe; 2: closed today; 3: acknowledged but not closed
      const bool closed = i < 3;
      ASSERT_TRUE(session->setReceipt({1, i == 1 ? 1u : 0u, closed, i == 2 ? 20 * day_ns : 0}).ok());
    }
  }
  auto spool = opened(folder.path());
  for (int day = 0; day <= 20; ++day) spool->clock().note(now_ns + day * day_ns);
  ASSERT_EQ(spool->unfinished().size(), 1u);
  EXPECT_EQ(spool->unfinished()[0]->idText(), ids[3]);
  EXPECT_EQ(spool->cleanUp({14 * 86'400, 1u << 30, 0}).size(), 2u);
  EXPECT_FALSE(fs::exists(folder.path() / ids[0]));
  EXPECT_FALSE(fs::exists(folder.path() / ids[1]));
  EXPECT_TRUE(fs::exists(folder.path() / ids[2]));
  EXPECT_THAT(spool->cleanUp({14 * 86'400, 0, 0}), testing::ElementsAre(HasSubstr(ids[2])));
  EXPECT_FALSE(fs::exists(folder.path() / ids[2]));
  EXPECT_TRUE(fs::exists(folder.path() / ids[3])) << "what the server has not closed is never touched";
}

// Makes four closed sessions; no server has the second. Returns their names.
std::vector<std::string> fourClosed(Spool& spool) {
  std::vector<std::string> ids;
  for (int i = 0; i < 4; ++i) {
    auto session = *spool.create(describeSession(makeUuidV7()));
    ids.push_back(session->idText());
    EXPECT_TRUE(session->appendChunk(coded(0, 1000), 1000).ok());
    EXPECT_TRUE(session->sync().ok());
    EXPECT_TRUE(session->end(false).ok());
    if (i != 1) {
      EXPECT_TRUE(session->setReceipt({1, 0, true, 1}).ok());
    }
  }
  return ids;
}

TEST(Spool, onAFullDiskOnlyClosedSessionsAreDeletedOldestFirst) {
  const TempFolder folder;
  auto spool = opened(folder.path());
  const std::vector<std::string> ids = fourClosed(*spool);
  const SmallDisk disk(folder.path());
  // One byte is missing: deleting the oldest session that the server has is enough.
  SpoolKeep keep{1'000'000'000, std::uint64_t{1} << 40, fs::space(folder.path()).available + 1};
  EXPECT_THAT(spool->cleanUp(keep), testing::ElementsAre(AllOf(HasSubstr(ids[0]), HasSubstr("nearly full"))));
  keep.min_free_bytes = std::uint64_t{1} << 60;  // can never be reached
  EXPECT_THAT(spool->cleanUp(keep), testing::ElementsAre(HasSubstr(ids[2]), HasSubstr(ids[3])));
  EXPECT_TRUE(fs::exists(folder.path() / ids[1] / "chunks")) << "no server has it: no disk is full enough";
}

TEST(Spool, usageCountsWhatNoServerHasChunkByChunk) {
  const TempFolder folder;
  auto spool = opened(folder.path());
  EXPECT_EQ(spool->usage()->unsent_bytes, 0u);
  EXPECT_EQ(spool->usage()->unsent_samples, 0u);
  std::uint64_t expected = 0;
  for (int i = 0; i < 3; ++i) {
    auto session = *spool->create(describeSession(makeUuidV7()));
    std::vector<std::size_t> sizes;
    for (std::uint64_t seq = 0; seq < 4; ++seq) {
      const Bytes chunk = coded(seq * 500, 500);
      sizes.push_back(chunk.size());
      ASSERT_TRUE(session->appendChunk(chunk, 500).ok());
    }
    ASSERT_TRUE(session->sync().ok());
    // 0: none acknowledged; 1: the first three; 2: all, not closed yet
    const auto committed = static_cast<std::uint64_t>(i == 0 ? 0 : i + 2);
    ASSERT_TRUE(session->setReceipt({committed, 0, false, 0}).ok());
    for (auto seq = committed; seq < 4; ++seq) expected += sizes[seq];
  }
  const SpoolUsage usage = *spool->usage();
  EXPECT_EQ(usage.unsent_sessions, 2u);
  EXPECT_EQ(usage.unsent_bytes, expected);
  EXPECT_EQ(usage.unsent_samples, 5u * 500);
  EXPECT_GT(usage.free_bytes, 0u);
}

// The child writes a session as fast as it can and reports the safely written samples through a pipe. It is
// killed at a random moment.
TEST(Spool, killedAtRandomInstantsNothingThatWasWrittenIsLost) {
  std::mt19937 random(20261120);
  int most_chunks = 0;
  for (int round = 0; round < 15; ++round) {
    const TempFolder folder;
    int to_parent[2];
    ASSERT_EQ(::pipe(to_parent), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      auto spool = Spool::open(folder.path());
      auto session = spool.ok() ? (*spool)->create(describeSession(makeUuidV7())) : Error{};
      if (!session.ok()) ::_exit(1);
      for (std::uint64_t seq = 0;; ++seq) {
        for (std::uint64_t piece = 0; piece < 5; ++piece) {
          const std::uint64_t first = seq * 100 + piece * 20;
          if (!(*session)->appendPiece(seq, coded(first, 20)).ok()) ::_exit(2);
          const std::uint64_t written = first + 20;
          if (::write(to_parent[1], &written, sizeof written) != sizeof written) ::_exit(3);
        }
        if (!(*session)->appendChunk(coded(seq * 100, 100), 100).ok() || !(*session)->restartTail().ok())
          ::_exit(4);
        if (seq % 8 == 0 && !(*session)->sync().ok()) ::_exit(5);
      }
    }
    ::close(to_parent[1]);
    // Reading keeps the pipe from filling; the last complete number is the child's confirmed count.
    std::uint64_t written = 0, word = 0;
    const auto wanted = random() % 4000 + 20;
    while (written < wanted && ::read(to_parent[0], &word, sizeof word) == sizeof word) written = word;
    ::usleep(static_cast<useconds_t>(random() % 3000));
    ::kill(child, SIGKILL);
    while (::read(to_parent[0], &word, sizeof word) == sizeof word) written = word;
    ::close(to_parent[0]);
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child failed by itself: " << WEXITSTATUS(status);

    const Recovered found = recover(folder.path());
    ASSERT_NO_FATAL_FAILURE(expectTicksFromZero(found.samples));
    ASSERT_GE(found.samples.size(), written) << "round " << round;
    ASSERT_LE(found.samples.size(), written + 20);
    most_chunks = std::max(most_chunks, static_cast<int>(found.contents.chunks));
  }
  EXPECT_GT(most_chunks, 5) << "the test did not reach the interesting places";
}

}  // namespace
}  // namespace needlelab::test
