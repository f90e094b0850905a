#include "db/erasure_list.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "db/erasure.h"
#include "db/people.h"
#include "tests/unit/db/erasure_fixture.h"

namespace needlelab {
namespace {

using ErasureListTest = test::ErasureTest;

// Where others may write, one may come between the reading of the list and its writing.
TEST_F(ErasureListTest, aPipeInItsPlaceIsNotWaitedFor) {
  const test::TempFolder beside;
  const auto pipe = beside.path() / kErasuresCopy;
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const Status written = writeErasures(beside.path(), {line("anna", 77)}, kErasuresCopy);
  ASSERT_FALSE(written.ok());
  EXPECT_THAT(written.error().message, testing::HasSubstr(pipe.string()));
  EXPECT_FALSE(addErasures(beside.path(), {line("anna", 77)}, kErasuresCopy).ok());
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
}

TEST_F(ErasureListTest, theListBesideABackupIsAddedToWithoutLosingALine) {
  const test::TempFolder beside;
  ErasureLine first = line("anna", 77), second = line("ben", 88);
  first.with_waiting = true;
  second.pseudonym = "erased-5678";
  second.without_account = true;
  ASSERT_OK(addErasures(beside.path(), {first}, kErasuresCopy));
  ASSERT_OK(addErasures(beside.path(), {second}, kErasuresCopy));
  ASSERT_OK(addErasures(beside.path(), {first, second}, kErasuresCopy));
  const auto lines = readErasures(beside.path(), kErasuresCopy);
  ASSERT_OK(lines);
  ASSERT_EQ(lines->size(), 2u);
  EXPECT_TRUE((*lines)[0].with_waiting);
  EXPECT_FALSE((*lines)[1].with_waiting);
  EXPECT_FALSE((*lines)[0].without_account);
  EXPECT_TRUE((*lines)[1].without_account);
  EXPECT_EQ((*lines)[1].name_hash, second.name_hash);
  EXPECT_TRUE(readErasures(beside.path())->empty()) << "another file";
}

TEST_F(ErasureListTest, linesOfTheListAreHeldByAMacOfTheKey) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  const PseudonymKey other(PseudonymKey::Hash{7});
  EXPECT_EQ(key->id().size(), 16u);
  EXPECT_NE(key->id(), other.id());
  ErasureLine made = line("anna", 77);
  EXPECT_EQ(sealOf(made, *key), SealState::kBroken) << "it has none";
  made.with_waiting = true;
  ASSERT_OK(writeErasures(db.folder.path(), {sealed(made, *key), line("ben", 88)}));
  const auto lines = readErasures(db.folder.path());
  ASSERT_OK(lines);
  ASSERT_EQ(lines->size(), 2u);
  const ErasureLine& read = lines->front();
  EXPECT_EQ(sealOf(read, *key), SealState::kOurs);
  EXPECT_TRUE(read.with_waiting);
  EXPECT_EQ(read.unix_ns, 77);
  EXPECT_EQ(sealOf(read, other), SealState::kOtherKey);
  EXPECT_FALSE((*lines)[1].seal.has_value());
  // each change shows
  for (const int what : {0, 1, 2, 3, 4, 5}) {
    ErasureLine changed = read;
    if (what == 0) changed.pseudonym += "0";
    if (what == 1) changed.name_hash[31] ^= 1;
    if (what == 2) changed.unix_ns += 1;
    if (what == 3) changed.with_waiting = false;
    if (what == 4) changed.seal->mac.clear();
    if (what == 5) changed.without_account = true;
    EXPECT_EQ(sealOf(changed, *key), SealState::kBroken) << what;
  }
  const auto text = readWholeFile(db.folder.path() / kErasuresFile);
  ASSERT_OK(text);
  EXPECT_TRUE(
      text->starts_with("erased-1234 " + hexDigitsOf(textOf(made.name_hash)) + " 77 with-waiting key="))
      << *text;
}

TEST_F(ErasureListTest, linesThatWereChangedOrAreOfAnotherKeyAreToldAndNotObeyed) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  ErasureStore store(db.writer);
  const auto faults = [&] {
    const auto all = store.listFaults(db.folder.path());
    EXPECT_OK(all);
    return *all;
  };
  EXPECT_TRUE(faults().empty());
  ASSERT_OK(writeErasures(db.folder.path(), {sealed(line("anna", 77), *key)}));
  EXPECT_EQ(store.toRepeat(db.folder.path())->size(), 1u);
  EXPECT_TRUE(faults().empty());
  // a known hash under another pseudonym
  ErasureLine forged = sealed(line("anna", 77), *key);
  forged.pseudonym = "erased-5678";
  ASSERT_OK(writeErasures(db.folder.path(), {forged}));
  EXPECT_TRUE(store.toRepeat(db.folder.path())->empty());
  ASSERT_EQ(faults().size(), 1u);
  EXPECT_NE(faults()[0].find("1 lines, such as that of erased-5678, were changed"), std::string::npos);
  // somebody took the MAC away
  ASSERT_OK(writeErasures(db.folder.path(), {line("anna", 77)}));
  EXPECT_TRUE(store.toRepeat(db.folder.path())->empty());
  EXPECT_EQ(faults().size(), 1u);
  // another machine's list
  const PseudonymKey other(PseudonymKey::Hash{7});
  ASSERT_OK(writeErasures(db.folder.path(), {sealed({"erased-9abc", other.nameHash("anna"), 77}, other)}));
  EXPECT_TRUE(store.toRepeat(db.folder.path())->empty());
  ASSERT_EQ(faults().size(), 1u);
  EXPECT_NE(faults()[0].find("another pseudonym.key (" + other.id() + ") than the one here (" + key->id()),
            std::string::npos)
      << faults()[0];
}

