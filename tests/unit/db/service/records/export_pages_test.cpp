// The pages of exports: their owner, the audit log, rows that appear and disappear, and the contents of
// studies.
#include "common/gesture/chunk.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/cut_snapshot.h"
#include "tests/unit/db/service/records/records_fixture.h"

namespace needlelab {
namespace {

/// A list of one path.
Bytes pathAt(std::uint64_t tick) {
  PathSnapshot snapshot;
  snapshot.tick = tick;
  snapshot.path.normal_W = {0, 0, 1};
  snapshot.path.count = 1;
  snapshot.path.layers[0] = {2, 0};
  Bytes list;
  EXPECT_TRUE(appendPath(snapshot, list));
  return list;
}

class ExportPages : public test::RecordsTest {
 protected:
  /// A large session: four exceed a page.
  void scoreLong(const Uuid& id, std::uint32_t version) {
    const std::string measures =
        R"([{"measure":"elapsed_s","value":1,"unit":"s","words":")" + std::string(300'000, 'w') + R"("}])";
    ASSERT_OK(change([&](Connection& c) { return ScoreStore(c).put(test::scoreOf(id, measures, version)); }));
  }
  static pb::Request withPage(pb::Request request, const std::string& page) {
    if (request.has_export_all()) request.mutable_export_all()->set_page(page);
    if (request.has_export_person()) request.mutable_export_person()->set_page(page);
    if (request.has_export_study()) request.mutable_export_study()->set_page(page);
    return request;
  }
  pb::Records studyPage(const std::string& page) {
    pb::Request request;
    request.mutable_export_study()->set_study("s1");
    return get(researcher, withPage(request, page)).records();
  }
  static std::map<std::string, int> sessionsByPerson(const pb::Records& records) {
    std::map<std::string, int> by_person;
    for (const std::string& text : records.records()) {
      const auto json = nlohmann::json::parse(text);
      if (json["kind"] == "session") ++by_person[json["person"]];
    }
    return by_person;
  }
  std::map<std::string, std::vector<Uuid>> threeWithFourEach() {
    addStation();
    std::map<std::string, std::vector<Uuid>> of;
    for (const char* name : {"anna", "ben", "zoe"}) {
      addNamed(name, "");
      consent(name, true);
      for (int i = 0; i < 4; ++i) {
        of[name].push_back(closedSession(name, ++when_, ""));
        scoreLong(of[name].back(), 2);
      }
    }
    return of;
  }
  std::int64_t when_ = 0;
};

TEST_F(ExportPages, beginWithTheFirstWhichIsWrittenDown) {
  addStation();
  addNamed("anna", "");
  const Uuid id = closedSession("anna", 1, "");
  const Uuid other = closedSession("anna", 2, "");
  for (std::uint32_t version = 2; version < 4; ++version) {
    scoreLong(id, version);
    scoreLong(other, version);
  }
  consent("anna", true);
  std::map<std::string, pb::Request> asks;
  asks["export-all"].mutable_export_all();
  asks["person export"].mutable_export_person()->set_name("anna");
  asks["study export"].mutable_export_study()->set_study("s1");
  const Principal other_admin{"bob", pb::ADMINISTRATOR};
  for (const auto& [action, request] : asks) {
    for (const char* made_up :
         {"0:0", "1", "0", " ", "[0,null,0,[],0]", "00000000000000000000000000000000[0,null,0,[],0]"})
      EXPECT_EQ(refusal(admin, withPage(request, made_up)), ErrorCode::kInvalidInput) << action << made_up;
    const std::string page = get(admin, request).records().next_page();
    ASSERT_FALSE(page.empty()) << action;
    EXPECT_EQ(refusal(other_admin, withPage(request, page)), ErrorCode::kInvalidInput) << action;
    std::string bent = page;
    bent.back() = static_cast<char>(bent.back() ^ 1);
    EXPECT_EQ(refusal(admin, withPage(request, bent)), ErrorCode::kInvalidInput) << action;
    get(admin, withPage(request, page));
    pb::Request log;
    log.mutable_list_audit()->set_action(action);
    EXPECT_EQ(get(admin, log).audit().entries_size(), 1) << action;
  }
  // A page token belongs to its own request, not to one that returns more.
  pb::Request more = asks["export-all"];
  const std::string page = get(admin, more).records().next_page();
  more.mutable_export_all()->set_with_passwords(true);
  EXPECT_EQ(refusal(admin, withPage(more, page)), ErrorCode::kInvalidInput);
}

TEST_F(ExportPages, readingAStudyRecordingIsAuditedFromAnyPosition) {
  addStation();
  addNamed("anna", "");
  closedSession("anna", 1, "");
  consent("anna", true);
  pb::Request read;
  for (const std::string& record : study("s2")) {
    const auto json = nlohmann::json::parse(record);
    if (json["kind"] == "session") read.mutable_read_study_recording()->set_session(json["session"]);
  }
  read.mutable_read_study_recording()->set_study("s2");
  for (const std::uint64_t seq : {1u, 2u, 0u}) {
    read.mutable_read_study_recording()->set_from_seq(seq);
    get(researcher, read);
  }
  pb::Request log;
  log.mutable_list_audit()->set_action("study recording");
  const auto lines = get(admin, log).audit();
  ASSERT_EQ(lines.entries_size(), 1) << "once an hour";
  EXPECT_EQ(lines.entries(0).who(), "rea");
  EXPECT_EQ(lines.entries(0).subject(), "s2");
  EXPECT_EQ(lines.entries(0).detail(), read.read_study_recording().session());
}

TEST_F(ExportPages, ofAStudySkipNoOneWhenSomeoneWithdraws) {
  threeWithFourEach();
  const auto first = studyPage("");
  ASSERT_FALSE(first.next_page().empty());
  ASSERT_EQ(sessionsByPerson(first).size(), 1u);
  const std::string gone = sessionsByPerson(first).begin()->first;
  // the pseudonym's owner, who withdraws and is no longer on the first page
  for (const char* name : {"anna", "ben", "zoe"}) {
    consent(name, false);
    if (!sessionsByPerson(studyPage("")).contains(gone)) break;
    consent(name, true);
  }
  std::map<std::string, int> rest;
  for (std::string page = first.next_page(); !page.empty();) {
    const auto records = studyPage(page);
    for (const auto& [person, number] : sessionsByPerson(records)) rest[person] += number;
    page = records.next_page();
  }
  EXPECT_EQ(rest.size(), 2u);
  for (const auto& [person, number] : rest) EXPECT_EQ(number, 4) << person;
}

TEST_F(ExportPages, ofScoresStandWhenSomebodyIsErased) {
  threeWithFourEach();
  addPerson("ada", pb::ADMINISTRATOR);
  pb::Request list;
  list.mutable_list_scores();
  auto scores = get(instructor, list).scores();
  std::multiset<std::string> seen;
  const auto take = [&] {
    for (const auto& row : scores.scores()) {
      if (row.attempt().trainee() == "anna") continue;
      seen.insert(row.score().session_id() + std::to_string(row.score().definition_version()));
    }
  };
  take();
  ASSERT_FALSE(scores.next_page().empty());
  EXPECT_EQ(scores.scores(0).attempt().trainee(), "anna");
  get(admin, erase("anna"));
  while (!scores.next_page().empty()) {
    list.mutable_list_scores()->set_page(scores.next_page());
    scores = get(instructor, list).scores();
    take();
  }
  EXPECT_EQ(seen.size(), 16u) << "two scores of eight sessions";
  EXPECT_EQ(std::set<std::string>(seen.begin(), seen.end()).size(), seen.size()) << "none twice";
  for (const char* made_up : {"x", "1 2 3", "1 2 3 99 a", "-"}) {
    list.mutable_list_scores()->set_page(made_up);
    EXPECT_EQ(refusal(instructor, list), ErrorCode::kInvalidInput) << made_up;
  }
}

TEST_F(ExportPages, ofScoresAreAuditedOnceAnHourFromAnyPosition) {
  threeWithFourEach();
  pb::Request list;
  list.mutable_list_scores();
  const std::string middle = get(manager, list).scores().next_page();
  ASSERT_FALSE(middle.empty());
  for (const std::string& page : {middle, middle, std::string()}) {
    list.mutable_list_scores()->set_page(page);
    get(instructor, list);
  }
  list.mutable_list_scores()->set_course_id("nowhere");
  EXPECT_EQ(refusal(instructor, list), ErrorCode::kNotFound);
  pb::Request log;
  log.mutable_list_audit()->set_action("score list");
  const auto lines = get(admin, log).audit();
  ASSERT_EQ(lines.entries_size(), 2);
  EXPECT_EQ(lines.entries(0).who(), "ina");
  EXPECT_EQ(lines.entries(1).who(), "mia");
}

TEST_F(ExportPages, ofEverythingAreConsistentDespiteConcurrentEnds) {
  threeWithFourEach();
  pb::Request ask;
  ask.mutable_export_all();
  std::vector<std::string> records;
  int pages = 0;
  for (;;) {
    const auto page = get(admin, ask).records();
    records.insert(records.end(), page.records().begin(), page.records().end());
    // A lesson ends, is scored and gets a remark: all of this belongs to the next export.
    closedSession("ben", ++when_, "later");
    ++pages;
    if (page.next_page().empty()) break;
    ask = withPage(ask, page.next_page());
  }
  EXPECT_GE(pages, 3);
  std::map<std::string, int> kinds;
  for (const std::string& record : records) ++kinds[nlohmann::json::parse(record)["kind"]];
  EXPECT_EQ(kinds["session"], 12);
  EXPECT_EQ(kinds["score"], 24);
  // An export is stopped if its pages would not match.
  pb::Request again;
  again.mutable_export_all();
  again = withPage(again, get(admin, again).records().next_page());
  pb::Request add;
  add.mutable_add_user()->set_name("new");
  add.mutable_add_user()->set_role(pb::TRAINEE);
  get(admin, add);
  EXPECT_EQ(refusal(admin, again), ErrorCode::kConflict);
}

TEST_F(ExportPages, aStudysNumbersAreNotChangedByNamesAndTellNoStation) {
  addStation();
  addNamed("name", "Anna Bone");
  addNamed("layers", "Tissue");
  consent("name", true);
  const std::string profile =
      R"({"id":"bone-1","name":"Bone of Anna","description":"by layers","layers":[{"tissue":"BONE","name":"x"}]})";
  const Uuid id = makeUuidV7();
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto d = test::describe(id);
    d.set_trainee("name");
    d.set_profile_json(profile);
    d.set_device("falcon no. 17");
    for (const double number : {1., 2., 3., 0., 0., 0., 1.}) d.add_placement(number);
    if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
    pb::CloseSession close = test::closeOf(id, 3);
    SessionHash hash;
    for (std::uint64_t seq = 0; seq < 3; ++seq) {
      // chunk 0 remembers cuts at its first sample, chunk 1 after its sixth, chunk 2 has bytes that are not a
      // memory
      const Bytes cuts = seq < 2 ? encodeCuts({1000 + seq * 25, {}, 4}) : Bytes(20, 7);
      const Bytes paths = seq < 2 ? pathAt(1000 + seq * 30) : Bytes(20, 7);
      const Bytes chunk = encodeChunk({}, test::someSamples(1000 + seq * 20, 20), cuts, paths);
      hash.update(chunk);
      if (auto appended = SessionStore(c).append(id, seq, chunk); !appended) return appended.error();
    }
    const Digest digest = hash.digest();
    close.set_hash(digest.data(), digest.size());
    const auto closed = SessionStore(c).close(close, 2);
    return closed ? Status() : Status(closed.error());
  }));
  nlohmann::json session;
  for (const std::string& record : study("s1"))
    if (const auto json = nlohmann::json::parse(record); json["kind"] == "session") session = json;
  EXPECT_EQ(session["profile"]["layers"][0]["tissue"], "BONE");
  EXPECT_EQ(session["profile"]["layers"][0]["name"], "x");
  EXPECT_EQ(session["profile"]["id"], "bone-1");
  EXPECT_EQ(session["profile"]["name"], "[name] of [name]");
  EXPECT_EQ(session["profile"]["description"], "by [name]");
  EXPECT_EQ(session["begun_after_first_days"], 0);
  for (const char* field :
       {"device", "placement", "tool", "stiffness_share", "delay_stiffness_share", "begun_after_first_s"})
    EXPECT_FALSE(session.contains(field)) << field;
  pb::Request request;
  request.mutable_export_study()->set_study("s1");
  request.mutable_export_study()->set_with_setup(true);
  EXPECT_EQ(nlohmann::json::parse(get(researcher, request).records().records(1))["device"], "falcon no. 17");
  for (const char* share : {"stiffness_share", "delay_stiffness_share"})
    EXPECT_EQ(nlohmann::json::parse(get(researcher, request).records().records(1))[share], 1);

  pb::Request read;
  read.mutable_read_study_recording()->set_study("s1");
  read.mutable_read_study_recording()->set_session(session["session"]);
  read.mutable_read_study_recording()->set_from_seq(1);
  const auto chunks = get(researcher, read).chunks();
  ASSERT_EQ(chunks.chunks_size(), 2);
  const auto origin = *decodeChunk(encodeChunk({}, test::someSamples(1000, 20)));
  const auto original = *decodeChunk(encodeChunk({}, test::someSamples(1020, 20)));
  const auto given = *decodeChunk(viewOf(chunks.chunks(0).data()));
  ASSERT_GT(origin[0].tick, 0u);
  EXPECT_EQ(cutMemoryOf(viewOf(chunks.chunks(0).data())), encodeCuts({25, {}, 4}));
  EXPECT_TRUE(cutMemoryOf(viewOf(chunks.chunks(1).data())).empty()) << "unread, it might tell the clock";
  EXPECT_EQ(pathListOf(viewOf(chunks.chunks(0).data())), pathAt(30));
  EXPECT_TRUE(pathListOf(viewOf(chunks.chunks(1).data())).empty()) << "likewise";
  ASSERT_EQ(given.size(), original.size());
  for (std::size_t i = 0; i < given.size(); ++i) {
    EXPECT_EQ(given[i].tick, original[i].tick - origin[0].tick);
    EXPECT_EQ(given[i].time_ns, original[i].time_ns - origin[0].time_ns);
    EXPECT_EQ(given[i].p_WT_m[2], original[i].p_WT_m[2]) << "measured values are unchanged";
    EXPECT_EQ(given[i].force_W_N[0], original[i].force_W_N[0]);
  }
  read.mutable_read_study_recording()->set_from_seq(0);
  const auto first = get(researcher, read).chunks().chunks(0);
  EXPECT_EQ(cutMemoryOf(viewOf(first.data())), encodeCuts({0, {}, 4})) << "remembered at the first sample";
  EXPECT_EQ(pathListOf(viewOf(first.data())), pathAt(0));
}

