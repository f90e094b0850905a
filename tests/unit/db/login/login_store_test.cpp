// What several servers know about each other's log-ins, on both engines.
#include "db/login/login_store.h"

#include <gmock/gmock.h>

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/base/time/clock.h"
#include "db/login/access_numbers.h"
#include "db/login/shared_logins.h"
#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "needlelab/types.pb.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using std::chrono::hours;
using std::chrono::minutes;
using test::TestDb;
using Kind = LoginRow::Kind;

constexpr std::int64_t kS = 1'000'000'000;
constexpr std::int64_t kNow = 1'000'000 * kS;

LoginKey keyOf(std::uint8_t byte) {
  PseudonymKey::Hash hash{};
  hash.fill(byte);
  return LoginKey(PseudonymKey(hash));
}

class LoginStoreTest : public testing::Test {
 protected:
  LoginStoreTest() {
    for (const char* name : {"anna", "bert"})
      EXPECT_OK(PeopleStore(db.writer).add({name, pb::INSTRUCTOR, "hash", false, 7}));
  }
  std::string refOf(const std::string& name) {
    return TestDb::must(findPerson(db.writer, name)).value_or(name);
  }
  TokenRow rowOf(const std::string& name, std::int64_t number = 0) {
    return {refOf(name), pb::INSTRUCTOR, number, kNow, kNow + 60 * kS};
  }
  std::string issue(const std::string& name, std::int64_t number = 0) {
    std::string token = key.makeToken();
    EXPECT_TRUE(TestDb::must(store.addToken(token, rowOf(name, number), 512)));
    return token;
  }
  bool isValid(const std::string& token) {
    const bool found = TestDb::must(store.token(token, kNow)).has_value();
    EXPECT_EQ(TestDb::must(store.isTokenValid(token)), found);
    return found;
  }
  std::int64_t count(const std::string& table) {
    auto row = db.writer.prepare("SELECT count(*) FROM " + table);
    EXPECT_TRUE(*row.step());
    return row.integer(0);
  }
  /// Like SharedLogins.
  Status beside(const std::function<Status()>& work) {
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(db.writer, Transaction::Kind::kSide));
    RETURN_IF_ERROR(work());
    return transaction.commit();
  }
  Status tidy(std::int64_t now_ns, const LoginStore::Bounds& bounds) {
    return beside([&] { return store.tidy(now_ns, bounds); });
  }
  std::int64_t number(const std::string& name, AccessKind what = AccessKind::kPerson) {
    return TestDb::must(
        AccessNumberStore(db.writer).of(what, what == AccessKind::kPerson ? refOf(name) : name));
  }

  TestDb db;
  const LoginKey key = keyOf(1);
  LoginStore store{db.writer, key};
};

TEST(LoginKey, onlyTheLabsServersCanReadTokens) {
  const LoginKey key = keyOf(1), same = keyOf(1), other = keyOf(2);
  const std::string token = key.makeToken();
  EXPECT_EQ(token.size(), 32u);
  EXPECT_NE(token, key.makeToken());
  EXPECT_TRUE(same.madeToken(token));
  EXPECT_FALSE(other.madeToken(token));
  EXPECT_FALSE(key.madeToken(""));
  EXPECT_FALSE(key.madeToken(token.substr(0, 31)));
  for (const std::size_t at : {0u, 15u, 16u, 31u}) {
    std::string changed = token;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    EXPECT_FALSE(key.madeToken(changed)) << at;
  }
  EXPECT_NE(key.of("a", "b"), key.of("b", "b"));
  EXPECT_NE(key.of("a", "b"), other.of("a", "b"));
}

TEST_F(LoginStoreTest, aTokenIsValidUntilItsEndAndStoredHashed) {
  const std::string token = issue("anna");
  const auto found = TestDb::must(store.token(token, kNow + 60 * kS - 1));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->name, refOf("anna"));
  EXPECT_EQ(found->called, "anna");
  EXPECT_EQ(found->role, pb::INSTRUCTOR);
  EXPECT_EQ(found->expires_ns, kNow + 60 * kS);
  EXPECT_FALSE(TestDb::must(store.token(token, kNow + 60 * kS)));
  EXPECT_FALSE(isValid(key.makeToken()));

  auto row = db.writer.prepare("SELECT hash FROM login_tokens");
  ASSERT_TRUE(*row.step());
  const auto hash = LoginKey::hashOfToken(token);
  EXPECT_EQ(std::string(textOf(row.bytes(0))), std::string(textOf(ByteView(hash))));
}

