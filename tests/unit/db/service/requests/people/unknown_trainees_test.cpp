// Names without an account: refused when a lesson would begin, accepted and flagged when a recording arrives,
// and assigned to the right person.
#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>

#include "common/base/text/text.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/service/requests/results/teaching_fixture.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;

class UnknownTrainees : public test::TeachingTest {
 protected:
  void SetUp() override {
    addStation();
    putCourse({{"second", {{"prerequisites", {"first"}}}}});
  }
  void addNamed(const std::string& name, const std::string& full_name = "") {
    ASSERT_OK(change([&](Connection& c) {
      return PeopleStore(c).add({name, pb::TRAINEE, "", false, 1, full_name});
    }));
  }
  void assignCourse(const std::string& who) {
    pb::Request request;
    request.mutable_assign()->set_course_id("course");
    request.mutable_assign()->set_trainee(who);
    get(manager, request);
  }
  std::optional<Error> begin(const std::string& who) {
    pb::Request request;
    request.mutable_get_lesson()->set_exercise_id("first");
    request.mutable_get_lesson()->set_trainee(who);
    const auto lesson = ask(station, request).error;
    pb::Request check;
    check.mutable_check_trainee()->set_trainee(who);
    const auto alone = ask(station, check).error;
    EXPECT_EQ(lesson.has_value(), alone.has_value());
    EXPECT_EQ(lesson ? lesson->message : "", alone ? alone->message : "");
    return lesson;
  }
  pb::Request assignTo(const Uuid& session, const std::string& who) {
    pb::Request request;
    request.mutable_assign_session()->set_session_id(test::bytesOfId(session));
    request.mutable_assign_session()->set_trainee(who);
    request.mutable_assign_session()->set_reason("a slip of the pen");
    return request;
  }
  std::vector<std::string> waiting(const Principal& who) {
    pb::Request request;
    request.mutable_list_sessions()->set_unknown_trainee(true);
    std::vector<std::string> ids;
    const auto reply = get(who, request);
    for (const auto& session : reply.sessions().sessions()) {
      EXPECT_TRUE(session.unknown_trainee());
      ids.push_back(session.description().session_id());
    }
    return ids;
  }
  pb::Request erase(const std::string& name) {
    pb::Request request;
    request.mutable_erase_person()->set_name(name);
    request.mutable_erase_person()->set_confirm(name);
    return request;
  }
  /// Whether anything in the database contains this text; bytes are stored as hexadecimal digits there.
  bool names(const std::string& text) {
    std::string all, digits = hexDigitsOf(text);
    std::transform(digits.begin(), digits.end(), digits.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    EXPECT_OK(change([&](Connection& c) -> Status {
      all = test::dump(c);
      return {};
    }));
    return all.find(text) != std::string::npos || all.find(digits) != std::string::npos;
  }
  std::uint32_t attemptsOf(const std::string& who) {
    pb::Request request;
    request.mutable_get_progress()->set_trainee(who);
    return static_cast<std::uint32_t>(get(instructor, request).progress().attempts_size());
  }
};

TEST_F(UnknownTrainees, areRefusedWithNamesThatTheStationMayList) {
  addNamed("tom", "Tom Smith");
  addNamed("tim");
  addNamed("tam");  // nothing is assigned to this person
  addNamed("tum");
  for (const char* name : {"tom", "tim", "tum"}) assignCourse(name);
  ASSERT_OK(change([](Connection& c) { return PeopleStore(c).setDisabled("tum", true); }));
  attempt("tem", "first", true);  // an earlier ghost is not suggested
  const auto refused = begin("tomm");
  ASSERT_TRUE(refused.has_value());
  EXPECT_EQ(refused->code, ErrorCode::kNotFound);
  EXPECT_EQ(refused->message,
            "the server knows no one named 'tomm' who may practise. Did you mean 'tom' (Tom Smith)? Give the "
            "name of a trainee's account, practise as 'guest', or ask a manager to add this person; staff "
            "practise as members of a group with an assignment");
  EXPECT_THAT(begin("txm")->message, HasSubstr("'tam', 'tim' or 'tom' (Tom Smith)?"));
  for (const char* hidden : {"'tum'", "'tem'"}) EXPECT_THAT(begin("txm")->message, Not(HasSubstr(hidden)));
  EXPECT_THAT(begin("somebody else")->message, Not(HasSubstr("Did you mean")));
  EXPECT_EQ(begin(std::string(65, 'x'))->code, ErrorCode::kInvalidInput);
  EXPECT_EQ(begin("tum")->code, ErrorCode::kNotFound);
  // known people, whether the station lists them or not, and the guest
  for (const char* good : {"tom", "tam", "guest", ""}) EXPECT_FALSE(begin(good).has_value()) << good;
  // staff may look at a lesson for any name
  pb::Request look;
  look.mutable_get_lesson()->set_exercise_id("first");
  look.mutable_get_lesson()->set_trainee("t0m");
  get(instructor, look);
}

TEST_F(UnknownTrainees, getASimilarNameSuggestedWithoutAssignments) {
  addNamed("tina");
  EXPECT_THAT(begin("tinna")->message, HasSubstr("Did you mean 'tina'?"));
}

TEST_F(UnknownTrainees, lookLikeStaffAndLikeThoseWhoseAccessHasEnded) {
  for (const auto& [name, role] : {std::pair{"Quirin", pb::INSTRUCTOR},
                                   {"Quasim", pb::ADMINISTRATOR},
                                   {"Quelle", pb::CURRICULUM_MANAGER},
                                   {"Quorra", pb::RESEARCHER},
                                   {"Quincy", pb::TRAINEE}}) {
    ASSERT_OK(change([&, name = name, role = role](Connection& c) {
      return PeopleStore(c).add(
          {name, role, role == pb::TRAINEE ? "" : "$hash", false, 1, "Secret Full Name"});
    }));
    attempt(name, "first", true);  // somebody with a station's key can send this
  }
  assignCourse("Quincy");
  ASSERT_OK(change([](Connection& c) { return PeopleStore(c).setDisabled("Quincy", true); }));
  // the answer to a station about a name, with the name itself removed
  const auto heard = [&](const std::string& name) {
    const auto refused = begin(name);
    std::string all =
        refused ? std::to_string(static_cast<int>(refused->code)) + refused->message : "may begin";
    pb::Request request;
    request.mutable_get_results()->set_course_id("course");
    request.mutable_get_results()->set_trainee(name);
    all += get(station, request).results().ShortDebugString();
    request.mutable_list_assignments()->set_trainee(name);
    all += get(station, request).assignments().ShortDebugString();
    for (std::size_t at = all.find(name); at != std::string::npos; at = all.find(name))
      all.erase(at, name.size());
    return all;
  };
  const std::string unknown = heard("Quabbe");
  EXPECT_THAT(unknown, HasSubstr("no one named '' who may practise"));
  for (const char* name : {"Quirin", "Quasim", "Quelle", "Quorra", "Quincy"})
    EXPECT_EQ(heard(name), unknown) << name;
  const pb::Results listed = results(station);
  for (const auto& row : listed.rows()) EXPECT_EQ(row.full_name(), "") << row.trainee();
  pb::Request every;
  every.mutable_list_assignments();
  EXPECT_EQ(get(station, every).assignments().assignments_size(), 0);
  EXPECT_EQ(get(manager, every).assignments().assignments_size(), 1) << "staff sees all";
  // an expert may record under their own name once they are in a group with an assignment
  get(manager, putGroup("experts", {"Quirin"}, 0));
  EXPECT_EQ(heard("Quirin"), unknown);
  pb::Request assign;
  assign.mutable_assign()->set_course_id("course");
  assign.mutable_assign()->set_group_id("experts");
  get(manager, assign);
  EXPECT_THAT(heard("Quirin"), HasSubstr("may begin"));
  EXPECT_THAT(heard("Quirin"), HasSubstr("Secret Full Name"));
}

TEST_F(UnknownTrainees, areNotInTheListOfAStation) {
  addNamed("tom");
  for (const char* name : {"tom", "ghost", "guest"}) attempt(name, "first", true);
  const auto names = [&](const Principal& who) {
    std::vector<std::string> found;
    const pb::Results listed = results(who);
    for (const auto& row : listed.rows()) found.push_back(row.trainee());
    return found;
  };
  EXPECT_EQ(names(station), (std::vector<std::string>{"guest", "tom"}));
  EXPECT_EQ(names(instructor), (std::vector<std::string>{"ghost", "guest", "tom"})) << "staff sees all";
}

TEST_F(UnknownTrainees, areTypedNamesWhilePeopleAreTheirIdsToAStation) {
  addNamed("tom");
  attempt("tom", "first", true);
  const pb::Results listed = results(station);
  ASSERT_EQ(listed.rows_size(), 1);
  const std::string person = listed.rows(0).person_ref();
  EXPECT_EQ(person.size(), 37u) << "@ and a UUID";
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id("first");
  request.mutable_get_lesson()->set_trainee("TOM");
  EXPECT_EQ(get(station, request).lesson().person_ref(), person);
  request.mutable_check_trainee()->set_trainee("tom");
  EXPECT_EQ(get(station, request).trainee_checked().person_ref(), person);
  request.mutable_check_trainee()->set_trainee("guest");
  EXPECT_EQ(get(station, request).trainee_checked().person_ref(), "");
  EXPECT_EQ(results(instructor).rows(0).person_ref(), "") << "to stations only";
  attempt(person, "first", true);
  EXPECT_EQ(attemptsOf("tom"), 2u);
  EXPECT_TRUE(waiting(manager).empty());
}

TEST_F(UnknownTrainees, waitAfterAWrongClockUntilAManagerSetsTheBegin) {
  addNamed("tom");
  constexpr std::int64_t kMin_ns = 60'000'000'000, kNow_ns = 1'000 * kMin_ns;
  using Clock = pb::SessionDescription;
  const auto bring = [&](Clock::BeginClock clock, std::int64_t started_ns) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee("tom");
    d.set_exercise_id("first");
    d.set_started_unix_ns(started_ns);
    d.set_begin_clock(clock);
    EXPECT_OK(change([&](Connection& c) -> Status {
      const auto opened = SessionStore(c).open(d, kNow_ns);
      if (!opened) return opened.error();
      const auto closed = SessionStore(c).close(test::closeOf(id, 0), kNow_ns);
      return closed ? Status() : Status(closed.error());
    }));
    return id;
  };
  bring(Clock::SERVER_CLOCK, kNow_ns);
  bring(Clock::OWN_CLOCK, kNow_ns + 5 * kMin_ns);
  bring(Clock::OWN_CLOCK_ALONE, kNow_ns - 5 * kMin_ns);
  bring(Clock::BEGIN_CLOCK_UNSPECIFIED, 1);
  EXPECT_TRUE(waiting(manager).empty());
  EXPECT_EQ(attemptsOf("tom"), 4u);
  const std::vector<std::pair<Clock::BeginClock, std::int64_t>> wrong = {
      {Clock::OWN_CLOCK, kNow_ns + 5 * kMin_ns + 1},
      {Clock::SERVER_CLOCK, 2 * kNow_ns},
      {Clock::OWN_CLOCK_BEHIND, kNow_ns - 6 * kMin_ns},
      {Clock::OWN_CLOCK_ALONE, 1}};
  for (const auto& [clock, started_ns] : wrong) {
    const Uuid id = bring(clock, started_ns);
    ASSERT_EQ(waiting(manager), std::vector<std::string>{test::bytesOfId(id)}) << clock;
    pb::Request show;
    show.mutable_get_session()->set_session_id(test::bytesOfId(id));
    EXPECT_TRUE(get(manager, show).session().begin_unsure());
    EXPECT_FALSE(get(manager, show).session().code_unchecked()) << "that is not why";
    const std::uint32_t before = attemptsOf("tom");
    pb::Request accept = assignTo(id, "tom");
    accept.mutable_assign_session()->set_started_unix_ns(2);
    const auto given = get(manager, accept).session();
    EXPECT_EQ(given.description().started_unix_ns(), 2);
    EXPECT_FALSE(given.begin_unsure());
    EXPECT_EQ(attemptsOf("tom"), before + 1);
  }
}

