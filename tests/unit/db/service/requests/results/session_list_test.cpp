// Lists of sessions: the search criteria and the contents of a row.
#include <set>

#include "db/sessions/session_results.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class SessionList : public test::ServiceTest {
 protected:
  struct Made {
    std::string trainee, exercise;
    std::int64_t day = 1;
    std::optional<std::string> score;  // JSON rows
    std::optional<bool> passed;
  };
  void SetUp() override {
    addStation();
    addPerson("anna", pb::TRAINEE);
    ASSERT_OK(change([](Connection& c) {
      return PeopleStore(c).add({"t17", pb::TRAINEE, "", false, 1, "Berta Hannawald"});
    }));
  }
  std::string add(const Made& made) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee(made.trainee);
      d.set_exercise_id(made.exercise);
      d.set_started_unix_ns(made.day * test::kDay_ns);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      if (!made.score) return {};
      if (auto appended = SessionStore(c).append(id, 0, test::chunkOf(0)); !appended) return appended.error();
      if (auto closed = SessionStore(c).close(test::closeOf(id, 1), 1); !closed) return closed.error();
      pb::Score score = test::scoreOf(id, *made.score);
      if (made.passed) score.set_passed(*made.passed);
      return ScoreStore(c).put(score);
    }));
    return test::bytesOfId(id);
  }
  std::set<std::string> found(const Principal& who, const std::function<void(pb::ListSessions&)>& wanted) {
    pb::Request request;
    wanted(*request.mutable_list_sessions());
    std::set<std::string> ids;
    const pb::Reply reply = get(who, request);
    for (const auto& row : reply.sessions().sessions())
      EXPECT_TRUE(ids.insert(row.description().session_id()).second);
    return ids;
  }
  using Ids = std::set<std::string>;
};

TEST_F(SessionList, rowsTellVerdictAndMainFiguresOfTheFirstScore) {
  const std::string scored =
      add({"anna", "knee-1", 1,
           R"([{"measure":"path_length_m","value":0.4,"unit":"m","words":""},)"
           R"({"measure":"peak_force_n","value":3.25,"unit":"N","words":"","max":3,"passed":false},)"
           R"({"measure":"target_distance_m","value":null,"unit":"m","words":""},)"
           R"({"measure":"hazards_touched","value":0,"unit":"","words":""}])",
           false});
  const std::string broken = add({"anna", "knee-1", 2, "{", {}});
  const std::string open = add({"anna", "knee-1", 3, {}, {}});
  pb::Request request;
  request.mutable_list_sessions();
  const auto rows = get(instructor, request).sessions();
  ASSERT_EQ(rows.sessions_size(), 3);
  const pb::SessionInfo& row = rows.sessions(2);
  EXPECT_EQ(row.description().session_id(), scored);
  ASSERT_TRUE(row.has_passed());
  EXPECT_FALSE(row.passed());
  EXPECT_EQ(row.score_json(), "") << "the whole score is for who asks for the session";
  ASSERT_EQ(row.figures_size(), 3);
  EXPECT_EQ(row.figures(0).measure(), "peak_force_n");
  EXPECT_EQ(row.figures(0).value(), 3.25);
  EXPECT_EQ(row.figures(0).unit(), "N");
  EXPECT_EQ(row.figures(1).measure(), "target_distance_m");
  EXPECT_FALSE(row.figures(1).has_value()) << "could not be measured";
  EXPECT_EQ(row.figures(2).measure(), "hazards_touched");
  EXPECT_TRUE(row.figures(2).has_value());
  EXPECT_EQ(rows.sessions(1).description().session_id(), broken);
  EXPECT_EQ(rows.sessions(1).figures_size(), 0) << "a score that cannot be read ends no list";
  EXPECT_EQ(rows.sessions(0).description().session_id(), open);
  EXPECT_FALSE(rows.sessions(0).has_passed());
  pb::Request one;
  one.mutable_get_session()->set_session_id(scored);
  EXPECT_FALSE(get(instructor, one).session().passed());
  EXPECT_TRUE(get(instructor, one).session().has_passed());
}

