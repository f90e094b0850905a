// Trainees' codes: requested by stations before a lesson, set by managers, required by the lab; sessions
// without a checked code wait.
#include <gmock/gmock.h>

#include <array>
#include <nlohmann/json.hpp>

#include "tests/support/time/fake_time.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;

class Codes : public test::TeachingTest {
 protected:
  void SetUp() override {
    store.reset();
    store = test::openStore(folder.path() / "data", time);
    addStation();
    putCourse({{"second", {{"prerequisites", {"first"}}}}});
    for (const char* name : {"tom", "tim"}) addPerson(name, pb::TRAINEE);
  }
  void TearDown() override { store.reset(); }

  pb::Request code(const std::string& of, const std::string& to) {
    pb::Request request;
    request.mutable_set_code()->set_name(of);
    request.mutable_set_code()->set_code(to);
    return request;
  }
  pb::Request make(const std::string& of) {
    pb::Request request;
    request.mutable_set_code()->set_name(of);
    request.mutable_set_code()->set_make(true);
    return request;
  }
  pb::Request begin(const std::string& who, const std::string& code, const std::string& exercise = "first") {
    pb::Request request;
    request.mutable_get_lesson()->set_exercise_id(exercise);
    request.mutable_get_lesson()->set_trainee(who);
    request.mutable_get_lesson()->set_code(code);
    return request;
  }
  pb::Request check(const std::string& who, const std::string& code) {
    pb::Request request;
    request.mutable_check_trainee()->set_trainee(who);
    request.mutable_check_trainee()->set_code(code);
    return request;
  }
  /// The station's refusal: "CODE: text", "ROLE: text", "NOT_FOUND: text"; empty: the lesson may begin.
  std::string said(const pb::Request& request) {
    const auto refused = ask(station, request).error;
    if (!refused) return {};
    const char* reason = refused->code == ErrorCode::kCode       ? "CODE"
                         : refused->code == ErrorCode::kDenied   ? "ROLE"
                         : refused->code == ErrorCode::kNotFound ? "NOT_FOUND"
                                                                 : "?";
    return std::string(reason) + ": " + refused->message;
  }
  void require(bool codes) {
    pb::Request request;
    request.mutable_change_lab_settings()->set_codes_required(codes);
    EXPECT_EQ(get(admin, request).lab_settings().codes_required(), codes);
  }
  std::vector<std::string> details(const std::string& action) {
    pb::Request request;
    request.mutable_list_audit()->set_action(action);
    std::vector<std::string> found;
    const auto log = get(admin, request).audit();
    for (const auto& line : log.entries())
      found.push_back(line.who() + " " + line.subject() + " " + line.detail());
    return found;
  }
  /// A closed session.
  Uuid record(const std::string& who, bool code_checked) {
    auto d = describe(who, code_checked);
    EXPECT_OK(change([&](Connection& c) -> Status {
      RETURN_IF_ERROR(SessionStore(c).open(d, 1));
      const auto closed = SessionStore(c).close(test::closeOf(idOf(d), 0), 2);
      return closed ? Status() : Status(closed.error());
    }));
    return idOf(d);
  }
  pb::SessionDescription describe(const std::string& who, bool code_checked) {
    auto d = test::describe(makeUuidV7());
    d.set_trainee(who);
    d.set_exercise_id("first");
    d.set_started_unix_ns(++clock_);
    d.set_code_checked(code_checked);
    return d;
  }
  static Uuid idOf(const pb::SessionDescription& d) {
    Uuid id{};
    std::copy(d.session_id().begin(), d.session_id().end(), id.begin());
    return id;
  }
  pb::SessionInfo info(const Uuid& id) {
    pb::Request request;
    request.mutable_get_session()->set_session_id(test::bytesOfId(id));
    return get(manager, request).session();
  }
  /// "waits: no such name", "waits: code", "counts"
  std::string stateOf(const Uuid& id) {
    const auto session = info(id);
    EXPECT_FALSE(session.code_unchecked() && !session.unknown_trainee());
    return session.code_unchecked()    ? "waits: code"
           : session.unknown_trainee() ? "waits: no such name"
                                       : "counts";
  }
  int attemptsOf(const std::string& who) {
    pb::Request request;
    request.mutable_get_progress()->set_trainee(who);
    return get(instructor, request).progress().attempts_size();
  }

  test::FakeTime time;
  static constexpr std::int64_t kSecond_ns = 1'000'000'000;
};