TEST_F(LoginStoreTest, aTokenIsLengthenedUpToTheLongestTimeSinceThePassword) {
  const std::string token = issue("anna");
  const auto renewed = [&](std::int64_t now_ns) {
    return TestDb::must(store.renewToken(token, now_ns, minutes(1), minutes(2)));
  };
  EXPECT_EQ(renewed(kNow + 30 * kS), kNow + 90 * kS);
  EXPECT_EQ(renewed(kNow + 80 * kS), kNow + 120 * kS);
  EXPECT_EQ(renewed(kNow + 119 * kS), kNow + 120 * kS);
  EXPECT_FALSE(renewed(kNow + 120 * kS)) << "it is over";
}

TEST_F(LoginStoreTest, eachAccessChangeEndsTheTokensInItsTransaction) {
  PeopleStore people(db.writer);
  const std::map<std::string, std::function<Status()>> changes = {
      {"password", [&] { return people.setPasswordHash("anna", "another"); }},
      {"role",
       [&] { return TestDb::must(people.change("anna", {}, {.role = pb::RESEARCHER}, "ada", 9)), Status(); }},
      {"disabled", [&] { return people.setDisabled("anna", true, "ada", 9); }},
      {"erased", [&] {
         return db.writer.run("UPDATE people SET erased_unix_ns = 9, disabled = 1 WHERE ref = ?",
                              refOf("anna"));
       }}};
  for (const auto& [how, change] : changes) {
    SCOPED_TRACE(how);
    const std::string anna = issue("anna", number("anna")), bert = issue("bert");
    {
      const auto undone = Transaction::begin(db.writer, Transaction::Kind::kWrite);
      ASSERT_OK(undone);
      ASSERT_OK(change());
      EXPECT_FALSE(isValid(anna));
    }
    EXPECT_TRUE(isValid(anna)) << "a rollback has ended nothing";
    const std::int64_t last = TestDb::must(AccessNumberStore(db.writer).last());
    ASSERT_OK(change());
    EXPECT_FALSE(isValid(anna));
    EXPECT_TRUE(isValid(bert)) << "others keep theirs";
    const auto told = TestDb::must(AccessNumberStore(db.writer).after(last, 10));
    ASSERT_EQ(told.size(), 1u);
    EXPECT_EQ(told[0].how, how);
    EXPECT_EQ(told[0].number, last + 1);
    const bool is_erased = how == "erased";
    EXPECT_EQ(told[0].what, is_erased ? AccessKind::kErased : AccessKind::kPerson);
    EXPECT_EQ(told[0].name, is_erased ? "" : refOf("anna"));
    // restored for the next change
    if (is_erased) {
      ASSERT_OK(db.writer.run("UPDATE people SET erased_unix_ns = NULL, disabled = 0"));
    } else {
      ASSERT_OK(people.setDisabled("anna", false, "ada", 9));
      ASSERT_OK(people.change("anna", {}, {.role = pb::INSTRUCTOR}, "ada", 9));
    }
  }
}

TEST_F(LoginStoreTest, whatIsNoChangeOfAccessHasNoNumber) {
  const std::string token = issue("anna");
  PeopleStore people(db.writer);
  ASSERT_OK(people.change("anna", {}, {.full_name = "Anna Bee"}, "ada", 9));
  ASSERT_OK(people.setCodeHash("anna", "code"));
  ASSERT_OK(people.setPasswordHash("anna", "hash"));
  ASSERT_OK(people.setDisabled("anna", false, "ada", 9));
  ASSERT_OK(people.add({"carl", pb::TRAINEE, "", false, 1}));
  EXPECT_EQ(TestDb::must(AccessNumberStore(db.writer).last()), 0);
  EXPECT_TRUE(isValid(token));
}

TEST_F(LoginStoreTest, aStationsKeyHasItsOwnVersions) {
  StationStore stations(db.writer);
  ASSERT_OK(PeopleStore(db.writer).add({"station-1", pb::INSTRUCTOR, "hash", false, 7}));
  ASSERT_OK(stations.revoke("station-1"));
  EXPECT_EQ(number("station-1", AccessKind::kStation), 1);
  StationKeyBytes other{};
  other.fill(9);
  ASSERT_OK(stations.add("station-1", other, 3));
  const auto told = TestDb::must(AccessNumberStore(db.writer).after(0, 10));
  ASSERT_EQ(told.size(), 1u) << "of an account there is the last change only";
  EXPECT_EQ(told[0].number, 2);
  EXPECT_EQ(told[0].how, "key");
  EXPECT_EQ(number("station-1"), 0) << "a person of that name is another one";
}

