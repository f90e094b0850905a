// Commands for sessions, remarks, scores and references: searches, unusual texts, tables for other programs.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "common/base/files/files.h"
#include "common/scoring/measures/measures.h"
#include "db/sessions/session_results.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using Arguments = std::vector<std::string>;

const std::string kUnknownSession = "019aa0c3-7c1e-7b3a-9d5e-0123456789ab";
const std::string kCommaName = "O'Neil, \"Zoë\"";

class SessionCommands : public test::AdminTest {
 protected:
  /// Adds a closed session without samples. `measures`: its score; empty: no score.
  std::string attempt(const std::string& trainee, const std::string& exercise,
                      const std::string& measures) const {
    auto store = test::TestDb::must(Store::open(data(), {}));
    const Uuid id = makeUuidV7();
    EXPECT_OK(store->writer().run([&](Connection& c) -> Status {
      if (const auto known = StationStore(c).find("station-1"); known.ok() && !known->has_value())
        RETURN_IF_ERROR(StationStore(c).add("station-1", StationKeyBytes{}, 1));
      auto description = test::describe(id);
      description.set_trainee(trainee);
      description.set_exercise_id(exercise);
      RETURN_IF_ERROR(SessionStore(c).open(description, 1));
      RETURN_IF_ERROR(SessionStore(c).close(test::closeOf(id, 0), 2));
      return measures.empty() ? Status() : ScoreStore(c).put(test::scoreOf(id, measures));
    }));
    return uuidText(id);
  }
  static std::string force(double newton) {
    return json::array({{{"measure", "peak_force_n"}, {"value", newton}, {"unit", "N"}, {"words", ""}}})
        .dump();
  }
  /// The rows and cells of a CSV with quotes.
  static std::vector<Arguments> cells(const std::string& csv) {
    std::vector<Arguments> rows(1, Arguments(1));
    bool quoted = false;
    for (std::size_t i = 0; i < csv.size(); ++i) {
      if (csv[i] == '"' && quoted && i + 1 < csv.size() && csv[i + 1] == '"')
        rows.back().back() += csv[i++];
      else if (csv[i] == '"')
        quoted = !quoted;
      else if (csv[i] == ',' && !quoted)
        rows.back().emplace_back();
      else if (csv[i] == '\n' && !quoted)
        rows.emplace_back(1);
      else
        rows.back().back() += csv[i];
    }
    EXPECT_FALSE(quoted);
    rows.pop_back();  // after the last line end
    return rows;
  }
};

TEST_F(SessionCommands, aSearchTakesItsTextAsItIs) {
  for (const std::string name : {"a_b", "axb", "100%", "x' OR '1'='1", "Zoë"})
    attempt(name, "knee-recess", "");
  const std::tuple<const char*, std::string, std::vector<std::string>> cases[] = {
      {"--search", "_", {"a_b"}},    {"--search", "%", {"100%"}},      {"--search", "' OR", {"x' OR '1'='1"}},
      {"--search", "zo", {"Zoë"}},   {"--search", "ë", {"Zoë"}},       {"--trainee", "a%b", {}},
      {"--trainee", "axb", {"axb"}}, {"--trainee", "' OR '1'='1", {}}, {"--station", "station_1", {}},
  };
  for (const auto& [option, text, names] : cases) {
    std::vector<std::string> found;
    for (const auto& row : good({"session", "list", option, text, "--json"}).rows())
      found.push_back(row.at("trainee"));
    EXPECT_EQ(found, names) << option << " " << text;
  }
}

TEST_F(SessionCommands, aSessionOfAnUnknownTraineeIsListedAndAssigned) {
  good({"user", "add", "tom", "--role", "trainee"});
  attempt("tom", "knee-recess", "");
  const std::string id = attempt("tmo", "knee-recess", "");
  const auto waiting = [&] { return good({"session", "list", "--unknown-trainee", "--json"}).rows(); };
  ASSERT_EQ(waiting().size(), 1u);
  EXPECT_EQ(waiting()[0].at("session_id"), id);
  EXPECT_EQ(waiting()[0].at("unknown_trainee"), true);
  EXPECT_THAT(good({"session", "show", id}).out, HasSubstr("nobody was named 'tmo' when it came"));
  EXPECT_THAT(good({"session", "assign", id, "--to", "tom", "--reason", "a typing error"}).out,
              HasSubstr("the session that its station gave as 'tmo' is tom's now"));
  EXPECT_TRUE(waiting().empty());
  const auto row = good({"session", "show", id, "--json"}).rows().at(0);
  EXPECT_EQ(row.at("trainee"), "tom");
  EXPECT_EQ(row.at("given_trainee"), "tmo");
  EXPECT_EQ(row.at("unknown_trainee"), false);
  EXPECT_EQ(good({"session", "list", "--trainee", "tom", "--json"}).rows().size(), 2u);
  const auto audit = good({"audit", "--json"}).rows();
  EXPECT_TRUE(std::any_of(audit.begin(), audit.end(), [&](const json& line) {
    return line.at("action") == "session assign" && line.at("subject") == id &&
           line.at("detail") == "from tmo to tom: a typing error";
  }));
}

