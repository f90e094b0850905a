// Records of any shape are imported or refused without a crash; each log line is imported once.
#include <fmt/core.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/base/files.h"
#include "common/scoring/measures.h"
#include "db/audit_chain.h"
#include "db/retention_store.h"
#include "db/service/audit_anchor.h"
#include "tests/unit/db/service/records_fixture.h"

namespace needlelab {
namespace {

using Import = test::RecordsTest;
using RecordJson = nlohmann::ordered_json;

TEST_F(Import, refusesRecordsOfAnyShapeAndNeverEndsTheServer) {
  addStation();
  ASSERT_OK(change([&](Connection& c) -> Status {
    test::fillAtRandom(c, 7);
    return {};
  }));
  const auto records = exportAll(*store, true);
  std::map<std::string, RecordJson> one_of;
  for (const std::string& text : records) {
    auto record = RecordJson::parse(text);
    one_of.emplace(record["kind"].get<std::string>(), record);
  }
  EXPECT_GE(one_of.size(), 13u);
  const std::vector<RecordJson> wrong{5,
                                      -1,
                                      0.5,
                                      true,
                                      nullptr,
                                      RecordJson::array(),
                                      RecordJson{{"a", 1}},
                                      "\x01x",
                                      std::string("a\0b", 3),
                                      18446744073709551615ull,
                                      "zz"};
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  ASSERT_TRUE(importAll(*other, records, 1000).done());
  std::size_t tried = 0;
  for (const auto& [kind, record] : one_of) {
    std::vector<std::string> bent;
    for (const auto& [field, value] : record.items()) {
      for (const auto& replacement : wrong) {
        auto copy = record;
        copy[field] = replacement;
        bent.push_back(copy.dump());
      }
      auto copy = record;
      copy.erase(field);
      bent.push_back(copy.dump());
    }
    tried += bent.size();
    (void)importAll(*other, bent, bent.size(), true);
  }
  EXPECT_GT(tried, 1000u);
  EXPECT_FALSE(other->writer().failed().has_value());

  // The message names the faults of some records that the schema alone would accept.
  auto score = one_of["score"], course = one_of["course"], session = one_of["session"],
       reference = one_of["reference"];
  score["measures"] = R"([{"measure":5,"value":1}])";
  course["id"] = 5;
  // with new keys; otherwise the message would only report a difference
  score["definition_version"] = 9;
  std::string id = session["id"];
  id.back() = id.back() == '0' ? '1' : '0';
  session["id"] = id;
  reference["revision"] = 9;
  reference["sessions"] = "{nonsense";
  const auto report =
      importAll(*other, {score.dump(), course.dump(), session.dump(), reference.dump()}, 10, true);
  ASSERT_EQ(report.faults_size(), 4) << report.DebugString();
  int i = 0;
  for (const char* word : {"measures", "id", "id", "sessions"}) {
    EXPECT_EQ(report.faults(i).message().rfind(word, 0), 0u) << report.faults(i).message();
    ++i;
  }
}

/// Without code_hash and code_unchecked, which schema 7 added.
TEST_F(Import, refusesAFullNameThatHoldsWhatNobodySees) {
  addPerson("anna", pb::TRAINEE);
  RecordJson person;
  for (const std::string& text : exportAll(*store))
    if (auto record = RecordJson::parse(text); record["kind"] == "person") person = record;
  ASSERT_TRUE(person.is_object());
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  person["name"] = "tom";
  person["full_name"] = "Tom \u202eegroeG";
  const auto refused = importAll(*other, {person.dump()}, 10, true);
  ASSERT_EQ(refused.faults_size(), 1) << refused.ShortDebugString();
  EXPECT_EQ(
      refused.faults(0).message().rfind("full_name: holds U+202E (right-to-left override) at byte 5", 0), 0u)
      << refused.faults(0).message();
  person["full_name"] = "אברהם בן־דוד";
  EXPECT_EQ(importAll(*other, {person.dump()}, 10, true).faults_size(), 0);
}

TEST_F(Import, takesAnExportOfBeforeCodesTwice) {
  addStation();
  ASSERT_OK(change([&](Connection& c) -> Status {
    test::fillAtRandom(c, 8);
    return {};
  }));
  for (const bool secrets : {false, true}) {
    std::vector<std::string> older;
    for (const std::string& text : exportAll(*store, secrets)) {
      auto record = RecordJson::parse(text);
      if (record["kind"] == "lab_setting") continue;
      record.erase("code_hash");
      record.erase("code_unchecked");
      older.push_back(record.dump());
    }
    const test::TempFolder elsewhere;
    const auto other = test::openStore(elsewhere.path() / "data");
    const auto report = importAll(*other, older, 1000);
    EXPECT_TRUE(report.done()) << report.ShortDebugString();
    const auto twice = importAll(*other, older, 1000);
    EXPECT_TRUE(twice.done()) << twice.ShortDebugString();
    for (const auto& count : twice.counts()) EXPECT_EQ(count.added(), 0u) << count.kind();
    ASSERT_OK(other->writer().run([](Connection& c) -> Status {
      auto row = c.prepare(
          "SELECT (SELECT count(*) FROM people WHERE code_hash IS NOT NULL), (SELECT sum(code_unchecked) "
          "FROM "
          "unknown_trainees)");
      RETURN_IF_ERROR(row.step());
      EXPECT_EQ(row.integer(0), 0);
      EXPECT_EQ(row.integer(1), 0);
      return {};
    }));
  }
}

TEST_F(Import, addsNothingToSessionsThatAreHereAndNamesWhatItLeftOut) {
  addStation();
  addNamed("anna", "");
  addNamed("ines", "", pb::INSTRUCTOR);
  const Uuid id = closedSession("anna", 5, "well done");
  const std::string digits = hexDigitsOf(textOf(id));
  const auto rows = [&] {
    std::string text;
    EXPECT_OK(change([&](Connection& c) -> Status {
      for (const char* table : {"sessions", "scores", "session_events", "annotations", "unknown_trainees"}) {
        auto row = c.prepare(fmt::format("SELECT count(*) FROM {}", table));
        RETURN_IF_ERROR(row.step());
        text += fmt::format("{} {}, ", table, row.integer(0));
      }
      return {};
    }));
    return text;
  };
  const std::string before = rows();
  const auto own = exportAll(*store);
  const RecordJson score{{"kind", "score"},           {"session", digits}, {"definition_version", 3},
                         {"measures", "[]"},          {"passed", 1},       {"first", 0},
                         {"engine_version", "0.1.0"}, {"made_unix_ns", 9}};
  const RecordJson remark{{"kind", "annotation"}, {"id", 77},         {"session", digits},   {"tick", 3},
                          {"text", "cheated"},    {"author", "ines"}, {"created_unix_ns", 1}};
  const RecordJson mark{{"kind", "unknown_trainee"}, {"session", digits},           {"given", "anna"},
                        {"by_whom", nullptr},        {"assigned_unix_ns", nullptr}, {"code_unchecked", 0}};
  for (const RecordJson& record : {score, remark, mark}) {
    const std::string kind = record["kind"];
    SCOPED_TRACE(kind);
    const auto report = importAll(*store, {record.dump()}, 1);
    EXPECT_TRUE(report.done()) << report.ShortDebugString();
    ASSERT_EQ(report.notes_size(), 1);
    EXPECT_EQ(report.notes(0),
              kind + " of session " + uuidText(id) +
                  ": left out, the session is here already, and an import adds nothing to it");
    for (const auto& count : report.counts()) EXPECT_EQ(count.added(), 0u);
    EXPECT_EQ(rows(), before);
    pb::Request list;
    list.mutable_list_audit()->set_action("import-all");
    const auto lines = get(admin, list).audit();
    EXPECT_TRUE(std::any_of(lines.entries().begin(), lines.entries().end(), [&](const auto& line) {
      return line.detail().find("left out of sessions that are here: 1 of " + kind + " (such as session " +
                                uuidText(id) + ")") != std::string::npos;
    })) << lines.ShortDebugString();
  }
  pb::Request progress;
  progress.mutable_get_progress()->set_trainee("anna");
  EXPECT_EQ(get(instructor, progress).progress().attempts_size(), 1);
  // its own export changes nothing, and nothing is left out of it
  const auto again = importAll(*store, own, 100);
  EXPECT_TRUE(again.done()) << again.ShortDebugString();
  EXPECT_EQ(again.notes_size(), 0) << again.ShortDebugString();
  EXPECT_EQ(rows(), before);
  // where the session comes with them, they are taken
  auto all = own;
  for (const RecordJson& record : {mark, score, remark}) all.push_back(record.dump());
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  const auto taken = importAll(*other, all, 100);
  EXPECT_TRUE(taken.done()) << taken.ShortDebugString();
  for (const auto& count : taken.counts()) {
    const bool twice = count.kind() == "score" || count.kind() == "annotation";
    if (twice || count.kind() == "unknown_trainee") {
      EXPECT_EQ(count.added(), twice ? 2u : 1u) << count.kind();
    }
  }
}

TEST_F(Import, namesWhatPeopleWhoAreHereGet) {
  addStation();
  addNamed("anna", "");
  addNamed("ines", "", pb::INSTRUCTOR);
  const Uuid id = closedSession("anna", 5, "well done");
  ASSERT_OK(change([](Connection& c) -> Status {
    RETURN_IF_ERROR(c.run("UPDATE annotations SET author = 'ines'"));
    RETURN_IF_ERROR(c.run("INSERT INTO groups VALUES ('class', 'Class', 1, 'mia', 1, 0)"));
    RETURN_IF_ERROR(c.run("INSERT INTO group_members VALUES ('class', 'anna')"));
    return c.run(
        "INSERT INTO assignments (exercise_id, group_id, due_unix_ns, by_whom, created_unix_ns)"
        " VALUES ('knee-recess', 'class', 5, 'mia', 1)");
  }));
  const auto records = exportAll(*store);
  ASSERT_OK(change([](Connection& c) -> Status {
    for (const char* sql : {"DELETE FROM removed_originals", "DELETE FROM annotations", "DELETE FROM scores",
                            "DELETE FROM chunks", "DELETE FROM sessions", "DELETE FROM group_members",
                            "DELETE FROM assignments"})
      RETURN_IF_ERROR(c.run(sql));
    return {};
  }));
  const auto report = importAll(*store, records, 100);
  EXPECT_TRUE(report.done()) << report.ShortDebugString();
  EXPECT_EQ(std::vector<std::string>(report.notes().begin(), report.notes().end()),
            (std::vector<std::string>{
                "session " + uuidText(id) + " is new here, of 'anna'",
                "a remark in the name of 'ines' is new here, on session " + uuidText(id),
                "'anna' is in group 'class' from now on", "group 'class' gets an assignment by 'mia'"}));
  // nobody was here
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  const auto elsewhere_report = importAll(*other, records, 100);
  for (const std::string& note : elsewhere_report.notes())
    EXPECT_EQ(note, "instructor 'ines' is new here, with no password");
}

TEST_F(Import, takesNoScoresOfDefinitionsThatThisProgramDoesNotKnow) {
  addStation();
  addNamed("anna", "");
  (void)closedSession("anna", 5, "");
  std::vector<std::string> records;
  for (const std::string& text : exportAll(*store)) {
    auto record = RecordJson::parse(text);
    if (record["kind"] == "score") record["definition_version"] = kScoreDefinitionVersion + 1;
    records.push_back(record.dump());
  }
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  const auto report = importAll(*other, records, 100);
  EXPECT_FALSE(report.done());
  ASSERT_EQ(report.faults_size(), 1) << report.ShortDebugString();
  EXPECT_EQ(report.faults(0).message(),
            fmt::format("definition_version: is {}, this program knows definitions up to {}: update it first",
                        kScoreDefinitionVersion + 1, kScoreDefinitionVersion));
}

TEST_F(Import, isRefusedWhereEarlierPiecesWereDropped) {
  addNamed("zoe", "");
  addPerson("ada", pb::ADMINISTRATOR);
  const auto piece = [&](const std::string& id, const std::string& name, bool last) {
    pb::Request request;
    auto* import = request.mutable_import_all();
    import->set_import_id(id);
    import->set_last(last);
    import->add_records(RecordJson{
        {"kind", "person"},
        {"name", name},
        {"role", 1},
        {"disabled", 0},
        {"created_unix_ns", 1},
        {"full_name", ""},
        {"revision", 1},
        {"changed_unix_ns", 1},
        { "changed_by",
          "" }}.dump());
    return ask(admin, request);
  };
  const auto age = [&](const char* id) {
    ASSERT_OK(change([&](Connection& c) {
      return c.run("UPDATE import_pieces SET unix_ns = 1 WHERE import_id = ? AND position >= 0", id);
    }));
  };
  const auto refused = [&](const char* id) {
    for (const bool last : {false, true}) {
      const auto outcome = piece(id, "second", last);
      ASSERT_TRUE(outcome.error.has_value()) << id;
      EXPECT_EQ(outcome.error->code, ErrorCode::kConflict);
      EXPECT_NE(outcome.error->message.find("Nothing of it was stored: begin again"), std::string::npos)
          << outcome.error->message;
    }
    auto reader = store->readers().borrow();
    ASSERT_OK(reader);
    EXPECT_FALSE(PeopleStore(**reader).find("second")->has_value());
  };
  // a day old when the next one comes; dropped by a start; by an erasure
  EXPECT_FALSE(piece("old", "first", false).error.has_value());
  age("old");
  refused("old");
  EXPECT_FALSE(piece("killed", "first", false).error.has_value());
  age("killed");
  store.reset();
  store = test::openStore(folder.path() / "data");
  refused("killed");
  EXPECT_FALSE(piece("meanwhile", "first", false).error.has_value());
  get(admin, erase("zoe"));
  refused("meanwhile");
  EXPECT_FALSE(piece("another", "first", false).error.has_value());
  EXPECT_TRUE(piece("another", "third", true).reply.import_report().done());
  auto reader = store->readers().borrow();
  ASSERT_OK(reader);
  for (const char* name : {"first", "third"})
    EXPECT_TRUE(PeopleStore(**reader).find(name)->has_value()) << name;
}

TEST_F(Import, takesNobodyUnderTheServersName) {
  addPerson("anna", pb::TRAINEE);
  for (const std::string& text : exportAll(*store)) {
    auto person = RecordJson::parse(text);
    if (person["kind"] != "person") continue;
    for (const char* name : {"server", "Server", "local", "Erasure", "import", "retention"}) {
      person["name"] = name;
      const auto report = importAll(*store, {person.dump()}, 1);
      ASSERT_EQ(report.faults_size(), 1) << name;
      EXPECT_EQ(
          report.faults(0).message().rfind("name: '" + std::string(name) + "' is the name under which", 0),
          0u)
          << report.faults(0).message();
    }
    person["name"] = "Local:root";
    const auto local = importAll(*store, {person.dump()}, 1);
    ASSERT_EQ(local.faults_size(), 1);
    EXPECT_EQ(local.faults(0).message().rfind("name: 'Local:root' begins with 'local:'", 0), 0u)
        << local.faults(0).message();
    return;
  }
  FAIL() << "the export has nobody";
}

TEST_F(Import, takesNoOtherFactsAboutADatabaseForSettings) {
  const auto said = [&](const std::string& key, const std::string& value) {
    const auto report = importAll(
        *store, {RecordJson{{"kind", "lab_setting"}, {"key", key}, {"value", value}}.dump()}, 1, false, true);
    return report.faults_size() == 0 ? std::string() : report.faults(0).message();
  };
  EXPECT_EQ(said("backup_path", "/elsewhere"), "key: is 'backup_path', allowed is codes_required");
  EXPECT_EQ(said("codes_required", "yes"), "value: allowed are 0 and 1");
  EXPECT_EQ(said("codes_required", "1"), "");
  EXPECT_EQ(said("codes_required", "0").rfind("differs", 0), 0u);
}

TEST_F(Import, leavesOutPoliciesThatAreNotThoseHereAndNamesThem) {
  RecordJson policy{{"kind", "retention_policy"}, {"exercise_id", ""},   {"thin_after_days", nullptr},
                    {"thin_rate_hz", nullptr},    {"thin_coarser", 1.0}, {"delete_after_days", 0},
                    {"without_backup", 1},        {"by_whom", "ada"},    {"changed_unix_ns", 1}};
  const auto stored = [&] {
    auto reader = store->readers().borrow();
    EXPECT_OK(reader);
    return *RetentionStore(**reader).policies();
  };
  const auto left_out = importAll(*store, {policy.dump()}, 1);
  EXPECT_TRUE(left_out.done());
  ASSERT_EQ(left_out.notes_size(), 1);
  EXPECT_EQ(
      left_out.notes(0).rfind("retention policy of all other exercises, delete recordings after 0 days: "
                              "left out, ",
                              0),
      0u)
      << left_out.notes(0);
  EXPECT_TRUE(stored().empty());
  // asked for: never without a backup
  const auto taken = importAll(*store, {policy.dump()}, 1, false, true);
  EXPECT_TRUE(taken.done());
  ASSERT_EQ(taken.notes_size(), 2);
  EXPECT_NE(taken.notes(0).find("taken without without_backup"), std::string::npos) << taken.notes(0);
  ASSERT_EQ(stored().size(), 1u);
  EXPECT_FALSE(stored()[0].without_backup());
  EXPECT_TRUE(importAll(*store, {policy.dump()}, 1, false, true).done()) << "again";
  // equal to what is here
  policy["without_backup"] = 0;
  const auto equal = importAll(*store, {policy.dump()}, 1);
  EXPECT_TRUE(equal.done());
  EXPECT_EQ(equal.notes_size(), 0);
  EXPECT_EQ(equal.counts(0).unchanged(), 1u);
}

TEST_F(Import, refusesPoliciesThatNobodyCouldSet) {
  const RecordJson policy{{"kind", "retention_policy"}, {"exercise_id", "knee"}, {"thin_after_days", 30},
                          {"thin_rate_hz", 100.0},      {"thin_coarser", 1.0},   {"delete_after_days", 365},
                          {"without_backup", 0},        {"by_whom", "ada"},      {"changed_unix_ns", 1}};
  const auto said = [&](const char* field, const RecordJson& value) {
    auto bad = policy;
    bad[field] = value;
    const auto report = importAll(*store, {bad.dump()}, 1, true, true);
    return report.faults_size() == 1 ? report.faults(0).message() : std::string();
  };
  EXPECT_EQ(said("delete_after_days", 36'501),
            "retention policy, delete_after_days: 36501, allowed is 0 to 36500");
  EXPECT_EQ(said("delete_after_days", (std::int64_t{1} << 32) + 5).rfind("retention policy, delete_", 0), 0u);
  EXPECT_EQ(said("thin_rate_hz", 1e6).rfind("retention policy, thin_rate_hz", 0), 0u);
  EXPECT_EQ(said("delete_after_days", 30).rfind("retention policy, delete_after_days: 30", 0), 0u);
}

TEST_F(Import, leavesTheLabsSettingsAsTheyAreUnlessAskedTo) {
  const RecordJson setting{{"kind", "lab_setting"}, {"key", "codes_required"}, {"value", "1"}};
  const auto required = [&] {
    auto reader = store->readers().borrow();
    EXPECT_OK(reader);
    return *LabSettingsStore(**reader).codesRequired();
  };
  const auto left_out = importAll(*store, {setting.dump()}, 1);
  EXPECT_TRUE(left_out.done());
  ASSERT_EQ(left_out.notes_size(), 1);
  EXPECT_EQ(left_out.notes(0).rfind("lab setting: codes of trainees required: left out", 0), 0u);
  EXPECT_FALSE(required());
  EXPECT_EQ(importAll(*store, {setting.dump()}, 1, false, true).notes_size(), 1);
  EXPECT_TRUE(required());
}

TEST_F(Import, namesWhoGetsInAndWhoConsents) {
  const auto person = [](const std::string& name, int role, const RecordJson& hash, const RecordJson& code) {
    return RecordJson{{"kind", "person"},      {"name", name},     {"role", role},
                      {"password_hash", hash}, {"disabled", 0},    {"created_unix_ns", 1},
                      {"full_name", ""},       {"revision", 1},    {"changed_unix_ns", 1},
                      {"changed_by", ""},      {"code_hash", code}}
        .dump();
  };
  const RecordJson word{{"kind", "consent"},    {"id", 1},   {"person", "tom"}, {"given", 1}, {"unix_ns", 5},
                        {"recorded_by", "tom"}, {"note", ""}};
  const RecordJson machine{{"kind", "station"},
                           {"name", "thief"},
                           {"key_hash", std::string(64, 'a')},
                           {"revoked", 0},
                           {"created_unix_ns", 1}};
  const auto report =
      importAll(*store,
                {person("tom", 1, "", nullptr), person("tim", 1, "", "$code"), person("ines", 2, "", nullptr),
                 person("mallory", 4, "$hash", nullptr), word.dump(), machine.dump()},
                10);
  EXPECT_TRUE(report.done()) << report.ShortDebugString();
  ASSERT_EQ(report.notes_size(), 5) << report.ShortDebugString();
  EXPECT_EQ(report.notes(0), "administrator 'mallory' is new here, with a password");
  EXPECT_EQ(report.notes(1), "instructor 'ines' is new here, with no password");
  EXPECT_EQ(report.notes(2), "station 'thief' is new here, with its key");
  EXPECT_EQ(report.notes(3), "trainee 'tim' is new here, with a code");
  EXPECT_EQ(report.notes(4).rfind("'tom' consents to studies, by the person, 1970-01-01", 0), 0u);
}

TEST_F(Import, namesThoseOfACrowdWhoCanDoMostFirst) {
  std::vector<std::string> records;
  for (int i = 0; i < 150; ++i)
    records.push_back(RecordJson{
        {"kind", "person"},
        {"name", fmt::format("p{}", i)},
        {"role", i == 149 ? 4 : 2},
        {"disabled", 0},
        {"created_unix_ns", 1},
        {"full_name", ""},
        {"revision", 1},
        {"changed_unix_ns", 1},
        {"changed_by",
         ""}}.dump());
  const auto report = importAll(*store, records, 200, true);
  ASSERT_EQ(report.notes_size(), 102);
  EXPECT_EQ(report.notes(0), "administrator 'p149' is new here, with no password");
  EXPECT_EQ(report.notes(101), "and 49 more lines on other staff");
}

TEST_F(Import, takesNoErasureOfWhoHasAnAccountHereAndNoneThatIsYetToCome) {
  addPerson("tom", pb::TRAINEE);
  const auto key = PseudonymKey::ofFolder(folder.path() / "data");
  ASSERT_OK(key);
  const auto erasure = [&](const std::string& pseudonym, const std::string& name, std::int64_t unix_ns) {
    return RecordJson{{"kind", "erasure"},
                      {"pseudonym", pseudonym},
                      {"name_hash", hexDigitsOf(textOf(key->nameHash(name)))},
                      {"erased_unix_ns", unix_ns},
                      {"by_whom", "ada"},
                      {"reason", ""}}
        .dump();
  };
  constexpr std::int64_t kIn2200 = 7'258'118'400'000'000'000;
  const auto toms = importAll(*store, {erasure("erased-00000000beef", "tom", kIn2200)}, 1);
  EXPECT_TRUE(toms.done());
  ASSERT_EQ(toms.notes_size(), 2);
  EXPECT_NE(toms.notes(1).find("left out, 'tom' has an account here"), std::string::npos) << toms.notes(1);
  const auto misnamed = importAll(*store, {erasure("tom", "ghost", 5)}, 1);
  ASSERT_EQ(misnamed.faults_size(), 1);
  EXPECT_EQ(misnamed.faults(0).message().rfind("pseudonym: must be \"erased-\" and 12", 0), 0u);
  for (const bool again : {false, true})
    EXPECT_TRUE(importAll(*store, {erasure("erased-00000000f00d", "ghost", kIn2200)}, 1).done()) << again;
  auto reader = store->readers().borrow();
  ASSERT_OK(reader);
  auto row = (*reader)->prepare("SELECT count(*), max(erased_unix_ns) FROM erasures");
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.integer(0), 1);
  EXPECT_LT(row.integer(1), kIn2200);
}

// What comes later under a name that nobody had may be another person's, also where the erasure was imported.
TEST_F(Import, keepsTheMarkOfAnErasureWithoutAnAccount) {
  addStation();
  addPerson("ada", pb::ADMINISTRATOR);
  addNamed("tom", "");
  (void)closedSession("Anna", 5, "");
  get(admin, erase("Anna"));
  get(admin, erase("tom"));
  const auto records = exportAll(*store);
  std::vector<std::string> older;
  for (const std::string& text : records) {
    auto record = RecordJson::parse(text);
    record.erase("without_account");
    older.push_back(record.dump());
  }
  const auto taken = [&](Store& from, const char* name) {
    auto reader = from.readers().borrow();
    EXPECT_OK(reader);
    constexpr std::int64_t kNow = 1'900'000'000'000'000'000;
    return ErasureStore(**reader).ownerOf(name, kNow, kNow)->pseudonym.has_value();
  };
  for (const bool says : {true, false}) {
    SCOPED_TRACE(says);
    const test::TempFolder elsewhere;
    std::filesystem::create_directory(elsewhere.path() / "data");
    std::filesystem::copy_file(folder.path() / "data/pseudonym.key", elsewhere.path() / "data/pseudonym.key");
    const auto other = test::openStore(elsewhere.path() / "data");
    ASSERT_TRUE(importAll(*other, says ? records : older, 100).done());
    EXPECT_FALSE(taken(*other, "Anna"));
    EXPECT_EQ(taken(*other, "tom"), says) << "of an account, unless the records do not say it";
    EXPECT_TRUE(importAll(*other, records, 100).done()) << "again";
    EXPECT_TRUE(importAll(*other, older, 100).done()) << "again";
    EXPECT_FALSE(taken(*other, "Anna"));
  }
}

TEST_F(Import, addsLinesOfTheLogOnceWhateverTheirNumbersAre) {
  addPerson("anna", pb::TRAINEE);
  consent("anna", true);
  const auto records = exportAll(*store);
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  // The other store was used before: its own lines have the first numbers.
  for (const char* who : {"x", "y", "z"}) ASSERT_OK(other->service().note(who, "backup", "b", ""));
  ASSERT_TRUE(importAll(*other, records, 100).done());
  EXPECT_TRUE(importAll(*other, records, 100).done());
  std::map<std::string, int> lines;
  for (const std::string& text : exportAll(*other)) {
    const auto record = nlohmann::json::parse(text);
    if (record["kind"] != "audit") continue;
    ++lines[record["who"].get<std::string>() + " " + record["action"].get<std::string>()];
  }
  EXPECT_EQ(lines["ina consent"], 1);
  for (const char* own : {"x backup", "y backup", "z backup"}) EXPECT_EQ(lines[own], 1);
}

TEST_F(Import, takesNoNumbersThatLeaveNoneForNewRows) {
  constexpr std::int64_t kGreatest = std::int64_t{1} << 53;
  addPerson("anna", pb::TRAINEE);
  const RecordJson line{{"kind", "audit"},   {"id", kGreatest + 1}, {"unix_ns", 1}, {"who", "x"},
                        {"action", "login"}, {"subject", ""},       {"detail", ""}};
  const RecordJson given{{"kind", "assignment"},   {"id", INT64_MAX},     {"course_id", nullptr},
                         {"exercise_id", "e"},     {"group_id", nullptr}, {"trainee", "anna"},
                         {"due_unix_ns", nullptr}, {"by_whom", "x"},      {"created_unix_ns", 1}};
  const RecordJson word{{"kind", "consent"}, {"id", INT64_MAX},    {"person", "anna"}, {"given", 1},
                        {"unix_ns", 1},      {"recorded_by", "x"}, {"note", ""}};
  for (const RecordJson& record : {line, given, word}) {
    const auto report = importAll(*store, {record.dump()}, 1);
    EXPECT_FALSE(report.done());
    ASSERT_EQ(report.faults_size(), 1) << record.dump();
    EXPECT_EQ(report.faults(0).message(),
              "id: is " + record["id"].dump() +
                  ", must not be above 9007199254740992: new rows are numbered on from it");
  }
  auto greatest = line;
  greatest["id"] = kGreatest;
  EXPECT_TRUE(importAll(*store, {greatest.dump()}, 1).done());
  EXPECT_OK(store->service().note("ina", "log-in", "", ""));  // the next number is free
}

TEST_F(Import, numbersLinesOfTheLogOnFromTheGreatestAndNotesThatOnce) {
  const auto count = [&](const char* sql) {
    std::int64_t found = -1;
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto row = c.prepare(sql);
      if (*row.step()) found = row.integer(0);
      return {};
    }));
    return found;
  };
  for (int i = 0; i < 3; ++i) ASSERT_OK(store->service().note("x", "backup", std::to_string(i), ""));
  const auto own_lines = static_cast<std::uint64_t>(count("SELECT max(id) FROM audit"));
  // some have numbers of lines that are here by then, and one a great one
  constexpr std::uint64_t kLines = 40, kGreat = 1000;
  std::vector<std::string> records;
  std::map<std::string, std::uint64_t> wanted;  // by subject
  std::uint64_t last = own_lines + 1;           // with the line between both imports
  for (std::uint64_t i = 1; i <= kLines; ++i) {
    const std::uint64_t id = i == 10 ? kGreat : i;
    const std::string subject = "line " + std::to_string(i);
    records.push_back(RecordJson{
        {"kind", "audit"},
        {"id", id},
        {"unix_ns", 1},
        {"who", "y"},
        {"action", "backup"},
        {"subject", subject},
        {"detail", ""}}.dump());
  }
  if (test::onPostgres()) {
    ASSERT_OK(change([](Connection& c) {
      return c.script(
          "CREATE TABLE notes (number BIGINT);"
          "CREATE FUNCTION note_write() RETURNS trigger LANGUAGE plpgsql AS $$"
          " BEGIN INSERT INTO notes VALUES (NEW.number); RETURN NULL; END $$;"
          "CREATE TRIGGER note_write AFTER INSERT OR UPDATE ON last_numbers"
          " FOR EACH ROW WHEN (NEW.name = 'audit') EXECUTE FUNCTION note_write()");
    }));
  }
  // a refused one leaves the trigger that numbers
  auto bad = records;
  bad.push_back(R"({"kind":"score"})");
  EXPECT_FALSE(importAll(*store, bad, 100).done());
  ASSERT_OK(store->service().note("x", "backup", "between", ""));
  EXPECT_EQ(static_cast<std::uint64_t>(count("SELECT max(id) FROM audit")), last);

  const std::int64_t notes_before = test::onPostgres() ? count("SELECT count(*) FROM notes") : 0;
  ASSERT_TRUE(importAll(*store, records, 100).done());
  std::set<std::uint64_t> taken;
  for (std::uint64_t id = 1; id <= last; ++id) taken.insert(id);
  for (std::uint64_t i = 1; i <= kLines; ++i) {
    std::uint64_t id = i == 10 ? kGreat : i;
    if (taken.contains(id)) id = last + 1;
    last = std::max(last, id);
    taken.insert(id);
    wanted["line " + std::to_string(i)] = id;
  }
  std::map<std::string, std::uint64_t> found;
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto row = c.prepare("SELECT subject, id FROM audit WHERE who = 'y'");
    while (*row.step()) found[row.text(0)] = row.natural(1);
    return {};
  }));
  EXPECT_EQ(found, wanted);
  if (test::onPostgres()) {
    EXPECT_LE(count("SELECT count(*) FROM notes") - notes_before, 2) << "and its own line";
  }
  // its own line came behind them, and the next one does
  EXPECT_EQ(static_cast<std::uint64_t>(count("SELECT max(id) FROM audit")), last + 1);
  ASSERT_OK(store->service().note("x", "backup", "afterwards", ""));
  EXPECT_EQ(static_cast<std::uint64_t>(count("SELECT max(id) FROM audit")), last + 2);
  EXPECT_EQ(static_cast<std::uint64_t>(count(test::onPostgres()
                                                 ? "SELECT number FROM last_numbers WHERE name = 'audit'"
                                                 : "SELECT seq FROM sqlite_sequence WHERE name = 'audit'")),
            last + 2)
      << "no line gets a number that was used, whoever removes the last ones";
}

