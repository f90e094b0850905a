/// From the bytes of a connection to a request, by Beast. Only for the files that compile Beast.
#pragma once

#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <cstddef>
#include <memory>
#include <string>

#include "server/web/web_request.h"

namespace needlelab {

using WebParser = boost::beast::http::request_parser<boost::beast::http::string_body>;

/// A header field's value; empty when it is absent.
std::string headerOf(const WebParser& parser, boost::beast::http::field name);

/// Its fields and its body, which is moved; without who asks.
std::shared_ptr<WebRequest> requestOf(WebParser& parser);

}  // namespace needlelab
