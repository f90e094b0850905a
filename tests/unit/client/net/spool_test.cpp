#include "client/net/spool.h"

#include <dlfcn.h>
#include <fmt/core.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <initializer_list>
#include <random>

#include "client/net/spool_json.h"
#include "client/net/spool_writer.h"
#include "common/base/files.h"
#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/spool_samples.h"

namespace {

/// While it lives, a disk of 1 GiB that holds the files of one folder and nothing else.
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

std::unique_ptr<Spool> opened(const fs::path& folder) {
  auto spool = Spool::open(folder);
  EXPECT_TRUE(spool.ok()) << spool.error().message;
  return spool.ok() ? std::move(*spool) : nullptr;
}

Bytes coded(std::uint64_t first, std::size_t count) {
  return encodeChunk(Resolution::standard(), samplesFrom(first, count));
}

// The tests below open thousands of spools with syncs, so they use a memory file system if available. They
// test crashes of the program; a sync has no effect on that.
[[maybe_unused]] const bool kInMemory = [] {
  return fs::is_directory("/dev/shm") && ::access("/dev/shm", W_OK) == 0 &&
         ::setenv("TMPDIR", "/dev/shm", 0) == 0;
}();

// Returns the result of the next start: all samples of the one session, in order.
struct Recovered {
  SpoolContents contents;
  std::vector<GestureSample> samples;
  std::vector<Bytes> chunks;
};
Recovered recover(const fs::path& folder) {
  Recovered found;
  auto spool = opened(folder);
  const auto sessions = spool->unfinished();
  EXPECT_EQ(sessions.size(), 1u);
  if (sessions.size() != 1) return found;
  found.contents = sessions[0]->contents();
  SessionHash hash;
  for (std::uint64_t seq = 0; seq < found.contents.chunks; ++seq) {
    auto chunk = sessions[0]->readChunk(seq);
    EXPECT_TRUE(chunk.ok());
    auto samples = decodeChunk(*chunk);
    EXPECT_TRUE(samples.ok());
    found.samples.insert(found.samples.end(), samples->begin(), samples->end());
    hash.update(*chunk);
    found.chunks.push_back(*chunk);
  }
  EXPECT_EQ(found.contents.hash, hash.digest());
  EXPECT_EQ(found.contents.samples, found.samples.size());
  return found;
}

// The samples stand in order, and the spool counts those that are missing between them.
void expectTicksButTheMissing(const Recovered& found) {
  std::uint64_t tick = 0, missing = 0;
  for (const GestureSample& sample : found.samples) {
    ASSERT_GE(sample.tick, tick);
    ASSERT_TRUE(isSampleOfItsTick(sample)) << sample.tick;
    missing += sample.tick - tick;
    tick = sample.tick + 1;
  }
  ASSERT_EQ(found.contents.damage.samples, missing);
}

void expectTicksFromZero(const std::vector<GestureSample>& samples) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].tick, i);
    ASSERT_TRUE(isSampleOfItsTick(samples[i])) << i;
  }
}

