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

/// Creates the missing files: the CA (20 years), and the server's certificate (2 years) for `hosts` (names
/// and IP addresses). Renews the server's certificate with the same CA when it lacks one of `hosts` or
/// expires within 30 days; the new certificate keeps the hosts of the old one. Peers trust the CA and notice
/// nothing. Returns true when a file was created. Errors: kInvalidInput for a CA or key that cannot be read,
/// with the fault of the server's certificate in the message; kFailed when a file cannot be written.
Result<bool> ensureTlsFiles(const TlsFiles& files, const std::vector<std::string>& hosts);

/// Creates a new certificate and key for the server, signed by the same CA, for `hosts` and all hosts of the
/// old certificate. The CA's key must exist. Errors: as ensureTlsFiles.
Status renewServerCertificate(const TlsFiles& files, const std::vector<std::string>& hosts);

/// The fields of a certificate. Times: seconds since 1970.
struct CertificateFacts {
  std::string subject;             ///< its common name
  std::vector<std::string> hosts;  ///< names and addresses of the certificate
  std::int64_t not_before_unix_s = 0, not_after_unix_s = 0;
  std::string sha256;  ///< fingerprint, hexadecimal
};
/// Errors: kInvalidInput (the file is missing or is not a certificate).
Result<CertificateFacts> readCertificate(const std::filesystem::path& path);

}  // namespace needlelab
