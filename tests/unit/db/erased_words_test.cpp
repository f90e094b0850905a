// What an erasure leaves of names in texts that stations and people wrote: in descriptions of sessions, and
// in each column of the schema.
#include <gmock/gmock.h>

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "db/audit.h"
#include "db/documents.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/session_rows.h"
#include "db/session_words.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/erasure_fixture.h"

namespace needlelab {
namespace {

class ErasedWordsTest : public test::ErasureTest {
 protected:
  /// A session of `trainee` in which the station wrote `word` into every text that it may.
  static pb::SessionDescription describeWith(const std::string& trainee, const std::string& word) {
    auto d = test::describe(makeUuidV7());
    d.set_trainee(trainee);
    d.set_exercise_id("for-" + word);
    d.set_profile_id(word + "-left-shoulder");
    d.set_profile_revision(0);
    d.set_profile_json(R"({"name":")" + word + R"("})");
    d.set_engine_version("0.1 " + word);
    d.set_device(word + "'s device");
    d.set_axial_model(word);
    d.add_live_effects(word);
    d.add_device_notes(word);
    hide(word, d);
    hide(word, *d.mutable_resolution());
    return d;
  }
  /// Adds a field that this version does not know.
  static void hide(const std::string& word, google::protobuf::Message& message) {
    constexpr int kUnknownField = 99;
    message.GetReflection()->MutableUnknownFields(&message)->AddLengthDelimited(kUnknownField, word);
  }
  pb::SessionDescription stored(const pb::SessionDescription& given) {
    auto row = db.writer.query(
        "SELECT description, exercise_id, profile_id, engine_version FROM sessions WHERE id = ?",
        viewOf(given.session_id()));
    EXPECT_TRUE(*row.step());
    pb::SessionDescription d;
    EXPECT_TRUE(d.ParseFromString(row.text(0)));
    EXPECT_EQ(row.text(1), d.exercise_id());
    EXPECT_EQ(row.text(2), d.profile_id());
    EXPECT_EQ(row.text(3), d.engine_version());
    return d;
  }
  /// "TABLE.COLUMN" of all columns that may have texts.
  std::set<std::string> columns() {
    const auto all =
        db.writer
            .prepare(
                "SELECT m.name || '.' || c.name FROM sqlite_schema m, pragma_table_info(m.name) c"
                " WHERE m.type = 'table' AND m.name NOT LIKE 'sqlite_%'"
                " AND c.type NOT IN ('INTEGER', 'REAL')")
            .all(firstText);
    EXPECT_OK(all);
    return {all->begin(), all->end()};
  }
  /// Those of them in which `word` stands.
  std::set<std::string> columnsWith(const std::string& word) {
    std::set<std::string> found;
    for (const std::string& one : columns()) {
      const std::size_t dot = one.find('.');
      auto rows = db.writer.query("SELECT 1 FROM " + one.substr(0, dot) + " WHERE instr(CAST(" +
                                      one.substr(dot + 1) + " AS BLOB), CAST(?1 AS BLOB)) > 0",
                                  word);
      if (*rows.step()) found.insert(one);
    }
    return found;
  }
  /// Puts `word` into each NAME of these statements.
  void runAll(const std::vector<std::string>& statements, const std::string& word) {
    for (std::string sql : statements) {
      for (std::size_t at = 0; (at = sql.find("NAME", at)) != std::string::npos; at += word.size())
        sql.replace(at, 4, word);
      const Status done = db.writer.run(sql);
      ASSERT_TRUE(done.ok()) << sql << ": " << done.error().message;
    }
  }
};

TEST_F(ErasedWordsTest, nothingThatAStationWroteIsLeftInSessionsOfThePerson) {
  const auto d = describeWith("anna", "anna");
  ASSERT_OK(SessionStore(db.writer).open(d, 1));
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  EXPECT_EQ(erased->text(), "");
  const auto left = stored(d);
  EXPECT_EQ(left.exercise_id(), "for-erased-1234");
  EXPECT_EQ(left.profile_id(), "erased-1234-left-shoulder");
  EXPECT_EQ(left.engine_version(), "0.1 erased-1234");
  EXPECT_EQ(left.rate_hz(), d.rate_hz());
  EXPECT_EQ(left.resolution().length_m(), d.resolution().length_m());
  EXPECT_EQ(columnsWith("anna"), std::set<std::string>());
  // the station comes again after a cut
  EXPECT_OK(SessionStore(db.writer).open(d, 5));
}

TEST_F(ErasedWordsTest, idsInWhichTheNameIsNoWordOrThatWouldBeTooLongBecomeThePseudonym) {
  auto d = describeWith("anna", "x");
  d.set_profile_id("Annasknie");
  d.set_exercise_id("anna-anna-anna-anna-anna-anna-anna-anna");
  d.set_engine_version("berg 2");  // a word of the full name
  ASSERT_OK(SessionStore(db.writer).open(d, 1));
  ASSERT_OK(erase("anna"));
  EXPECT_EQ(stored(d).profile_id(), "erased-1234");
  EXPECT_EQ(stored(d).exercise_id(), "erased-1234");
  EXPECT_EQ(stored(d).engine_version(), "erased-1234");
}

TEST_F(ErasedWordsTest, idsOfStoredProfilesAndExercisesStayAndAreNamed) {
  ASSERT_OK(ProfileStore(db.writer).put({"anna-knee", 0, "A knee", "{}", "bea", 1}));
  ASSERT_OK(CurriculumStore(db.writer).put(
      {"course", 0, "A course", "{}", "bea", 1, {{"anna-1", "", "One", "anna-knee", "{}"}}}));
  auto d = describeWith("anna", "x");
  d.set_profile_id("anna-knee");
  d.set_exercise_id("anna-1");
  ASSERT_OK(SessionStore(db.writer).open(d, 1));
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  EXPECT_EQ(stored(d).profile_id(), "anna-knee");
  EXPECT_EQ(stored(d).exercise_id(), "anna-1");
  for (const std::string& named :
       {std::string("the ids of 2 profiles, courses and exercises, such as anna-1, anna-knee"),
        "what stations wrote with 1 sessions, such as " + sessionText(d.session_id())})
    EXPECT_THAT(erased->text(), testing::HasSubstr(named));
}

TEST_F(ErasedWordsTest, ofASessionThatComesLaterOnlyIdsOfStoredDocumentsAndTheVersionAreStored) {
  ASSERT_OK(ProfileStore(db.writer).put({"knee", 0, "A knee", "{}", "bea", 1}));
  ASSERT_OK(erase("anna"));
  SessionStore sessions(db.writer);
  // the server has forgotten the full name
  for (const char* word : {"anna", "berg"}) {
    const auto d = describeWith("anna", word);
    ASSERT_OK(sessions.open(d, 5));
    EXPECT_EQ(stored(d).exercise_id(), "erased-1234");
    EXPECT_EQ(stored(d).profile_id(), "erased-1234");
    EXPECT_EQ(stored(d).engine_version(), "erased-1234");
    EXPECT_EQ(columnsWith(word), std::set<std::string>());
    EXPECT_OK(sessions.open(d, 6));
  }
  auto d = describeWith("anna", "anna");
  d.set_exercise_id("");
  d.set_profile_id("knee");
  d.set_engine_version("0.1.0");
  ASSERT_OK(sessions.open(d, 7));
  EXPECT_EQ(stored(d).exercise_id(), "");
  EXPECT_EQ(stored(d).profile_id(), "knee");
  EXPECT_EQ(stored(d).engine_version(), "0.1.0");
}

TEST_F(ErasedWordsTest, fieldsThatNobodyKnowsAreNotStoredAndMakeNoOtherDescription) {
  SessionStore sessions(db.writer);
  auto d = describeWith("ben", "x");
  hide("hidden", d);
  hide("hidden", *d.mutable_resolution());
  ASSERT_OK(sessions.open(d, 1));
  EXPECT_EQ(columnsWith("hidden"), std::set<std::string>());
  EXPECT_OK(sessions.open(d, 2));
  d.set_device("another one");
  EXPECT_EQ(sessions.open(d, 4).error().code, ErrorCode::kAlreadyExists);
}

TEST_F(ErasedWordsTest, theReplyNamesSessionsOfOthersByEachTextOfTheirDescriptions) {
  SessionStore sessions(db.writer);
  const auto opened = [&](const auto& change) {
    auto d = test::describe(makeUuidV7());
    d.set_trainee("ben");
    change(d);
    EXPECT_OK(sessions.open(d, 1));
    return d;
  };
  const auto whole = [&](const auto& change) {
    const auto d = opened(change);
    const auto erased = erase("anna");
    EXPECT_OK(erased);
    EXPECT_THAT(erased->text(), testing::HasSubstr("exercise in 1 sessions of others, such as " +
                                                   sessionText(d.session_id())));
    EXPECT_OK(db.writer.run("DELETE FROM session_progress"));
    EXPECT_OK(db.writer.run("DELETE FROM sessions"));
    EXPECT_OK(db.writer.run("DELETE FROM erasures"));
    EXPECT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1, "Anna Östlund-Berg"}));
  };
  whole([](pb::SessionDescription& d) { d.set_exercise_id("for anna"); });
  whole([](pb::SessionDescription& d) { d.set_profile_id("Anna-knee"); });
  whole([](pb::SessionDescription& d) { d.set_engine_version("0.1 anna"); });
  whole([](pb::SessionDescription& d) { d.add_live_effects("x, anna"); });
  whole([](pb::SessionDescription& d) { d.add_device_notes("of Anna Östlund-Berg"); });
  // only its letters, and what somebody put into the database
  const auto letters = opened([](pb::SessionDescription& d) { d.set_profile_id("annabel"); });
  auto hidden = opened([](pb::SessionDescription&) {});
  hidden.clear_profile_json();
  hide("anna", hidden);
  ASSERT_OK(db.writer.run("UPDATE sessions SET description = ? WHERE id = ?",
                          viewOf(hidden.SerializeAsString()), viewOf(hidden.session_id())));
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  EXPECT_THAT(erased->text(), testing::HasSubstr("exercise in 1 sessions of others, such as " +
                                                 sessionText(hidden.session_id()) + ". "));
  EXPECT_THAT(erased->text(), testing::HasSubstr("what stations wrote with 1 sessions, such as " +
                                                 sessionText(letters.session_id()) + ". "));
}