TEST(Spool, aSessionThatEndedIsFoundAgainAsItWas) {
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

TEST(Spool, aNewFolderIsItsOwnersOnlyWhateverTheUmask) {
  const TempFolder folder;
  const mode_t before = ::umask(0);
  const auto spool = Spool::open(folder.path() / "spool");
  ::umask(before);
  ASSERT_TRUE(spool.ok());
  EXPECT_EQ(std::filesystem::status(folder.path() / "spool").permissions(),
            std::filesystem::perms::owner_all);
}

TEST(Spool, aFolderThatCannotBeMadeIsRefusedByName) {
  const TempFolder folder;
  const auto file = folder.write("file", "x");
  auto spool = Spool::open(file / "spool");
  ASSERT_FALSE(spool.ok());
  EXPECT_THAT(spool.error().message, HasSubstr((file / "spool").string()));
}

// The files after a crash with two chunks and three pieces of the third one written.
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

TEST(Spool, theTailOfASessionThatWasCutOffBecomesItsLastChunk) {
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

TEST(Spool, everyTruncationOfChunksAndTailGivesWhatIsWholeAndCountsTheRest) {
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
      // All whole records before the cut survive, and the tail behind missing chunks.
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

TEST(Spool, aTailThatKeptPiecesOfTwoChunksGivesBothAlsoAfterASecondCrash) {
  const TempFolder folder;
  fs::path session;
  {
    auto spool = opened(folder.path());
    auto made = *spool->create(describeSession(makeUuidV7()));
    session = made->folder();
    // a power cut left two pieces of the tail before, and lost the chunk that they went into; the third piece
    // lies under one of the next tail
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
  // the second one came when the first of the two was a chunk, or both, and the end was not written
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

// three chunks of 100 samples, synced one by one or all at last; the program ended the session, or crashed.
// Returns the session's folder.
fs::path sessionOfThreeChunks(const fs::path& folder, bool ended, bool synced_each = true) {
  auto spool = opened(folder);
  auto made = *spool->create(describeSession(makeUuidV7()));
  for (std::uint64_t k = 0; k < 3; ++k) {
    EXPECT_TRUE(made->appendChunk(coded(100 * k, 100), 100).ok());
    if (synced_each) {
      EXPECT_TRUE(made->sync().ok());
    }
  }
  EXPECT_TRUE(made->sync().ok());
  if (ended) {
    EXPECT_TRUE(made->end(false).ok());
  }
  return made->folder();
}

TEST(Spool, aSessionThatEndedAndLostAChunkAfterwardsKeepsTheOthersAndTheFile) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  auto text = *readWholeFile(session / "chunks");
  text[text.size() / 2] = static_cast<char>(~text[text.size() / 2]);
  std::ofstream(session / "chunks", std::ios::binary) << text;
  // Opening it again changes nothing.
  for (int start = 0; start < 2; ++start) {
    const Recovered found = recover(folder.path());
    EXPECT_TRUE(found.contents.interrupted);
    EXPECT_EQ(found.contents.chunks, 2u);
    EXPECT_EQ(found.samples.size(), 200u);
    EXPECT_EQ(found.contents.damage, (SpoolDamage{1, 100, 100}));
    EXPECT_EQ(*readWholeFile(session / "chunks.damaged"), text);
  }
}

TEST(Spool, aLostLastChunkIsCountedByTheEnd) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  auto text = *readWholeFile(session / "chunks");
  text.back() = static_cast<char>(~text.back());
  std::ofstream(session / "chunks", std::ios::binary) << text;
  for (int start = 0; start < 2; ++start) {
    const Recovered found = recover(folder.path());
    EXPECT_EQ(found.samples.size(), 200u);
    EXPECT_EQ(found.contents.damage, (SpoolDamage{1, 100, 200}));
  }
}

TEST(Spool, aChunkThatHasFewerSamplesThanTheEndSaysIsDamageAndCounted) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  fs::remove(session / "chunks");
  {
    auto file = std::move(*SpoolFile::open(session / "chunks"));
    ASSERT_TRUE(file.append(0, 0, coded(0, 100)).ok());
    ASSERT_TRUE(file.append(1, 1, coded(100, 10)).ok());  // sound, but of 100 samples before
    ASSERT_TRUE(file.append(2, 2, coded(200, 100)).ok());
  }
  const std::string text = *readWholeFile(session / "chunks");
  EXPECT_THAT(
      (*Spool::open(folder.path()))->notes(),
      testing::ElementsAre(testing::AllOf(HasSubstr("its disk has damaged it. 210 samples can still be read"),
                                          HasSubstr("90 samples (0 chunks) from tick 110 on are missing"))));
  for (int start = 0; start < 2; ++start) {
    const Recovered found = recover(folder.path());
    EXPECT_TRUE(found.contents.interrupted);
    EXPECT_EQ(found.contents.chunks, 3u);
    EXPECT_EQ(found.contents.damage, (SpoolDamage{0, 90, 110}));
    ASSERT_NO_FATAL_FAILURE(expectTicksButTheMissing(found));
    EXPECT_EQ(*readWholeFile(session / "chunks.damaged"), text);
  }
}

TEST(Spool, anEndThatContradictsItsChunksIsNotBelieved) {
  struct Case {
    const char* key;
    nlohmann::json value;
    SpoolDamage damage;
  };
  for (const Case& wrong : {Case{"samples", 400, {0, 100, 300}}, Case{"samples", 200, {}},
                            Case{"hash", hexOf(Digest{}), {}}, Case{"hash", "", {}}}) {
    const TempFolder folder;
    const fs::path session = sessionOfThreeChunks(folder.path(), true);
    auto end = *readSpoolJson(session / "end.json");
    end[wrong.key] = wrong.value;
    ASSERT_TRUE(writeSpoolJson(session / "end.json", end).ok());
    EXPECT_THAT((*Spool::open(folder.path()))->notes(),
                testing::ElementsAre(HasSubstr("its disk has damaged it. 300 samples can still be read")));
    for (int start = 0; start < 2; ++start) {
      const Recovered found = recover(folder.path());
      EXPECT_TRUE(found.contents.interrupted) << wrong.key << " " << wrong.value;
      EXPECT_EQ(found.samples.size(), 300u);
      EXPECT_EQ(found.contents.damage, wrong.damage) << wrong.key << " " << wrong.value;
    }
    EXPECT_TRUE(fs::exists(session / "chunks.damaged"));
  }
}

// Five chunks of 100 samples and a tail of 12, of a program that died. Returns the session's folder.
fs::path fiveChunksAndATail(const fs::path& folder) {
  auto spool = opened(folder);
  auto made = *spool->create(describeSession(makeUuidV7()));
  for (std::uint64_t k = 0; k < 5; ++k) {
    EXPECT_TRUE(made->appendChunk(coded(100 * k, 100), 100).ok());
    EXPECT_TRUE(made->sync().ok());
  }
  for (std::uint64_t piece = 0; piece < 3; ++piece)
    EXPECT_TRUE(made->appendPiece(5, coded(500 + 4 * piece, 4)).ok());
  return made->folder();
}

// Flips a byte in the middle of these chunks: all are equally long, or nearly.
void damageChunks(const fs::path& session, std::initializer_list<std::size_t> which, std::size_t of) {
  auto text = *readWholeFile(session / "chunks");
  for (const std::size_t chunk : which) {
    char& byte = text[text.size() * (2 * chunk + 1) / (2 * of)];
    byte = static_cast<char>(~byte);
  }
  std::ofstream(session / "chunks", std::ios::binary) << text;
}

TEST(Spool, chunksAndTailBehindDamageAreKeptAndWhatIsMissingIsCounted) {
  const TempFolder folder;
  damageChunks(fiveChunksAndATail(folder.path()), {1, 3}, 5);
  const auto notes = (*Spool::open(folder.path()))->notes();
  EXPECT_THAT(notes, testing::Contains(HasSubstr("200 samples (2 chunks) from tick 100 on are missing")));
  const Recovered found = recover(folder.path());
  ASSERT_NO_FATAL_FAILURE(expectTicksButTheMissing(found));
  EXPECT_EQ(found.samples.size(), 312u);
  EXPECT_EQ(found.contents.chunks, 4u);
  EXPECT_EQ(found.contents.damage, (SpoolDamage{2, 200, 100}));
}

TEST(Spool, theTailBehindADamagedLastChunkIsKept) {
  const TempFolder folder;
  damageChunks(fiveChunksAndATail(folder.path()), {4}, 5);
  const Recovered found = recover(folder.path());
  EXPECT_EQ(found.samples.size(), 412u);
  EXPECT_EQ(found.contents.damage, (SpoolDamage{1, 100, 400}));
}

TEST(Spool, aDamagedFirstChunkIsCountedFromTickZero) {
  const TempFolder folder;
  damageChunks(fiveChunksAndATail(folder.path()), {0}, 5);
  EXPECT_EQ(recover(folder.path()).contents.damage, (SpoolDamage{1, 100, 0}));
}

TEST(Spool, aRecordOfAnotherTimeBehindDamageIsNotTaken) {
  // the disk brought back a record with a later number, but of samples that the session already has
  const TempFolder folder;
  const fs::path session = fiveChunksAndATail(folder.path());
  const TempFolder other;
  {
    auto file = std::move(*SpoolFile::open(other.path() / "chunks"));
    ASSERT_TRUE(file.append(5, 0, coded(200, 100)).ok());
    ASSERT_TRUE(file.append(7, 0, coded(200, 100)).ok());
  }
  auto stale = *readWholeFile(other.path() / "chunks");
  stale[kSpoolRecordHeader + 5] = static_cast<char>(~stale[kSpoolRecordHeader + 5]);
  std::ofstream(session / "chunks", std::ios::binary | std::ios::app) << stale;
  const Recovered found = recover(folder.path());
  EXPECT_EQ(found.samples.size(), 512u);
  EXPECT_EQ(found.contents.damage, SpoolDamage{});
}

TEST(Spool, aDescriptionOfAnEarlierVersionHasNoChecksumAndIsReadAndAChangedOneIsNot) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  fs::remove(session / "session.copy.json");  // as in an earlier version
  const std::string text = *readWholeFile(session / "session.json");
  const std::string before = text.substr(0, text.rfind("\ncrc32c "));
  ASSERT_LT(before.size(), text.size());
  std::ofstream(session / "session.json", std::ios::binary) << before;
  EXPECT_EQ(recover(folder.path()).samples.size(), 300u);
  for (std::size_t at = 0; at < text.size(); ++at) {
    std::string damaged = text;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << (at % 8)));
    std::ofstream(session / "session.json", std::ios::binary) << damaged;
    const auto spool = opened(folder.path());
    ASSERT_TRUE(spool->unfinished().empty()) << "byte " << at << " was believed";
    ASSERT_THAT(spool->notes(), testing::ElementsAre(testing::AllOf(
                                    HasSubstr("There is no copy of it"), HasSubstr("300 samples in 3 chunks"),
                                    HasSubstr("correct session.json"), HasSubstr("left as it is"))));
  }
  // what the note asks for
  std::ofstream(session / "session.json", std::ios::binary) << before;
  EXPECT_EQ(recover(folder.path()).samples.size(), 300u);
}