TEST_F(Codes, areRequiredOfStationsOnly) {
  EXPECT_EQ(said(begin("tom", "")), "") << "no code, and none is required";
  EXPECT_EQ(said(begin("tom", "0000")), "") << "a code that no one asked for";
  get(manager, code("tom", "2468"));
  for (const auto& [without, wrong, right] :
       {std::array{begin("tom", ""), begin("tom", "2469"), begin("tom", "2468")},
        std::array{check("tom", ""), check("tom", "2469"), check("tom", "2468")}}) {
    EXPECT_EQ(said(without), "CODE: tom has a code: type the PIN or hold the badge to the reader");
    EXPECT_EQ(said(wrong), "CODE: this is not the code of tom; 4 tries left");
    EXPECT_EQ(said(right), "");
  }
  for (const char* who : {"tim", "guest", ""}) EXPECT_EQ(said(begin(who, "")), "") << who;
  // watching a lesson does not need a station
  get(instructor, begin("tom", ""));
  get(Principal{"tom", pb::TRAINEE}, begin("tom", ""));
}

TEST_F(Codes, comeAfterTheNameAndBeforeTheRestOfTheLesson) {
  get(manager, code("tom", "2468"));
  EXPECT_THAT(said(begin("tomm", "2468")), HasSubstr("NOT_FOUND: the server knows no one named 'tomm'"));
  EXPECT_THAT(said(begin("tom", "", "second")), HasSubstr("CODE: tom has a code"));
  EXPECT_THAT(said(begin("tom", "2468", "second")), HasSubstr("ROLE: ")) << "the first is not passed";
  ASSERT_OK(change([](Connection& c) { return PeopleStore(c).setDisabled("tom", true); }));
  EXPECT_THAT(said(begin("tom", "2468")), HasSubstr("NOT_FOUND: the server knows no one named 'tom'"));
}

TEST_F(Codes, waitAfterFiveWrongOnes) {
  get(manager, code("tom", "2468"));
  get(manager, code("tim", "1357"));
  const std::string wrong = "CODE: this is not the code of tom; ",
                    many = "CODE: too many wrong codes of tom: ";
  // attempts at all stations, with both requests, count together
  EXPECT_EQ(said(begin("tom", "1")), wrong + "4 tries left");
  EXPECT_EQ(said(check("tom", "1357")), wrong + "3 tries left");
  EXPECT_EQ(said(begin("tom", std::string(1000, 'x'))), wrong + "2 tries left");
  EXPECT_EQ(said(begin("tom", "")), "CODE: tom has a code: type the PIN or hold the badge to the reader")
      << "no try";
  EXPECT_EQ(said(begin("tom", "24680")), wrong + "1 try left");
  EXPECT_EQ(said(begin("tom", "246")), wrong + "try again in 1 min");
  EXPECT_EQ(said(begin("tom", "2468")), many + "try again in 1 min") << "the right one waits, too";
  EXPECT_EQ(said(begin("tim", "1357")), "") << "another person";
  time.advance(59 * kSecond_ns);
  EXPECT_EQ(said(begin("tom", "2468")), many + "try again in 1 s");
  time.advance(kSecond_ns);
  EXPECT_EQ(said(begin("tom", "0000")), wrong + "try again in 2 min");
  time.advance(120 * kSecond_ns);
  EXPECT_EQ(said(begin("tom", "2468")), "");
  EXPECT_EQ(said(begin("tom", "0000")), wrong + "4 tries left") << "the right one ended the row";
  // the lines are written after the answers
  ASSERT_OK(change([](Connection&) { return Status(); }));
  EXPECT_THAT(details("code locked"),
              testing::ElementsAre("station-1 tom too many wrong codes: waits 2 min",
                                   "station-1 tom too many wrong codes: waits 1 min"));
}

TEST_F(Codes, areAnsweredTheSameWhenTheAuditLogCannotBeWritten) {
  get(manager, code("tom", "2468"));
  for (int i = 0; i < 4; ++i) (void)said(begin("tom", "0000"));
  store->writer().stop();
  EXPECT_EQ(said(begin("tom", "0000")), "CODE: this is not the code of tom; try again in 1 min");
  EXPECT_EQ(said(begin("tom", "2468")), "CODE: too many wrong codes of tom: try again in 1 min");
}

