#include "tests/postgres/isolation/pairs_at_a_time.h"

#include <google/protobuf/text_format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "db/audit/audit_chain.h"
#include "db/service/requests/requests.h"

namespace needlelab::test {
namespace {

/// Two requests in protobuf's text format; {name} stands for a text of the world.
struct TwoRequests {
  const char* first_by;
  const char* first;
  const char* second_by;
  const char* second;
  const char* told_later = "";  ///< PairAtATime
};

/// For an erasure: after its transaction it looks for the name elsewhere, and somebody with this name may
/// exist by then. That is true when the administrator reads it.
constexpr const char* kWhoElseHasTheName = "These have the letters of a name of this person";

// clang-format off
/// Each request that stores something, twice at the same time.
constexpr TwoRequests kSameRequests[] = {
  {"ada", "add_user { name: 'tom' role: TRAINEE full_name: 'Tom One' }",
   "mia", "add_user { name: 'tom' role: TRAINEE full_name: 'Tom Two' }"},
  {"ada", "set_password { name: 'ina' password: 'violet harbour 91 kite' }",
   "abe", "set_password { name: 'ina' password: 'amber canyon 37 loom' }"},
  {"ada", "set_code { name: 'anna' code: '081516' }", "mia", "set_code { name: 'anna' make: true }"},
  {"ada", "set_code { name: 'cora' }", "mia", "set_code { name: 'cora' }"},
  {"ada", "disable_user { name: 'carl' }", "mia", "disable_user { name: 'carl' }"},
  {"ada", "disable_user { name: 'carl' }", "mia", "disable_user { name: 'carl' enable: true }"},
  {"ada", "disable_user { name: 'abe' }", "abe", "disable_user { name: 'ada' }"},
  {"ina", "set_consent { name: 'bob' given: true }", "ina", "set_consent { name: 'bob' given: true }"},
  {"ina", "set_consent { name: 'anna' given: false }", "ada", "set_consent { name: 'anna' given: true note: 'again' }"},
  {"ada", "change_user { name: 'anna' base_revision: 1 full_name: 'Anna One' }",
   "mia", "change_user { name: 'anna' base_revision: 1 full_name: 'Anna Two' }"},
  {"ada", "change_user { name: 'anna' base_revision: 1 full_name: 'Anna One' }",
   "mia", "change_user { name: 'anna' base_revision: 2 full_name: 'Anna Two' }"},
  {"ada", "change_user { name: 'abe' base_revision: 1 role: INSTRUCTOR }",
   "abe", "change_user { name: 'ada' base_revision: 1 role: INSTRUCTOR }"},
  {"ada", "import_people { csv: 'name,full_name,group\\ntom,Tom One,g1;g9\\nanna,Anna One,g9\\n' }",
   "mia", "import_people { csv: 'name,full_name,group\\ntom,Tom Two,g9\\nbob,Bob Two,g9\\n' }"},
  {"ada", "export_person { name: 'anna' }", "mia", "export_person { name: 'anna' }"},
  {"ada", "put_group { group { id: 'g1' name: 'One' members: 'anna' } base_revision: 1 }",
   "mia", "put_group { group { id: 'g1' name: 'Two' members: 'carl' } base_revision: 1 }"},
  {"ada", "put_group { group { id: 'g9' name: 'One' members: 'anna' } }",
   "mia", "put_group { group { id: 'g9' name: 'Two' members: 'carl' } }"},
  {"ada", "remove_group { id: 'g1' base_revision: 1 }", "mia", "remove_group { id: 'g1' base_revision: 1 }"},
  {"ada", "add_station { name: 'station-9' }", "abe", "add_station { name: 'station-9' }"},
  {"ada", "revoke_station { name: 'station-2' }", "abe", "revoke_station { name: 'station-2' }"},
  {"ina", "trainee_message { station: 'station-1' text: 'slowly' }", "ada", "trainee_message { station: 'station-1' text: 'stop' }"},
  {"ina", "next_exercise { station: 'station-1' exercise_id: 'first' }",
   "ada", "next_exercise { station: 'station-1' exercise_id: 'second' }"},
  {"ina", "set_aids { station: 'station-1' reset: true }", "ada", "set_aids { station: 'station-1' }"},
  {"ina", "stop_lesson { station: 'station-1' reason: 'one' }", "ada", "stop_lesson { station: 'station-1' reason: 'two' }"},
  {"ada", "import_profile { json: {profile one} base_revision: 1 }", "mia", "import_profile { json: {profile two} base_revision: 1 }"},
  {"ada", "import_profile { json: {profile one} }", "mia", "import_profile { json: {profile one} }"},
  {"ada", "import_curriculum { json: {course one} base_revision: 1 }", "mia", "import_curriculum { json: {course two} base_revision: 1 }"},
  {"ina", "set_reference { exercise_id: 'first' session_ids: 'closed-session-1' }",
   "ada", "set_reference { exercise_id: 'first' session_ids: 'closed-session-2' }"},
  {"ina", "assign { trainee: 'anna' exercise_id: 'first' due_unix_ns: 1700000000000000000 }",
   "ada", "assign { trainee: 'anna' exercise_id: 'first' due_unix_ns: 1700000001000000000 }"},
  {"ina", "remove_assignment { id: 1 }", "ada", "remove_assignment { id: 1 }"},
  {"ina", "excuse_attempt { session_id: 'closed-session-1' excused: true reason: 'one' }",
   "ada", "excuse_attempt { session_id: 'closed-session-1' excused: false reason: 'two' }"},
  {"ada", "assign_session { session_id: 'waits--session-4' trainee: 'anna' was: 'nobody' }",
   "mia", "assign_session { session_id: 'waits--session-4' trainee: 'bob' was: 'nobody' }"},
  {"ada", "assign_session { session_id: 'waits--session-4' trainee: 'anna' }",
   "mia", "assign_session { session_id: 'waits--session-4' trainee: 'bob' }"},
  {"ada", "redact { name: 'carl' where: 'remark 1' }", "abe", "redact { name: 'carl' where: 'remark 1' }"},
  {"ina", "annotate { session_id: 'closed-session-1' tick: 1 text: 'one' }",
   "ada", "annotate { session_id: 'closed-session-1' tick: 1 text: 'two' }"},
  {"ina", "rescore_session { session_id: 'closed-session-1' }", "ada", "rescore_session { session_id: 'closed-session-1' }"},
  {"mia", "rescore_all {}", "ada", "rescore_all {}"},
  {"rea", "export_study { study: 'one' }", "ada", "export_study { study: 'one' }"},
  {"ada", "export_all {}", "abe", "export_all {}"},
  {"ada", "change_lab_settings { codes_required: true }", "abe", "change_lab_settings { codes_required: true }"},
  {"ada", "change_lab_settings { codes_required: true }", "abe", "change_lab_settings { codes_required: false }"},
  {"ada", "backup { path: {restored} counts_as_safe: true }", "abe", "backup { path: {restored} counts_as_safe: true }"},
  {"ada", "backup { path: {restored} counts_as_safe: true }", "abe", "backup { path: {older} counts_as_safe: true }"},
  {"ada", "backup { path: {older} counts_as_safe: true }", "abe", "backup { path: {restored} counts_as_safe: true }"},
  {"ada", "set_retention { policy { exercise_id: 'first' delete_after_days: 30 } }",
   "mia", "set_retention { policy { exercise_id: 'first' delete_after_days: 60 } }"},
  {"ada", "set_retention { policy { exercise_id: 'second' } as_default: true }",
   "mia", "set_retention { policy { exercise_id: 'second' } as_default: true }"},
  {"ada", "run_retention {}", "mia", "run_retention {}"},
};

/// Different requests about the same rows.
constexpr TwoRequests kOtherRequests[] = {
  {"ada", "change_user { name: 'carl' base_revision: 1 full_name: 'Carl Two' }", "mia", "disable_user { name: 'carl' }"},
  {"ada", "disable_user { name: 'abe' }", "abe", "add_user { name: 'tom' role: TRAINEE }"},
  {"ada", "change_user { name: 'mia' base_revision: 1 role: INSTRUCTOR }", "mia", "set_password { name: 'ina' password: 'violet harbour 91 kite' }"},
  {"ada", "import_people { csv: 'name,role,group\\ntom,trainee,g1\\n' }", "mia", "add_user { name: 'tom' role: TRAINEE }"},
  {"ada", "import_people { csv: 'name,group\\ncarl,g1\\n' }", "mia", "put_group { group { id: 'g1' name: 'Two' } base_revision: 1 }"},
  {"ada", "import_people { csv: 'name,full_name\\nanna,Anna One\\n' }", "mia", "change_user { name: 'anna' base_revision: 1 full_name: 'Anna Two' }"},
  {"ada", "import_people { csv: 'name,code\\nanna,481516\\n' }", "mia", "set_code { name: 'anna' code: '081516' }"},
  {"ada", "remove_group { id: 'g1' base_revision: 1 }", "mia", "put_group { group { id: 'g1' name: 'Two' members: 'carl' } base_revision: 1 }"},
  {"ada", "remove_group { id: 'g1' base_revision: 1 }", "ina", "assign { group_id: 'g1' course_id: 'course' }"},
  {"ada", "revoke_station { name: 'station-1' }", "ina", "stop_lesson { station: 'station-1' }"},
  {"ada", "import_curriculum { json: {course two} base_revision: 1 }", "ina", "assign { trainee: 'anna' exercise_id: 'second' }"},
  {"ada", "import_curriculum { json: {course two} base_revision: 1 }", "ina", "set_reference { exercise_id: 'second' session_ids: 'old----session-5' }"},
  {"ada", "import_curriculum { json: {course two} base_revision: 1 }", "mia", "set_retention { policy { exercise_id: 'second' delete_after_days: 9 } }"},
  {"ada", "import_profile { json: {profile one} }", "mia", "import_curriculum { json: {course one} base_revision: 1 }"},
  {"ada", "set_retention { policy { exercise_id: 'second' } }", "mia", "run_retention {}"},
  {"ina", "rescore_session { session_id: 'old----session-5' }", "mia", "run_retention {}"},
  {"ina", "set_reference { exercise_id: 'second' session_ids: 'old----session-5' }", "mia", "run_retention {}"},
  {"ina", "excuse_attempt { session_id: 'waits--session-4' excused: true }", "ada", "assign_session { session_id: 'waits--session-4' trainee: 'anna' }"},
  {"ina", "rescore_session { session_id: 'closed-session-1' }", "ada", "rescore_all {}"},
  {"mia", "export_person { name: 'anna' }", "ada", "change_user { name: 'anna' base_revision: 1 full_name: 'Anna One' }"},
  {"ada", "add_user { name: 'nobody' role: TRAINEE }", "mia", "assign_session { session_id: 'waits--session-4' trainee: 'anna' }"},
  {"ada", "backup { path: {restored} counts_as_safe: true }", "mia", "run_retention {}"},
  {"ada", "backup { path: {older} counts_as_safe: true }", "mia", "run_retention {}"},
  // an erasure; one program runs only one at a time (erasures.cpp)
  {"ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }", "mia", "change_user { name: 'carl' base_revision: 1 full_name: 'Carl Two' }"},
  {"ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }", "mia", "add_user { name: 'carl' role: TRAINEE }", kWhoElseHasTheName},
  {"ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }", "mia", "disable_user { name: 'carl' }"},
  {"ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }", "ina", "assign { trainee: 'carl' exercise_id: 'first' }"},
  {"ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }", "mia", "assign_session { session_id: 'waits--session-4' trainee: 'carl' }"},
  {"ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }", "mia", "put_group { group { id: 'g1' name: 'Two' members: 'carl' } base_revision: 1 }"},
  {"ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }", "abe", "backup { path: {restored} counts_as_safe: true }"},
  {"ada", "erase_person { name: 'abe' confirm: 'abe' }", "abe", "add_user { name: 'tom' role: TRAINEE }"},
};
// clang-format on

std::string quoted(const std::string& text) {
  std::string made = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') made += '\\';
    made += c == '\n' ? std::string("\\n") : std::string(1, c);
  }
  return made + "\"";
}

std::map<std::string, std::string> textsOf(const SharedWorld& world) {
  std::map<std::string, std::string> texts;
  for (const char* number : {"one", "two"}) {
    auto profile = nlohmann::json::parse(world.profileJson());
    profile["name"] = std::string("Knee ") + number;
    texts[std::string("{profile ") + number + "}"] = quoted(profile.dump());
    for (const char* name : {"zoe", "yan"}) {
      auto person = nlohmann::ordered_json::parse(world.personRecord());
      person["name"] = name;
      person["full_name"] = std::string("Full ") + number;
      texts[std::string("{") + name + " " + number + "}"] = quoted(person.dump());
    }
  }
  texts["{restored}"] = quoted(world.restoredUrl());
  texts["{older}"] = quoted(world.olderUrl());
  constexpr const char* kFirst = R"({"id":"first","name":"The first one","profile_id":"knee-adult"})";
  texts["{course one}"] = quoted(std::string(R"({"id":"course","name":"Course one","exercises":[)") + kFirst +
                                 R"(,{"id":"second","name":"The second","profile_id":"knee-adult"}]})");
  // without the second exercise
  texts["{course two}"] =
      quoted(std::string(R"({"id":"course","name":"Course two","exercises":[)") + kFirst + "]}");
  return texts;
}

struct MadeRequest {
  ServerWork work;
  pb::Request::CallCase call = pb::Request::CALL_NOT_SET;
};

MadeRequest requestOf(const std::string& by, std::string text,
                      const std::map<std::string, std::string>& texts) {
  for (const auto& [name, value] : texts)
    if (const auto at = text.find(name); at != std::string::npos) text.replace(at, name.size(), value);
  pb::Request request;
  if (!google::protobuf::TextFormat::ParseFromString(text, &request))
    throw std::runtime_error("this is no request: " + text);
  return {[who = principalOf(by), request](OneServer& server) {
            return answerText(server.service().execute(who, request));
          },
          request.call_case()};
}

}  // namespace

