#include "db/engine/postgres.h"

#include <fmt/core.h>
#include <libpq-fe.h>
#include <netdb.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "db/engine/open_postgres.h"

namespace needlelab {
namespace {

struct InfoCloser {
  void operator()(PQconninfoOption* options) const { PQconninfoFree(options); }
};

/// Lines of libpq's message about a failed connection: one per host it tried, and notes.
std::vector<std::string> linesOf(const char* text) {
  std::vector<std::string> lines;
  std::string_view rest = text != nullptr ? text : "";
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string line = printable(rest.substr(0, end));
    // a tab introduces advice for the administrator
    const bool counts = end > 0 && rest.front() != '\t';
    if (counts && std::find(lines.begin(), lines.end(), line) == lines.end())
      lines.push_back(std::move(line));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return lines;
}

/// The code of one such line, in English: libpq gives no SQLSTATE for a failed connection. Nothing: a note on
/// the previous line.
std::optional<ErrorCode> codeOfLine(std::string_view line) {
  struct Words {
    std::string_view words;
    ErrorCode code;
  };
  const std::string nobodys_name = gai_strerror(EAI_NONAME), no_address = gai_strerror(EAI_NODATA);
  const Words known[] = {{"authentication failed", ErrorCode::kDenied},
                         {"no pg_hba.conf entry", ErrorCode::kDenied},
                         {"pg_hba.conf rejects", ErrorCode::kDenied},
                         {"no password supplied", ErrorCode::kDenied},
                         {"is not permitted to log in", ErrorCode::kDenied},
                         {"permission denied for database", ErrorCode::kDenied},
                         {"requires a valid client certificate", ErrorCode::kDenied},
                         {"certificate verify failed", ErrorCode::kInvalidInput},
                         {"does not match host name", ErrorCode::kInvalidInput},
                         {"server does not support SSL", ErrorCode::kInvalidInput},
                         {"does not exist", ErrorCode::kInvalidInput},
                         {"could not match", ErrorCode::kInvalidInput},  // hosts and ports
                         {nobodys_name, ErrorCode::kInvalidInput},
                         {no_address, ErrorCode::kInvalidInput}};
  if (line.starts_with("password retrieved") || line.starts_with("DETAIL") || line.starts_with("HINT"))
    return std::nullopt;
  if (line.starts_with("invalid ")) return ErrorCode::kInvalidInput;  // a parameter's value
  for (const Words& one : known)
    if (line.find(one.words) != std::string_view::npos) return one.code;
  return ErrorCode::kUnavailable;
}

/// The parameters in a URL, by libpq's names. kInvalidInput also if it contains a password.
Result<std::map<std::string, std::string>> valuesOf(const std::string& url) {
  char* wrong = nullptr;
  const std::unique_ptr<PQconninfoOption, InfoCloser> parsed(PQconninfoParse(url.c_str(), &wrong));
  if (parsed == nullptr) {
    PQfreemem(wrong);  // may quote the URL, including the password
    return Error{ErrorCode::kInvalidInput,
                 "--store: is not a PostgreSQL address; write postgresql://USER@HOST:5432/DATABASE, and the "
                 "password into a file (passfile, PGPASSFILE)"};
  }
  std::map<std::string, std::string> values;
  for (const PQconninfoOption* option = parsed.get(); option->keyword != nullptr; ++option) {
    if (option->val == nullptr) continue;
    values[option->keyword] = option->val;
    if (std::string_view(option->dispchar) == "*")  // hidden by libpq itself
      return Error{
          ErrorCode::kInvalidInput,
          fmt::format("--store: has a password ({}), which every user of this machine can see in the list of "
                      "processes: put it into a file of mode 0600 and write passfile=FILE, or set PGPASSFILE",
                      option->keyword)};
  }
  // a password that contains a delimiter, or has no host after it, is parsed as one of these
  if (values["host"].find('@', 1) != std::string::npos || values["dbname"].find('@') != std::string::npos ||
      values["port"].find_first_not_of("0123456789,") != std::string::npos)
    return Error{ErrorCode::kInvalidInput,
                 "--store: its host, port or database has a sign that none has: write "
                 "postgresql://USER@HOST:5432/DATABASE, "
                 "with %2F for a / and %40 for an @ in a name, and the password into a file (passfile, "
                 "PGPASSFILE)"};
  return values;
}

/// Whether `host` of an address is a socket or the loopback device.
bool isLocalHost(std::string_view host) {
  return host.empty() || host.front() == '/' || host.front() == '@' || host == "localhost" ||
         host == "127.0.0.1" || host == "::1";
}

}  // namespace

Result<std::string> withoutPassword(const std::string& url) {
  ASSIGN_OR_RETURN(const auto values, valuesOf(url));
  const auto value = [&](const char* name, const char* otherwise) {
    const auto found = values.find(name);
    return found != values.end() && !found->second.empty() ? found->second : std::string(otherwise);
  };
  return fmt::format("postgresql://{}@{}:{}/{}", value("user", "(you)"), value("host", "(local)"),
                     value("port", "5432"), value("dbname", value("user", "(you)").c_str()));
}

Status checkAddressFromOutside(const std::string& url) {
  ASSIGN_OR_RETURN(const auto values, valuesOf(url));
  constexpr std::array<std::string_view, 5> kTaken = {"user", "host", "port", "dbname", "sslmode"};
  for (const auto& [name, value] : values)
    if (!value.empty() && std::find(kTaken.begin(), kTaken.end(), name) == kTaken.end())
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("the address has {}, and of an address that a request gives only user, host, "
                               "port, dbname and sslmode are taken: postgresql://USER@HOST:PORT/DATABASE"
                               "?sslmode=verify-full",
                               name)};
  const auto value = [&](const char* name) {
    const auto found = values.find(name);
    return found != values.end() ? std::string_view(found->second) : std::string_view();
  };
  if (value("sslmode") == "verify-full") return {};
  const std::string_view hosts = value("host");
  for (std::size_t at = 0; at <= hosts.size();) {
    const std::size_t end = std::min(hosts.find(',', at), hosts.size());
    if (!isLocalHost(hosts.substr(at, end - at)))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("the address names the host {}: write sslmode=verify-full behind it, or "
                               "somebody else may answer there, and get the password",
                               hosts.substr(at, end - at))};
    at = end + 1;
  }
  return {};
}

Error cannotConnect(const std::string& shown_url, const char* said) {
  const auto lines = linesOf(said);
  ErrorCode code = ErrorCode::kInvalidInput;
  std::string all;
  for (const std::string& line : lines) {
    all += (all.empty() ? "" : "; ") + line;
    const auto found = codeOfLine(line);
    if (found && code != ErrorCode::kUnavailable && *found != ErrorCode::kInvalidInput) code = *found;
  }
  if (lines.empty()) code = ErrorCode::kUnavailable;
  if (all.ends_with('.')) all.pop_back();
  const char* advice = "";
  if (code == ErrorCode::kDenied)
    advice =
        ". Look at the user in the address, at its line HOST:PORT:DATABASE:USER:PASSWORD in the password "
        "file "
        "(passfile, PGPASSFILE; mode 0600), and at pg_hba.conf on that machine";
  if (code == ErrorCode::kInvalidInput) advice = ". Look at the address";
  return {code, fmt::format("{}: cannot connect: {}{}", shown_url, all, advice)};
}

}  // namespace needlelab
