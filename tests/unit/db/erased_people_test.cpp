// Whose a session is that comes after an erasure, and who came back with an older database.
#include <fmt/core.h>
#include <gmock/gmock.h>

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "db/audit.h"
#include "db/check.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/schema.h"
#include "db/session_results.h"
#include "db/session_rows.h"
#include "db/unknown_trainees.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/erasure_fixture.h"

namespace needlelab {
namespace {

using ErasedPeopleTest = test::ErasureTest;

TEST_F(ErasedPeopleTest, whatAStationStillSendsIsAcknowledgedAndNotKept) {
  const Uuid id = session("anna", 3, false);
  ASSERT_EQ(ErasureStore(db.writer).openSessions("anna")->size(), 1u);
  ASSERT_OK(erase("anna"));
  removeChunks(id);
  SessionStore sessions(db.writer);
  // The station continues as before: new chunks, old chunks, its description, the end.
  for (const std::uint64_t seq : {3u, 4u, 1u}) {
    const auto appended = sessions.append(id, seq, test::chunkOf(seq), "station-1");
    ASSERT_OK(appended);
    EXPECT_TRUE(appended->taken()) << appended->text;
    EXPECT_GT(appended->next_seq, seq);
  }
  auto again = test::describe(id);
  again.set_trainee("anna");
  EXPECT_OK(sessions.open(again, 5));
  const auto closed = sessions.close(test::closeOf(id, 5), 6, "station-1");
  ASSERT_OK(closed);
  EXPECT_TRUE(closed->taken()) << closed->text;
  auto left = db.writer.prepare("SELECT count(*) FROM chunks");
  ASSERT_TRUE(*left.step());
  EXPECT_EQ(left.integer(0), 0);
  EXPECT_EQ(test::dump(db.writer).find("616E6E61"), std::string::npos);
  EXPECT_EQ(ScoreStore(db.writer).put(test::scoreOf(id, "[]")).error().code, ErrorCode::kUnavailable);
}

TEST_F(ErasedPeopleTest, aSessionThatComesAfterTheErasureIsStoredWithoutNameAndEmpty) {
  ASSERT_OK(erase("anna"));
  SessionStore sessions(db.writer);
  // It was recorded before the erasure, while the station was offline.
  const Uuid id = makeUuidV7();
  auto d = test::describe(id);
  d.set_trainee("anna");
  ASSERT_OK(sessions.open(d, 5));
  EXPECT_EQ(sessions.info(id)->description().trainee(), "erased-1234");
  EXPECT_EQ(sessions.info(id)->description().device(), "") << "a station may have put the name there";
  EXPECT_TRUE(sessions.append(id, 0, test::chunkOf(0))->taken());
  EXPECT_TRUE(sessions.close(test::closeOf(id, 1), 6)->taken());
  EXPECT_EQ(sessions.info(id)->chunks(), 0u);
  // A station whose clock is ahead says that it began after the erasure; the server knows better.
  const Uuid ahead = makeUuidV7();
  d.set_session_id(test::bytesOfId(ahead));
  d.set_started_unix_ns(1'900'000'000'000'000'000);
  ASSERT_OK(sessions.open(d, 5));
  EXPECT_EQ(sessions.info(ahead)->description().trainee(), "erased-1234");
  EXPECT_TRUE(sessions.append(ahead, 0, test::chunkOf(0))->taken());
  EXPECT_EQ(sessions.info(ahead)->chunks(), 0u);
  EXPECT_EQ(test::dump(db.writer).find("'anna'"), std::string::npos);
  // Somebody who gets an account of this name afterwards is a different person.
  ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1'850'000'000'000'000'000}));
  const Uuid between = makeUuidV7();
  d.set_session_id(test::bytesOfId(between));
  d.set_started_unix_ns(1'840'000'000'000'000'000);
  ASSERT_OK(sessions.open(d, 1'860'000'000'000'000'000));
  EXPECT_EQ(sessions.info(between)->description().trainee(), "anna");
  EXPECT_EQ(sessions.append(between, 0, test::chunkOf(0))->kind, Appended::Kind::kStored);
  EXPECT_TRUE(waits(between)) << "from before the account: kept, and counted for nobody";
  const Uuid later = makeUuidV7();
  d.set_session_id(test::bytesOfId(later));
  d.set_started_unix_ns(1'900'000'000'000'000'000);
  ASSERT_OK(sessions.open(d, 5));
  EXPECT_EQ(sessions.info(later)->description().trainee(), "anna");
  EXPECT_EQ(sessions.append(later, 0, test::chunkOf(0))->kind, Appended::Kind::kStored);
  EXPECT_FALSE(waits(later));
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << check->faults.front();
}