Indivisible indivisibleOf(pb::Request::CallCase call) {
  switch (call) {
    case pb::Request::kExportPerson:
    case pb::Request::kExportAll:
    case pb::Request::kExportStudy:
      return Indivisible::kStored;
    case pb::Request::kBackup:  // its line is written before it connects
    case pb::Request::kRescoreAll:
    case pb::Request::kRunRetention:
      return Indivisible::kSteps;
    default:
      return Indivisible::kWhole;
  }
}

std::vector<PairAtATime> pairsAtATime(const SharedWorld& world) {
  const auto texts = textsOf(world);
  std::vector<PairAtATime> pairs;
  const auto add = [&](const TwoRequests& two) {
    MadeRequest first = requestOf(two.first_by, two.first, texts);
    MadeRequest second = requestOf(two.second_by, two.second, texts);
    pairs.push_back({std::string(two.first_by) + ": " + two.first + " | " + two.second_by + ": " + two.second,
                     std::move(first.work), std::move(second.work), first.call, second.call, two.told_later});
  };
  for (const TwoRequests& two : kSameRequests) add(two);
  for (const TwoRequests& two : kOtherRequests) add(two);

  constexpr std::size_t kSame = 60, kAnother = 30;
  const auto request = [&](const char* by, const char* text) { return requestOf(by, text, texts); };
  const auto erase = request("ada", "erase_person { name: 'carl' confirm: 'carl' with_open_sessions: true }");
  const auto addWork = [&](const char* name, ServerWork first, ServerWork second,
                           pb::Request::CallCase call = pb::Request::CALL_NOT_SET) {
    pairs.push_back({name, std::move(first), std::move(second), pb::Request::CALL_NOT_SET, call});
  };
  addWork("a session is opened | and once more", opening("new----session-9", "anna", "one"),
          opening("new----session-9", "anna", "one"));
  addWork("a session is opened | and otherwise", opening("new----session-9", "anna", "one"),
          opening("new----session-9", "anna", "two"));
  addWork("two sessions are opened", opening("new----session-8", "anna", "one"),
          opening("new----session-9", "anna", "one"));
  addWork("a chunk | and once more", appending(2, kSame), appending(2, kSame));
  addWork("a chunk | and another one in its place", appending(2, kSame), appending(2, kAnother));
  addWork("a chunk | and the one behind it", appending(2, kSame), appending(3, kSame));
  addWork("a chunk | and the close with it", appending(2, kSame), closing(3));
  addWork("a chunk | and the close without it", appending(2, kSame), closing(2));
  addWork("a close | and once more", closing(2), closing(2));
  addWork("a close | and one with more chunks", closing(2), closing(3));
  addWork("a chunk | and the erasure of its trainee", appending(2, kSame), erase.work, erase.call);
  addWork("a close | and the erasure of its trainee", closing(2), erase.work, erase.call);
  pairs.back().first_commits = closingInTwoCommits(2);
  addWork("a session is opened | and its trainee is erased", opening("new----session-9", "carl", "one"),
          erase.work, erase.call);
  addWork("a chunk that cannot be decoded | and once more", appendingUndecodable(2), appendingUndecodable(2));
  addWork("a chunk that cannot be decoded | and a sound one in its place", appendingUndecodable(2),
          appending(2, kSame));
  addWork("a chunk that cannot be decoded | and the one behind it, neither", appendingUndecodable(2),
          appendingUndecodable(3));
  addWork("a chunk that cannot be decoded | and the erasure of its trainee", appendingUndecodable(2),
          erase.work, erase.call);
  const auto backup = request("ada", "backup { path: {restored} counts_as_safe: true }");
  addWork("a chunk | and a backup", appending(2, kSame), backup.work, backup.call);
  addWork("a close | and a backup", closing(2), backup.work, backup.call);
  addWork("a log-in | and once more", loggingIn("ina"), loggingIn("ina"));
  addWork("a code is locked | and once more", typingWrongCodes(), typingWrongCodes());
  addWork("a code is locked | and is another one", typingWrongCodes(),
          request("mia", "set_code { name: 'cora' code: '081516' }").work, pb::Request::kSetCode);
  const auto read = request("ina", "list_scores { course_id: 'course' }");
  const auto readOften = [read](OneServer& server) {
    const std::string once = read.work(server);
    return once + read.work(server);
  };
  addWork("scores are read, often | and by the other server", readOften, readOften);
  const auto added = request("mia", "add_user { name: 'zoe' role: TRAINEE }");
  addWork("a session of nobody is opened | and the trainee is added",
          opening("new----session-9", "zoe", "one"), added.work, added.call);
  const auto code = request("mia", "set_code { name: 'anna' code: '081516' }");
  addWork("a session is opened | and its trainee gets a code", opening("new----session-9", "anna", "one"),
          code.work, code.call);
  const auto revoked = request("ada", "revoke_station { name: 'station-1' }");
  addWork("a session is opened | and its station is revoked", opening("new----session-9", "anna", "one"),
          revoked.work, revoked.call);
  const auto given = request("mia", "assign_session { session_id: 'opened-session-8' trainee: 'anna' }");
  addWork("a close | and the session is given to a person", closing(2, kUnknownOpenSession), given.work,
          given.call);
  pairs.back().first_commits = closingInTwoCommits(2, kUnknownOpenSession);
  const auto annotated = request("ina", "annotate { session_id: 'open---session-3' tick: 1 text: 'one' }");
  addWork("a close | and a remark", closing(2), annotated.work, annotated.call);
  return pairs;
}

}  // namespace needlelab::test
