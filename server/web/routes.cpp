#include "server/web/routes.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "server/web/openapi.h"
#include "server/web/route_parts.h"

namespace needlelab {
namespace {

using Call = pb::Request;

constexpr auto kOwnRoutes = std::to_array<WebRoute>({
    {"POST", "/session", Call::CALL_NOT_SET, WebAction::kLogIn},
    {"GET", "/session", Call::CALL_NOT_SET, WebAction::kWhoAmI},
    {"DELETE", "/session", Call::CALL_NOT_SET, WebAction::kLogOut},
    {"GET", "/live", Call::kListStations, WebAction::kLive},
    {"GET", "/openapi.json", Call::CALL_NOT_SET, WebAction::kText, nullptr, nullptr, nullptr, 200, nullptr,
     openApiText},
});

/// The pattern's parts against the path's; what stands for {…} goes into `parts`.
bool fits(std::string_view pattern, std::span<const std::string> segments, std::vector<std::string>& parts) {
  parts.clear();
  std::size_t next = 0;
  while (!pattern.empty()) {
    pattern.remove_prefix(1);  // the '/'
    const std::size_t end = std::min(pattern.find('/'), pattern.size());
    const std::string_view part = pattern.substr(0, end);
    pattern.remove_prefix(end);
    if (next == segments.size() || segments[next].empty()) return false;
    if (part.front() == '{')
      parts.push_back(segments[next]);
    else if (part != segments[next])
      return false;
    ++next;
  }
  return next == segments.size();
}

}  // namespace

std::span<const WebRoute> webRoutes() {
  static const std::vector<WebRoute> all = [] {
    std::vector<WebRoute> routes(kOwnRoutes.begin(), kOwnRoutes.end());
    for (const auto& more : {peopleRoutes(), lessonRoutes(), sessionRoutes()})
      routes.insert(routes.end(), more.begin(), more.end());
    return routes;
  }();
  return all;
}

WebJson listOf(const google::protobuf::Message& list, const std::string& rows) {
  WebJson all = jsonOf(list);
  WebJson shaped = {{"items", std::move(all[rows])}};
  for (auto& [key, value] : all.items())
    if (key != rows) shaped[key] = std::move(value);
  if (!shaped.contains("next_page")) shaped["next_page"] = "";
  return shaped;
}

Status setPage(const WebCall& call, std::string& page) {
  auto bytes = pageOf(call.query("page"));
  if (!bytes) return bytes.error();
  page = std::move(*bytes);
  return {};
}

Status readBodyInto(const WebCall& call, google::protobuf::Message& message,
                    std::initializer_list<const char*> outside) {
  for (const char* name : outside) {
    if (call.body.is_object() && call.body.contains(name))
      return Error{ErrorCode::kInvalidInput, std::string(name) + ": does not stand in the body"};
  }
  return messageOf(call.body.is_null() ? nlohmann::json::object() : call.body, message);
}

Result<pb::Reply> replyOf(Service& service, const WebCall& call, const pb::Request& request) {
  Outcome outcome = service.execute(call.who, request);
  if (outcome.error) return *outcome.error;
  return std::move(outcome.reply);
}

Result<WebStream> streamFromFirst(std::string type, std::string file_name,
                                  std::function<Result<std::string>()> next) {
  for (char& c : file_name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.';
    if (!plain) c = '_';
  }
  auto piece = next();
  if (!piece) return piece.error();
  const auto first = std::make_shared<std::string>(std::move(*piece));
  return WebStream{std::move(type), std::move(file_name),
                   [next = std::move(next), first]() -> Result<std::string> {
                     if (!first->empty()) return std::exchange(*first, std::string());
                     return next();
                   }};
}

WebJson emptyReply(const WebCall&, const pb::Reply&) {
  return WebJson::object();
}

Result<std::uint32_t> baseOf(const WebCall& call) {
  if (call.if_match) return *call.if_match;
  return Error{ErrorCode::kInvalidInput,
               "If-Match: give the revision that was changed, in quotes; \"0\" for something new"};
}

WebMatch matchRoute(std::string_view method, std::span<const std::string> segments) {
  WebMatch match;
  std::string_view pattern;  // the first that fits: one with a fixed part hides one with {…}
  std::vector<std::string> parts;
  for (const WebRoute& route : webRoutes()) {
    if (!pattern.empty() && route.pattern != pattern) continue;
    if (!fits(route.pattern, segments, parts)) continue;
    pattern = route.pattern;
    match.allowed.emplace_back(route.method);
    if (route.method == "GET") match.allowed.emplace_back("HEAD");
    if (route.method != method && !(route.method == "GET" && method == "HEAD")) continue;
    match.route = &route;
    match.parts = parts;
  }
  return match;
}

}  // namespace needlelab
