/// The lab's private certificate authority: made once, may sign names of the lab only, and can be followed by
/// a new one without a break.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/certificates.h"
#include "common/wire/x509.h"

namespace needlelab {

struct Authority {
  x509::Certificate certificate;
  x509::Key key;
};

/// Which names an authority may sign (name constraints, RFC 5280 §4.2.1.10): `domains` with all names below
/// them, or without any the DNS names of `hosts`; localhost; private addresses, and the public ones of
/// `hosts`. Errors: kInvalidInput for a domain that is none, or that is a whole top-level domain.
Result<std::string> permittedNames(const std::vector<std::string>& domains,
                                   const std::vector<std::string>& hosts);

/// Makes an authority (20 years) over `key`, in memory. `permitted` comes from permittedNames.
Result<Authority> makeAuthority(const std::string& permitted, x509::Key key = x509::newKey());

/// The authority of ca.key and that certificate of ca.crt that fits it.
Result<Authority> loadAuthority(const TlsFiles& files);

/// kFailed unless every peer whose clock agrees with this machine's accepts this authority of `file`: it was
/// made while the clock was ahead, it has expired, or this machine's clock is wrong. `then`: what to do if
/// the clock is right.
Status checkValidNow(X509* authority, const std::filesystem::path& file, const std::string& then);

/// Whether `authority` may sign for this name or address. An authority without constraints may sign all.
bool maySign(X509* authority, const std::string& host);

/// kInvalidInput names the first of `hosts` that it may not sign, and what to do.
Status checkSigns(X509* authority, const std::vector<std::string>& hosts);

/// The names that it may sign, for people; empty without constraints.
std::string permittedText(X509* authority);

/// Makes server.key and server.crt (2 years) for `hosts`. Errors: as checkSigns; kFailed.
Status signServer(const TlsFiles& files, const Authority& authority, const std::vector<std::string>& hosts);

}  // namespace needlelab
