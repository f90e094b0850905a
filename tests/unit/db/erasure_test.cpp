#include "db/erasure.h"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "common/base/text.h"
#include "db/audit.h"
#include "db/check.h"
#include "db/db_writer.h"
#include "db/documents.h"
#include "db/free_parts.h"
#include "db/people.h"
#include "db/retention_store.h"
#include "db/schema.h"
#include "db/session_results.h"
#include "db/session_rows.h"
#include "db/unknown_trainees.h"
#include "tests/support/sanitized.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/shim_vfs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

class ErasureStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1, "Anna Östlund-Berg"}));
    ASSERT_OK(PeopleStore(db.writer).add({"ben", pb::TRAINEE, "", false, 1}));
  }
  Uuid session(const std::string& trainee, std::uint64_t chunks, bool closed) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee(trainee);
    EXPECT_OK(SessionStore(db.writer).open(d, 1));
    for (std::uint64_t seq = 0; seq < chunks; ++seq)
      EXPECT_OK(SessionStore(db.writer).append(id, seq, test::chunkOf(seq)));
    if (closed) EXPECT_OK(SessionStore(db.writer).close(test::closeOf(id, chunks), 2));
    return id;
  }
  ErasureLine line(const std::string& name, std::int64_t when) {
    const auto key = PseudonymKey::ofFolder(db.folder.path());
    return {"erased-1234", key->nameHash(name), when};
  }
  Result<pb::Erasure> erase(const std::string& name, std::int64_t when = 1'800'000'000'000'000'000) {
    return ErasureStore(db.writer).erase(name, line(name, when), "ada", "asked for it", when);
  }
  bool waits(const Uuid& id) {
    auto row = db.writer.query(
        "SELECT 1 FROM unknown_trainees WHERE by_whom IS NULL"
        " AND session = (SELECT number FROM sessions WHERE id = ?)",
        ByteView(id));
    return *row.step();
  }
  void removeChunks(const Uuid& id) {
    for (;;) {
      const auto more = RetentionStore(db.writer).removeSome(id, 2);
      ASSERT_OK(more);
      if (!*more) return;
    }
  }
  test::TestDb db;
};

TEST_F(ErasureStoreTest, nothingInTheDatabaseNamesThePersonAfterwards) {
  const Uuid id = session("anna", 5, true), other = session("ben", 3, true);
  ASSERT_OK(ScoreStore(db.writer).put(test::scoreOf(id, "[1]")));
  ASSERT_OK(AnnotationStore(db.writer).add(
      {0, id, 1, "Well done, ANNA! Mrs. Östlund-Berg holds still.", "ina", 1}));
  ASSERT_OK(AnnotationStore(db.writer).add({0, other, 1, "better than anna, annabel", "ina", 1}));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "ina", "assign", "anna", "exercise knee-1 for anna"}));
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  EXPECT_EQ(erased->sessions(), 1u);
  EXPECT_EQ(erased->recordings(), 1u);
  EXPECT_EQ(erased->scores(), 1u);
  EXPECT_EQ(erased->remarks_kept(), 1u);
  EXPECT_EQ(erased->audit_lines(), 1u);
  const std::string all = test::dump(db.writer);
  EXPECT_EQ(all.find("'anna'"), std::string::npos);
  EXPECT_EQ(all.find("stlund"), std::string::npos);
  // blobs are dumped as digits
  EXPECT_EQ(all.find("616E6E61"), std::string::npos) << "in the description";
  EXPECT_NE(all.find("Well done, erased-1234!"), std::string::npos);
  EXPECT_NE(all.find("better than erased-1234, annabel"), std::string::npos);
  EXPECT_NE(all.find("exercise knee-1 for erased-1234"), std::string::npos);
  // others are untouched
  EXPECT_EQ(SessionStore(db.writer).info(other)->chunks(), 3u);
  removeChunks(id);
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << check->faults.front();
  EXPECT_EQ(erase("anna").error().code, ErrorCode::kNotFound);
}

/// The peak of this process's memory while `work` runs, in bytes.
template <typename Work>
std::uint64_t peakOf(const Work& work) {
  std::ofstream("/proc/self/clear_refs") << "5";
  work();
  std::ifstream in("/proc/self/status");
  std::uint64_t kib = 0;
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("VmHWM:")) kib = std::stoull(line.substr(6));
  return kib << 10;
}

TEST_F(ErasureStoreTest, memoryDoesNotGrowWithTheRemarksInThePersonsSessions) {
  const Uuid id = session("anna", 1, true);
  constexpr std::uint64_t kRemarks = 30'000, kLength = 2000;
  ASSERT_OK(
      db.writer.run("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ?2)"
                    " INSERT INTO annotations (session, tick, author, text, created_unix_ns)"
                    " SELECT s.number, 1, 'ina', printf('%.*c', ?3, '.'), 1 FROM sessions s, n"
                    " WHERE s.id = ?1",
                    ByteView(id), kRemarks, kLength));
  Result<pb::Erasure> erased = Error{ErrorCode::kFailed, "not asked"};
  const std::uint64_t before = peakOf([] {});
  const std::uint64_t peak = peakOf([&] { erased = erase("anna"); });
  ASSERT_OK(erased);
  EXPECT_EQ(erased->remarks_kept(), kRemarks);
  // a sanitizer keeps what is freed
  if (!test::kSanitized) {
    EXPECT_LT(peak - before, kRemarks * kLength / 3);
  }
}

