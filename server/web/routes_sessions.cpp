// Sessions, their samples and scores, references, exports for studies.
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <string_view>
#include <utility>

#include "common/base/csv.h"
#include "common/base/uuid.h"
#include "server/web/route_parts.h"
#include "server/web/session_views.h"

namespace needlelab {
namespace {

using Call = pb::Request;

// --- sessions

/// A list's row: without the profile, which is most of it.
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

Result<pb::Request> listSessions(const WebCall& call) {
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
  constexpr std::uint64_t kLatest_ms = 9'200'000'000'000;  // 2261: as far as ns reach
  for (const auto& [name, set] : {std::pair("from_ms", &pb::ListSessions::set_from_unix_ns),
                                  std::pair("to_ms", &pb::ListSessions::set_to_unix_ns)}) {
    const std::string text = call.query(name);
    if (text.empty()) continue;
    const auto moment_ms = wholeOf(name, text, 0, kLatest_ms);
    if (!moment_ms) return moment_ms.error();
    (list.*set)(static_cast<std::int64_t>(*moment_ms) * 1'000'000);
  }
  list.set_limit(100);
  if (const std::string limit = call.query("limit"); !limit.empty()) {
    const auto number = wholeOf("limit", limit, 1, 1000);
    if (!number) return number.error();
    list.set_limit(static_cast<std::uint32_t>(*number));
  }
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  return request;
}

WebJson sessionsJson(const WebCall&, const pb::Reply& reply) {
  WebJson rows = WebJson::array();
  for (const pb::SessionInfo& session : reply.sessions().sessions()) rows.push_back(sessionRowJson(session));
  return {{"items", std::move(rows)}, {"next_page", base64Url(reply.sessions().next_page())}};
}

Result<pb::Request> getSession(const WebCall& call) {
  pb::Request request;
  if (auto set = setSession(call, *request.mutable_get_session()); !set) return set.error();
  return request;
}

WebJson oneSession(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.session());
}

Result<pb::Request> listEvents(const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_events();
  if (auto set = setSession(call, list); !set) return set.error();
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  return request;
}

WebJson eventsJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.events(), "events");
}

/// Where a session's ticks stand in time.
struct TickTimes {
  std::uint64_t first_tick = 0;
  double rate_hz = 0;
};

Result<TickTimes> tickTimesOf(Service& service, const WebCall& call) {
  pb::Request request;
  if (auto set = setSession(call, *request.mutable_get_session()); !set) return set.error();
  const auto info = replyOf(service, call, request);
  if (!info) return info.error();
  TickTimes times{0, info->session().description().rate_hz()};
  if (info->session().chunks() == 0) return times;
  if (auto set = setSession(call, *request.mutable_seek_session()); !set) return set.error();
  request.mutable_seek_session()->set_seconds(0);
  // a recording that retention has deleted has remarks nevertheless: by the rate alone
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
  if (auto set = setSession(call, list); !set) return set.error();
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  const auto reply = replyOf(service, call, request);
  if (!reply) return reply.error();
  const auto times = tickTimesOf(service, call);
  if (!times) return times.error();
  WebJson rows = WebJson::array();
  for (const pb::Annotation& annotation : reply->annotations().annotations())
    rows.push_back(annotationJson(annotation, *times));
  return WebJson{{"items", std::move(rows)}, {"next_page", base64Url(reply->annotations().next_page())}};
}

/// {"t_s": s since the first sample, "text": …}, or the tick itself.
Result<WebJson> addAnnotation(Service& service, const WebCall& call) {
  nlohmann::json body = call.body;
  if (!body.is_object() || body.contains("session_id") || body.contains("t_s") == body.contains("tick"))
    return Error{ErrorCode::kInvalidInput, "give {\"t_s\": SECONDS, \"text\": TEXT}"};
  const auto times = tickTimesOf(service, call);
  if (!times) return times.error();
  if (body.contains("t_s")) {
    const nlohmann::json at = body["t_s"];
    if (!at.is_number() || !(at.get<double>() >= 0 && at.get<double>() < 1e8))
      return Error{ErrorCode::kInvalidInput, "t_s: must be a number of seconds from 0"};
    body.erase("t_s");
    body["tick"] =
        times->first_tick + static_cast<std::uint64_t>(std::llround(at.get<double>() * times->rate_hz));
  }
  pb::Request request;
  auto& annotate = *request.mutable_annotate();
  if (auto read = messageOf(body, annotate); !read) return read.error();
  if (auto set = setSession(call, annotate); !set) return set.error();
  const auto reply = replyOf(service, call, request);
  if (!reply) return reply.error();
  return annotationJson(reply->annotation(), *times);
}