TEST_F(SessionList, isSearchedByDateVerdictExerciseAndPartsOfNames) {
  const std::string first = add({"anna", "knee-1", 10, "[]", true});
  const std::string second = add({"t17", "knee-1", 11, "[]", false});
  const std::string third = add({"t17", "hip-1", 12, "[]", {}});
  const std::string stranger = add({"Johanna/2", "knee-1", 13, {}, {}});  // from a station that was offline
  const auto by = [&](const std::function<void(pb::ListSessions&)>& wanted) {
    return found(instructor, wanted);
  };
  // `from` is inclusive, `to` is exclusive
  EXPECT_EQ(by([](auto& w) { w.set_from_unix_ns(11 * test::kDay_ns); }), (Ids{second, third, stranger}));
  EXPECT_EQ(by([](auto& w) { w.set_to_unix_ns(11 * test::kDay_ns); }), (Ids{first}));
  EXPECT_EQ(by([](auto& w) {
              w.set_from_unix_ns(10 * test::kDay_ns + 1);
              w.set_to_unix_ns(12 * test::kDay_ns + 1);
            }),
            (Ids{second, third}));
  EXPECT_EQ(by([](auto& w) {
              w.set_from_unix_ns(12 * test::kDay_ns);
              w.set_to_unix_ns(12 * test::kDay_ns);
            }),
            Ids{});
  EXPECT_EQ(by([](auto& w) { w.set_verdict(pb::ListSessions::PASSED); }), (Ids{first}));
  EXPECT_EQ(by([](auto& w) { w.set_verdict(pb::ListSessions::FAILED); }), (Ids{second}));
  EXPECT_EQ(by([](auto& w) { w.set_verdict(pb::ListSessions::NONE); }), (Ids{third, stranger}));
  EXPECT_EQ(by([](auto& w) { w.set_exercise_id("hip-1"); }), (Ids{third}));
  EXPECT_EQ(by([](auto& w) { w.set_search("ANNA"); }), (Ids{first, second, third, stranger}))
      << "anna, Berta Hannawald, Johanna/2";
  EXPECT_EQ(by([](auto& w) { w.set_search("berta"); }), (Ids{second, third}));
  EXPECT_EQ(by([](auto& w) { w.set_search("%"); }), Ids{}) << "no wild cards";
  EXPECT_EQ(by([](auto& w) {
              w.set_search("berta");
              w.set_verdict(pb::ListSessions::FAILED);
              w.set_exercise_id("knee-1");
              w.set_trainee("t17");
              w.set_station("station-1");
            }),
            (Ids{second}));
  EXPECT_EQ(by([](auto& w) { w.set_trainee("Johanna/2"); }), (Ids{stranger})) << "names as they once were";
  EXPECT_EQ(found(trainee, [](auto& w) { w.set_search("berta"); }), Ids{}) << "a trainee searches its own";
  EXPECT_EQ(found(trainee, [](auto& w) { w.set_verdict(pb::ListSessions::PASSED); }), (Ids{first}));

  pb::Request wrong;
  wrong.mutable_list_sessions()->set_verdict(static_cast<pb::ListSessions::Verdict>(9));
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kInvalidInput);
  wrong.mutable_list_sessions()->set_verdict(pb::ListSessions::ANY);
  wrong.mutable_list_sessions()->set_search(std::string(65, 'x'));
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kInvalidInput);
  wrong.mutable_list_sessions()->set_search("\xff");
  EXPECT_EQ(refusal(instructor, wrong), ErrorCode::kInvalidInput);
}

TEST_F(SessionList, pagesOfASearchHoldEachSessionOnceInOrder) {
  std::vector<std::string> wanted;  // oldest first
  for (int i = 0; i < 40; ++i) {
    // several at the same moment; every third one has the wanted verdict
    const bool fits = i % 3 == 0;
    const std::string id = add({i % 2 == 0 ? "anna" : "t17", "knee-1", 1 + i / 4, "[]", fits});
    if (fits && i >= 8) wanted.push_back(id);
  }
  for (const std::uint32_t limit : {1u, 3u, 5u, 100u}) {
    std::vector<std::string> seen;
    pb::Request request;
    auto& list = *request.mutable_list_sessions();
    list.set_limit(limit);
    list.set_verdict(pb::ListSessions::PASSED);
    list.set_from_unix_ns(3 * test::kDay_ns);
    do {
      const auto reply = get(instructor, request);
      ASSERT_LE(reply.sessions().sessions_size(), static_cast<int>(limit));
      for (const auto& row : reply.sessions().sessions()) seen.push_back(row.description().session_id());
      list.set_page(reply.sessions().next_page());
      ASSERT_LE(seen.size(), wanted.size()) << "none comes twice";
    } while (!list.page().empty());
    EXPECT_EQ(std::vector<std::string>(seen.rbegin(), seen.rend()), wanted) << limit;
  }
}

}  // namespace
}  // namespace needlelab
