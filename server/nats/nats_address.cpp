#include "server/nats/nats_address.h"

#include <fmt/core.h>
#include <sys/stat.h>

#include <array>
#include <charconv>
#include <cstdlib>
#include <optional>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/secret.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxServers = 16;
constexpr std::size_t kMaxUserFileBytes = 16u << 10;
constexpr std::string_view kNatsScheme = "nats://", kTlsScheme = "tls://";
constexpr std::string_view kCredsStart = "-----BEGIN NATS USER JWT-----";

Error invalidAddress(const std::string& why) {
  return {ErrorCode::kInvalidInput,
          "--live: " + why + "; wanted is nats://HOST:PORT or tls://HOST:PORT, several separated by commas"};
}

bool takePrefix(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r'))
    text.remove_suffix(1);
  return text;
}

Result<NatsServer> parseServer(std::string_view text) {
  NatsServer server;
  std::string_view host = text, port;
  if (takePrefix(host, "[")) {
    const auto end = host.find(']');
    if (end == std::string_view::npos) return invalidAddress("'[' without ']'");
    port = host.substr(end + 1);
    host = host.substr(0, end);
  } else if (const auto colon = host.rfind(':'); colon != std::string_view::npos) {
    port = host.substr(colon);
    host = host.substr(0, colon);
    if (host.find(':') != std::string_view::npos)
      return invalidAddress(fmt::format("'{}': an IPv6 address stands in brackets", printable(text)));
  }
  if (host.empty()) return invalidAddress(fmt::format("'{}' has no host", printable(text)));
  for (const char c : host)
    if (!isLetterOrDigit(c) && c != '.' && c != '-' && c != '_' && c != ':')
      return invalidAddress(fmt::format("'{}' is not a host", printable(host)));
  server.host = host;
  if (port.empty()) return server;
  port.remove_prefix(1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), server.port);
  if (error != std::errc() || end != port.data() + port.size() || server.port == 0)
    return invalidAddress(fmt::format("'{}' is not a port", printable(port)));
  return server;
}

/// As for a backup's key (db/backup/encrypted_backup.cpp).
bool isCredential(const fs::path& file) {
  const char* const folder = std::getenv("CREDENTIALS_DIRECTORY");
  std::error_code error;
  return folder != nullptr && fs::equivalent(file.parent_path(), folder, error);
}

}  // namespace

std::string NatsServer::url() const {
  const bool is_v6 = host.find(':') != std::string::npos;
  return fmt::format("nats://{}{}{}:{}", is_v6 ? "[" : "", host, is_v6 ? "]" : "", port);
}

Result<NatsAddress> parseNatsAddress(const std::string& text) {
  if (text.find('@') != std::string::npos)
    return Error{ErrorCode::kInvalidInput,
                 "--live: a user or a password does not stand in the address, where everybody sees it in the "
                 "list of processes: give --live-user FILE"};
  NatsAddress address;
  std::optional<bool> tls;
  std::string_view rest = text;
  for (bool more = true; more;) {
    const auto comma = rest.find(',');
    std::string_view one = trimmed(rest.substr(0, comma));
    more = comma != std::string_view::npos;
    if (more) rest.remove_prefix(comma + 1);
    const bool with_tls = takePrefix(one, kTlsScheme);
    const bool with_scheme = with_tls || takePrefix(one, kNatsScheme);
    if (!with_scheme && !tls) return invalidAddress(fmt::format("'{}' has no scheme", printable(one)));
    if (with_scheme && tls && *tls != with_tls)
      return invalidAddress("nats:// and tls:// cannot be mixed: all servers must use the same scheme");
    if (with_scheme) tls = with_tls;
    ASSIGN_OR_RETURN(auto server, parseServer(one));
    address.servers.push_back(std::move(server));
  }
  if (address.servers.size() > kMaxServers)
    return invalidAddress(
        fmt::format("{} servers, at most {} are possible", address.servers.size(), kMaxServers));
  address.tls = *tls;
  return address;
}

NatsUser::~NatsUser() {
  wipe(password);
}

