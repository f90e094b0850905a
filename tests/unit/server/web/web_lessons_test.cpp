// The console's data: people, profiles, courses, sessions with their samples. Every reply fits openapi.json.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <string>

#include "server/live/monitor/monitor.h"
#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"
#include "tests/unit/server/web/web_lab.h"

namespace needlelab {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;

TEST(WebLessons, listsAndDocumentsAreAsTheyAreDescribed) {
  WebLab lab;
  const std::string id = lab.recorded(5);
  Browser ada = lab.browserOf("ada");
  const auto ok = [&](const std::string& path) {
    const WebReply reply = askChecked(ada, "GET", "/api/v1" + path);
    EXPECT_EQ(reply.status, 200) << path << reply.body;
    return reply.json();
  };
  EXPECT_EQ(ok("/people")["items"].size(), 5u);
  EXPECT_EQ(ok("/people/ines")["role"], "INSTRUCTOR");
  EXPECT_EQ(ok("/stations")["items"][0]["name"], "bench");
  const json profiles = ok("/profiles");
  ASSERT_GT(profiles["items"].size(), 0u);
  const std::string profile = profiles["items"][0]["id"];
  EXPECT_EQ(ok("/profiles/" + profile)["json"]["id"], profile);
  EXPECT_EQ(ok("/profiles/" + profile + "?revision=1")["revision"], 1);
  const json courses = ok("/courses");
  ASSERT_GT(courses["items"].size(), 0u);
  const std::string course = courses["items"][0]["id"];
  EXPECT_GT(ok("/courses/" + course)["json"]["exercises"].size(), 0u);
  const json sessions = ok("/sessions?trainee=tina");
  ASSERT_EQ(sessions["items"].size(), 1u);
  EXPECT_EQ(sessions["items"][0]["description"]["session_id"], id);
  EXPECT_EQ(ok("/sessions?exercise=other")["items"].size(), 0u);
  const std::size_t all = sessions["items"].size();
  const auto started_ms =
      static_cast<std::int64_t>(sessions["items"][0]["description"]["started_unix_ms"].get<double>());
  const auto found = [&](const std::string& query) {
    return ok("/sessions?trainee=tina&" + query)["items"].size();
  };
  EXPECT_EQ(found("search=TIN"), all);
  EXPECT_EQ(found("search=nobody"), 0u);
  EXPECT_EQ(found("from_ms=" + std::to_string(started_ms + 1)), 0u);
  EXPECT_EQ(found("to_ms=" + std::to_string(started_ms + 1)), all);
  EXPECT_EQ(found("verdict=passed") + found("verdict=failed") + found("verdict=none"), all);
  EXPECT_EQ(ok("/sessions/" + id)["samples"], 500);
  // It has no valid profile, so it cannot be scored.
  EXPECT_EQ(askChecked(ada, "GET", "/api/v1/sessions/" + id + "/score").status, 404);
  ok("/openapi.json");
  ok("/retention");
  ok("/audit");
  const WebReply remark = askChecked(ada, "POST", "/api/v1/sessions/" + id + "/annotations",
                                     R"({"t_s": 0.25, "text": "slow down"})");
  EXPECT_EQ(remark.status, 201) << remark.body;
  EXPECT_EQ(ok("/sessions/" + id + "/annotations")["items"][0]["t_s"], 0.25);
  EXPECT_EQ(askChecked(ada, "POST", "/api/v1/people",
                       R"({"name": "new", "role": "TRAINEE", "password": "correct horse battery"})")
                .status,
            201);
  EXPECT_EQ(askChecked(ada, "POST", "/api/v1/check", "{}").json()["ok"], true);
  const std::string copy = (lab.server().folder() / "copy.db").string();
  const WebReply backup = askChecked(ada, "POST", "/api/v1/backup", json{{"path", copy}}.dump());
  if (onPostgres()) {
    EXPECT_EQ(backup.status, 400) << backup.body;
    EXPECT_THAT(backup.body, testing::HasSubstr("PostgreSQL, whose own tools make its backups"));
  } else {
    EXPECT_EQ(backup.json()["path"], copy);
  }
  EXPECT_EQ(std::filesystem::exists(copy), !onPostgres());
  // The audit log names the user.
  bool noted = false;
  const json audit = ok("/audit?who=ada");
  for (const json& line : audit["items"]) noted = noted || line["action"] == "user add";
  EXPECT_TRUE(noted);
}

TEST(WebLessons, aCodeIsShownToItsMakerOnce) {
  WebLab lab;
  Browser mara = lab.browserOf("mara"), ada = lab.browserOf("ada");
  const auto set = [](Browser& who, const std::string& name, const std::string& body) {
    return askChecked(who, "POST", "/api/v1/people/" + name + "/code", body);
  };
  const WebReply made = set(mara, "tina", R"({"make": true})");
  ASSERT_EQ(made.status, 200) << made.body;
  EXPECT_EQ(made.json()["name"], "tina");
  const std::string pin = made.json()["code"];
  EXPECT_THAT(pin, testing::MatchesRegex("[0-9]{6}"));
  const auto hasCode = [&] { return askChecked(mara, "GET", "/api/v1/people/tina").json()["has_code"]; };
  EXPECT_EQ(hasCode(), true);
  const WebReply bad = set(mara, "tina", R"({"code": "123"})");
  EXPECT_EQ(bad.status, 400);
  EXPECT_EQ(bad.json()["error"]["field"], "code");

  const std::string settings = "/api/v1/lab/settings";
  EXPECT_EQ(askChecked(mara, "GET", settings).json()["codes_required"], false);
  EXPECT_EQ(askChecked(ada, "PATCH", settings, R"({"codes_required": true})").json()["codes_required"], true);
}

TEST(WebLessons, aProfileIsCheckedAndPushedThroughByTheEngine) {
  WebLab lab;
  Browser mara = lab.browserOf("mara");
  const std::string id = askChecked(mara, "GET", "/api/v1/profiles").json()["items"][0]["id"];
  json profile = askChecked(mara, "GET", "/api/v1/profiles/" + id).json()["json"];
  EXPECT_EQ(askChecked(mara, "POST", "/api/v1/profiles/check", profile.dump()).json()["ok"], true);
  const json preview = askChecked(mara, "POST", "/api/v1/profiles/preview?points=200", profile.dump()).json();
  EXPECT_NEAR(static_cast<double>(preview["depth_m"].size()), 200, 20);
  EXPECT_GT(preview["max_force_n"], 0);
  profile["layers"][0]["thickness_m"] = -1;
  profile["needle"].erase("length_m");
  const json check = askChecked(mara, "POST", "/api/v1/profiles/check", profile.dump()).json();
  EXPECT_EQ(check["ok"], false);
  std::set<std::string> paths;
  for (const json& problem : check["problems"]) paths.insert(problem["path"].get<std::string>());
  EXPECT_TRUE(paths.contains("layers[0].thickness_m") && paths.contains("needle.length_m")) << check.dump();
  EXPECT_EQ(askChecked(mara, "POST", "/api/v1/profiles/preview", profile.dump()).status, 400);
}

TEST(WebLessons, aManagersWeekWorksAndConcurrentEditorsGetAConflict) {
  WebLab lab;
  Browser mara = lab.browserOf("mara"), ada = lab.browserOf("ada");
  const auto done = [&](const std::string& method, const std::string& path, const std::string& body,
                        const WebHeaders& headers = {}) {
    const WebReply reply = askChecked(mara, method, "/api/v1" + path, body, headers);
    EXPECT_TRUE(reply.status == 200 || reply.status == 201) << method << " " << path << reply.body;
    return reply.json();
  };
  const std::string csv = "name,full_name,group\nanna,Anna Bauer,autumn\nben,Ben Osei,autumn\n";
  EXPECT_EQ(done("POST", "/people/import", json{{"csv", csv}, {"dry_run", true}}.dump())["done"], false);
  EXPECT_EQ(done("POST", "/people/import", json{{"csv", csv}}.dump())["added"], 2);
  const json group = done("GET", "/groups/autumn", "");
  EXPECT_EQ(group["members"], json({"anna", "ben"}));

  // Two users edit the same revision: the second one gets the current revision, and the first edit is not
  // lost.
  const std::string id = done("GET", "/profiles", "")["items"][0]["id"];
  json profile = done("GET", "/profiles/" + id, "")["json"];
  profile["description"] = "first";
  EXPECT_EQ(done("PUT", "/profiles/" + id, profile.dump(), {{"If-Match", "\"1\""}})["revision"], 2);
  profile["description"] = "second";
  const WebReply late =
      askChecked(ada, "PUT", "/api/v1/profiles/" + id, profile.dump(), {{"If-Match", "\"1\""}});
  EXPECT_EQ(late.status, 409);
  EXPECT_EQ(late.json()["error"]["code"], "conflict");
  EXPECT_EQ(late.json()["error"]["current_revision"], 2);
  EXPECT_EQ(done("GET", "/profiles/" + id, "")["json"]["description"], "first");
  EXPECT_EQ(askChecked(mara, "PUT", "/api/v1/profiles/" + id, profile.dump()).status, 400)
      << "without If-Match";
  EXPECT_EQ(askChecked(mara, "PUT", "/api/v1/profiles/other", profile.dump(), {{"If-Match", "\"2\""}}).status,
            400);
  EXPECT_EQ(done("GET", "/profiles/" + id + "/revisions", "")["items"].size(), 2u);
  EXPECT_EQ(done("GET", "/profiles/" + id + "?revision=1", "")["revision"], 1);

  const json course = {{"id", "autumn-course"},
                       {"name", "Autumn"},
                       {"exercises",
                        {{{"id", "autumn-1"},
                          {"name", "One"},
                          {"profile_id", id},
                          {"attempts", 3},
                          {"requirements", {{{"measure", "peak_force_n"}, {"max", 3}}}}}}}};
  EXPECT_EQ(done("POST", "/courses/check", course.dump())["ok"], true);
  EXPECT_EQ(done("PUT", "/courses/autumn-course", course.dump(), {{"If-Match", "\"0\""}})["revision"], 1);
  EXPECT_EQ(done("GET", "/exercises?course=autumn-course", "")["items"][0]["json"]["id"], "autumn-1");
  EXPECT_GT(done("GET", "/measures", "")["items"].size(), 10u);
  const json assignment =
      done("POST", "/assignments",
           json{{"course_id", "autumn-course"}, {"group_id", "autumn"}, {"due_unix_ms", 1.8e12}}.dump());
  EXPECT_EQ(assignment["due_unix_ms"], 1.8e12);
  EXPECT_EQ(done("GET", "/assignments?group=autumn", "")["items"].size(), 1u);
  const json results = done("GET", "/results?course=autumn-course&group=autumn", "");
  EXPECT_EQ(results["rows"].size(), 2u);
  EXPECT_EQ(results["exercise_ids"], json({"autumn-1"}));
  // one page at a time; the first one states the total
  const json first = done("GET", "/results?course=autumn-course&group=autumn&limit=1", "");
  EXPECT_EQ(first["rows"].size(), 1u);
  EXPECT_EQ(first["trainees"], 2);
  EXPECT_EQ(first["trainees_passed"], json::array({0}));
  const json second = done(
      "GET",
      "/results?course=autumn-course&group=autumn&limit=1&page=" + first["next_page"].get<std::string>(), "");
  EXPECT_EQ(second["rows"].size(), 1u);
  EXPECT_NE(second["rows"][0]["trainee"], first["rows"][0]["trainee"]);
  EXPECT_EQ(second["next_page"], "");
  EXPECT_FALSE(second.contains("trainees"));
  const json everybody = done("GET", "/people", "");
  EXPECT_EQ(everybody["total"], everybody["items"].size());
  json names = json::array();
  std::string page;
  do {
    const json people = done("GET", "/people?limit=2&page=" + page, "");
    EXPECT_LE(people["items"].size(), 2u);
    EXPECT_EQ(people.contains("total"), page.empty());
    for (const json& person : people["items"]) names.push_back(person["name"]);
    page = people["next_page"];
  } while (!page.empty() && names.size() < 50);
  EXPECT_EQ(names.size(), everybody["items"].size());
  const json found = done("GET", "/people?search=AUTUMN&role=trainee", "");
  EXPECT_EQ(found["total"], 2) << "by their group";
  EXPECT_EQ(done("GET", "/people?search=anna", "")["items"][0]["name"], "anna");
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/people?role=wizard").status, 400);
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/people?limit=501").status, 400);
  EXPECT_EQ(done("GET", "/people/anna/progress", "")["items"].size(), 0u);
  EXPECT_EQ(done("PATCH", "/people/anna", R"({"consent": true})")["consent"]["given"], true);
  EXPECT_EQ(done("GET", "/people/anna/consents", "")["items"].size(), 1u);
  const WebReply all = askChecked(mara, "GET", "/api/v1/people/anna/export");
  EXPECT_THAT(all.header("content-disposition"), HasSubstr("anna.json"));
  EXPECT_GT(all.json()["items"].size(), 0u);
  EXPECT_EQ(all.json()["items"][0]["kind"], "person");
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/people/nobody/export").status, 404);
  const std::string base =
      "\"" + std::to_string(done("GET", "/people/anna", "")["revision"].get<int>()) + "\"";
  EXPECT_EQ(done("PATCH", "/people/anna", R"({"full_name": "Anna B."})", {{"If-Match", base}})["full_name"],
            "Anna B.");
  EXPECT_EQ(
      askChecked(mara, "PATCH", "/api/v1/people/anna", R"({"full_name": "A."})", {{"If-Match", base}}).status,
      409);
  done("GET", "/exercises/autumn-1/reference", "");
  EXPECT_THAT(mara.get("/api/v1/scores.csv?course=autumn-course").body,
              testing::StartsWith("trainee,exercise_id,"));
  const WebReply table =
      mara.get("/api/v1/courses/autumn-course/results.csv?group=autumn&separator=semicolon");
  EXPECT_EQ(table.status, 200);
  EXPECT_EQ(table.header("content-type"), "text/csv; charset=utf-8");
  EXPECT_EQ(table.header("content-disposition"), "attachment; filename=\"autumn-course-results.csv\"");
  EXPECT_THAT(table.body,
              testing::StartsWith("\xef\xbb\xbfPerson;Full name;Groups;Exercise;Verdict;Attempts;"));
  EXPECT_THAT(table.body, HasSubstr("\r\nanna;Anna B.;autumn;"));
  EXPECT_EQ(std::count(table.body.begin(), table.body.end(), '\n'), 3) << "the header, anna and ben";
  EXPECT_THAT(mara.get("/api/v1/courses/autumn-course/results.csv").body,
              testing::StartsWith("\xef\xbb\xbfPerson,Full name,"));
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/courses/autumn-course/results.csv?separator=space").status, 400);
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/courses/autumn-course/results.csv?group=nobody").status, 404);
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/courses/nothing/results.csv").status, 404);
  done("DELETE", "/assignments/" + std::to_string(assignment["id"].get<int>()), "");
  done("DELETE", "/groups/autumn", "",
       {{"If-Match", "\"" + std::to_string(group["revision"].get<int>()) + "\""}});
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/groups/autumn").status, 404);
  // Only administrators can erase a person.
  EXPECT_EQ(askChecked(mara, "DELETE", "/api/v1/people/anna/data", R"({"confirm": "anna"})").status, 403);
  EXPECT_EQ(askChecked(ada, "DELETE", "/api/v1/people/anna/data", R"({"confirm": "ben"})").status, 400);
  EXPECT_EQ(askChecked(ada, "DELETE", "/api/v1/people/anna/data", R"({"confirm": "anna"})").status, 200);
  EXPECT_EQ(askChecked(mara, "GET", "/api/v1/people/anna").status, 404);
}

// a page has 100 trainees
TEST(WebLessons, exportedResultsListEachPersonOnceAcrossPages) {
  WebLab lab;
  Browser mara = lab.browserOf("mara");
  const json course = {
      {"id", "course"},
      {"name", "A course"},
      {"exercises", json::array({{{"id", "one"}, {"name", "The one"}, {"profile_id", "knee-adult"}},
                                 {{"id", "two"}, {"name", "The two"}, {"profile_id", "knee-adult"}}})}};
  ASSERT_EQ(askChecked(mara, "PUT", "/api/v1/courses/course", course.dump(), {{"If-Match", "\"0\""}}).status,
            200);
  std::string csv = "name,group\n";
  for (int i = 0; i < 230; ++i) csv += fmt::format("t{:03},class\n", i);
  ASSERT_EQ(askChecked(mara, "POST", "/api/v1/people/import", json{{"csv", csv}}.dump()).status, 200);
  ASSERT_EQ(askChecked(mara, "POST", "/api/v1/assignments", R"({"course_id": "course", "group_id": "class"})")
                .status,
            201);
  std::istringstream lines(mara.get("/api/v1/courses/course/results.csv").body);
  std::string line;
  std::getline(lines, line);
  for (int i = 0; i < 230; ++i)
    for (const char* name : {"The one", "The two"}) {
      ASSERT_TRUE(std::getline(lines, line));
      EXPECT_EQ(line, fmt::format("t{:03},,class,{},not tried,0,,,\r", i, name));
    }
  EXPECT_FALSE(std::getline(lines, line)) << line;
}

TEST(WebLessons, filtersHoldAcrossPages) {
  WebLab lab;
  Browser ada = lab.browserOf("ada"), mara = lab.browserOf("mara");
  // mara's lines are mixed with ada's: an audit page has 200
  for (int i = 0; i < 450; ++i) {
    pb::Request request;
    request.mutable_set_consent()->set_name("tina");
    request.mutable_set_consent()->set_given(i % 2 == 0);
    (void)lab.server().service().execute(
        i % 3 == 0 ? Principal{"@3", pb::CURRICULUM_MANAGER} : Principal{"@5", pb::ADMINISTRATOR}, request);
  }
  const auto all = [&](const std::string& query) {
    std::size_t lines = 0, pages = 0;
    std::string page;
    do {
      const json reply = askChecked(ada, "GET", "/api/v1/audit?" + query + "&page=" + page).json();
      for (const json& line : reply["items"]) {
        EXPECT_TRUE(query.find("who=") == std::string::npos || line["who"] == "mara") << line.dump();
        EXPECT_EQ(line["action"], "consent");
      }
      lines += reply["items"].size();
      page = reply["next_page"];
    } while (!page.empty() && ++pages < 20);
    EXPECT_TRUE(page.empty());
    return lines;
  };
  EXPECT_EQ(all("action=consent"), 450u);
  EXPECT_EQ(all("action=consent&who=mara"), 150u);

  // three sessions of one trainee at one exercise, one per page
  for (int i = 0; i < 3; ++i) (void)lab.recorded(1);
  std::set<std::string> seen;
  std::string page;
  do {
    const json reply = askChecked(mara, "GET", "/api/v1/sessions?trainee=tina&limit=1&page=" + page).json();
    for (const json& session : reply["items"])
      seen.insert(session["description"]["session_id"].get<std::string>());
    page = reply["next_page"];
  } while (!page.empty());
  EXPECT_EQ(seen.size(), 3u);
  const json other = askChecked(mara, "GET", "/api/v1/sessions?trainee=tom&limit=1").json();
  EXPECT_TRUE(other["items"].empty() && other["next_page"] == "") << other.dump();
}

TEST(WebLessons, aPolicyOfRetentionIsSetAndTriedOut) {
  WebLab lab;
  Browser mara = lab.browserOf("mara");
  EXPECT_EQ(
      askChecked(mara, "PUT", "/api/v1/retention",
                 R"({"policy": {"exercise_id": "", "delete_after_days": 3650, "without_backup": true}})")
          .status,
      200);
  const json kept = askChecked(mara, "GET", "/api/v1/retention").json();
  ASSERT_EQ(kept["policies"].size(), 1u);
  EXPECT_EQ(kept["policies"][0]["delete_after_days"], 3650);
  const WebReply run = askChecked(mara, "POST", "/api/v1/retention/run", R"({"dry_run": true})");
  EXPECT_EQ(run.status, 200) << run.body;
  EXPECT_EQ(run.json()["deleted"], 0);
}

std::vector<std::vector<double>> rowsOf(const std::string& csv, std::string& header) {
  std::istringstream lines(csv);
  std::getline(lines, header);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');)
      rows.back().push_back(std::strtod(cell.c_str(), nullptr));
  }
  return rows;
}

