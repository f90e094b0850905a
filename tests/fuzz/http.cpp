// Fuzzes the requests of a browser or an impostor, one after the other on a connection.
#include <array>
#include <boost/asio/buffer.hpp>
#include <string>

#include "common/base/text/strict_json.h"
#include "db/service/requests/requests.h"
#include "server/base/http_message.h"
#include "server/base/http_stream.h"
#include "server/web/routes.h"
#include "server/web/web_call.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

void checkTarget(const WebTarget& target) {
  for (const std::string& segment : target.segments) {
    require(!segment.empty() && segment != "." && segment != "..", "no part climbs");
    require(segment.find('/') == std::string::npos && segment.find('\0') == std::string::npos,
            "no part hides one");
  }
  if (kPlanted) {
    // The planted fault: assumes at most six parts.
    std::array<std::size_t, 6> sizes{};
    for (std::size_t i = 0; i < target.segments.size(); ++i) sizes.data()[i] = target.segments[i].size();
    require(sizes.data()[0] < 4096, "parts are short");
  }
}

void routeRequest(const HttpRequest& request) {
  const auto target = parseTarget(request.target);
  if (!target.ok()) {
    require(!target.error().message.empty(), "a refusal says why");
    return;
  }
  checkTarget(*target);
  if (const auto cookie = cookieNamed(request.cookie, kSessionCookie); cookie) {
    const auto token = bytesOfBase64Url(*cookie);
    require(!token || base64Url(*token) == *cookie, "one text a token");
  }
  (void)isSameOrigin(request.origin, request.host);
  if (target->segments.size() < 2 || target->segments[0] != "api" || target->segments[1] != "v1") return;
  const WebMatch match = matchRoute(request.method, std::span(target->segments).subspan(2));
  if (match.route == nullptr) return;
  require(!match.allowed.empty(), "a route has a method");

  WebCall call;
  call.target = *target;
  call.parts = match.parts;
  call.who = {"fuzz", pb::ADMINISTRATOR};
  if (!request.if_match.empty()) {
    if (const auto revision = parseIfMatch(request.if_match); revision.ok()) call.if_match = *revision;
  }
  if (!request.body.empty() && isJsonType(request.content_type)) {
    auto body = readStrictJson(request.body, "body", 1u << 20);
    if (!body.ok()) {
      const HttpAnswer answer = errorAnswer(body.error());
      require(nlohmann::json::accept(answer.body), "every error is JSON");
      return;
    }
    call.body = std::move(*body);
  }
  if (match.route->how.action != WebAction::kRequest) return;
  const auto built = match.route->how.build(*match.route, call);
  if (!built.ok()) {
    require(nlohmann::json::accept(errorAnswer(built.error()).body), "every error is JSON");
    return;
  }
  require(built->call_case() != pb::Request::CALL_NOT_SET, "a request holds a call");
  require(
      checkRole(call.who, built->call_case()).ok() || checkRole(call.who, match.route->call).ok() == false,
      "the route's role is that of its request");
  require(nlohmann::json::accept(jsonAnswer(jsonOf(*built)).body), "every message is JSON");
}

}  // namespace

void http(ByteView data) {
  std::size_t at = 0;
  for (int requests = 0; requests < 8 && at < data.size(); ++requests) {
    HttpParser parser;
    parser.header_limit(8192);
    parser.body_limit(std::uint64_t{1} << 20);
    parser.eager(true);
    while (!parser.is_done() && at < data.size()) {
      boost::system::error_code error;
      const std::size_t used = parser.put(boost::asio::buffer(data.data() + at, data.size() - at), error);
      at += used;
      if (error == boost::beast::http::error::need_more ||
          (error == boost::system::error_code() && used == 0))
        return;
      if (error) return;
    }
    if (!parser.is_done()) return;
    routeRequest(*requestOf(parser));
  }
}

}  // namespace needlelab::fuzz