TEST_F(Import, marksLinesOfTheLogWithWhoBroughtThemAndFromWhere) {
  addPerson("anna", pb::TRAINEE);
  consent("anna", true);
  const auto records = exportAll(*store);
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  ASSERT_OK(other->service().note("x", "backup", "b", ""));  // has number 1, too
  ASSERT_TRUE(importAll(*other, records, 100).done());
  pb::Request list;
  list.mutable_list_audit()->set_action("consent");
  auto lines = other->service().execute(admin, list).reply.audit();
  ASSERT_EQ(lines.entries_size(), 1);
  EXPECT_EQ(lines.entries(0).who(), "ina");
  EXPECT_EQ(lines.entries(0).imported_by(), "ada");
  EXPECT_EQ(lines.entries(0).imported_from(), "import-1, line 1");
  EXPECT_NE(lines.entries(0).id(), 1u);
  for (const char* own : {"backup", "import-all"}) {
    list.mutable_list_audit()->set_action(own);
    lines = other->service().execute(admin, list).reply.audit();
    ASSERT_EQ(lines.entries_size(), 1) << own;
    EXPECT_EQ(lines.entries(0).imported_by(), "") << own;
  }
  auto reader = other->readers().borrow();
  ASSERT_OK(reader);
  const std::vector keys{test::TestDb::must(AuditKey::ofFile(elsewhere.path() / "data" / kAuditKeyFile))};
  const auto verdict = verifyAudit(**reader, keys, {});
  ASSERT_OK(verdict);
  EXPECT_TRUE(verdict->ok()) << verdict->texts.front();
}