Result<NatsUser> readNatsUser(const fs::path& file) {
  const auto invalid = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, "--live-user " + file.string() + ": " + why};
  };
  struct stat info {};
  if (::stat(file.c_str(), &info) == 0 && (info.st_mode & 0077) != 0 && !isCredential(file))
    return invalid("may be read by others: chmod 600 " + file.string());
  auto text = readWholeFile(file, kMaxUserFileBytes);
  if (!text) return Error{ErrorCode::kInvalidInput, "--live-user " + text.error().message};
  const WipeAtEnd wipe_text(*text);
  NatsUser user;
  if (trimmed(withoutMark(*text)).starts_with(kCredsStart)) {
    user.creds = file;
    return user;
  }
  std::string_view rest = withoutMark(*text);
  while (!rest.empty()) {
    const auto end = rest.find('\n');
    const std::string_view line = trimmed(rest.substr(0, end));
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    const auto equals = line.find('=');
    const std::string_view key = trimmed(line.substr(0, equals));
    std::string* const wanted = key == "user" ? &user.user : key == "password" ? &user.password : nullptr;
    // do not repeat the line, it may be a password
    if (wanted == nullptr || equals == std::string_view::npos)
      return invalid("a line is neither 'user = NAME' nor 'password = TEXT'");
    *wanted = trimmed(line.substr(equals + 1));
  }
  if (user.user.empty() || user.password.empty())
    return invalid(
        "wanted are two lines, 'user = NAME' and 'password = TEXT', or a file of NATS's own (.creds)");
  return user;
}

fs::path natsUserFile(const fs::path& given) {
  if (!given.empty()) return given;
  const char* const folder = std::getenv("CREDENTIALS_DIRECTORY");
  if (folder == nullptr) return {};
  std::error_code error;
  const fs::path file = fs::path(folder) / "nats.user";
  return fs::exists(file, error) ? file : fs::path();
}

namespace {

constexpr std::array<std::string_view, kLivePlanes> kPlanes = {"presence", "watch", "live", "ask", "answer"};

bool isPlain(char c) {
  return isLetterOrDigit(c) || c == '-' || c == '_';
}

}  // namespace

std::string_view nameOf(LivePlane plane) {
  return kPlanes[static_cast<std::size_t>(plane)];
}

std::string subjectToken(std::string_view name) {
  std::string token;
  for (const char c : name) {
    if (isPlain(c))
      token += c;
    else
      token += fmt::format("={:02x}", static_cast<unsigned>(static_cast<unsigned char>(c)));
  }
  return token;
}

std::optional<std::string> nameOfToken(std::string_view token) {
  std::string name;
  for (std::size_t at = 0; at < token.size(); ++at) {
    if (isPlain(token[at])) {
      name += token[at];
      continue;
    }
    if (token[at] != '=' || token.size() - at < 3) return std::nullopt;
    const int high = hexDigit(token[at + 1]), low = hexDigit(token[at + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    name += static_cast<char>(16 * high + low);
    at += 2;
  }
  // each name has exactly one token
  if (name.empty() || subjectToken(name) != token) return std::nullopt;
  return name;
}

std::string subjectOf(std::string_view lab, LivePlane plane, const std::optional<std::string>& name) {
  return fmt::format("nl.{}.{}.{}", subjectToken(lab), nameOf(plane), name ? subjectToken(*name) : "*");
}

std::optional<SubjectParts> partsOfSubject(std::string_view lab, std::string_view subject) {
  const std::string start = "nl." + subjectToken(lab) + ".";
  if (!subject.starts_with(start)) return std::nullopt;
  subject.remove_prefix(start.size());
  const auto dot = subject.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  for (std::size_t plane = 0; plane < kLivePlanes; ++plane) {
    if (kPlanes[plane] != subject.substr(0, dot)) continue;
    auto name = nameOfToken(subject.substr(dot + 1));
    if (!name) return std::nullopt;
    return SubjectParts{static_cast<LivePlane>(plane), *std::move(name)};
  }
  return std::nullopt;
}

}  // namespace needlelab