TEST_F(LoginStoreTest, numbersAreOfManyAtOnceAndComeInPieces) {
  PeopleStore people(db.writer);
  for (int i = 0; i < 5; ++i) {
    ASSERT_OK(people.add({"p" + std::to_string(i), pb::INSTRUCTOR, "", false, 1}));
    ASSERT_OK(people.setPasswordHash("p" + std::to_string(i), "hash"));
  }
  AccessNumberStore numbers(db.writer);
  const std::vector<std::string> names{refOf("p0"), refOf("p4"), "nobody"};
  EXPECT_EQ(TestDb::must(numbers.numbersOf(AccessKind::kPerson, names)),
            (std::map<std::string, std::int64_t>{{names[0], 1}, {names[1], 5}}));
  EXPECT_EQ(TestDb::must(numbers.numbersOf(AccessKind::kStation, names)).size(), 0u);
  const auto some = TestDb::must(numbers.after(1, 2));
  ASSERT_EQ(some.size(), 2u);
  EXPECT_EQ(some[0].name + some[1].name, refOf("p1") + refOf("p2"));
}

// Two servers: one checks the password while the other changes it.
TEST_F(LoginStoreTest, aTokenOfAChangedAccountIsRefused) {
  const auto refused = [&](const TokenRow& row) {
    return !TestDb::must(store.addToken(key.makeToken(), row, 512));
  };
  EXPECT_FALSE(refused(rowOf("anna")));
  ASSERT_OK(PeopleStore(db.writer).setPasswordHash("anna", "another"));
  EXPECT_TRUE(refused(rowOf("anna"))) << "with the earlier number";
  EXPECT_FALSE(refused(rowOf("anna", 1)));
  TokenRow other = rowOf("anna", 1);
  other.role = pb::ADMINISTRATOR;
  EXPECT_TRUE(refused(other));
  EXPECT_TRUE(refused(rowOf("nobody")));

  // a row inserted between a change and its trigger's DELETE, as with two concurrent transactions
  const std::string token = issue("anna", 1);
  ASSERT_TRUE(isValid(token));
  ASSERT_OK(db.writer.run("UPDATE login_tokens SET access_number = 0"));
  EXPECT_FALSE(isValid(token));
}

TEST_F(LoginStoreTest, aLogOutEndsOneTokenAndReachesOtherServers) {
  const std::string one = issue("anna"), other = issue("anna");
  ASSERT_OK(store.endToken(one, "server-a"));
  EXPECT_FALSE(isValid(one));
  EXPECT_TRUE(isValid(other));
  const auto told = TestDb::must(AccessNumberStore(db.writer).after(0, 10));
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0].what, AccessKind::kLogOut);
  EXPECT_EQ(told[0].name, refOf("anna"));
  EXPECT_EQ(told[0].server, "server-a");
  EXPECT_EQ(number("anna"), 0) << "the account is as it was";
  ASSERT_OK(store.endToken(one, "server-a"));
  EXPECT_EQ(TestDb::must(AccessNumberStore(db.writer).last()), 1) << "it had ended already";
}

TEST_F(LoginStoreTest, tokensHaveBounds) {
  std::vector<std::string> tokens;
  for (int i = 0; i < 4; ++i) {
    tokens.push_back(key.makeToken());
    TokenRow row = rowOf("anna");
    row.expires_ns += i;
    ASSERT_TRUE(TestDb::must(store.addToken(tokens.back(), row, 3)));
  }
  EXPECT_FALSE(isValid(tokens[0])) << "the one that ends first gave way";
  EXPECT_TRUE(isValid(tokens[1]));
  const std::string bert = issue("bert");
  LoginStore::Bounds bounds;
  bounds.tokens = 2;
  ASSERT_OK(tidy(kNow, bounds));
  EXPECT_EQ(count("login_tokens"), 2);
  EXPECT_TRUE(isValid(tokens[3]));
  ASSERT_OK(tidy(kNow + 60 * kS + 2, bounds));
  EXPECT_EQ(count("login_tokens"), 1) << "those that are over are gone";
}