TEST_F(ErasedPeopleTest, aNewAccountKeepsItsSessionsAlthoughTheClockWasAheadAtTheErasure) {
  constexpr std::int64_t kDay = 86'400'000'000'000, kNow = 1'800'000'000'000'000'000;
  ASSERT_OK(erase("anna", kNow + 200 * kDay));
  ErasureStore erasures(db.writer);
  EXPECT_EQ(*erasures.addedAt("anna", kNow), kNow + 200 * kDay + 1)
      << "added after it, whatever the clock says";
  EXPECT_EQ(*erasures.addedAt("anna", kNow + 201 * kDay), kNow + 201 * kDay);
  EXPECT_EQ(*erasures.addedAt("ben", kNow), kNow) << "never erased";
  ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, *erasures.addedAt("anna", kNow)}));
  SessionStore sessions(db.writer);
  const auto deliver = [&](std::int64_t started, std::int64_t now) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee("anna");
    d.set_started_unix_ns(started);
    EXPECT_OK(sessions.open(d, now));
    EXPECT_EQ(sessions.append(id, 0, test::chunkOf(0))->kind, Appended::Kind::kStored);
    EXPECT_OK(sessions.open(d, now));  // the station comes again
    EXPECT_TRUE(sessions.close(test::closeOf(id, 1), now + 1)->taken());
    EXPECT_EQ(sessions.info(id)->chunks(), 1u);
    EXPECT_EQ(sessions.info(id)->description().trainee(), "anna");
    return id;
  };
  EXPECT_FALSE(waits(deliver(kNow + kDay, kNow + kDay)));
  // the clock has reached the account's time: who comes from before may be the erased person
  const Uuid late = deliver(kNow + 2 * kDay, kNow + 300 * kDay);
  EXPECT_TRUE(waits(late));
  EXPECT_FALSE(waits(deliver(kNow + 299 * kDay, kNow + 300 * kDay)));
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << check->faults.front();
  EXPECT_TRUE(erasures.toRepeat(db.folder.path())->empty()) << "nobody is told to erase the new person";
  // one that waits for another reason can be given to the new person, too
  ASSERT_OK(PeopleStore(db.writer).setCodeHash("anna", "$code"));
  const Uuid unchecked = deliver(kNow + 3 * kDay, kNow + 3 * kDay);
  ASSERT_TRUE(waits(unchecked));
  EXPECT_OK(UnknownTraineeStore(db.writer).assign(unchecked, "anna", {}, "mia", kNow + 4 * kDay));
  EXPECT_FALSE(waits(unchecked));
}

TEST_F(ErasedPeopleTest, guestsWhoComeAfterAnErasureOfGuestKeepTheirSessionsWhateverTheClocksSaid) {
  constexpr std::int64_t kDay = 86'400'000'000'000, kNow = 1'800'000'000'000'000'000;
  SessionStore sessions(db.writer);
  const auto describe = [](const Uuid& id, std::int64_t started) {
    auto d = test::describe(id);
    d.set_trainee("guest");
    d.set_started_unix_ns(started);
    return d;
  };
  for (const std::int64_t erased : {kNow, kNow + 200 * kDay}) {  // the server's clock right, and ahead
    const Uuid closed = session("guest", 2, true), still_open = session("guest", 1, false);
    ASSERT_OK(ErasureStore(db.writer).erase(
        "guest", {"erased-" + std::to_string(erased), line("guest", 0).name_hash, erased}, "ada", "",
        erased));
    for (const std::int64_t started : {kNow + kDay, kNow - kDay, kNow - 1900 * kDay}) {
      const Uuid id = makeUuidV7();
      ASSERT_OK(sessions.open(describe(id, started), kNow + kDay));
      EXPECT_EQ(sessions.append(id, 0, test::chunkOf(0))->kind, Appended::Kind::kStored);
      EXPECT_OK(sessions.open(describe(id, started), kNow + kDay));  // the station comes again
      EXPECT_TRUE(sessions.close(test::closeOf(id, 1), kNow + kDay)->taken());
      EXPECT_EQ(sessions.info(id)->chunks(), 1u) << started;
      EXPECT_EQ(sessions.info(id)->description().trainee(), "guest");
    }
    // stations offer again what was erased: it stays away
    for (const Uuid& id : {closed, still_open}) {
      ASSERT_OK(sessions.open(describe(id, kNow), kNow + kDay));
      EXPECT_TRUE(sessions.append(id, 1, test::chunkOf(1))->taken());
      removeChunks(id);
      EXPECT_EQ(sessions.info(id)->description().trainee(), "erased-" + std::to_string(erased));
    }
  }
  auto kept = db.writer.prepare(
      "SELECT count(*) FROM chunks WHERE session IN (SELECT number FROM sessions WHERE erased = 0)");
  ASSERT_TRUE(*kept.step());
  EXPECT_EQ(kept.integer(0), 3) << "the second erasure took those of between";
  EXPECT_TRUE(ErasureStore(db.writer).toRepeat(db.folder.path())->empty())
      << "nobody is told to erase new guests";
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << check->faults.front();
}