TEST_F(UnknownTrainees, areNotTakenForTheIdThatTheyLookLike) {
  addNamed("tom");
  const Uuid session = attempt("@1", "first", true);
  EXPECT_EQ(waiting(manager), std::vector<std::string>{test::bytesOfId(session)});
  pb::Request request;
  request.mutable_get_session()->set_session_id(test::bytesOfId(session));
  EXPECT_EQ(get(manager, request).session().description().trainee(), "1");
}

TEST_F(UnknownTrainees, keepTheirRecordingsWhichAreFlaggedUntilTheyAreAssigned) {
  addNamed("tom");
  const Uuid ghosts = attempt("tmo", "first", true, 5), toms = attempt("tom", "first", false, 6);
  attempt("guest", "first", true);
  EXPECT_EQ(waiting(manager), std::vector<std::string>{test::bytesOfId(ghosts)});
  // an account created later with that name does not count: it may be another person
  addNamed("tmo");
  EXPECT_EQ(waiting(manager).size(), 1u);
  EXPECT_EQ(attemptsOf("tmo"), 0u) << "of the name's former owner";
  EXPECT_TRUE(lesson("second", "tom").has_value()) << "not passed";
  EXPECT_EQ(attemptsOf("tom"), 1u);

  const auto given = get(manager, assignTo(ghosts, "tom")).session();
  EXPECT_EQ(given.description().trainee(), "tom");
  EXPECT_FALSE(given.unknown_trainee());
  EXPECT_EQ(given.given_trainee(), "tmo");
  EXPECT_TRUE(waiting(manager).empty());
  // as if it had been tom's: the first attempt by time, and what it unlocks
  EXPECT_FALSE(lesson("second", "tom").has_value());
  EXPECT_EQ(attemptsOf("tom"), 2u);
  EXPECT_EQ(attemptsOf("tmo"), 0u);
  pb::Request progress;
  progress.mutable_get_progress()->set_trainee("tom");
  const auto attempts = get(instructor, progress).progress().attempts();
  EXPECT_EQ(attempts[0].session_id(), test::bytesOfId(ghosts));
  EXPECT_EQ(attempts[1].session_id(), test::bytesOfId(toms));
  EXPECT_EQ(attempts[1].number(), 2u);
  // the station sends the name it knows and gets the same answer as before
  auto again = test::describe(ghosts);
  again.set_trainee("tmo");
  again.set_exercise_id("first");
  again.set_started_unix_ns(5);
  ASSERT_OK(change([&](Connection& c) -> Status {
    const auto opened = SessionStore(c).open(again, 9);
    return opened ? Status() : Status(opened.error());
  }));
  again.set_trainee("tim");
  EXPECT_FALSE(change([&](Connection& c) -> Status {
                 const auto opened = SessionStore(c).open(again, 9);
                 return opened ? Status() : Status(opened.error());
               }).ok());
  // it was somebody else's after all, and finally no one's
  EXPECT_EQ(get(manager, assignTo(ghosts, "tmo")).session().given_trainee(), "tmo");
  EXPECT_EQ(attemptsOf("tom"), 1u);
  EXPECT_EQ(get(manager, assignTo(ghosts, "guest")).session().description().trainee(), "guest");

  pb::Request audit;
  audit.mutable_list_audit()->set_action("session assign");
  const auto lines = get(admin, audit).audit();
  ASSERT_EQ(lines.entries_size(), 3);
  EXPECT_EQ(lines.entries(2).who(), "mia");
  EXPECT_EQ(lines.entries(2).subject(), uuidText(ghosts));
  EXPECT_EQ(lines.entries(2).detail(), "from tmo to tom: a slip of the pen");
  EXPECT_EQ(lines.entries(1).detail(), "from tom to tmo: a slip of the pen");
}