TEST_F(SessionCommands, sessionsThatWaitForACodeAreConfirmedAllAtOnce) {
  for (const char* name : {"tom", "tim"}) {
    good({"user", "add", name, "--role", "trainee"});
    good({"user", "code", name, "--make"});
  }
  const std::string toms = attempt("tom", "knee-recess", ""), tims = attempt("tim", "knee-recess", ""),
                    ghosts = attempt("tmo", "knee-recess", "");
  // open, under a name that no account has: its row says that it is tom's, without a code
  addSession(1, true,
             "UPDATE sessions SET trainee = (SELECT ref FROM accounts WHERE name = 'tom') WHERE state = 1;"
             "UPDATE unknown_trainees SET code_unchecked = 1 WHERE session IN (SELECT number FROM sessions"
             " WHERE state = 1)");
  const auto why = [&] {
    std::map<std::string, std::string> found;
    for (const auto& row : good({"session", "list", "--unknown-trainee", "--json"}).rows())
      found[row.at("session_id")] = row.at("why");
    return found;
  };
  auto reasons = why();
  EXPECT_EQ(reasons.size(), 4u);
  EXPECT_EQ(reasons.at(toms), "code not checked");
  EXPECT_EQ(reasons.at(ghosts), "no such name");
  EXPECT_THAT(good({"session", "list", "--unknown-trainee"}).out, HasSubstr("WAITS BECAUSE"));
  EXPECT_THAT(good({"session", "list"}).out, testing::Not(HasSubstr("WAITS BECAUSE")));
  EXPECT_THAT(good({"session", "show", toms}).out,
              HasSubstr("nobody gave the code of 'tom': session confirm"));
  EXPECT_EQ(good({"session", "show", toms, "--json"}).rows().at(0).at("code_unchecked"), true);

  const auto nothing = good({"session", "confirm", "--station", "station-2"});
  EXPECT_THAT(nothing.err, HasSubstr("no session waits for a code"));
  EXPECT_EQ(nothing.out, "");
  const auto some = good({"session", "confirm", "--trainee", "tim"});
  EXPECT_THAT(some.out, HasSubstr(tims));
  EXPECT_THAT(some.out, HasSubstr("1 of 1 confirmed, 0 still open"));
  const auto all = good({"session", "confirm"});
  EXPECT_THAT(all.out, HasSubstr("1 of 2 confirmed, 1 still open"));
  reasons = why();
  EXPECT_EQ(reasons.size(), 2u) << "the open one, and the one of a name that nobody has";
  EXPECT_TRUE(reasons.contains(ghosts));
  EXPECT_EQ(good({"session", "show", toms, "--json"}).rows().at(0).at("given_trainee"), "tom");
  EXPECT_THAT(good({"session", "show", toms}).out, HasSubstr("\na manager confirmed it"));
  EXPECT_THAT(good({"session", "show", toms}).out, testing::Not(HasSubstr("assigned")));
  const auto audit = good({"audit", "--json"}).rows();
  EXPECT_EQ(std::count_if(audit.begin(), audit.end(),
                          [](const json& line) {
                            return line.at("action") == "session assign" &&
                                   line.at("detail") == "from tom to tom: confirmed without a code";
                          }),
            1);
}

TEST_F(SessionCommands, aSessionThatCannotBeConfirmedIsNamedAndTheOthersAre) {
  good({"user", "add", "tom", "--role", "trainee"});
  good({"user", "code", "tom", "--make"});
  const std::string first = attempt("tom", "knee-recess", ""), second = attempt("tom", "knee-recess", "");
  {
    auto store = test::TestDb::must(Store::open(data(), {}));
    ASSERT_OK(store->writer().run([&](Connection& c) {
      return c.run("UPDATE sessions SET erased = 1 WHERE id = ?", ByteView(*parseUuid(first)));
    }));
  }
  const auto result = onData({"session", "confirm"});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.out, HasSubstr("the data of its person was erased"));
  EXPECT_THAT(result.out, HasSubstr("1 of 2 confirmed, 0 still open"));
  EXPECT_THAT(result.err, HasSubstr("1 sessions could not be confirmed"));
  EXPECT_EQ(good({"session", "show", second, "--json"}).rows().at(0).at("code_unchecked"), false);
}

