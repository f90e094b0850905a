// Routes that are not plain (see routes.h): two kinds of change selected by the body, a document as the body,
// replies from several requests.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>
#include <utility>

#include "common/base/text/text.h"
#include "common/base/text/uuid.h"
#include "server/web/routes.h"
#include "server/web/session_views.h"

namespace needlelab {
namespace {

// --- people, groups

constexpr std::uint32_t kListedByDefault = 100;
constexpr std::uint64_t kMaxListedSessions = 1000, kMaxListedPeople = 500, kMaxListedResults = 250;

/// `?limit=`, 100 by default. kInvalidInput.
Result<std::uint32_t> limitOf(const WebCall& call, std::uint64_t most) {
  const std::string text = call.query("limit");
  if (text.empty()) return kListedByDefault;
  ASSIGN_OR_RETURN(const auto number, wholeOf("limit", text, 1, most));
  return static_cast<std::uint32_t>(number);
}

Result<pb::Request> listPeople(const WebRoute&, const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_users();
  list.set_search(call.query("search"));
  if (std::string role = lowerCase(call.query("role")); !role.empty()) {
    std::replace(role.begin(), role.end(), '_', '-');
    list.set_role(roleOfName(role));
    if (list.role() == pb::ROLE_UNSPECIFIED || list.role() == pb::STATION)
      return Error{ErrorCode::kInvalidInput,
                   "role: must be trainee, instructor, curriculum-manager, administrator or researcher"};
  }
  ASSIGN_OR_RETURN(const auto limit, limitOf(call, kMaxListedPeople));
  list.set_limit(limit);
  RETURN_IF_ERROR(setPage(call, *list.mutable_page()));
  return request;
}

WebJson addedPerson(const WebCall& call, const pb::Reply& reply) {
  if (reply.has_user()) return jsonOf(reply.user());
  const pb::AddUser& added = call.request->add_user();
  return WebJson{{"name", added.name()}, {"role", pb::Role_Name(added.role())}};
}

/// Changes role, name and access, or only the consent to studies.
Result<pb::Request> changePerson(const WebRoute&, const WebCall& call) {
  pb::Request request;
  if (call.body.is_object() && call.body.contains("consent")) {
    const nlohmann::json& given = call.body["consent"];
    const bool noted = call.body.size() == 2 && call.body.contains("note") && call.body["note"].is_string();
    if (!given.is_boolean() || (call.body.size() != 1 && !noted))
      return Error{ErrorCode::kInvalidInput,
                   "consent: give {\"consent\": true or false, \"note\": TEXT} alone"};
    auto& consent = *request.mutable_set_consent();
    consent.set_name(call.parts[0]);
    consent.set_given(given.get<bool>());
    if (noted) consent.set_note(call.body["note"].get<std::string>());
    return request;
  }
  auto& change = *request.mutable_change_user();
  RETURN_IF_ERROR(readBodyInto(call, change, {"name", "base_revision"}));
  ASSIGN_OR_RETURN(const auto base, baseOf(call));
  change.set_name(call.parts[0]);
  change.set_base_revision(base);
  return request;
}

Result<pb::Request> addGroup(const WebRoute&, const WebCall& call) {
  pb::Request request;
  auto& put = *request.mutable_put_group();
  RETURN_IF_ERROR(readBodyInto(call, *put.mutable_group(), {"revision", "changed_by", "member_count"}));
  return request;
}

Result<pb::Request> putGroup(const WebRoute& route, const WebCall& call) {
  ASSIGN_OR_RETURN(auto request, addGroup(route, call));
  auto& put = *request.mutable_put_group();
  if (!put.group().id().empty() && put.group().id() != call.parts[0])
    return Error{ErrorCode::kInvalidInput, "id: differs from the one in the address"};
  put.mutable_group()->set_id(call.parts[0]);
  ASSIGN_OR_RETURN(const auto base, baseOf(call));
  put.set_base_revision(base);
  return request;
}

// --- profiles, courses, exercises: the body is the document itself

std::string bodyText(const WebCall& call) {
  return call.body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

/// The document's id must match the address.
Status sameId(const WebCall& call) {
  if (call.body.is_object() && call.body.value("id", nlohmann::json()) == call.parts[0]) return {};
  return Error{ErrorCode::kInvalidInput, "id: is not '" + call.parts[0] + "', as in the address"};
}

template <typename Import>
Status putDocument(const WebCall& call, Import& import) {
  RETURN_IF_ERROR(sameId(call));
  ASSIGN_OR_RETURN(const auto base, baseOf(call));
  import.set_json(bodyText(call));
  import.set_base_revision(base);
  return {};
}

Result<pb::Request> putProfile(const WebRoute&, const WebCall& call) {
  pb::Request request;
  RETURN_IF_ERROR(putDocument(call, *request.mutable_import_profile()));
  return request;
}

Result<pb::Request> putCourse(const WebRoute&, const WebCall& call) {
  pb::Request request;
  RETURN_IF_ERROR(putDocument(call, *request.mutable_import_curriculum()));
  return request;
}

/// POST /profiles/check and POST /courses/check.
Result<pb::Request> checkDocument(const WebRoute& route, const WebCall& call) {
  pb::Request request;
  request.mutable_check_text()->set_json(bodyText(call));
  request.mutable_check_text()->set_kind(route.pattern == "/courses/check" ? "course" : "profile");
  return request;
}

Result<pb::Request> previewProfile(const WebRoute&, const WebCall& call) {
  pb::Request request;
  auto& preview = *request.mutable_preview_profile();
  preview.set_json(bodyText(call));
  if (const std::string text = call.query("points"); !text.empty()) {
    ASSIGN_OR_RETURN(const auto number, wholeOf("points", text, 2, 2000));
    preview.set_points(static_cast<std::uint32_t>(number));
  }
  if (const std::string text = call.query("to_depth_m"); !text.empty()) {
    ASSIGN_OR_RETURN(const double number, numberOf("to_depth_m", text, 0.001, 1));
    preview.set_to_depth_m(number);
  }
  return request;
}

WebJson measuresJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.measures(), "measures");
}

Result<pb::Request> setReference(const WebRoute&, const WebCall& call) {
  pb::Request request;
  auto& set = *request.mutable_set_reference();
  const Error fault{ErrorCode::kInvalidInput, "session_ids: give {\"session_ids\": [TEXT, …]}"};
  if (!call.body.is_object() || call.body.size() != 1 || !call.body.contains("session_ids") ||
      !call.body["session_ids"].is_array())
    return fault;
  for (const nlohmann::json& id : call.body["session_ids"]) {
    if (!id.is_string()) return fault;
    ASSIGN_OR_RETURN(auto bytes, sessionBytesOf(id.get<std::string>()));
    set.add_session_ids(std::move(bytes));
  }
  ASSIGN_OR_RETURN(const auto base, baseOf(call));
  set.set_exercise_id(call.parts[0]);
  set.set_base_revision(base);
  return request;
}

// --- assignments and results

Result<pb::Request> listResults(const WebRoute& route, const WebCall& call) {
  ASSIGN_OR_RETURN(auto request, plainRequest(route, call));
  ASSIGN_OR_RETURN(const auto limit, limitOf(call, kMaxListedResults));
  request.mutable_get_results()->set_limit(limit);
  return request;
}

WebJson addedAssignment(const WebCall&, const pb::Reply& reply) {
  return reply.assignments().assignments_size() > 0 ? jsonOf(reply.assignments().assignments(0))
                                                    : WebJson::object();
}

Result<pb::Request> removeAssignment(const WebRoute&, const WebCall& call) {
  pb::Request request;
  const auto id = wholeOf("id", call.parts[0], 1, INT64_MAX);
  if (!id) return Error{ErrorCode::kNotFound, "there is no assignment of that number"};
  request.mutable_remove_assignment()->set_id(*id);
  return request;
}

// --- sessions

/// A row of a list, without the profile, which is its largest part.
WebJson sessionRowJson(const pb::SessionInfo& session) {
  WebJson row = jsonOf(session);
  if (row.contains("description")) row["description"].erase("profile");
  return row;
}

constexpr std::pair<std::string_view, pb::ListSessions::Verdict> kVerdicts[] = {
    {"passed", pb::ListSessions::PASSED},
    {"failed", pb::ListSessions::FAILED},
    {"none", pb::ListSessions::NONE},
};

Result<pb::Request> listSessions(const WebRoute&, const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_sessions();
  list.set_trainee(call.query("trainee"));
  list.set_station(call.query("station"));
  list.set_exercise_id(call.query("exercise"));
  list.set_search(call.query("search"));
  if (const std::string verdict = call.query("verdict"); !verdict.empty()) {
    const auto found = std::find_if(std::begin(kVerdicts), std::end(kVerdicts),
                                    [&](const auto& known) { return known.first == verdict; });
    if (found == std::end(kVerdicts))
      return Error{ErrorCode::kInvalidInput, "verdict: must be passed, failed or none"};
    list.set_verdict(found->second);
  }
  constexpr std::uint64_t kLatest_ms = 9'200'000'000'000;  // 2261: the range of ns
  for (const auto& [name, set] : {std::pair("from_ms", &pb::ListSessions::set_from_unix_ns),
                                  std::pair("to_ms", &pb::ListSessions::set_to_unix_ns)}) {
    const std::string text = call.query(name);
    if (text.empty()) continue;
    const auto moment_ms = wholeOf(name, text, 0, kLatest_ms);
    if (!moment_ms)
      return Error{ErrorCode::kInvalidInput,
                   std::string(name) + ": must be a time in ms since 1970, until 2261"};
    (list.*set)(static_cast<std::int64_t>(*moment_ms) * 1'000'000);
  }
  ASSIGN_OR_RETURN(const auto limit, limitOf(call, kMaxListedSessions));
  list.set_limit(limit);
  RETURN_IF_ERROR(setPage(call, *list.mutable_page()));
  return request;
}

Result<pb::Request> listUnknownTrainees(const WebRoute&, const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_sessions();
  list.set_unknown_trainee(true);
  list.set_limit(kListedByDefault);
  RETURN_IF_ERROR(setPage(call, *list.mutable_page()));
  return request;
}

WebJson sessionsJson(const WebCall&, const pb::Reply& reply) {
  WebJson rows = WebJson::array();
  for (const pb::SessionInfo& session : reply.sessions().sessions()) rows.push_back(sessionRowJson(session));
  return {{"items", std::move(rows)}, {"next_page", base64Url(reply.sessions().next_page())}};
}

/// Maps a session's ticks to times.
struct TickTimes {
  std::uint64_t first_tick = 0;
  double rate_hz = 0;
};

Result<TickTimes> tickTimesOf(Service& service, const WebCall& call) {
  pb::Request request;
  RETURN_IF_ERROR(setSession(call, *request.mutable_get_session()));
  ASSIGN_OR_RETURN(const auto info, replyOf(service, call, request));
  TickTimes times{0, info.session().description().rate_hz()};
  if (info.session().chunks() == 0) return times;
  RETURN_IF_ERROR(setSession(call, *request.mutable_seek_session()));
  request.mutable_seek_session()->set_seconds(0);
  // a deleted recording still has remarks; then convert by the rate alone
  if (const auto sought = replyOf(service, call, request); sought)
    times.first_tick = sought->sought().recording_first_tick();
  return times;
}

WebJson annotationJson(const pb::Annotation& annotation, const TickTimes& times) {
  WebJson row = jsonOf(annotation);
  row["t_s"] =
      times.rate_hz > 0
          ? (static_cast<double>(annotation.tick()) - static_cast<double>(times.first_tick)) / times.rate_hz
          : 0.0;
  return row;
}

Result<WebJson> listAnnotations(Service& service, const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_annotations();
  RETURN_IF_ERROR(setSession(call, list));
  RETURN_IF_ERROR(setPage(call, *list.mutable_page()));
  ASSIGN_OR_RETURN(const auto reply, replyOf(service, call, request));
  ASSIGN_OR_RETURN(const auto times, tickTimesOf(service, call));
  WebJson rows = WebJson::array();
  for (const pb::Annotation& annotation : reply.annotations().annotations())
    rows.push_back(annotationJson(annotation, times));
  return WebJson{{"items", std::move(rows)}, {"next_page", base64Url(reply.annotations().next_page())}};
}

/// {"t_s": s since the first sample, "text": …}, or the tick itself.
Result<WebJson> addAnnotation(Service& service, const WebCall& call) {
  nlohmann::json body = call.body;
  if (!body.is_object() || body.contains("session_id") || body.contains("t_s") == body.contains("tick"))
    return Error{ErrorCode::kInvalidInput, "give {\"t_s\": SECONDS, \"text\": TEXT}"};
  ASSIGN_OR_RETURN(const auto times, tickTimesOf(service, call));
  if (body.contains("t_s")) {
    const nlohmann::json at = body["t_s"];
    if (!at.is_number() || !(at.get<double>() >= 0 && at.get<double>() < 1e8))
      return Error{ErrorCode::kInvalidInput, "t_s: must be a number of seconds from 0"};
    body.erase("t_s");
    body["tick"] =
        times.first_tick + static_cast<std::uint64_t>(std::llround(at.get<double>() * times.rate_hz));
  }
  pb::Request request;
  auto& annotate = *request.mutable_annotate();
  RETURN_IF_ERROR(messageOf(body, annotate));
  RETURN_IF_ERROR(setSession(call, annotate));
  ASSIGN_OR_RETURN(const auto reply, replyOf(service, call, request));
  return annotationJson(reply.annotation(), times);
}

// --- scores, studies, the audit log

Result<pb::Request> exportStudy(const WebRoute&, const WebCall& call) {
  pb::Request request;
  auto& ask = *request.mutable_export_study();
  ask.set_study(call.parts[0]);
  ask.set_exercise_id(call.query("exercise"));
  ask.set_with_remarks(call.query("remarks") == "yes");
  RETURN_IF_ERROR(setPage(call, *ask.mutable_page()));
  return request;
}

Result<pb::Request> listAudit(const WebRoute& route, const WebCall& call) {
  ASSIGN_OR_RETURN(auto request, plainRequest(route, call));
  request.mutable_list_audit()->set_limit(200);
  return request;
}

constexpr RouteAdapter kAdapters[] = {
    {.line = "GET /people", .build = listPeople},
    {.line = "POST /people", .shape = addedPerson, .status = 201},
    {.line = "PATCH /people/{name}", .build = changePerson},
    {.line = "GET /people/{name}/export", .action = WebAction::kStream, .stream = personRecords},
    {.line = "POST /groups", .build = addGroup, .status = 201},
    {.line = "PUT /groups/{id}", .build = putGroup},
    {.line = "PUT /profiles/{id}", .build = putProfile},
    {.line = "POST /profiles/check", .build = checkDocument},
    {.line = "POST /profiles/preview", .build = previewProfile},
    {.line = "PUT /courses/{id}", .build = putCourse},
    {.line = "POST /courses/check", .build = checkDocument},
    {.line = "GET /measures", .shape = measuresJson},
    {.line = "PUT /exercises/{id}/reference", .build = setReference},
    {.line = "POST /assignments", .shape = addedAssignment, .status = 201},
    {.line = "DELETE /assignments/{id}", .build = removeAssignment},
    {.line = "GET /results", .build = listResults},
    {.line = "GET /courses/{id}/results.*",
     .action = WebAction::kStream,
     .stream = resultStream,
     .place = ExportPlace::kWebResults},
    {.line = "GET /sessions", .build = listSessions, .shape = sessionsJson},
    {.line = "GET /unknown-trainees", .build = listUnknownTrainees, .shape = sessionsJson},
    {.line = "GET /sessions/{id}/samples", .action = WebAction::kSteps, .steps = samplePlot},
    {.line = "GET /sessions/{id}/samples.*",
     .action = WebAction::kStream,
     .stream = sampleStream,
     .place = ExportPlace::kWebSamples},
    {.line = "GET /sessions/{id}/annotations", .action = WebAction::kWork, .work = listAnnotations},
    {.line = "POST /sessions/{id}/annotations",
     .action = WebAction::kWork,
     .work = addAnnotation,
     .status = 201},
    {.line = "GET /scores.*",
     .action = WebAction::kStream,
     .stream = scoreStream,
     .place = ExportPlace::kWebScores},
    {.line = "GET /studies/{study}", .build = exportStudy},
    {.line = "GET /audit", .build = listAudit},
};

}  // namespace

std::span<const RouteAdapter> routeAdapters() {
  return kAdapters;
}

}  // namespace needlelab
