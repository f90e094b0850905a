#include "db/erasure/erasure.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "db/audit/audit.h"
#include "db/backup/check.h"
#include "db/people/person_name.h"
#include "db/sessions/session_results.h"
#include "db/sessions/unknown_trainees.h"
#include "db/store/schema.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/erasure/erasure_fixture.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;

class ErasureTest : public test::ErasureTest {
 protected:
  /// All bytes of the files of the database's folder.
  std::string bytesOfFolder() {
    std::string all;
    for (const auto& entry : std::filesystem::directory_iterator(db.folder.path())) {
      std::ifstream in(entry.path(), std::ios::binary);
      all.append(std::istreambuf_iterator<char>(in), {});
    }
    return all;
  }
};

TEST_F(ErasureTest, theNamesGoAndTheIdStays) {
  const Uuid id = session("anna", 5, true), other = session("ben", 3, true);
  ASSERT_OK(ScoreStore(db.writer).put(test::scoreOf(id, "[1]")));
  ASSERT_OK(AnnotationStore(db.writer).add({0, id, 1, "holds still", ben, 1}));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, ben, "assign", anna, "exercise knee-1 for " + anna}));
  const auto erased = erase(anna);
  ASSERT_OK(erased);
  EXPECT_EQ(erased->pseudonym(), "erased person " + anna.substr(1));
  EXPECT_EQ(erased->sessions(), 1u);
  EXPECT_EQ(erased->recordings(), 1u);
  EXPECT_EQ(erased->scores(), 1u);
  EXPECT_EQ(erased->remarks_kept(), 1u);
  EXPECT_THAT(test::dump(db.writer), Not(testing::AnyOf(HasSubstr("'anna'"), HasSubstr("stlund"))));
  EXPECT_EQ(traineeOf(id), anna);
  EXPECT_EQ(nameOf(anna), "erased person " + anna.substr(1));
  EXPECT_EQ(nameOf(ben), "ben");
  EXPECT_EQ(SessionStore(db.writer).info(other)->chunks(), 3u);
  for (;;) {
    const auto more = RetentionStore(db.writer).removeSome(id, 2);
    ASSERT_OK(more);
    if (!*more) break;
  }
  const auto check = checkDatabase(db.writer);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << check->faults.front();
  EXPECT_EQ(erase(anna).error().code, ErrorCode::kNotFound);
}

// SQLite leaves behind what it moves within a page; 400 names, some of which were added, removed and changed.
TEST_F(ErasureTest, noByteOfAnErasedNameIsLeftInTheFiles) {
  if (test::onPostgres()) return;  // deploy/FACULTY.md describes what remains there, and for how long
  PeopleStore people(db.writer);
  std::vector<std::string> refs(400);
  for (std::size_t i = 0; i < refs.size(); ++i)
    ASSERT_OK(people.add({"quincyname" + std::to_string(i), pb::TRAINEE, "", false, 1,
                          std::string(i % 37, 'x') + "Fullname" + std::to_string(i)},
                         &refs[i]));
  for (std::size_t i = 0; i < refs.size(); i += 3)
    ASSERT_OK(people.change(refs[i], {}, {.full_name = "Otherfullname" + std::to_string(i)}, "@1", 2));
  for (std::size_t i = 0; i < refs.size(); i += 2)
    ASSERT_OK(people.change(refs[i], {}, {.name = "renamed" + std::to_string(i)}, "@1", 2));
  session("quincyname11", 1, true);
  session("typedalone", 1, true);
  const auto typed = findPerson(db.writer, "typedalone", Named::kAccountOrTyped);
  for (const std::string& ref : refs) ASSERT_OK(erase(ref));
  ASSERT_OK(erase(**typed));
  ASSERT_TRUE(*db.writer.emptyLog(0));
  const std::string bytes = bytesOfFolder();
  for (const char* word : {"quincyname", "ullname", "renamed", "typedalone", "Otherfull"})
    EXPECT_EQ(bytes.find(word), std::string::npos) << word;
  EXPECT_NE(bytes.find("ben"), std::string::npos);
}

TEST_F(ErasureTest, whatOnlyAnAccountHasGoes) {
  pb::Group group;
  group.set_id("a");
  group.set_name("a");
  group.add_members(anna);
  group.add_members(ben);
  ASSERT_OK(GroupStore(db.writer).put(group, {}, "@9", 1));
  ASSERT_OK(ConsentStore(db.writer).add(anna, {}));
  ASSERT_OK(PeopleStore(db.writer).setCodeHash(anna, "$code"));
  ASSERT_OK(erase(anna));
  EXPECT_THAT(GroupStore(db.writer).get("a")->members(), testing::ElementsAre(ben));
  EXPECT_FALSE(*ConsentStore(db.writer).newest(anna));
  EXPECT_FALSE(*PeopleStore(db.writer).find(anna));
  auto row = db.writer.query("SELECT code_hash IS NULL, disabled FROM people WHERE ref = ?", anna);
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.integer(0), 1);
  EXPECT_EQ(row.integer(1), 1);
}