TEST_F(SessionCommands, aNameOfQuotesAndCommasStaysWholeInTableAndJson) {
  const std::string id = attempt(kCommaName, "knee-recess", "");
  EXPECT_EQ(good({"session", "show", id, "--json"}).rows()[0].at("trainee"), kCommaName);
  EXPECT_EQ(good({"session", "list", "--trainee", kCommaName, "--json"}).rows()[0].at("session_id"), id);
  EXPECT_THAT(good({"session", "list"}).out, HasSubstr("  " + kCommaName + "  knee-recess  "));
}

TEST_F(SessionCommands, anUnreadableProfileIsNullAndTheRestIsShown) {
  const std::string id = uuidText(addSession(2, false, "UPDATE sessions SET profile_json = '{broken'"));
  const auto row = good({"session", "show", id, "--json"}).rows().at(0);
  EXPECT_TRUE(row.at("profile").is_null());
  EXPECT_EQ(row.at("samples"), 40);
  EXPECT_THAT(good({"session", "show", id}).out, HasSubstr(id));
  good({"session", "export", id, "--format", "json", "--out", file("s.json")});
  const auto whole = json::parse(*readWholeFile(file("s.json")));
  EXPECT_TRUE(whole.at("session").at("profile").is_null());
  EXPECT_EQ(whole.at("rows").size(), 40u);
}

TEST_F(SessionCommands, aRemarkKeepsItsLinesInJsonOnly) {
  const std::string id = uuidText(addSession(1));
  const std::string remark = "first \"line\"\nsecond, é", longest(4096, 'x');
  good({"annotate", id, "--tick", "7", "--text", remark});
  good({"annotate", id, "--text", longest});
  const auto notes = good({"session", "show", id, "--json"}).rows()[0].at("annotations");
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_EQ(notes[0].at("tick"), 0) << "they come by tick";
  EXPECT_EQ(notes[0].at("text"), longest);
  EXPECT_EQ(notes[1].at("tick"), 7);
  EXPECT_EQ(notes[1].at("text"), remark);
  EXPECT_THAT(good({"session", "show", id}).out, HasSubstr("  first \"line\" second, é\n"));
}