TEST_F(LoginStoreTest, attemptsAreOfTheirKindNameAndAddressAndHaveBounds) {
  ASSERT_OK(store.putAttempt(Kind::kPair, "anna", "here", LoginRow{3, kNow, 5}));
  ASSERT_OK(store.putAttempt(Kind::kName, "anna", "", LoginRow{1.5, kNow, 0}));
  ASSERT_OK(store.putAttempt(Kind::kAddress, "", "here", LoginRow{2, kNow - 1, 0}));
  ASSERT_OK(store.putAttempt(Kind::kKnownAddress, "", "here", LoginRow{0, kNow - 2, 0}));
  ASSERT_OK(store.putAttempt(Kind::kCode, "anna", "", LoginRow{4, kNow, 0}));
  EXPECT_EQ(TestDb::must(store.attempts("anna", "here")),
            (std::map<Kind, LoginRow>{{Kind::kPair, {3, kNow, 5}},
                                      {Kind::kName, {1.5, kNow, 0}},
                                      {Kind::kAddress, {2, kNow - 1, 0}},
                                      {Kind::kKnownAddress, {0, kNow - 2, 0}}}));
  EXPECT_EQ(TestDb::must(store.attempts("bert", "there")).size(), 0u);
  EXPECT_EQ(TestDb::must(store.attempts("anna", "there")).size(), 1u) << "the name, at any address";
  EXPECT_EQ(TestDb::must(store.attempt(Kind::kCode, "anna", "anywhere")), (LoginRow{4, kNow, 0}));
  ASSERT_OK(store.putAttempt(Kind::kPair, "anna", "here", std::nullopt));
  EXPECT_FALSE(TestDb::must(store.attempt(Kind::kPair, "anna", "here")));

  for (int i = 0; i < 10; ++i)
    ASSERT_OK(store.putAttempt(Kind::kName, "n" + std::to_string(i), "", LoginRow{1, kNow + i, 0}));
  LoginStore::Bounds bounds;
  bounds.attempts = 3;
  ASSERT_OK(tidy(kNow + 10, bounds));
  EXPECT_TRUE(TestDb::must(store.attempt(Kind::kName, "n9", "")));
  EXPECT_FALSE(TestDb::must(store.attempt(Kind::kName, "n6", ""))) << "idle for longest";
  EXPECT_TRUE(TestDb::must(store.attempt(Kind::kAddress, "", "here"))) << "of another kind";
  // an hour after the last failure, a day for codes, a month for addresses
  const auto left = [&](std::int64_t later_ns) {
    EXPECT_OK(tidy(kNow + later_ns, {}));
    return count("login_attempts");
  };
  EXPECT_EQ(left(3600 * kS - 10), 6);
  EXPECT_EQ(left(3600 * kS + 10), 2);
  EXPECT_EQ(left(24 * 3600 * kS + 10), 1);
  EXPECT_EQ(left(30 * 24 * 3600 * kS + 10), 0);
}

TEST_F(LoginStoreTest, neitherNamesThatWereTypedNorAddressesCanBeRead) {
  ASSERT_OK(store.putAttempt(Kind::kPair, "person secret7431", "10.1.2.3", LoginRow{1, kNow, 0}));
  ASSERT_OK(store.putAttempt(Kind::kName, "person secret7431", "", LoginRow{1, kNow, 0}));
  EXPECT_TRUE(TestDb::must(store.noteRead("anna\nsession export\nsecret7431", hours(1))));
  for (const char* table : {"login_attempts", "noted_reads"}) {
    auto rows = db.writer.prepare(std::string("SELECT key FROM ") + table);
    while (TestDb::must(rows.step())) {
      const std::string bytes(textOf(rows.bytes(0)));
      EXPECT_EQ(bytes.size(), 32u);
      EXPECT_EQ(bytes.find("secret7431"), std::string::npos);
      EXPECT_EQ(bytes.find("10.1.2.3"), std::string::npos);
    }
  }
  // without the lab's key it is impossible to test names against them
  const LoginKey other = keyOf(2);
  EXPECT_EQ(TestDb::must(LoginStore(db.writer, other).attempts("person secret7431", "10.1.2.3")).size(), 0u);
}