TEST_F(ErasureListTest, aPseudonymIsOneOnlyInTheFormThatErasuresMake) {
  EXPECT_TRUE(isErasurePseudonym("erased-0123456789ab"));
  for (const char* other : {"", "ben", "erased-", "erased-0123456789a", "erased-0123456789abc",
                            "erased-0123456789aB", "erased-0123456789a ", "Erased-0123456789ab"})
    EXPECT_FALSE(isErasurePseudonym(other)) << other;
}

TEST_F(ErasureListTest, aLineWhosePseudonymAnAccountHasIsToldAndNotObeyed) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  ErasureLine made = line("anna", 77);
  made.pseudonym = "ben";
  ASSERT_OK(writeErasures(db.folder.path(), {sealed(made, *key)}));
  EXPECT_TRUE(ErasureStore(db.writer).toRepeat(db.folder.path())->empty());
  const auto faults = ErasureStore(db.writer).listFaults(db.folder.path());
  ASSERT_OK(faults);
  ASSERT_EQ(faults->size(), 1u);
  EXPECT_NE(faults->at(0).find("'ben', is the name of an account"), std::string::npos) << faults->at(0);
}

TEST_F(ErasureListTest, noListIsWrittenThatCouldNotBeReadAgain) {
  std::vector<ErasureLine> lines;
  for (std::size_t i = 0; i < kMostErasureLines; ++i)
    lines.push_back({fmt::format("erased-{:012x}", i), {}, 77, false, ErasureSeal{"k", "m"}});
  ASSERT_OK(writeErasures(db.folder.path(), lines));
  EXPECT_EQ(readErasures(db.folder.path())->size(), kMostErasureLines);
  // each line is there: not one comparison for each pair of them
  ASSERT_OK(addErasures(db.folder.path(), lines));
  const auto more = addErasures(db.folder.path(), {line("anna", 77)});
  ASSERT_FALSE(more.ok());
  EXPECT_EQ(more.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(more.error().message.find("now 50001 lines, such a list has at most 50000"), std::string::npos);
  EXPECT_EQ(readErasures(db.folder.path())->size(), kMostErasureLines) << "as it was";
  lines.resize(1);
  lines[0].seal->mac.assign(16u << 20, 'f');
  EXPECT_EQ(writeErasures(db.folder.path(), lines).error().code, ErrorCode::kInvalidInput);
  // one that another program wrote is told, and the server starts
  ASSERT_OK(
      writeFileAtomically(db.folder.path() / kErasuresFile, viewOf(std::string((16u << 20) + 1, '\n'))));
  EXPECT_EQ(readErasures(db.folder.path()).error().code, ErrorCode::kCorrupt);
}

// Who can write beside the backups must not keep this machine's erasures out.
TEST_F(ErasureListTest, linesOfOthersGiveWayBesideTheBackups) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  const ErasureLine own = sealed(line("anna", 77), *key);
  const test::TempFolder beside;
  std::vector<ErasureLine> others;
  for (std::size_t i = 0; i < kMostErasureLines; ++i)
    others.push_back(
        {fmt::format("erased-{:012x}", i), {}, 77, false, ErasureSeal{"0123456789abcdef", "00"}});
  ASSERT_OK(writeErasures(beside.path(), others, kErasuresCopy));
  const auto note = addErasuresBeside(beside.path(), {own}, &*key);
  ASSERT_OK(note);
  EXPECT_THAT(*note, testing::HasSubstr(fmt::format("{} lines that the pseudonym.key here did not make",
                                                    kMostErasureLines + 1 - kMostLinesBeside)));
  const auto left = readErasures(beside.path(), kErasuresCopy);
  ASSERT_OK(left);
  ASSERT_EQ(left->size(), kMostLinesBeside) << "a restore takes it";
  EXPECT_EQ(left->front().pseudonym, others.front().pseudonym) << "the last give way";
  EXPECT_EQ(sealOf(left->back(), *key), SealState::kOurs);
  EXPECT_EQ(lackedBeside(beside.path(), {own}, *key), "");
  const auto again = addErasuresBeside(beside.path(), {own}, &*key);
  ASSERT_OK(again);
  EXPECT_EQ(*again, "");
}