TEST_F(ExportPages, aStudyRecordingsReplyShiftsABoundedNumberOfSamples) {
  constexpr std::uint64_t kChunks = 5;
  addStation();
  addNamed("anna", "");
  consent("anna", true);
  const Uuid id = makeUuidV7();
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto d = test::describe(id);
    d.set_trainee("anna");
    if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
    SessionHash hash;
    for (std::uint64_t seq = 0; seq < kChunks; ++seq) {
      // a motionless hand: some 8 KiB
      std::vector<GestureSample> samples(kMaxChunkSamples);
      for (std::size_t i = 0; i < samples.size(); ++i) {
        samples[i].tick = 1000 + seq * kMaxChunkSamples + i;
        samples[i].time_ns = static_cast<std::int64_t>(samples[i].tick) * 1'000'000;
      }
      const Bytes chunk = encodeChunk({}, samples);
      hash.update(chunk);
      if (auto appended = SessionStore(c).append(id, seq, chunk); !appended) return appended.error();
    }
    pb::CloseSession close = test::closeOf(id, kChunks);
    close.set_samples(kChunks * kMaxChunkSamples);
    const Digest digest = hash.digest();
    close.set_hash(digest.data(), digest.size());
    const auto closed = SessionStore(c).close(close, 2);
    return closed ? Status() : Status(closed.error());
  }));
  pb::Request read;
  read.mutable_read_study_recording()->set_study("s1");
  for (const std::string& record : study("s1"))
    if (const auto json = nlohmann::json::parse(record); json["kind"] == "session")
      read.mutable_read_study_recording()->set_session(json["session"]);
  std::vector<int> sizes;
  for (std::uint64_t next = 0; next < kChunks;) {
    read.mutable_read_study_recording()->set_from_seq(next);
    const auto chunks = get(researcher, read).chunks();
    ASSERT_GT(chunks.chunks_size(), 0);
    for (const pb::Chunk& chunk : chunks.chunks()) {
      ASSERT_EQ(chunk.seq(), next);
      EXPECT_EQ(decodeChunk(viewOf(chunk.data()))->front().tick, next * kMaxChunkSamples);
      ++next;
    }
    EXPECT_EQ(chunks.next_seq(), next);
    EXPECT_EQ(chunks.end(), next == kChunks);
    sizes.push_back(chunks.chunks_size());
  }
  EXPECT_EQ(sizes, (std::vector<int>{2, 2, 1}));
}

}  // namespace
}  // namespace needlelab
