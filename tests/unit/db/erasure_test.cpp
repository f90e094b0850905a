#include "db/erasure.h"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "common/base/text.h"
#include "db/audit.h"
#include "db/check.h"
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
#include "tests/unit/db/erasure_fixture.h"

namespace needlelab {
namespace {

using ErasureStoreTest = test::ErasureTest;

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
      "These have the name and stay as they are: what stations wrote about device, patient and exercise in 1 "
      "sessions of others, such as " +
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
  EXPECT_EQ(
      erased->text(),
      "These have the name and stay as they are: revisions of the profile 'knee-of' (nobody can remove "
      "them); what stations wrote about device, patient and exercise in 1 sessions of others, such as " +
          sessionText(bens.session_id()) + ". ");
  // both stations come again after a cut, and one that was away sends what it has
  EXPECT_OK(sessions.open(own, 5));
  EXPECT_OK(sessions.open(bens, 5));
  (void)opened("anna", profile);
  EXPECT_EQ(test::dump(db.writer).find("Wqjvornov"), std::string::npos);
}

// Anybody can type a common word at a station, or the name of somebody else.
TEST_F(ErasureStoreTest, aNameThatSomebodyTypedGoesFromItsOwnSessionsOnlyAndTheRestIsNamed) {
  const Uuid own = session("hand", 2, true), given = session("hand", 1, true), bens = session("ben", 1, true);
  ASSERT_OK(UnknownTraineeStore(db.writer).assign(given, "ben", {}, "mia", 3));
  const auto remark = [&](const Uuid& id, const std::string& text, const std::string& author) {
    ASSERT_OK(AnnotationStore(db.writer).add({0, id, 1, text, author, 1}));
  };
  remark(own, "Hand holds still", "ina");
  remark(bens, "right hand first", "ina");
  remark(bens, "good", "hand");
  pb::Group group;
  group.set_id("hand");
  group.set_name("Hand and needle");
  group.add_members("ben");
  ASSERT_OK(GroupStore(db.writer).put(group, {}, "mia", 1));
  const std::vector<std::string> of_others{"hand|user add|ben|trainee",
                                           "ada|group set|hand|revision 1; joined: hand, ben",
                                           "ada|attempt excuse|" + uuidText(bens) + "|the hand slipped"};
  std::vector<std::string> before = of_others, expected = of_others;
  before.push_back("mia|session assign|" + uuidText(given) + "|from hand to ben: his hand");
  expected.push_back("mia|session assign|" + uuidText(given) + "|from erased-1234 to ben: his hand");
  before.push_back("ina|session export|" + uuidText(own) + "|samples of 'hand'");
  expected.push_back("ina|session export|" + uuidText(own) + "|samples of 'erased-1234'");
  for (const std::string& line : before) {
    std::vector<std::string> cells;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, '|');) cells.push_back(cell);
    ASSERT_OK(AuditStore(db.writer).add({0, 1, cells.at(0), cells.at(1), cells.at(2), cells.at(3)}));
  }
  auto typed = line("hand", 77);
  typed.without_account = true;
  const auto erased = ErasureStore(db.writer).erase("hand", typed, "ada", "", 77);
  ASSERT_OK(erased);
  EXPECT_EQ(erased->sessions(), 1u);
  EXPECT_EQ(AnnotationStore(db.writer).list(own)->front().text, "erased-1234 holds still");
  EXPECT_EQ(AnnotationStore(db.writer).list(bens)->front().text, "right hand first");
  EXPECT_EQ(AnnotationStore(db.writer).list(bens)->back().author, "hand");
  EXPECT_EQ(GroupStore(db.writer).get("hand")->name(), "Hand and needle");
  EXPECT_EQ(auditLines(db.writer), expected);
  EXPECT_EQ(erased->audit_lines(), 2u);
  EXPECT_EQ(
      *db.writer.prepare("SELECT given FROM unknown_trainees WHERE by_whom IS NOT NULL").first(firstText),
      "erased-1234");
  for (const char* left : {"The name was also replaced in: 1 lines of the audit log about others. ",
                           "2 remarks, such as number 2, 3", "the names of 1 groups, such as hand",
                           "4 lines of the audit log, such as 1, 2, 3",
                           "wrote these rows of the database, which keep it: 1 of annotations (author). "})
    EXPECT_THAT(erased->text(), testing::HasSubstr(left));
}

TEST_F(ErasureStoreTest, whoDidSomethingOnTheServerItselfStaysInTheLogWhateverSomebodyTyped) {
  for (const char* name : {"local:root", "server", "guest"}) {
    SCOPED_TRACE(name);
    const Uuid id = session(name, 1, true);
    const std::string line_of_log = std::string(name) + "|user add|ben|trainee";
    ASSERT_OK(AuditStore(db.writer).add({0, 1, name, "user add", "ben", "trainee"}));
    auto typed = line(name, 77);
    typed.without_account = true;
    typed.pseudonym += name;
    ASSERT_OK(ErasureStore(db.writer).erase(name, typed, "ada", "", 77));
    EXPECT_EQ(auditLines(db.writer).back(), line_of_log);
    EXPECT_EQ(SessionStore(db.writer).info(id)->description().trainee(), typed.pseudonym);
  }
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
            "profiles, courses and exercises, such as qzxannas-knee; 1 facts about this database (meta), "
            "such as backup_path. ");
}

TEST_F(ErasureStoreTest, theLastAdministratorIsNotErased) {
  ASSERT_OK(PeopleStore(db.writer).add({"ada", pb::ADMINISTRATOR, "h", false, 1}));
  EXPECT_EQ(erase("ada").error().code, ErrorCode::kDenied);
  ASSERT_OK(PeopleStore(db.writer).add({"alf", pb::ADMINISTRATOR, "h", false, 1}));
  EXPECT_OK(erase("ada"));
}

}  // namespace
}  // namespace needlelab