// --- scores and references

Result<pb::Request> getScore(const WebCall& call) {
  pb::Request request;
  auto& ask = *request.mutable_get_score();
  if (auto set = setSession(call, ask); !set) return set.error();
  if (const std::string text = call.query("definition_version"); !text.empty()) {
    const auto number = wholeOf("definition_version", text, 1, UINT32_MAX);
    if (!number) return number.error();
    ask.set_definition_version(static_cast<std::uint32_t>(*number));
  }
  return request;
}
WebJson scoreJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.score());
}

Result<pb::Request> rescore(const WebCall& call) {
  pb::Request request;
  if (auto set = setSession(call, *request.mutable_rescore_session()); !set) return set.error();
  return request;
}

Result<pb::Request> rescoreAll(const WebCall& call) {
  pb::Request request;
  if (auto read = readBodyInto(call, *request.mutable_rescore_all(), {}); !read) return read.error();
  return request;
}
WebJson rescoreReportJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.rescore_report());
}

Result<pb::Request> excuse(const WebCall& call) {
  pb::Request request;
  auto& ask = *request.mutable_excuse_attempt();
  if (auto read = readBodyInto(call, ask, {"session_id"}); !read) return read.error();
  if (auto set = setSession(call, ask); !set) return set.error();
  return request;
}
WebJson attemptJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.attempt());
}

Result<pb::Request> getReference(const WebCall& call) {
  pb::Request request;
  request.mutable_get_reference()->set_exercise_id(call.parts[0]);
  return request;
}
WebJson referenceJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.reference());
}

Result<pb::Request> setReference(const WebCall& call) {
  pb::Request request;
  auto& set = *request.mutable_set_reference();
  const Error fault{ErrorCode::kInvalidInput, "session_ids: give {\"session_ids\": [TEXT, …]}"};
  if (!call.body.is_object() || call.body.size() != 1 || !call.body.contains("session_ids") ||
      !call.body["session_ids"].is_array())
    return fault;
  for (const nlohmann::json& id : call.body["session_ids"]) {
    if (!id.is_string()) return fault;
    auto bytes = sessionBytesOf(id.get<std::string>());
    if (!bytes) return bytes.error();
    set.add_session_ids(std::move(*bytes));
  }
  const auto base = baseOf(call);
  if (!base) return base.error();
  set.set_exercise_id(call.parts[0]);
  set.set_base_revision(*base);
  return request;
}

