#include "server/web/web_server.h"

#include <fmt/core.h>

#include <utility>

#include "common/base/secret.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "db/service/requests/requests.h"
#include "db/store/schema.h"
#include "server/live/counters.h"
#include "server/live/limits/disk_room.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/account_login.h"
#include "server/live/login/login_state.h"
#include "server/live/port/request_effects.h"
#include "server/live/work/server_work.h"
#include "server/web/route_actions.h"
#include "server/web/routes.h"
#include "server/web/web_call.h"

namespace needlelab {
namespace {

using Shared = std::shared_ptr<WebServer>;
using Request = std::shared_ptr<HttpRequest>;

/// As in other servers' logs; never sent.
constexpr unsigned kClientHungUp = 499;

/// An upper estimate of the memory of a body's JSON, from its punctuation: a value in a list takes 16 bytes
/// of a block that doubles, a member about 96.
std::size_t jsonBytes(std::string_view body) {
  std::size_t bytes = body.size();
  for (const char c : body) bytes += c == ',' ? 32u : c == ':' ? 96u : c == '[' || c == '{' ? 64u : 0u;
  return bytes;
}

/// The key for turns when looking for a session.
std::string askerOf(const HttpRequest& request) {
  return Admission::keyOf(hostOfAddress(request.address));
}

HttpAnswer notLoggedIn() {
  HttpAnswer answer = errorAnswer(401, "not_logged_in", "log in first: there is no session, or it has ended");
  return answer;
}

HttpAnswer fileAnswer(const WebServer& server, const HttpRequest& request, const WebTarget& target) {
  if (request.method != "GET" && request.method != "HEAD") {
    HttpAnswer answer = errorAnswer(405, "method_not_allowed", "only GET and HEAD");
    answer.headers.emplace_back("Allow", "GET, HEAD");
    return answer;
  }
  const StaticFile* file = server.files().find(target.path());
  if (file == nullptr) return errorAnswer(404, "not_found", "there is no such page");
  HttpAnswer answer;
  answer.no_store = false;
  answer.type = file->type;
  answer.headers.emplace_back("ETag", file->etag);
  if (request.if_none_match == "*" || request.if_none_match.find(file->etag) != std::string::npos) {
    answer.status = 304;
  } else {
    answer.shared_body = file->body;
  }
  return answer;
}

/// Refuses a request that another site's page made through this browser, even with valid credentials.
std::optional<HttpAnswer> foreignPage(HttpRequest& request, bool needs_origin) {
  const bool safe = (request.method == "GET" || request.method == "HEAD") && !needs_origin;
  if (safe) return std::nullopt;
  const bool wrong = request.origin.empty() ? needs_origin : !isSameOrigin(request.origin, request.host);
  const bool site_wrong =
      !request.fetch_site.empty() && request.fetch_site != "same-origin" && request.fetch_site != "none";
  if (!wrong && !site_wrong) return std::nullopt;
  request.refused_for = fmt::format("Origin '{}', Host '{}', Sec-Fetch-Site '{}'", printable(request.origin),
                                    printable(request.host), printable(request.fetch_site));
  return errorAnswer(403, "wrong_origin", "only pages of this server may ask for that");
}

/// The room on the database's disk, for administrators, who can free some.
WebJson diskRoom(const ServerContext& context) {
  const std::uint64_t left = context.limits.disk_room.leftBytes();
  const bool read_only = context.store.readOnly().has_value();
  WebJson room = {{"level", std::string(read_only ? "read_only" : nameOf(context.limits.disk_room.level()))}};
  if (left != UINT64_MAX) room["left_bytes"] = left;  // UINT64_MAX: before the first look
  return room;
}

constexpr std::int64_t kAskDatabaseAfter_ns = 10'000'000'000;
constexpr std::int64_t kLongCommit_ns = 2'000'000'000;

/// For administrators: what an ack survives, which acknowledged data is missing, and whether incoming data is
/// stored. While nothing is being committed, starts a test write whose result the next call reports.
WebJson storeState(ServerContext& context) {
  DbWriter& writer = context.store.writer();
  const DbWriter::Standing standing = writer.standing();
  const std::int64_t now = steadyNowNs();
  WebJson state = {{"ack_survives", std::string(durabilityText(writer.durability()))}};
  std::string refused = standing.refused;
  if (refused.empty()) refused = writer.failedItem(DbWriter::kReportedFor);
  if (refused.empty()) refused = writer.full(DbWriter::kReportedFor);
  if (!refused.empty()) state["refused"] = refused;
  if (const std::string lack = writer.lack(); !lack.empty()) state["lack"] = lack;
  if (standing.began_ns != 0 && now - standing.began_ns > kLongCommit_ns)
    state["waits_s"] = static_cast<double>(now - standing.began_ns) / 1e9;
  const bool idle = standing.began_ns == 0 && now - standing.committed_ns > kAskDatabaseAfter_ns &&
                    writer.counters().waiting == 0;
  // a write that fails because the disk is full would end the writer
  if (idle && !context.store.readOnly() && context.limits.disk_room.level() == RoomLevel::kPlenty)
    (void)writer.post(
        [](Connection& connection) {
          return MetaStore(connection).set("health_unix_ns", std::to_string(wallNowNs()));
        },
        {});
  return state;
}

HttpAnswer noFreeConnection() {
  HttpAnswer answer = errorAnswer(503, "unavailable",
                                  "other people take all connections of this server: try again in a minute");
  answer.close = true;
  return answer;
}

Task<WebJson> sessionState(Shared server, Principal who, std::string token) {
  pb::Request own;
  own.mutable_get_user()->set_name(who.name);
  std::function<Outcome()> read = [&service = server->context().store.service(), who, own] {
    return service.execute(who, own);
  };
  const Outcome person =
      co_await offload(*server->context().work.workers_of_people, turnNameOf(who), std::move(read));
  const std::chrono::nanoseconds left = co_await server->context().logins.state->left(token);
  WebJson state = {{"name", who.shown()},
                   {"full_name", person.reply.user().full_name()},
                   {"role", pb::Role_Name(who.role)},
                   {"csrf_token", server->sessions().csrfOf(token)},
                   {"expires_unix_ms", static_cast<double>(wallNowNs() + left.count()) / 1e6}};
  if (who.role == pb::ADMINISTRATOR) {
    state["disk_room"] = diskRoom(server->context());
    state["store"] = storeState(server->context());
  }
  co_return state;
}

Task<HttpAnswer> logIn(Shared server, Request request, nlohmann::json body) {
  if (!body.is_object() || body.size() != 2 || !body.contains("name") || !body["name"].is_string() ||
      !body.contains("password") || !body["password"].is_string())
    co_return errorAnswer(400, "invalid_input", "give {\"name\": TEXT, \"password\": TEXT}");
  auto secret = std::make_shared<const PersonSecret>(body["name"].get<std::string>(),
                                                     body["password"].get<std::string>());
  wipe(body["password"].get_ref<std::string&>());
  ServerContext& context = server->context();
  LoginPeer peer{request->connection, request->address, request->gone};
  const PersonLogin login = co_await logInPerson(context, secret, std::move(peer));
  using Answer = PersonLogin::Answer;
  if (login.answer == Answer::kMustWait || login.answer == Answer::kTooMany) {
    HttpAnswer answer = errorAnswer(429, "rate_limited", textOf(login));
    answer.headers.emplace_back("Retry-After", std::to_string(login.wait.count() / 1000 + 1));
    co_return answer;
  }
  if (login.answer == Answer::kRefused)
    co_return errorAnswer(401, "login_refused", "unknown name, wrong password, or disabled");
  if (login.answer != Answer::kWelcome) co_return errorAnswer(500, "failed", textOf(login));
  if (!server->showedSession(request->connection, login.holder.who.name)) co_return noFreeConnection();
  // replaces the browser's earlier session
  const auto before = co_await server->sessions().find(request->cookie, askerOf(*request));
  if (before.ok() && *before) (void)co_await context.logins.state->end((*before)->token);
  const auto issued = co_await context.logins.state->issue(login.holder);
  if (!issued.ok() && issued.error().code == ErrorCode::kConflict) {
    PersonLogin changed;
    changed.answer = Answer::kTooMany;
    co_return errorAnswer(429, "rate_limited", textOf(changed));
  }
  if (!issued.ok()) co_return errorAnswer(issued.error());
  ++context.counters.logins;
  const std::string& name = login.holder.who.name;
  server->note(name, PeerLine::kWebLogin,
               {{"conn", request->connection},
                {"who", name},
                {"role", pb::Role_Name(login.holder.who.role)},
                {"peer", request->address}});
  const WebJson state = co_await sessionState(server, login.holder.who, issued->token);
  HttpAnswer answer = jsonAnswer(state);
  answer.headers.emplace_back("Set-Cookie", WebSessions::cookieFor(issued->token));
  co_return answer;
}

/// Parses the body as JSON if one is expected. Nothing: no fault.
std::optional<HttpAnswer> bodyFault(HttpRequest& request, nlohmann::json& body) {
  const bool carries = request.method == "POST" || request.method == "PUT" || request.method == "PATCH" ||
                       !request.body.empty();
  if (!carries || (request.body.empty() && request.content_type.empty())) return std::nullopt;
  if (!isJsonType(request.content_type))
    return errorAnswer(415, "unsupported_media_type", "send the body as application/json");
  if (request.body.empty()) return std::nullopt;
  auto parsed = readStrictJson(request.body, "body", request.body.size());
  wipe(request.body);  // it may contain a password
  if (!parsed) return errorAnswer(parsed.error());
  body = std::move(*parsed);
  return std::nullopt;
}

/// Whether there is an unexpected body. A POST without fields may have an empty object.
bool hasForeignBody(const HttpRequest& request, const WebRoute& route) {
  if (request.body.empty() || acceptsBody(route)) return false;
  return request.method != "POST" || request.body != "{}";
}

/// Waits until the JSON of a large body fits beside the work in progress. An answer: it can never fit, or the
/// browser has disconnected.
Task<std::optional<HttpAnswer>> takeShare(Shared server, Request request, Principal who,
                                          std::optional<ByteBudget::Share>& share) {
  ServerContext& context = server->context();
  if (request->body.size() <= kSmallBody) co_return std::nullopt;
  const std::size_t bytes = jsonBytes(request->body);
  if (bytes > context.in_flight.decoded.mostBytes(budgetOwner(who)))
    co_return errorAnswer(413, "too_large", "the body has too many values: send less at once");
  std::function<bool()> gone = [request] { return request->gone(); };
  share = co_await waitForRoom(context.in_flight.decoded, context.in_flight.decoded_room, std::move(who),
                               bytes, std::move(gone));
  if (share) co_return std::nullopt;
  co_return disconnectedAnswer();
}

Task<std::optional<HttpAnswer>> readBody(Shared server, Request request, std::shared_ptr<WebCall> call) {
  call->body_bytes = request->body.size();
  std::function<std::optional<HttpAnswer>()> read = [request, call] {
    return bodyFault(*request, call->body);
  };
  if (call->body_bytes <= kSmallBody) co_return read();
  co_return co_await offload(*server->context().work.views_of_people, turnNameOf(call->who), std::move(read));
}

Task<HttpAnswer> apiAnswer(Shared server, Request request, WebTarget target) {
  ServerContext& context = server->context();
  const std::span<const std::string> below(target.segments.begin() + 2, target.segments.end());
  const WebMatch match = matchRoute(request->method, below);
  if (match.route == nullptr) {
    if (match.allowed.empty()) co_return errorAnswer(404, "not_found", "there is no such address");
    std::string methods;
    for (const std::string& method : match.allowed) methods += (methods.empty() ? "" : ", ") + method;
    HttpAnswer answer = errorAnswer(405, "method_not_allowed", "allowed: " + methods);
    answer.headers.emplace_back("Allow", methods);
    co_return answer;
  }
  const WebRoute& route = *match.route;
  request->route = std::string(route.method) + " " + std::string(route.pattern);
  if (auto foreign = foreignPage(*request, route.how.action == WebAction::kLive))
    co_return std::move(*foreign);
  if (hasForeignBody(*request, route))
    co_return errorAnswer(400, "invalid_input", "this address takes no body");

  auto call = std::make_shared<WebCall>();
  if (route.how.action == WebAction::kLogIn) {
    if (auto fault = co_await readBody(server, request, call)) co_return std::move(*fault);
    co_return co_await logIn(server, request, std::move(call->body));
  }

  // all following routes require a session
  const auto found = co_await server->sessions().find(request->cookie, askerOf(*request));
  if (!found.ok()) co_return errorAnswer(found.error());
  const std::optional<WebSession>& session = *found;
  if (!session) co_return notLoggedIn();
  const AccessWatch account = context.logins.access.watch(session->holder.who.name, false);
  request->who = session->holder.who.name;
  call->who = session->holder.who;
  const bool safe = request->method == "GET" || request->method == "HEAD";
  if (!safe && !server->sessions().csrfFits(session->token, request->csrf))
    co_return errorAnswer(403, "csrf", "send the session's csrf_token in the header X-CSRF-Token");
  std::function<Result<bool>()> check = context.logins.state->check(session->token, call->who);
  const auto allowed =
      co_await offload(*context.work.workers_of_people, turnNameOf(call->who), std::move(check));
  if (!allowed.ok()) co_return errorAnswer(allowed.error());
  if (!*allowed) {
    (void)co_await context.logins.state->end(session->token);
    co_return notLoggedIn();
  }
  if (!server->showedSession(request->connection, session->holder.who.name)) co_return noFreeConnection();
  // neither asking for the session's expiry nor a page left open extends the session
  if (route.how.action != WebAction::kWhoAmI && route.how.action != WebAction::kLive)
    context.logins.state->renew(session->token);

  if (route.how.action == WebAction::kWhoAmI)
    co_return jsonAnswer(co_await sessionState(server, call->who, session->token));
  if (route.how.action == WebAction::kLogOut) {
    if (const Status ended = co_await context.logins.state->end(session->token); !ended)
      co_return errorAnswer(ended.error());
    server->note(call->who.name, PeerLine::kWebLogout,
                 {{"conn", request->connection}, {"who", call->who.name}});
    HttpAnswer answer = jsonAnswer(WebJson::object());
    answer.headers.emplace_back("Set-Cookie", WebSessions::cookieFor(""));
    co_return answer;
  }
  if (route.call != pb::Request::CALL_NOT_SET) {
    if (const Status role = checkRole(call->who, route.call); !role) co_return errorAnswer(role.error());
  }
  // taken before anything else; held with the answer until the browser has read it
  std::optional<ByteBudget::Share> reply_room;
  if (route.how.action == WebAction::kRequest || route.how.action == WebAction::kWork ||
      route.how.action == WebAction::kSteps) {
    std::function<bool()> gone = [request] { return request->gone(); };
    reply_room = co_await waitForRoom(context.in_flight.replies, context.in_flight.reply_room, call->who,
                                      replyRoomOf(context, call->who, route.call), std::move(gone));
    if (!reply_room) co_return disconnectedAnswer();
  }
  // for the body's JSON; released on the network's thread
  std::optional<ByteBudget::Share> share;
  if (auto refused = co_await takeShare(server, request, call->who, share)) co_return std::move(*refused);
  if (auto fault = co_await readBody(server, request, call)) co_return std::move(*fault);
  if (!request->if_match.empty()) {
    const auto revision = parseIfMatch(request->if_match);
    if (!revision) co_return errorAnswer(revision.error());
    call->if_match = *revision;
  }
  call->target = std::move(target);
  call->parts = match.parts;
  if (route.how.action == WebAction::kLive) {
    if (!request->upgrade) {
      HttpAnswer answer = errorAnswer(426, "upgrade_required", "this address is a WebSocket");
      answer.headers.emplace_back("Upgrade", "websocket");
      co_return answer;
    }
    if (!server->onViewerJoined(call->who.name)) {
      HttpAnswer answer = errorAnswer(429, "rate_limited", "too many live pages are open");
      answer.headers.emplace_back("Retry-After", "5");
      co_return answer;
    }
    HttpAnswer answer;
    answer.takeover = makeLiveSocket(server, session->token, call->who.name);
    co_return answer;
  }
  if (route.how.action == WebAction::kOpenApi) {
    HttpAnswer answer;
    answer.body = std::string(openApiText());
    co_return answer;
  }
  // for kRequest, it is taken on execution
  const bool is_direct = route.how.action == WebAction::kWork || route.how.action == WebAction::kSteps ||
                         route.how.action == WebAction::kStream;
  DiskRoom::Share disk_room;
  if (is_direct) {
    auto room = takeRoom(context, call->who, route.call, call->body_bytes);
    if (!room) {
      noteNoRoom(context, *call, room.error());
      co_return errorAnswer(room.error());
    }
    disk_room = std::move(*room);
  }
  LongRequester by{turnNameOf(call->who), session->token, account};
  HttpAnswer answer;
  if (route.how.action == WebAction::kStream)  // not ?: around co_await, which g++ 12 miscompiles
    answer = co_await throughStream(server, request, route, call, std::move(by));
  else if (route.how.action == WebAction::kWork)
    answer = co_await throughWork(server, request, route, call);
  else if (route.how.action == WebAction::kSteps)
    answer = co_await throughSteps(server, request, route, call, std::move(by));
  else
    answer = co_await throughService(server, request, route, call, std::move(share));
  if (answer.status < 400) disk_room.stored();
  if (reply_room) {
    reply_room->become(answer.body.size());
    answer.until_sent = std::make_shared<const ByteBudget::Share>(std::move(*reply_room));
  }
  co_return answer;
}

}  // namespace

Task<HttpAnswer> WebServer::answer(std::shared_ptr<HttpRequest> request) {
  const bool standard = proxies_.header() == TrustedProxies::Header::kForwarded;
  request->address =
      proxies_.clientOf(request->address, standard ? request->forwarded : request->x_forwarded_for);
  HttpAnswer answer = co_await answerTo(request);
  // it is not sent, and nothing failed: keep it out of the metrics' 5xx, which raise an alarm
  if (answer.status == 503 && request->gone()) answer.status = kClientHungUp;
  if (mayDemandHttps(request->host))
    answer.headers.emplace_back("Strict-Transport-Security", "max-age=31536000");
  co_return answer;
}

Task<HttpAnswer> WebServer::answerTo(std::shared_ptr<HttpRequest> request) {
  if (!request->is_http_1_1) {
    HttpAnswer answer = errorAnswer(505, "version", "only HTTP/1.1");
    answer.close = true;
    co_return answer;
  }
  const auto server = std::static_pointer_cast<WebServer>(shared_from_this());
  auto target = parseTarget(request->target);
  if (!target) co_return errorAnswer(target.error());
  if (request->host.empty()) co_return errorAnswer(400, "invalid_input", "the header Host is missing");
  const auto& segments = target->segments;
  if (segments.size() >= 2 && segments[0] == "api" && segments[1] == "v1") {
    // an exception in one request (unexpected stored text, out of memory) must not end the server
    try {
      co_return co_await apiAnswer(server, request, std::move(*target));
    } catch (const std::exception& fault) {
      note(request->who, PeerLine::kWebRequestThrew, {{"route", request->route}, {"text", fault.what()}});
    }
    co_return errorAnswer(500, "failed", "the server could not answer that; its log says why");
  }
  if (!segments.empty() && segments[0] == "api")
    co_return errorAnswer(404, "not_found", "there is no such address");
  request->route = "file";
  co_return fileAnswer(*server, *request, *target);
}

}  // namespace needlelab