TEST(WebLessons, theCsvHasEverySampleAndThePlotItsExtremes) {
  WebLab lab;
  // FakeSession: sample k at k ms, z = k µm
  const std::string id = lab.recorded(60);
  Browser ines = lab.browserOf("ines");
  const WebReply csv = ines.get("/api/v1/sessions/" + id + "/samples.csv");
  EXPECT_EQ(csv.status, 200);
  EXPECT_THAT(csv.header("content-disposition"), HasSubstr(id + ".csv"));
  std::string header;
  const auto rows = rowsOf(csv.body, header);
  EXPECT_THAT(header, testing::StartsWith("t_s,tick,time_ns,px_m"));
  ASSERT_EQ(rows.size(), 6000u);
  for (std::size_t k : {std::size_t{0}, std::size_t{1234}, std::size_t{5999}}) {
    EXPECT_NEAR(rows[k][0], static_cast<double>(k) * 1e-3, 1e-9);
    EXPECT_NEAR(rows[k][5], static_cast<double>(k) * 1e-6, 1e-9);
  }
  const auto part =
      rowsOf(ines.get("/api/v1/sessions/" + id + "/samples.csv?from_s=1.5&to_s=2").body, header);
  ASSERT_EQ(part.size(), 500u);
  EXPECT_NEAR(part.front()[0], 1.5, 1e-9);
  EXPECT_EQ(ines.get("/api/v1/sessions/" + id + "/samples.csv?from_s=2&to_s=1").status, 400);
  const WebReply head = ines.ask("HEAD", "/api/v1/sessions/" + id + "/samples.csv");
  EXPECT_EQ(head.status, 200);

  const json plot = askChecked(ines, "GET", "/api/v1/sessions/" + id + "/samples?points=100").json();
  EXPECT_EQ(plot["decimated"], true);
  EXPECT_EQ(plot["columns"]["t_s"].size(), 100u);
  EXPECT_EQ(plot["columns"]["pz_m"].size(), 100u);
  const auto times = plot["columns"]["t_s"].get<std::vector<double>>();
  EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
  for (std::size_t i = 0; i < times.size(); ++i)
    EXPECT_NEAR(plot["columns"]["pz_m"][i].get<double>(), times[i] * 1e-3, 1e-9)
        << "a sample that was never there";
  const json few = askChecked(ines, "GET", "/api/v1/sessions/" + id + "/samples?from_s=1&to_s=1.05").json();
  EXPECT_EQ(few["decimated"], false);
  EXPECT_EQ(few["columns"]["t_s"].size(), 51u);
}

