// Work that somebody began and that is written after the person's erasure: nowhere in the name.
#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/base/clock.h"
#include "common/base/files.h"
#include "db/audit.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/service/rescoring.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/service/retention_fixture.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class WorkOfErased : public test::RetentionTest {
 protected:
  static constexpr const char* kName = "qzmia";
  /// Adds the person who will be erased, by her account.
  Principal add(pb::Role role) {
    addPerson(kName, role);
    return {kName, role, true, 1};
  }
  /// One who can log in, so that another administrator may go.
  void addAda() {
    ASSERT_OK(change([](Connection& c) {
      return PeopleStore(c).add({"ada", pb::ADMINISTRATOR, "$hash", false, 1});
    }));
  }
  void eraseHer() {
    pb::Request request;
    request.mutable_erase_person()->set_name(kName);
    request.mutable_erase_person()->set_confirm(kName);
    const auto erasure = get(admin, request).erasure();
    pseudonym = erasure.pseudonym();
    EXPECT_FALSE(erasure.pending()) << erasure.text();
  }
  /// Another person of her name; returns when the account was made.
  std::int64_t addNamesake(pb::Role role) {
    std::int64_t added_unix_ns = 0;
    EXPECT_OK(change([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(added_unix_ns, ErasureStore(c).addedAt(kName, wallNowNs()));
      return PeopleStore(c).add({kName, role, "", false, added_unix_ns});
    }));
    return added_unix_ns;
  }
  /// `during` comes before the second recording.
  pb::RetentionReport runRetentionOf(const Principal& who, const std::function<void()>& during) {
    const std::atomic<bool> stop = false;
    int recordings = 0;
    const RetentionTools tools{store->writer(),
                               store->readers(),
                               [&](const Uuid&) -> Status {
                                 if (++recordings == 2) during();
                                 return {};
                               },
                               [] { return false; },
                               stop,
                               {.pause = std::chrono::milliseconds(0)}};
    const auto report = runRetention(tools, who.doer(), wallNowNs(), false);
    EXPECT_OK(report);
    return report.ok() ? *report : pb::RetentionReport();
  }
  std::uint64_t count(const std::string& sql, const std::string& name) {
    std::uint64_t rows = 0;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.query("SELECT count(*) FROM " + sql, name);
      RETURN_IF_ERROR(row.step());
      rows = row.natural(0);
      return {};
    }));
    return rows;
  }
  std::uint64_t lines(const std::string& name, const std::string& action) {
    return count("audit WHERE action = '" + action + "' AND who = ?", name);
  }
  /// The newest line of this kind.
  AuditRow lineOf(const std::string& action) {
    AuditRow line;
    EXPECT_OK(change([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(const auto found, AuditStore(c).list(1, 0, {}, action));
      if (!found.empty()) line = found.front();
      return {};
    }));
    return line;
  }
  /// Ends the store; returns the files of its folder that have her name in their bytes.
  std::vector<std::string> filesWithHer() {
    EXPECT_OK(change([](Connection& c) -> Status {
      EXPECT_THAT(test::dump(c), testing::Not(HasSubstr(kName)));
      return {};
    }));
    store.reset();
    std::vector<std::string> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path() / "data")) {
      if (!entry.is_regular_file()) continue;
      const auto bytes = readWholeFile(entry.path());
      EXPECT_OK(bytes);
      if (bytes.ok() && bytes->find(kName) != std::string::npos) files.push_back(entry.path().string());
    }
    return files;
  }
  /// What becomes of a request that waits for the writer while she is erased.
  Outcome whileErased(const Principal& who, const pb::Request& request) {
    std::optional<Outcome> outcome;
    std::atomic<bool> ended = false;
    std::thread asks;
    EXPECT_OK(store->writer().run([&](Connection& c) -> Status {
      asks = std::thread([&] {
        outcome = ask(who, request);
        ended = true;
      });
      while (store->writer().counters().waiting == 0 && !ended) std::this_thread::yield();
      ASSIGN_OR_RETURN(const auto key, ErasureStore(c).key());
      pseudonym = newErasurePseudonym();
      const ErasureLine line{pseudonym, key.nameHash(kName), wallNowNs()};
      const auto erased = ErasureStore(c).erase(kName, line, "ada", "", wallNowNs());
      return erased ? Status() : Status(erased.error());
    }));
    asks.join();
    return *outcome;
  }
  static void hears(const Error& error) { ADD_FAILURE() << error.message; }

  std::string pseudonym;
};