TEST_F(Import, anExportHasTheHeadOfTheLogWithoutItsOwnLine) {
  addPerson("anna", pb::TRAINEE);
  consent("anna", true);
  AuditHead before;
  {
    auto reader = store->readers().borrow();
    ASSERT_OK(reader);
    const auto head = AuditChain(**reader).head();
    ASSERT_OK(head);
    before = *head;
  }
  EXPECT_EQ(before.position, 1u);
  std::string text;
  for (const std::string& record : exportAll(*store, true)) text += record + "\n";
  ASSERT_OK(writeFileAtomically(folder.path() / "all.jsonl", viewOf(text)));
  const auto anchor = readAuditAnchor(folder.path() / "all.jsonl");
  ASSERT_OK(anchor);
  EXPECT_EQ(anchor->head.position, before.position);
  EXPECT_EQ(anchor->head.mac, before.mac);
}

// The first page of an export is read after its own line is written: what is imported between stands behind
// it.
TEST_F(Import, aLineThatSomebodyImportsBehindAnExportsOwnIsNotItsHead) {
  addPerson("anna", pb::TRAINEE);
  consent("anna", true);
  const auto first = exportAll(*store);
  const auto own = nlohmann::json::parse(first.back());
  ASSERT_EQ(own.at("action"), "export-all");
  ASSERT_TRUE(own.at("imported_from").is_null());
  auto forged = own;
  forged["id"] = own.at("id").get<int>() + 1;
  forged["detail"] = "audit head 99:" + std::string(64, 'f');
  for (const char* field : {"imported_by", "imported_from"}) {
    SCOPED_TRACE(field);
    forged["unix_ns"] = forged["unix_ns"].get<std::int64_t>() + 1;
    forged.erase(field);  // as an older program wrote it; or null, as if it were this store's
    ASSERT_TRUE(importAll(*store, {forged.dump()}, 1).done());
  }
  auto records = exportAll(*store);
  records
      .pop_back();  // the second export's own line: what is left is what the first one's page would have had
  std::string text;
  for (const std::string& record : records) text += record + "\n";
  ASSERT_NE(text.find("audit head 99:"), std::string::npos);
  ASSERT_OK(writeFileAtomically(folder.path() / "all.jsonl", viewOf(text)));
  const auto anchor = readAuditAnchor(folder.path() / "all.jsonl");
  ASSERT_OK(anchor);
  EXPECT_EQ(anchor->head.position, 1u) << "the consent, before the first export's own line";
  // nor does the mark get lost on the way through another store
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  ASSERT_TRUE(importAll(*other, records, 100).done());
  for (const std::string& record : exportAll(*other)) {
    const auto json = nlohmann::json::parse(record);
    if (json.at("kind") == "audit" && json.at("detail") == forged.at("detail")) {
      EXPECT_FALSE(json.at("imported_from").is_null());
    }
  }
  EXPECT_TRUE(importAll(*store, records, 100).done());
  EXPECT_EQ(exportAll(*store).size(), records.size() + 3) << "the import's line, and two of exports";
}