TEST_F(ErasureStoreTest, namesBesideTypographicPunctuationGoToo) {
  ASSERT_OK(
      PeopleStore(db.writer).add({"wilhelmina", pb::TRAINEE, "", false, 1, "Wilhelmina Quastenflosser"}));
  const Uuid id = session("wilhelmina", 1, true);
  for (const char* text : {"“Wilhelmina” in curly quotes", "Wilhelmina’s needle", "see—Wilhelmina—again",
                           "„Wilhelmina“", "Quastenflosser’s"})
    ASSERT_OK(AnnotationStore(db.writer).add({0, id, 1, text, "ina", 1}));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "ada", "attempt excuse", uuidText(id), "Wilhelmina’s glove"}));
  const auto erased =
      ErasureStore(db.writer).erase("wilhelmina", line("wilhelmina", 77), "ada", "Wilhelmina’s wish", 77);
  ASSERT_OK(erased);
  const std::string all = test::dump(db.writer);
  for (const char* name : {"ilhelmina", "uastenflosser"})
    EXPECT_EQ(all.find(name), std::string::npos) << name;
  EXPECT_EQ(erased->text(), "");
}

TEST_F(ErasureStoreTest, theReplyNamesTextsThatMayStillMeanThePerson) {
  const Uuid other = session("ben", 1, true);
  ASSERT_OK(PeopleStore(db.writer).add({"anna-maria", pb::TRAINEE, "", false, 1}));
  for (const char* text : {"anna is quick", "Annas Hand", "as Östlund-BERG says", "anna-maria"})
    ASSERT_OK(AnnotationStore(db.writer).add({0, other, 1, text, "ina", 1}));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "ada", "server start", "server", "with annas settings"}));
  const auto erased = ErasureStore(db.writer).erase("anna", line("anna", 77), "ada", "annas wish", 77);
  ASSERT_OK(erased);
  EXPECT_EQ(
      erased->text(),
      "The name was also replaced in: 1 remarks in sessions of others. "
      "These have the letters of a name of this person, as a part of another word, as a word of the full "
      "name or as a name that a station gave, and stay as they are; look whom they mean: 2 remarks, such as "
      "number 2, 3; 1 lines of the audit "
      "log, such as 1; the reasons of 1 erasures, such as erased-1234. ");
}

/// Lines of the audit log as "who|action|subject|detail".
std::vector<std::string> auditLines(Connection& c) {
  std::vector<std::string> lines;
  const auto rows = AuditStore(c).list(0);
  EXPECT_OK(rows);
  for (const AuditRow& row : *rows)
    lines.insert(lines.begin(), row.who + "|" + row.action + "|" + row.subject + "|" + row.detail);
  return lines;
}

TEST_F(ErasureStoreTest, linesOfTheLogAboutOthersStayAsTheyWere) {
  PeopleStore people(db.writer);
  ASSERT_OK(people.add({"ann", pb::TRAINEE, "", false, 1, "Ann Bone Page"}));
  for (const char* name : {"ann-maria", "ann berg", "ann.b", "b, ann-x"})
    ASSERT_OK(people.add({name, pb::TRAINEE, "", false, 1}));
  const Uuid own = session("ann", 1, true), other = session("ben", 1, true);
  const std::vector<std::string> of_others{
      "ann-maria|user add|ann berg|trainee",
      "ada|user change|ann.b|full name: '' to 'Will Bone'",
      "ada|group set|ann|revision 2; joined: ann-maria, ann berg, ann.b",
      "ada|group remove|ann|with its assignments",
      "ada|assign|ann|course page for group ann",
      "ada|profile import|bone-page|revision 2; changed: layers[0].tissue (Bone), ann",
      "ada|access ended|ann|the station's key was revoked; ended: 1 connections, 0 tokens",
      "ada|attempt excuse|" + uuidText(other) + "|does not count: Bone at Page 4, says ann-maria"};
  const std::vector<std::pair<std::string, std::string>> own_lines{
      {"ann|consent|ann|given", "x|consent|x|given"},
      {"ada|assign|ann|exercise knee-1 for ann", "ada|assign|x|exercise knee-1 for x"},
      {"ada|group set|g|revision 3; joined: ann, ann berg; left: ann",
       "ada|group set|g|revision 3; joined: x, ann berg; left: x"},
      {"server|log-in locked|ann|too many", "server|log-in locked|x|too many"},
      {"ada|attempt excuse|" + uuidText(own) + "|does not count: Mrs. Bone fell",
       "ada|attempt excuse|" + uuidText(own) + "|does not count: Mrs. x fell"},
      {"ada|attempt excuse|" + uuidText(other) + "|counts again: Ann was in the way",
       "ada|attempt excuse|" + uuidText(other) + "|counts again: x was in the way"}};
  std::vector<std::string> before, expected;
  for (const auto& line : of_others) before.push_back(line), expected.push_back(line);
  for (const auto& [was, is] : own_lines) before.push_back(was), expected.push_back(is);
  for (const std::string& line : before) {
    std::vector<std::string> cells;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, '|');) cells.push_back(cell);
    ASSERT_OK(AuditStore(db.writer).add({0, 1, cells.at(0), cells.at(1), cells.at(2), cells.at(3)}));
  }
  ASSERT_OK(AnnotationStore(db.writer).add({0, own, 1, "Bone hit the bone, Ann", "ina", 1}));
  ASSERT_OK(AnnotationStore(db.writer).add(
      {0, other, 1, "Bone hit; ANN-Maria and ann looked at Page 3", "ina", 1}));
  const auto erased = ErasureStore(db.writer).erase(
      "ann", {"x", PseudonymKey::ofFolder(db.folder.path())->nameHash("ann"), 5}, "ada", "", 5);
  ASSERT_OK(erased);
  EXPECT_EQ(auditLines(db.writer), expected);
  EXPECT_EQ(erased->audit_lines(), own_lines.size());
  EXPECT_EQ(AnnotationStore(db.writer).list(own)->front().text, "x hit the bone, x");
  EXPECT_EQ(AnnotationStore(db.writer).list(other)->front().text,
            "Bone hit; ANN-Maria and x looked at Page 3");
}