TEST_F(Codes, areReportedAsCheckedOnlyIfTheyWereCompared) {
  get(manager, code("tom", "2468"));
  const auto checked = [&](const std::string& who, const std::string& given) {
    const bool lesson = get(station, begin(who, given)).lesson().code_checked();
    EXPECT_EQ(get(station, check(who, given)).trainee_checked().code_checked(), lesson);
    return lesson;
  };
  EXPECT_TRUE(checked("tom", "2468"));
  for (const char* who : {"tim", "guest", ""}) EXPECT_FALSE(checked(who, "2468")) << who;
  EXPECT_FALSE(get(instructor, begin("tom", "2468")).lesson().code_checked());
  get(manager, code("tom", ""));
  EXPECT_FALSE(checked("tom", "2468")) << "removed meanwhile";
}

TEST_F(Codes, ofAPersonWhoGetsAnotherWaitNoLonger) {
  get(manager, code("tom", "2468"));
  for (int i = 0; i < 5; ++i) EXPECT_NE(said(begin("tom", "0000")), "");
  get(manager, code("tom", "8642"));
  EXPECT_EQ(said(begin("tom", "2468")), "CODE: this is not the code of tom; 4 tries left");
  EXPECT_EQ(said(begin("tom", "8642")), "");
  get(manager, code("tom", ""));
  EXPECT_EQ(said(begin("tom", "")), "") << "removed";
}

TEST_F(Codes, areSetByTheirOwnersAndWhoManagesThem) {
  const std::vector<std::pair<std::string, pb::Role>> people = {
      {"anna", pb::TRAINEE},           {"ina", pb::INSTRUCTOR},    {"mia", pb::CURRICULUM_MANAGER},
      {"max", pb::CURRICULUM_MANAGER}, {"ada", pb::ADMINISTRATOR}, {"rea", pb::RESEARCHER}};
  for (const auto& [name, role] : people) addPerson(name, role);
  // listed by hand: whose codes each may set, besides their own
  const std::map<std::string, std::set<std::string>> may = {
      {"anna", {}},
      {"ina", {}},
      {"rea", {}},
      {"mia", {"tom", "anna", "ina", "max"}},
      {"ada", {"tom", "anna", "ina", "mia", "max", "rea"}}};
  for (const Principal& who : {trainee, instructor, researcher, manager, admin}) {
    for (const std::string whom : {"tom", "anna", "ina", "mia", "max", "ada", "rea"}) {
      const bool allowed = whom == who.name || may.at(who.name).contains(whom);
      for (const auto& request : {code(whom, "2468"), make(whom), code(whom, "")}) {
        const auto refused = ask(who, request).error;
        EXPECT_EQ(!refused.has_value(), allowed) << who.name << " sets the code of " << whom;
        if (refused) {
          EXPECT_EQ(refused->code, ErrorCode::kDenied);
        }
      }
    }
  }
  EXPECT_EQ(refusal(manager, code("nobody", "2468")), ErrorCode::kNotFound);
  EXPECT_EQ(refusal(trainee, code("nobody", "2468")), ErrorCode::kDenied) << "who there is stays unsaid";
}

TEST_F(Codes, areSixDigitsWhenTheServerMakesThemAndShownOnce) {
  const auto made = get(manager, make("tom")).new_code();
  EXPECT_EQ(made.name(), "tom");
  EXPECT_THAT(made.code(), testing::MatchesRegex("[0-9]{6}"));
  EXPECT_EQ(said(begin("tom", made.code())), "");
  EXPECT_EQ(get(manager, code("tim", "badge 0007 ~")).new_code().code(), "") << "a given one is not repeated";
  EXPECT_EQ(said(begin("tim", "badge 0007 ~")), "");
  const auto has = [&](const std::string& name) {
    pb::Request request;
    request.mutable_get_user()->set_name(name);
    return get(manager, request).user().has_code();
  };
  EXPECT_TRUE(has("tom"));
  get(manager, code("tom", ""));
  EXPECT_FALSE(has("tom"));
  EXPECT_TRUE(has("tim"));
  EXPECT_THAT(details("user code"), testing::ElementsAre("mia tom removed", "mia tim set", "mia tom made"));
  // neither in the database nor in a person's export; an export has the hash only on request
  EXPECT_OK(change([&](Connection& c) -> Status {
    const std::string all = test::dump(c);
    EXPECT_THAT(all, Not(HasSubstr("badge 0007")));
    EXPECT_THAT(all, Not(HasSubstr("'" + made.code() + "'")));
    return {};
  }));
  for (const bool secrets : {false, true}) {
    pb::Request request;
    request.mutable_export_all()->set_with_passwords(secrets);
    std::string all;
    const auto records = get(admin, request).records();
    for (const std::string& record : records.records()) all += record;
    EXPECT_EQ(all.find("$argon2id$") != std::string::npos, secrets);
  }
  pb::Request own;
  own.mutable_export_person()->set_name("tim");
  const auto records = get(manager, own).records();
  for (const std::string& record : records.records()) EXPECT_THAT(record, Not(HasSubstr("$argon2id$")));
  EXPECT_THAT(records.DebugString(), HasSubstr("user code")) << "that it was set";
}

