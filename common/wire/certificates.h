/// A private certificate authority and a server's certificate (EC P-256), made with OpenSSL at the first
/// start.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace needlelab {

/// Files of `DIR/tls`. Keys have mode 0600.
struct TlsFiles {
  std::filesystem::path ca_certificate;  ///< ca.crt: give this to stations and instructors
  std::filesystem::path ca_key;          ///< ca.key
  std::filesystem::path certificate;     ///< server.crt
  std::filesystem::path key;             ///< server.key
};

TlsFiles tlsFilesIn(const std::filesystem::path& folder);

/// Makes what is missing: the CA (20 years), and the server's certificate (2 years) for `hosts` (names and IP
/// addresses). The server's certificate is made anew, by the same CA, when it lacks one of `hosts` or ends
/// within 30 days; peers notice nothing, they know the CA. Returns true when something was made. Errors:
/// kInvalidInput for a CA or key that cannot be read; kFailed when a file cannot be written.
Result<bool> ensureTlsFiles(const TlsFiles& files, const std::vector<std::string>& hosts);

}  // namespace needlelab