TEST(WebLessons, aTraineeGetsExamSamplesOnceResultsAreShown) {
  WebLab lab;
  const std::string session = "/api/v1/sessions/" + lab.recorded(2);
  json course{
      {"id", "exam"}, {"name", "An exam"}, {"exam", true}, {"results_from_unix_ms", 9'000'000'000'000}};
  course["exercises"].push_back({{"id", "practice"}, {"name", "Practice"}, {"profile_id", "knee-adult"}});
  Browser mara = lab.browserOf("mara"), tina = lab.browserOf("tina"), ines = lab.browserOf("ines");
  for (const bool shown : {false, true}) {
    if (shown) course["results_from_unix_ms"] = 1;
    ASSERT_EQ(askChecked(mara, "PUT", "/api/v1/courses/exam", course.dump(),
                         {{"If-Match", shown ? "\"1\"" : "\"0\""}})
                  .status,
              200);
    for (const char* below : {"/samples", "/samples.csv"}) {
      EXPECT_EQ(askChecked(tina, "GET", session + below).status, shown ? 200 : 403) << below;
      EXPECT_EQ(askChecked(ines, "GET", session + below).status, 200) << below;
    }
  }
}

TEST(WebLessons, aLongCsvTakesConstantMemoryForASlowReader) {
  WebLab lab;
  const bool is_long = test::longForm();
  const std::uint64_t chunks = is_long ? 18'000 : 2500;  // 30 min, or 4 min
  const std::string id = lab.recorded(chunks);
  Browser ines = lab.browserOf("ines");
  WebWire wire(lab.port());
  ASSERT_TRUE(wire.send(requestText("GET", "/api/v1/sessions/" + id + "/samples.csv", "", ines.own("GET"))));
  ASSERT_EQ(wire.readHeader().status, 200);
  bool broken = false;
  (void)wire.readChunk(broken);
  const std::uint64_t before = processFacts().rss_bytes;
  std::uint64_t most = before, bytes = 0, pieces = 0;
  while (const auto chunk = wire.readChunk(broken)) {
    bytes += chunk->size();
    if (++pieces % 8 == 0) std::this_thread::sleep_for(milliseconds(2));
    most = std::max<std::uint64_t>(most, processFacts().rss_bytes);
  }
  EXPECT_FALSE(broken);
  EXPECT_GT(bytes, 20u << 20) << "long enough to show it";
  // AddressSanitizer holds back freed memory for a while.
  if (!kSanitized) {
    EXPECT_LT(most - before, 12u << 20) << bytes << " bytes in " << pieces << " pieces";
  }
  std::printf("%llu MB of CSV, resident memory grew by %llu KiB\n",
              static_cast<unsigned long long>(bytes >> 20),
              static_cast<unsigned long long>((most - before) >> 10));
}

