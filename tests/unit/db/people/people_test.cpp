#include "db/people/people.h"

#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

TEST(People, returnsWhatWasAdded) {
  test::TestDb db;
  PeopleStore people(db.writer);
  ASSERT_OK(people.add({"zoe", pb::TRAINEE, "", false, 7}));
  ASSERT_OK(people.add({"Bea Müller", pb::ADMINISTRATOR, "$argon2id$x", false, 8}));
  const auto list = people.list();
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  EXPECT_EQ((*list)[0].name, "Bea Müller");
  EXPECT_EQ((*list)[0].role, pb::ADMINISTRATOR);
  EXPECT_EQ((*list)[0].password_hash, "$argon2id$x");
  EXPECT_EQ((*list)[1].created_unix_ns, 7);
  EXPECT_TRUE((*list)[1].password_hash.empty());
  EXPECT_FALSE(people.find("nobody")->has_value());
}

TEST(People, refusesTwiceTheSameNameAndWrongFields) {
  test::TestDb db;
  PeopleStore people(db.writer);
  ASSERT_OK(people.add({"anna", pb::TRAINEE, "", false, 1}));
  EXPECT_EQ(people.add({"anna", pb::INSTRUCTOR, "", false, 1}).error().code, ErrorCode::kAlreadyExists);
  EXPECT_EQ(people.find("anna")->value().role, pb::TRAINEE);
  for (const pb::Role role :
       {pb::ROLE_UNSPECIFIED, pb::STATION, static_cast<pb::Role>(99), static_cast<pb::Role>(-1)}) {
    EXPECT_EQ(people.add({"ben", role, "", false, 1}).error().code, ErrorCode::kInvalidInput);
  }
  EXPECT_EQ(people.add({"", pb::TRAINEE, "", false, 1}).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(people.add({std::string(1'000'000, 'x'), pb::TRAINEE, "", false, 1}).error().code,
            ErrorCode::kInvalidInput);
  // names are never executed as SQL
  EXPECT_OK(people.add({"x'); DROP TABLE people; --", pb::TRAINEE, "", false, 1}));
  EXPECT_EQ(people.list()->size(), 2u);
}

TEST(People, aBidirectionalFullNameIsRefusedButOldOnesAreTolerated) {
  test::TestDb db;
  PeopleStore people(db.writer);
  const std::string turned = "Tom \u202eegroeG", hebrew = "אברהם בן־דוד";
  const Status refused = people.add({"tom", pb::TRAINEE, "", false, 1, turned});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().message.rfind(
                "full_name: contains the invisible character U+202E (right-to-left override) at byte 5", 0),
            0u)
      << refused.error().message;
  EXPECT_FALSE(people.add({"to\u200bm", pb::TRAINEE, "", false, 1, "Tom"}).ok());
  ASSERT_OK(people.add({"tom", pb::TRAINEE, "", false, 1, hebrew}));
  EXPECT_FALSE(people.change("tom", {}, {.full_name = turned}, "root", 2).ok());
  EXPECT_EQ(people.find("tom")->value().full_name, hebrew);
  // stored by an earlier version
  ASSERT_OK(db.writer.run("UPDATE names SET full_name = ? WHERE name = 'tom'", turned));
  ASSERT_OK(people.setDisabled("tom", true));
  EXPECT_OK(people.change("tom", {}, {.full_name = "Tom George"}, "root", 3));
}

TEST(People, setsPasswordsAndDisables) {
  test::TestDb db;
  PeopleStore people(db.writer);
  ASSERT_OK(people.add({"anna", pb::TRAINEE, "", false, 1}));
  ASSERT_OK(people.setPasswordHash("anna", "h"));
  ASSERT_OK(people.setDisabled("anna", true));
  EXPECT_EQ(people.find("anna")->value().password_hash, "h");
  EXPECT_TRUE(people.find("anna")->value().disabled);
  ASSERT_OK(people.setDisabled("anna", false));
  EXPECT_FALSE(people.find("anna")->value().disabled);
  EXPECT_EQ(people.setPasswordHash("nobody", "h").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(people.setDisabled("nobody", true).error().code, ErrorCode::kNotFound);
}

TEST(People, setsAndRemovesCodesNextToThePassword) {
  test::TestDb db;
  PeopleStore people(db.writer);
  Person anna{"anna", pb::TRAINEE, "h", false, 1};
  anna.code_hash = "c";
  ASSERT_OK(people.add(anna));
  ASSERT_OK(people.add({"ben", pb::TRAINEE, "", false, 1}));
  EXPECT_EQ(people.find("anna")->value().code_hash, "c");
  EXPECT_EQ(people.find("ben")->value().code_hash, "");
  ASSERT_OK(people.setCodeHash("ben", "d"));
  ASSERT_OK(people.setCodeHash("anna", ""));
  EXPECT_EQ(people.find("ben")->value().code_hash, "d");
  EXPECT_EQ(people.find("anna")->value().code_hash, "");
  EXPECT_EQ(people.find("anna")->value().password_hash, "h");
  EXPECT_EQ(people.find("ben")->value().revision, 1u) << "as with passwords, no edit";
  EXPECT_EQ(people.setCodeHash("nobody", "c").error().code, ErrorCode::kNotFound);
}

TEST(People, theLastAdministratorWhoCanLogInStays) {
  test::TestDb db;
  PeopleStore people(db.writer);
  ASSERT_OK(people.add({"a", pb::ADMINISTRATOR, "h", false, 1}));
  ASSERT_OK(people.add({"without password", pb::ADMINISTRATOR, "", false, 1}));
  EXPECT_EQ(people.setDisabled("a", true).error().code, ErrorCode::kDenied);
  ASSERT_OK(people.add({"b", pb::ADMINISTRATOR, "h", false, 1}));
  EXPECT_OK(people.setDisabled("a", true));
  EXPECT_OK(people.setDisabled("a", true));
  EXPECT_EQ(people.setDisabled("b", true).error().code, ErrorCode::kDenied);
}

}  // namespace
}  // namespace needlelab