TEST_F(Codes, thatAreNoneAreRefusedAndNothingChanges) {
  get(manager, code("tom", "2468"));
  auto both = code("tom", "1234");
  both.mutable_set_code()->set_make(true);
  for (const auto& request :
       {code("tom", "123"), code("tom", std::string(65, '1')), code("tom", "12\n45"), both}) {
    const auto refused = ask(manager, request).error;
    ASSERT_TRUE(refused.has_value());
    EXPECT_EQ(refused->code, ErrorCode::kInvalidInput);
    EXPECT_THAT(refused->message, testing::StartsWith("code: "));
  }
  EXPECT_EQ(said(begin("tom", "2468")), "");
}

TEST_F(Codes, mayBeRequiredByTheLab) {
  pb::Request show, change_nothing;
  show.mutable_get_lab_settings();
  change_nothing.mutable_change_lab_settings();
  EXPECT_FALSE(get(station, show).lab_settings().codes_required());
  require(true);
  for (const Principal& who : {trainee, instructor, manager, admin, station, researcher})
    EXPECT_TRUE(get(who, show).lab_settings().codes_required()) << who.name;
  EXPECT_TRUE(get(admin, change_nothing).lab_settings().codes_required());
  EXPECT_EQ(said(begin("tom", "")), "ROLE: tom has no code yet: ask a manager for one");
  EXPECT_EQ(said(check("tom", "1234")), "ROLE: tom has no code yet: ask a manager for one");
  for (const char* who : {"guest", ""}) EXPECT_EQ(said(begin(who, "")), "") << who;
  get(instructor, begin("tom", ""));
  get(manager, code("tom", "2468"));
  EXPECT_EQ(said(begin("tom", "2468")), "");
  require(false);
  EXPECT_EQ(said(begin("tim", "")), "");
  EXPECT_EQ(said(begin("tom", "")), "CODE: tom has a code: type the PIN or hold the badge to the reader");
  EXPECT_THAT(details("lab set"), testing::ElementsAre("ada  codes optional", "ada  codes required"));
}

TEST_F(Codes, comeWithATableOfPeopleForThoseWhoHaveNone) {
  get(manager, code("tim", "3333"));
  const auto wrong = importPeople("name,code\nanna,123\n");
  ASSERT_EQ(wrong.faults(), 1u);
  EXPECT_EQ(wrong.rows(0).column(), "code");
  EXPECT_EQ(wrong.rows(0).text(), "code: has 3 characters, allowed are 4 to 64");
  const std::string csv = "name,full_name,code\nanna,,1111\nben,,\ntom,Tom T,2222\ntim,,4444\n";
  EXPECT_FALSE(importPeople(csv, true).done());
  EXPECT_EQ(said(begin("tom", "")), "") << "a dry run";
  const auto done = importPeople(csv);
  ASSERT_TRUE(done.done()) << done.DebugString();
  EXPECT_EQ(done.rows(0).text(), "added as trainee, with a code");
  EXPECT_EQ(done.rows(1).what(), pb::PeopleImport::CHANGE) << "before ben, who gets no code";
  EXPECT_EQ(done.rows(1).text(), "given the code; full name");
  EXPECT_EQ(done.rows(3).what(), pb::PeopleImport::NOTHING);
  EXPECT_EQ(done.rows(3).text(), "is there already; has a code, which is left as it is");
  for (const auto& [who, right] :
       {std::pair("anna", "1111"), std::pair("tom", "2222"), std::pair("tim", "3333")}) {
    EXPECT_EQ(said(begin(who, right)), "") << who;
    EXPECT_THAT(said(begin(who, "")), HasSubstr("CODE")) << who;
    EXPECT_THAT(said(begin(who, "4444")), HasSubstr("this is not the code of")) << who;
  }
  EXPECT_EQ(said(begin("ben", "")), "");
  EXPECT_THAT(details("user import"), testing::Contains("mia tom given the code; full name"));
  // again: now everybody has a code
  EXPECT_EQ(importPeople(csv).unchanged(), 4u);
}

