/// OpenSSL's certificates and keys as C++ values: PEM files, drafts, extensions. For certificates.cpp and
/// authority.cpp.
#pragma once

#include <openssl/asn1.h>
#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab::x509 {

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
using GeneralNames = std::unique_ptr<GENERAL_NAMES, Deleter<&GENERAL_NAMES_free>>;
using NameConstraints = std::unique_ptr<NAME_CONSTRAINTS, Deleter<&NAME_CONSTRAINTS_free>>;

/// A kFailed error with OpenSSL's last error.
Error opensslError(const std::string& doing);

bool isAddress(const std::string& host);

/// Reads every certificate of a PEM file, at least one, or the one of a DER file. Errors: kInvalidInput with
/// the file.
Result<std::vector<Certificate>> loadCertificates(const std::filesystem::path& path);
/// Reads the first certificate of a file.
Result<Certificate> loadCertificate(const std::filesystem::path& path);
/// Errors: kInvalidInput with the file.
Result<Key> loadKey(const std::filesystem::path& path);
/// Writes the key with mode 0600.
Status saveKey(const std::filesystem::path& path, EVP_PKEY* key);
/// Writes the certificates in this order, with mode 0644.
Status saveCertificates(const std::filesystem::path& path, const std::vector<X509*>& certificates);

/// A new EC P-256 key; null when OpenSSL fails.
Key newKey();
/// The common part of all certificates: serial number, O=needlelab, CN, the key, valid from an hour ago for
/// `days`. Extensions, issuer and signature follow.
Result<Certificate> draft(EVP_PKEY* key, const std::string& common_name, long days);
bool addExtension(X509* certificate, X509* issuer, int nid, const std::string& value);

/// The alternative names for `hosts` in OpenSSL's configuration syntax: "DNS:lab.example,IP:10.0.0.1".
std::string alternativeNames(const std::vector<std::string>& hosts);
/// The names and addresses of a certificate.
std::vector<std::string> hostsOf(const X509* certificate);

/// Seconds since 1970; 0 for a time that OpenSSL cannot read.
std::int64_t unixSeconds(const ASN1_TIME* time);

}  // namespace needlelab::x509
