/// Where NATS is, and who this server is there: from the options of needlelab-server.
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
  std::string host;  ///< a name, or an address; of IPv6 without brackets
  std::uint16_t port = kNatsPort;
  /// "nats://a.example:4222"; over TLS too, which is an option of the connection.
  [[nodiscard]] std::string url() const;
};

struct NatsAddress {
  bool tls = false;
  std::vector<NatsServer> servers;  ///< at least one
};

/// Reads `nats://HOST[:PORT][,HOST[:PORT]…]`, or the same with `tls://`; each host may repeat the scheme.
/// kInvalidInput, also of one with a user or a password, which everybody would see in the list of processes.
Result<NatsAddress> parseNatsAddress(const std::string& text);

/// A NATS server's user. Wiped on destruction; what libnats copies stays.
struct NatsUser {
  NatsUser() = default;
  NatsUser(const NatsUser&) = default;
  NatsUser& operator=(const NatsUser&) = default;
  ~NatsUser();
  std::string user, password;   ///< both empty: none
  std::filesystem::path creds;  ///< a file of NATS's own, with a JWT and a seed; empty: none
};

/// Reads a file of two lines, `user = NAME` and `password = TEXT`, or knows one of NATS's own (`.creds`) by
/// its first line. kInvalidInput: missing, readable by others than its owner (but systemd itself guards what
/// lies in $CREDENTIALS_DIRECTORY), or neither.
Result<NatsUser> readNatsUser(const std::filesystem::path& file);

/// The file to use: `given`, or $CREDENTIALS_DIRECTORY/nats.user when that exists (systemd:
/// LoadCredential=nats.user:FILE). Empty: no user.
std::filesystem::path natsUserFile(const std::filesystem::path& given);

}  // namespace needlelab
