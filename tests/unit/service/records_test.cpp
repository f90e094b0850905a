// Everything out and in again; studies; a person's data out, and away.
#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "base/atomic_file.h"
#include "db/annotation_store.h"
#include "db/erasure_store.h"
#include "db/event_store.h"
#include "db/score_store.h"
#include "dump.h"
#include "test_service.h"

namespace needlelab {
namespace {

std::uint64_t seedOfRecords() {
  const char* given = std::getenv("NEEDLELAB_SEED");
  return given != nullptr ? std::strtoull(given, nullptr, 10) : std::random_device()();
}

class Records : public test::ServiceTest {
 protected:
  /// All pages, one request a page.
  std::vector<std::string> all(const Principal& who, Store& from,
                               const std::function<void(pb::Request&, const std::string&)>& ask) {
    std::vector<std::string> records;
    std::string page;
    do {
      pb::Request request;
      ask(request, page);
      const Outcome outcome = from.service().execute(who, request);
      EXPECT_FALSE(outcome.error.has_value()) << outcome.error->message;
      if (outcome.error) return records;
      EXPECT_LT(outcome.reply.ByteSizeLong(), 1u << 20);
      records.insert(records.end(), outcome.reply.records().records().begin(),
                     outcome.reply.records().records().end());
      page = outcome.reply.records().next_page();
    } while (!page.empty());
    return records;
  }
  std::vector<std::string> exportAll(Store& from, bool secrets = false) {
    return all(admin, from, [&](pb::Request& request, const std::string& page) {
      request.mutable_export_all()->set_page(page);
      request.mutable_export_all()->set_with_passwords(secrets);
    });
  }
  std::vector<std::string> study(const std::string& name, bool remarks = false) {
    return all(researcher, *store, [&](pb::Request& request, const std::string& page) {
      request.mutable_export_study()->set_study(name);
      request.mutable_export_study()->set_with_remarks(remarks);
      request.mutable_export_study()->set_page(page);
    });
  }
  pb::ImportReport importAll(Store& into, const std::vector<std::string>& records, std::size_t piece,
                             bool dry_run = false) {
    pb::Request request;
    auto* import = request.mutable_import_all();
    import->set_import_id("import-1");
    import->set_dry_run(dry_run);
    for (std::size_t i = 0; i < records.size(); i += piece) {
      import->clear_records();
      for (std::size_t j = i; j < std::min(i + piece, records.size()); ++j) import->add_records(records[j]);
      import->set_last(i + piece >= records.size());
      const Outcome outcome = into.service().execute(admin, request);
      EXPECT_FALSE(outcome.error.has_value()) << outcome.error->message;
      if (import->last()) return outcome.reply.import_report();
    }
    return {};
  }
  void consent(const std::string& name, bool given) {
    pb::Request request;
    request.mutable_set_consent()->set_name(name);
    request.mutable_set_consent()->set_given(given);
    get(instructor, request);
  }
  Uuid closedSession(const std::string& who, std::int64_t started, const std::string& remark) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee(who);
      d.set_started_unix_ns(started);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      for (std::uint64_t seq = 0; seq < 3; ++seq)
        if (auto appended = SessionStore(c).append(id, seq, test::chunkOf(seq)); !appended)
          return appended.error();
      if (auto closed = SessionStore(c).close(test::closeOf(id, 3), 2); !closed) return closed.error();
      if (auto done = ScoreStore(c).put(
              test::scoreOf(id, R"([{"measure":"elapsed_s","value":1.5,"unit":"s","words":""}])"));
          !done)
        return done;
      if (remark.empty()) return {};
      const auto added = AnnotationStore(c).add({0, id, 1, remark, "ina", 1});
      return added ? Status() : Status(added.error());
    }));
    return id;
  }
  void addNamed(const std::string& name, const std::string& full_name, pb::Role role = pb::TRAINEE) {
    ASSERT_OK(change([&](Connection& c) {
      return PeopleStore(c).add({name, role, "", false, 1, full_name});
    }));
  }
  pb::Request erase(const std::string& name, bool with_open = false) {
    pb::Request request;
    request.mutable_erase_person()->set_name(name);
    request.mutable_erase_person()->set_confirm(name);
    request.mutable_erase_person()->set_with_open_sessions(with_open);
    return request;
  }
  const Principal researcher{"rea", pb::RESEARCHER};
};

