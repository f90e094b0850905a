#include "common/wire/tls.h"

#include <openssl/bio.h>
#include <openssl/crypto.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <cassert>
#include <filesystem>
#include <memory>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/x509.h"

#if defined(__aarch64__)
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif

namespace needlelab {
namespace {

/// Both ciphers are safe; which is cheaper depends on whether the processor has AES instructions.
bool hasAesInstructions() {
#if defined(__x86_64__) || defined(__i386__)
  return __builtin_cpu_supports("aes") != 0 && __builtin_cpu_supports("pclmul") != 0;
#elif defined(__aarch64__)
  return (::getauxval(AT_HWCAP) & HWCAP_AES) != 0;
#else
  return false;
#endif
}

/// The bytes that a connection has carried, the number of its peer's key changes, and the length of the
/// peer's handshake.
struct KeyUse {
  std::uint64_t bytes = 0;  // of records, in both directions
  std::uint64_t updates = 0;
  std::uint64_t handshake_bytes = 0;  // of the peer's records until the handshake is done, including headers
  /// Why TLS reads nothing more from the peer; nullptr if it still reads.
  [[nodiscard]] const char* fault() const {
    if (handshake_bytes > kMaxHandshakeBytes) return "the peer's handshake is too long";
    if (updates > kMaxKeyUpdates + bytes / kBytesOfKeys) return "the peer changes its keys too often";
    return nullptr;
  }
};

/// The index at which every SSL made after the first call stores its KeyUse. One for the program.
int keyUseIndex() {
  static const int index = SSL_get_ex_new_index(
      0, nullptr,
      [](void*, void*, CRYPTO_EX_DATA* data, int at, long, void*) {
        auto use = std::make_unique<KeyUse>();
        if (CRYPTO_set_ex_data(data, at, use.get()) == 1) (void)use.release();
      },
      nullptr, [](void*, void* use, CRYPTO_EX_DATA*, int, long, void*) { delete static_cast<KeyUse*>(use); });
  return index;
}

KeyUse* keyUseOf(const SSL* ssl) {
  return static_cast<KeyUse*>(SSL_get_ex_data(ssl, keyUseIndex()));
}

/// OpenSSL calls this for each record's header and for each message of a handshake. A KeyUpdate takes 27
/// bytes and forces new keys, and one SSL_read processes all that have arrived; a handshake may come in
/// records of one byte. Beyond the limits, TLS stops reading, as if the peer had ended its data.
void countKeyUse(int is_sent, int /*version*/, int type, const void* bytes, std::size_t size, SSL* ssl,
                 void* /*argument*/) {
  KeyUse* const use = keyUseOf(ssl);
  const auto* const seen = static_cast<const std::uint8_t*>(bytes);
  if (use == nullptr) return;
  if (type == SSL3_RT_HEADER && size == SSL3_RT_HEADER_LENGTH) {
    const auto record_bytes = static_cast<std::uint64_t>(seen[3] << 8 | seen[4]);
    use->bytes += record_bytes;
    if (SSL_is_init_finished(ssl) == 1)
      use->handshake_bytes = 0;
    else if (is_sent == 0)
      use->handshake_bytes += size + record_bytes;
  }
  if (is_sent == 0 && type == SSL3_RT_HANDSHAKE && size > 0 && seen[0] == SSL3_MT_KEY_UPDATE) ++use->updates;
  if (use->fault() != nullptr) SSL_set_shutdown(ssl, SSL_get_shutdown(ssl) | SSL_RECEIVED_SHUTDOWN);
}

Result<TlsContext> newContext(asio::ssl::context::method method) {
  auto context = std::make_shared<asio::ssl::context>(method);
  SSL_CTX* const raw = context->native_handle();
  if (SSL_CTX_set_min_proto_version(raw, TLS1_3_VERSION) != 1 ||
      SSL_CTX_set_max_proto_version(raw, TLS1_3_VERSION) != 1) {
    return Error{ErrorCode::kFailed, "this OpenSSL does not speak TLS 1.3"};
  }
  // AES-128 if the processor has AES instructions: cheapest for a live frame's record, and unbroken
  const char* const suites =
      hasAesInstructions() ? "TLS_AES_128_GCM_SHA256:TLS_AES_256_GCM_SHA384:TLS_CHACHA20_POLY1305_SHA256"
                           : "TLS_CHACHA20_POLY1305_SHA256:TLS_AES_128_GCM_SHA256:TLS_AES_256_GCM_SHA384";
  if (SSL_CTX_set_ciphersuites(raw, suites) != 1) {
    return Error{ErrorCode::kFailed, std::string("this OpenSSL does not know the cipher suites ") + suites};
  }
  // no finite fields: an exchange with ffdhe8192 costs hundreds of times as much as with X25519, and
  // strangers can request it
  char groups[] = "X25519:P-256:P-384";
  if (SSL_CTX_ctrl(raw, SSL_CTRL_SET_GROUPS_LIST, 0, groups) != 1)
    return Error{ErrorCode::kFailed, "this OpenSSL does not know the groups X25519, P-256 and P-384"};
  // no session tickets: no client resumes, and they would cost memory and bytes per connection
  SSL_CTX_set_num_tickets(raw, 0);
  SSL_CTX_set_session_cache_mode(raw, SSL_SESS_CACHE_OFF);
  // both are defaults; set explicitly because our safety depends on them: early data could be replayed
  SSL_CTX_set_max_early_data(raw, 0);
  SSL_CTX_set_options(raw, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_TICKET | SSL_OP_NO_COMPRESSION);
  (void)keyUseIndex();  // before the first SSL
  SSL_CTX_set_msg_callback(raw, countKeyUse);
  return context;
}

Error fileError(const std::string& what, const std::filesystem::path& path,
                const boost::system::error_code& error) {
  return {ErrorCode::kInvalidInput, "cannot use " + what + " " + path.string() + ": " + error.message()};
}

constexpr std::size_t kKeptOutput = 64u << 10;  // above this, memory is released when everything is sent
constexpr std::size_t kMaxOutput = 4u << 20;  // limit for a peer that makes TLS reply endlessly (key updates)

/// Clears errors that other code left on this thread, which we would mistake for ours.
void forgetErrors() {
  if (ERR_peek_error() != 0) ERR_clear_error();
}

}  // namespace

void keepTlsAtExit() {
  OPENSSL_init_crypto(OPENSSL_INIT_NO_ATEXIT, nullptr);
}

Result<TlsContext> makeServerTls(const std::filesystem::path& certificate, const std::filesystem::path& key) {
  auto context = newContext(asio::ssl::context::tls_server);
  if (!context) return context;
  boost::system::error_code error;
  (*context)->use_certificate_chain_file(certificate.string(), error);
  if (error) return fileError("the server's certificate", certificate, error);
  (*context)->use_private_key_file(key.string(), asio::ssl::context::pem, error);
  if (error) return fileError("the server's key", key, error);
  return context;
}

Result<TlsContext> makeClientTls(const std::filesystem::path& ca) {
  auto context = newContext(asio::ssl::context::tls_client);
  if (!context) return context;
  boost::system::error_code error;
  X509_STORE* const store = SSL_CTX_get_cert_store((*context)->native_handle());
  ASSIGN_OR_RETURN(const auto certificates, x509::loadCertificates(ca));
  for (const auto& certificate : certificates)
    if (X509_STORE_add_cert(store, certificate.get()) != 1)
      return x509::opensslError("using the CA's certificate");
  // OpenSSL parses a certificate's extensions on first use: force it now, before threads share the
  // certificate
  const STACK_OF(X509_OBJECT)* const known = X509_STORE_get0_objects(store);
  for (int i = 0; i < sk_X509_OBJECT_num(known); ++i)
    if (X509* const certificate = X509_OBJECT_get0_X509(sk_X509_OBJECT_value(known, i)))
      X509_check_purpose(certificate, -1, 0);
  (*context)->set_verify_mode(asio::ssl::verify_peer | asio::ssl::verify_fail_if_no_peer_cert, error);
  if (error) return fileError("the CA's certificate", ca, error);
  return context;
}

std::uint64_t keyUpdatesOf(const SSL* ssl) {
  const KeyUse* const use = keyUseOf(ssl);
  return use == nullptr ? 0 : use->updates;
}

Status requireHost(TlsStream& stream, const std::string& host) {
  SSL* const ssl = stream.native_handle();
  boost::system::error_code no_address;
  const auto address = asio::ip::make_address(host, no_address);
  bool ok = false;
  if (!no_address) {
    ok = X509_VERIFY_PARAM_set1_ip_asc(SSL_get0_param(ssl), address.to_string().c_str()) == 1;
  } else {
    SSL_set_hostflags(ssl, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
    // the macro SSL_set_tlsext_host_name casts away const, which our warnings forbid
    std::string name = host;
    ok = !host.empty() && SSL_set1_host(ssl, host.c_str()) == 1 &&
         SSL_ctrl(ssl, SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name, name.data()) == 1;
  }
  if (!ok) return Error{ErrorCode::kInvalidInput, "'" + host + "' is not a host name or IP address"};
  return {};
}

std::string tlsErrorText(const SSL* ssl, std::string text) {
  const long verified = SSL_get_verify_result(ssl);
  if (verified != X509_V_OK) text += std::string(" (") + X509_verify_cert_error_string(verified) + ")";
  if (verified == X509_V_ERR_CERT_NOT_YET_VALID || verified == X509_V_ERR_CERT_HAS_EXPIRED) {
    // a clock without a battery starts in 1970
    text += "; this machine's clock says " + localTime(wallNowNs(), TimeForm::kZoned) +
            ": if that is wrong, set it";
  }
  return text;
}

struct TlsEngine::Bio {
  static TlsEngine& of(BIO* bio) { return *static_cast<TlsEngine*>(BIO_get_data(bio)); }

  static int write(BIO* bio, const char* data, std::size_t size, std::size_t* written) {
    TlsEngine& engine = of(bio);
    if (engine.output_.size() + size > kMaxOutput) return 0;
    engine.output_.append(data, size);
    *written = size;
    return 1;
  }
  static int read(BIO* bio, char* data, std::size_t size, std::size_t* count) {
    BIO_clear_retry_flags(bio);
    ByteView& input = of(bio).input_;
    if (input.empty()) {
      BIO_set_retry_read(bio);
      return 0;
    }
    *count = std::min(size, input.size());
    std::copy_n(input.begin(), *count, reinterpret_cast<std::uint8_t*>(data));
    input = input.subspan(*count);
    return 1;
  }
  static long control(BIO*, int command, long, void*) { return command == BIO_CTRL_FLUSH ? 1 : 0; }
  static int create(BIO* bio) {
    BIO_set_init(bio, 1);
    return 1;
  }
  // one for the program, never freed
  static const BIO_METHOD* method() {
    static const BIO_METHOD* const made = [] {
      BIO_METHOD* const fresh = BIO_meth_new(BIO_get_new_index() | BIO_TYPE_SOURCE_SINK, "needlelab memory");
      BIO_meth_set_write_ex(fresh, write);
      BIO_meth_set_read_ex(fresh, read);
      BIO_meth_set_ctrl(fresh, control);
      BIO_meth_set_create(fresh, create);
      return fresh;
    }();
    return made;
  }
};

TlsEngine::TlsEngine(SSL* ssl) {
  SSL_up_ref(ssl);
  ssl_.reset(ssl);
  BIO* const bio = BIO_new(Bio::method());
  BIO_set_data(bio, this);
  SSL_set_bio(ssl, bio, bio);
  // keep 34 KiB per connection, which would otherwise be allocated and freed with each message
  SSL_clear_mode(ssl, SSL_MODE_RELEASE_BUFFERS);
}

TlsEngine::~TlsEngine() = default;

void TlsEngine::keepInput() {
  Bytes rest(input_.begin(), input_.end());
  kept_.swap(rest);
  input_ = kept_;
}

TlsStep TlsEngine::stepOf(int result) {
  switch (SSL_get_error(ssl_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return TlsStep::kWantsInput;
    case SSL_ERROR_ZERO_RETURN: {
      const KeyUse* const use = keyUseOf(ssl_.get());
      if (use == nullptr || use->fault() == nullptr) return TlsStep::kEnded;
      failure_ = use->fault();
      return TlsStep::kFailed;
    }
    default: {
      const unsigned long code = ERR_peek_error();
      const char* const reason = code != 0 ? ERR_reason_error_string(code) : nullptr;
      failure_ = reason != nullptr ? reason : "TLS failed";
      ERR_clear_error();
      return TlsStep::kFailed;
    }
  }
}

TlsStep TlsEngine::handshake(bool as_server) {
  forgetErrors();
  const int result = as_server ? SSL_accept(ssl_.get()) : SSL_connect(ssl_.get());
  return result == 1 ? TlsStep::kDone : stepOf(result);
}

TlsStep TlsEngine::read(std::span<std::uint8_t> room, std::size_t& count) {
  assert(!room.empty());
  forgetErrors();
  count = 0;
  const int result = SSL_read_ex(ssl_.get(), room.data(), room.size(), &count);
  return result == 1 ? TlsStep::kDone : stepOf(result);
}

TlsStep TlsEngine::write(std::string_view plain) {
  forgetErrors();
  while (!plain.empty()) {
    std::size_t count = 0;
    if (const int result = SSL_write_ex(ssl_.get(), plain.data(), plain.size(), &count); result != 1)
      return stepOf(result);
    plain.remove_prefix(count);
  }
  return TlsStep::kDone;
}

void TlsEngine::sent(std::size_t count) {
  assert(count <= output_.size() - sent_);
  sent_ += count;
  if (sent_ < output_.size()) return;
  sent_ = 0;
  output_.clear();
  if (output_.capacity() > kKeptOutput) output_.shrink_to_fit();
}

}  // namespace needlelab