// The finding: who worked on the server itself was neither replaced nor named.
TEST_F(ErasedWordsTest, theReplyNamesOtherFormsOfTheNameInWhoDidSomething) {
  (void)session("ben", 1, true);
  ASSERT_OK(AuditStore(db.writer).add({0, 1, "zoe", "said", "x", "y"}));
  runAll({"UPDATE audit SET detail = 'NAMEs'",
          "INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
          " SELECT number, 1, 'good', 'local:NAME', 1 FROM sessions",
          "INSERT INTO profiles VALUES ('knee', 1, 'A knee', '{}', 'local:NAME', 1),"
          " ('knee', 2, 'A knee', '{}', 'local:NAME', 1)",
          "INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES ('ben', 1, 1, 'NAME', '')",
          "INSERT INTO retention_policies (exercise_id, by_whom, changed_unix_ns)"
          " VALUES ('', 'NAME Östlund-Berg', 1)"},
         "ANNA");
  const auto erased = erase("anna");
  ASSERT_OK(erased);
  for (const char* named : {"1 remarks, such as number 1", "1 lines of the audit log, such as 1",
                            "'local:ANNA' in 2 of profiles (author)", "'ANNA' in 1 of consents (recorded_by)",
                            "'ANNA Östlund-Berg' in 1 of retention_policies (by_whom)"})
    EXPECT_THAT(erased->text(), testing::HasSubstr(named));
}

