/// The lab's private certificate authority: made once, may sign only names of the lab, and can be replaced by
/// a new one without interruption.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/tls_folder.h"
#include "common/wire/x509.h"

namespace needlelab {

struct Authority {
  x509::Certificate certificate;
  x509::Key key;
};

/// Returns the names that an authority may sign (name constraints, RFC 5280 §4.2.1.10): `domains` with all
/// names below them, or the DNS names of `hosts` if there are none; localhost; private addresses, and the
/// public ones of `hosts`. Errors: kInvalidInput for an invalid domain or a top-level domain.
Result<std::string> permittedNames(const std::vector<std::string>& domains,
                                   const std::vector<std::string>& hosts);

/// Makes an authority (20 years) over `key`, in memory. `permitted` comes from permittedNames.
Result<Authority> makeAuthority(const std::string& permitted, x509::Key key = x509::newKey());

/// Loads the authority from ca.key and the matching certificate in ca.crt.
Result<Authority> loadAuthority(const TlsFiles& files);

/// Returns kFailed unless peers whose clocks agree with this machine's would accept this authority from
/// `file`. It may have been made while the clock was ahead, have expired, or this machine's clock may be
/// wrong. `then`: what to do if the clock is right.
Status checkValidNow(X509* authority, const std::filesystem::path& file, const std::string& then);

/// Whether `authority` may sign for this name or address. An authority without constraints may sign any.
bool maySign(X509* authority, const std::string& host);

/// Errors: kInvalidInput, naming the first of `hosts` that the authority may not sign, and the remedy.
Status checkSigns(X509* authority, const std::vector<std::string>& hosts);

/// The names that the authority may sign, for people; empty without constraints.
std::string permittedText(X509* authority);

/// Makes server.key and server.crt (2 years) for `hosts`. Errors: as checkSigns; kFailed.
Status signServer(const TlsFiles& files, const Authority& authority, const std::vector<std::string>& hosts);

}  // namespace needlelab
