#include "common/wire/certificates.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string_view>
#include <system_error>

#include <openssl/bio.h>
#include <openssl/bn.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>
#include <boost/asio/ip/address.hpp>

#include "common/base/files.h"
#include "common/base/local_time.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

template <auto Free>
struct Deleter {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
using Key = std::unique_ptr<EVP_PKEY, Deleter<&EVP_PKEY_free>>;
using Certificate = std::unique_ptr<X509, Deleter<&X509_free>>;
using Bio = std::unique_ptr<BIO, Deleter<&BIO_free_all>>;
using Number = std::unique_ptr<BIGNUM, Deleter<&BN_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Deleter<&X509_EXTENSION_free>>;

constexpr long kDay = 24 * 3600;
constexpr long kCaDays = 20 * 365, kServerDays = 2 * 365, kRenewDays = 30;

Error opensslError(const std::string& doing) {
  std::array<char, 256> text{};
  ERR_error_string_n(ERR_get_error(), text.data(), text.size());
  return {ErrorCode::kFailed, doing + " failed: " + text.data()};
}

bool isAddress(const std::string& host) {
  boost::system::error_code error;
  boost::asio::ip::make_address(host, error);
  return !error;
}

std::string textOfBio(BIO* bio) {
  BUF_MEM* memory = nullptr;
  BIO_get_mem_ptr(bio, &memory);
  return {memory->data, memory->length};
}

Result<Certificate> loadCertificate(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(auto text, readWholeFile(path, 1u << 20));
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  if (!certificate) return Error{ErrorCode::kInvalidInput, path.string() + " holds no certificate (PEM)"};
  return certificate;
}

Result<Key> loadKey(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(auto text, readWholeFile(path, 1u << 20));
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  Key key(PEM_read_bio_PrivateKey(bio.get(), nullptr, nullptr, nullptr));
  if (!key)
    return Error{ErrorCode::kInvalidInput, path.string() + " holds no private key (PEM without a password)"};
  return key;
}

Status saveKey(const std::filesystem::path& path, EVP_PKEY* key) {
  const Bio bio(BIO_new(BIO_s_mem()));
  if (PEM_write_bio_PKCS8PrivateKey(bio.get(), key, nullptr, nullptr, 0, nullptr, nullptr) != 1) {
    return opensslError("encoding a key");
  }
  return writeFileAtomically(path, viewOf(textOfBio(bio.get())), 0600);
}

Status saveCertificate(const std::filesystem::path& path, X509* certificate) {
  const Bio bio(BIO_new(BIO_s_mem()));
  if (PEM_write_bio_X509(bio.get(), certificate) != 1) return opensslError("encoding a certificate");
  return writeFileAtomically(path, viewOf(textOfBio(bio.get())), 0644);
}

bool addExtension(X509* certificate, X509* issuer, int nid, const std::string& value) {
  X509V3_CTX context{};
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str()));
  return extension && X509_add_ext(certificate, extension.get(), -1) == 1;
}

bool setSerial(X509* certificate) {
  std::array<std::uint8_t, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) return false;
  bytes[0] &= 0x7f;  // positive
  const Number number(BN_bin2bn(bytes.data(), static_cast<int>(bytes.size()), nullptr));
  return number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)) != nullptr;
}

/// The common part of CA and server certificates; the extensions and the signature are added later.
Result<Certificate> draft(EVP_PKEY* key, const std::string& common_name, long days) {
  Certificate certificate(X509_new());
  if (!certificate || X509_set_version(certificate.get(), X509_VERSION_3) != 1 ||
      !setSerial(certificate.get())) {
    return opensslError("making a certificate");
  }
  // valid since an hour ago, for inaccurate clocks
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -3600);
  X509_time_adj_ex(X509_getm_notAfter(certificate.get()), static_cast<int>(days), 0, nullptr);
  X509_NAME* const name = X509_get_subject_name(certificate.get());
  const auto add = [&](const char* field, const std::string& text) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(text.c_str());
    return X509_NAME_add_entry_by_txt(name, field, MBSTRING_UTF8, bytes, -1, -1, 0) == 1;
  };
  if (!add("O", "needlelab") || !add("CN", common_name) || X509_set_pubkey(certificate.get(), key) != 1) {
    return opensslError("making a certificate");
  }
  return certificate;
}

/// Same as EVP_EC_gen; that macro casts a const away.
EVP_PKEY* newKey() {
  return EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256");
}

struct Authority {
  Certificate certificate;
  Key key;
};

