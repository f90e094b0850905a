#include "common/wire/tls_engine.h"

#include <openssl/bio.h>
#include <openssl/err.h>

#include <algorithm>
#include <cassert>

namespace needlelab {
namespace {

constexpr std::size_t kKeptOutput = 64u << 10;  // above, memory is given back when all is sent
constexpr std::size_t kMostOutput = 4u
                                    << 20;  // a peer that makes TLS answer without end (key updates) is cut

/// Errors that another user of this thread left behind would be taken for ours.
void forgetErrors() {
  if (ERR_peek_error() != 0) ERR_clear_error();
}

}  // namespace

struct TlsEngine::Bio {
  static TlsEngine& of(BIO* bio) { return *static_cast<TlsEngine*>(BIO_get_data(bio)); }

  static int write(BIO* bio, const char* data, std::size_t size, std::size_t* written) {
    TlsEngine& engine = of(bio);
    if (engine.output_.size() + size > kMostOutput) return 0;
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
  // 34 KiB stay with the connection; else they would be allocated and freed with each message
  SSL_clear_mode(ssl, SSL_MODE_RELEASE_BUFFERS);
}

TlsEngine::~TlsEngine() = default;

TlsStep TlsEngine::stepOf(int result) {
  switch (SSL_get_error(ssl_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return TlsStep::kWantsInput;
    case SSL_ERROR_ZERO_RETURN:
      return TlsStep::kEnded;
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
