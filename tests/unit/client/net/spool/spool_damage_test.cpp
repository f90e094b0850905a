// How a spool handles files that its disk damaged: it keeps what is readable and counts what is missing.
#include <fmt/core.h>
#include <gmock/gmock.h>

#include <fstream>
#include <initializer_list>

#include "client/net/spool/spool_json.h"
#include "client/net/spool/spool_writer.h"
#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/spool/spool_sessions.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Five chunks of 100 samples and a tail of 12, left by a program that died. Returns the session's folder.
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

// Flips a byte in the middle of these chunks; all have about the same length. Returns the damaged file.
std::string damageChunks(const fs::path& session, std::initializer_list<std::size_t> which, std::size_t of) {
  auto text = *readWholeFile(session / "chunks");
  for (const std::size_t chunk : which) {
    char& byte = text[text.size() * (2 * chunk + 1) / (2 * of)];
    byte = static_cast<char>(~byte);
  }
  std::ofstream(session / "chunks", std::ios::binary) << text;
  return text;
}

TEST(SpoolDamage, anEndedSessionThatLostAChunkKeepsTheOthers) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  const std::string text = damageChunks(session, {1}, 3);
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

// The server has two of the three chunks, among them the one that the disk lost.
TEST(SpoolDamage, numbersThatCouldNotBeWrittenAreFixedByTheNextTry) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  damageChunks(session, {1}, 3);
  {
    const auto spool = opened(folder.path());
    const auto found = spool->unfinished().at(0);
    fs::rename(session / "end.json", session / "end.kept");
    fs::create_directory(session / "end.json");
    EXPECT_FALSE(found->settle(2).ok());
    EXPECT_EQ(found->contents().chunks, 2u);
    fs::remove(session / "end.json");
    fs::rename(session / "end.kept", session / "end.json");
    EXPECT_TRUE(found->settle(2).ok());
    EXPECT_EQ(found->contents().chunks, 3u);
  }
  EXPECT_EQ(opened(folder.path())->unfinished().at(0)->contents().chunks, 3u) << "also after the next start";
}

