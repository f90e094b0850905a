// Commands for patients, courses and assignments: bad files, revisions, assignments to people and classes.
#include <gmock/gmock.h>

#include <filesystem>

#include "common/base/files/files.h"
#include "tests/support/anatomy/ball_profiles.h"
#include "tests/support/time_zone.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;
using Arguments = std::vector<std::string>;

class ProfileCommands : public test::AdminTest {
 protected:
  void SetUp() override {
    good({"user", "add", "tom", "--role", "trainee"});
    profile_ = json::parse(*readWholeFile(NEEDLELAB_SAMPLES "/knee-adult.json"));
    profile_["id"] = "mine";
    profile_["name"] = "Gelenk \"links\", Zoë";
    profile_["description"] = "two\nlines";
  }
  std::string write(const std::string& name, const json& value) const {
    return folder.write(name, value.dump()).string();
  }
  bool known(const std::string& id) const { return onData({"profile", "show", id}).code == 0; }
  json profile_;
};

TEST_F(ProfileCommands, aBadProfileNamesTheFaultAndStoresNoFile) {
  const auto other = [&](const char* field, const json& value) {
    json copy = profile_;
    copy["id"] = "other";
    copy[json::json_pointer(field)] = value;
    return copy.dump();
  };
  const std::pair<std::string, std::string> cases[] = {
      {other("/layers/1/cutting_force_n", 75), "layers[1].cutting_force_n: 75 is out of range [0, 50]"},
      {other("/name", std::string(201, 'x')), "name: has 201 bytes, allowed are 1 to 200"},
      {other("/name", "a\x1b[2J"), "name: has control characters"},
      {"{\"id\": \"other\"", "not valid JSON"},
      {"", "bad.json"},
  };
  const auto fine = write("fine.json", profile_);
  for (const auto& [text, words] : cases) {
    const auto bad = folder.write("bad.json", text).string();
    const Run result = onData({"profile", "import", fine, bad});
    EXPECT_EQ(result.code, 2) << words;
    EXPECT_THAT(result.err, HasSubstr("needlelab-admin: " + bad + ": "));
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_THAT(result.err, Not(HasSubstr("\x1b")));
    EXPECT_EQ(result.out, "") << words;
    EXPECT_FALSE(known("mine")) << "the file before the bad one was stored: " << words;
    EXPECT_FALSE(known("other")) << words;
  }
  EXPECT_EQ(good({"profile", "import", fine, NEEDLELAB_SAMPLES "/knee-adult.json"}).out,
            "profile 'mine' is revision 1\nprofile 'knee-adult' is revision 1\n");
}

TEST_F(ProfileCommands, aProfileWhoseSkinLeavesAPlanIsImportedWithAWarning) {
  auto shoulder = json::parse(*readWholeFile(NEEDLELAB_SAMPLES "/shoulder-adult.json"));
  shoulder["limb"]["sphere"]["center_m"]["z"] = -0.063;  // before, its top was at the plan's entry
  const auto file = write("sunk.json", shoulder);
  const Run done = good({"profile", "import", file});
  EXPECT_EQ(done.out, "profile 'shoulder-adult' is revision 2\n");
  EXPECT_THAT(done.err,
              HasSubstr(file + ": warning: exercise 'shoulder-bursa' of course 'rheumatology-basics': "
                               "plan.entry_m: (0, 0, 0) mm is 3 mm above the skin"));
}

TEST_F(ProfileCommands, aProfileThatTheStoreRefusesIsNamedByItsFile) {
  profile_["name"] =
      "a\xc2\x9b"
      "31m";  // a control character of two bytes
  const auto bad = write("bad.json", profile_);
  const Run result = onData({"profile", "import", bad});
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.err, HasSubstr(bad + ": profile name: holds a control character"));
  EXPECT_FALSE(known("mine"));
}

TEST_F(ProfileCommands, aDifferentProfileBecomesANewRevision) {
  const auto first = write("first.json", profile_);
  profile_["layers"][1]["thickness_m"] = 0.0075;
  const auto second = write("second.json", profile_);
  for (const auto& [path, revision] : {std::pair(first, 1), {first, 1}, {second, 2}, {second, 2}})
    EXPECT_EQ(good({"profile", "import", path}).out,
              "profile 'mine' is revision " + std::to_string(revision) + "\n");
  const auto layer = [&](const Arguments& which) {
    Arguments arguments = {"profile", "show", "mine", "--json"};
    arguments.insert(arguments.begin() + 3, which.begin(), which.end());
    return good(arguments).rows()[0].at("profile").at("layers")[1].at("thickness_m").get<double>();
  };
  EXPECT_EQ(layer({"--revision", "1"}), 0.006);
  EXPECT_EQ(layer({"--revision", "2"}), 0.0075);
  EXPECT_EQ(layer({}), 0.0075);
  for (const char* command : {"show", "export"}) {
    const Run missing = onData({"profile", command, "mine", "--revision", "3"});
    EXPECT_EQ(missing.code, 1) << command;
    EXPECT_THAT(missing.err, HasSubstr("no profile 'mine' of revision 3"));
    EXPECT_EQ(missing.out, "");
    EXPECT_EQ(onData({"profile", command, "mine", "--revision", "-1"}).code, 2) << command;
  }
  // the list has one row: the newest revision, with the name as typed
  int rows = 0;
  for (const auto& row : good({"profile", "list", "--json"}).rows()) {
    if (row.at("id") != "mine") continue;
    ++rows;
    EXPECT_EQ(row.at("revision"), 2);
    EXPECT_EQ(row.at("name"), "Gelenk \"links\", Zoë");
  }
  EXPECT_EQ(rows, 1);
}