TEST_F(ErasureListTest, whatIsNoListBesideTheBackupsIsPutAside) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  const ErasureLine own = sealed(line("anna", 77), *key);
  const test::TempFolder beside;
  ASSERT_OK(writeFileAtomically(beside.path() / kErasuresCopy, viewOf("nonsense\n")));
  EXPECT_THAT(lackedBeside(beside.path(), {own}, *key), testing::HasSubstr("line 1 is not a pseudonym"));
  const auto note = addErasuresBeside(beside.path(), {own}, &*key);
  ASSERT_OK(note);
  EXPECT_THAT(*note, testing::HasSubstr("It was put aside as " + (beside.path() / kErasuresAside).string()));
  EXPECT_EQ(*readWholeFile(beside.path() / kErasuresAside), "nonsense\n");
  EXPECT_EQ(lackedBeside(beside.path(), {own}, *key), "");
  // a link to a list that only this program may write
  std::filesystem::remove(beside.path() / kErasuresCopy);
  const test::TempFolder data;
  ASSERT_OK(writeErasures(data.path(), {line("ben", 78)}));
  std::filesystem::create_symlink(data.path() / kErasuresFile, beside.path() / kErasuresCopy);
  EXPECT_THAT(lackedBeside(beside.path(), {}, *key), testing::HasSubstr("is a link"));
  const auto linked = addErasuresBeside(beside.path(), {line("anna", 77)}, &*key);
  ASSERT_OK(linked);
  EXPECT_THAT(*linked, testing::HasSubstr("is a link"));
  EXPECT_FALSE(std::filesystem::is_symlink(beside.path() / kErasuresCopy));
  EXPECT_EQ(readErasures(data.path())->size(), 1u) << "nothing was written through the link";
  // a folder is nobody's list: people must look
  std::filesystem::remove(beside.path() / kErasuresCopy);
  std::filesystem::create_directory(beside.path() / kErasuresCopy);
  EXPECT_FALSE(addErasuresBeside(beside.path(), {own}, &*key).ok());
  EXPECT_THAT(lackedBeside(beside.path(), {own}, *key), testing::HasSubstr("cannot be read"));
}

