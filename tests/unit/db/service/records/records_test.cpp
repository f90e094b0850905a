// Exports everything; studies; exports and erases a person's data.
#include <fmt/core.h>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "db/audit/audit_chain.h"
#include "db/service/folder/data_folder.h"
#include "db/service/records/record_end.h"
#include "db/service/records/record_tables.h"
#include "db/service/start/bootstrap.h"
#include "tests/unit/db/service/records/records_fixture.h"

namespace needlelab {
namespace {

using Records = test::RecordsTest;
using test::fillAtRandom, test::seedOfRecords;

/// A stored value in the form of a record.
nlohmann::json valueOf(const Statement& row, int column, RecordColumnKind kind) {
  if (row.isNull(column)) return nullptr;
  if (kind == RecordColumnKind::kReal) return row.real(column);
  if (kind == RecordColumnKind::kText) return row.text(column);
  if (kind == RecordColumnKind::kHex) return hexDigitsOf(textOf(row.bytes(column)));
  return row.integer(column);
}

TEST_F(Records, everyRowIsExportedOnceWithItsValues) {
  const std::uint64_t seed = seedOfRecords();
  RecordProperty("seed", std::to_string(seed));
  SCOPED_TRACE("NEEDLELAB_SEED=" + std::to_string(seed));
  addStation();
  ASSERT_OK(change([&](Connection& c) -> Status {
    fillAtRandom(c, seed);
    return {};
  }));
  for (const bool secrets : {false, true}) {
    std::map<std::string, std::vector<nlohmann::json>> records;
    for (const std::string& text : exportAll(*store, secrets)) {
      auto record = nlohmann::json::parse(text);
      records[record["kind"]].push_back(std::move(record));
    }
    EXPECT_EQ(records["event"].size(), 14u);
    EXPECT_EQ(records["session"].size(), 7u) << "not the open one";
    ASSERT_OK(change([&](Connection& c) -> Status {
      for (const RecordTable& table : recordTables()) {
        const auto& exported = records[std::string(table.kind)];
        for (const RecordColumn& column : table.columns) {
          const std::string field(column.name == "kind" ? "what" : column.name == "ref" ? "id" : column.name);
          if (column.secret && !secrets) {
            for (const auto& record : exported) EXPECT_FALSE(record.contains(field)) << field;
            continue;
          }
          using K = RecordColumnKind;
          if (column.kind == K::kSession || column.kind == K::kPerson) continue;
          std::multiset<nlohmann::json> stored, said;
          for (const auto& record : exported) said.insert(record.at(field));
          auto rows = c.prepare(fmt::format("SELECT {} FROM {}{}{}", column.name, table.table,
                                            table.only.empty() ? "" : " WHERE ", table.only));
          for (;;) {
            ASSIGN_OR_RETURN(const bool more, rows.step());
            if (!more) break;
            stored.insert(valueOf(rows, 0, column.kind));
          }
          EXPECT_EQ(said, stored) << table.kind << " " << field;
        }
      }
      return {};
    }));
  }
}

TEST_F(Records, anOpenSessionIsExportedAsFarAsItGoes) {
  addStation();
  addNamed("anna", "Anna A");
  addSession("anna", 3);
  const auto own = all(trainee, *store, [](pb::Request& request, const std::string& page) {
    request.mutable_export_person()->set_name("anna");
    request.mutable_export_person()->set_page(page);
  });
  std::vector<std::string> sessions;
  std::copy_if(own.begin(), own.end(), std::back_inserter(sessions), [](const std::string& record) {
    return record.find(R"("kind":"session")") != std::string::npos;
  });
  ASSERT_EQ(sessions.size(), 1u);
  const auto json = nlohmann::json::parse(sessions[0]);
  std::uint64_t bytes = 0;
  for (std::uint64_t seq = 0; seq < 3; ++seq) bytes += test::chunkOf(seq).size();
  EXPECT_EQ(json["state"], 1);
  EXPECT_EQ(json["chunks"], 3);
  EXPECT_EQ(json["samples"], 60);
  EXPECT_EQ(json["stored_bytes"], bytes);
}

TEST_F(Records, aStudyHoldsThoseWhoConsentAndNoNameAnywhere) {
  addStation();
  addNamed("anna", "Anna Östlund-Berg");
  addNamed("ben", "Benjamin Karlsson");
  addNamed("zoe", "");
  addNamed("ina", "Ina Instructor", pb::INSTRUCTOR);
  closedSession("anna", 1'000'000'000'000, "Anna, mind Benjamin's needle! says ina, Mrs. ÖSTLUND-BERG");
  closedSession("anna", 1'060'000'000'000, "");
  closedSession("ben", 5, "ben was here");
  closedSession("zoe", 5, "");
  EXPECT_EQ(study("s1").size(), 1u) << "no one was asked: the header alone";
  consent("anna", true);
  consent("ben", true);
  consent("zoe", true);
  consent("zoe", false);
  const auto records = study("s1", true);
  std::map<std::string, int> kinds;
  std::set<std::string> people, sessions;
  for (const std::string& record : records) {
    const auto json = nlohmann::json::parse(record);
    ++kinds[json["kind"]];
    if (json["kind"] == "session") {
      people.insert(json["person"]);
      sessions.insert(json["session"]);
      EXPECT_EQ(json["profile_revision"], 1);
      EXPECT_EQ(json["engine_version"], "0.1.0");
    }
    std::string lower = record;
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char ch) { return static_cast<char>(std::tolower(ch)); });
    for (const char* name : {"anna", "stlund", "ben", "karlsson", "zoe", "\"ina\"", " ina", "instructor",
                             "station-1", "1000000000000"})
      EXPECT_EQ(lower.find(name), std::string::npos) << name << " in " << record;
  }
  EXPECT_EQ(kinds["session"], 3);
  EXPECT_EQ(kinds["score"], 3);
  EXPECT_EQ(kinds["remark"], 2);
  EXPECT_EQ(people.size(), 2u);
  // The same tomorrow, but different in another study.
  EXPECT_EQ(study("s1", true), records);
  for (const std::string& record : study("s2"))
    for (const std::string& person : people) EXPECT_EQ(record.find(person), std::string::npos);
  for (const std::string& record : study("s1"))
    EXPECT_EQ(record.find("\"remark\""), std::string::npos) << "only when asked for";

