// An erasure that had no success at its end: its COMMIT may have been carried out all the same.
#include <gmock/gmock.h>

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/clock.h"
#include "db/erasure.h"
#include "db/erasure_list.h"
#include "db/pseudonyms.h"
#include "db/service/erasures.h"
#include "tests/unit/db/service/records_fixture.h"

namespace needlelab {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class ErasureInDoubt : public test::RecordsTest {
 protected:
  void SetUp() override {
    addStation();
    addPerson("ada", pb::ADMINISTRATOR);
    addNamed("anna", "Anna A");
  }
  /// Puts a line for anna on the list, as a request to erase does first.
  ErasureLine putOnList() {
    const auto key = PseudonymKey::ofFolder(data);
    EXPECT_OK(key);
    const ErasureLine line = sealed({newErasurePseudonym(), key->nameHash("anna"), wallNowNs(), false}, *key);
    EXPECT_OK(writeErasures(data, {line}));
    return line;
  }
  Result<std::string> settle(const ErasureLine& line) {
    return settleErasure(store->writer(), data, line, {}, why);
  }
  [[nodiscard]] std::vector<std::string> listed() const {
    std::vector<std::string> pseudonyms;
    for (const ErasureLine& line : test::TestDb::must(readErasures(data)))
      pseudonyms.push_back(line.pseudonym);
    return pseudonyms;
  }
  const std::filesystem::path data = folder.path() / "data";
  const Error why{ErrorCode::kUnavailable, "the connection was lost"};
};

TEST_F(ErasureInDoubt, staysOnTheListWhereTheDatabaseHasIt) {
  EXPECT_EQ(get(admin, erase("anna")).erasure().sessions(), 0u);
  const auto lines = readErasures(data);
  ASSERT_OK(lines);
  ASSERT_EQ(lines->size(), 1u);
  const auto settled = settle(lines->front());
  ASSERT_OK(settled);
  EXPECT_THAT(*settled, AllOf(HasSubstr("is erased"), HasSubstr(why.message)));
  EXPECT_THAT(listed(), testing::ElementsAre(lines->front().pseudonym));
}

TEST_F(ErasureInDoubt, leavesTheListWhereTheDatabaseDoesNotHaveIt) {
  const auto settled = settle(putOnList());
  ASSERT_FALSE(settled.ok());
  EXPECT_EQ(settled.error().code, why.code);
  EXPECT_EQ(settled.error().message, why.message);
  EXPECT_THAT(listed(), testing::IsEmpty());
}

TEST_F(ErasureInDoubt, isNotTakenForTheErasureThatItRepeats) {
  get(admin, erase("anna"));
  auto line = test::TestDb::must(readErasures(data)).front();
  ++line.unix_ns;
  ASSERT_OK(writeErasures(data, {line}));
  EXPECT_FALSE(settle(line).ok());
  EXPECT_THAT(listed(), testing::IsEmpty()) << "as it was given";
}

TEST_F(ErasureInDoubt, staysOnTheListWhereNobodyCanTellAndTheNextStartErasesThePerson) {
  const ErasureLine line = putOnList();
  store->writer().stop();
  const auto settled = settle(line);
  ASSERT_FALSE(settled.ok());
  EXPECT_EQ(settled.error().code, why.code);
  EXPECT_THAT(settled.error().message,
              AllOf(HasSubstr(why.message), HasSubstr("nobody can tell whether"), HasSubstr(line.pseudonym)));
  EXPECT_THAT(listed(), testing::ElementsAre(line.pseudonym));
  store.reset();
  store = test::openStore(data);
  EXPECT_EQ(store->erasuresRepeated(), 1u);
}

TEST_F(ErasureInDoubt, isNoneWhereTheReplySaysWhatPostgresqlKeeps) {
  const std::string text = get(admin, erase("anna")).erasure().text();
  EXPECT_EQ(text.find("\"Erasure on PostgreSQL\"") != std::string::npos, test::onPostgres()) << text;
}

}  // namespace
}  // namespace needlelab