TEST_F(UnknownTrainees, areAssignedByTheFirstOfTwoManagers) {
  for (const char* name : {"tom", "tim"}) addNamed(name);
  const Uuid ghosts = attempt("tmo", "first", true);
  auto first = assignTo(ghosts, "tom"), second = assignTo(ghosts, "tim");
  for (auto* request : {&first, &second}) request->mutable_assign_session()->set_was("tmo");
  get(manager, first);
  const auto late = ask(manager, second).error;
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(late->code, ErrorCode::kConflict);
  EXPECT_THAT(late->message, HasSubstr("was given to 'tom' meanwhile, not 'tmo'"));
  EXPECT_EQ(attemptsOf("tom"), 1u);
  EXPECT_EQ(attemptsOf("tim"), 0u);
  // someone who saw that may correct it
  second.mutable_assign_session()->set_was("tom");
  EXPECT_EQ(get(manager, second).session().description().trainee(), "tim");
}

TEST_F(UnknownTrainees, keepTheirSessionsFromALaterNamesake) {
  const Uuid ghosts = attempt("tmo", "first", true);
  EXPECT_EQ(attemptsOf("tmo"), 1u) << "staff sees what no one's account claims";
  addNamed("tmo");
  const Principal tmo{"tmo", pb::TRAINEE};
  pb::Request list, show, read, score, own;
  list.mutable_list_sessions();
  show.mutable_get_session()->set_session_id(test::bytesOfId(ghosts));
  read.mutable_read_chunks()->set_session_id(test::bytesOfId(ghosts));
  score.mutable_get_score()->set_session_id(test::bytesOfId(ghosts));
  own.mutable_export_person()->set_name("tmo");
  const auto of_kind = [&](const std::string& kind) {
    std::size_t found = 0;
    const auto records = get(tmo, own).records();
    for (const std::string& record : records.records())
      found += nlohmann::json::parse(record)["kind"] == kind ? 1 : 0;
    return found;
  };
  EXPECT_EQ(get(tmo, list).sessions().sessions_size(), 0);
  for (const auto& request : {show, read, score}) EXPECT_EQ(refusal(tmo, request), ErrorCode::kNotFound);
  EXPECT_EQ(of_kind("person"), 1u);
  EXPECT_EQ(of_kind("session") + of_kind("score") + of_kind("unknown_trainee"), 0u);
  EXPECT_TRUE(lesson("second", "tmo").has_value()) << "a stranger's attempt unlocks nothing";
  EXPECT_EQ(results(tmo).rows(0).cells(0).attempts(), 0u);
  // staff still sees it, but not among tmo's scores
  EXPECT_EQ(get(instructor, list).sessions().sessions_size(), 1);
  get(instructor, show);
  pb::Request scores;
  scores.mutable_list_scores();
  EXPECT_EQ(get(instructor, scores).scores().scores_size(), 0);

  // it was this person's after all
  get(manager, assignTo(ghosts, "tmo"));
  EXPECT_EQ(get(instructor, scores).scores().scores(0).attempt().number(), 1u);
  EXPECT_EQ(attemptsOf("tmo"), 1u);
  get(tmo, show);
  EXPECT_EQ(get(tmo, list).sessions().sessions_size(), 1);
  EXPECT_EQ(of_kind("session"), 1u);
  EXPECT_FALSE(lesson("second", "tmo").has_value());
}

