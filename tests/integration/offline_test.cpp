// A lab without its server: lessons from the cache, everything uploaded later, in order and once.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/integration/lab.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

class OfflineTest : public testing::Test {
 protected:
  // a lesson with the server, so that the exercise is in the cache; then the server stops
  void fillCacheAndStopServer() {
    lab_.startServer();
    auto online = lab_.startStation("online", {"--exercise", "ball-free-practice", "--seconds", "0.3"});
    ASSERT_EQ(online->wait(), kExitDone) << online->said();
    ASSERT_EQ(lab_.stopServer(), kExitDone);
  }
  // without any server on the command line
  std::unique_ptr<Process> alone(const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {
        "--trainee", "tom", "--headless", "--spool", lab_.path("spool"), "--json", lab_.path(name + ".json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return std::make_unique<Process>("needlelab-station", arguments, lab_.path(name + ".log"));
  }
  Lab lab_;
};

TEST_F(OfflineTest, threeLessonsWithoutAServerAreUploadedInOrderAndOnce) {
  fillCacheAndStopServer();
  std::vector<std::string> ids;
  for (int i = 0; i < 3; ++i) {
    const std::string name = "alone" + std::to_string(i);
    auto station = alone(name, {"--exercise", "ball-free-practice", "--seconds", "1.4"});
    ASSERT_EQ(station->wait(), kExitDone) << station->said();
    const auto summary = lab_.summary(name);
    ids.push_back(summary["session_id"]);
    EXPECT_EQ(summary["samples_lost"], 0);
    EXPECT_EQ(summary["score_source"], "station");
    EXPECT_GT(summary["profile_revision"], 0) << "kept beside the cached profile";
    EXPECT_THAT(station->said(), HasSubstr("from the cache"));
    EXPECT_THAT(station->said(), HasSubstr("no server has yet"));
    EXPECT_THAT(station->said(), HasSubstr("an hour"));
  }

  lab_.startServer();
  auto later =
      lab_.startStation("later", {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain", "30"});
  ASSERT_EQ(later->wait(), kExitDone) << later->said();
  EXPECT_EQ(lab_.summary("later")["spool_left"], 0);
  const auto sessions = lab_.sessions();
  EXPECT_EQ(sessions.size(), 5u) << "online, three alone, later: each once";
  std::vector<std::pair<std::int64_t, std::string>> received;
  for (const auto& id : ids) {
    const StoredSession stored = lab_.stored(id);
    EXPECT_EQ(stored.info.state(), pb::SESSION_COMPLETE);
    EXPECT_EQ(stored.info.description().station(), "station-1") << "named by the key that it had no use for";
    EXPECT_EQ(stored.chunks, Lab::spooledChunks(lab_.path("spool"), id));
    EXPECT_TRUE(lab_.verifies(id));
    for (std::size_t i = 1; i < stored.samples.size(); ++i)
      ASSERT_GT(stored.samples[i].tick, stored.samples[i - 1].tick);
    received.emplace_back(stored.info.received_unix_ns(), id);
  }
  std::sort(received.begin(), received.end());
  for (std::size_t i = 0; i < ids.size(); ++i) EXPECT_EQ(received[i].second, ids[i]) << "oldest first";

  // nothing is left to upload, and nothing is uploaded twice
  auto again = lab_.startStation("again", {"--exercise", "ball-free-practice", "--seconds", "0.3"});
  ASSERT_EQ(again->wait(), kExitDone) << again->said();
  EXPECT_THAT(again->said(), Not(HasSubstr("earlier runs")));
  EXPECT_EQ(lab_.sessions().size(), 6u);
}

TEST_F(OfflineTest, anUnknownNameIsRefusedOnlineAndFlaggedOffline) {
  fillCacheAndStopServer();
  const auto as_tmo = [&](const std::string& name, const std::vector<std::string>& more) {
    auto arguments = lab_.stationArguments({"--seconds", "0.3", "--json", lab_.path(name + ".json")});
    std::replace(arguments.begin(), arguments.end(), std::string("tom"), std::string("tmo"));
    arguments.insert(arguments.end(), more.begin(), more.end());
    return std::make_unique<Process>("needlelab-station", arguments, lab_.path(name + ".log"));
  };
  auto away = as_tmo("away", {"--exercise", "ball-free-practice"});
  ASSERT_EQ(away->wait(), kExitDone) << away->said();
  const std::string id = lab_.summary("away")["session_id"];

  lab_.startServer();
  const std::vector<std::string> lessons[] = {{"--exercise", "ball-free-practice"},
                                              {"--profile", NEEDLELAB_SAMPLES "/knee-adult.json"}};
  for (const auto& lesson : lessons) {
    auto refused = as_tmo("refused", lesson);
    EXPECT_EQ(refused->wait(), kExitFailed) << refused->said();
    EXPECT_THAT(refused->said(), HasSubstr("no one named 'tmo' who may practise. Did you mean 'tom'?"));
  }
  // the next lesson uploads what was recorded without the server
  auto next =
      lab_.startStation("next", {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain", "30"});
  ASSERT_EQ(next->wait(), kExitDone) << next->said();
  EXPECT_EQ(lab_.sessions().size(), 3u) << "online, away, next: nothing was recorded of what was refused";
  const StoredSession stored = lab_.stored(id);
  EXPECT_EQ(stored.info.state(), pb::SESSION_COMPLETE);
  EXPECT_TRUE(stored.info.unknown_trainee());
  EXPECT_EQ(stored.chunks, Lab::spooledChunks(lab_.path("spool"), id));
  ASSERT_EQ(lab_.stopServer(), kExitDone);
  ASSERT_EQ(lab_.admin({"session", "assign", id, "--to", "tom"}), kExitDone);

  // the station asks again about sessions that no backup covers: it gets an answer, and nothing is sent twice
  lab_.startServer();
  auto last =
      lab_.startStation("last", {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain", "30"});
  ASSERT_EQ(last->wait(), kExitDone) << last->said();
  EXPECT_THAT(last->said(), Not(HasSubstr("another description")));
  EXPECT_EQ(lab_.stored(id).info.description().trainee(), "tom");
  EXPECT_EQ(lab_.stored(id).info.given_trainee(), "tmo");
}

TEST_F(OfflineTest, aCodeIsCheckedOnlineAndAnOfflineSessionWaits) {
  fillCacheAndStopServer();
  const auto code_file = [&](const std::string& name, const std::string& code) {
    std::ofstream(lab_.path(name)) << code << "\n";
    std::filesystem::permissions(lab_.path(name), std::filesystem::perms::owner_read);
    return lab_.path(name).string();
  };
  const std::string right_file = code_file("right.code", "badge-of-tom-4711"),
                    wrong_file = code_file("wrong.code", "badge-of-zoe-0815");
  ASSERT_EQ(lab_.admin({"user", "code", "tom", "--code-file", right_file}), kExitDone);
  const auto lesson = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain",
                                          "30"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return lab_.startStation(name, arguments);
  };

  lab_.startServer();
  auto wrong = lesson("wrong", {"--code-file", wrong_file});
  EXPECT_EQ(wrong->wait(), kExitFailed) << wrong->said();
  EXPECT_THAT(wrong->said(), HasSubstr("not the code of tom"));
  EXPECT_EQ(lab_.sessions().size(), 1u) << "only the earlier lesson: nothing was recorded";
  auto right = lesson("right", {"--code-file", right_file});
  ASSERT_EQ(right->wait(), kExitDone) << right->said();
  const StoredSession checked = lab_.stored(lab_.summary("right")["session_id"]);
  EXPECT_TRUE(checked.info.description().code_checked());
  EXPECT_FALSE(checked.info.unknown_trainee());
  EXPECT_FALSE(checked.info.code_unchecked());

  // without the server the lesson still begins, and the trainee learns what happens to it
  ASSERT_EQ(lab_.stopServer(), kExitDone);
  auto away = lab_.startStation("away", {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain",
                                         "0.2", "--code-file", right_file});
  ASSERT_EQ(away->wait(), kExitDone) << away->said();
  EXPECT_THAT(away->said(), HasSubstr("your code was not checked. A manager confirms this session later."));
  const std::string id = lab_.summary("away")["session_id"];
  lab_.startServer();
  auto next = lesson("next", {"--code-file", right_file});
  ASSERT_EQ(next->wait(), kExitDone) << next->said();
  const StoredSession unchecked = lab_.stored(id);
  EXPECT_EQ(unchecked.info.state(), pb::SESSION_COMPLETE);
  EXPECT_FALSE(unchecked.info.description().code_checked());
  EXPECT_TRUE(unchecked.info.unknown_trainee());
  EXPECT_TRUE(unchecked.info.code_unchecked());
  EXPECT_FALSE(lab_.stored(lab_.summary("next")["session_id"]).info.unknown_trainee());

  // the station neither stores nor shows the code
  for (const auto& entry : std::filesystem::recursive_directory_iterator(lab_.path("spool")))
    if (entry.is_regular_file()) {
      EXPECT_EQ(readWholeFile(entry.path())->find("badge-of-tom"), std::string::npos) << entry.path();
    }
  const auto holdsNoCode = [&](const std::string& file) {
    const auto text = readWholeFile(lab_.path(file));
    ASSERT_TRUE(text.ok()) << text.error().message;
    EXPECT_EQ(text->find("badge-of-"), std::string::npos) << file;
  };
  for (const char* log : {"wrong.log", "right.log", "away.log", "next.log", "server.log"}) holdsNoCode(log);
  // those that did not begin have no summary
  for (const char* summary : {"right.json", "away.json", "next.json"}) holdsNoCode(summary);
}

TEST_F(OfflineTest, aSilentServerDelaysAProfileFileAtMostThreeSeconds) {
  lab_.startServer();
  lab_.signalServer(SIGSTOP);
  auto station = lab_.startStation(
      "station", {"--profile", NEEDLELAB_SAMPLES "/knee-adult.json", "--seconds", "60", "--drain", "0"});
  // a lesson from the server may take ten seconds
  const auto goesOn = [&] {
    return station->said().find("the server did not say within 3 s whether it knows the trainee") !=
           std::string::npos;
  };
  EXPECT_TRUE(eventually(goesOn, 60s)) << station->said();
  lab_.signalServer(SIGCONT);
  station->signal(SIGTERM);
  EXPECT_TRUE(station->wait().has_value()) << station->said();
}

TEST_F(OfflineTest, aServerThatIsAwayIsNotWaitedForAtTheEnd) {
  fillCacheAndStopServer();
  auto station =
      lab_.startStation("away", {"--exercise", "ball-free-practice", "--seconds", "0.5", "--drain", "60"});
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  EXPECT_THAT(station->said(), HasSubstr("comes from the cache"));
  // otherwise it reports what could not be sent within --drain (DrainEnd::kTimeOver)
  EXPECT_THAT(station->said(), HasSubstr("not connected"));
  EXPECT_THAT(station->said(), HasSubstr("the spool keeps everything"));
  EXPECT_THAT(station->said(), testing::Not(HasSubstr("within --drain")));
  EXPECT_GE(lab_.summary("away")["spool_left"], 1);
}

TEST_F(OfflineTest, aServerThatComesInMidLessonGetsAllOfIt) {
  fillCacheAndStopServer();
  auto station =
      lab_.startStation("station", {"--exercise", "ball-free-practice", "--seconds", "4", "--drain", "30"});
  std::this_thread::sleep_for(1500ms);
  lab_.startServer();
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  const auto summary = lab_.summary("station");
  EXPECT_EQ(summary["state"], "COMPLETE") << station->said();
  EXPECT_EQ(summary["samples_acked"], summary["samples"]);
  const auto stored = lab_.stored(summary["session_id"]);
  EXPECT_EQ(stored.samples.size(), summary["samples"]);
  // complete from its beginning: only ticks that a busy machine's loop missed precede the first sample
  EXPECT_LE(stored.samples.front().tick, summary["missed_ticks"].get<std::uint64_t>());
}

TEST_F(OfflineTest, theListTellsWhatCanBePractisedWithAndWithoutTheServer) {
  fillCacheAndStopServer();
  const auto rowsOf = [&](const std::string& name) {
    std::map<std::string, nlohmann::json> rows;
    const auto summary = lab_.summary(name);
    for (const auto& row : summary["rows"]) rows[row["exercise_id"]] = row;
    return rows;
  };
  Process offline("needlelab-station",
                  {"--list-exercises", "--spool", lab_.path("spool"), "--json", lab_.path("offline.json")},
                  lab_.path("offline.log"));
  ASSERT_EQ(offline.wait(), kExitDone) << offline.said();
  auto rows = rowsOf("offline");
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows["ball-free-practice"]["cached"], true);
  EXPECT_EQ(rows["ball-free-practice"]["on_server"], nullptr);
  EXPECT_NE(rows["ball-free-practice"]["name"], "");
  EXPECT_THAT(offline.said(), HasSubstr("yes: profile phantom-ball, revision"));

  lab_.startServer();
  auto arguments = lab_.stationArguments({"--list-exercises", "--json", lab_.path("online2.json")});
  Process online("needlelab-station", arguments, lab_.path("online2.log"));
  ASSERT_EQ(online.wait(), kExitDone) << online.said();
  rows = rowsOf("online2");
  EXPECT_GT(rows.size(), 3u);
  EXPECT_EQ(rows["ball-free-practice"]["on_server"], true);
  EXPECT_EQ(rows["knee-recess"]["cached"], false);

  // nothing cached, the server away
  ASSERT_EQ(lab_.stopServer(), kExitDone);
  Process nothing("needlelab-station", lab_.stationArguments({"--list-exercises"}, lab_.path("empty")),
                  lab_.path("nothing.log"));
  EXPECT_EQ(nothing.wait(), kExitFailed);
  EXPECT_THAT(nothing.said(), HasSubstr("no exercise is cached"));

  // nothing cached, no server
  Process bodies("needlelab-station",
                 {"--list-exercises", "--spool", lab_.path("empty"), "--json", lab_.path("bodies.json")},
                 lab_.path("bodies.log"));
  EXPECT_EQ(bodies.wait(), kExitDone);
  EXPECT_THAT(bodies.said(), HasSubstr("yes: built in, profile shoulder-median"));
  EXPECT_EQ(rowsOf("bodies")["knee-heavy"]["built_in"], true);
}

TEST_F(OfflineTest, aLessonOnABuiltInBodyIsScoredHereAndUploadedOnceThereIsAServer) {
  auto station = alone("body", {"--exercise", "wrist-median", "--uncapped", "--hand-speed-m-s", "0.04"});
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  EXPECT_THAT(station->said(), HasSubstr("exercise wrist-median is built in"));
  const auto summary = lab_.summary("body");
  EXPECT_EQ(summary["score_source"], "station");
  EXPECT_EQ(summary["samples_lost"], 0);
  EXPECT_EQ(scoreOf(summary, "target_reached"), 1);
  EXPECT_EQ(scoreOf(summary, "injected_in_target_share"), 1);
  const auto required = [](const nlohmann::json& rows) {
    return std::count_if(rows.begin(), rows.end(), [](const auto& row) {
      return row.contains("passed") && row["passed"].is_boolean();
    });
  };
  EXPECT_EQ(required(summary["score"]), 9) << "time limit and eight requirements make the verdict";

  lab_.startServer();
  auto later =
      lab_.startStation("later", {"--exercise", "ball-free-practice", "--seconds", "0.3", "--drain", "30"});
  ASSERT_EQ(later->wait(), kExitDone) << later->said();
  const StoredSession stored = lab_.stored(summary["session_id"]);
  EXPECT_EQ(stored.info.state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(stored.info.description().exercise_id(), "wrist-median");
  EXPECT_EQ(stored.chunks, Lab::spooledChunks(lab_.path("spool"), summary["session_id"]));
}

TEST_F(OfflineTest, theLadderIsListedOfflineWithItsTimestamp) {
  fillCacheAndStopServer();
  ASSERT_EQ(lab_.admin({"assign", "tom", "--course", "rheumatology-basics"}), kExitDone);
  lab_.startServer();
  Process online("needlelab-station", lab_.stationArguments({"--list-exercises"}), lab_.path("ladder.log"));
  ASSERT_EQ(online.wait(), kExitDone) << online.said();
  const std::string first = "\nPhantoms: layered models\n  1.  ball-free-practice";
  EXPECT_THAT(online.said(), HasSubstr(first));
  EXPECT_THAT(online.said(), HasSubstr("Next")) << "0.3 s of it are not a pass";
  EXPECT_THAT(online.said(), Not(HasSubstr("as of")));

  ASSERT_EQ(lab_.stopServer(), kExitDone);
  Process away("needlelab-station", lab_.stationArguments({"--list-exercises"}), lab_.path("away.log"));
  ASSERT_EQ(away.wait(), kExitDone) << away.said();
  EXPECT_THAT(away.said(), HasSubstr("the server is away"));
  EXPECT_THAT(away.said(), HasSubstr("tom, as of 20"));
  EXPECT_THAT(away.said(), HasSubstr(first));
}

TEST_F(OfflineTest, aDamagedOrHostileCacheIsReportedAndNotRendered) {
  fillCacheAndStopServer();
  const auto file = lab_.path("spool") / "lessons" / "ball-free-practice.json";
  const std::string good = *readWholeFile(file);
  const auto refused = [&](const std::string& name, const std::string& text) {
    std::ofstream(file) << text;
    auto station = alone(name, {"--exercise", "ball-free-practice", "--seconds", "0.2"});
    EXPECT_EQ(station->wait(), kExitInvalid) << name << station->said();
    EXPECT_THAT(station->said(), HasSubstr("ball-free-practice.json")) << name;
    EXPECT_THAT(station->said(), HasSubstr("connect to the server")) << name;
    EXPECT_THAT(station->said(), Not(HasSubstr("\x1b"))) << name;
  };
  std::string flipped = good;
  const auto at = flipped.find("hash");
  flipped[at + 10] = flipped[at + 10] == '0' ? '1' : '0';
  refused("flipped", flipped);
  refused("torn", good.substr(0, good.size() / 2));
  refused("empty", "");
  refused("hostile", "\x1b[2J{\"exercise_json\": \"\x1b]0;x\x07\"}");

  // once the server is back, the damaged one is replaced
  lab_.startServer();
  auto online = lab_.startStation("online3", {"--exercise", "ball-free-practice", "--seconds", "0.2"});
  EXPECT_EQ(online->wait(), kExitDone) << online->said();
  ASSERT_EQ(lab_.stopServer(), kExitDone);
  auto whole = alone("whole", {"--exercise", "ball-free-practice", "--seconds", "0.2"});
  EXPECT_EQ(whole->wait(), kExitDone) << whole->said();
}

TEST_F(OfflineTest, lessonsContinueOverTheQuotaAndEveryoneIsTold) {
  lab_.startServer();
  auto online = lab_.startStation("online", {"--exercise", "ball-free-practice", "--seconds", "0.3"});
  ASSERT_EQ(online->wait(), kExitDone) << online->said();
  ASSERT_EQ(lab_.stopServer(), kExitDone);
  auto first = alone("first", {"--exercise", "ball-free-practice", "--seconds", "1.5"});
  ASSERT_EQ(first->wait(), kExitDone) << first->said();
  auto second =
      alone("second", {"--exercise", "ball-free-practice", "--seconds", "1.5", "--spool-quota", "0.001"});
  ASSERT_EQ(second->wait(), kExitDone) << second->said();
  const std::string said = second->said();
  const auto start = said.find("over its quota"), end = said.rfind("over its quota");
  ASSERT_NE(start, std::string::npos) << said;
  EXPECT_NE(start, end) << "at the start and at the end\n" << said;
  EXPECT_THAT(said, HasSubstr("kept nevertheless"));
  EXPECT_THAT(said, HasSubstr("connect to the server"));
  EXPECT_TRUE(std::filesystem::exists(lab_.path("spool") / std::string(lab_.summary("first")["session_id"]) /
                                      "chunks"));
}

}  // namespace
}  // namespace needlelab::test