TEST_F(ErasureStoreTest, linesOfReadSamplesLoseTheNameAlsoWhereTheSessionIsSomebodyElsesNow) {
  ASSERT_OK(PeopleStore(db.writer).add({"anna-lena", pb::TRAINEE, "", false, 1}));
  const Uuid now_bens = session("ben", 1, true), own = session("anna", 1, true);
  for (const auto& [id, detail] : {std::pair{now_bens, "samples of 'anna'"},
                                   {own, "samples of 'anna'"},
                                   {now_bens, "samples of 'ben'"},
                                   {now_bens, "samples of 'anna-lena'"}})
    ASSERT_OK(AuditStore(db.writer).add({0, 1, "ina", "session export", uuidText(id), detail}));
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  EXPECT_EQ(erased->audit_lines(), 2u);
  const std::string of_ben = "ina|session export|" + uuidText(now_bens) + "|";
  EXPECT_EQ(auditLines(db.writer),
            (std::vector<std::string>{of_ben + "samples of 'erased-1234'",
                                      "ina|session export|" + uuidText(own) + "|samples of 'erased-1234'",
                                      of_ben + "samples of 'ben'", of_ben + "samples of 'anna-lena'"}));
}

TEST_F(ErasureStoreTest, groupsKeepTheirNamesWithoutThePerson) {
  ASSERT_OK(PeopleStore(db.writer).add({"anna-lena", pb::TRAINEE, "", false, 1}));
  GroupStore groups(db.writer);
  const auto put = [&](const std::string& id, const std::string& name) {
    pb::Group group;
    group.set_id(id);
    group.set_name(name);
    group.add_members("ben");
    ASSERT_OK(groups.put(group, std::nullopt, "ada", 1));
  };
  put("friends", "Friends of ANNA, Annabel and anna-lena");
  put("anna-2", "Anna Östlund-Berg");
  put("other", "For anna-lena");
  ASSERT_OK(AuditStore(db.writer).add(
      {0, 1, "ada", "group set", "friends", "revision 1; name: 'Friends of ANNA, anna-lena'; joined: ben"}));
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  const auto friends = groups.get("friends"), second = groups.get("anna-2"), other = groups.get("other");
  ASSERT_TRUE(friends.ok() && second.ok() && other.ok());
  EXPECT_EQ(friends->name(), "Friends of erased-1234, Annabel and anna-lena");
  EXPECT_EQ(friends->revision(), 2u) << "an edit of before would bring the name back";
  EXPECT_EQ(second->name(), "erased-1234");
  EXPECT_EQ(other->name(), "For anna-lena");
  EXPECT_EQ(other->revision(), 1u);
  EXPECT_EQ(auditLines(db.writer).front(),
            "ada|group set|friends|revision 1; name: 'Friends of erased-1234, anna-lena'; joined: ben");
  EXPECT_EQ(
      erased->text(),
      "The name was also replaced in: 2 names of groups; 1 lines of the audit log about others. "
      "These have the name and stay as they are: the id of the group 'anna-2' (make the group anew). "
      "These have the letters of a name of this person, as a part of another word, as a word of the full "
      "name or as a name that a station gave, and stay as they are; look whom they mean: the names of 1 "
      "groups, such as friends. ");
}

TEST_F(ErasureStoreTest, wordsAboutTheDeviceGoFromOwnSessionsAndAreListedOfOthers) {
  SessionStore sessions(db.writer);
  const auto opened = [&](const std::string& trainee) {
    auto d = test::describe(makeUuidV7());
    d.set_trainee(trainee);
    d.set_device("Falcon of anna");
    d.set_axial_model("Anna's");
    d.add_device_notes("as Östlund-Berg holds it");
    EXPECT_OK(sessions.open(d, 1));
    return d;
  };
  const auto own = opened("anna"), bens = opened("ben");
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  const auto shown = [&](const pb::SessionDescription& d) {
    Uuid id{};
    std::copy(d.session_id().begin(), d.session_id().end(), id.begin());
    const auto info = sessions.info(id);
    EXPECT_OK(info);
    return info->description();
  };
  EXPECT_EQ(shown(own).device(), "");
  EXPECT_EQ(shown(own).axial_model(), "");
  EXPECT_EQ(shown(own).device_notes_size(), 0);
  // a person may be called as a device is: an administrator looks at it
  EXPECT_EQ(shown(bens).device(), "Falcon of anna");
  EXPECT_EQ(
      erased->text(),
      "These have the name and stay as they are: the words about device and patient in 1 sessions of others, "
      "such as " +
          sessionText(bens.session_id()) + ". ");
  // both stations come again after a cut
  EXPECT_OK(sessions.open(own, 5));
  EXPECT_OK(sessions.open(bens, 5));
}

