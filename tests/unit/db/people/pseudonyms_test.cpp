#include "db/people/pseudonyms.h"

#include <gmock/gmock.h>

#include <set>
#include <string>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

TEST(Pseudonyms, areStableWithinAStudyAndTellNothingAcross) {
  const test::TempFolder folder;
  const auto key = PseudonymKey::ofFolder(folder.path());
  ASSERT_OK(key);
  const auto again = PseudonymKey::ofFolder(folder.path());
  EXPECT_EQ(key->ofPerson("s", "@anna1"), again->ofPerson("s", "@anna1"));
  const std::set<std::string> all{key->ofPerson("s", "@anna1"), key->ofPerson("t", "@anna1"),
                                  key->ofPerson("s", "@ben1"), key->ofPerson("s", "@anna2"),
                                  key->ofPerson("s@", "anna1")};
  EXPECT_EQ(all.size(), 5u);
  const test::TempFolder elsewhere;
  EXPECT_NE(PseudonymKey::ofFolder(elsewhere.path())->ofPerson("s", "@anna1"), key->ofPerson("s", "@anna1"));
  const auto mode = std::filesystem::status(folder.path() / "pseudonym.key").permissions();
  EXPECT_EQ(mode, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  ASSERT_OK(writeFileAtomically(folder.path() / "pseudonym.key", viewOf("short")));
  EXPECT_EQ(PseudonymKey::ofFolder(folder.path()).error().code, ErrorCode::kCorrupt);
}

TEST(Pseudonyms, aNameIsReplacedAsAWordOnly) {
  EXPECT_EQ(withoutName("anna, Anna and annabel; susanna", "anna", "", "X"), "X, X and annabel; susanna");
  EXPECT_EQ(withoutName("Dr. Berg and Li", "b1", "Anna Berg Li", "X"), "Dr. X and Li")
      << "two letters may be any word";
  EXPECT_EQ(withoutName("Anna Berg Li was here", "b1", "Anna Berg Li", "X"), "X was here");
  EXPECT_EQ(withoutName("Jürg übte", "jürg", "", "X"), "X übte");
  EXPECT_EQ(withoutName("", "anna", "", "X"), "");
  EXPECT_EQ(withoutName("anna", "", "", "X"), "anna");
  EXPECT_EQ(withoutName("ananas anna", "ana", "", "X"), "ananas anna");
}

TEST(Pseudonyms, punctuationOfEveryScriptEndsAName) {
  for (const char* neighbour :
       {"\u201c", "\u201d", "\u201e", "\u2019", "\u2014", "\u2026", "\u00a0", "\u00ab", "\u00bb", "\u3001",
        "\u3002", "\uff0c", "\u200b", "\U0001f600", "手", "가"}) {
    const std::string edge = neighbour;
    EXPECT_EQ(withoutName(edge + "Anna" + edge, "anna", "", "X"), edge + "X" + edge);
    EXPECT_EQ(withoutName("see " + edge + "Berg" + edge + "s", "b1", "Anna Berg", "X"),
              "see " + edge + "X" + edge + "s");
  }
  for (const char* letter : {"é", "ß", "ж", "λ", "ẽ", "\u0301", "ա"}) {
    const std::string edge = letter;
    EXPECT_EQ(withoutName(edge + "anna anna" + edge, "anna", "", "X"), edge + "anna anna" + edge);
  }
  EXPECT_EQ(withoutName("\xe2\x80"
                        "anna\xff",
                        "anna", "", "X"),
            "\xe2\x80X\xff")
      << "bytes that are not UTF-8 are not letters";
}

TEST(Pseudonyms, aNameInAScriptWithoutSpacesIsReplacedEverywhere) {
  EXPECT_EQ(withoutName("李雷手抖了", "李雷", "", "X"), "X手抖了");
  EXPECT_EQ(withoutName("今天李雷手抖了", "李雷", "", "X"), "今天X手抖了");
  EXPECT_EQ(withoutName("با آناو", "آنا", "", "X"), "با Xو");
  EXPECT_EQ(withoutName("김민수가 anna와", "김민수", "", "X"), "X가 anna와");
  EXPECT_EQ(withoutName("安全", "b1", "安 山田", "X"), "安全") << "one character may be of any word";
  EXPECT_EQ(withoutName("山田さん", "b1", "安 山田", "X"), "Xさん");
}

}  // namespace
}  // namespace needlelab