TEST_F(UnknownTrainees, onlyTheirClosedSessionsAreAssignedAndOnlyToPeople) {
  addNamed("tom");
  const Uuid ghosts = attempt("tmo", "first", true), toms = attempt("tom", "first", true);
  const auto said = [&](const Uuid& id, const std::string& who) {
    const auto refused = ask(manager, assignTo(id, who)).error;
    return refused ? refused->message : std::string();
  };
  EXPECT_THAT(said(ghosts, "nobody"), HasSubstr("there is no person named 'nobody'"));
  EXPECT_THAT(said(ghosts, ""), HasSubstr("trainee"));
  EXPECT_THAT(said(toms, "tom"), HasSubstr("whom the server knew when it came"));
  EXPECT_THAT(said(makeUuidV7(), "tom"), HasSubstr("there is no session"));
  EXPECT_THAT(said(addSession("tam", 1), "tom"), HasSubstr("still open"));
  EXPECT_EQ(waiting(manager).size(), 2u) << "nothing of this changed anything";
  pb::Request audit;
  audit.mutable_list_audit()->set_action("session assign");
  EXPECT_EQ(get(admin, audit).audit().entries_size(), 0);
}

TEST_F(UnknownTrainees, remainWhenANamesakesAccountIsErased) {
  addPerson("ada", pb::ADMINISTRATOR);
  const Uuid ghosts = attempt("tom", "first", true, 5), still_open = addSession("tom", 1);
  addNamed("tom");
  attempt("tom", "first", true, 6);
  const auto erasure = get(admin, erase("tom")).erasure();
  EXPECT_EQ(erasure.sessions(), 1u) << "the account's own";
  EXPECT_EQ(erasure.waiting_sessions(), 2u);
  EXPECT_THAT(erasure.text(), HasSubstr("under the name 'tom'"));
  EXPECT_THAT(erasure.text(), HasSubstr("another person's: 2. Give them to the right person"));
  EXPECT_THAT(erasure.text(), HasSubstr("person erase 'tom' --confirm 'tom'"));
  EXPECT_EQ(waiting(manager).size(), 2u);
  pb::Request show;
  show.mutable_get_session()->set_session_id(test::bytesOfId(ghosts));
  const auto kept = get(instructor, show).session();
  EXPECT_EQ(kept.description().trainee(), "tom");
  EXPECT_TRUE(kept.passed()) << "with its verdict";
  // the station that records one of them still knows it by that name
  ASSERT_OK(change([&](Connection& c) -> Status {
    auto again = test::describe(still_open);
    again.set_trainee("tom");
    const auto opened = SessionStore(c).open(again, 9);
    if (!opened) return opened.error();
    EXPECT_EQ(*opened, 1u) << "chunks";
    const auto closed = SessionStore(c).close(test::closeOf(still_open, 1), 10);
    return closed ? Status() : Status(closed.error());
  }));
  get(manager, assignTo(ghosts, "guest"));
  EXPECT_EQ(get(instructor, show).session().given_trainee(), "tom");

  // no account has the name: the name itself is to be erased
  const auto rest = get(admin, erase("tom")).erasure();
  EXPECT_EQ(rest.sessions(), 1u) << "the other one was given to guest";
  EXPECT_EQ(rest.waiting_sessions(), 0u);
  EXPECT_THAT(rest.text(), Not(HasSubstr("wait")));
  EXPECT_TRUE(waiting(manager).empty());
  EXPECT_FALSE(names("'tom'"));
}

