// An erasure that others commit between, that is killed on its way, that the writer refuses, or for which a
// start has no memory.
#include <fmt/core.h>
#include <gmock/gmock.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/base/clock.h"
#include "db/audit.h"
#include "db/backup.h"
#include "db/erasure.h"
#include "db/erasure_list.h"
#include "db/pseudonyms.h"
#include "db/service/erasures.h"
#include "db/text_pages.h"
#include "tests/unit/db/service/records_fixture.h"

namespace needlelab {
namespace {

class ErasingInSteps : public test::RecordsTest {
 protected:
  void SetUp() override {
    addStation();
    addPerson("ada", pb::ADMINISTRATOR);
    addNamed("anna", "Anna Qvarnstrom");
    addNamed("ben", "");
    closedSession("anna", 1'700'000'000'000'000'000, "Qvarnstrom slipped");
    of_ben = closedSession("ben", 1'700'000'000'000'000'001, "");
  }
  std::string everything() {
    std::string all;
    EXPECT_OK(change([&](Connection& c) -> Status {
      all = test::dump(c);
      return {};
    }));
    return all;
  }
  void addRemarks(std::uint64_t count) {
    ASSERT_OK(change([&](Connection& c) {
      return c.run(
          "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ?2)"
          " INSERT INTO annotations (session, tick, author, text, created_unix_ns)"
          " SELECT s.number, 1, 'ina', 'as anna does', 1 FROM sessions s, n WHERE s.id = ?1",
          ByteView(of_ben), count);
    }));
  }
  std::uint64_t remarksWith(const std::string& text) {
    std::uint64_t count = 0;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.query("SELECT count(*) FROM annotations WHERE text = ?", text);
      RETURN_IF_ERROR(row.step());
      count = row.natural(0);
      return {};
    }));
    return count;
  }
  /// Of all recordings.
  std::uint64_t chunkRows() {
    std::uint64_t count = 0;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.query("SELECT count(*) FROM chunks");
      RETURN_IF_ERROR(row.step());
      count = row.natural(0);
      return {};
    }));
    return count;
  }
  /// Gives anna `count` further sessions, and pieces of one chunk to what removes chunks.
  void addSessionsInSmallPieces(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) closedSession("anna", 1'700'000'000'000'000'002, "");
    RetentionPace pace;
    pace.rows = 1;
    pace.pause = std::chrono::milliseconds(0);
    store->service().setRetentionPace(pace);
  }
  /// Gives anna kLongSessions sessions, each of which fills a page.
  void addLongSessions() {
    for (std::uint64_t i = 1; i < kLongSessions; ++i) closedSession("anna", 1'700'000'000'000'000'002, "");
    ASSERT_OK(change([](Connection& c) {
      return c.run("UPDATE sessions SET profile_json = printf('%.*c', ?, '.') WHERE trainee = 'anna'",
                   static_cast<std::uint64_t>(kBytesOfPage));
    }));
  }
  std::uint64_t sessionsOf(const std::string& name) {
    std::uint64_t count = 0;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.query("SELECT count(*) FROM sessions WHERE trainee = ?", name);
      RETURN_IF_ERROR(row.step());
      count = row.natural(0);
      return {};
    }));
    return count;
  }
  /// As a request to erase does first.
  ErasureLine putOnList() {
    const auto key = PseudonymKey::ofFolder(data);
    EXPECT_OK(key);
    const ErasureLine line = sealed({newErasurePseudonym(), key->nameHash("anna"), wallNowNs(), false}, *key);
    EXPECT_OK(writeErasures(data, {line}));
    return line;
  }
  static constexpr std::uint64_t kLongSessions = 3;
  const std::filesystem::path data = folder.path() / "data";
  Uuid of_ben{};
};

TEST_F(ErasingInSteps, othersCommitAfterEachPageOfNames) {
  constexpr std::uint64_t kPages = 6;
  addRemarks(kPages * kRowsOfPage);
  const auto before = store->writer().counters();
  const auto erasure = get(admin, erase("anna")).erasure();
  const auto after = store->writer().counters();
  EXPECT_GE(after.commits - before.commits, kPages + 1);
  EXPECT_EQ(remarksWith("as " + erasure.pseudonym() + " does"), kPages * kRowsOfPage);
  EXPECT_THAT(erasure.text(),
              testing::HasSubstr(fmt::format("{} remarks in sessions of others", kPages * kRowsOfPage)));
  for (const char* name : {"'anna'", "Qvarnstrom", "as anna", "616E6E61"})
    EXPECT_EQ(everything().find(name), std::string::npos) << name;
}