TEST(WebLessons, aDownloadEndsWhenItsAccountIsDisabled) {
  WebLab lab;
  const std::string id = lab.recorded(1500);  // some 13 MB of CSV, more than the sockets' buffers
  Browser ines = lab.browserOf("ines"), ada = lab.browserOf("ada");
  const std::string path = "/api/v1/sessions/" + id + "/samples.csv";
  for (const bool disabled : {false, true}) {
    WebWire wire(lab.port());
    ASSERT_TRUE(wire.send(requestText("GET", path, "", ines.own("GET"))));
    ASSERT_EQ(wire.readHeader().status, 200);
    bool broken = false;
    ASSERT_TRUE(wire.readChunk(broken).has_value());
    // disabling another account does not end the download
    const std::string who = disabled ? "ines" : "rhea";
    ASSERT_EQ(
        ada.ask("PATCH", "/api/v1/people/" + who, R"({"disabled": true})", {{"If-Match", "\"1\""}}).status,
        200);
    while (wire.readChunk(broken)) {
    }
    EXPECT_EQ(broken, disabled) << "without its last piece a browser knows that it is not whole";
  }
}

TEST(WebLessons, metricsCountTheRequestsByRouteAndStatus) {
  WebLab lab([](ServerOptions& options) { options.metrics = "127.0.0.1:0"; });
  Browser ines = lab.browserOf("ines");
  (void)ines.get("/api/v1/profiles");
  (void)ines.get("/api/v1/profiles");
  (void)ines.get("/api/v1/audit");
  (void)ines.get("/secret-of-somebody");
  WebWire wire(lab.server().server().metricsPort(), false);
  (void)wire.sendPlain("GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n");
  const std::string text = wire.receivePlain();
  for (const char* line : {"needlelab_web_requests_total{route=\"GET /profiles\",status=\"200\"} 2\n",
                           "needlelab_web_requests_total{route=\"GET /audit\",status=\"403\"} 1\n",
                           "needlelab_web_requests_total{route=\"POST /session\",status=\"200\"} 1\n",
                           "needlelab_web_requests_total{route=\"file\",status=\"404\"} 1\n",
                           "needlelab_web_request_seconds_count 5\n", "needlelab_web_connections 1\n"})
    EXPECT_THAT(text, HasSubstr(line));
  EXPECT_THAT(text, testing::Not(HasSubstr("secret")));
}

}  // namespace
}  // namespace needlelab