  // Recordings have the study's own names; a person who withdraws disappears at once.
  pb::Request read;
  read.mutable_read_study_recording()->set_study("s1");
  read.mutable_read_study_recording()->set_session(*sessions.begin());
  const auto chunks = get(researcher, read).chunks();
  EXPECT_EQ(chunks.chunks_size(), 3);
  EXPECT_EQ(chunks.chunks(0).session_id(), *sessions.begin());
  consent("anna", false);
  consent("ben", false);
  EXPECT_EQ(study("s1").size(), 1u);
  EXPECT_EQ(refusal(researcher, read), ErrorCode::kNotFound);
}

TEST_F(Records, aStudysProfilesAndScoresHaveNoNameAtAnyDepth) {
  addStation();
  addNamed("anna", "Anna Wqjvornov");
  addNamed("muscle", "");  // has the same name as a tissue and a measure
  addNamed("peak_force_n", "");
  consent("anna", true);
  const std::string profile =
      R"({"id":"knee-of-anna","name":"Anna's knee","needle":{"source":"of anna","synthetic":["ask wqjvornov"]},)"
      R"("layers":[{"tissue":"MUSCLE","name":"Wqjvornov's muscle","thickness_m":0.02}],)"
      R"("targets":[{"name":"where ANNA missed"}],"hazards":[{"name":"nerve of Anna","radius_m":0.001}],)"
      R"("effects":["PUNCTURE"],"unknown":{"wqjvornov":[[{"deep":"\u0041nna anna"}]]}})";
  const Uuid id = addSession("anna", 1, 20, profile);
  ASSERT_OK(change([&](Connection& c) -> Status {
    if (auto closed = SessionStore(c).close(test::closeOf(id, 1), 2); !closed) return closed.error();
    return ScoreStore(c).put(test::scoreOf(
        id, R"([{"measure":"peak_force_n","value":1.5,"unit":"N","words":"in the nerve of Anna"}])"));
  }));
  std::string all;
  nlohmann::json exported, measures;
  for (const std::string& record : study("s1")) {
    all += record;
    const auto json = nlohmann::json::parse(record);
    if (json["kind"] == "session") exported = json["profile"];
    if (json["kind"] == "score") measures = json["measures"];
  }
  std::transform(all.begin(), all.end(), all.begin(),
                 [](unsigned char ch) { return static_cast<char>(std::tolower(ch)); });
  const std::string kept = "knee-of-anna";  // ids are kept
  for (std::size_t at = all.find(kept); at != std::string::npos; at = all.find(kept))
    all.erase(at, kept.size());
  for (const char* name : {"anna", "wqjvornov"})
    EXPECT_EQ(all.find(name), std::string::npos) << name << " in " << all;
  EXPECT_EQ(exported["layers"][0]["tissue"], "MUSCLE") << "an enumerator is not text";
  EXPECT_EQ(exported["layers"][0]["thickness_m"], 0.02);
  EXPECT_EQ(exported["hazards"][0]["name"], "nerve of [name]");
  EXPECT_EQ(exported["effects"][0], "PUNCTURE");
  EXPECT_EQ(exported["id"], kept);
  EXPECT_EQ(measures[0]["measure"], "peak_force_n");
  EXPECT_EQ(measures[0]["words"], "in the nerve of [name]");
  EXPECT_EQ(measures[0]["value"], 1.5);
}