TEST_F(ErasingInSteps, whatWasKilledBetweenTwoPagesTheNextStartRepeatsUnderTheSamePseudonym) {
  // one line only says an earlier full name: it must say it to the next start, too
  ASSERT_OK(change([](Connection& c) -> Status {
    RETURN_IF_ERROR(AuditStore(c).add(
        {0, 1, "mia", "user change", "anna", "full name: 'Anna Altmann' to 'Anna Qvarnstrom'"}));
    return AuditStore(c).add({0, 1, "ina", "consent", "anna", "given"});
  }));
  const Uuid of_anna = closedSession("anna", 1'700'000'000'000'000'002, "");
  constexpr std::uint64_t kRemarks = 2 * kRowsOfPage + 5;
  addRemarks(kRemarks);
  ASSERT_OK(change([&](Connection& c) -> Status {
    RETURN_IF_ERROR(
        c.run("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ?)"
              " INSERT INTO audit (unix_ns, who, action, subject, detail)"
              " SELECT 1, 'ina', 'consent', 'ben', 'given' FROM n",
              static_cast<std::uint64_t>(kRowsOfPage)));
    RETURN_IF_ERROR(AuditStore(c).add({0, 1, "ina", "consent", "anna", "Altmann agrees"}));
    const auto added = AnnotationStore(c).add({0, of_anna, 1, "Altmann holds still", "ina", 1});
    return added ? Status() : Status(added.error());
  }));
  const ErasureLine line = putOnList();
  std::size_t pages = 0;
  for (std::size_t done = 1; pages == 0 || done < pages; ++done) {
    SCOPED_TRACE(done);
    const test::TempFolder killed;
    {
      auto reader = store->readers().borrow();
      ASSERT_OK(reader);
      auto found = ErasureStore(**reader).lookForNames("anna", line, false);
      ASSERT_OK(found);
      if (pages == 0) {
        ASSERT_EQ(found->pages.size(), 3u + 2u);
        pages = found->pages.size();
      }
      // the pages of the rounds before have no names any more
      const FoundNames::Page page = found->pages.front();
      ASSERT_OK(change([&](Connection& c) { return ErasureStore(c).replaceNames(*found, page); }));
      const auto copy = killed.path() / "data";
      std::filesystem::create_directory(copy);
      ASSERT_OK(backupTo(**reader, copy / "needlelab.db"));
      for (const char* file : {"pseudonym.key", "audit.key", kErasuresFile})
        std::filesystem::copy_file(data / file, copy / file);
    }
    const auto next = test::openStore(killed.path() / "data");
    EXPECT_EQ(next->erasuresRepeated(), 1u);
    std::string all;
    ASSERT_OK(next->writer().run([&](Connection& c) -> Status {
      all = test::dump(c);
      return {};
    }));
    for (const char* name : {"'anna'", "Qvarnstrom", "Altmann", "as anna", "616E6E61"})
      EXPECT_EQ(all.find(name), std::string::npos) << name;
    std::size_t replaced = 0;
    const std::string text = "'as " + line.pseudonym + " does'";
    for (std::size_t at = all.find(text); at != std::string::npos; at = all.find(text, at + 1)) ++replaced;
    EXPECT_EQ(replaced, kRemarks);
  }
}

TEST_F(ErasingInSteps, whatTheWriterRefusesLeavesThePersonAndSaysWhatIsDone) {
  addRemarks(3);
  ASSERT_OK(change([](Connection& c) {
    return c.script("CREATE TRIGGER no BEFORE DELETE ON people BEGIN SELECT RAISE(ABORT, 'no'); END");
  }));
  const auto refused = ask(admin, erase("anna"));
  ASSERT_TRUE(refused.error.has_value());
  EXPECT_THAT(refused.error->message, testing::ContainsRegex("'erased-[0-9a-f]+' stands in the place of the "
                                                             "name in 4 remarks and 0 lines"));
  EXPECT_TRUE(readErasures(data)->empty());
  pb::Request user;
  user.mutable_get_user()->set_name("anna");
  EXPECT_EQ(get(admin, user).user().full_name(), "Anna Qvarnstrom");
  ASSERT_OK(change([](Connection& c) { return c.script("DROP TRIGGER no"); }));
  get(admin, erase("anna"));
  EXPECT_EQ(readErasures(data)->size(), 1u);
  for (const char* name : {"'anna'", "Qvarnstrom", "as anna"})
    EXPECT_EQ(everything().find(name), std::string::npos) << name;
}