TEST_F(ErasedPeopleTest, whoComesUnderANameThatWasErasedWithoutAnAccountKeepsTheSessionsWhichWait) {
  constexpr std::int64_t kDay = 86'400'000'000'000, kNow = 1'800'000'000'000'000'000;
  SessionStore sessions(db.writer);
  const auto eraseName = [&](const std::string& pseudonym, bool without_account, std::int64_t when) {
    auto of = line("Dora", when);
    of.pseudonym = pseudonym;
    of.without_account = without_account;
    return ErasureStore(db.writer).erase("Dora", of, "ada", "", when);
  };
  const auto deliver = [&](const Uuid& id, std::int64_t started) {
    auto d = test::describe(id);
    d.set_trainee("Dora");
    d.set_started_unix_ns(started);
    EXPECT_OK(sessions.open(d, kNow + kDay));
    EXPECT_TRUE(sessions.append(id, 0, test::chunkOf(0))->taken());
    EXPECT_OK(sessions.open(d, kNow + kDay));  // the station comes again
    EXPECT_TRUE(sessions.close(test::closeOf(id, 1), kNow + kDay)->taken());
    return sessions.info(id)->description().trainee();
  };
  // the server's clock right, and ahead
  for (const auto& [pseudonym, when] :
       {std::pair{"erased-1", kNow}, std::pair{"erased-2", kNow + 200 * kDay}}) {
    const Uuid taken = session("Dora", 1, true);
    ASSERT_OK(eraseName(pseudonym, true, when));
    for (const std::int64_t started : {kNow + kDay, kNow - kDay}) {
      const Uuid id = makeUuidV7();
      EXPECT_EQ(deliver(id, started), "Dora");
      EXPECT_EQ(sessions.info(id)->chunks(), 1u) << started;
      EXPECT_TRUE(waits(id));
    }
    auto again = test::describe(taken);
    again.set_trainee("Dora");
    ASSERT_OK(sessions.open(again, kNow + kDay));
    EXPECT_EQ(sessions.info(taken)->description().trainee(), pseudonym) << "offered again, it stays away";
    EXPECT_TRUE(ErasureStore(db.writer).toRepeat(db.folder.path())->empty());
  }
  // of an erasure that took an account, what comes late may be that account's
  ASSERT_OK(eraseName("erased-3", false, kNow + 201 * kDay));
  EXPECT_EQ(deliver(makeUuidV7(), kNow), "erased-3");
  ASSERT_OK(PeopleStore(db.writer).add({"Dora", pb::TRAINEE, "", false, kNow + 202 * kDay}));
  EXPECT_EQ(eraseName("erased-6", true, kNow + 203 * kDay).error().code, ErrorCode::kNotFound)
      << "the line says that nobody had the name: it takes no account";
  ASSERT_OK(eraseName("erased-4", false, kNow + 203 * kDay));
  session("ben", 1, true);
  ASSERT_OK(db.writer.run("UPDATE sessions SET trainee = 'Dora' WHERE trainee = 'ben'"));
  ASSERT_OK(eraseName("erased-5", true, kNow + 204 * kDay));
  EXPECT_EQ(deliver(makeUuidV7(), kNow), "erased-4") << "the account's, also after an erasure of what waited";
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << check->faults.front();
}