Result<Authority> makeAuthority(const TlsFiles& files) {
  Key key(newKey());
  if (!key) return opensslError("making the CA's key");
  ASSIGN_OR_RETURN(auto made, draft(key.get(), "needlelab private CA", kCaDays));
  X509* const ca = made.get();
  if (X509_set_issuer_name(ca, X509_get_subject_name(ca)) != 1 ||
      !addExtension(ca, ca, NID_basic_constraints, "critical,CA:TRUE,pathlen:0") ||
      !addExtension(ca, ca, NID_key_usage, "critical,keyCertSign,cRLSign") ||
      !addExtension(ca, ca, NID_subject_key_identifier, "hash") ||
      X509_sign(ca, key.get(), EVP_sha256()) == 0) {
    return opensslError("making the CA's certificate");
  }
  // write the key first: a published certificate always has its key
  RETURN_IF_ERROR(saveKey(files.ca_key, key.get()));
  RETURN_IF_ERROR(saveCertificate(files.ca_certificate, ca));
  return Authority{std::move(made), std::move(key)};
}

Status makeServer(const TlsFiles& files, const Authority& authority, const std::vector<std::string>& hosts) {
  const Key key(newKey());
  if (!key) return opensslError("making the server's key");
  ASSIGN_OR_RETURN(auto made, draft(key.get(), hosts.front(), kServerDays));
  X509* const server = made.get();
  X509* const ca = authority.certificate.get();
  std::string names;
  for (const std::string& host : hosts)
    names += (names.empty() ? "" : ",") + (isAddress(host) ? "IP:" + host : "DNS:" + host);
  if (X509_set_issuer_name(server, X509_get_subject_name(ca)) != 1 ||
      !addExtension(server, ca, NID_basic_constraints, "critical,CA:FALSE") ||
      !addExtension(server, ca, NID_key_usage, "critical,digitalSignature") ||
      !addExtension(server, ca, NID_ext_key_usage, "serverAuth") ||
      !addExtension(server, ca, NID_subject_alt_name, names) ||
      !addExtension(server, ca, NID_authority_key_identifier, "keyid") ||
      X509_sign(server, authority.key.get(), EVP_sha256()) == 0) {
    return opensslError("making the server's certificate for " + names);
  }
  RETURN_IF_ERROR(saveKey(files.key, key.get()));
  return saveCertificate(files.certificate, server);
}

std::int64_t unixSeconds(const ASN1_TIME* time) {
  std::tm parts{};
  return ASN1_TIME_to_tm(time, &parts) == 1 ? static_cast<std::int64_t>(::timegm(&parts)) : 0;
}

std::string dayText(const ASN1_TIME* time) {
  const std::int64_t seconds = unixSeconds(time);
  return seconds == 0 ? "an unknown day" : localTime(seconds * 1'000'000'000, TimeForm::kZoned);
}

/// The names and addresses of a certificate.
std::vector<std::string> hostsOf(X509* certificate) {
  std::vector<std::string> hosts;
  const std::unique_ptr<GENERAL_NAMES, Deleter<&GENERAL_NAMES_free>> names(
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr)));
  for (int i = 0; names && i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(names.get(), i);
    if (name->type == GEN_DNS) {
      hosts.emplace_back(reinterpret_cast<const char*>(ASN1_STRING_get0_data(name->d.dNSName)),
                         static_cast<std::size_t>(ASN1_STRING_length(name->d.dNSName)));
    } else if (name->type == GEN_IPADD) {
      const auto* bytes = ASN1_STRING_get0_data(name->d.iPAddress);
      if (ASN1_STRING_length(name->d.iPAddress) == 4) {
        boost::asio::ip::address_v4::bytes_type v4{};
        std::copy_n(bytes, v4.size(), v4.begin());
        hosts.push_back(boost::asio::ip::make_address_v4(v4).to_string());
      } else if (ASN1_STRING_length(name->d.iPAddress) == 16) {
        boost::asio::ip::address_v6::bytes_type v6{};
        std::copy_n(bytes, v6.size(), v6.begin());
        hosts.push_back(boost::asio::ip::make_address_v6(v6).to_string());
      }
    }
  }
  return hosts;
}

