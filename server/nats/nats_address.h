/// The address of NATS and this server's user there, from the options of needlelab-server; subjects; when to
/// try again to connect.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "server/together/live_carrier.h"

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

// --- subjects: nl.LAB.PLANE.NAME, one token each

/// A lab's or a station's name as one token: letters, digits, '-' and '_' stay; any other byte becomes '='
/// and two hexadecimal digits, e.g. "=20" for a space.
std::string subjectToken(std::string_view name);
/// The inverse; nothing if subjectToken cannot return this token.
std::optional<std::string> nameOfToken(std::string_view token);

std::string_view nameOf(LivePlane plane);
/// `name`: of the station or server; nothing: all of them.
std::string subjectOf(std::string_view lab, LivePlane plane, const std::optional<std::string>& name);

struct SubjectParts {
  LivePlane plane = LivePlane::kPresence;
  std::string name;
};
/// Nothing: not a subject of this lab.
std::optional<SubjectParts> partsOfSubject(std::string_view lab, std::string_view subject);

// --- the waiting time before the next attempt to connect

/// Doubles with each attempt, and is random so that servers which lost NATS together do not return together.
class BackOff {
 public:
  static constexpr std::chrono::milliseconds kFirst{100}, kLast{2'000};

  /// `drawn`: random, in [0, 1).
  std::chrono::milliseconds next(double drawn) {
    const auto whole = next_;
    next_ = std::min(2 * next_, kLast);
    return std::chrono::milliseconds(
        static_cast<std::chrono::milliseconds::rep>(static_cast<double>(whole.count()) * (0.5 + drawn / 2)));
  }
  /// Call when a connection has lasted for some time.
  void reset() { next_ = kFirst; }

 private:
  std::chrono::milliseconds next_ = kFirst;
};

}  // namespace needlelab
