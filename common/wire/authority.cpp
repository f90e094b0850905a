#include "common/wire/authority.h"

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/wire/tls_folder.h"

namespace needlelab {
namespace {

using x509::isAddress;
using x509::opensslError;

constexpr long kAuthorityDays = 20 * 365, kServerDays = 2 * 365;

// RFC 1918, RFC 6598, loopback, link-local, RFC 4193; in OpenSSL's form, address/mask
constexpr std::array kPrivateAddresses = {
    "127.0.0.0/255.0.0.0",
    "10.0.0.0/255.0.0.0",
    "172.16.0.0/255.240.0.0",
    "192.168.0.0/255.255.0.0",
    "100.64.0.0/255.192.0.0",
    "169.254.0.0/255.255.0.0",
    "::1/ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff",
    "fc00::/fe00::",
    "fe80::/ffc0::",
};
// these have no owner on the internet
constexpr std::array kPrivateDomains = {"local", "lan", "internal", "home", "test", "localhost"};

bool isLabel(std::string_view label) {
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
  };
  return !label.empty() && label.size() <= 63 && std::all_of(label.begin(), label.end(), fits) &&
         label.front() != '-' && label.back() != '-';
}

Status checkDomain(const std::string& domain) {
  std::size_t labels = 0;
  bool good = domain.size() <= 253 && !isAddress(domain);
  for (std::string_view rest = domain; good;) {
    const std::size_t dot = rest.find('.');
    good = isLabel(rest.substr(0, dot));
    ++labels;
    if (dot == std::string_view::npos) break;
    rest.remove_prefix(dot + 1);
  }
  if (!good)
    return Error{ErrorCode::kInvalidInput,
                 "'" + domain + "' is not a domain; give one such as lab.example.org"};
  if (labels == 1 &&
      std::find(kPrivateDomains.begin(), kPrivateDomains.end(), lowerCase(domain)) == kPrivateDomains.end())
    return Error{ErrorCode::kInvalidInput,
                 "'" + domain + "' is a whole top-level domain; give the lab's own, such as lab.example.org"};
  return {};
}

x509::NameConstraints constraintsOf(X509* authority) {
  return x509::NameConstraints(
      static_cast<NAME_CONSTRAINTS*>(X509_get_ext_d2i(authority, NID_name_constraints, nullptr, nullptr)));
}

/// Each name once: "localhost" is in every authority, and often a host of its server.
std::vector<std::string> permittedDomains(X509* authority) {
  std::vector<std::string> names;
  const auto constraints = constraintsOf(authority);
  if (!constraints) return names;
  for (int i = 0; i < sk_GENERAL_SUBTREE_num(constraints->permittedSubtrees); ++i) {
    const GENERAL_NAME* const base = sk_GENERAL_SUBTREE_value(constraints->permittedSubtrees, i)->base;
    if (base->type != GEN_DNS) continue;
    std::string name(reinterpret_cast<const char*>(ASN1_STRING_get0_data(base->d.dNSName)),
                     static_cast<std::size_t>(ASN1_STRING_length(base->d.dNSName)));
    if (std::ranges::find(names, name) == names.end()) names.push_back(std::move(name));
  }
  return names;
}

std::string maskOf(const std::string& address) {
  return address.find(':') == std::string::npos ? "/255.255.255.255"
                                                : "/ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff";
}

}  // namespace

Result<std::string> permittedNames(const std::vector<std::string>& domains,
                                   const std::vector<std::string>& hosts) {
  std::string names = "critical,permitted;DNS:localhost";
  for (const std::string& domain : domains) {
    RETURN_IF_ERROR(checkDomain(domain));
    names += ",permitted;DNS:" + domain;
  }
  for (const char* const range : kPrivateAddresses) names += std::string(",permitted;IP:") + range;
  for (const std::string& host : hosts) {
    if (isAddress(host))
      names += ",permitted;IP:" + host + maskOf(host);
    else if (domains.empty())
      names += ",permitted;DNS:" + host;
  }
  return names;
}