TEST_F(ErasureStoreTest, profilesGoFromOwnSessionsAndAreListedOfOthers) {
  SessionStore sessions(db.writer);
  const std::string profile =
      R"({"id":"knee","layers":[{"name":"muscle of anna"}],"hazards":[{"name":"Wqjvornov"}]})";
  const auto opened = [&](const std::string& trainee, const std::string& profile_json) {
    auto d = test::describe(makeUuidV7());
    d.set_trainee(trainee);
    d.set_profile_json(profile_json);
    EXPECT_OK(sessions.open(d, 1));
    return d;
  };
  ASSERT_OK(
      ProfileStore(db.writer).put({"knee-of", 0, "Anna's knee", R"({"name":"Anna's knee"})", "bea", 1}));
  ASSERT_OK(ProfileStore(db.writer).put({"hip", 0, "A hip", R"({"name":"A hip"})", "bea", 1}));
  const auto own = opened("anna", profile);
  const auto bens = opened("ben", R"({"id":"knee","targets":[{"name":"where ANNA missed"}]})");
  (void)opened("ben", R"({"id":"knee","targets":[{"name":"annabel"}]})");
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  const std::string all = test::dump(db.writer);
  for (const char* text : {"muscle of", "Wqjvornov"}) EXPECT_EQ(all.find(text), std::string::npos) << text;
  EXPECT_NE(all.find("where ANNA missed"), std::string::npos) << "its station sends it again";
  EXPECT_EQ(erased->text(),
            "These have the name and stay as they are: revisions of the profile 'knee-of' (nobody can remove "
            "them); the words about device and patient in 1 sessions of others, such as " +
                sessionText(bens.session_id()) + ". ");
  // both stations come again after a cut, and one that was away sends what it has
  EXPECT_OK(sessions.open(own, 5));
  EXPECT_OK(sessions.open(bens, 5));
  (void)opened("anna", profile);
  EXPECT_EQ(test::dump(db.writer).find("Wqjvornov"), std::string::npos);
}

TEST_F(ErasureStoreTest, earlierFullNamesGoWithTheLast) {
  const Uuid id = session("ben", 1, true), other = session("anna", 1, true);
  for (const char* change :
       {"role: trainee to instructor; full name: '' to 'Ben Altmann'",
        "full name: 'Ben Altmann' to 'Benno Neumann'", "full name: 'Benno Neumann' to ''"})
    ASSERT_OK(AuditStore(db.writer).add({0, 1, "ada", "user change", "ben", change}));
  ASSERT_OK(AnnotationStore(db.writer).add({0, id, 1, "Altmann, now Neumann", "ina", 1}));
  ASSERT_OK(AnnotationStore(db.writer).add({0, other, 1, "as ben altmann did; ask Neumann", "ina", 1}));
  ASSERT_OK(erase("ben"));
  const std::string all = test::dump(db.writer);
  for (const char* name : {"Altmann", "altmann", "Benno"})
    EXPECT_EQ(all.find(name), std::string::npos) << name;
  EXPECT_EQ(auditLines(db.writer).front(),
            "ada|user change|erased-1234|role: trainee to instructor; full name changed");
  EXPECT_EQ(AnnotationStore(db.writer).list(other)->front().text, "as erased-1234 did; ask Neumann")
      << "a word of it in somebody else's session is not known to be the name";
}

TEST_F(ErasureStoreTest, whatWasErasedIsNotInTheFileEither) {
  // a unique name, and a rare one
  ASSERT_OK(PeopleStore(db.writer).add({"qzxanna", pb::TRAINEE, "", false, 1, "Wqjvornov"}));
  const Uuid id = session("qzxanna", 20, true);
  ASSERT_OK(AnnotationStore(db.writer).add({0, id, 1, "Wqjvornov is good", "ina", 1}));
  const auto count = [&](const std::string& word) {
    EXPECT_OK(db.writer.checkpointPassive());
    const auto bytes = readWholeFile(db.path);
    EXPECT_OK(bytes);
    std::size_t found = 0;
    for (std::size_t at = bytes->find(word); at != std::string::npos; at = bytes->find(word, at + 1)) ++found;
    return found;
  };
  const Bytes chunk = test::chunkOf(7);
  const std::string motion(textOf(ByteView(chunk).subspan(8, 48)));
  EXPECT_GT(count("qzxanna"), 0u);
  EXPECT_GT(count("Wqjvornov"), 0u);
  EXPECT_GT(count(motion), 0u);
  ASSERT_OK(erase("qzxanna"));
  removeChunks(id);
  EXPECT_EQ(count("qzxanna"), 0u) << "pages that were freed are overwritten";
  EXPECT_EQ(count("Wqjvornov"), 0u);
  EXPECT_EQ(count(motion), 0u);
}

TEST_F(ErasureStoreTest, samplesThatAnAnalyzeTookOfTheIndexesGoToo) {
  ASSERT_OK(PeopleStore(db.writer).add({"qzxanna", pb::TRAINEE, "", false, 1}));
  (void)session("qzxanna", 1, true);
  // as a SQLite with STAT4 fills it: the sample is a record of the index
  ASSERT_OK(
      db.writer.script("PRAGMA writable_schema=ON; CREATE TABLE sqlite_stat4(tbl,idx,neq,nlt,ndlt,sample);"
                       "PRAGMA writable_schema=OFF; INSERT INTO sqlite_stat4 VALUES ('sessions',"
                       " 'sessions_by_trainee', '1 1', '0 0', '0 0', CAST('qzxanna' AS BLOB))"));
  ASSERT_OK(erase("qzxanna"));
  ASSERT_OK(db.writer.checkpointPassive());
  const auto bytes = readWholeFile(db.path);
  ASSERT_OK(bytes);
  EXPECT_EQ(bytes->find("qzxanna"), std::string::npos);
}

TEST_F(ErasureStoreTest, whatPagesKeepOfRowsThatMovedGoesTooAndNothingElse) {
  // rows of many lengths in random order: pages are parted and joined, and keep copies of rows that moved
  std::uint64_t state = 1;
  const auto random = [&](std::uint64_t below) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (state >> 33) % below;
  };
  constexpr std::uint64_t kPeople = 2000;
  const auto nameOf = [](std::uint64_t i) { return fmt::format("zq{:08x}", 0x51ab0000u + i * 7919); };
  const auto fullNameOf = [&](std::uint64_t i) {
    return "F" + nameOf(i) + " " + std::string(random(700), 'x');
  };
  std::vector<std::uint64_t> order(kPeople);
  std::iota(order.begin(), order.end(), 0u);
  for (std::size_t i = order.size() - 1; i > 0; --i) std::swap(order[i], order[random(i + 1)]);
  const Uuid open = session("anna", 2, false);
  session("ben", 3, true);
  {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    ASSERT_OK(transaction);
    for (const std::uint64_t i : order)
      ASSERT_OK(
          db.writer.run("INSERT INTO people (name, role, created_unix_ns, full_name, changed_unix_ns)"
                        " VALUES (?, 1, 1, ?, 1)",
                        nameOf(i), fullNameOf(i)));
    for (std::uint64_t k = 0; k < kPeople; ++k) {
      const std::uint64_t i = random(kPeople);
      ASSERT_OK(db.writer.run("UPDATE people SET full_name = ? WHERE name = ?", fullNameOf(i), nameOf(i)));
    }
    for (std::uint64_t i = 0; i < kPeople; i += 5)
      ASSERT_OK(db.writer.run("DELETE FROM people WHERE name = ?", nameOf(i)));
    ASSERT_OK(transaction->commit());
  }
  const auto left = [&] {
    EXPECT_OK(db.writer.checkpointPassive());
    const auto bytes = readWholeFile(db.path);
    EXPECT_OK(bytes);
    std::size_t found = 0;
    for (std::uint64_t i = 0; i < kPeople; i += 5)
      found += bytes->find(nameOf(i)) != std::string::npos ? 1 : 0;
    return found;
  };
  EXPECT_GT(left(), 0u) << "secure_delete alone leaves names";
  const std::string before = test::dump(db.writer);
  FreeParts parts;
  ASSERT_OK(db.writer.run("UPDATE people SET changed_unix_ns = changed_unix_ns WHERE name = 'anna'"));
  const auto early = parts.clearSome(db.writer, 1000);
  ASSERT_OK(early);
  EXPECT_FALSE(*early) << "the log has pages";
  int pieces = 0;
  for (bool all = false; !all; ++pieces) {
    ASSERT_LT(pieces, 10'000);
    ASSERT_TRUE(*db.writer.emptyLog(0));
    const auto done = parts.clearSome(db.writer, 10);
    ASSERT_OK(done);
    all = *done;
    // commits go on between the pieces
    if (!all)
      ASSERT_OK(db.writer.run("UPDATE people SET changed_unix_ns = changed_unix_ns WHERE name = 'anna'"));
  }
  EXPECT_GT(pieces, 20) << "2000 names with some 350 bytes, ten pages in a piece";
  EXPECT_EQ(left(), 0u);
  EXPECT_TRUE(test::dump(db.writer) == before) << "no row is another";
  // keys and triggers hold again
  EXPECT_FALSE(db.writer.run("INSERT INTO group_members (group_id, person) VALUES ('none', 'nobody')").ok());
  EXPECT_OK(SessionStore(db.writer).append(open, 2, test::chunkOf(2)));
  EXPECT_OK(SessionStore(db.writer).close(test::closeOf(open, 3), 3));
  EXPECT_EQ(SessionStore(db.writer).info(open)->chunks(), 3u);
}

TEST_F(ErasureStoreTest, freePartsAreClearedWithoutRoomInTheLogAndTheDatabaseStaysSound) {
  session("ben", 5, true);
  ASSERT_TRUE(*db.writer.emptyLog(0));
  const auto bytes = std::filesystem::file_size(db.path);
  FreeParts parts;
  const auto done = parts.clearSome(db.writer, 100'000);
  ASSERT_OK(done);
  EXPECT_TRUE(*done);
  EXPECT_EQ(db.writer.walBytes(), 0u);
  EXPECT_EQ(std::filesystem::file_size(db.path), bytes);
  auto row = db.writer.prepare("PRAGMA integrity_check");
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.text(0), "ok");
}

TEST_F(ErasureStoreTest, anErasureIsMarkedUntilTheFreePartsAreCleared) {
  ASSERT_OK(erase("anna"));
  EXPECT_EQ(*MetaStore(db.writer).get(kFreePartsKey), "erased-1234");
}

TEST_F(ErasureStoreTest, whatAStationStillSendsIsAcknowledgedAndNotKept) {
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

TEST_F(ErasureStoreTest, aSessionThatComesAfterTheErasureIsStoredWithoutNameAndEmpty) {
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

TEST_F(ErasureStoreTest, aNewAccountKeepsItsSessionsAlthoughTheClockWasAheadAtTheErasure) {
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

TEST_F(ErasureStoreTest, guestsWhoComeAfterAnErasureOfGuestKeepTheirSessionsWhateverTheClocksSaid) {
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

TEST_F(ErasureStoreTest, whoComesUnderANameThatWasErasedWithoutAnAccountKeepsTheSessionsWhichWait) {
  constexpr std::int64_t kDay = 86'400'000'000'000, kNow = 1'800'000'000'000'000'000;
  SessionStore sessions(db.writer);
  const auto eraseName = [&](const std::string& pseudonym, bool without_account, std::int64_t when) {
    auto of = line("Anna", when);
    of.pseudonym = pseudonym;
    of.without_account = without_account;
    return ErasureStore(db.writer).erase("Anna", of, "ada", "", when);
  };
  const auto deliver = [&](const Uuid& id, std::int64_t started) {
    auto d = test::describe(id);
    d.set_trainee("Anna");
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
    const Uuid taken = session("Anna", 1, true);
    ASSERT_OK(eraseName(pseudonym, true, when));
    for (const std::int64_t started : {kNow + kDay, kNow - kDay}) {
      const Uuid id = makeUuidV7();
      EXPECT_EQ(deliver(id, started), "Anna");
      EXPECT_EQ(sessions.info(id)->chunks(), 1u) << started;
      EXPECT_TRUE(waits(id));
    }
    auto again = test::describe(taken);
    again.set_trainee("Anna");
    ASSERT_OK(sessions.open(again, kNow + kDay));
    EXPECT_EQ(sessions.info(taken)->description().trainee(), pseudonym) << "offered again, it stays away";
    EXPECT_TRUE(ErasureStore(db.writer).toRepeat(db.folder.path())->empty());
  }
  // an erasure of before does not say that nobody had the name: what comes late may be an account's
  ASSERT_OK(eraseName("erased-3", false, kNow + 201 * kDay));
  EXPECT_EQ(deliver(makeUuidV7(), kNow), "erased-3");
  ASSERT_OK(PeopleStore(db.writer).add({"Anna", pb::TRAINEE, "", false, kNow + 202 * kDay}));
  ASSERT_OK(eraseName("erased-4", true, kNow + 203 * kDay));  // added since the line was made
  session("ben", 1, true);
  ASSERT_OK(db.writer.run("UPDATE sessions SET trainee = 'Anna' WHERE trainee = 'ben'"));
  ASSERT_OK(eraseName("erased-5", true, kNow + 204 * kDay));
  EXPECT_EQ(deliver(makeUuidV7(), kNow), "erased-4") << "the account's, also after an erasure of what waited";
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << check->faults.front();
}

TEST_F(ErasureStoreTest, sessionsUnderOtherFormsOfTheNameAreNamed) {
  ASSERT_OK(PeopleStore(db.writer).add({"annabel", pb::TRAINEE, "", false, 1}));
  for (const char* given : {"anna ÖSTLUND-berg", "Anna", "berg", "Berg", "ANNA at station 2", "östlund-berg"})
    (void)session(given, 1, true);
  (void)session("Anna", 1, false);
  (void)session("annabel", 1, true);  // an account's
  (void)session("Carl", 1, true);
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  EXPECT_EQ(erased->sessions(), 0u);
  EXPECT_EQ(erased->text(),
            "Sessions under names that nobody has and that are like this person's stay with their "
            "recordings: 'ANNA at station 2' (1), 'Anna' (2), 'Berg' (1), 'anna ÖSTLUND-berg' (1), 'berg' "
            "(1), 'östlund-berg' (1). "
            "Whose they are a "
            "manager must say: give them to the right person (needlelab-admin session list "
            "--unknown-trainee, session assign), or erase each of these names, too (needlelab-admin person "
            "erase). ");
  EXPECT_EQ(erase("Anna")->sessions(), 2u);
}

TEST_F(ErasureStoreTest, theReplyNamesEveryTableThatStillHasTheLettersOfTheName) {
  constexpr const char* kName = "qzxanna";
  ASSERT_OK(PeopleStore(db.writer).add({kName, pb::ADMINISTRATOR, "h", false, 1}));
  ASSERT_OK(PeopleStore(db.writer).add({"ada", pb::ADMINISTRATOR, "h", false, 1}));
  const Uuid bens = session("Qzxannas Freund", 1, true);
  ASSERT_OK(UnknownTraineeStore(db.writer).assign(bens, "ben", {}, "mia", 3));
  for (const char* sql :
       {"INSERT INTO stations (name, key_hash, created_unix_ns) VALUES ('qzxanna-pc', zeroblob(32), 1)",
        "INSERT INTO meta (key, value) VALUES ('backup_path', '/home/qzxanna/b.db')",
        "INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES ('ben', 1, 1, 'ada', 'as "
        "QZXANNA')"})
    ASSERT_OK(db.writer.run(sql));
  ASSERT_OK(ProfileStore(db.writer).put({"qzxannas-knee", 0, "A knee", "{}", "bea", 1}));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "ada", "station add", "qzxanna-pc", ""}));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "ada", "log-in locked", "person Qzxanna", ""}));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "qzxannas-pc", "chunk contradicts", "x", ""}));
  const auto erased = erase(kName);
  ASSERT_OK(erased);
  EXPECT_EQ(erased->text(),
            "These have the letters of a name of this person, as a part of another word, as a word of the "
            "full name "
            "or as a name that a station gave, and stay as they are; look whom they mean: 3 lines of the "
            "audit log, "
            "such as 1, 2, 3; the notes of 1 consents, such as that of ben; 1 names that stations gave for "
            "sessions "
            "of others, such as Qzxannas Freund; the names of 1 stations, such as qzxanna-pc; the ids of 1 "
            "profiles "
            "and courses, such as qzxannas-knee; 1 facts about this database (meta), such as backup_path. ");
}

