#include "server/web/web_parser.h"

#include <boost/beast/websocket/rfc6455.hpp>
#include <utility>

namespace needlelab {

namespace bhttp = boost::beast::http;

namespace {

std::string headerOf(const WebParser& parser, const char* name) {
  const auto value = parser.get()[name];
  return {value.data(), value.size()};
}

}  // namespace

std::string headerOf(const WebParser& parser, bhttp::field name) {
  const auto value = parser.get()[name];
  return {value.data(), value.size()};
}

std::shared_ptr<WebRequest> requestOf(WebParser& parser) {
  auto request = std::make_shared<WebRequest>();
  auto& message = parser.get();
  request->method = std::string(message.method_string().data(), message.method_string().size());
  request->target = std::string(message.target().data(), message.target().size());
  request->host = headerOf(parser, bhttp::field::host);
  request->origin = headerOf(parser, bhttp::field::origin);
  request->fetch_site = headerOf(parser, "Sec-Fetch-Site");
  request->cookie = headerOf(parser, bhttp::field::cookie);
  request->content_type = headerOf(parser, bhttp::field::content_type);
  request->if_match = headerOf(parser, bhttp::field::if_match);
  request->if_none_match = headerOf(parser, bhttp::field::if_none_match);
  request->csrf = headerOf(parser, "X-CSRF-Token");
  request->upgrade = boost::beast::websocket::is_upgrade(message);
  request->body = std::move(message.body());
  return request;
}

}  // namespace needlelab
