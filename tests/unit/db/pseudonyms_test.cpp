#include "db/pseudonyms.h"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/base/text.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

TEST(Pseudonym, isStableWithinAStudyAndTellsNothingAcross) {
  const test::TempFolder folder;
  const auto key = PseudonymKey::ofFolder(folder.path());
  ASSERT_OK(key);
  const auto again = PseudonymKey::ofFolder(folder.path());
  EXPECT_EQ(key->ofPerson("s", "anna", 1), again->ofPerson("s", "anna", 1));
  const std::set<std::string> all{key->ofPerson("s", "anna", 1), key->ofPerson("t", "anna", 1),
                                  key->ofPerson("s", "ben", 1), key->ofPerson("s", "anna", 2),
                                  key->ofPerson("sa", "nna", 1)};
  EXPECT_EQ(all.size(), 5u);
  const test::TempFolder elsewhere;
  EXPECT_NE(PseudonymKey::ofFolder(elsewhere.path())->ofPerson("s", "anna", 1),
            key->ofPerson("s", "anna", 1));
  const auto mode = std::filesystem::status(folder.path() / "pseudonym.key").permissions();
  EXPECT_EQ(mode, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  ASSERT_OK(writeFileAtomically(folder.path() / "pseudonym.key", viewOf("short")));
  EXPECT_EQ(PseudonymKey::ofFolder(folder.path()).error().code, ErrorCode::kCorrupt);
}

TEST(Pseudonym, aNameIsReplacedAsAWordOnly) {
  EXPECT_EQ(withoutName("anna, Anna and annabel; susanna", "anna", "", "X"), "X, X and annabel; susanna");
  EXPECT_EQ(withoutName("Dr. Berg and Li", "b1", "Anna Berg Li", "X"), "Dr. X and Li")
      << "two letters may be any word";
  EXPECT_EQ(withoutName("Anna Berg Li was here", "b1", "Anna Berg Li", "X"), "X was here");
  EXPECT_EQ(withoutName("Jürg übte", "jürg", "", "X"), "X übte");
  EXPECT_EQ(withoutName("", "anna", "", "X"), "");
  EXPECT_EQ(withoutName("anna", "", "", "X"), "anna");
  EXPECT_EQ(withoutName("ananas anna", "ana", "", "X"), "ananas anna");
}

TEST(Pseudonym, aPlainSearchFindsANameInEitherCaseOfItsScript) {
  const std::pair<std::string, std::string> pairs[] = {
      {"Östlund", "öSTLUND"}, {"ŽIŽEK", "žižek"},     {"Łukasz", "łUKASZ"}, {"Иванов", "ИВАНОВ"},
      {"Ђоко", "ђоко"},       {"Γιώργος", "ΓΙΏΡΓΟΣ"}, {"Արամ", "արամ"},     {"Þór", "þÓR"},
      {"Ωmega", "ωMEGA"},     {"李明", "李明"},       {"Ionuț", "IONUȚ"},   {"Айгүл", "АЙГҮЛ"},
      {"Nguyễn", "NGUYỄN"},   {"Ґалаґан", "ҐАЛАҐАН"}, {"Weiß", "WEISS"},    {"Weiß", "WEIẞ"},
  };
  for (const auto& [name, written] : pairs) {
    const ErasedNames names{"x-1", {name}, {}, "p", {}};
    EXPECT_TRUE(NameSearch(names).finds("bei " + written + "s")) << name;
    EXPECT_TRUE(NameSearch({written, {}, {}, "p", {}}).finds(name)) << name;
    EXPECT_FALSE(NameSearch({name, {}, {written + "-Berg"}, "p", {}}).finds("bei " + written + "-Berg"))
        << name;
  }
  // in another number of bytes, beside a text that has another one, too
  EXPECT_TRUE(NameSearch({"x-1", {"Weiß"}, {"Weißhaupt", "ẞẞ"}, "p", {}}).finds("ẞẞ WEISS"));
  EXPECT_FALSE(NameSearch({"x-1", {"Weiß"}, {"Weißhaupt"}, "p", {}}).finds("ẞẞ WEISSHAUPT"));
  EXPECT_FALSE(NameSearch({"÷stlund", {}, {}, "p", {}}).finds("×stlund")) << "signs are no letters";
}

TEST(Pseudonym, punctuationOfEveryScriptEndsAName) {
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
      << "what is no UTF-8 is no letter";
}

TEST(Pseudonym, aNameInAScriptWithoutSpacesIsReplacedWhereverItStands) {
  EXPECT_EQ(withoutName("李雷手抖了", "李雷", "", "X"), "X手抖了");
  EXPECT_EQ(withoutName("今天李雷手抖了", "李雷", "", "X"), "今天X手抖了");
  EXPECT_EQ(withoutName("با آناو", "آنا", "", "X"), "با Xو");
  EXPECT_EQ(withoutName("김민수가 anna와", "김민수", "", "X"), "X가 anna와");
  EXPECT_EQ(withoutName("安全", "b1", "安 山田", "X"), "安全") << "one character may be of any word";
  EXPECT_EQ(withoutName("山田さん", "b1", "安 山田", "X"), "Xさん");
  const ErasedNames names{"李雷", {}, {"李雷明"}, "X", {}};
  EXPECT_EQ(withoutNames("李雷明和李雷", names, false), "李雷明和X") << "not within another person's name";
}

/// `tom` in the text becomes X where no letter of ASCII goes on from it and none of the others that stand so
/// has it as a part. The other characters of the text are no letters.
std::string withoutTom(const std::string& text, const std::vector<std::string>& others) {
  const auto has = [&](std::size_t at, const std::string& name) {
    const auto goesOn = [](char inside, char neighbour) {
      const bool letter = (neighbour >= '0' && neighbour <= '9') || (neighbour >= 'a' && neighbour <= 'z') ||
                          (neighbour >= 'A' && neighbour <= 'Z');
      return letter && static_cast<unsigned char>(inside) < 0x80;
    };
    const std::size_t end = at + name.size();
    return end <= text.size() && lowerCase(text.substr(at, name.size())) == lowerCase(name) &&
           (at == 0 || !goesOn(name.front(), text[at - 1])) &&
           (end == text.size() || !goesOn(name.back(), text[end]));
  };
  std::string without;
  for (std::size_t at = 0; at < text.size();) {
    bool stays = !has(at, "tom");
    for (const std::string& other : others)
      for (std::size_t begin = 0; !stays && begin <= at; ++begin)
        stays = has(begin, other) && other.size() > 3 && begin + other.size() >= at + 3;
    without += stays ? text.substr(at, 1) : "X";
    at += stays ? 1 : 3;
  }
  return without;
}

TEST(Pseudonym, aNameStaysInOtherNamesWhateverTheirOrderAndOverlap) {
  const std::vector<std::string> pieces = {"tom", "Tom", "TOM", " ", " ", "-", "-", "0", "a", "\u2014"};
  std::mt19937 random(20);
  const auto some = [&](std::size_t most) {
    std::string text;
    for (std::size_t count = 1 + random() % most; count > 0; --count)
      text += pieces[random() % pieces.size()];
    return text;
  };
  std::size_t protect = 0, replaced = 0;
  for (int i = 0; i < 3000; ++i) {
    std::vector<std::string> others(random() % 6);
    for (std::string& other : others) other = some(6);
    const std::string text = some(40);
    const ErasedNames names{"tom", {}, OtherNames(others), "X", {}};
    const std::string expected = withoutTom(text, others);
    ASSERT_EQ(withoutNames(text, names, false), expected)
        << text << "; others: " << testing::PrintToString(others);
    protect += expected != withoutTom(text, {}) ? 1 : 0;
    replaced += expected != text ? 1 : 0;
  }
  EXPECT_GT(protect, 100u);
  EXPECT_GT(replaced, 100u);
}

TEST(Pseudonym, aLongTextFullOfTheNameIsReadOnceForAllOtherNames) {
  // before, each of the hits was looked for in each other name to the end of the text: hours
  std::vector<std::string> others;
  for (int i = 0; i < 1000; ++i) others.push_back(fmt::format("tom-{}", i));
  const ErasedNames names{"tom", {}, OtherNames(others), "X", {}};
  std::string text, expected;
  for (int i = 0; i < 250'000; ++i) text += "tom ", expected += "X ";
  EXPECT_EQ(withoutNames(text + "Tom-999", names, false), expected + "Tom-999");
  EXPECT_TRUE(NameSearch(names).finds(text));
  std::string of_others;
  for (int i = 0; i < 150'000; ++i) of_others += fmt::format("tom-{} ", i % 1000);
  EXPECT_EQ(withoutNames(of_others, names, false), of_others);
  EXPECT_FALSE(NameSearch(names).finds(of_others));
}

}  // namespace
}  // namespace needlelab