TEST_F(ErasureTest, sessionsStayWithoutANameWhereTheLabKeepsThem) {
  ASSERT_OK(LabSettingsStore(db.writer).setKeepsRecordingsOfErased(true));
  const std::string outer = **outerRef(db.writer, anna);
  const Uuid kept = session("anna", 3, true);
  const auto done = erase(anna);
  ASSERT_TRUE(done.ok());
  EXPECT_EQ(done->sessions(), 0u);
  EXPECT_EQ(done->waiting_sessions(), 0u) << "they are no longer anybody's, and wait for nobody";
  EXPECT_THAT(done->text(), testing::HasSubstr("stay, as of " + erasedName(anna)));
  const auto info = SessionStore(db.writer).info(kept);
  EXPECT_EQ(info->chunks(), 3u);
  EXPECT_EQ(nameOf(info->description().trainee()), erasedName(anna));
  EXPECT_THAT(test::dump(db.writer), testing::Not(testing::HasSubstr("Östlund")));
  // a late one is stored in the same way
  const Uuid late = session(outer, 2, true);
  EXPECT_EQ(traineeOf(late), anna);
  EXPECT_FALSE(waits(late));
  EXPECT_EQ(SessionStore(db.writer).info(late)->chunks(), 2u);
  ASSERT_OK(LabSettingsStore(db.writer).setKeepsRecordingsOfErased(false));
  session("ben", 3, true);
  EXPECT_EQ(erase(ben)->sessions(), 1u);
}

TEST_F(ErasureTest, anIdIsNeverUsedAgain) {
  ASSERT_OK(erase(ben));
  std::string next;
  ASSERT_OK(PeopleStore(db.writer).add({"ben", pb::TRAINEE, "", false, 1}, &next));
  EXPECT_EQ(std::stoi(next.substr(1)), std::stoi(ben.substr(1)) + 1);
  EXPECT_EQ(nameOf(next), "ben");
}

TEST_F(ErasureTest, aLateSessionUnderATypedNameWaitsDespiteANamesake) {
  ASSERT_OK(erase(anna));
  std::string namesake;
  ASSERT_OK(PeopleStore(db.writer).add({"Anna", pb::TRAINEE, "", false, 1}, &namesake));
  const auto opened = [&](std::int64_t now_ns, std::int64_t started_ns = kNow_ns - 1) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee("ANNA");
    d.set_started_unix_ns(started_ns);
    EXPECT_OK(SessionStore(db.writer).open(d, now_ns));
    return id;
  };
  const Uuid late = opened(kNow_ns + 1);
  EXPECT_TRUE(waits(late));
  EXPECT_NE(traineeOf(late), namesake);
  EXPECT_EQ(nameOf(traineeOf(late)), "ANNA");
  ASSERT_OK(SessionStore(db.writer).close(test::closeOf(late, 0), 2));
  ASSERT_OK(UnknownTraineeStore(db.writer).assign(late, namesake, "ANNA", "@9", 3));
  EXPECT_EQ(traineeOf(late), namesake) << "a manager clears a namesake";
  const Uuid own = opened(kNow_ns + 2, kNow_ns + 1);
  EXPECT_FALSE(waits(own)) << "it began after the erasure";
  EXPECT_EQ(traineeOf(own), namesake);
  const Uuid long_after = opened(kNow_ns + kErasedNamesKept_ns + 1);
  EXPECT_FALSE(waits(long_after));
  EXPECT_EQ(traineeOf(long_after), namesake);
}

TEST_F(ErasureTest, aLateSessionUnderAnErasedIdStaysEmpty) {
  const std::string outer = **outerRef(db.writer, anna);
  ASSERT_OK(erase(anna));
  const Uuid id = makeUuidV7();
  auto d = test::describe(id);
  d.set_trainee(outer);
  ASSERT_OK(SessionStore(db.writer).open(d, kNow_ns + 1));
  EXPECT_EQ(traineeOf(id), anna);
  const auto chunk = SessionStore(db.writer).append(id, 0, test::chunkOf(0));
  ASSERT_OK(chunk);
  EXPECT_EQ(chunk->kind, Appended::Kind::kRepeated) << "acknowledged, and not kept";
  EXPECT_EQ(SessionStore(db.writer).info(id)->samples(), 0u);
}

TEST_F(ErasureTest, anIdsSessionWaitsForTheCodeLikeANames) {
  const std::string outer = **outerRef(db.writer, anna);
  const auto opened = [&](bool checked) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee(outer);
    d.set_code_checked(checked);
    EXPECT_OK(SessionStore(db.writer).open(d, kNow_ns));
    EXPECT_EQ(traineeOf(id), anna);
    return id;
  };
  EXPECT_FALSE(waits(opened(false))) << "there is no code";
  ASSERT_OK(PeopleStore(db.writer).setCodeHash(anna, "$code"));
  EXPECT_TRUE(waits(opened(false)));
  EXPECT_FALSE(waits(opened(true)));
}