// A list that is put into place late, or a start after an erasure that was killed: others had the names
// since.
TEST_F(ErasedPeopleTest, aListThatComesLaterTakesNothingThatIsNewerThanItsLines) {
  constexpr std::int64_t kMinute = 60'000'000'000, kNow = 1'800'000'000'000'000'000;
  SessionStore sessions(db.writer);
  const auto deliver = [&](const std::string& name, std::int64_t now) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee(name);
    d.set_started_unix_ns(now);
    EXPECT_OK(sessions.open(d, now));
    EXPECT_TRUE(sessions.append(id, 0, test::chunkOf(0))->taken());
    EXPECT_TRUE(sessions.close(test::closeOf(id, 1), now + 1)->taken());
    return id;
  };
  const auto add = [&](const std::string& name, std::int64_t now) {
    ASSERT_OK(PeopleStore(db.writer).add({name, pb::TRAINEE, "", false, now}));
  };
  std::vector<ErasureLine> list;
  const auto listed = [&](const std::string& name, bool without_account) {
    ErasureLine one = line(name, kNow);
    one.pseudonym = "erased-00000000000" + std::to_string(list.size());
    one.without_account = without_account;
    list.push_back(sealed(std::move(one), *PseudonymKey::ofFolder(db.folder.path())));
  };
  const Uuid monas = deliver("Mona", kNow - kMinute), another_monas = deliver("Mona", kNow + kMinute);
  const Uuid first_eves = deliver("eve", kNow - kMinute);
  add("eve", kNow + kMinute);
  const Uuid eves = deliver("eve", kNow + 2 * kMinute);
  add("zoe", kNow - 2 * kMinute);
  const Uuid zoes = deliver("zoe", kNow - kMinute);
  add("tom", kNow + kMinute);
  const Uuid toms = deliver("tom", kNow + 2 * kMinute);
  add("una", kNow);
  const Uuid unas = deliver("una", kNow + kMinute);
  for (const char* name : {"Mona", "eve", "zoe"}) listed(name, true);
  for (const char* name : {"tom", "una"}) listed(name, false);
  ASSERT_OK(writeErasures(db.folder.path(), list));
  ErasureStore erasures(db.writer);
  const auto repeat = erasures.toRepeat(db.folder.path());
  ASSERT_OK(repeat);
  std::set<std::string> names;
  for (const ErasureToRepeat& one : *repeat) {
    names.insert(one.name);
    EXPECT_EQ(erasures.erase(one.name, one.line, "server", "", kNow + 3 * kMinute)->sessions(), 1u)
        << one.name;
  }
  EXPECT_EQ(names, (std::set<std::string>{"Mona", "eve", "una"}));
  EXPECT_EQ(erasures.erase("zoe", list[2], "server", "", kNow).error().code, ErrorCode::kNotFound);
  ASSERT_OK(erasures.rememberList(db.folder.path(), {}, kNow + 3 * kMinute));
  EXPECT_TRUE(erasures.toRepeat(db.folder.path())->empty());

  const auto ownerOf = [&](const Uuid& id) { return sessions.info(id)->description().trainee(); };
  EXPECT_EQ(ownerOf(monas), list[0].pseudonym);
  EXPECT_EQ(ownerOf(first_eves), list[1].pseudonym) << "it waited: nobody had the name when it came";
  EXPECT_EQ(ownerOf(unas), list[4].pseudonym) << "the account's, whenever it came";
  for (const auto& [id, name] : {std::pair{another_monas, "Mona"}, std::pair{eves, "eve"},
                                 std::pair{zoes, "zoe"}, std::pair{toms, "tom"}}) {
    EXPECT_EQ(ownerOf(id), name);
    EXPECT_EQ(sessions.info(id)->chunks(), 1u) << name;
  }
  EXPECT_TRUE(waits(another_monas));
  for (const char* name : {"eve", "zoe", "tom"})
    EXPECT_TRUE(PeopleStore(db.writer).find(name)->has_value()) << name;
  EXPECT_FALSE(PeopleStore(db.writer).find("una")->has_value());
  // a clock may have been wrong: somebody must look
  const auto told = db.writer.prepare("SELECT subject || ': ' || detail FROM audit").all(firstText);
  ASSERT_OK(told);
  ASSERT_EQ(told->size(), 1u);
  EXPECT_THAT(told->front(), testing::StartsWith("tom: not repeated: who had this name was erased on "));
}