TEST_F(UnknownTrainees, areErasedWithTheAccountOnRequest) {
  addPerson("ada", pb::ADMINISTRATOR);
  attempt("tom", "first", true, 5);
  addNamed("tom");
  attempt("tom", "first", true, 6);
  auto request = erase("tom");
  request.mutable_erase_person()->set_with_waiting_sessions(true);
  const auto erasure = get(admin, request).erasure();
  EXPECT_EQ(erasure.sessions(), 2u);
  EXPECT_EQ(erasure.waiting_sessions(), 0u);
  EXPECT_TRUE(waiting(manager).empty());
  EXPECT_FALSE(names("'tom'"));
}

TEST_F(UnknownTrainees, whoseSessionIsOpenHoldUpTheErasureOfThoseItTakes) {
  addPerson("ada", pb::ADMINISTRATOR);
  addSession("tom", 1);
  EXPECT_EQ(refusal(admin, erase("tom")), ErrorCode::kUnavailable) << "nobody's account: it would be taken";
  addNamed("tom");
  auto request = erase("tom");
  request.mutable_erase_person()->set_with_waiting_sessions(true);
  EXPECT_EQ(refusal(admin, request), ErrorCode::kUnavailable);
  EXPECT_EQ(get(admin, erase("tom")).erasure().waiting_sessions(), 1u);
}

TEST_F(UnknownTrainees, areErasedByTheNameThatTheirStationGaveToo) {
  addNamed("tom");
  addPerson("ada", pb::ADMINISTRATOR);
  const Uuid ghosts = attempt("Mona Ghost", "first", true, 5);
  get(manager, assignTo(ghosts, "guest"));
  EXPECT_TRUE(names("Mona Ghost"));
  EXPECT_EQ(get(admin, erase("Mona Ghost")).erasure().sessions(), 0u) << "it is guest's";
  EXPECT_FALSE(names("Mona Ghost"));
}

}  // namespace
}  // namespace needlelab