TEST_F(ErasureTest, anUnknownIdsSessionWaitsOrIsErasedAfterARestore) {
  const Uuid unknown = makeUuidV7(), gone = makeUuidV7();
  const auto lab = parseUuid(**MetaStore(db.writer).get(kLabKey));
  const std::vector<ErasureLine> lines{{*lab, gone, 5}};
  ASSERT_OK(ErasureStore(db.writer).repeat(lines, kNow_ns));
  const auto open = [&](const Uuid& person) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee("@" + uuidText(person));
    EXPECT_OK(SessionStore(db.writer).open(d, kNow_ns));
    EXPECT_OK(SessionStore(db.writer).open(d, kNow_ns));
    return id;
  };
  const Uuid waiting = open(unknown), erased = open(gone);
  EXPECT_TRUE(waits(waiting));
  EXPECT_THAT(nameOf(traineeOf(waiting)), testing::StartsWith("unknown "));
  EXPECT_FALSE(waits(erased));
  EXPECT_THAT(nameOf(traineeOf(erased)), testing::StartsWith("erased person "));
}

TEST_F(ErasureTest, sessionsThatWaitForACodeStayUnlessTheyAreWanted) {
  ASSERT_OK(LabSettingsStore(db.writer).setCodesRequired(true));
  const Uuid waiting = session("anna", 2, true);
  EXPECT_TRUE(waits(waiting));
  const auto erased = erase(anna);
  ASSERT_OK(erased);
  EXPECT_EQ(erased->sessions(), 0u);
  EXPECT_EQ(erased->waiting_sessions(), 1u);
  EXPECT_EQ(SessionStore(db.writer).info(waiting)->chunks(), 2u);
  const Uuid of_ben = session("ben", 2, true);
  ASSERT_OK(erase(ben, true));
  EXPECT_FALSE(waits(of_ben));
  EXPECT_EQ(SessionStore(db.writer).info(of_ben)->removed_original().fate(), pb::RemovedOriginal::DELETED);
}

TEST_F(ErasureTest, aMisspeltNameGoesWithThePersonWhoseSessionsItHas) {
  const Uuid misspelt = session("Anna Ostlund", 1, true), shared = session("somebody", 1, true),
             of_ben = session("somebody", 1, true);
  UnknownTraineeStore waiting(db.writer);
  ASSERT_OK(waiting.assign(misspelt, anna, {}, "@9", 3));
  ASSERT_OK(waiting.assign(shared, anna, {}, "@9", 3));
  ASSERT_OK(waiting.assign(of_ben, ben, {}, "@9", 3));
  ASSERT_OK(erase(anna));
  const std::string all = test::dump(db.writer);
  EXPECT_THAT(all, Not(HasSubstr("Anna Ostlund")));
  EXPECT_THAT(all, HasSubstr("somebody")) << "it names ben's session, too";
}

TEST_F(ErasureTest, theErasureListErasesPeopleInARestoredBackupAgain) {
  const auto line = ErasureStore(db.writer).lineOf(anna, 7);
  ASSERT_OK(line);
  const std::vector<ErasureLine> lines{*line,
                                       {makeUuidV7(), ErasureStore(db.writer).lineOf(ben, 7)->person, 7}};
  EXPECT_TRUE(*ErasureStore(db.writer).isAnyBack(lines));
  const auto repeated = ErasureStore(db.writer).repeat(lines, kNow_ns);
  ASSERT_OK(repeated);
  EXPECT_EQ(*repeated, 1u);
  EXPECT_FALSE(*ErasureStore(db.writer).isAnyBack(lines)) << "ben's line is of another lab";
  EXPECT_EQ(nameOf(ben), "ben") << "the line of another lab";
  EXPECT_THAT(nameOf(anna), HasSubstr("erased"));
  EXPECT_EQ(*ErasureStore(db.writer).repeat(lines, kNow_ns), 0u) << "once";
}

TEST_F(ErasureTest, theLastAdministratorStays) {
  std::string ada;
  ASSERT_OK(PeopleStore(db.writer).add({"ada", pb::ADMINISTRATOR, "$hash", false, 1}, &ada));
  EXPECT_EQ(erase(ada).error().code, ErrorCode::kDenied);
  EXPECT_EQ(nameOf(ada), "ada");
}

TEST_F(ErasureTest, openSessionsAreNamed) {
  const Uuid open = session("anna", 1, false);
  session("anna", 1, true);
  EXPECT_THAT(*ErasureStore(db.writer).openSessions(anna),
              testing::ElementsAre(uuidText(open) + " at station 'station-1'"));
}

}  // namespace
}  // namespace needlelab