TEST_F(ProfileCommands, showingAProfileWrapsLinesAndWarnsOfImperceptibleParts) {
  profile_["layers"][0]["thickness_m"] = 0.00001;
  const auto path = write("thin.json", profile_);
  EXPECT_THAT(good({"profile", "import", path}).err,
              HasSubstr(path + ": warning: layers[0] (skin, 0.01 mm)"));
  const std::string text = good({"profile", "show", "mine"}).out;
  EXPECT_THAT(text, HasSubstr("description  two lines\n"));
  EXPECT_THAT(text, HasSubstr("\nskin                  SKIN     0.01          0.8"));
  EXPECT_THAT(text, HasSubstr("\nsuprapatellar recess  OTHER    6"));
  EXPECT_THAT(text, HasSubstr("\nwarning: layers[0] (skin, 0.01 mm)"));
  const auto row = good({"profile", "show", "mine", "--json"}).rows()[0];
  EXPECT_EQ(row.at("description"), "two\nlines");
  EXPECT_FALSE(row.at("warnings").empty());
}

TEST_F(ProfileCommands, showingAVolumeListsItsStructuresWithTheirForces) {
  json tree = test::withCyst();
  tree["volume"]["structures"][3]["layer"]["cutting_force_n"] = 0.375;
  tree["volume"]["structures"][3]["layer"]["name"] = "ganglion";
  ASSERT_EQ(onData({"profile", "import", write("ball.json", tree)}).code, 0);
  const Run shown = onData({"profile", "show", "ball"});
  EXPECT_EQ(shown.code, 0) << shown.err;
  for (const char* words : {"CUTTING N", "skin", "fat", "muscle", "ganglion", "0.375"})
    EXPECT_THAT(shown.out, HasSubstr(words));
  EXPECT_THAT(shown.out, Not(HasSubstr("warning")));
}

TEST_F(ProfileCommands, anExportPrintsItsFilesTextWithOrWithoutJson) {
  good({"profile", "import", write("mine.json", profile_)});
  for (const Arguments& what :
       {Arguments{"profile", "export", "mine"}, {"curriculum", "export", "rheumatology-basics"}}) {
    Arguments to_file = what;
    to_file.insert(to_file.end(), {"--out", file("export.json"), "--replace"});
    EXPECT_EQ(good(to_file).out, "wrote " + file("export.json") + "\n");
    const std::string written = *readWholeFile(file("export.json"));
    EXPECT_EQ(json::parse(written).at("id"), what[2]);
    EXPECT_EQ(good(what).out, written);
    Arguments with_json = what;
    with_json.emplace_back("--json");
    EXPECT_EQ(good(with_json).out, written) << "nothing is printed with --json";
    Arguments unknown = to_file;
    unknown[2] = "nothing";
    EXPECT_EQ(onData(unknown).code, 1);
    EXPECT_EQ(*readWholeFile(file("export.json")), written) << "the file of before is gone";
  }
}

class CurriculumCommands : public ProfileCommands {
 protected:
  static json courseOf(const json& exercise = json::object()) {
    json whole = {{"id", "x1"}, {"name", "Die \"erste\" Übung"}, {"profile_id", "knee-adult"}};
    whole.update(exercise);
    return {{"id", "course-9"}, {"name", "Kurs „neu“, \"1\""}, {"exercises", json::array({whole})}};
  }
};

TEST_F(CurriculumCommands, aBadCourseIsNamedByItsFileAndStoresNothing) {
  json twice = courseOf();
  twice["exercises"].push_back(twice["exercises"][0]);
  const auto requiring = [](const json& requirement) {
    return courseOf({{"requirements", json::array({requirement})}});
  };
  const std::tuple<json, int, std::string> cases[] = {
      {twice, 2, "exercises[1].id: \"x1\" is used twice"},
      {requiring({{"measure", "luck"}, {"max", 1}}), 2, "\"luck\" is not one of elapsed_s"},
      {courseOf({{"profile_id", "nobody"}}), 1, "profile_id: there is no profile 'nobody': import it first"},
      {courseOf({{"id", "knee-recess"}}), 1,
       "already an exercise of this id in curriculum 'rheumatology-basics'"},
  };
  const std::string before = good({"curriculum", "list", "--json"}).out;
  for (const auto& [course, code, words] : cases) {
    const auto bad = write("bad.json", course);
    const Run result = onData({"curriculum", "import", bad});
    EXPECT_EQ(result.code, code) << words;
    EXPECT_THAT(result.err, HasSubstr("needlelab-admin: " + bad + ": "));
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_EQ(good({"curriculum", "list", "--json"}).out, before) << words;
  }
}