TEST_F(ErasedPeopleTest, anErasureIsNeverOlderThanWhatItTakes) {
  constexpr std::int64_t kDay = 86'400'000'000'000, kNow = 1'800'000'000'000'000'000;
  ErasureStore erasures(db.writer);
  EXPECT_EQ(*erasures.erasedAt("anna", kNow), kNow);
  // the clock was ahead when the account was added, when a session came, when one came that is ben's by now
  ASSERT_OK(PeopleStore(db.writer).add({"eve", pb::TRAINEE, "", false, kNow + kDay}));
  EXPECT_EQ(*erasures.erasedAt("eve", kNow), kNow + kDay);
  for (const char* name : {"Mona", "Lisa"}) {
    const Uuid id = session(name, 1, true);
    ASSERT_OK(db.writer.run("UPDATE sessions SET received_unix_ns = ? WHERE id = ?", kNow + 2 * kDay,
                            ByteView(id)));
    EXPECT_EQ(*erasures.erasedAt(name, kNow), kNow + 2 * kDay);
    ASSERT_OK(UnknownTraineeStore(db.writer).assign(id, "ben", {}, "mia", kNow));
    EXPECT_EQ(*erasures.erasedAt(name, kNow), kNow + 2 * kDay);
  }
  EXPECT_EQ(*erasures.erasedAt("nobody", kNow), kNow);
}

TEST_F(ErasedPeopleTest, nobodyGetsAnErasedPersonsPseudonym) {
  for (const char* name : {"erased-feff9409daf7", "Erased-FEFF9409DAF7"}) {
    const auto refused = PeopleStore(db.writer).add({name, pb::TRAINEE, "", false, 1});
    ASSERT_FALSE(refused.ok()) << name;
    EXPECT_EQ(refused.error().message,
              "name: '" + std::string(name) +
                  "' has the form of the names that erased people have: take another one");
    auto d = test::describe(makeUuidV7());
    d.set_trainee(name);
    const auto given = SessionStore(db.writer).open(d, 1);
    ASSERT_FALSE(given.ok()) << name;
    EXPECT_EQ(given.error().code, ErrorCode::kInvalidInput);
  }
  for (const char* name : {"erased", "erased-", "erased-feff9409daf", "erased-feff9409daf71",
                           "erased-feff9409dafg", "unerased-feff9409daf7"})
    EXPECT_OK(PeopleStore(db.writer).add({name, pb::TRAINEE, "", false, 1}));
}

TEST_F(ErasedPeopleTest, aDatabaseFromBeforeSaysWhoMustBeErasedAgain) {
  const auto made = sealed(line("anna", 77), *PseudonymKey::ofFolder(db.folder.path()));
  ASSERT_OK(writeErasures(db.folder.path(), {made}));
  const auto lines = readErasures(db.folder.path());
  ASSERT_OK(lines);
  ASSERT_EQ(lines->size(), 1u);
  EXPECT_EQ((*lines)[0].name_hash, made.name_hash);
  EXPECT_EQ((*lines)[0].unix_ns, 77);
  // The file has the erasure but the database does not, as after a restore.
  const auto repeat = ErasureStore(db.writer).toRepeat(db.folder.path());
  ASSERT_OK(repeat);
  ASSERT_EQ(repeat->size(), 1u);
  EXPECT_EQ((*repeat)[0].name, "anna");
  EXPECT_TRUE((*repeat)[0].restored);
  EXPECT_NE(erasureToRepeatText((*repeat)[0]).find("person erase 'anna'"), std::string::npos);
  ASSERT_OK(erase("anna"));
  EXPECT_TRUE(ErasureStore(db.writer).toRepeat(db.folder.path())->empty());
  ASSERT_OK(writeFileAtomically(db.folder.path() / "erasures", viewOf("nonsense\n")));
  EXPECT_EQ(ErasureStore(db.writer).toRepeat(db.folder.path()).error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace needlelab