TEST_F(SessionCommands, aWrongRemarkIsNamedAndNotStored) {
  const std::string id = uuidText(addSession(1));
  const std::tuple<Arguments, int, std::string> cases[] = {
      {{id, "--text", ""}, 2, "text: has 0 bytes, allowed are 1 to 4096"},
      {{id, "--text", std::string(4097, 'x')}, 2, "text: has 4097 bytes, allowed are 1 to 4096"},
      {{id, "--text", "a\x1b[2J"}, 2, "text: holds a control character"},
      {{id, "--text", "caf\xe9"}, 2, "text: is not valid UTF-8 text"},
      {{id, "--text", "x", "--tick", "-1"}, 2, "-1"},
      {{id, "--text", "x", "--tick", "soon"}, 2, "soon"},
      {{"x" + id.substr(1), "--text", "x"}, 2, "is not a session id: 36 characters"},
      {{"ffff", "--text", "x"}, 1, "no session's id begins with 'ffff'"},
      {{kUnknownSession, "--text", "x"}, 1, "there is no session " + kUnknownSession},
  };
  for (const auto& [arguments, code, words] : cases) {
    Arguments all = {"annotate"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Run result = onData(all);
    EXPECT_EQ(result.code, code) << words;
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_EQ(result.out, "") << words;
  }
  EXPECT_TRUE(good({"session", "show", id, "--json"}).rows()[0].at("annotations").empty());
}

TEST_F(SessionCommands, aSessionIsNamedByTheBeginningOfItsIdOrAsNewest) {
  good({"station", "add", "station-9", "--out", file("key")});
  EXPECT_THAT(onData({"session", "show", "newest"}).err, HasSubstr("there is no session yet"));
  const std::string first = attempt("ann", "knee-recess", ""), second = attempt("tom", "knee-recess", "");
  const auto shown = [&](const std::string& name) {
    return good({"session", "show", name, "--json"}).rows().at(0).at("session_id");
  };
  const auto newest = good({"session", "list", "--json", "--limit", "1"}).rows().at(0).at("session_id");
  EXPECT_EQ(shown("newest"), newest);
  std::size_t same = 0;
  while (first[same] == second[same]) ++same;
  EXPECT_EQ(shown(first.substr(0, same + 1)), first);
  std::string upper = second.substr(0, same + 1);
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  EXPECT_EQ(shown(upper), second);
  const Run both = onData({"session", "show", first.substr(0, 4)});
  EXPECT_EQ(both.code, 2);
  for (const std::string& name :
       {std::string("the ids of 2 sessions begin with"), first + "  ", second + "  "})
    EXPECT_THAT(both.err, HasSubstr(name));
}

TEST_F(SessionCommands, aScoreIsShownAsItIsStored) {
  const std::string id = attempt(
      "tom", "knee-recess",
      R"([{"measure":"peak_force_n","value":8.25,"unit":"N","max":5,"passed":false,"words":"two\nlines"},)"
      R"({"measure":"elapsed_s","value":null,"unit":"s","words":"é"}])");
  const auto row = good({"session", "score", id, "--json"}).rows().at(0);
  EXPECT_EQ(row.at("definition_version"), 1);
  EXPECT_EQ(row.at("first"), true);
  ASSERT_EQ(row.at("measures").size(), 2u);
  EXPECT_EQ(row.at("measures")[0].at("words"), "two\nlines");
  EXPECT_TRUE(row.at("measures")[1].at("value").is_null());
  const std::string text = good({"session", "score", id}).out;
  EXPECT_THAT(text, HasSubstr("\npeak_force_n  8.25 N  not passed  two lines\n"));
  EXPECT_THAT(text, HasSubstr("\nelapsed_s     -       -           é\n"));
  EXPECT_EQ(good({"session", "score", id, "--version", "1", "--json"}).rows().at(0), row);
  const std::string without = attempt("tom", "knee-recess", "");
  for (const Arguments& missing : {Arguments{id, "--version", "7"}, {without}, {kUnknownSession}}) {
    Arguments all = {"session", "score"};
    all.insert(all.end(), missing.begin(), missing.end());
    const Run result = onData(all);
    EXPECT_EQ(result.code, 1) << missing[0];
    EXPECT_EQ(result.out, "");
    EXPECT_THAT(result.err, HasSubstr("session " + missing[0]));
  }
}

TEST_F(SessionCommands, aResultCountsThePersonsAttempts) {
  good({"user", "add", "tom", "--role", "trainee"});
  good({"user", "add", "zoe", "--role", "trainee"});
  for (int i = 0; i < 3; ++i) attempt("tom", "knee-recess", force(1));
  attempt("zoe", "knee-recess", force(1));
  std::map<std::string, std::string> cells_of;
  for (const json& row : good({"results", "rheumatology-basics", "--json"}).rows())
    cells_of[row.at("trainee")] = row.at("knee-recess");
  EXPECT_EQ(cells_of["tom"], "tried, 3 attempts");
  EXPECT_EQ(cells_of["zoe"], "tried, 1 attempt");
}

TEST_F(SessionCommands, theTableOfScoresKeepsNamesApartAndFormulasHarmless) {
  good({"user", "add", kCommaName, "--role", "trainee"});
  good({"group", "set", "g"});
  good({"group", "join", "g", kCommaName});
  const std::string quoted =
      attempt(kCommaName, "knee-recess",
              R"([{"measure":"peak_force_n","value":0.1,"unit":"N","max":5,"passed":true},)"
              R"({"measure":"elapsed_s","value":null,"unit":"s"}])");
  attempt("=1+1", "ball-free-practice", force(3));
  attempt("nobody", "knee-recess", "");
  const auto exported = [&](const Arguments& more) {
    Arguments all = {"scores", "export", "--out", file("scores.csv"), "--replace"};
    all.insert(all.end(), more.begin(), more.end());
    good(all);
    return cells(*readWholeFile(file("scores.csv")));
  };
  const auto rows = exported({});
  ASSERT_EQ(rows.size(), 4u) << "a head, and a row for each measure";
  const Arguments& head = rows[0];
  const auto cell = [&](std::size_t row, const std::string& column) {
    const auto at = static_cast<std::size_t>(std::find(head.begin(), head.end(), column) - head.begin());
    return rows.at(row).at(at);
  };
  for (const auto& row : rows) EXPECT_EQ(row.size(), head.size());
  EXPECT_EQ(cell(1, "trainee"), "'=1+1");
  EXPECT_EQ(std::stod(cell(1, "value")), 3);
  EXPECT_EQ(cell(1, "passed"), "") << "nothing is required";
  EXPECT_EQ(cell(2, "trainee"), kCommaName);
  EXPECT_EQ(cell(2, "session"), quoted);
  EXPECT_EQ(cell(2, "exercise"), "knee-recess");
  EXPECT_EQ(std::stod(cell(2, "value")), 0.1);
  EXPECT_EQ(cell(2, "passed"), "1");
  EXPECT_EQ(cell(3, "measure"), "elapsed_s");
  EXPECT_EQ(cell(3, "value"), "") << "nothing was measured";
  EXPECT_EQ(exported({"--group", "g"}).size(), 3u);
  EXPECT_EQ(exported({"--course", "rheumatology-basics"}).size(), 4u);
  EXPECT_EQ(exported({"--course", "injection-steps"}).size(), 1u);
}

TEST_F(SessionCommands, anUnreadableScoreIsNamedAndTheOldFileStays) {
  attempt("anna", "knee-recess", force(1));
  const std::string bad = attempt("tom", "knee-recess", force(2));
  {
    auto store = test::TestDb::must(Store::open(data(), {}));
    ASSERT_OK(store->writer().run([](Connection& c) {
      return c.script(
          "UPDATE scores SET measures = '{broken' WHERE session = (SELECT max(number) FROM sessions)");
    }));
  }
  folder.write("scores.csv", "old");
  const Run result = onData({"scores", "export", "--out", file("scores.csv"), "--replace"});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.err, HasSubstr("session " + bad + ": "));
  EXPECT_EQ(*readWholeFile(file("scores.csv")), "old");
  EXPECT_EQ(onData({"scores", "export", "--format", "xml", "--out", file("new.csv")}).code, 2);
  EXPECT_EQ(onData({"scores", "export", "--out", file("none/new.csv")}).code, 2);
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++files;
  EXPECT_EQ(files, 2u) << "something is left beside the folder and the old file";
}