TEST_F(Codes, ofATableAreGivenOnlyByThoseWhoManageThePerson) {
  addPerson("adam", pb::ADMINISTRATOR);
  const auto refused = importPeople("name,code\nadam,1111\ntom,2222\n");
  EXPECT_FALSE(refused.done());
  ASSERT_EQ(refused.faults(), 1u);
  EXPECT_EQ(refused.rows(0).column(), "code");
  EXPECT_EQ(said(begin("tom", "")), "") << "all or nothing";
  EXPECT_TRUE(importPeople("name,code\nadam,1111\n", false, &admin).done());
}

TEST_F(Codes, thatAreUncheckedMakeASessionWait) {
  get(manager, code("tom", "2468"));
  const Uuid unchecked = record("tom", false), checked = record("tom", true), tims = record("tim", false),
             guests = record("guest", false), ghosts = record("ghost", false);
  EXPECT_EQ(stateOf(unchecked), "waits: code");
  EXPECT_EQ(stateOf(checked), "counts");
  EXPECT_EQ(stateOf(tims), "counts") << "no code";
  EXPECT_EQ(stateOf(guests), "counts");
  EXPECT_EQ(stateOf(ghosts), "waits: no such name");
  require(true);
  EXPECT_EQ(stateOf(record("tim", false)), "waits: code");
  EXPECT_EQ(stateOf(record("tim", true)), "counts") << "checked before the code was taken away";
  EXPECT_EQ(stateOf(record("guest", false)), "counts");
  EXPECT_EQ(stateOf(record("ghost", true)), "waits: no such name");
}

TEST_F(Codes, thatComeLaterChangeNothingAboutASessionThatIsThere) {
  const auto before = describe("tom", false);
  const auto open = [&](const pb::SessionDescription& d) {
    return change([&](Connection& c) -> Status {
      const auto opened = SessionStore(c).open(d, 9);
      return opened ? Status() : Status(opened.error());
    });
  };
  ASSERT_OK(open(before));
  get(manager, code("tom", "2468"));
  const auto after = describe("tom", false);
  ASSERT_OK(open(after));
  get(manager, code("tom", ""));
  // their station asks again
  ASSERT_OK(open(before));
  ASSERT_OK(open(after));
  EXPECT_EQ(stateOf(idOf(before)), "counts");
  EXPECT_EQ(stateOf(idOf(after)), "waits: code");
  auto other = after;
  other.set_code_checked(true);
  EXPECT_FALSE(open(other).ok()) << "a session id is used once only";
}

TEST_F(Codes, thatAreUncheckedCountOnceAManagerConfirms) {
  get(manager, code("tom", "2468"));
  const Uuid waits = attempt("tom", "first", true);
  const Principal tom{"tom", pb::TRAINEE};
  pb::Request list, show, own, confirm;
  list.mutable_list_sessions();
  show.mutable_get_session()->set_session_id(test::bytesOfId(waits));
  own.mutable_export_person()->set_name("tom");
  confirm.mutable_assign_session()->set_session_id(test::bytesOfId(waits));
  confirm.mutable_assign_session()->set_trainee("tom");
  confirm.mutable_assign_session()->set_was("tom");
  const auto sessionsInOwnExport = [&] {
    int found = 0;
    const auto records = get(tom, own).records();
    for (const std::string& record : records.records())
      found += nlohmann::json::parse(record)["kind"] == "session" ? 1 : 0;
    return found;
  };
  const auto scores = [&] {
    pb::Request request;
    request.mutable_list_scores();
    return get(instructor, request).scores().scores_size();
  };
  EXPECT_EQ(attemptsOf("tom"), 0);
  EXPECT_EQ(scores(), 0);
  EXPECT_EQ(get(tom, list).sessions().sessions_size(), 0);
  EXPECT_EQ(refusal(tom, show), ErrorCode::kNotFound);
  EXPECT_EQ(sessionsInOwnExport(), 0);
  EXPECT_THAT(said(begin("tom", "2468", "second")), HasSubstr("ROLE: ")) << "unlocks nothing";
  pb::Request waiting;
  waiting.mutable_list_sessions()->set_unknown_trainee(true);
  EXPECT_EQ(get(manager, waiting).sessions().sessions_size(), 1);

  const auto confirmed = get(manager, confirm).session();
  EXPECT_EQ(confirmed.description().trainee(), "tom");
  EXPECT_FALSE(confirmed.unknown_trainee());
  EXPECT_FALSE(confirmed.code_unchecked());
  EXPECT_EQ(attemptsOf("tom"), 1);
  EXPECT_EQ(scores(), 1);
  EXPECT_EQ(get(tom, list).sessions().sessions_size(), 1);
  EXPECT_EQ(sessionsInOwnExport(), 1);
  EXPECT_EQ(said(begin("tom", "2468", "second")), "");
  EXPECT_EQ(get(manager, waiting).sessions().sessions_size(), 0);
  EXPECT_THAT(details("session assign"), testing::ElementsAre("mia " + uuidText(waits) + " from tom to tom"));
}