TEST(Spool, aDamagedDescriptionIsTakenFromItsCopyWhicheverByteItIs) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  const std::string text = *readWholeFile(session / "session.json");
  std::vector<std::string> damages = {"", "{}", text.substr(0, text.size() / 2)};
  for (std::size_t at = 0; at < text.size(); ++at) {
    damages.push_back(text);
    damages.back()[at] = static_cast<char>(text[at] ^ (1 << (at % 8)));
  }
  for (const std::string& damaged : damages) {
    std::ofstream(session / "session.json", std::ios::binary) << damaged;
    {
      const auto spool = opened(folder.path());
      ASSERT_EQ(spool->unfinished().size(), 1u) << damaged;
      ASSERT_EQ(spool->unfinished()[0]->contents().samples, 300u);
      ASSERT_FALSE(spool->unfinished()[0]->contents().interrupted) << "nothing of it is lost";
      ASSERT_THAT(spool->notes(), testing::ElementsAre(HasSubstr("taken from its copy")));
    }
    ASSERT_EQ(*readWholeFile(session / "session.json"), text) << "and is whole again";
  }
  EXPECT_THAT(opened(folder.path())->notes(), testing::IsEmpty());
  fs::remove(session / "session.json");
  EXPECT_EQ(recover(folder.path()).samples.size(), 300u) << "gone altogether";
  // a damaged copy hurts nobody while the description is whole; both together go to a technician
  std::ofstream(session / "session.copy.json", std::ios::binary) << text.substr(1);
  EXPECT_EQ(recover(folder.path()).samples.size(), 300u);
  std::ofstream(session / "session.json", std::ios::binary) << text.substr(2);
  const auto spool = opened(folder.path());
  EXPECT_TRUE(spool->unfinished().empty());
  EXPECT_THAT(spool->notes(), testing::ElementsAre(testing::AllOf(HasSubstr("Its copy is damaged, too"),
                                                                  HasSubstr("left as it is"))));
  EXPECT_TRUE(fs::exists(session / "chunks"));
}