TEST_F(ErasingInSteps, whatWasKilledBetweenTwoPagesOfSessionsTheNextStartRepeatsUnderTheSamePseudonym) {
  addLongSessions();
  const ErasureLine line = putOnList();
  {
    auto reader = store->readers().borrow();
    ASSERT_OK(reader);
    auto found = ErasureStore(**reader).lookForNames("anna", line, false);
    ASSERT_OK(found);
    ASSERT_OK(change([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(const bool more,
                       ErasureStore(c).eraseSomeSessions("anna", line, "ada", 7, false, *found));
      EXPECT_TRUE(more);
      return {};
    }));
    EXPECT_EQ(found->sessions.sessions(), 1u);
  }
  EXPECT_EQ(sessionsOf(line.pseudonym), 1u);
  EXPECT_EQ(sessionsOf("anna"), kLongSessions - 1);
  store.reset();
  store = test::openStore(data);
  EXPECT_EQ(store->erasuresRepeated(), 1u);
  EXPECT_EQ(sessionsOf(line.pseudonym), kLongSessions);
  for (const char* name : {"'anna'", "Qvarnstrom", "616E6E61"})
    EXPECT_EQ(everything().find(name), std::string::npos) << name;
}

TEST_F(ErasingInSteps, whatTheWriterRefusesAfterAPageOfSessionsSaysHowManyAreErased) {
  addLongSessions();
  ASSERT_OK(change([](Connection& c) {
    return c.script("CREATE TRIGGER no BEFORE DELETE ON people BEGIN SELECT RAISE(ABORT, 'no'); END");
  }));
  const auto refused = ask(admin, erase("anna"));
  ASSERT_TRUE(refused.error.has_value());
  EXPECT_THAT(
      refused.error->message,
      testing::HasSubstr(fmt::format("; {} of the person's sessions are erased already", kLongSessions - 1)));
  EXPECT_TRUE(readErasures(data)->empty());
  EXPECT_EQ(sessionsOf("anna"), 1u);
  ASSERT_OK(change([](Connection& c) { return c.script("DROP TRIGGER no"); }));
  EXPECT_EQ(get(admin, erase("anna")).erasure().sessions(), 1u);
  for (const char* name : {"'anna'", "Qvarnstrom", "616E6E61"})
    EXPECT_EQ(everything().find(name), std::string::npos) << name;
}

TEST_F(ErasingInSteps, chunksGoInPiecesBetweenWhichOthersHaveTheirTurn) {
  addSessionsInSmallPieces(20);
  const pb::Request request = erase("anna");
  RequestUnderWay under_way;
  std::uint64_t left = chunkRows();
  ASSERT_EQ(left, 3u + 21 * 3);
  ASSERT_FALSE(store->service().executeStep(admin, request, under_way));
  EXPECT_TRUE(under_way.isDone());
  EXPECT_EQ(chunkRows(), left) << "the person is erased first";
  ASSERT_FALSE(store->service().executeStep(admin, request, under_way));
  EXPECT_EQ(chunkRows(), left) << "then it is looked where the name is left";
  std::uint64_t steps = 0;
  while (left > 3) {
    ASSERT_FALSE(store->service().executeStep(admin, request, under_way)) << left;
    const std::uint64_t now = chunkRows();
    ASSERT_LT(now, left);
    ASSERT_LE(left - now, kErasedPiecesAtOnce);
    left = now;
    ++steps;
  }
  EXPECT_GE(steps, 21 * 3 / kErasedPiecesAtOnce);
  EXPECT_EQ(left, 3u) << "ben's";
  std::optional<Outcome> outcome;
  for (int i = 0; i < 20 && !outcome; ++i) outcome = store->service().executeStep(admin, request, under_way);
  ASSERT_TRUE(outcome.has_value());
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_EQ(outcome->reply.erasure().recordings(), 21u);
  EXPECT_FALSE(outcome->reply.erasure().pending());
  EXPECT_EQ(outcome->reply.erasure().text().find("recordings are damaged"), std::string::npos);
}

// else the steps of a long recording would each read all that is left of it
TEST_F(ErasingInSteps, beforeAPieceGoesOnlyItsOwnChunksAreRead) {
  addSessionsInSmallPieces(0);
  ASSERT_OK(change([](Connection& c) {
    return c.run(
        "UPDATE chunks SET bytes = zeroblob(length(bytes))"
        " WHERE seq = 0 AND session = (SELECT number FROM sessions WHERE trainee = 'anna')");
  }));
  const auto erasure = get(admin, erase("anna")).erasure();
  EXPECT_EQ(chunkRows(), 3u + 1) << "ben's, and the damaged one";
  EXPECT_THAT(erasure.text(), testing::HasSubstr("1 recordings are damaged"));
  EXPECT_THAT(erasure.text(), testing::HasSubstr("chunk 0"));
}

TEST_F(ErasingInSteps, whoSetThePolicyByWhichARecordingWentIsNoLongerNamed) {
  ASSERT_OK(change([](Connection& c) {
    return c.run(
        "INSERT INTO removed_originals (session, removed_unix_ns, reason, by_whom, leftover, crcs)"
        " SELECT number, 1, 'thinned: policy of exercise of anna, set by anna', 'retention', 0, zeroblob(0)"
        " FROM sessions WHERE trainee = 'ben'");
  }));
  const auto erasure = get(admin, erase("anna")).erasure();
  const std::string all = everything();
  EXPECT_NE(all.find("policy of exercise of anna, set by " + erasure.pseudonym()), std::string::npos)
      << "an exercise's name stays";
  EXPECT_EQ(all.find("set by anna"), std::string::npos);
}