Result<Authority> makeAuthority(const std::string& permitted, x509::Key key) {
  if (!key) return opensslError("making the CA's key");
  ASSIGN_OR_RETURN(auto made, x509::draft(key.get(), "needlelab private CA", kAuthorityDays));
  X509* const ca = made.get();
  if (X509_set_issuer_name(ca, X509_get_subject_name(ca)) != 1 ||
      !x509::addExtension(ca, ca, NID_basic_constraints, "critical,CA:TRUE,pathlen:0") ||
      !x509::addExtension(ca, ca, NID_key_usage, "critical,keyCertSign,cRLSign") ||
      !x509::addExtension(ca, ca, NID_subject_key_identifier, "hash") ||
      !x509::addExtension(ca, ca, NID_name_constraints, permitted) ||
      X509_sign(ca, key.get(), EVP_sha256()) == 0) {
    return opensslError("making the CA's certificate");
  }
  return Authority{std::move(made), std::move(key)};
}

Result<Authority> loadAuthority(const TlsFiles& files) {
  ASSIGN_OR_RETURN(auto certificates, x509::loadCertificates(files.ca_certificate));
  auto key = x509::loadKey(files.ca_key);
  if (!key.ok())
    return Error{key.error().code, "a new server certificate needs the CA's key: " + key.error().message +
                                       "; put it back for the time of this start"};
  for (auto& certificate : certificates)
    if (X509_check_private_key(certificate.get(), key->get()) == 1)
      return Authority{std::move(certificate), std::move(*key)};
  return Error{ErrorCode::kInvalidInput, files.ca_certificate.string() + " and " + files.ca_key.string() +
                                             " do not fit each other: put back the two that were made "
                                             "together"};
}