TEST_F(WorkOfErased, aRunOfRetentionThatThinsGoesOnUnderThePseudonym) {
  const Principal her = add(pb::CURRICULUM_MANAGER);
  for (int i = 0; i < 3; ++i) (void)addClosed();
  (void)get(admin, policy(0, 100, -1));
  EXPECT_EQ(runRetentionOf(her, [&] { eraseHer(); }).thinned(), 3u);
  EXPECT_EQ(count("removed_originals WHERE by_whom = ?", pseudonym), 3u);
  EXPECT_EQ(lines(pseudonym, "retention thin"), 3u);
  EXPECT_EQ(lines(pseudonym, "retention run"), 1u);
  EXPECT_TRUE(sound());
  EXPECT_THAT(filesWithHer(), IsEmpty());
}

TEST_F(WorkOfErased, aRunOfRetentionThatDeletesGoesOnUnderThePseudonym) {
  const Principal her = add(pb::CURRICULUM_MANAGER);
  for (int i = 0; i < 3; ++i) (void)addClosed();
  (void)get(admin, policy(-1, 0, 0));
  EXPECT_EQ(runRetentionOf(her, [&] { eraseHer(); }).deleted(), 3u);
  EXPECT_EQ(count("removed_originals WHERE by_whom = ?", pseudonym), 3u);
  EXPECT_EQ(lines(pseudonym, "retention delete"), 3u);
  EXPECT_EQ(lines(pseudonym, "retention run"), 1u);
  EXPECT_TRUE(sound());
  EXPECT_THAT(filesWithHer(), IsEmpty());
}

TEST_F(WorkOfErased, isNotThatOfALaterAccountOfTheName) {
  const Principal her = add(pb::CURRICULUM_MANAGER);
  for (int i = 0; i < 2; ++i) (void)addClosed();
  (void)get(admin, policy(0, 100, -1));
  Principal namesake = her;
  EXPECT_TRUE(*store->service().stillAllowed(her));
  ASSERT_OK(store->service().noteLogin(her, "192.0.2.1"));
  runRetentionOf(her, [&] {
    eraseHer();
    namesake.account_unix_ns = addNamesake(her.role);
  });
  EXPECT_EQ(count("removed_originals WHERE by_whom = ?", pseudonym), 2u);
  EXPECT_EQ(lines(pseudonym, "retention thin"), 2u);
  EXPECT_EQ(count("audit WHERE who = ?", kName), 0u);
  EXPECT_FALSE(*store->service().stillAllowed(her));
  EXPECT_TRUE(*store->service().stillAllowed(namesake));
  // what the other one does is the other one's, also once it is erased; and has lines of its own
  const std::string first = pseudonym;
  ASSERT_OK(store->service().noteLogin(namesake, "192.0.2.1"));
  EXPECT_EQ(lineOf("log-in").who, kName);
  eraseHer();
  store->service().noteSoon(her.doer(), "not delivered", "station-1", "", hears);
  EXPECT_EQ(lineOf("not delivered").who, first);
  store->service().noteSoon(namesake.doer(), "not delivered", "station-1", "", hears);
  EXPECT_EQ(lineOf("not delivered").who, pseudonym);
  EXPECT_THAT(filesWithHer(), IsEmpty());
}

TEST_F(WorkOfErased, aRunOfScoresIsNotedUnderThePseudonym) {
  const Principal her = add(pb::CURRICULUM_MANAGER);
  (void)addClosed();
  ASSERT_OK(change([](Connection& c) { return c.run("DELETE FROM scores"); }));
  const std::atomic<bool> stop = false;
  const RescoreTools tools{store->writer(),
                           store->readers(),
                           [&](Connection&, const Uuid&) -> Result<std::string> {
                             eraseHer();
                             return std::string();
                           },
                           [] { return false; },
                           stop,
                           {}};
  const auto report = runRescoring(tools, "", her.doer(), false);
  ASSERT_OK(report);
  EXPECT_EQ(report->left_alone(), 1u);
  EXPECT_EQ(lines(pseudonym, "rescore all"), 1u);
  EXPECT_THAT(filesWithHer(), IsEmpty());
}

