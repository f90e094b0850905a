/// The TLS stream of a browser's connection. Only for the files that compile Beast.
#pragma once

#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/basic_stream.hpp>

#include "common/wire/asio.h"

namespace needlelab {

// the executor by which kUseTuple resumes
using PlainWebStream = boost::beast::basic_stream<Tcp, asio::any_io_executor>;
using SecureWebStream = asio::ssl::stream<PlainWebStream>;

}  // namespace needlelab
