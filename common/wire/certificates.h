/// A private certificate authority and a server's certificate (EC P-256), made with OpenSSL at the first
/// start.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/tls.h"

namespace needlelab {

/// Files of `DIR/tls`. Keys have mode 0600.
struct TlsFiles {
  std::filesystem::path ca_certificate;  ///< ca.crt: give this to stations and instructors
  std::filesystem::path ca_key;          ///< ca.key
  std::filesystem::path certificate;     ///< server.crt
  std::filesystem::path key;             ///< server.key
  /// ca-next.crt, ca-next.key: of a new authority, between prepareAuthority and switchAuthority
  std::filesystem::path next_ca_certificate, next_ca_key;
};

TlsFiles tlsFilesIn(const std::filesystem::path& folder);

/// What a server's certificate is for: names and IP addresses.
struct CertificateNames {
  std::vector<std::string> hosts = {};  ///< it must have these
  /// Of this machine: left out where the authority may not sign them, or its key is elsewhere.
  std::vector<std::string> own = {};
  std::vector<std::string> domains =
      {};  ///< for an authority that is made now: it may sign these and names below
};

/// Creates the missing files: the CA (20 years), and the server's certificate (2 years). The CA may sign
/// localhost, private addresses, `domains` (without any: the names of `hosts` and `own`), and nothing else.
/// Renews the server's certificate with the same CA when it lacks one of `hosts` or expires within 30 days;
/// the new certificate keeps the names of the old one. Peers trust the CA and notice nothing. Returns true
/// when a file was created. Errors: kInvalidInput for a name that the CA may not sign, for a CA that is lost
/// (there is no ca.crt, but a file that was made with it; no key is ever replaced), for a CA or key that
/// cannot be read, with the fault of the server's certificate in the message; kFailed when a file cannot be
/// written. While the CA is not valid by this machine's clock (clockFault), the stored certificate stays.
Result<bool> ensureTlsFiles(const TlsFiles& files, const CertificateNames& names);

/// Why a peer whose clock agrees with this machine's accepts no certificate of this folder: its CA is not
/// valid yet, or no more. Says what to do. Empty: it is valid, or it cannot be read. One of the clocks may be
/// wrong, so a server says it and serves on.
std::string clockFault(const TlsFiles& files);

/// Creates a new certificate and key for the server, signed by the same CA, for `hosts` and all names of the
/// old certificate. The CA's key must exist. Errors: as ensureTlsFiles; kFailed while the CA is not valid.
Status renewServerCertificate(const TlsFiles& files, const std::vector<std::string>& hosts);

// A new authority in three steps, without a break: prepare, bring ca.crt to all peers, switch, drop. The
// server may run; it takes each change within a minute (server/server.h).

/// Makes ca-next.crt and ca-next.key, and adds the new authority to ca.crt, so that a peer with this ca.crt
/// trusts both; the server's names without a dot are permitted besides. `domains` as in CertificateNames. May
/// be repeated when it was cut off. Errors: kInvalidInput (a domain, a name of the server that lies in none
/// of them, or one is prepared already), kFailed.
Status prepareAuthority(const TlsFiles& files, const std::vector<std::string>& domains);
/// Lets the new authority sign the server's certificate, and takes its key as ca.key. ca.crt keeps both. May
/// be repeated when it was cut off. Peers with the ca.crt from before prepareAuthority no longer connect.
/// Errors: kInvalidInput (none is prepared, or ca.crt lacks it), kFailed (also while it is not valid).
Status switchAuthority(const TlsFiles& files);
/// Leaves in ca.crt only the authority that signed the server's certificate.
Status dropOldAuthorities(const TlsFiles& files);
/// Writes ca.key to the new file `to` (0600), reads it back, and removes ca.key.
Status moveAuthorityKey(const TlsFiles& files, const std::filesystem::path& to);

/// The fields of a certificate. Times: seconds since 1970.
struct CertificateFacts {
  std::string subject;             ///< its common name
  std::vector<std::string> hosts;  ///< names and addresses of the certificate
  std::string may_sign;            ///< of an authority: the names that it may sign; empty: all, or none
  std::int64_t not_before_unix_s = 0, not_after_unix_s = 0;
  std::string sha256;  ///< fingerprint, hexadecimal
};
/// Reads every certificate of a file, at least one. Errors: kInvalidInput (the file is missing or has none).
Result<std::vector<CertificateFacts>> readCertificates(const std::filesystem::path& path);
/// Reads the first one.
Result<CertificateFacts> readCertificate(const std::filesystem::path& path);
/// The certificate that a server's context shows to its peers; the files may have another one by now.
Result<CertificateFacts> shownCertificate(const TlsContext& server);

}  // namespace needlelab
