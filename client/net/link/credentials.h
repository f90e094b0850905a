/// Log-in credentials: a person's password, and a station's enrolment (server, name, key, CA), both as the
/// bundle file that the server writes and as the files that the station keeps.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/wire/endpoint.h"

namespace needlelab {

/// Returns the first line of a file that holds a secret, and warns if others may read the file. Errors:
/// kInvalidInput (no such file).
Result<std::string> readSecretLine(const std::filesystem::path& file);

/// Maximum length of a password or code from a file or terminal.
inline constexpr std::size_t kMostPasswordBytes = 1024;

/// Returns the first line of a file like readSecretLine(). `what`: its name in messages. Passwords are never
/// arguments, because others could read them in the process list. Errors: kInvalidInput (no such file; the
/// line is empty or longer than kMostPasswordBytes).
Result<std::string> passwordFromFile(const std::filesystem::path& file, const std::string& what = "password");

/// Likewise; without a file, asks on the terminal without echo. Errors: also kInvalidInput (no terminal).
Result<std::string> readPassword(const std::filesystem::path& file, const std::string& prompt);

/// Asks on the terminal without echo, for one line of at most about `most_bytes`. Polls `stopped`, if given,
/// about 20 times a second. Errors: kInvalidInput with the text `no_terminal` without a terminal; kFailed
/// (stopped).
Result<std::string> passwordFromTerminal(const std::string& prompt, std::size_t most_bytes,
                                         const std::string& no_terminal,
                                         const std::function<bool()>& stopped = {});

struct Enrolment {
  Endpoints servers;    ///< at least one
  std::string station;  ///< name
  std::string key;      ///< 32 bytes
  std::string ca_pem;   ///< the server's certificate authority
};

/// The bundle's text: a line "needlelab-enrolment 1", then "server HOST:PORT" (for several servers "server
/// HOST:PORT,HOST:PORT"), "station NAME", "key HEX", and the CA's certificate as PEM. It contains the key:
/// keep it at mode 0600, and delete it once the station is enrolled.
std::string bundleText(const Enrolment& enrolment);
/// Errors: kInvalidInput naming `source` and the line; no message contains the key.
Result<Enrolment> parseBundle(std::string_view text, const std::string& source);

/// The folder of an enrolled station: `server`, `ca.crt`, `station.key` (0600).
struct EnrolmentFiles {
  std::filesystem::path server, ca, key;
};
EnrolmentFiles enrolmentFilesIn(const std::filesystem::path& folder);
/// /etc/needlelab for root, otherwise needlelab in $XDG_CONFIG_HOME or ~/.config.
std::filesystem::path defaultEnrolmentFolder();

/// Writes the three files, the key first, so that a station that knows its server also has its key. Errors:
/// kFailed.
Status saveEnrolment(const Enrolment& enrolment, const std::filesystem::path& folder);

/// Where an enrolment was proven.
struct ProvenEnrolment {
  std::string station;  ///< its name at the server
  Endpoint server;
};
/// Connects and logs in as the station with only this enrolment, at the first of its servers that accepts it.
/// `scratch`: a folder for the temporary CA file. Errors: as connectClient.
Result<ProvenEnrolment> proveEnrolment(const Enrolment& enrolment, const std::filesystem::path& scratch);

}  // namespace needlelab