TEST_F(CurriculumCommands, aCourseThatDiffersReplacesItsExercises) {
  const auto first = write("first.json", courseOf());
  const auto second = write("second.json", courseOf({{"id", "x2"}}));
  EXPECT_EQ(good({"curriculum", "import", first}).out, "curriculum 'course-9' is revision 1\n");
  EXPECT_EQ(good({"curriculum", "import", first}).out, "curriculum 'course-9' is revision 1\n");
  EXPECT_EQ(good({"curriculum", "import", second}).out, "curriculum 'course-9' is revision 2\n");
  int rows = 0;
  for (const auto& row : good({"curriculum", "list", "--json"}).rows()) {
    if (row.at("id") != "course-9") continue;
    ++rows;
    EXPECT_EQ(row.at("name"), "Kurs „neu“, \"1\"");
    EXPECT_EQ(row.at("exercise_ids"), json::array({"x2"}));
  }
  EXPECT_EQ(rows, 1);
  EXPECT_EQ(good({"assign", "tom", "x2"}).out, "assigned 'x2' to 'tom'\n");
}

TEST_F(CurriculumCommands, aWrongAssignmentIsNamedAndNotMade) {
  good({"user", "add", "ines", "--role", "instructor", "--password-file",
        folder.write("pw", "correct horse").string()});
  const std::tuple<Arguments, int, std::string> cases[] = {
      {{}, 2, "give a trainee or --group"},
      {{"tom"}, 2, "give an exercise or --course"},
      {{"tom", "knee-recess", "--group", "g"}, 2, "give a trainee or --group"},
      {{"tom", "knee-recess", "--course", "rheumatology-basics"}, 2, "give an exercise or --course"},
      {{"tom", "knee-recess", "--due", "tomorrow"}, 2, "--due: 'tomorrow' is not a time"},
      {{"tom", "knee-recess", "--due", "2026-02-30T12:00Z"}, 2, "is not a valid date or time"},
      {{"ines", "knee-recess"}, 2, "'ines' is not a trainee"},
      {{"nobody", "knee-recess"}, 1, "no person named 'nobody'"},
      {{"--group", "nobody", "--course", "rheumatology-basics"}, 1, "no group 'nobody'"},
      {{"tom", "nothing"}, 1, "nothing"},
      {{"tom", "--course", "nothing"}, 1, "nothing"},
  };
  for (const auto& [arguments, code, words] : cases) {
    Arguments all = {"assign"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Run result = onData(all);
    EXPECT_EQ(result.code, code) << words;
    EXPECT_THAT(result.err, HasSubstr(words));
    EXPECT_EQ(result.out, "") << words;
  }
  EXPECT_TRUE(good({"assignments", "--json"}).rows().empty());
}

TEST_F(CurriculumCommands, theSameAssignmentAgainOnlyMovesItsDate) {
  good({"assign", "tom", "knee-recess"});
  EXPECT_EQ(good({"assignments", "--json"}).rows().at(0).at("due_unix_ns"), 0);
  good({"assign", "tom", "knee-recess", "--due", "2026-12-01T18:00+01:00"});
  const auto rows = good({"assignments", "--json"}).rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].at("due_unix_ns"), 1'796'144'400'000'000'000);
  const test::WithZone zone(test::kStJohns);
  EXPECT_THAT(good({"assignments"}).out, HasSubstr("2026-12-01 13:30:00 NST"));
  EXPECT_TRUE(good({"assignments", "--trainee", "nobody", "--json"}).rows().empty());
}

TEST_F(CurriculumCommands, anAssignmentIsWithdrawnOnceByItsNumberOnly) {
  good({"assign", "tom", "knee-recess"});
  const std::string number = good({"assignments", "--json"}).rows().at(0).at("id").dump();
  for (const auto& [wrong, code] : {std::pair("77", 1), {"-1", 2}, {"x", 2}}) {
    const Run result = onData({"unassign", wrong});
    EXPECT_EQ(result.code, code) << wrong;
    EXPECT_THAT(result.err, HasSubstr(wrong));
  }
  EXPECT_EQ(good({"assignments", "--json"}).rows().size(), 1u);
  EXPECT_EQ(good({"unassign", number}).out, "took assignment " + number + " back\n");
  EXPECT_TRUE(good({"assignments", "--json"}).rows().empty());
  EXPECT_EQ(onData({"unassign", number}).code, 1);
}

}  // namespace

}  // namespace needlelab
