#include "wire/certificates.h"

#include <array>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <memory>
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

#include "base/atomic_file.h"

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
  auto text = readWholeFile(path, 1u << 20);
  if (!text.ok()) return text.error();
  const Bio bio(BIO_new_mem_buf(text->data(), static_cast<int>(text->size())));
  Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  if (!certificate) return Error{ErrorCode::kInvalidInput, path.string() + " holds no certificate (PEM)"};
  return certificate;
}

Result<Key> loadKey(const std::filesystem::path& path) {
  auto text = readWholeFile(path, 1u << 20);
  if (!text.ok()) return text.error();
  const Bio bio(BIO_new_mem_buf(text->data(), static_cast<int>(text->size())));
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

/// All that CA and server have in common; the extensions and the signature are still missing.
Result<Certificate> draft(EVP_PKEY* key, const std::string& common_name, long days) {
  Certificate certificate(X509_new());
  if (!certificate || X509_set_version(certificate.get(), X509_VERSION_3) != 1 ||
      !setSerial(certificate.get())) {
    return opensslError("making a certificate");
  }
  // an hour back, for clocks that are not quite right
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

/// What EVP_EC_gen does, whose macro casts a const away.
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
  auto made = draft(key.get(), "needlelab private CA", kCaDays);
  if (!made.ok()) return made.error();
  X509* const ca = made->get();
  if (X509_set_issuer_name(ca, X509_get_subject_name(ca)) != 1 ||
      !addExtension(ca, ca, NID_basic_constraints, "critical,CA:TRUE,pathlen:0") ||
      !addExtension(ca, ca, NID_key_usage, "critical,keyCertSign,cRLSign") ||
      !addExtension(ca, ca, NID_subject_key_identifier, "hash") ||
      X509_sign(ca, key.get(), EVP_sha256()) == 0) {
    return opensslError("making the CA's certificate");
  }
  // the key first: a certificate that was given out always has its key
  if (auto saved = saveKey(files.ca_key, key.get()); !saved.ok()) return saved.error();
  if (auto saved = saveCertificate(files.ca_certificate, ca); !saved.ok()) return saved.error();
  return Authority{std::move(*made), std::move(key)};
}

Status makeServer(const TlsFiles& files, const Authority& authority, const std::vector<std::string>& hosts) {
  const Key key(newKey());
  if (!key) return opensslError("making the server's key");
  auto made = draft(key.get(), hosts.front(), kServerDays);
  if (!made.ok()) return made.error();
  X509* const server = made->get();
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
  if (auto saved = saveKey(files.key, key.get()); !saved.ok()) return saved;
  return saveCertificate(files.certificate, server);
}

/// Is what lies there still good: the key fits, our CA signed it, it lasts, and every host is in it?
bool serverIsGood(const TlsFiles& files, X509* ca, const std::vector<std::string>& hosts) {
  const auto certificate = loadCertificate(files.certificate);
  const auto key = loadKey(files.key);
  if (!certificate.ok() || !key.ok()) return false;
  X509* const server = certificate->get();
  std::time_t renew = std::time(nullptr) + kRenewDays * kDay;
  if (X509_check_private_key(server, key->get()) != 1 || X509_verify(server, X509_get0_pubkey(ca)) != 1 ||
      X509_cmp_time(X509_get0_notAfter(server), &renew) <= 0) {
    return false;
  }
  for (const std::string& host : hosts) {
    const int found = isAddress(host) ? X509_check_ip_asc(server, host.c_str(), 0)
                                      : X509_check_host(server, host.c_str(), host.size(), 0, nullptr);
    if (found != 1) return false;
  }
  return true;
}

}  // namespace

TlsFiles tlsFilesIn(const std::filesystem::path& folder) {
  return {folder / "ca.crt", folder / "ca.key", folder / "server.crt", folder / "server.key"};
}

Result<bool> ensureTlsFiles(const TlsFiles& files, const std::vector<std::string>& hosts) {
  if (hosts.empty()) return Error{ErrorCode::kInvalidInput, "a server's certificate needs a host name"};
  for (const std::string& host : hosts) {
    if (host.empty() || host.find_first_of(",: \n") != std::string::npos) {
      if (!isAddress(host))
        return Error{ErrorCode::kInvalidInput, "'" + host + "' is no host name or IP address"};
    }
  }
  std::error_code failed;
  std::filesystem::create_directories(files.ca_certificate.parent_path(), failed);
  if (failed) {
    return Error{ErrorCode::kFailed,
                 "cannot make " + files.ca_certificate.parent_path().string() + ": " + failed.message()};
  }

  const bool has_ca = std::filesystem::exists(files.ca_certificate, failed);
  if (failed) {
    return Error{ErrorCode::kFailed,
                 "cannot look at " + files.ca_certificate.string() + ": " + failed.message()};
  }
  if (!has_ca) {
    auto authority = makeAuthority(files);
    if (!authority.ok()) return authority.error();
    if (auto made = makeServer(files, *authority, hosts); !made.ok()) return made.error();
    return true;
  }
  auto certificate = loadCertificate(files.ca_certificate);
  if (!certificate.ok()) return certificate.error();
  if (serverIsGood(files, certificate->get(), hosts)) return false;
  // the CA's key is needed only now; who keeps it elsewhere puts it back for this
  auto key = loadKey(files.ca_key);
  if (!key.ok())
    return Error{key.error().code, "a new server certificate needs the CA's key: " + key.error().message};
  const Authority authority{std::move(*certificate), std::move(*key)};
  if (auto made = makeServer(files, authority, hosts); !made.ok()) return made.error();
  return true;
}

}  // namespace needlelab