TEST(Spool, aDescriptionThatNoServerTakesParksItsSessionAloneAndTheOthersAreThere) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  std::string id;
  {
    auto other = *opened(folder.path())->create(describeSession(makeUuidV7()));
    id = other->idText();
  }
  const std::string text = *readWholeFile(session / "session.json");
  std::string whole = text.substr(0, text.rfind("\ncrc32c ") + 1);
  const std::string profile = "{\\\"id\\\": \\\"shoulder\\\"}";
  const auto at = whole.find(profile);
  ASSERT_NE(at, std::string::npos) << whole;
  whole.replace(at, profile.size(), std::string(3'000'000, 'x'));
  // as sound as the others, as far as its checksum goes
  for (const char* name : {"session.json", "session.copy.json"})
    std::ofstream(session / name, std::ios::binary) << sealed(whole);
  const auto spool = opened(folder.path());
  ASSERT_EQ(spool->unfinished().size(), 1u);
  EXPECT_EQ(spool->unfinished()[0]->idText(), id);
  EXPECT_THAT(spool->notes(),
              testing::Contains(testing::AllOf(HasSubstr((session / "session.json").string()),
                                               HasSubstr("profile_json"), HasSubstr("left as it is"))));
  EXPECT_TRUE(fs::exists(session / "chunks"));
}