TEST_F(ErasingInSteps, aProgramThatEndsLeavesTheOtherChunksToRetentionAndSaysSo) {
  addSessionsInSmallPieces(20);
  const pb::Request request = erase("anna");
  RequestUnderWay under_way;
  for (int step = 0; step < 3; ++step) ASSERT_FALSE(store->service().executeStep(admin, request, under_way));
  store->service().stopRetention();
  const std::uint64_t left = chunkRows();
  EXPECT_GT(left, 3u);
  std::optional<Outcome> outcome;
  for (int i = 0; i < 20 && !outcome; ++i) outcome = store->service().executeStep(admin, request, under_way);
  ASSERT_TRUE(outcome.has_value());
  EXPECT_EQ(chunkRows(), left);
  EXPECT_THAT(outcome->reply.erasure().text(),
              testing::HasSubstr("the chunks go with the next run of retention"));
  // as the next start does
  store.reset();
  store = test::openStore(data);
  ASSERT_OK(store->service().retention({"ada"}, false));
  EXPECT_EQ(chunkRows(), 3u);
}

TEST_F(ErasingInSteps, aKillInTheErasureOfANameThatNobodyHadTakesNothingThatCameAfterIt) {
  const auto key = PseudonymKey::ofFolder(data);
  ASSERT_OK(key);
  const std::int64_t began = wallNowNs();
  std::vector<ErasureLine> lines;
  std::vector<Uuid> before, after;
  for (const char* name : {"Mona", "Lisa"}) {
    before.push_back(closedSession(name, 1, ""));
    ErasureLine line{newErasurePseudonym(), key->nameHash(name), began};
    line.without_account = true;
    lines.push_back(sealed(std::move(line), *key));
  }
  ASSERT_OK(writeErasures(data, lines));
  // between its pages a namesake practises; and a new trainee gets the other name
  ASSERT_OK(change([&](Connection& c) {
    return PeopleStore(c).add({"Lisa", pb::TRAINEE, "", false, began + 1});
  }));
  for (const char* name : {"Mona", "Lisa"}) after.push_back(closedSession(name, 2, ""));
  ASSERT_OK(change([&](Connection& c) -> Status {
    for (const Uuid& id : after)
      RETURN_IF_ERROR(
          c.run("UPDATE sessions SET received_unix_ns = ? WHERE id = ?", began + 2, ByteView(id)));
    return {};
  }));
  store.reset();
  store = test::openStore(data);
  EXPECT_EQ(store->erasuresRepeated(), 2u);
  const auto shown = [&](const Uuid& id) {
    pb::Request show;
    show.mutable_get_session()->set_session_id(test::bytesOfId(id));
    return get(instructor, show).session();
  };
  for (std::size_t i = 0; i < lines.size(); ++i) {
    EXPECT_EQ(shown(before[i]).description().trainee(), lines[i].pseudonym);
    EXPECT_EQ(shown(after[i]).description().trainee(), i == 0 ? "Mona" : "Lisa");
    EXPECT_EQ(shown(after[i]).chunks(), 3u);
  }
  pb::Request user;
  user.mutable_get_user()->set_name("Lisa");
  get(admin, user);
}

TEST_F(ErasingInSteps, aStartWithoutMemoryForThemEndsWithATextAndNothingHalfWritten) {
  addRemarks(3);
  putOnList();
  store.reset();
  auto writer = Connection::open(data / "needlelab.db", {.mode = Connection::Mode::kWriter});
  ASSERT_OK(writer);
  const std::string before = test::dump(*writer);
  int asked = 0;
  const ErasureStore::FreeRoom room = [&]() -> std::optional<std::uint64_t> {
    if (++asked == 3) throw std::bad_alloc();
    return UINT64_MAX;
  };
  const auto failed = eraseBeforeServing(*writer, 7, room);
  ASSERT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().code, ErrorCode::kFailed);
  EXPECT_THAT(failed.error().message, testing::HasSubstr("not enough memory"));
  EXPECT_THAT(failed.error().message, testing::HasSubstr(data.string()));
  EXPECT_FALSE(writer->inTransaction());
  EXPECT_TRUE(test::dump(*writer) == before);
  EXPECT_EQ(*eraseBeforeServing(*writer, 7), 1u);
  EXPECT_EQ(test::dump(*writer).find("as anna"), std::string::npos);
}

}  // namespace
}  // namespace needlelab