/// A database of everything, made at random: texts that need escaping, numbers with all their digits, bytes.
void fillAtRandom(Connection& c, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto number = [&](std::uint64_t below) { return static_cast<std::int64_t>(random() % below); };
  const auto text = [&] {
    static const std::vector<std::string> kParts = {"a", "\"", "\\", "ö",    "\xe2\x82\xac",    ", ",
                                                    "'", "{",  " ",  "x;--", "\xf0\x9f\x92\x89"};
    std::string made = "t";
    for (std::int64_t i = number(8); i > 0; --i) made += kParts[random() % kParts.size()];
    return made + "e";
  };
  std::vector<std::string> people;
  for (int i = 0; i < 12; ++i) {
    people.push_back("p" + std::to_string(i) + text());
    ASSERT_OK(PeopleStore(c).add({people.back(), i % 5 == 0 ? pb::INSTRUCTOR : pb::TRAINEE,
                                  i % 5 == 0 ? "$hash" : "", number(2) == 0, number(1ull << 62), text()}));
    ASSERT_OK(c.run("INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES (?,?,?,?,?)",
                    people.back(), number(2), number(1ull << 62), text(), text()));
  }
  for (int i = 0; i < 4; ++i) {
    const std::string id = "g" + std::to_string(i);
    ASSERT_OK(c.run("INSERT INTO groups VALUES (?,?,?,?,?,?)", id, text(), 1 + number(100), text(),
                    number(1ull << 62), i == 3));
    for (const auto& person : people)
      if (i != 3 && number(2) == 0) ASSERT_OK(c.run("INSERT INTO group_members VALUES (?,?)", id, person));
    ASSERT_OK(
        c.run("INSERT INTO assignments (exercise_id, group_id, due_unix_ns, by_whom, created_unix_ns) VALUES "
              "('knee-recess',?,?,?,?)",
              id, number(1ull << 62), text(), number(1ull << 62)));
  }
  for (int i = 0; i < 8; ++i) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee(people[random() % people.size()]);
    d.set_rate_hz(static_cast<double>(random() % 1'000'000) / 997.0);
    d.set_started_unix_ns(number(1ull << 62));
    ASSERT_OK(SessionStore(c).open(d, number(1ull << 62)));
    // the last one stays open, and is of no export
    if (i == 7) break;
    ASSERT_OK(SessionStore(c).append(id, 0, test::chunkOf(0)));
    ASSERT_OK(SessionStore(c).close(test::closeOf(id, 1), number(1ull << 62)));
    ASSERT_OK(ScoreStore(c).put(
        test::scoreOf(id, R"([{"measure":")" + std::string("m") + R"(","value":0.1}])", 1)));
    ASSERT_OK(ScoreStore(c).put(test::scoreOf(id, "[]", 2)));
    // a stroke's own kind must not take the place of the record's
    pb::SyringeEvent drawn, pressed;
    drawn.set_kind(pb::SyringeEvent::ASPIRATION);
    drawn.set_end_s(static_cast<double>(random() % 1'000'000) / 997.0);
    drawn.mutable_begin()->set_tissue(text());
    pressed.set_kind(pb::SyringeEvent::INJECTION);
    pressed.add_hazards("artery");
    ASSERT_OK(EventStore(c).put(id, std::array{drawn, pressed}));
    const auto added = AnnotationStore(c).add({0, id, random() % 1000, text(), text(), number(1ull << 62)});
    ASSERT_OK(added);
    ASSERT_OK(
        c.run("UPDATE sessions SET clock_offset_ns = ?, clock_round_trip_ns = ?, passed = ?, excused = ? "
              "WHERE id = ?",
              -number(1ull << 62), number(1ull << 40), number(2), number(2), ByteView(id)));
  }
  ASSERT_OK(c.run("INSERT INTO retention_policies VALUES ('knee-recess', 30, ?, 1.0, 365, 0, ?, 1)",
                  static_cast<double>(random() % 100'000 + 1) / 3.0, text()));
  ASSERT_OK(c.run("INSERT INTO exercise_references VALUES ('knee-recess', 1, '[]', ?, 1)", text()));
  ASSERT_OK(c.run("INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1,?,?,?,?)", text(),
                  text(), text(), text()));
}

TEST_F(Records, everythingComesBackExactly) {
  const std::uint64_t seed = seedOfRecords();
  RecordProperty("seed", std::to_string(seed));
  SCOPED_TRACE("NEEDLELAB_SEED=" + std::to_string(seed));
  addStation();
  ASSERT_OK(change([&](Connection& c) -> Status {
    fillAtRandom(c, seed);
    return {};
  }));
  for (const bool secrets : {false, true}) {
    const auto records = exportAll(*store, secrets);
    ASSERT_GT(records.size(), 60u);
    EXPECT_EQ(std::count_if(records.begin(), records.end(),
                            [](const std::string& r) { return r.find(R"("kind":"event")") != r.npos; }),
              14);
    const test::TempFolder elsewhere;
    const auto other = test::openStore(elsewhere.path() / "data");
    const auto plan = importAll(*other, records, 7, true);
    EXPECT_FALSE(plan.done());
    EXPECT_EQ(plan.faults_size(), 0) << plan.faults(0).ShortDebugString();
    const auto report = importAll(*other, records, 50);
    EXPECT_TRUE(report.done()) << report.ShortDebugString();
    // but the line that says so, and the exports' own
    auto again = exportAll(*other, secrets);
    std::erase_if(
        again, [](const std::string& r) { return r.find(R"("action":"import-all")") != std::string::npos; });
    std::erase_if(
        again, [](const std::string& r) { return r.find(R"("action":"export-all")") != std::string::npos; });
    auto before = records;
    std::erase_if(
        before, [](const std::string& r) { return r.find(R"("action":"export-all")") != std::string::npos; });
    EXPECT_EQ(before, again);
    // what was imported is a sound database, and the same import again changes nothing
    pb::Request check;
    check.mutable_check();
    const auto checked = other->service().execute(admin, check).reply.check_report();
    EXPECT_TRUE(checked.ok()) << checked.ShortDebugString();
    const auto twice = importAll(*other, records, 1000);
    EXPECT_TRUE(twice.done());
    for (const auto& count : twice.counts()) EXPECT_EQ(count.added(), 0u) << count.kind();
  }
}

TEST_F(Records, anOpenSessionIsExportedWithWhatItHoldsSoFarAndNotTakenElsewhere) {
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
  const test::TempFolder elsewhere;
  const auto other = test::openStore(elsewhere.path() / "data");
  ASSERT_OK(other->writer().run(
      [](Connection& c) { return StationStore(c).add("station-1", StationKeyBytes{}, 1); }));
  const auto report = importAll(*other, sessions, 3);
  EXPECT_FALSE(report.done());
  ASSERT_EQ(report.faults_size(), 1);
  EXPECT_NE(report.faults(0).message().find("open"), std::string::npos) << report.ShortDebugString();
}

TEST_F(Records, anImportThatDoesNotFitChangesNothingAndNamesTheRecords) {
  addPerson("anna", pb::TRAINEE);
  const auto before = exportAll(*store);
  const std::vector<std::string> wrong{
      R"({"kind":"person","name":"new","role":1,"disabled":0,"created_unix_ns":1,"full_name":"","revision":1,"changed_unix_ns":1,"changed_by":""})",
      R"({"kind":"person","name":"anna","role":4,"disabled":0,"created_unix_ns":1,"full_name":"","revision":1,"changed_unix_ns":1,"changed_by":""})",
      R"({"kind":"person","name":"bad","role":5,"disabled":0,"created_unix_ns":1,"full_name":"","revision":1,"changed_unix_ns":1,"changed_by":""})",
      R"({"kind":"person","name":"short","role":1})",
      R"({"kind":"person","name":7})",
      R"({"kind":"group_member","group_id":"nowhere","person":"anna"})",
      R"({"kind":"profile","id":"p","revision":1,"name":"P","json":"{}","author":"x","created_unix_ns":1})",
      R"({"kind":"chair"})",
      "nonsense",
      "[]"};
  const auto report = importAll(*store, wrong, 3);
  EXPECT_FALSE(report.done());
  ASSERT_EQ(report.faults_size(), 9);
  EXPECT_EQ(report.faults(0).path(), "record 2 (person)");
  EXPECT_NE(report.faults(0).message().find("differs"), std::string::npos);
  EXPECT_EQ(exportAll(*store).size(), before.size() + 1) << "but the line about the export";
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
  EXPECT_EQ(study("s1").size(), 1u) << "nobody was asked: the header alone";
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
  // the same tomorrow, others in another study
  EXPECT_EQ(study("s1", true), records);
  for (const std::string& record : study("s2"))
    for (const std::string& person : people) EXPECT_EQ(record.find(person), std::string::npos);
  for (const std::string& record : study("s1"))
    EXPECT_EQ(record.find("\"remark\""), std::string::npos) << "only when asked for";

  // recordings by the study's own names; who withdraws is gone at once
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
  // nothing else is a researcher's
  pb::Request list;
  list.mutable_list_sessions();
  EXPECT_EQ(refusal(researcher, list), ErrorCode::kDenied);
  list.mutable_list_users();
  EXPECT_EQ(refusal(researcher, list), ErrorCode::kDenied);
}

TEST_F(Records, aPersonGetsAllOfItsOwnDataAndNobodyElses) {
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

TEST_F(Records, anErasureTakesRecordingsAwayAtOnceAndIsAskedForTwice) {
  addStation();
  addNamed("anna", "Anna A");
  addPerson("ada", pb::ADMINISTRATOR);
  const Uuid id = closedSession("anna", 1, "Anna again");
  pb::Request unsure = erase("anna");
  unsure.mutable_erase_person()->set_confirm("ben");
  EXPECT_EQ(refusal(admin, unsure), ErrorCode::kInvalidInput);
  EXPECT_EQ(refusal(manager, erase("anna")), ErrorCode::kDenied);
  EXPECT_EQ(refusal(admin, erase("ada")), ErrorCode::kDenied) << "oneself";
  EXPECT_EQ(refusal(admin, erase("nobody")), ErrorCode::kNotFound);
  EXPECT_TRUE(readErasures(folder.path() / "data")->empty()) << "what was refused left no line";
  // a session that is open is in the way, until it is said what shall become of it
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

TEST_F(Records, aRestoredBackupSaysThatSomebodyMustBeErasedAgain) {
  addNamed("anna", "Anna A");
  pb::Request backup;
  backup.mutable_backup()->set_path((folder.path() / "before.db").string());
  get(admin, backup);
  const auto first = get(admin, erase("anna")).erasure();
  EXPECT_TRUE(store->service().erasuresToRepeat()->empty());
  // the server is stopped, the backup put into place
  store.reset();
  const auto text = readWholeFile(folder.path() / "before.db");
  ASSERT_OK(text);
  for (const char* suffix : {"", "-wal", "-shm"})
    std::filesystem::remove(folder.path() / ("data/needlelab.db" + std::string(suffix)));
  ASSERT_OK(writeFileAtomically(folder.path() / "data/needlelab.db", viewOf(*text), 0600));
  store = test::openStore(folder.path() / "data");
  const auto repeat = store->service().erasuresToRepeat();
  ASSERT_OK(repeat);
  ASSERT_EQ(repeat->size(), 1u);
  EXPECT_NE(repeat->front().find("'anna'"), std::string::npos);
  pb::Request check;
  check.mutable_check();
  EXPECT_FALSE(get(admin, check).check_report().ok());
  EXPECT_EQ(get(admin, erase("anna")).erasure().pseudonym(), first.pseudonym());
  EXPECT_TRUE(store->service().erasuresToRepeat()->empty());
  EXPECT_TRUE(get(admin, check).check_report().ok());
}

}  // namespace
}  // namespace needlelab