TEST(Spool, damageIsSaidOnceWithWhatIsLeftAndWhereTheRestIs) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  auto text = *readWholeFile(session / "chunks");
  text[text.size() / 2] = static_cast<char>(~text[text.size() / 2]);
  std::ofstream(session / "chunks", std::ios::binary) << text;
  const auto notes = [&] { return (*Spool::open(folder.path()))->notes(); };
  EXPECT_THAT(notes(), testing::ElementsAre(testing::AllOf(
                           HasSubstr("200 samples can still be read, 100 samples (1 chunk) from tick 100 on"),
                           HasSubstr((session / "chunks.damaged").string()))));
  EXPECT_THAT(notes(), testing::IsEmpty());
}

TEST(Spool, damageInTheMiddleOfASessionThatDidNotEndKeepsTheFileATornEndDoesNot) {
  for (const bool torn : {true, false}) {
    const TempFolder folder;
    const fs::path session = sessionOfThreeChunks(folder.path(), false);
    auto text = *readWholeFile(session / "chunks");
    if (torn)
      text.resize(text.size() - 5);
    else
      text[text.size() / 2] = static_cast<char>(~text[text.size() / 2]);
    std::ofstream(session / "chunks", std::ios::binary) << text;
    const Recovered found = recover(folder.path());
    EXPECT_TRUE(found.contents.interrupted);
    EXPECT_EQ(found.samples.size(), 200u);
    EXPECT_EQ(found.contents.damage.samples, torn ? 0u : 100u) << "a torn end was never promised";
    EXPECT_EQ(fs::exists(session / "chunks.damaged"), !torn);
    if (!torn) {
      EXPECT_EQ(*readWholeFile(session / "chunks.damaged"), text);
    }
  }
}