/// The fault of the stored certificate, in words; empty if it is valid: the key matches, our CA signed it, it
/// does not expire soon, and it has every host.
std::string serverFault(const TlsFiles& files, X509* ca, const std::vector<std::string>& hosts) {
  const auto certificate = loadCertificate(files.certificate);
  if (!certificate.ok()) return certificate.error().message;
  const auto key = loadKey(files.key);
  if (!key.ok()) return key.error().message;
  X509* const server = certificate->get();
  const std::string name = files.certificate.string();
  if (X509_check_private_key(server, key->get()) != 1)
    return name + " and " + files.key.string() + " do not fit each other";
  if (X509_verify(server, X509_get0_pubkey(ca)) != 1)
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

Status checkHosts(const std::vector<std::string>& hosts) {
  if (hosts.empty()) return Error{ErrorCode::kInvalidInput, "a server's certificate needs a host name"};
  for (const std::string& host : hosts) {
    if (host.empty() || host.find_first_of(",: \n") != std::string::npos) {
      if (!isAddress(host))
        return Error{ErrorCode::kInvalidInput, "'" + host + "' is no host name or IP address"};
    }
  }
  return {};
}

/// Each name once: DNS names differ in more than case, and an address has one form ("::1").
std::vector<std::string> eachOnce(const std::vector<std::string>& hosts) {
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

/// `hosts`, and those of the stored certificate: a name that stations use for the server must not be lost.
std::vector<std::string> withOldHosts(const TlsFiles& files, std::vector<std::string> hosts) {
  const auto old = loadCertificate(files.certificate);
  if (old.ok())
    for (const std::string& host : hostsOf(old->get())) hosts.push_back(host);
  return eachOnce(hosts);
}

Result<Authority> loadAuthority(const TlsFiles& files) {
  ASSIGN_OR_RETURN(auto certificate, loadCertificate(files.ca_certificate));
  auto key = loadKey(files.ca_key);
  if (!key.ok())
    return Error{key.error().code, "a new server certificate needs the CA's key: " + key.error().message +
                                       "; put it back for the time of this start"};
  if (X509_check_private_key(certificate.get(), key->get()) != 1)
    return Error{ErrorCode::kInvalidInput,
                 files.ca_certificate.string() + " and " + files.ca_key.string() +
                     " do not fit each other: put back the two that were made together"};
  return Authority{std::move(certificate), std::move(*key)};
}

}  // namespace

TlsFiles tlsFilesIn(const std::filesystem::path& folder) {
  return {folder / "ca.crt", folder / "ca.key", folder / "server.crt", folder / "server.key"};
}

Result<bool> ensureTlsFiles(const TlsFiles& files, const std::vector<std::string>& hosts) {
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

  // a key restored with the usual permissions is readable by everybody
  for (const auto& key : {files.ca_key, files.key}) {
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
    ASSIGN_OR_RETURN(auto authority, makeAuthority(files));
    RETURN_IF_ERROR(makeServer(files, authority, eachOnce(hosts)));
    return true;
  }
  ASSIGN_OR_RETURN(auto certificate, loadCertificate(files.ca_certificate));
  const std::string fault = serverFault(files, certificate.get(), hosts);
  if (fault.empty()) return false;
  // the CA's key is needed only now; if it is kept elsewhere, it must be restored for this
  const auto authority = loadAuthority(files);
  if (!authority.ok()) return Error{authority.error().code, fault + "; " + authority.error().message};
  RETURN_IF_ERROR(makeServer(files, *authority, withOldHosts(files, hosts)));
  return true;
}

Status renewServerCertificate(const TlsFiles& files, const std::vector<std::string>& hosts) {
  const auto all = withOldHosts(files, hosts);
  RETURN_IF_ERROR(checkHosts(all));
  ASSIGN_OR_RETURN(const auto authority, loadAuthority(files));
  return makeServer(files, authority, all);
}

Result<CertificateFacts> readCertificate(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const auto certificate, loadCertificate(path));
  X509* const x509 = certificate.get();
  CertificateFacts facts;
  std::array<char, 256> name{};
  if (X509_NAME_get_text_by_NID(X509_get_subject_name(x509), NID_commonName, name.data(),
                                static_cast<int>(name.size())) > 0)
    facts.subject = name.data();
  facts.hosts = hostsOf(x509);
  facts.not_before_unix_s = unixSeconds(X509_get0_notBefore(x509));
  facts.not_after_unix_s = unixSeconds(X509_get0_notAfter(x509));
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  if (X509_digest(x509, EVP_sha256(), digest.data(), &length) != 1)
    return opensslError("hashing a certificate");
  constexpr std::string_view kHex = "0123456789abcdef";
  for (unsigned i = 0; i < length; ++i) {
    facts.sha256 += kHex[digest[i] >> 4];
    facts.sha256 += kHex[digest[i] & 15];
  }
  return facts;
}

}  // namespace needlelab
