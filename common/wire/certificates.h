/// A private certificate authority and a server's certificate (EC P-256), made with OpenSSL at the first
/// start.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/tls.h"
#include "common/wire/tls_folder.h"

namespace needlelab {

/// The names and IP addresses in a server's certificate.
struct CertificateNames {
  std::vector<std::string> hosts = {};  ///< required
  /// This machine's names: omitted if the authority may not sign them or its key is elsewhere.
  std::vector<std::string> own = {};
  std::vector<std::string> domains =
      {};  ///< for a new authority: it may sign these domains and names below them
};

/// Creates the missing files: the CA (20 years), and the server's certificate (2 years). The CA may sign only
/// localhost, private addresses, and `domains` (if empty: the names in `hosts` and `own`). Renews the
/// server's certificate with the same CA when it lacks one of `hosts` or expires within 30 days; the new
/// certificate keeps the names of the old one. Peers trust the CA and do not notice. Returns true when a file
/// was created. Errors: kInvalidInput for a name that the CA may not sign, for a lost CA (no ca.crt, but a
/// file made with it; keys are never replaced), or for a CA or key that cannot be read; the message has the
/// fault of the server's certificate. kFailed when a file cannot be written. While the CA is not valid by
/// this machine's clock (clockFault), the stored certificate is kept.
Result<bool> ensureTlsFiles(const TlsFiles& files, const CertificateNames& names);

/// Explains why a peer whose clock agrees with this machine's accepts no certificate from this folder (the CA
/// is not valid yet or has expired), and what to do. Empty if the CA is valid or cannot be read. Either clock
/// may be wrong, so a server reports this and continues.
std::string clockFault(const TlsFiles& files);

/// Creates a new certificate and key for the server, signed by the same CA, for `hosts` and all names of the
/// old certificate. The CA's key must exist. Errors: as ensureTlsFiles; kFailed while the CA is not valid.
Status renewServerCertificate(const TlsFiles& files, const std::vector<std::string>& hosts);
/// The same; if the CA may not sign `hosts`, prepares another that may (prepareAuthority), which
/// switchAuthority then uses. Returns whether the server has the new certificate now.
Result<bool> renewOrPrepare(const TlsFiles& files, const std::vector<std::string>& hosts);

// A new authority in three steps, without interruption: prepare (then bring ca.crt to all peers), switch,
// drop. The server may be running; it applies each change within a minute (server/server.h).

/// Makes ca-next.crt and ca-next.key, and adds the new authority to ca.crt, so that a peer with this ca.crt
/// trusts both; also permits the server's names without a dot. `domains` as in CertificateNames; `more`:
/// further names, permitted besides what the old one may sign. Can be repeated after an interruption. Errors:
/// kInvalidInput (an invalid domain, a server name outside all domains, or an authority is already prepared),
/// kFailed.
Status prepareAuthority(const TlsFiles& files, const std::vector<std::string>& domains,
                        const std::vector<std::string>& more = {});
/// Signs the server's certificate with the new authority, for its names and `more`, and makes its key ca.key.
/// ca.crt keeps both. Can be repeated after an interruption. Peers with a ca.crt from before prepareAuthority
/// can no longer connect. Errors: kInvalidInput (no authority is prepared, or ca.crt lacks it), kFailed (also
/// while it is not valid).
Status switchAuthority(const TlsFiles& files, const std::vector<std::string>& more = {});
/// Removes from ca.crt all authorities except the one that signed the server's certificate.
Status dropOldAuthorities(const TlsFiles& files);
/// Writes ca.key to the new file `to` (0600), reads it back, and removes ca.key.
Status moveAuthorityKey(const TlsFiles& files, const std::filesystem::path& to);

/// The fields of a certificate. Times: seconds since 1970.
struct CertificateFacts {
  std::string subject;             ///< its common name
  std::vector<std::string> hosts;  ///< names and addresses of the certificate
  std::string may_sign;            ///< for an authority: the names that it may sign; empty: no constraints,
                                   ///< or not an authority
  std::int64_t not_before_unix_s = 0, not_after_unix_s = 0;
  std::string sha256;  ///< fingerprint, hexadecimal
};
/// Reads every certificate of a file, at least one. Errors: kInvalidInput (the file is missing or has none).
Result<std::vector<CertificateFacts>> readCertificates(const std::filesystem::path& path);
/// Reads the first certificate of a file.
Result<CertificateFacts> readCertificate(const std::filesystem::path& path);
/// The certificate that a server's context presents to its peers; the files may already have another one.
Result<CertificateFacts> shownCertificate(const TlsContext& server);

}  // namespace needlelab
