#include "server/web/routes.h"

#include <fmt/core.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <utility>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using Call = pb::Request;

/// Routes without a request to the service.
std::vector<WebRoute> ownRoutes() {
  const RouteAdapter log_in{.action = WebAction::kLogIn}, who_am_i{.action = WebAction::kWhoAmI},
      log_out{.action = WebAction::kLogOut}, live{.action = WebAction::kLive, .status = 101},
      openapi{.action = WebAction::kOpenApi};
  return {
      {"POST", "/session", {}, "Log in; the cookie comes with the reply", Call::CALL_NOT_SET, log_in},
      {"GET", "/session", {}, "Who is logged in, and until when", Call::CALL_NOT_SET, who_am_i},
      {"DELETE", "/session", {}, "Log out", Call::CALL_NOT_SET, log_out},
      {"GET", "/live", {}, "WebSocket: {tiles: […]} every 200 ms", Call::kListStations, live},
      {"GET", "/openapi.json", {}, "This file", Call::CALL_NOT_SET, openapi},
  };
}

WebRoute routeOf(const HttpLine& http, pb::Request::CallCase call) {
  WebRoute route;
  const std::size_t space = http.line.find(' ');
  const std::size_t question = std::min(http.line.find('?'), http.line.size());
  route.method = http.line.substr(0, space);
  route.pattern = http.line.substr(space + 1, question - space - 1);
  for (std::size_t at = question + 1; at < http.line.size();) {
    const std::size_t end = std::min(http.line.find('&', at), http.line.size());
    route.query.push_back(http.line.substr(at, end - at));
    at = end + 1;
  }
  route.summary = http.summary;
  route.call = call;
  for (const RouteAdapter& adapter : routeAdapters()) {
    if (adapter.line == http.line.substr(0, question)) route.how = adapter;
  }
  return route;
}

/// Adds the route; of one with formats ("/scores.*") one for each format ("/scores.csv").
void addRoute(std::vector<WebRoute>& routes, const WebRoute& route) {
  if (!route.how.place) {
    routes.push_back(route);
    return;
  }
  static std::deque<std::string> patterns;  // routes refer to them
  for (const ExportFormat* const format : formatsAt(*route.how.place)) {
    std::string& pattern = patterns.emplace_back(route.pattern.substr(0, route.pattern.size() - 2));
    pattern += format->suffix;
    WebRoute one = route;
    one.pattern = pattern;
    one.format = format;
    routes.push_back(std::move(one));
  }
}

/// Matches the pattern's parts with the path's; stores the values of {…} in `parts`.
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

/// The names in a pattern's {…}, each with the preceding fixed part: ("sessions", "id").
std::vector<std::pair<std::string, std::string>> namesIn(std::string_view pattern) {
  std::vector<std::pair<std::string, std::string>> names;
  std::string before;
  while (!pattern.empty()) {
    pattern.remove_prefix(1);  // the '/'
    const std::size_t end = std::min(pattern.find('/'), pattern.size());
    const std::string part(pattern.substr(0, end));
    pattern.remove_prefix(end);
    if (part.front() == '{') names.emplace_back(before, part.substr(1, part.size() - 2));
    before = part;
  }
  return names;
}

const Descriptor& messageOf(pb::Request::CallCase call) {
  return *pb::Request::descriptor()->FindFieldByNumber(call)->message_type();
}

/// Converts a text of the address or the query to a field. `name`: its name there.
Status setField(Message& message, const FieldDescriptor* field, const std::string& name,
                const std::string& text) {
  const auto& reflection = *message.GetReflection();
  if (field != nullptr && field->type() == FieldDescriptor::TYPE_STRING) {
    reflection.SetString(&message, field, text);
    return {};
  }
  if (field != nullptr && field->type() == FieldDescriptor::TYPE_BYTES) {
    ASSIGN_OR_RETURN(auto bytes, field->name() == "session_id" ? sessionBytesOf(text) : pageOf(text));
    reflection.SetString(&message, field, bytes);
    return {};
  }
  if (field != nullptr && field->type() == FieldDescriptor::TYPE_UINT32) {
    ASSIGN_OR_RETURN(const auto number, wholeOf(name, text, 1, UINT32_MAX));
    reflection.SetUInt32(&message, field, static_cast<std::uint32_t>(number));
    return {};
  }
  if (field != nullptr && field->type() == FieldDescriptor::TYPE_BOOL) {
    if (text != "yes" && text != "no")
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("{}: '{}', allowed are yes, no", name, printable(text))};
    reflection.SetBool(&message, field, text == "yes");
    return {};
  }
  return Error{ErrorCode::kFailed, fmt::format("{}: the route needs an adapter for it", name)};
}

}  // namespace

std::span<const WebRoute> webRoutes() {
  static const std::vector<WebRoute> all = [] {
    std::vector<WebRoute> routes = ownRoutes();
    for (const RequestRow& row : requestRows()) {
      for (const HttpLine& http : row.http)
        if (!http.line.empty()) addRoute(routes, routeOf(http, row.call));
    }
    // '{' sorts after all letters, so fixed parts come before {…} at the same position
    std::stable_sort(routes.begin(), routes.end(),
                     [](const WebRoute& a, const WebRoute& b) { return a.pattern < b.pattern; });
    return routes;
  }();
  return all;
}

