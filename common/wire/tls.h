/// TLS contexts: version 1.3 only, a private CA, and the peer's name checked.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/wire/asio.h"

namespace needlelab {

/// Shared by all connections of a program; immutable once made.
using TlsContext = std::shared_ptr<asio::ssl::context>;
using TlsStream = asio::ssl::stream<Tcp::socket>;

/// Errors: kInvalidInput naming the file that is missing, unreadable, or does not fit the other.
Result<TlsContext> makeServerTls(const std::filesystem::path& certificate, const std::filesystem::path& key);

/// Trusts `ca` and nothing else. Errors: kInvalidInput naming the file.
Result<TlsContext> makeClientTls(const std::filesystem::path& ca);

/// Before the handshake of a client: the server's certificate must be for `host` (a name or an IP address).
Status requireHost(TlsStream& stream, const std::string& host);

/// What the last TLS failure was, in words: e.g. "certificate verify failed (self-signed certificate)".
std::string tlsErrorText(const SSL* ssl, std::string text);

}  // namespace needlelab