// Schema 5 had no records of unknown trainees. Its export is today's without them.
TEST_F(Import, flagsTheUnknownTraineesOfAnExportFromBeforeSchema6) {
  addStation();
  addNamed("anna", "");
  closedSession("anna", 5, "");
  closedSession("guest", 6, "");
  const Uuid ghosts = closedSession("tmo", 7, "");
  std::vector<std::string> old = exportAll(*store);
  EXPECT_EQ(std::erase_if(old,
                          [](const std::string& record) {
                            return record.find(R"("kind":"unknown_trainee")") != std::string::npos;
                          }),
            1u);
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  // an account here that has the name by chance
  ASSERT_OK(other->writer().run([](Connection& c) {
    return PeopleStore(c).add({"tmo", pb::TRAINEE, "", false, 1});
  }));
  const auto flagged = [&](const pb::ImportReport& report) {
    EXPECT_TRUE(report.done()) << report.ShortDebugString();
    for (const auto& count : report.counts())
      if (count.kind() == "unknown_trainee") return count.added();
    return std::uint64_t{0};
  };
  EXPECT_EQ(flagged(importAll(*other, old, 2)), 1u);
  pb::Request list;
  list.mutable_list_sessions()->set_unknown_trainee(true);
  const auto waiting = other->service().execute(manager, list).reply.sessions();
  ASSERT_EQ(waiting.sessions_size(), 1);
  EXPECT_EQ(waiting.sessions(0).description().session_id(), test::bytesOfId(ghosts));
  pb::Request progress;
  progress.mutable_get_progress()->set_trainee("tmo");
  EXPECT_EQ(other->service().execute(instructor, progress).reply.progress().attempts_size(), 0);
}

}  // namespace
}  // namespace needlelab