TEST_F(Records, aPersonGetsAllAndOnlyItsOwnData) {
  addStation();
  addNamed("anna", "Anna A");
  addNamed("ben", "");
  closedSession("anna", 1, "a remark");
  closedSession("ben", 2, "ben's remark");
  consent("anna", true);
  const auto own = all(trainee, *store, [](pb::Request& request, const std::string& page) {
    request.mutable_export_person()->set_name("anna");
    request.mutable_export_person()->set_page(page);
  });
  std::map<std::string, int> kinds;
  for (const std::string& record : own) {
    ++kinds[nlohmann::json::parse(record)["kind"]];
    EXPECT_EQ(record.find("ben"), std::string::npos) << record;
    EXPECT_EQ(record.find("password"), std::string::npos) << record;
  }
  for (const char* kind : {"person", "consent", "session", "score", "annotation", "audit"})
    EXPECT_EQ(kinds[kind], 1) << kind;
  pb::Request request;
  request.mutable_export_person()->set_name("ben");
  EXPECT_EQ(refusal(trainee, request), ErrorCode::kDenied);
  EXPECT_EQ(refusal(instructor, request), ErrorCode::kDenied);
  get(manager, request);
  request.mutable_export_person()->set_name("nobody");
  EXPECT_EQ(refusal(admin, request), ErrorCode::kNotFound);
}

TEST_F(Records, anErasureTakesRecordingsAwayAtOnce) {
  addStation();
  addNamed("anna", "Anna A");
  addPerson("ada", pb::ADMINISTRATOR);
  const Uuid id = closedSession("anna", 1, "Anna again");
  // An open session blocks the erasure until the request says how to treat it.
  const Uuid open = addSession("anna", 2);
  const auto busy = ask(admin, erase("anna"));
  ASSERT_TRUE(busy.error.has_value());
  EXPECT_NE(busy.error->message.find("station-1"), std::string::npos) << busy.error->message;
  const auto erasure = get(admin, erase("anna", true)).erasure();
  EXPECT_EQ(erasure.sessions(), 2u);
  EXPECT_EQ(erasure.recordings(), 2u) << "the open one's counts, too";
  EXPECT_EQ(erasure.remarks_kept(), 1u);
  EXPECT_NE(erasure.text().find("ackup"), std::string::npos);
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto chunks = c.prepare("SELECT count(*) FROM chunks");
    EXPECT_TRUE(*chunks.step());
    EXPECT_EQ(chunks.integer(0), 0) << "retention's machinery was here";
    const auto appended = SessionStore(c).append(open, 2, test::chunkOf(2), "station-1");
    EXPECT_TRUE(appended.ok() && appended->taken());
    EXPECT_EQ(test::dump(c).find("'anna'"), std::string::npos);
    return {};
  }));
  EXPECT_EQ(readErasures(folder.path() / "data")->size(), 1u);
  pb::Request show;
  show.mutable_get_session()->set_session_id(test::bytesOfId(id));
  const auto info = get(instructor, show).session();
  EXPECT_EQ(info.description().trainee(), erasure.pseudonym());
  EXPECT_EQ(info.score_json(), "");
  pb::Request check;
  check.mutable_check();
  const auto report = get(admin, check).check_report();
  EXPECT_TRUE(report.ok()) << report.ShortDebugString();
}