TEST(Spool, aGapInWhatWasNotSyncedIsCountedButNoDamageOfTheDisk) {
  // A power cut lost the first sectors in flight and kept later ones.
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), false, false);
  auto text = *readWholeFile(session / "chunks");
  text[text.size() / 2] = static_cast<char>(~text[text.size() / 2]);
  std::ofstream(session / "chunks", std::ios::binary) << text;
  EXPECT_THAT((*Spool::open(folder.path()))->notes(), testing::Not(testing::Contains(HasSubstr("damaged"))));
  EXPECT_FALSE(fs::exists(session / "chunks.damaged"));
  const Recovered found = recover(folder.path());
  EXPECT_TRUE(found.contents.interrupted);
  EXPECT_EQ(found.samples.size(), 200u);
  EXPECT_EQ(found.contents.damage, (SpoolDamage{1, 100, 100}));
}

TEST(Spool, damagedChunksAreNotCutOffWhileNoCopyCanBeKept) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  auto text = *readWholeFile(session / "chunks");
  text[text.size() / 2] = static_cast<char>(~text[text.size() / 2]);
  std::ofstream(session / "chunks", std::ios::binary) << text;
  // a folder at the path of the copy simulates a full disk
  fs::create_directories(session / "chunks.damaged.partial" / "x");
  {
    auto spool = opened(folder.path());
    EXPECT_TRUE(spool->unfinished().empty());
    ASSERT_EQ(spool->notes().size(), 1u);
    EXPECT_NE(spool->notes()[0].find("no copy of them can be kept"), std::string::npos) << spool->notes()[0];
  }
  EXPECT_EQ(*readWholeFile(session / "chunks"), text);
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
  // practice without a key: the station's name comes with the upload
  auto nameless = describeSession(makeUuidV7());
  nameless.clear_station();
  EXPECT_TRUE(spool->create(nameless).ok());
}