Status checkValidNow(X509* authority, const std::filesystem::path& file, const std::string& then) {
  std::time_t now = std::time(nullptr);
  const ASN1_TIME* const begin = X509_get0_notBefore(authority);
  const ASN1_TIME* const end = X509_get0_notAfter(authority);
  const bool is_early = X509_cmp_time(begin, &now) > 0;
  if (!is_early && X509_cmp_time(end, &now) > 0) return {};
  const auto dayOf = [](const ASN1_TIME* time) {
    return localTime(x509::unixSeconds(time) * 1'000'000'000, TimeForm::kZoned);
  };
  return Error{
      ErrorCode::kFailed,
      fmt::format(
          "{}: the authority {}, and this machine's clock says {}: no station, instructor or browser "
          "whose clock says the same accepts this server. If the clock is wrong, set it (timedatectl). "
          "If it is right, {}{}",
          file.string(),
          is_early ? "is valid from " + dayOf(begin) + " on only" : "has expired on " + dayOf(end),
          localTime(static_cast<std::int64_t>(now) * 1'000'000'000, TimeForm::kDay),
          is_early ? "it was ahead when the authority was made: " : "", then)};
}

bool maySign(X509* authority, const std::string& host) {
  const auto constraints = constraintsOf(authority);
  if (!constraints) return true;
  const x509::Certificate probe(X509_new());
  if (!probe ||
      !x509::addExtension(probe.get(), authority, NID_subject_alt_name, x509::alternativeNames({host})))
    return false;
  // makes OpenSSL read the extensions, which the check needs
  X509_get_extension_flags(probe.get());
  return NAME_CONSTRAINTS_check(probe.get(), constraints.get()) == X509_V_OK;
}

Status checkSigns(X509* authority, const std::vector<std::string>& hosts) {
  for (const std::string& host : hosts) {
    if (maySign(authority, host)) continue;
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("the authority may not sign '{0}', only {1} and names below; make another authority: "
                    "needlelab-admin --data DIR certificate renew --host-name {0}, or for a whole domain "
                    "certificate authority prepare --domain DOMAIN",
                    host, permittedText(authority))};
  }
  return {};
}

std::string permittedText(X509* authority) {
  const auto names = permittedDomains(authority);
  if (names.empty()) return {};
  return fmt::format("{}, private addresses and those that it was made for", fmt::join(names, ", "));
}

Status signServer(const TlsFiles& files, const Authority& authority, const std::vector<std::string>& hosts) {
  X509* const ca = authority.certificate.get();
  RETURN_IF_ERROR(checkSigns(ca, hosts));
  const x509::Key key = x509::newKey();
  if (!key) return opensslError("making the server's key");
  // without a DNS name, OpenSSL checks the constraints on the common name if that looks like one
  const auto name = std::find_if_not(hosts.begin(), hosts.end(), isAddress);
  ASSIGN_OR_RETURN(const auto made,
                   x509::draft(key.get(), name == hosts.end() ? "needlelab server" : *name, kServerDays));
  X509* const server = made.get();
  const std::string names = x509::alternativeNames(hosts);
  if (X509_set_issuer_name(server, X509_get_subject_name(ca)) != 1 ||
      !x509::addExtension(server, ca, NID_basic_constraints, "critical,CA:FALSE") ||
      !x509::addExtension(server, ca, NID_key_usage, "critical,digitalSignature") ||
      !x509::addExtension(server, ca, NID_ext_key_usage, "serverAuth") ||
      !x509::addExtension(server, ca, NID_subject_alt_name, names) ||
      !x509::addExtension(server, ca, NID_authority_key_identifier, "keyid") ||
      X509_sign(server, authority.key.get(), EVP_sha256()) == 0) {
    return opensslError("making the server's certificate for " + names);
  }
  RETURN_IF_ERROR(x509::saveKey(files.key, key.get()));
  return x509::saveCertificates(files.certificate, {server});
}

// --- a technician's operations

namespace {

bool isThere(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

Status removeFile(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::remove(path, error);
  if (error) return Error{ErrorCode::kFailed, "cannot remove " + path.string() + ": " + error.message()};
  return syncFolder(path.parent_path());
}

bool has(const std::vector<x509::Certificate>& certificates, X509* wanted) {
  return std::any_of(certificates.begin(), certificates.end(),
                     [&](const x509::Certificate& one) { return X509_cmp(one.get(), wanted) == 0; });
}

// writes the certificates in `known`, followed by `more`
Status addTo(const std::filesystem::path& file, const std::vector<x509::Certificate>& known, X509* more) {
  std::vector<X509*> all;
  for (const auto& one : known) all.push_back(one.get());
  all.push_back(more);
  return x509::saveCertificates(file, all);
}

}  // namespace

Status prepareAuthority(const TlsFiles& files, const std::vector<std::string>& domains,
                        const std::vector<std::string>& more) {
  const TlsFolderUse use(files);
  ASSIGN_OR_RETURN(const auto old, x509::loadCertificates(files.ca_certificate));
  if (isThere(files.next_ca_certificate)) {
    ASSIGN_OR_RETURN(const auto next, x509::loadCertificate(files.next_ca_certificate));
    // interrupted before its last step
    if (!has(old, next.get())) return addTo(files.ca_certificate, old, next.get());
    return Error{ErrorCode::kInvalidInput,
                 "a new authority is prepared already (" + files.next_ca_certificate.string() + "): bring " +
                     files.ca_certificate.string() +
                     " to every station and browser, then `certificate authority switch`"};
  }
  ASSIGN_OR_RETURN(const auto server, x509::loadCertificate(files.certificate));
  auto hosts = x509::hostsOf(server.get());
  hosts.insert(hosts.end(), more.begin(), more.end());
  if (!more.empty()) std::ranges::copy(permittedDomains(old.front().get()), std::back_inserter(hosts));
  // a name without a dot is the machine's own and belongs to no domain
  ASSIGN_OR_RETURN(auto permitted, permittedNames(domains, hosts));
  for (const std::string& host : hosts)
    if (!isAddress(host) && host.find('.') == std::string::npos) permitted += ",permitted;DNS:" + host;
  ASSIGN_OR_RETURN(const auto made, makeAuthority(permitted));
  for (const std::string& host : hosts)
    if (!maySign(made.certificate.get(), host))
      return Error{ErrorCode::kInvalidInput, "the server is called '" + host +
                                                 "', which lies in none of the domains: give --domain " +
                                                 host + " as well"};
  RETURN_IF_ERROR(x509::saveKey(files.next_ca_key, made.key.get()));
  RETURN_IF_ERROR(x509::saveCertificates(files.next_ca_certificate, {made.certificate.get()}));
  return addTo(files.ca_certificate, old, made.certificate.get());
}

Status switchAuthority(const TlsFiles& files, const std::vector<std::string>& more) {
  const TlsFolderUse use(files);
  if (!isThere(files.next_ca_certificate))
    return Error{ErrorCode::kInvalidInput,
                 "no new authority is prepared: `certificate authority prepare` first"};
  ASSIGN_OR_RETURN(auto next, x509::loadCertificate(files.next_ca_certificate));
  ASSIGN_OR_RETURN(const auto known, x509::loadCertificates(files.ca_certificate));
  if (!has(known, next.get()))
    return Error{ErrorCode::kInvalidInput,
                 files.ca_certificate.string() +
                     " lacks the new authority: `certificate authority prepare` was "
                     "cut off; repeat it, and bring ca.crt to all"};
  RETURN_IF_ERROR(checkValidNow(
      next.get(), files.next_ca_certificate,
      fmt::format("remove {} and {}, then `certificate authority drop`, and prepare another one",
                  files.next_ca_certificate.string(), files.next_ca_key.string())));
  // After each step the server can start with the files, and an interrupted switch is repeated. First the
  // server's certificate, which peers with the combined ca.crt accept from either authority; then the key
  // that matches ca.crt.
  if (isThere(files.next_ca_key)) {
    ASSIGN_OR_RETURN(auto key, x509::loadKey(files.next_ca_key));
    ASSIGN_OR_RETURN(const auto server, x509::loadCertificate(files.certificate));
    x509::Certificate copy(X509_dup(next.get()));
    if (!copy) return opensslError("copying a certificate");
    auto hosts = x509::hostsOf(server.get());
    for (const std::string& host : more)
      if (std::ranges::find(hosts, host) == hosts.end()) hosts.push_back(host);
    RETURN_IF_ERROR(signServer(files, {std::move(copy), std::move(key)}, hosts));
    std::error_code error;
    std::filesystem::rename(files.next_ca_key, files.ca_key, error);
    if (error)
      return Error{ErrorCode::kFailed,
                   "cannot rename " + files.next_ca_key.string() + ": " + error.message()};
    RETURN_IF_ERROR(syncFolder(files.ca_key.parent_path()));
  }
  std::vector<X509*> order = {next.get()};
  for (const auto& one : known)
    if (X509_cmp(one.get(), next.get()) != 0) order.push_back(one.get());
  RETURN_IF_ERROR(x509::saveCertificates(files.ca_certificate, order));
  return removeFile(files.next_ca_certificate);
}

Status dropOldAuthorities(const TlsFiles& files) {
  const TlsFolderUse use(files);
  if (isThere(files.next_ca_certificate))
    return Error{ErrorCode::kInvalidInput,
                 "the server still uses the old authority: `certificate authority "
                 "switch` first"};
  ASSIGN_OR_RETURN(const auto known, x509::loadCertificates(files.ca_certificate));
  ASSIGN_OR_RETURN(const auto server, x509::loadCertificate(files.certificate));
  for (const auto& one : known)
    if (X509_verify(server.get(), X509_get0_pubkey(one.get())) == 1)
      return x509::saveCertificates(files.ca_certificate, {one.get()});
  return Error{ErrorCode::kInvalidInput,
               files.certificate.string() + " was made by none of " + files.ca_certificate.string()};
}

Status moveAuthorityKey(const TlsFiles& files, const std::filesystem::path& to) {
  const TlsFolderUse use(files);
  ASSIGN_OR_RETURN(const auto authority, loadAuthority(files));
  if (isThere(to))
    return Error{ErrorCode::kInvalidInput, to.string() + " is there already: give the name of a new file"};
  RETURN_IF_ERROR(x509::saveKey(to, authority.key.get()));
  const auto copied = x509::loadKey(to);
  if (!copied.ok()) return copied.error();
  if (X509_check_private_key(authority.certificate.get(), copied->get()) != 1)
    return Error{ErrorCode::kFailed, to.string() + " does not read back as the key that was written"};
  return removeFile(files.ca_key);
}

}  // namespace needlelab