TEST_F(ErasureStoreTest, whatARestoreLeftForTheLogLosesThePerson) {
  MetaStore meta(db.writer);
  const auto left = [&](const std::string& text) {
    EXPECT_OK(PeopleStore(db.writer).add({"user", pb::TRAINEE, "", false, 1}));
    EXPECT_OK(meta.set("access_valid_again", text));
    EXPECT_OK(erase("user"));
    EXPECT_OK(db.writer.run("DELETE FROM erasures"));
    return **meta.get("access_valid_again");
  };
  EXPECT_EQ(left("user user: was disabled"), "");
  EXPECT_EQ(left("user anna: was disabled; user user: was disabled; station user: was revoked"),
            "user anna: was disabled; station user: was revoked");
  EXPECT_EQ(left("user users: was disabled"), "user users: was disabled");
}

TEST_F(ErasureStoreTest, nobodyGetsAnErasedPersonsPseudonym) {
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

TEST_F(ErasureStoreTest, theLastAdministratorIsNotErased) {
  ASSERT_OK(PeopleStore(db.writer).add({"ada", pb::ADMINISTRATOR, "h", false, 1}));
  EXPECT_EQ(erase("ada").error().code, ErrorCode::kDenied);
  ASSERT_OK(PeopleStore(db.writer).add({"alf", pb::ADMINISTRATOR, "h", false, 1}));
  EXPECT_OK(erase("ada"));
}

TEST_F(ErasureStoreTest, aDatabaseFromBeforeSaysWhoMustBeErasedAgain) {
  const auto made = line("anna", 77);
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

TEST_F(ErasureStoreTest, theListBesideABackupIsAddedToWithoutLosingALine) {
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

TEST_F(ErasureStoreTest, linesOfTheListAreHeldByAMacOfTheKey) {
  const auto key = PseudonymKey::ofFolder(db.folder.path());
  ASSERT_OK(key);
  const PseudonymKey other(PseudonymKey::Hash{7});
  EXPECT_EQ(key->id().size(), 16u);
  EXPECT_NE(key->id(), other.id());
  ErasureLine made = line("anna", 77);
  EXPECT_EQ(sealOf(made, *key), SealState::kNone);
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
  // programs of before read the first four cells
  const auto text = readWholeFile(db.folder.path() / kErasuresFile);
  ASSERT_OK(text);
  EXPECT_TRUE(
      text->starts_with("erased-1234 " + hexDigitsOf(textOf(made.name_hash)) + " 77 with-waiting key="))
      << *text;
}

TEST_F(ErasureStoreTest, linesThatWereChangedOrAreOfAnotherKeyAreToldAndNotObeyed) {
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
  // another machine's list
  const PseudonymKey other(PseudonymKey::Hash{7});
  ASSERT_OK(writeErasures(db.folder.path(), {sealed({"erased-9abc", other.nameHash("anna"), 77}, other)}));
  EXPECT_TRUE(store.toRepeat(db.folder.path())->empty());
  ASSERT_EQ(faults().size(), 1u);
  EXPECT_NE(faults()[0].find("another pseudonym.key (" + other.id() + ") than the one here (" + key->id()),
            std::string::npos)
      << faults()[0];
}

TEST_F(ErasureStoreTest, aPseudonymIsOneOnlyInTheFormThatErasuresMake) {
  EXPECT_TRUE(isErasurePseudonym("erased-0123456789ab"));
  for (const char* other : {"", "ben", "erased-", "erased-0123456789a", "erased-0123456789abc",
                            "erased-0123456789aB", "erased-0123456789a ", "Erased-0123456789ab"})
    EXPECT_FALSE(isErasurePseudonym(other)) << other;
}

TEST_F(ErasureStoreTest, aLineWhosePseudonymAnAccountHasIsToldAndNotObeyed) {
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

TEST_F(ErasureStoreTest, noListIsWrittenThatCouldNotBeReadAgain) {
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

TEST_F(ErasureStoreTest, theCommandThatShortensAListLeavesThisFoldersLines) {
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

TEST_F(ErasureStoreTest, aLineBesideABackupThatWasChangedIsPutRight) {
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

/// A disk of `bytes` for the log; the database lies on another one.
class SmallDisk {
 public:
  explicit SmallDisk(std::int64_t bytes) : bytes_(bytes) {
    test::ShimVfs::instance().setHook(
        [this](test::ShimVfs::Op op, const std::string& path, std::int64_t offset, int size) {
          if (op != test::ShimVfs::Op::kWrite || !path.ends_with("-wal")) return SQLITE_OK;
          if (offset + size > bytes_) return full_ = true, SQLITE_FULL;
          log_ = std::max(log_.load(), offset + size);
          return SQLITE_OK;
        });
  }
  ~SmallDisk() { test::ShimVfs::instance().setHook({}); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  [[nodiscard]] std::uint64_t left() const { return static_cast<std::uint64_t>(bytes_ - log_); }
  [[nodiscard]] bool wasFull() const { return full_; }

 private:
  std::int64_t bytes_;
  std::atomic<std::int64_t> log_ = 0;
  std::atomic<bool> full_ = false;
};

TEST(ErasureOnAFullDisk, isRefusedAndTheWriterGoesOnWhereverThePersonIsNamed) {
  constexpr std::int64_t kDisk = 56 << 20;
  // 80 MB each: more than the disk and the writer's memory take
  const std::pair<const char*, const char*> places[] = {
      {"remarks",
       "INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
       " SELECT 1, 1, 'anna' || char(10) || printf('%8000s', ''), 'ina', 1 FROM n"},
      {"remarks by the person",
       "INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
       " SELECT 1, 1, printf('%8000s', ''), 'anna', 1 FROM n"},
      {"lines of the audit log",
       "INSERT INTO audit (unix_ns, who, action, subject, detail)"
       " SELECT 1, 'anna', 'settings', 'lab', printf('%8000s', '') FROM n"},
      {"profiles",
       "INSERT INTO profiles (id, revision, name, json, author, created_unix_ns)"
       " SELECT 'p', i + 1, 'P', printf('%8000s', ''), 'anna', 1 FROM n"},
      {"pieces of imports",
       "INSERT INTO import_pieces (import_id, position, records, by_whom, unix_ns)"
       " SELECT 'i', i, printf('%8000s', ''), 'ada', 1 FROM n"},
  };
  for (const auto& [place, fill] : places) {
    SCOPED_TRACE(place);
    test::TestDb db(test::ShimVfs::name());
    ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1}));
    auto d = test::describe(makeUuidV7());
    d.set_trainee("ben");
    ASSERT_OK(SessionStore(db.writer).open(d, 1));
    const std::string sql = fill;
    const std::size_t select = sql.find(" SELECT ");
    ASSERT_OK(
        db.writer.script(sql.substr(0, select) +
                         " WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 9999)" +
                         sql.substr(select)));
    const auto emptied = db.writer.emptyLog(0);
    ASSERT_OK(emptied);
    auto reader = db.reader();
    const auto key = PseudonymKey::ofFolder(db.folder.path());
    ASSERT_OK(key);
    const ErasureLine line{"erased-1234", key->nameHash("anna"), 77};
    const SmallDisk disk(kDisk);
    DbWriter writer(std::move(db.writer), {}, {});
    const auto erase = [&](const ErasureStore::FreeRoom& room) {
      return writer.run([&](Connection& connection) -> Status {
        const auto done = ErasureStore(connection, room).erase("anna", line, "ada", "wish", 77);
        return done ? Status() : Status(done.error());
      });
    };
    const auto refused = erase([&] { return std::optional(disk.left()); });
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom) << refused.error().message;
    EXPECT_THAT(refused.error().message, testing::HasSubstr("make room on it, then erase again"));
    EXPECT_FALSE(disk.wasFull());
    EXPECT_FALSE(writer.failed());
    ASSERT_OK(writer.run([](Connection& connection) {
      return PeopleStore(connection).add({"eve", pb::TRAINEE, "", false, 1});
    }));
    const auto anna = PeopleStore(reader).find("anna"), eve = PeopleStore(reader).find("eve");
    ASSERT_OK(anna);
    ASSERT_OK(eve);
    EXPECT_TRUE(*anna && *eve) << "nothing of the erasure is stored";
  }
}

}  // namespace
}  // namespace needlelab