TEST_F(LoginStoreTest, anErasedPersonIsForgotten) {
  ASSERT_OK(store.putAttempt(Kind::kPair, "person anna", "a", LoginRow{1, kNow, 0}));
  ASSERT_OK(store.putAttempt(Kind::kKnown, "person anna", "b", LoginRow{0, kNow, 0}));
  ASSERT_OK(store.putAttempt(Kind::kCode, "anna", "", LoginRow{1, kNow, 0}));
  ASSERT_OK(store.putAttempt(Kind::kPair, "person bert", "a", LoginRow{1, kNow, 0}));
  ASSERT_OK(store.putAttempt(Kind::kAddress, "", "a", LoginRow{1, kNow, 0}));
  const std::vector<std::string> names{"person anna", "anna"};
  ASSERT_OK(beside([&] { return store.forgetNames(names); }));
  EXPECT_EQ(count("login_attempts"), 2);
  EXPECT_TRUE(TestDb::must(store.attempt(Kind::kPair, "person bert", "a")));

  (void)issue("anna");
  ASSERT_OK(PeopleStore(db.writer).setPasswordHash("anna", "another"));
  ASSERT_OK(db.writer.run("UPDATE people SET erased_unix_ns = 9 WHERE ref = ?", refOf("anna")));
  for (const char* table : {"login_tokens", "access_numbers"}) {
    auto row =
        db.writer.query(std::string("SELECT count(*) FROM ") + table + " WHERE name = ?", refOf("anna"));
    ASSERT_TRUE(*row.step());
    EXPECT_EQ(row.integer(0), 0) << table;
  }
}

TEST_F(LoginStoreTest, aReadIsNotedOnceWithinTheTimeWhicheverServerNotesIt) {
  EXPECT_TRUE(TestDb::must(store.noteRead("a", hours(1))));
  EXPECT_FALSE(TestDb::must(store.noteRead("a", hours(1))));
  EXPECT_TRUE(TestDb::must(store.noteRead("b", hours(1))));
  ASSERT_OK(db.writer.run("UPDATE noted_reads SET at_ns = at_ns - ?", 3601 * kS));
  EXPECT_TRUE(TestDb::must(store.noteRead("a", hours(1))));
  EXPECT_EQ(count("noted_reads"), 1) << "those that are over are gone";
  // a clock that was set back, e.g. a promoted standby's
  ASSERT_OK(db.writer.run("UPDATE noted_reads SET at_ns = at_ns + ?", 7200 * kS));
  EXPECT_TRUE(TestDb::must(store.noteRead("a", hours(1))));
}

TEST_F(LoginStoreTest, theDatabasesClockIsTheReference) {
  const std::int64_t now_ns = TestDb::must(store.nowNs());
  EXPECT_LT(std::abs(now_ns - wallNowNs()), 3600 * kS) << "the same machine, so about the same time";
}

TEST_F(LoginStoreTest, whatAServerAloneFindsIsRemoved) {
  (void)issue("anna");
  ASSERT_OK(store.putAttempt(Kind::kName, "anna", "", LoginRow{1, kNow, 0}));
  ASSERT_OK(removeSharedLogins(db.writer));
  EXPECT_EQ(count("login_tokens") + count("login_attempts"), 0);
  ASSERT_OK(removeSharedLogins(db.writer));
}

TEST_F(LoginStoreTest, eachServerHasTheSameKey) {
  ASSERT_OK(claimLoginKey(db.writer, key));
  ASSERT_OK(claimLoginKey(db.writer, key));
  const Status refused = claimLoginKey(db.writer, keyOf(2));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("Copy pseudonym.key from another server's folder"));
}

TEST_F(LoginStoreTest, workThatFailsLeavesNothingAndTheClockIsTheGivenOne) {
  test::FakeTime clock(kNow);
  SharedLogins shared(db.address, key, "server-a", &clock);
  const auto failed = shared.run<bool>([](LoginStore& on, std::int64_t now_ns) -> Result<bool> {
    EXPECT_EQ(now_ns, kNow);
    RETURN_IF_ERROR(on.putAttempt(Kind::kName, "anna", "", LoginRow{1, now_ns, 0}));
    return Error{ErrorCode::kFailed, "on purpose"};
  });
  EXPECT_FALSE(failed.ok());
  EXPECT_EQ(count("login_attempts"), 0);
  ASSERT_OK(shared.run<bool>([](LoginStore& on, std::int64_t now_ns) -> Result<bool> {
    RETURN_IF_ERROR(on.lockAttempts());
    RETURN_IF_ERROR(on.putAttempt(Kind::kName, "anna", "", LoginRow{1, now_ns, 0}));
    return true;
  }));
  EXPECT_EQ(count("login_attempts"), 1);
}

}  // namespace
}  // namespace needlelab
