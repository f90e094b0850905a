// Account names: which count as the same name, and which are refused.
#include "db/people/person_name.h"

#include <gmock/gmock.h>

#include <string>
#include <utility>

#include "db/people/people.h"
#include "db/store/schema.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

std::string refused(const std::string& name) {
  const Status valid = checkNewPersonName("name", name);
  return valid ? "" : valid.error().message;
}

TEST(PersonName, spellingsOfOneNameHaveOneKey) {
  // Unicode's own examples of normalisation (UAX 15) and of full case folding (CaseFolding.txt)
  for (const auto& [one, other] :
       {std::pair<const char*, const char*>{"bea.l", "Bea.L"},
        {"j\u00fcrgen", "ju\u0308rgen"},
        {"J\u00dcRGEN", "ju\u0308rgen"},
        {"\u1e69", "s\u0307\u0323"},
        {"stra\u00dfe", "STRASSE"},
        {"\u03a3\u03af\u03c3\u03c5\u03c6\u03bf\u03c2", "\u03c3\u03af\u03c3\u03c5\u03c6\u03bf\u03c3"},
        {"\u0410\u043d\u043d\u0430", "\u0430\u043d\u043d\u0430"},
        {"\u0130nci", "i\u0307nci"},
        {"an\u00adna", "anna"},
        {"autumn-a", "autumn\u2011a"},
        {"autumn-a", "Autumn\u2013A"},
        {"room-3", "room\u22123"},
        {"anna b", "anna  b"},
        {"anna b", "anna\u00a0\u2009b"},
        {"\u0645\u06cc\u200c\u062e", "\u0645\u06cc\u062e"}}) {
    EXPECT_EQ(nameKey(one), nameKey(other)) << one << " and " << other;
    EXPECT_EQ(nameKey(nameKey(one)), nameKey(one)) << one;
  }
}

TEST(PersonName, otherNamesHaveOtherKeys) {
  for (const auto& [one, other] : {std::pair<const char*, const char*>{"anna", "anne"},
                                   {"\u00fc", "u"},
                                   {"\u00fc", "ue"},
                                   {"anna b", "annab"},
                                   {"\u0131nci", "inci"},
                                   {"\uff41nna", "anna"}})
    EXPECT_NE(nameKey(one), nameKey(other)) << one << " and " << other;
}

TEST(PersonName, allWhiteSpaceIsTrimmedFromTheEnds) {
  for (const char* space : {" ", "\t", "\u00a0", "\u1680", "\u2000", "\u2007", "\u200a", "\u2028", "\u202f",
                            "\u205f", "\u3000", "\u0085"}) {
    const std::string all = std::string(space) + "anna k" + space + space;
    EXPECT_EQ(trimmedName(all), "anna k") << all;
    EXPECT_EQ(trimmedName(space), "");
  }
  EXPECT_EQ(trimmedName("a\xff\u00a0"), "a\xff") << "bytes that are not UTF-8 stay";
}

TEST(PersonName, whatCannotBeReadOrTypedIsRefused) {
  using testing::HasSubstr;
  EXPECT_THAT(refused("anna\u00a0"), HasSubstr("begins or ends with a space"));
  EXPECT_THAT(refused("J\ufffdrgen"), HasSubstr("U+FFFD"));
  EXPECT_THAT(refused("an\u00adna"), HasSubstr("U+00AD"));
  for (const char* hidden : {"\u034f", "\u115f", "\u3164", "\uffa0", "\ufe0f", "\u2800", "\U000e0100"})
    EXPECT_THAT(refused(std::string("an") + hidden + "na"), HasSubstr("invisible")) << hidden;
  EXPECT_THAT(refused("@17"), HasSubstr("begins with '@'"));
  for (const char* own : {"server", "SERVER", "Guest", "local", "Local:root", "retention", "Erasure"})
    EXPECT_THAT(refused(own), HasSubstr("take another one")) << own;
  for (const char* good : {"anna", "Bea M\u00fcller", "jos\u00e9", "\u0627\u0645\u06cc\u200c\u0631", "0815",
                           "%", "d'Arc", "a@b.c", "server-room"})
    EXPECT_EQ(refused(good), "") << good;
}

TEST(PersonName, anotherSpellingOfAnExistingNameIsRefusedWithAQuestion) {
  test::TestDb db;
  PeopleStore people(db.writer);
  ASSERT_OK(people.add({"J\u00fcrgen", pb::TRAINEE, "", false, 1}));
  for (const char* same : {"ju\u0308rgen", "J\u00dcRGEN", "j\u00fcrgen"}) {
    const Status refused = people.add({same, pb::TRAINEE, "", false, 1});
    ASSERT_FALSE(refused) << same;
    EXPECT_EQ(refused.error().code, ErrorCode::kAlreadyExists);
    EXPECT_THAT(refused.error().message, testing::HasSubstr("named 'J\u00fcrgen'")) << same;
    EXPECT_THAT(refused.error().message, testing::HasSubstr("is it the same person?")) << same;
    EXPECT_EQ(people.findNamed(same)->value().name, "J\u00fcrgen") << "shown as typed";
  }
}

TEST(PersonName, otherTablesOfUnicodeGiveNewKeysUnlessTwoNamesBecomeOne) {
  test::TestDb db;
  PeopleStore people(db.writer);
  const auto refresh = [&] {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    const Status done = refreshNameKeys(db.writer);
    if (done) {
      EXPECT_OK(transaction->commit());
    }
    return done;
  };
  ASSERT_OK(refresh());
  ASSERT_OK(people.add({"Anna", pb::TRAINEE, "", false, 1}));
  ASSERT_OK(people.add({"ben", pb::TRAINEE, "", false, 1}));
  // as left by tables that did not know that A is a
  ASSERT_OK(db.writer.run("UPDATE names SET folded = name"));
  ASSERT_OK(MetaStore(db.writer).set("names_unicode", "1.0.0"));
  ASSERT_OK(refresh());
  EXPECT_EQ(people.findNamed("ANNA")->value().name, "Anna");
  EXPECT_EQ(people.findNamed("BEN")->value().name, "ben");

  ASSERT_OK(people.add({"another", pb::TRAINEE, "", false, 1}));
  ASSERT_OK(db.writer.run("UPDATE names SET name = 'anna' WHERE name = 'another'"));
  ASSERT_OK(refresh());  // same tables: nothing is checked
  ASSERT_OK(MetaStore(db.writer).set("names_unicode", "1.0.0"));
  const Status refused = refresh();
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("'Anna' and 'anna' are one name"));
  EXPECT_EQ(people.findNamed("ANNA")->value().name, "Anna") << "nothing is changed";
}

}  // namespace
}  // namespace needlelab