TEST_F(SessionCommands, aSessionThatCannotBeScoredIsLeftAloneAndNamed) {
  const std::string id = uuidText(addSession(3));  // its profile has no layers
  EXPECT_THAT(good({"scores", "rescore", "--dry-run"}).out, HasSubstr("would be scored: 1 sessions"));
  EXPECT_THAT(good({"scores", "rescore", "--exercise", "knee-recess"}).out, HasSubstr("scored: 0 sessions"));
  const Run unknown = onData({"scores", "rescore", "--exercise", "hip-1"});
  EXPECT_EQ(unknown.code, 1);
  EXPECT_THAT(unknown.err,
              HasSubstr("'hip-1' is not an exercise of any curriculum or stored session; there are: "));
  EXPECT_THAT(unknown.err, HasSubstr("knee-recess"));
  const Run again = good({"scores", "rescore", "--json"});
  ASSERT_EQ(again.rows().size(), 1u);
  EXPECT_EQ(again.rows()[0].at("session_id"), id);
  EXPECT_NE(again.rows()[0].at("text"), "");
  EXPECT_THAT(again.err, HasSubstr("scored: 0 sessions, by definition version " +
                                   std::to_string(kScoreDefinitionVersion) + "; 1 left alone"));
  EXPECT_EQ(onData({"session", "score", id}).code, 1);
}

TEST_F(SessionCommands, aReferenceIsOfClosedSessionsOfItsExercise) {
  const std::string low = attempt("ada", "knee-recess", force(3)),
                    high = attempt("ada", "knee-recess", force(8));
  EXPECT_THAT(good({"reference", "show", "knee-recess"}).err, HasSubstr("no session of experts"));
  EXPECT_EQ(good({"reference", "set", "knee-recess", low, high}).out,
            "the reference of 'knee-recess' is revision 1, of 2 sessions\n");
  const std::string before = good({"reference", "show", "knee-recess", "--json"}).out;
  const auto band = json::parse(before).at("rows").at(0);
  EXPECT_EQ(band.at("measure"), "peak_force_n");
  EXPECT_EQ(band.at("n"), 2);
  EXPECT_DOUBLE_EQ(band.at("mean").get<double>(), 5.5);

  const std::tuple<Arguments, int, std::string> cases[] = {
      {{"knee-recess", "123"}, 2, "'123' is not a session id: 36 characters"},
      {{"knee-recess", low, low}, 2, low},
      {{"knee-recess", low, kUnknownSession}, 1, "there is no session " + kUnknownSession},
  };
  for (const auto& [arguments, code, words] : cases) {
    Arguments all = {"reference", "set"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Run result = onData(all);
    EXPECT_EQ(result.code, code) << words;
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_EQ(good({"reference", "show", "knee-recess", "--json"}).out, before) << words;
  }
  EXPECT_THAT(good({"reference", "set", "knee-recess"}).out, HasSubstr("revision 2, of 0 sessions"));
  EXPECT_TRUE(good({"reference", "show", "knee-recess", "--json"}).rows().empty());
}

}  // namespace

}  // namespace needlelab
