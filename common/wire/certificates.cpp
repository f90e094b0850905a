#include "common/wire/certificates.h"

#include <fmt/core.h>
#include <openssl/err.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/wire/authority.h"
#include "common/wire/tls_folder.h"
#include "common/wire/x509.h"

namespace needlelab {
namespace {

using x509::addExtension;
using x509::hostsOf;
using x509::isAddress;
using x509::loadCertificate;
using x509::loadKey;
using x509::opensslError;
using x509::unixSeconds;

constexpr long kDay = 24 * 3600;
constexpr long kRenewDays = 30;

std::string dayText(const ASN1_TIME* time) {
  const std::int64_t seconds = unixSeconds(time);
  return seconds == 0 ? "an unknown day" : localTime(seconds * 1'000'000'000, TimeForm::kZoned);
}

/// Describes the fault of the stored certificate. Empty if it is valid: the key matches, one of our CAs
/// signed it, it does not expire soon, and it has every host.
std::string serverFault(const TlsFiles& files, const std::vector<x509::Certificate>& authorities,
                        const std::vector<std::string>& hosts) {
  const auto certificate = loadCertificate(files.certificate);
  if (!certificate.ok()) return certificate.error().message;
  const auto key = loadKey(files.key);
  if (!key.ok()) return key.error().message;
  X509* const server = certificate->get();
  const std::string name = files.certificate.string();
  if (X509_check_private_key(server, key->get()) != 1)
    return name + " and " + files.key.string() + " do not fit each other";
  const auto signed_by = [&](const x509::Certificate& ca) {
    return X509_verify(server, X509_get0_pubkey(ca.get())) == 1;
  };
  if (std::none_of(authorities.begin(), authorities.end(), signed_by))
    return name + " was not made by the authority in " + files.ca_certificate.string();
  std::time_t now = std::time(nullptr), renew = now + kRenewDays * kDay;
  const ASN1_TIME* const end = X509_get0_notAfter(server);
  if (X509_cmp_time(end, &now) <= 0) return name + " has expired on " + dayText(end);
  if (X509_cmp_time(end, &renew) <= 0) return name + " expires on " + dayText(end);
  if (const ASN1_TIME* const begin = X509_get0_notBefore(server); X509_cmp_time(begin, &now) > 0)
    return name + " is valid from " + dayText(begin) + " on only: is this machine's clock right?";
  for (const std::string& host : hosts) {
    const int found = isAddress(host) ? X509_check_ip_asc(server, host.c_str(), 0)
                                      : X509_check_host(server, host.c_str(), host.size(), 0, nullptr);
    if (found == 1) continue;
    std::string has;
    for (const std::string& known : hostsOf(server)) has += (has.empty() ? "" : ", ") + known;
    return name + " is not for '" + host + "', only for " + has;
  }
  return {};
}

/// Before a user makes a new certificate: peers must accept its authority.
Status checkAuthority(const TlsFiles& files, X509* authority) {
  return checkValidNow(authority, files.ca_certificate,
                       fmt::format("move the folder {} away and start again, which makes a new authority: "
                                   "then enrol every station again",
                                   files.ca_certificate.parent_path().string()));
}

/// The authority that signed the stored certificate; null if none of these did or there is no certificate.
X509* signerOf(const TlsFiles& files, const std::vector<x509::Certificate>& authorities) {
  const auto certificate = loadCertificate(files.certificate);
  if (!certificate.ok()) return nullptr;
  for (const auto& one : authorities)
    if (X509_verify(certificate->get(), X509_get0_pubkey(one.get())) == 1) return one.get();
  return nullptr;
}

Status checkHosts(const std::vector<std::string>& hosts) {
  if (hosts.empty()) return Error{ErrorCode::kInvalidInput, "a server's certificate needs a host name"};
  for (const std::string& host : hosts) {
    if (host.empty() || host.find_first_of(",: \n") != std::string::npos) {
      if (!isAddress(host))
        return Error{ErrorCode::kInvalidInput, "'" + host + "' is not a host name or IP address"};
    }
  }
  return {};
}

/// Removes duplicate names: DNS names that differ only in case are equal, and addresses are compared in one
/// form ("::1").
std::vector<std::string> withoutDuplicates(const std::vector<std::string>& hosts) {
  const auto formOf = [](const std::string& host) {
    boost::system::error_code error;
    const auto address = boost::asio::ip::make_address(host, error);
    return error ? lowerCase(host) : address.to_string();
  };
  std::vector<std::string> once, forms;
  for (const std::string& host : hosts) {
    std::string form = formOf(host);
    if (std::find(forms.begin(), forms.end(), form) != forms.end()) continue;
    forms.push_back(std::move(form));
    once.push_back(host);
  }
  return once;
}

/// `hosts` and those of the stored certificate: stations may use any of these names for the server, so none
/// may be lost.
std::vector<std::string> withOldHosts(const TlsFiles& files, std::vector<std::string> hosts) {
  const auto old = loadCertificate(files.certificate);
  if (old.ok())
    for (const std::string& host : hostsOf(old->get())) hosts.push_back(host);
  return withoutDuplicates(hosts);
}

// the names that the certificate must have, plus the machine's own names that the authority may sign: a
// renamed machine can then still serve
std::vector<std::string> named(X509* authority, const CertificateNames& names) {
  std::vector<std::string> hosts;
  for (const std::string& host : names.own)
    if (maySign(authority, host)) hosts.push_back(host);
  hosts.insert(hosts.end(), names.hosts.begin(), names.hosts.end());
  return hosts;
}

/// If there is no ca.crt, checks whether there used to be one: a new authority would lock out every station.
Status checkFilesComplete(const TlsFiles& files) {
  for (const auto& left : {files.certificate, files.key, files.next_ca_certificate, files.next_ca_key}) {
    std::error_code failed;
    if (!std::filesystem::exists(left, failed) && !failed) continue;
    return Error{ErrorCode::kInvalidInput,
                 files.ca_certificate.string() + " is lost, " + left.string() +
                     " is there: put ca.crt back, each enrolled station has a copy; only if no copy is left, "
                     "move the folder " +
                     files.ca_certificate.parent_path().string() +
                     " away and start again, which makes a new authority: then enrol every station again"};
  }
  return {};
}

/// The key for a new authority: one left by an interrupted start, or a new one. Never replaces a key.
Result<x509::Key> keyForNewAuthority(const TlsFiles& files) {
  std::error_code failed;
  if (std::filesystem::exists(files.ca_key, failed)) return loadKey(files.ca_key);
  x509::Key key = x509::newKey();
  if (!key) return opensslError("making the CA's key");
  return key;
}

}  // namespace

Result<bool> ensureTlsFiles(const TlsFiles& files, const CertificateNames& names) {
  std::vector<std::string> hosts = names.own;
  hosts.insert(hosts.end(), names.hosts.begin(), names.hosts.end());
  RETURN_IF_ERROR(checkHosts(hosts));
  std::error_code failed;
  const auto folder = files.ca_certificate.parent_path();
  const bool made_folder = std::filesystem::create_directories(folder, failed);
  if (failed)
    return Error{ErrorCode::kFailed, "cannot make " + folder.string() + ": " + failed.message() +
                                         diskAdvice(failed.value(), folder)};
  if (made_folder) std::filesystem::permissions(folder, std::filesystem::perms::owner_all, failed);
  // a published CA must not vanish with its directory entry in a power cut
  if (made_folder) RETURN_IF_ERROR(syncFolder(folder.parent_path()));
  const TlsFolderUse use(files);
  for (const auto& path : {files.ca_certificate, files.ca_key, files.certificate, files.key,
                           files.next_ca_certificate, files.next_ca_key})
    RETURN_IF_ERROR(requireFileOrNothing(path));

  // a key restored with default permissions is readable by everyone
  for (const auto& key : {files.ca_key, files.key, files.next_ca_key}) {
    const auto mode = std::filesystem::status(key, failed).permissions();
    using std::filesystem::perms;
    if (failed || (mode & (perms::group_all | perms::others_all)) == perms::none) continue;
    return Error{ErrorCode::kInvalidInput,
                 key.string() + " may be read by others: chmod 600 " + key.string()};
  }
  failed.clear();

  const bool has_ca = std::filesystem::exists(files.ca_certificate, failed);
  if (failed) {
    return Error{ErrorCode::kFailed,
                 "cannot look at " + files.ca_certificate.string() + ": " + failed.message()};
  }
  if (!has_ca) {
    RETURN_IF_ERROR(checkFilesComplete(files));
    ASSIGN_OR_RETURN(const auto permitted, permittedNames(names.domains, hosts));
    ASSIGN_OR_RETURN(auto key, keyForNewAuthority(files));
    ASSIGN_OR_RETURN(const auto made, makeAuthority(permitted, std::move(key)));
    const auto signable = named(made.certificate.get(), names);
    // check everything that can be refused before writing a file
    RETURN_IF_ERROR(checkSigns(made.certificate.get(), signable));
    // the key first, so that a published certificate always has its key
    RETURN_IF_ERROR(x509::saveKey(files.ca_key, made.key.get()));
    RETURN_IF_ERROR(x509::saveCertificates(files.ca_certificate, {made.certificate.get()}));
    RETURN_IF_ERROR(signServer(files, made, withoutDuplicates(signable)));
    return true;
  }
  ASSIGN_OR_RETURN(const auto authorities, x509::loadCertificates(files.ca_certificate));
  hosts = named(authorities.front().get(), names);
  // if the clock is wrong, the stored certificate is better than one made with that clock
  if (X509* const signer = signerOf(files, authorities);
      signer != nullptr && !checkAuthority(files, signer).ok())
    return false;
  // if the CA's key is kept elsewhere, the server does without names of its machine that were not requested
  const bool has_key = std::filesystem::exists(files.ca_key, failed);
  const std::string fault = serverFault(files, authorities, has_key ? hosts : names.hosts);
  if (fault.empty()) return false;
  // from here the CA's key is needed; if it is kept elsewhere, it must be restored
  const auto authority = loadAuthority(files);
  if (!authority.ok()) return Error{authority.error().code, fault + "; " + authority.error().message};
  RETURN_IF_ERROR(signServer(files, *authority, withOldHosts(files, hosts)));
  return true;
}

std::string clockFault(const TlsFiles& files) {
  const auto authorities = x509::loadCertificates(files.ca_certificate);
  if (!authorities.ok()) return {};
  X509* const signer = signerOf(files, *authorities);
  const Status valid = checkAuthority(files, signer != nullptr ? signer : authorities->front().get());
  return valid.ok() ? std::string() : valid.error().message;
}

Status renewServerCertificate(const TlsFiles& files, const std::vector<std::string>& hosts) {
  const auto all = withOldHosts(files, hosts);
  RETURN_IF_ERROR(checkHosts(all));
  const TlsFolderUse use(files);
  ASSIGN_OR_RETURN(const auto authority, loadAuthority(files));
  RETURN_IF_ERROR(checkAuthority(files, authority.certificate.get()));
  return signServer(files, authority, all);
}

Result<bool> renewOrPrepare(const TlsFiles& files, const std::vector<std::string>& hosts) {
  ASSIGN_OR_RETURN(const auto known, x509::loadCertificates(files.ca_certificate));
  const bool may = checkSigns(known.front().get(), hosts).ok();
  if (!may) RETURN_IF_ERROR(checkHosts(hosts));
  RETURN_IF_ERROR(may ? renewServerCertificate(files, hosts) : prepareAuthority(files, {}, hosts));
  return may;
}

namespace {

Result<CertificateFacts> factsOf(X509* certificate) {
  CertificateFacts facts;
  std::array<char, 256> name{};
  if (X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName, name.data(),
                                static_cast<int>(name.size())) > 0)
    facts.subject = name.data();
  facts.hosts = hostsOf(certificate);
  facts.may_sign = permittedText(certificate);
  facts.not_before_unix_s = unixSeconds(X509_get0_notBefore(certificate));
  facts.not_after_unix_s = unixSeconds(X509_get0_notAfter(certificate));
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  if (X509_digest(certificate, EVP_sha256(), digest.data(), &length) != 1)
    return opensslError("hashing a certificate");
  constexpr std::string_view kHex = "0123456789abcdef";
  for (unsigned i = 0; i < length; ++i) {
    facts.sha256 += kHex[digest[i] >> 4];
    facts.sha256 += kHex[digest[i] & 15];
  }
  return facts;
}

}  // namespace

Result<std::vector<CertificateFacts>> readCertificates(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const auto certificates, x509::loadCertificates(path));
  std::vector<CertificateFacts> all;
  for (const auto& certificate : certificates) {
    ASSIGN_OR_RETURN(auto facts, factsOf(certificate.get()));
    all.push_back(std::move(facts));
  }
  return all;
}

Result<CertificateFacts> shownCertificate(const TlsContext& server) {
  X509* const certificate = SSL_CTX_get0_certificate(server->native_handle());
  if (certificate == nullptr) return Error{ErrorCode::kInvalidInput, "the TLS context has no certificate"};
  return factsOf(certificate);
}

Result<CertificateFacts> readCertificate(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(auto all, readCertificates(path));
  return std::move(all.front());
}

}  // namespace needlelab