TEST(SpoolDamage, aLostLastChunkIsCountedByTheEnd) {
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

TEST(SpoolDamage, aShortChunkOfAnEndedSessionIsCountedAsDamage) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  fs::remove(session / "chunks");
  {
    auto file = std::move(*SpoolFile::open(session / "chunks"));
    ASSERT_TRUE(file.append(0, 0, coded(0, 100)).ok());
    ASSERT_TRUE(file.append(1, 1, coded(100, 10)).ok());  // intact, but with samples from 100 earlier
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

TEST(SpoolDamage, anEndThatContradictsItsChunksIsNotBelieved) {
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

TEST(SpoolDamage, chunksBehindDamageAreKeptAndTheLossIsCounted) {
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

TEST(SpoolDamage, theTailBehindADamagedLastChunkIsKept) {
  const TempFolder folder;
  damageChunks(fiveChunksAndATail(folder.path()), {4}, 5);
  const Recovered found = recover(folder.path());
  EXPECT_EQ(found.samples.size(), 412u);
  EXPECT_EQ(found.contents.damage, (SpoolDamage{1, 100, 400}));
}

TEST(SpoolDamage, aDamagedFirstChunkIsCountedFromTickZero) {
  const TempFolder folder;
  damageChunks(fiveChunksAndATail(folder.path()), {0}, 5);
  EXPECT_EQ(recover(folder.path()).contents.damage, (SpoolDamage{1, 100, 0}));
}

TEST(SpoolDamage, aRecordOfAnotherTimeBehindDamageIsNotTaken) {
  // the disk returned an old record with a later number; the session already has its samples
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

TEST(SpoolDamage, aHandEditedDescriptionIsReadButNotATamperedOne) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  fs::remove(session / "session.copy.json");
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
  // following the note's advice
  std::ofstream(session / "session.json", std::ios::binary) << before;
  EXPECT_EQ(recover(folder.path()).samples.size(), 300u);
}

TEST(SpoolDamage, aDamagedDescriptionIsReadFromItsCopy) {
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
  // a damaged copy does no harm while the description is intact; if both are damaged, a technician is needed
  std::ofstream(session / "session.copy.json", std::ios::binary) << text.substr(1);
  EXPECT_EQ(recover(folder.path()).samples.size(), 300u);
  std::ofstream(session / "session.json", std::ios::binary) << text.substr(2);
  const auto spool = opened(folder.path());
  EXPECT_TRUE(spool->unfinished().empty());
  EXPECT_THAT(spool->notes(), testing::ElementsAre(testing::AllOf(HasSubstr("Its copy is damaged, too"),
                                                                  HasSubstr("left as it is"))));
  EXPECT_TRUE(fs::exists(session / "chunks"));
}

TEST(SpoolDamage, anUnusableDescriptionParksOnlyItsOwnSession) {
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
  // as intact as the others, by its checksum
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

TEST(SpoolDamage, damageIsReportedOnceWithWhatRemainsAndWhere) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  damageChunks(session, {1}, 3);
  const auto notes = [&] { return (*Spool::open(folder.path()))->notes(); };
  EXPECT_THAT(notes(), testing::ElementsAre(testing::AllOf(
                           HasSubstr("200 samples can still be read, 100 samples (1 chunk) from tick 100 on"),
                           HasSubstr((session / "chunks.damaged").string()))));
  EXPECT_THAT(notes(), testing::IsEmpty());
}

TEST(SpoolDamage, insideDamageKeepsTheFileButATornEndDoesNot) {
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

TEST(SpoolDamage, aGapOfUnsyncedDataIsCountedButNoDiskDamage) {
  // A power cut lost the first sectors in flight and kept later ones.
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), false, false);
  damageChunks(session, {1}, 3);
  EXPECT_THAT((*Spool::open(folder.path()))->notes(), testing::Not(testing::Contains(HasSubstr("damaged"))));
  EXPECT_FALSE(fs::exists(session / "chunks.damaged"));
  const Recovered found = recover(folder.path());
  EXPECT_TRUE(found.contents.interrupted);
  EXPECT_EQ(found.samples.size(), 200u);
  EXPECT_EQ(found.contents.damage, (SpoolDamage{1, 100, 100}));
}

TEST(SpoolDamage, damagedChunksAreNotCutOffWhileNoCopyCanBeKept) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  const std::string text = damageChunks(session, {1}, 3);
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

TEST(SpoolDamage, aDeeplyNestedSmallFileCountsAsDamaged) {
  const std::string deep = std::string(500'000, '[') + std::string(500'000, ']');
  {
    const TempFolder folder;
    std::ofstream(sessionOfThreeChunks(folder.path(), true) / "end.json", std::ios::binary) << sealed(
        R"({"chunks": 3, "samples": 300, "hash": "", "interrupted": false, "damage": )" + deep + "}");
    const Recovered found = recover(folder.path());
    EXPECT_EQ(found.samples.size(), 300u);
    EXPECT_TRUE(found.contents.interrupted);
  }
  const TempFolder folder;
  std::ofstream(fiveChunksAndATail(folder.path()) / "tail.json", std::ios::binary)
      << sealed(R"({"chunks": [{"seq": 0, "samples": 1, "more": )" + deep + "}]}");
  const Recovered found = recover(folder.path());
  EXPECT_EQ(found.samples.size(), 512u);
  EXPECT_EQ(found.contents.damage, SpoolDamage{});
}

TEST(SpoolDamage, aLossIsKnownAfterTheProgramsDeath) {
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

TEST(SpoolDamage, aBadLossFileMakesAnEndedSessionInterrupted) {
  const TempFolder original;
  const fs::path session = sessionOfThreeChunks(original.path(), true);
  const std::string text = *readWholeFile(session / "lost");
  std::vector<std::string> damages = {"", "many, and early", text.substr(0, 50), text + "\n",
                                      // without its checksum, and with more than a lesson can lose
                                      text.substr(0, text.find("crc32c")),
                                      sealed(fmt::format("{:020} {:020}\n", 100'000'000'000u, 0))};
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
      ASSERT_THAT(spool->notes(), testing::ElementsAre(HasSubstr("it is unknown how many"))) << damaged;
    }
  }
  fs::remove(session / "lost");
  EXPECT_TRUE(recover(original.path()).contents.interrupted);
}

TEST(SpoolDamage, theLongestLossThatALessonCanHaveIsBelieved) {
  const TempFolder folder;
  const fs::path session = sessionOfThreeChunks(folder.path(), true);
  const std::uint64_t most = std::uint64_t{1000} << 20;  // at 1 kHz
  for (const std::uint64_t samples : {most, most + 1}) {
    std::ofstream(session / "lost", std::ios::binary) << sealed(fmt::format("{:020} {:020}\n", samples, 300));
    EXPECT_EQ(recover(folder.path()).contents.loss, samples == most ? (SpoolLoss{most, 300}) : SpoolLoss{});
  }
}

}  // namespace
}  // namespace needlelab::test
