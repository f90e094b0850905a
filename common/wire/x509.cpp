#include "common/wire/x509.h"

#include <openssl/bn.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/rand.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <ctime>

#include "common/base/files/files.h"

namespace needlelab::x509 {
namespace {

using Number = std::unique_ptr<BIGNUM, Deleter<&BN_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Deleter<&X509_EXTENSION_free>>;

std::string textOfBio(BIO* bio) {
  BUF_MEM* memory = nullptr;
  BIO_get_mem_ptr(bio, &memory);
  return {memory->data, memory->length};
}

bool setSerial(X509* certificate) {
  std::array<std::uint8_t, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) return false;
  bytes[0] &= 0x7f;  // positive
  const Number number(BN_bin2bn(bytes.data(), static_cast<int>(bytes.size()), nullptr));
  return number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate)) != nullptr;
}

}  // namespace

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

Result<std::vector<Certificate>> loadCertificates(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(auto text, readWholeFile(path, 1u << 20));
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  std::vector<Certificate> certificates;
  while (Certificate next{PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr)})
    certificates.push_back(std::move(next));
  if (certificates.empty()) {  // DER, as browsers save a certificate
    const Bio der(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
    if (Certificate one{d2i_X509_bio(der.get(), nullptr)}) certificates.push_back(std::move(one));
  }
  ERR_clear_error();  // the end of the file
  if (certificates.empty())
    return Error{ErrorCode::kInvalidInput, path.string() + " holds no certificate (PEM or DER)"};
  return certificates;
}

Result<Certificate> loadCertificate(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(auto certificates, loadCertificates(path));
  return std::move(certificates.front());
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

Status saveCertificates(const std::filesystem::path& path, const std::vector<X509*>& certificates) {
  const Bio bio(BIO_new(BIO_s_mem()));
  for (X509* const certificate : certificates)
    if (PEM_write_bio_X509(bio.get(), certificate) != 1) return opensslError("encoding a certificate");
  return writeFileAtomically(path, viewOf(textOfBio(bio.get())), 0644);
}

// Same as EVP_EC_gen, whose macro casts a const away.
Key newKey() {
  return Key(EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256"));
}

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

bool addExtension(X509* certificate, X509* issuer, int nid, const std::string& value) {
  X509V3_CTX context{};
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str()));
  return extension && X509_add_ext(certificate, extension.get(), -1) == 1;
}

std::string alternativeNames(const std::vector<std::string>& hosts) {
  std::string names;
  for (const std::string& host : hosts)
    names += (names.empty() ? "" : ",") + (isAddress(host) ? "IP:" + host : "DNS:" + host);
  return names;
}

std::vector<std::string> hostsOf(const X509* certificate) {
  std::vector<std::string> hosts;
  const GeneralNames names(
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

std::int64_t unixSeconds(const ASN1_TIME* time) {
  std::tm parts{};
  return ASN1_TIME_to_tm(time, &parts) == 1 ? static_cast<std::int64_t>(::timegm(&parts)) : 0;
}

}  // namespace needlelab::x509