TEST_F(Records, aRestoredBackupRepeatsErasuresBeforeServing) {
  addStation();
  addNamed("anna", "Anna A");
  addNamed("ben", "Ben B");
  const Uuid id = closedSession("anna", 1, "well done, anna");
  pb::Request backup;
  backup.mutable_backup()->set_path((folder.path() / "before.db").string());
  get(admin, backup);
  const auto first = get(admin, erase("anna")).erasure();
  EXPECT_EQ(store->erasuresRepeated(), 0u);
  // the server is stopped and the backup put in place
  store.reset();
  const auto text = readWholeFile(folder.path() / "before.db");
  ASSERT_OK(text);
  for (const char* suffix : {"", "-wal", "-shm"})
    std::filesystem::remove(folder.path() / ("data/needlelab.db" + std::string(suffix)));
  ASSERT_OK(writeFileAtomically(folder.path() / "data/needlelab.db", viewOf(*text), 0600));
  // no service while the erasure cannot be repeated
  Store::Options full;
  full.read_only_because = [] { return std::string("the disk is full"); };
  const auto refused = Store::open(folder.path() / "data", full);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kNoRoom);
  EXPECT_NE(refused.error().message.find("Make room on the disk"), std::string::npos)
      << refused.error().message;
  store = test::openStore(folder.path() / "data");
  EXPECT_EQ(store->erasuresRepeated(), 1u);
  pb::Request show;
  show.mutable_get_session()->set_session_id(test::bytesOfId(id));
  const auto session = get(instructor, show).session();
  EXPECT_EQ(session.description().trainee(), first.pseudonym()) << "the pseudonym of the first erasure";
  EXPECT_EQ(session.chunks(), 0u);
  pb::Request person;
  person.mutable_get_user()->set_name("anna");
  EXPECT_EQ(refusal(admin, person), ErrorCode::kNotFound);
  person.mutable_get_user()->set_name("ben");
  get(admin, person);
  pb::Request check;
  check.mutable_check();
  EXPECT_TRUE(get(admin, check).check_report().ok());
  // once is enough
  store.reset();
  store = test::openStore(folder.path() / "data");
  EXPECT_EQ(store->erasuresRepeated(), 0u);
}

TEST_F(Records, aRestoreOmitsErasedPeopleFromRestoredAccess) {
  constexpr std::int64_t kLater = 1'900'000'000'000'000'000;
  const auto data = folder.path() / "data";
  const auto add = [&](const std::string& name, std::int64_t created_unix_ns) {
    ASSERT_OK(change([&](Connection& c) {
      return PeopleStore(c).add({name, pb::INSTRUCTOR, "a hash", false, created_unix_ns});
    }));
  };
  const auto backUp = [&](const std::string& name) {
    pb::Request backup;
    backup.mutable_backup()->set_path((folder.path() / name).string());
    get(admin, backup);
  };
  const auto disable = [&](const std::string& name) {
    pb::Request request;
    request.mutable_disable_user()->set_name(name);
    get(admin, request);
  };
  const auto restored = [&](const std::string& name) {
    store.reset();
    std::vector<std::string> names;
    const auto result = test::TestDb::must(restoreFrom(data, folder.path() / name, kLater));
    store = test::openStore(data);
    for (const auto& one : test::TestDb::must(noteAccessValidAgain(*store, result.kept)))
      names.push_back(one.name);
    return names;
  };
  add("erwin", 1);
  add("dora", 1);
  backUp("before.db");
  get(admin, erase("erwin"));
  disable("dora");
  EXPECT_EQ(restored("before.db"), std::vector<std::string>{"dora"});
  ASSERT_OK(change([](Connection& c) -> Status {
    auto lines = c.prepare("SELECT count(*) FROM audit WHERE subject = 'erwin' OR detail LIKE '%erwin%'");
    EXPECT_TRUE(*lines.step());
    EXPECT_EQ(lines.integer(0), 0);
    return {};
  }));
  EXPECT_EQ(store->erasuresRepeated(), 1u);
  // another person of that name is mentioned
  add("erwin", kLater);
  backUp("after.db");
  disable("erwin");
  EXPECT_EQ(restored("after.db"), std::vector<std::string>{"erwin"});
}

TEST_F(Records, aBackupRestoredElsewhereRepeatsErasuresFromItsList) {
  addNamed("anna", "Anna A");
  const auto kept = folder.path() / "kept", other = folder.path() / "other";
  for (const auto& made : {kept, other}) std::filesystem::create_directory(made);
  pb::Request backup;
  backup.mutable_backup()->set_path((kept / "before.db").string());
  get(admin, backup);
  get(admin, erase("anna"));
  // the machine is lost, except for its backups and keys
  std::filesystem::copy_file(folder.path() / "data/pseudonym.key", other / "pseudonym.key");
  std::filesystem::copy_file(folder.path() / "data/audit.key", other / "audit.key");
  ASSERT_OK(restoreFrom(other, kept / "before.db", 1'800'000'000'000'000'000));
  const auto restored = test::openStore(other);
  EXPECT_EQ(restored->erasuresRepeated(), 1u);
  auto reader = restored->readers().borrow();
  ASSERT_OK(reader);
  EXPECT_FALSE(PeopleStore(**reader).find("anna")->has_value());
  // the chain continues there, with the repeated erasure
  const std::vector keys{test::TestDb::must(AuditKey::ofFile(other / kAuditKeyFile))};
  const std::vector anchors{test::TestDb::must(readAuditAnchor(kept / "before.db"))};
  const auto verdict = verifyAudit(**reader, keys, anchors);
  ASSERT_OK(verdict);
  EXPECT_TRUE(verdict->ok()) << verdict->texts.front();
}

}  // namespace
}  // namespace needlelab