TEST(Spool, aSmallFileThatIsNestedDeeplyIsADamagedOneAndEndsNobody) {
  const std::string deep = std::string(500'000, '[') + std::string(500'000, ']');
  {
    const TempFolder folder;
    std::ofstream(sessionOfThreeChunks(folder.path(), true) / "end.json", std::ios::binary)
        << R"({"chunks": 3, "samples": 300, "hash": "", "interrupted": false, "damage": )" << deep << "}";
    const Recovered found = recover(folder.path());
    EXPECT_EQ(found.samples.size(), 300u);
    EXPECT_TRUE(found.contents.interrupted);
  }
  const TempFolder folder;
  std::ofstream(fiveChunksAndATail(folder.path()) / "tail.json", std::ios::binary)
      << R"({"chunks": [{"seq": 0, "samples": 1, "more": )" << deep << "}]}";
  const Recovered found = recover(folder.path());
  EXPECT_EQ(found.samples.size(), 512u);
  EXPECT_EQ(found.contents.damage, SpoolDamage{});
}

TEST(Spool, aPipeInPlaceOfAFileHoldsNobodyAndParksTheSessionWhereItIsNeeded) {
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

TEST(Spool, whatTheServerClosedIsNotOfferedAgainAndLeavesByAgeQuotaOrBackup) {
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

// Makes four closed sessions; the second is on no server. Returns their names.
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

TEST(Spool, onAFullDiskClosedSessionsMakeRoomOldestFirstAndUnsentOnesStay) {
  const TempFolder folder;
  auto spool = opened(folder.path());
  const std::vector<std::string> ids = fourClosed(*spool);
  const SmallDisk disk(folder.path());
  // One byte is missing: deleting the oldest session that the server has is enough.
  SpoolKeep keep{1'000'000'000, std::uint64_t{1} << 40, fs::space(folder.path()).available + 1};
  EXPECT_THAT(spool->cleanUp(keep), testing::ElementsAre(AllOf(HasSubstr(ids[0]), HasSubstr("nearly full"))));
  keep.min_free_bytes = std::uint64_t{1} << 60;  // never enough
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

TEST(Spool, aLossIsKnownAfterTheProgramsDeath) {
  const TempFolder folder;
  {
    auto spool = opened(folder.path());
    auto session = *spool->create(describeSession(makeUuidV7()));
    ASSERT_TRUE(session->appendChunk(coded(0, 100), 100).ok());
    ASSERT_TRUE(session->setLoss({7, 100}).ok());
    ASSERT_TRUE(session->setLoss({1234567, 100}).ok());
    EXPECT_EQ(fs::file_size(session->folder() / "lost"), 58u) << "always as long: written in place";
  }
  const Recovered found = recover(folder.path());
  EXPECT_TRUE(found.contents.interrupted);
  EXPECT_EQ(found.contents.loss, (SpoolLoss{1234567, 100}));
}

TEST(Spool, aLossFileThatIsMissingOrDamagedMakesAnEndedSessionInterrupted) {
  const TempFolder original;
  const fs::path session = sessionOfThreeChunks(original.path(), true);
  const std::string text = *readWholeFile(session / "lost");
  std::vector<std::string> damages = {"", "many, and early", text.substr(0, 50), text + "\n",
                                      // sealed or not, no lesson loses so many
                                      sealed(fmt::format("{:020} {:020}\n", 100'000'000'000u, 0)),
                                      fmt::format("{:020} {:020}\n", 100'000'000'000u, 0)};
  for (std::size_t at = 0; at < text.size(); ++at)
    for (int bit = 0; bit < 8; ++bit) {
      damages.push_back(text);
      damages.back()[at] = static_cast<char>(text[at] ^ (1 << bit));
    }
  for (const std::string& damaged : damages) {
    const TempFolder folder;
    fs::copy(original.path(), folder.path(), fs::copy_options::recursive);
    std::ofstream(folder.path() / session.filename() / "lost", std::ios::binary) << damaged;
    for (int start = 0; start < 2; ++start) {
      const auto spool = opened(folder.path());
      ASSERT_EQ(spool->unfinished().size(), 1u) << damaged;
      const SpoolContents contents = spool->unfinished()[0]->contents();
      ASSERT_TRUE(contents.interrupted) << damaged;
      ASSERT_EQ(contents.loss, SpoolLoss{}) << damaged;
      ASSERT_EQ(contents.samples, 300u) << damaged;
      ASSERT_THAT(spool->notes(), testing::ElementsAre(HasSubstr("nobody knows how many"))) << damaged;
    }
  }
  fs::remove(session / "lost");
  EXPECT_TRUE(recover(original.path()).contents.interrupted);
}

TEST(Spool, aLossFileOfAnEarlierVersionHasNoChecksumAndIsBelievedWithANote) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  for (const std::uint64_t samples : {0u, 77u}) {
    std::ofstream(session / "lost", std::ios::binary) << fmt::format("{:020} {:020}\n", samples, 300);
    EXPECT_THAT(
        (*Spool::open(folder.path()))->notes(),
        testing::ElementsAre(testing::AllOf(HasSubstr("has no checksum"),
                                            HasSubstr(std::to_string(samples) + " samples are taken"))));
    const SpoolContents contents = recover(folder.path()).contents;
    EXPECT_EQ(contents.loss, (SpoolLoss{samples, 300}));
    EXPECT_FALSE(contents.interrupted);
  }
}

TEST(Spool, theLongestLossThatALessonCanHaveIsBelieved) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  const std::uint64_t most = std::uint64_t{1000} << 20;  // at 1 kHz
  for (const std::uint64_t samples : {most, most + 1}) {
    std::ofstream(session / "lost", std::ios::binary) << sealed(fmt::format("{:020} {:020}\n", samples, 300));
    EXPECT_EQ(recover(folder.path()).contents.loss, samples == most ? (SpoolLoss{most, 300}) : SpoolLoss{});
  }
}

// The child writes a session as fast as it can and reports the safely written samples through a pipe. It is
// killed at a random instant.
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
    // Reading keeps the pipe from filling; the last whole number is the confirmed count of the child.
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