TEST_F(ErasureListTest, copiesOfOneLineBesideTheBackupsKeepNoErasureOut) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  const ErasureLine own = sealed(line("anna", 77), *key);
  ErasureLine more = line("ben", 78);
  more.pseudonym = "erased-5678";
  more = sealed(more, *key);
  const test::TempFolder beside;
  ASSERT_OK(writeErasures(beside.path(), std::vector<ErasureLine>(kMostLinesBeside + 1, own), kErasuresCopy));
  const auto note = addErasuresBeside(beside.path(), {more}, &*key);
  ASSERT_OK(note);
  EXPECT_EQ(*note, "");
  EXPECT_EQ(readErasures(beside.path(), kErasuresCopy)->size(), 2u);
  EXPECT_EQ(lackedBeside(beside.path(), {own, more}, *key), "");
}

TEST_F(ErasureListTest, whatTheListBesideTheBackupsLacksIsNamed) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  const PseudonymKey other(PseudonymKey::Hash{7});
  const ErasureLine own = sealed(line("anna", 77), *key), without_mac = line("anna", 77);
  ErasureLine newer = line("anna", 78), foreign = line("ben", 77);
  newer = sealed(newer, *key);
  foreign.pseudonym = "erased-5678";
  foreign = sealed(foreign, other);
  const test::TempFolder beside;
  const auto lacked = [&](const std::vector<ErasureLine>& here, const std::vector<ErasureLine>& there) {
    EXPECT_OK(writeErasures(beside.path(), there, kErasuresCopy));
    const std::string text = lackedBeside(beside.path(), here, *key);
    EXPECT_TRUE(text.empty() || text.find("lacks 1 erasures, such as erased-1234") != std::string::npos)
        << text;
    return !text.empty();
  };
  EXPECT_THAT(lackedBeside(beside.path(), {own}, *key), testing::HasSubstr("lacks 1 erasures"));
  EXPECT_FALSE(lacked({own, foreign}, {own}));
  EXPECT_TRUE(lacked({own}, {foreign}));
  EXPECT_TRUE(lacked({newer}, {own})) << "the person was erased again";
  EXPECT_FALSE(lacked({own}, {newer}));
  EXPECT_TRUE(lacked({own}, {without_mac})) << "a restore does not obey a line without a MAC";
  EXPECT_FALSE(lacked({}, {}));
}

TEST_F(ErasureListTest, theCommandThatShortensAListLeavesThisFoldersLines) {
  const ErasureLine own = sealed(line("anna", 77), *PseudonymKey::ofFolder(db.folder.path()));
  ASSERT_OK(writeErasures(db.folder.path(), {own}));
  std::string text = *readWholeFile(db.folder.path() / kErasuresFile);
  for (std::size_t i = 0; i < kMostErasureLines; ++i)
    text += fmt::format("erased-{:012x} {} 99 key=0123456789abcdef mac=00\n", i, std::string(64, '0'));
  ASSERT_OK(writeFileAtomically(db.folder.path() / kErasuresFile, viewOf(text)));
  const auto refused = readErasures(db.folder.path());
  ASSERT_FALSE(refused.ok());
  const std::string& message = refused.error().message;
  const auto at = message.find("cp '");
  ASSERT_NE(at, std::string::npos) << message;
  ASSERT_EQ(std::system(message.substr(at).c_str()), 0) << message;
  const auto left = readErasures(db.folder.path());
  ASSERT_OK(left);
  ASSERT_EQ(left->size(), 1u);
  EXPECT_EQ(left->front().pseudonym, own.pseudonym);
  EXPECT_EQ(*readWholeFile(db.folder.path() / "erasures.all"), text);
}

TEST_F(ErasureListTest, aLineBesideABackupThatWasChangedIsPutRight) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  const test::TempFolder beside;
  const ErasureLine made = sealed(line("anna", 77), *key);
  ErasureLine later = made;
  later.unix_ns = 99;
  for (const ErasureLine& there : {later, line("anna", 77)}) {
    ASSERT_OK(writeErasures(beside.path(), {there}, kErasuresCopy));
    ASSERT_OK(addErasures(beside.path(), {made}, kErasuresCopy, &*key));
    const auto lines = readErasures(beside.path(), kErasuresCopy);
    ASSERT_OK(lines);
    ASSERT_EQ(lines->size(), 1u);
    EXPECT_EQ(sealOf((*lines)[0], *key), SealState::kOurs);
    EXPECT_EQ((*lines)[0].unix_ns, 77);
  }
}

}  // namespace
}  // namespace needlelab