PlainFields plainFieldsOf(const WebRoute& route) {
  const Descriptor& message = messageOf(route.call);
  PlainFields fields;
  for (const auto& [before, name] : namesIn(route.pattern)) {
    const FieldDescriptor* field = message.FindFieldByName(name);
    // e.g. "sessions" and "id": session_id
    if (field == nullptr && !before.empty())
      field = message.FindFieldByName(before.substr(0, before.size() - 1) + "_" + name);
    if (field == nullptr && name == "name") field = message.FindFieldByName("trainee");
    fields.parts.push_back(field);
  }
  for (const std::string_view query : route.query) {
    const std::string name(query);
    const FieldDescriptor* field = message.FindFieldByName(name);
    fields.query.push_back(field != nullptr ? field : message.FindFieldByName(name + "_id"));
  }
  if (route.method != "GET") fields.base = message.FindFieldByName("base_revision");
  for (int i = 0; i < message.field_count() && route.method != "GET"; ++i) {
    const FieldDescriptor* field = message.field(i);
    const auto is_of = [&](const auto& list) {
      return std::find(list.begin(), list.end(), field) != list.end();
    };
    if (field != fields.base && !is_of(fields.parts) && !is_of(fields.query)) fields.body.push_back(field);
  }
  return fields;
}

bool acceptsBody(const WebRoute& route) {
  if (route.call == Call::CALL_NOT_SET) return route.how.action == WebAction::kLogIn;
  return !plainFieldsOf(route).body.empty();
}

const FieldDescriptor* rowsOf(const Descriptor& message) {
  const FieldDescriptor* rows = nullptr;
  for (int i = 0; i < message.field_count(); ++i) {
    if (!message.field(i)->is_repeated()) continue;
    if (rows != nullptr) return nullptr;
    rows = message.field(i);
  }
  const bool is_list = message.field_count() == 1 || message.FindFieldByName("next_page") != nullptr;
  return is_list ? rows : nullptr;
}

Result<pb::Request> plainRequest(const WebRoute& route, const WebCall& call) {
  pb::Request request;
  Message& message = *request.GetReflection()->MutableMessage(
      &request, pb::Request::descriptor()->FindFieldByNumber(route.call));
  const PlainFields fields = plainFieldsOf(route);
  if (!fields.body.empty()) {
    std::vector<std::string> outside;
    for (const FieldDescriptor* field : fields.parts)
      if (field != nullptr) outside.push_back(field->name());
    if (fields.base != nullptr) outside.push_back(fields.base->name());
    RETURN_IF_ERROR(readBodyInto(call, message, outside));
  }
  const auto names = namesIn(route.pattern);
  for (std::size_t i = 0; i < names.size(); ++i)
    RETURN_IF_ERROR(setField(message, fields.parts[i], names[i].second, call.parts[i]));
  for (std::size_t i = 0; i < route.query.size(); ++i) {
    const std::string name(route.query[i]), text = call.query(name);
    if (!text.empty()) RETURN_IF_ERROR(setField(message, fields.query[i], name, text));
  }
  if (fields.base != nullptr) {
    ASSIGN_OR_RETURN(const std::uint32_t base, baseOf(call));
    message.GetReflection()->SetUInt32(&message, fields.base, base);
  }
  return request;
}

WebJson plainReply(const WebCall&, const pb::Reply& reply) {
  if (reply.result_case() == pb::Reply::RESULT_NOT_SET) return WebJson::object();
  const auto& result = reply.GetReflection()->GetMessage(
      reply, pb::Reply::descriptor()->FindFieldByNumber(reply.result_case()));
  const FieldDescriptor* rows = rowsOf(*result.GetDescriptor());
  return rows == nullptr ? jsonOf(result) : listOf(result, rows->name());
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
  ASSIGN_OR_RETURN(page, pageOf(call.query("page")));
  return {};
}

Status readBodyInto(const WebCall& call, google::protobuf::Message& message,
                    const std::vector<std::string>& outside) {
  for (const std::string& name : outside) {
    if (call.body.is_object() && call.body.contains(name))
      return Error{ErrorCode::kInvalidInput,
                   name + ": must not be in the body: the address, If-Match or the server gives it"};
  }
  return messageOf(call.body.is_null() ? nlohmann::json::object() : call.body, message);
}

Result<pb::Reply> replyOf(Service& service, const WebCall& call, const pb::Request& request) {
  Outcome outcome = service.execute(call.who, request);
  if (outcome.error) return *outcome.error;
  return std::move(outcome.reply);
}

Result<WebStream> streamFromFirst(std::string type, std::string file_name,
                                  std::function<Result<WebPiece>()> next) {
  for (char& c : file_name) {
    if (!isLetterOrDigit(c) && c != '-' && c != '.') c = '_';
  }
  ASSIGN_OR_RETURN(auto piece, next());
  const auto first = std::make_shared<std::string>(std::move(piece).value_or(std::string()));
  return WebStream{std::move(type), std::move(file_name),
                   [next = std::move(next), first]() -> Result<WebPiece> {
                     if (!first->empty()) return WebPiece(std::exchange(*first, std::string()));
                     return next();
                   }};
}

Result<WebStream> streamFromFirst(const ExportFormat& format, const std::string& name,
                                  std::function<Result<WebPiece>()> next) {
  return streamFromFirst(std::string(format.media_type), name + std::string(format.suffix), std::move(next));
}

Result<std::uint32_t> baseOf(const WebCall& call) {
  if (call.if_match) return *call.if_match;
  return Error{ErrorCode::kInvalidInput,
               "If-Match: give the revision that was changed, in quotes; \"0\" for something new"};
}

WebMatch matchRoute(std::string_view method, std::span<const std::string> segments) {
  WebMatch match;
  std::string_view pattern;  // the first match: a fixed part hides a {…}
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
