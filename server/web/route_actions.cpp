#include "server/web/route_actions.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <utility>

#include "common/base/secret.h"
#include "common/base/time/clock.h"
#include "server/live/counters.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/login_state.h"
#include "server/live/port/request_effects.h"
#include "server/live/work/offload.h"
#include "server/live/work/server_work.h"
#include "server/web/web_call.h"

namespace needlelab {
namespace {

using Shared = std::shared_ptr<WebServer>;
using Request = std::shared_ptr<HttpRequest>;

Error disconnectedError() {
  return {ErrorCode::kUnavailable, "the browser is gone"};
}

/// Wraps work that waits for its turn: skips it if the browser has disconnected by then.
template <typename T>
std::function<T()> unlessDisconnected(const Request& request, T if_disconnected, std::function<T()> work) {
  return [gone = request->gone, if_disconnected = std::move(if_disconnected), work = std::move(work)]() -> T {
    return gone() ? if_disconnected : work();
  };
}

/// The error's own code if there is one; otherwise by the refusal's reason.
HttpAnswer refusedAnswer(const Outcome& outcome, const pb::Refusal& refusal) {
  if (outcome.error) return errorAnswer(*outcome.error);
  switch (refusal.reason()) {
    case pb::Refusal::NOT_FOUND:
      return errorAnswer({ErrorCode::kNotFound, refusal.text()});
    case pb::Refusal::TIMEOUT:
      return errorAnswer({ErrorCode::kUnavailable, refusal.text()});
    default:
      return errorAnswer({ErrorCode::kFailed, refusal.text()});
  }
}

/// A backup without a path goes to a folder beside the database; the newest ten there are kept.
Status placeBackup(const ServerContext& context, pb::Request& request) {
  if (!request.has_backup() || !request.backup().path().empty()) return {};
  const auto folder = context.store.databasePath().parent_path() / "backups";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Error{ErrorCode::kUnavailable, "cannot make " + folder.string() + ": " + error.message()};
  std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  request.mutable_backup()->set_path(folder.string());
  if (request.backup().keep() == 0) request.mutable_backup()->set_keep(10);
  return {};
}

/// Wipes the passwords and codes in a body that became a request; the request wipes its own copy.
void wipeSecrets(nlohmann::json& body) {
  if (!body.is_object()) return;
  for (const char* name : {"password", "old_password", "code", "csv"}) {
    if (const auto found = body.find(name); found != body.end() && found->is_string())
      wipe(found->get_ref<std::string&>());
  }
}

/// Whether the session was ended because its account was disabled or its role or password changed. A session
/// that merely expires during its download does not end it.
Task<bool> accessEnded(ServerContext& context, LongRequester by) {
  if (!by.account.changed()) co_return false;
  const std::chrono::nanoseconds left = co_await context.logins.state->left(by.token);
  co_return left.count() <= 0;
}

Error accessHasEnded() {
  return {ErrorCode::kDenied, "the session that asked for it has ended"};
}

/// A stream and its reader.
struct SessionStream {
  Request request;
  Principal who;
  WebStream stream;
  LongRequester by;
  ByteBudget::Share room;  ///< of the piece being made or sent, and of what is kept for the next one
  bool has_begun = false;
};

/// Takes the room for making a piece. Nothing: the browser has disconnected.
Task<std::optional<ByteBudget::Share>> roomForPiece(Shared server, Request request, Principal who) {
  ServerContext& context = server->context();
  const std::size_t bytes = std::min(kMaxPieceBytes, context.in_flight.replies.mostBytes(budgetOwner(who)));
  std::function<bool()> gone = [request] { return request->gone(); };
  co_return co_await waitForRoom(context.in_flight.replies, context.in_flight.reply_room, who, bytes,
                                 std::move(gone));
}

Task<Result<std::string>> nextPiece(Shared server, std::shared_ptr<SessionStream> stream) {
  if (std::exchange(stream->has_begun, true)) {
    // the last piece was sent: release its room before the next one is made
    stream->room.become(0);
    auto room = co_await roomForPiece(server, stream->request, stream->who);
    if (!room) co_return disconnectedError();
    stream->room = std::move(*room);
  }
  if (co_await accessEnded(server->context(), stream->by)) co_return accessHasEnded();
  for (;;) {
    // without `stream`: the room must be released on this thread
    std::function<Result<WebPiece>()> work = stream->stream.next;
    work = unlessDisconnected<Result<WebPiece>>(stream->request, disconnectedError(), std::move(work));
    auto piece =
        co_await offload(*server->context().work.views_of_people, stream->by.turn_name, std::move(work));
    if (!piece) co_return piece.error();
    if (co_await accessEnded(server->context(), stream->by)) co_return accessHasEnded();
    if (!*piece) continue;
    stream->room.become((*piece)->size() + kMaxHeldByStream);
    co_return std::move(**piece);
  }
}

}  // namespace

HttpAnswer disconnectedAnswer() {
  return errorAnswer(503, "unavailable", "the browser is gone");
}

void noteNoRoom(ServerContext& context, const WebCall& call, const Error& error) {
  if (error.code != ErrorCode::kNoRoom) return;
  ++context.counters.refused_for_room;
  context.limits.lines.write(turnNameOf(call.who), PeerLine::kNoRoom, steadyNowNs(),
                             {{"port", "web"}, {"who", call.who.name}, {"text", error.message}});
}

Task<HttpAnswer> throughService(Shared server, Request asked, const WebRoute& route,
                                std::shared_ptr<WebCall> call, std::optional<ByteBudget::Share> share) {
  ServerContext& context = server->context();
  // parsing a class or a course of a megabyte takes time: not on the network's thread
  std::function<Result<pb::Request>()> build = [&route, call] { return route.how.build(route, *call); };
  Result<pb::Request> built = Error{ErrorCode::kFailed, ""};
  if (call->body_bytes > kSmallBody)  // not ?: around co_await, which g++ 12 miscompiles
    built = co_await offload(*context.work.views_of_people, turnNameOf(call->who), std::move(build));
  else
    built = build();
  wipeSecrets(call->body);
  call->body = nullptr;
  if (!built) co_return errorAnswer(built.error());
  if (const Status placed = placeBackup(context, *built); !placed) co_return errorAnswer(placed.error());
  if (const std::size_t bytes = built->SpaceUsedLong(); share)
    share->become(bytes <= context.limits.bounds.uncounted_decoded_bytes ? 0 : bytes);
  const auto request = wipedWhenReleased(std::move(*built));
  call->request = request;
  std::function<bool()> gone = asked->gone;
  const auto outcome = co_await executeRequest(context, call->who, request, std::move(gone));
  if (outcome->error) noteNoRoom(context, *call, *outcome->error);
  const Doer by = call->who.doer();
  const auto refusal = co_await complete(context, *request, by, *outcome);
  followUp(context, *outcome, by, nullptr);
  if (refusal) co_return refusedAnswer(*outcome, *refusal);
  std::function<HttpAnswer()> write = [&route, call, outcome] {
    return jsonAnswer(route.how.shape(*call, outcome->reply), route.how.status);
  };
  // serialising long lists takes time
  FairPool* const pool = poolForWriting(context, outcome->reply.ByteSizeLong());
  if (pool == nullptr) co_return write();
  write = unlessDisconnected(asked, disconnectedAnswer(), std::move(write));
  co_return co_await offload(*pool, turnNameOf(call->who), std::move(write));
}

Task<HttpAnswer> throughWork(Shared server, Request request, const WebRoute& route,
                             std::shared_ptr<const WebCall> call) {
  ServerContext& context = server->context();
  std::function<HttpAnswer()> work = [&service = context.store.service(), &route, call] {
    auto json = route.how.work(service, *call);
    return json ? jsonAnswer(*json, route.how.status) : errorAnswer(json.error());
  };
  work = unlessDisconnected(request, disconnectedAnswer(), std::move(work));
  co_return co_await offload(*context.work.views_of_people, turnNameOf(call->who), std::move(work));
}

Task<HttpAnswer> throughSteps(Shared server, Request request, const WebRoute& route,
                              std::shared_ptr<const WebCall> call, LongRequester by) {
  ServerContext& context = server->context();
  std::function<Result<WebSteps>()> begin = [&service = context.store.service(), &route, call] {
    return route.how.steps(service, *call);
  };
  begin = unlessDisconnected<Result<WebSteps>>(request, disconnectedError(), std::move(begin));
  const auto steps = co_await offload(*context.work.views_of_people, by.turn_name, std::move(begin));
  if (!steps) co_return errorAnswer(steps.error());
  while (!request->gone()) {
    if (co_await accessEnded(context, by)) co_return errorAnswer(accessHasEnded());
    std::function<std::optional<HttpAnswer>()> work = [&route, step = steps->step] {
      const auto json = step();
      if (!json) return std::optional(errorAnswer(json.error()));
      return *json ? std::optional(jsonAnswer(**json, route.how.status)) : std::nullopt;
    };
    work = unlessDisconnected(request, std::optional(disconnectedAnswer()), std::move(work));
    auto answer = co_await offload(*context.work.views_of_people, by.turn_name, std::move(work));
    if (answer) co_return std::move(*answer);
  }
  co_return disconnectedAnswer();
}

Task<HttpAnswer> throughStream(Shared server, Request request, const WebRoute& route,
                               std::shared_ptr<const WebCall> call, LongRequester by) {
  auto room = co_await roomForPiece(server, request, call->who);
  if (!room) co_return disconnectedAnswer();
  std::function<Result<WebStream>()> open = [&service = server->context().store.service(), &route, call] {
    return route.how.stream(service, route, *call);
  };
  open = unlessDisconnected<Result<WebStream>>(request, disconnectedError(), std::move(open));
  auto opened = co_await offload(*server->context().work.views_of_people, by.turn_name, std::move(open));
  if (!opened) co_return errorAnswer(opened.error());
  HttpAnswer answer;
  answer.type = opened->type;
  answer.headers.emplace_back("Content-Disposition", "attachment; filename=\"" + opened->file_name + "\"");
  auto stream = std::make_shared<SessionStream>(
      SessionStream{std::move(request), call->who, std::move(*opened), std::move(by), std::move(*room)});
  answer.pieces = [server, stream] { return nextPiece(server, stream); };
  co_return answer;
}

}  // namespace needlelab