// The server trusts a station's claim about its answer (SECURITY.md): misuse of a stolen key is traced to its
// station and undone.
TEST_F(Codes, reportedFalselyAreUndoneByExcusingTheSessions) {
  get(manager, code("tom", "2468"));
  const Uuid forged = record("tom", true);
  ASSERT_OK(change([&](Connection& c) {
    auto score = test::scoreOf(forged, "[]");
    score.set_passed(true);
    return ScoreStore(c).put(score);
  }));
  EXPECT_EQ(stateOf(forged), "counts");
  EXPECT_EQ(said(begin("tom", "2468", "second")), "") << "it unlocks what comes next";

  pb::Request list, excuse;
  list.mutable_list_sessions()->set_station(info(forged).description().station());
  const auto found = get(instructor, list).sessions();
  ASSERT_EQ(found.sessions_size(), 1);
  excuse.mutable_excuse_attempt()->set_session_id(found.sessions(0).description().session_id());
  excuse.mutable_excuse_attempt()->set_excused(true);
  excuse.mutable_excuse_attempt()->set_reason("the station was stolen");
  EXPECT_TRUE(get(instructor, excuse).attempt().excused());
  EXPECT_THAT(said(begin("tom", "2468", "second")), HasSubstr("ROLE: ")) << "it unlocks nothing any more";
}

TEST_F(Codes, thatAreUncheckedMayBelongToSomeoneElse) {
  get(manager, code("tom", "2468"));
  const Uuid waits = attempt("tom", "first", true);
  pb::Request assign;
  assign.mutable_assign_session()->set_session_id(test::bytesOfId(waits));
  assign.mutable_assign_session()->set_trainee("tim");
  EXPECT_EQ(get(manager, assign).session().given_trainee(), "tom");
  EXPECT_EQ(attemptsOf("tom"), 0);
  EXPECT_EQ(attemptsOf("tim"), 1);
}

TEST_F(Codes, thatAreUncheckedNoLongerWaitOnceTheAccountIsErased) {
  addPerson("ada", pb::ADMINISTRATOR);
  get(manager, code("tom", "2468"));
  const Uuid waits = record("tom", false);
  EXPECT_EQ(stateOf(waits), "waits: code");
  pb::Request erase;
  erase.mutable_erase_person()->set_name("tom");
  erase.mutable_erase_person()->set_confirm("tom");
  EXPECT_EQ(get(admin, erase).erasure().waiting_sessions(), 1u);
  EXPECT_EQ(stateOf(waits), "waits: no such name") << "no one could confirm it";
}

TEST_F(Codes, goWithAnErasure) {
  addPerson("ada", pb::ADMINISTRATOR);
  get(manager, code("tom", "2468"));
  for (int i = 0; i < 5; ++i) (void)said(begin("tom", "0000"));
  pb::Request erase;
  erase.mutable_erase_person()->set_name("tom");
  erase.mutable_erase_person()->set_confirm("tom");
  get(admin, erase);
  EXPECT_OK(change([&](Connection& c) -> Status {
    const std::string all = test::dump(c);
    EXPECT_THAT(all, Not(HasSubstr("'tom'")));
    EXPECT_THAT(all, Not(HasSubstr("$argon2id$")));
    EXPECT_THAT(all, HasSubstr("too many wrong codes"));
    return {};
  }));
}

}  // namespace
}  // namespace needlelab