/// Columns in which nobody writes a name: hashes and keys, ids that are made by chance, and the server's own
/// words. Recordings (`bytes`) of the person are removed.
const std::set<std::string> kColumnsWithoutNames{"access_numbers.how",
                                                 "access_numbers.server",
                                                 "audit.action",
                                                 "audit_chain.commitment",
                                                 "audit_chain.key_id",
                                                 "audit_chain.mac",
                                                 "audit_chain.salt",
                                                 "chunks.bytes",
                                                 "derived_chunks.bytes",
                                                 "derived_recordings.hash",
                                                 "derived_recordings.method",
                                                 "derived_recordings.original_hash",
                                                 "erasures.name_hash",
                                                 "erasures.pseudonym",
                                                 "exercise_references.sessions",
                                                 "login_attempts.key",
                                                 "login_tokens.hash",
                                                 "meta.key",
                                                 "noted_reads.key",
                                                 "people.code_hash",
                                                 "people.password_hash",
                                                 "quarantined_chunks.reason",
                                                 "removed_originals.crcs",
                                                 "scores.engine_version",
                                                 "sessions.hash",
                                                 "sessions.id",
                                                 "station_claims.server",
                                                 "stations.key_hash"};

// A column that somebody adds to the schema fails this test until it is planted here or listed above.
TEST_F(ErasedWordsTest, eachColumnOfTheSchemaLosesTheNameOrTheReplyNamesItsPlace) {
  // what goes
  const std::string gone = "qzxanna";
  ASSERT_OK(PeopleStore(db.writer).add({gone, pb::TRAINEE, "", false, 1, gone + " Wqjvornov"}));
  (void)session("ben", 1, true);
  const auto own = describeWith(gone, gone);
  ASSERT_OK(SessionStore(db.writer).open(own, 1));
  ASSERT_OK(SessionStore(db.writer).close(test::closeOf(*uuidOf(own.session_id()), 0), 2));
  ASSERT_OK(AuditStore(db.writer).add({0, 1, gone, "consent", gone, "given by " + gone}));
  runAll({"UPDATE people SET changed_by = 'NAME' WHERE name = 'ben'",
          "UPDATE sessions SET score_json = '[\"NAME\"]' WHERE trainee = 'NAME'",
          "INSERT INTO scores (session, definition_version, measures, first, engine_version, made_unix_ns)"
          " SELECT number, 1, '[\"NAME\"]', 1, '0.1.0', 1 FROM sessions WHERE trainee = 'NAME'",
          "INSERT INTO session_events SELECT number, 0, 1, 0, 1, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0, 'NAME', 0, 0,"
          " 'NAME', 0, 'NAME', 0, 0, 0, 0, 'NAME', 0, 0, 'NAME', 0, 'NAME', 'NAME'"
          " FROM sessions WHERE trainee = 'NAME'",
          "INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
          " SELECT number, 1, 'as NAME did', 'NAME', 1 FROM sessions WHERE trainee = 'ben'",
          "INSERT INTO removed_originals (session, removed_unix_ns, reason, by_whom, leftover, crcs)"
          " SELECT number, 1, 'deleted: policy of all other exercises, set by NAME', 'NAME', 0, zeroblob(0)"
          " FROM sessions WHERE trainee = 'ben'",
          "INSERT INTO retention_policies (exercise_id, by_whom, changed_unix_ns) VALUES ('', 'NAME', 1)",
          "INSERT INTO exercise_references VALUES ('knee-1', 1, '[]', 'NAME', 1)",
          "INSERT INTO erasures VALUES ('erased-0', zeroblob(32), 1, 'NAME', '')",
          "INSERT INTO profiles VALUES ('knee', 1, 'A knee', '{}', 'NAME', 1)",
          "INSERT INTO curricula VALUES ('course', 1, 'A course', '{}', 'NAME', 1)",
          "INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns)"
          " VALUES ('friends', 'Friends of NAME', 1, 'NAME', 1)",
          "INSERT INTO group_members VALUES ('friends', 'NAME')",
          "INSERT INTO assignments (exercise_id, trainee, by_whom, created_unix_ns)"
          " VALUES ('knee-1', 'NAME', 'ada', 1), ('knee-1', 'ben', 'NAME', 1)",
          "INSERT INTO consents (person, given, unix_ns, recorded_by, note)"
          " VALUES ('NAME', 1, 1, 'ada', 'as NAME said'), ('ben', 1, 1, 'NAME', '')",
          "INSERT INTO unknown_trainees (session, given, by_whom, assigned_unix_ns)"
          " SELECT number, 'NAME', 'NAME', 3 FROM sessions WHERE trainee = 'ben'",
          "UPDATE people SET password_hash = 'hash' WHERE name = 'NAME'",
          "INSERT INTO login_tokens VALUES (zeroblob(32), 'NAME', 1, 1, 1, 1, 1)"},
         gone);
  std::set<std::string> planted = columnsWith(gone);
  const auto erased = ErasureStore(db.writer).erase(gone, line(gone, 77), "ada", gone + "'s wish", 77);
  ASSERT_OK(erased);
  EXPECT_EQ(columnsWith(gone), std::set<std::string>());
  EXPECT_EQ(columnsWith("Wqjvornov"), std::set<std::string>());
  EXPECT_THAT(erased->text(), testing::Not(testing::HasSubstr("stay as they are")));

  // what stays and is named
  const std::string left = "qzxcarl";
  ASSERT_OK(PeopleStore(db.writer).add({left, pb::TRAINEE, "", false, 1}));
  runAll({"INSERT INTO stations (name, key_hash, created_unix_ns) VALUES ('NAME-pc', zeroblob(32), 1)"},
         left);
  auto bens = describeWith("ben", left);
  bens.set_station(left + "-pc");
  ASSERT_OK(SessionStore(db.writer).open(bens, 1));
  (void)session(left + "s friend", 0, true);
  ASSERT_OK(AuditStore(db.writer).add({0, 1, left + "s", "server start", left + "s", left + "s"}));
  runAll(
      {"INSERT INTO annotations (session, tick, text, author, created_unix_ns)"
       " SELECT number, 1, 'NAMEs hand', 'ina', 1 FROM sessions WHERE trainee = 'ben' LIMIT 1",
       "UPDATE removed_originals SET reason = 'policy of exercise NAMEs, set by ada'"
       " WHERE session = (SELECT min(number) FROM sessions WHERE trainee = 'ben')",
       "INSERT INTO retention_policies (exercise_id, by_whom, changed_unix_ns) VALUES ('NAME-1', 'ada', 1)",
       "INSERT INTO exercise_references VALUES ('NAME-1', 1, '[]', 'ada', 1)",
       "INSERT INTO station_claims VALUES ('NAME-pc', 1, 'first', 1)",
       "INSERT INTO erasures VALUES ('erased-1', zeroblob(32), 1, 'ada', 'NAMEs wish')",
       "INSERT INTO profiles VALUES ('NAME-p', 1, 'NAME', '{\"name\":\"NAME\"}', 'ada', 1)",
       "INSERT INTO curricula VALUES ('NAME-c', 1, 'NAME', '{\"name\":\"NAME\"}', 'ada', 1)",
       "INSERT INTO exercises VALUES ('NAME-1', 'NAME-c', 0, 'NAME', 'NAME-p', '{\"name\":\"NAME\"}')",
       "INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns)"
       " VALUES ('NAME-g', 'NAMEs friends', 1, 'ada', 1)",
       "INSERT INTO group_members VALUES ('NAME-g', 'ben')",
       "INSERT INTO assignments (exercise_id, group_id, by_whom, created_unix_ns)"
       " VALUES ('NAME-1', 'NAME-g', 'ada', 1)",
       "INSERT INTO assignments (course_id, group_id, by_whom, created_unix_ns)"
       " VALUES ('NAME-c', 'NAME-g', 'ada', 1)",
       "INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES ('ben', 1, 1, 'ada', 'NAME')",
       "UPDATE unknown_trainees SET given = 'NAMEs' WHERE by_whom IS NOT NULL",
       "INSERT INTO meta (key, value) VALUES ('backup_path', '/home/NAME/b.db')"},
      left);
  const auto also_planted = columnsWith(left);
  planted.insert(also_planted.begin(), also_planted.end());
  auto other_line = line(left, 78);
  other_line.pseudonym = "erased-5678";
  const auto named = ErasureStore(db.writer).erase(left, other_line, "ada", "", 78);
  ASSERT_OK(named);
  const std::string of_group = "the id of the group 'qzxcarl-g'",
                    of_profile = "revisions of the profile 'qzxcarl-p'",
                    of_course = "revisions of the course 'qzxcarl-c'",
                    of_ids =
                        "the ids of 3 profiles, courses and exercises, such as qzxcarl-1, qzxcarl-c, "
                        "qzxcarl-p",
                    of_log = "1 lines of the audit log", of_station = "the names of 1 stations",
                    of_words = "exercise in 1 sessions of others, such as " + sessionText(bens.session_id());
  const std::vector<std::pair<std::string, std::string>> places{
      {"annotations.text", "1 remarks, such as number"},
      {"assignments.course_id", of_ids},
      {"assignments.exercise_id", of_ids},
      {"assignments.group_id", of_group},
      // as the sessions that they sum up
      {"attempt_sums.exercise_id", of_words},
      {"attempt_sums.trainee", "like this person's stay with their recordings: 'qzxcarls friend' (1)"},
      {"audit.detail", of_log},
      {"audit.subject", of_log},
      {"audit.who", of_log},
      {"consents.note", "the notes of 1 consents"},
      {"curricula.id", of_ids},
      {"curricula.json", of_course},
      {"curricula.name", of_course},
      {"erasures.reason", "the reasons of 1 erasures, such as erased-1"},
      {"exercise_references.exercise_id", of_ids},
      {"exercises.curriculum_id", of_ids},
      {"exercises.id", of_ids},
      {"exercises.json", of_course},
      {"exercises.name", of_course},
      {"exercises.profile_id", of_ids},
      {"group_members.group_id", of_group},
      {"groups.id", of_group},
      {"groups.name", "the names of 1 groups, such as qzxcarl-g"},
      {"meta.value", "1 facts about this database (meta), such as backup_path"},
      {"profiles.id", of_ids},
      {"profiles.json", of_profile},
      {"profiles.name", of_profile},
      {"removed_originals.reason", "the reasons of 1 removed recordings, such as that of session "},
      {"retention_policies.exercise_id", of_ids},
      {"sessions.description", of_words},
      {"sessions.engine_version", of_words},
      {"sessions.exercise_id", of_words},
      {"sessions.profile_id", of_words},
      {"sessions.profile_json", of_words},
      {"sessions.station", of_station},
      {"sessions.trainee", "like this person's stay with their recordings: 'qzxcarls friend' (1)"},
      {"station_claims.station", of_station},
      {"stations.name", of_station},
      {"unknown_trainees.given", "names that stations gave for sessions of others, such as qzxcarls"},
  };
  std::set<std::string> expected;
  for (const auto& [column, said] : places) {
    expected.insert(column);
    EXPECT_THAT(named->text(), testing::HasSubstr(said)) << column;
  }
  EXPECT_EQ(columnsWith(left), expected);

  // each column has been tried, or never has a name
  std::set<std::string> known = kColumnsWithoutNames;
  for (const std::string& column : planted)
    EXPECT_TRUE(known.insert(column).second) << column << " has names";
  EXPECT_EQ(columns(), known);
}

}  // namespace
}  // namespace needlelab