TEST_F(WorkOfErased, linesThatComeAfterTheErasureHaveThePseudonym) {
  const Principal her = add(pb::INSTRUCTOR);
  eraseHer();
  store->service().noteSoon(her.doer(), "not delivered", "station-1", "stop: it did not confirm", hears);
  EXPECT_EQ(lineOf("not delivered").who, pseudonym);
  store->service().noteWatching(her, "station-1", "", hears);
  EXPECT_EQ(lineOf("watch live").who, pseudonym);
  ASSERT_OK(store->service().noteLogin(her, "192.0.2.1"));
  EXPECT_EQ(lineOf("log-in").who, pseudonym);
  // those about her
  store->service().noteSoon({"ada"}, "access ended", kName, "the account was disabled", hears);
  EXPECT_EQ(lineOf("access ended").subject, pseudonym);
  ASSERT_OK(store->service().note("server", "log-in locked", std::string("person ") + kName, ""));
  EXPECT_EQ(lineOf("log-in locked").subject, "person " + pseudonym);
  EXPECT_EQ(lineOf("log-in locked").who, "server");
  EXPECT_THAT(filesWithHer(), IsEmpty());
}

TEST_F(WorkOfErased, aLineAboutWhatSomebodyReadsHasThePseudonymOfWhomItWasBegunAbout) {
  const Principal her = add(pb::TRAINEE);
  const std::int64_t begun = wallNowNs();
  eraseHer();
  const auto note = [&](const std::string& action, const std::string& subject, const std::string& detail) {
    EXPECT_OK(change([&](Connection& c) {
      return AuditStore(c).add({0, begun, "ina", action, subject, detail});
    }));
    return lineOf(action);
  };
  EXPECT_EQ(note("session export", "s", "samples of 'qzmia'").detail, "samples of '" + pseudonym + "'");
  EXPECT_EQ(note("person export", kName, "").subject, pseudonym);
  EXPECT_EQ(note("backup", kName, "").subject, kName) << "that is a file";
  // somebody has the name again
  addNamesake(her.role);
  EXPECT_EQ(note("person export", kName, "").subject, kName);
}

TEST_F(WorkOfErased, anAdministratorsOwnErasureOfAnotherIsToldUnderThePseudonym) {
  addAda();
  addPerson("tom", pb::TRAINEE);
  const Principal her = add(pb::ADMINISTRATOR);
  // a copy of the database that has tom
  std::filesystem::create_directory(folder.path() / "kept");
  pb::Request backup;
  backup.mutable_backup()->set_path((folder.path() / "kept" / "tom.db").string());
  get(admin, backup);
  pb::Request erase;
  erase.mutable_erase_person()->set_name("tom");
  erase.mutable_erase_person()->set_confirm("tom");
  RequestUnderWay under_way;
  ASSERT_FALSE(store->service().executeStep(her, erase, under_way));
  ASSERT_TRUE(under_way.isDone());
  eraseHer();
  std::optional<Outcome> outcome;
  for (int i = 0; i < 100 && !outcome; ++i) outcome = store->service().executeStep(her, erase, under_way);
  ASSERT_TRUE(outcome.has_value());
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_EQ(outcome->reply.erasure().files_size(), 1);
  EXPECT_EQ(count("erasures WHERE by_whom = ?", pseudonym), 1u);
  EXPECT_EQ(lines(pseudonym, "person erase"), 2u) << "that he was erased, and the file";
  EXPECT_THAT(filesWithHer(), IsEmpty());
}

TEST_F(WorkOfErased, aScoreThatWaitedIsNotStored) {
  const Principal her = add(pb::CURRICULUM_MANAGER);
  pb::Request profile;
  profile.mutable_get_profile()->set_id("knee-adult");
  const Uuid id = addClosed(test::kClosedChunks, true, get(admin, profile).profile().json());
  ASSERT_OK(change([](Connection& c) { return c.run("DELETE FROM scores"); }));
  pb::Request rescore;
  rescore.mutable_rescore_session()->set_session_id(test::bytesOfId(id));
  const Outcome outcome = whileErased(her, rescore);
  ASSERT_TRUE(outcome.error);
  EXPECT_EQ(outcome.error->code, ErrorCode::kDenied) << outcome.error->message;
  EXPECT_EQ(count("scores WHERE measures <> ?", ""), 0u);
}

}  // namespace
}  // namespace needlelab
