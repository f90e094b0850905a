/// The address of NATS and this server's user there, from the options of needlelab-server.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

inline constexpr std::uint16_t kNatsPort = 4222;

struct NatsServer {
  std::string host;  ///< a name or an address; IPv6 without brackets
  std::uint16_t port = kNatsPort;
  /// "nats://a.example:4222"; the same with TLS, which is an option of the connection.
  [[nodiscard]] std::string url() const;
};

struct NatsAddress {
  bool tls = false;
  std::vector<NatsServer> servers;  ///< at least one
};

/// Parses `nats://HOST[:PORT][,HOST[:PORT]…]`, or the same with `tls://`; each host may repeat the scheme.
/// kInvalidInput; also for an address with a user or password, which the list of processes would show to
/// everyone.
Result<NatsAddress> parseNatsAddress(const std::string& text);

/// The user at a NATS server. Wiped on destruction; copies made by libnats remain.
struct NatsUser {
  NatsUser() = default;
  NatsUser(const NatsUser&) = default;
  NatsUser& operator=(const NatsUser&) = default;
  ~NatsUser();
  std::string user, password;   ///< both empty: no user
  std::filesystem::path creds;  ///< a file in NATS's format, with a JWT and a seed; empty: no file
};

/// Reads a file of two lines, `user = NAME` and `password = TEXT`, or recognises NATS's own format (`.creds`)
/// by its first line. kInvalidInput: missing, neither format, or readable by others than its owner (except in
/// $CREDENTIALS_DIRECTORY, which systemd protects).
Result<NatsUser> readNatsUser(const std::filesystem::path& file);

/// The file to use: `given`, or $CREDENTIALS_DIRECTORY/nats.user if it exists (systemd:
/// LoadCredential=nats.user:FILE). Empty: no user.
std::filesystem::path natsUserFile(const std::filesystem::path& given);

}  // namespace needlelab