/// A cell of CSV: quoted where it must be, and never a formula of a spreadsheet.
std::string csvCell(const std::string& text) {
  std::string cell = !text.empty() && std::string_view("=+-@\t\r").find(text[0]) != std::string_view::npos
                         ? "'" + text
                         : text;
  if (cell.find_first_of(",\"\r\n") == std::string::npos) return cell;
  std::string quoted = "\"";
  for (const char c : cell) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// Scores as a long table, a measure a line: page by page of ListScores.
class ScoreLines {
 public:
  ScoreLines(Service& service, WebCall call) : service_(service), call_(std::move(call)) {}

  Result<std::string> next() {
    if (ended_) return std::string();
    pb::Request request;
    auto& list = *request.mutable_list_scores();
    list.set_course_id(call_.query("course"));
    list.set_group_id(call_.query("group"));
    list.set_page(page_);
    const auto reply = replyOf(service_, call_, request);
    if (!reply) return reply.error();
    std::string text;
    if (page_.empty())
      text =
          "trainee,exercise_id,attempt,session_id,started_unix_ms,passed,definition_version,measure,value,"
          "unit,min,max,met\r\n";
    for (const pb::ScoreRow& row : reply->scores().scores()) addLines(text, row);
    page_ = reply->scores().next_page();
    ended_ = page_.empty();
    return text;
  }

 private:
  static std::string numberCell(const nlohmann::json& row, const char* name) {
    std::string text;
    if (row.contains(name) && row[name].is_number()) appendNumber(text, row[name].get<double>());
    return text;
  }
  static std::string textCell(const nlohmann::json& row, const char* name) {
    return row.contains(name) && row[name].is_string() ? csvCell(row[name].get<std::string>())
                                                       : std::string();
  }
  static void addLines(std::string& text, const pb::ScoreRow& row) {
    const pb::Attempt& attempt = row.attempt();
    const auto measures = nlohmann::json::parse(row.score().measures_json(), nullptr, false);
    if (!measures.is_array()) return;
    const WebJson shown = jsonOf(attempt);
    std::string head = csvCell(attempt.trainee()) + "," + csvCell(attempt.exercise_id()) + "," +
                       std::to_string(attempt.number()) + "," + shown.value("session_id", "") + "," +
                       std::to_string(attempt.started_unix_ns() / 1'000'000) + "," +
                       (row.score().has_passed() ? (row.score().passed() ? "yes" : "no") : "") + "," +
                       std::to_string(row.score().definition_version()) + ",";
    for (const nlohmann::json& measure : measures) {
      if (!measure.is_object()) continue;
      text += head + textCell(measure, "measure") + "," + numberCell(measure, "value") + "," +
              textCell(measure, "unit") + "," + numberCell(measure, "min") + "," +
              numberCell(measure, "max") + "," +
              (measure.contains("passed") && measure["passed"].is_boolean()
                   ? (measure["passed"].get<bool>() ? "yes" : "no")
                   : "") +
              "\r\n";
    }
  }

  Service& service_;
  const WebCall call_;
  std::string page_;
  bool ended_ = false;
};

Result<WebStream> scoresCsv(Service& service, const WebCall& call) {
  auto lines = std::make_shared<ScoreLines>(service, call);
  return streamFromFirst("text/csv; charset=utf-8", "scores.csv", [lines] { return lines->next(); });
}

// --- studies

Result<pb::Request> exportStudy(const WebCall& call) {
  pb::Request request;
  auto& ask = *request.mutable_export_study();
  ask.set_study(call.parts[0]);
  ask.set_exercise_id(call.query("exercise"));
  ask.set_with_remarks(call.query("remarks") == "yes");
  if (auto page = setPage(call, *ask.mutable_page()); !page) return page.error();
  return request;
}
WebJson studyJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.records(), "records");
}

constexpr auto kAskThe = WebAction::kRequest;

constexpr auto kSessionRoutes = std::to_array<WebRoute>({
    {"GET", "/sessions", Call::kListSessions, kAskThe, listSessions, sessionsJson},
    {"GET", "/sessions/{id}", Call::kGetSession, kAskThe, getSession, oneSession},
    {"GET", "/sessions/{id}/score", Call::kGetScore, kAskThe, getScore, scoreJson},
    {"POST", "/sessions/{id}/rescore", Call::kRescoreSession, kAskThe, rescore, scoreJson},
    {"POST", "/sessions/{id}/excuse", Call::kExcuseAttempt, kAskThe, excuse, attemptJson},
    {"GET", "/sessions/{id}/events", Call::kListEvents, kAskThe, listEvents, eventsJson},
    {"GET", "/sessions/{id}/samples", Call::kReadChunks, WebAction::kWork, nullptr, nullptr, samplePlot},
    {"GET", "/sessions/{id}/samples.csv", Call::kReadChunks, WebAction::kStream, nullptr, nullptr, nullptr,
     200, sampleCsv},
    {"GET", "/sessions/{id}/annotations", Call::kListAnnotations, WebAction::kWork, nullptr, nullptr,
     listAnnotations},
    {"POST", "/sessions/{id}/annotations", Call::kAnnotate, WebAction::kWork, nullptr, nullptr, addAnnotation,
     201},
    {"GET", "/exercises/{id}/reference", Call::kGetReference, kAskThe, getReference, referenceJson},
    {"PUT", "/exercises/{id}/reference", Call::kSetReference, kAskThe, setReference, referenceJson},
    {"GET", "/scores.csv", Call::kListScores, WebAction::kStream, nullptr, nullptr, nullptr, 200, scoresCsv},
    {"POST", "/scores/rescore", Call::kRescoreAll, kAskThe, rescoreAll, rescoreReportJson},
    {"GET", "/studies/{study}", Call::kExportStudy, kAskThe, exportStudy, studyJson},
});

}  // namespace

std::span<const WebRoute> sessionRoutes() {
  return kSessionRoutes;
}

}  // namespace needlelab
