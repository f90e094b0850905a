/// A private certificate authority and a server's certificate (EC P-256), made with OpenSSL at the first
/// start.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"

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
/// addresses). The server's certificate is made again, by the same CA, when it lacks one of `hosts` or ends
/// within 30 days; it keeps the hosts of the old one. Peers notice nothing, they know the CA. Returns true
/// when something was made. Errors: kInvalidInput for a CA or key that cannot be read, saying what is wrong
/// with the server's certificate; kFailed when a file cannot be written.
Result<bool> ensureTlsFiles(const TlsFiles& files, const std::vector<std::string>& hosts);

/// A new certificate and key for the server, by the same CA, for `hosts` and all that the old one was for.
/// The CA's key must be there. Errors: as ensureTlsFiles.
Status renewServerCertificate(const TlsFiles& files, const std::vector<std::string>& hosts);

/// What a certificate says of itself. Times: seconds since 1970.
struct CertificateFacts {
  std::string subject;             ///< its common name
  std::vector<std::string> hosts;  ///< names and addresses that it is for
  std::int64_t not_before_unix_s = 0, not_after_unix_s = 0;
  std::string sha256;  ///< fingerprint, hexadecimal
};
/// Errors: kInvalidInput (missing, or no certificate).
Result<CertificateFacts> readCertificate(const std::filesystem::path& path);

}  // namespace needlelab
