#include "db/backup/encrypted_backup.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "NLBACKUP";
constexpr std::uint32_t kFormat = 1;
/// Plain bytes per piece. Greater: fewer authenticators (17 bytes each), more memory.
constexpr std::uint32_t kPieceBytes = 64u << 10;
constexpr std::uint32_t kMinPieceBytes = 4u << 10;
constexpr std::uint32_t kMaxPieceBytes = 1u << 20;
constexpr std::size_t kTagBytes = crypto_secretstream_xchacha20poly1305_ABYTES;
/// Magic, format, piece size, key id; authenticated with each piece.
constexpr std::size_t kPreambleBytes = 8 + 4 + 4 + 16;
constexpr std::size_t kHeaderBytes = kPreambleBytes + crypto_secretstream_xchacha20poly1305_HEADERBYTES;
static_assert(kHeaderBytes == 56 && kTagBytes == 17, "as db/README.md says");
static_assert(BackupKey::kBytes == crypto_kdf_KEYBYTES &&
              BackupKey::kBytes == crypto_secretstream_xchacha20poly1305_KEYBYTES);

/// The cipher's state holds the key.
struct Stream {
  Stream() = default;
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream() { sodium_memzero(&state, sizeof state); }
  crypto_secretstream_xchacha20poly1305_state state{};
};

class Hash {
 public:
  Hash() { crypto_generichash_init(&state_, nullptr, 0, PlainHash().size()); }
  void add(ByteView bytes) { crypto_generichash_update(&state_, bytes.data(), bytes.size()); }
  [[nodiscard]] PlainHash result() {
    PlainHash hash{};
    crypto_generichash_final(&state_, hash.data(), hash.size());
    return hash;
  }

 private:
  crypto_generichash_state state_{};
};

Status ready() {
  if (sodium_init() < 0) return Error{ErrorCode::kFailed, "the system has no source of random numbers"};
  return {};
}

Status checkNotCancelled(const std::atomic<bool>* cancelled) {
  if (cancelled == nullptr || !cancelled->load()) return {};
  return Error{ErrorCode::kUnavailable, "the backup was given up because the program ends: make it again"};
}

Bytes preambleOf(const BackupKey& key) {
  Bytes bytes;
  ByteWriter writer(bytes);
  writer.put(viewOf(kMagic));
  writer.put(kFormat);
  writer.put(kPieceBytes);
  writer.put(ByteView(key.id()));
  return bytes;
}

std::string idTextOf(ByteView id) {
  return hexDigitsOf(textOf(id.first(8)));
}

/// Whether systemd provided the file, readable only by the unit's user. Its mode contains ACL bits, which a
/// mode check would take for other users' access.
bool isCredential(const fs::path& file) {
  const char* const folder = std::getenv("CREDENTIALS_DIRECTORY");
  std::error_code error;
  return folder != nullptr && fs::equivalent(file.parent_path(), folder, error);
}

/// The checked bytes before the pieces.
struct Preamble {
  Bytes bytes;
  std::uint32_t piece_bytes = 0;
};
Result<Preamble> checkPreamble(ByteView header, const fs::path& path, const BackupKey& key) {
  const auto corrupt = [&](const std::string& text) {
    return Error{ErrorCode::kCorrupt, path.string() + ": " + text};
  };
  ByteReader reader(header);
  const auto magic = reader.take(kMagic.size());
  if (!reader.ok() || textOf(magic) != kMagic)
    return corrupt(
        "is not an encrypted backup, or its first bytes are damaged; a plain one is restored without --key");
  const auto format = reader.get<std::uint32_t>();
  const auto piece_bytes = reader.get<std::uint32_t>();
  const auto id = reader.take(BackupKey::Id().size());
  if (!reader.ok() || header.size() < kHeaderBytes)
    return corrupt(fmt::format("is cut off within its first {} bytes: take another backup", kHeaderBytes));
  if (format != kFormat)
    return Error{ErrorCode::kVersion,
                 fmt::format("{}: its format has version {}, this program (needlelab {}) knows {}: use the "
                             "newer program, or another backup if this one is damaged",
                             path.string(), format, programVersion(), kFormat)};
  if (piece_bytes < kMinPieceBytes || piece_bytes > kMaxPieceBytes)
    return corrupt(
        fmt::format("its pieces have {} bytes, {} to {} are possible: it is damaged, take another "
                    "backup",
                    piece_bytes, kMinPieceBytes, kMaxPieceBytes));
  if (!std::equal(id.begin(), id.end(), key.id().begin()))
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("{}: is encrypted with the key {}, the given one is {}: give the right key, or take "
                    "another backup if this one is damaged",
                    path.string(), idTextOf(id), key.idText())};
  return Preamble{Bytes(header.begin(), header.begin() + kPreambleBytes), piece_bytes};
}

}  // namespace

BackupKey::BackupKey(const std::array<std::uint8_t, kBytes>& key) {
  constexpr char kContext[crypto_kdf_CONTEXTBYTES + 1] = "nlbackup";
  crypto_kdf_derive_from_key(stream_key_.data(), stream_key_.size(), 1, kContext, key.data());
  crypto_kdf_derive_from_key(id_.data(), id_.size(), 2, kContext, key.data());
}

BackupKey::~BackupKey() {
  sodium_memzero(stream_key_.data(), stream_key_.size());
}

std::string BackupKey::idText() const {
  return idTextOf(id_);
}

Result<BackupKey> BackupKey::read(const fs::path& file) {
  RETURN_IF_ERROR(ready());
  const auto invalid = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, "backup key " + file.string() + ": " + why};
  };
  struct stat info {};
  if (::stat(file.c_str(), &info) == 0 && (info.st_mode & 0077) != 0 && !isCredential(file))
    return invalid("may be read by others: chmod 600 " + file.string());
  auto text = readWholeFile(file, 1000);
  if (!text) return Error{ErrorCode::kInvalidInput, "backup key " + text.error().message};
  const WipeAtEnd wipe_text(*text);
  std::string_view digits = withoutMark(*text);
  while (digits.ends_with('\n') || digits.ends_with('\r')) digits.remove_suffix(1);
  auto bytes = bytesOfHex(digits);
  if (!bytes || bytes->size() != kBytes)
    return invalid(
        fmt::format("has {} characters, a key is one line of {} digits 0-9, a-f; needlelab-admin "
                    "backup-key new FILE makes one",
                    digits.size(), 2 * kBytes));
  const WipeAtEnd wipe_bytes(*bytes);
  std::array<std::uint8_t, kBytes> key{};
  std::copy(bytes->begin(), bytes->end(), key.begin());
  BackupKey made(key);
  sodium_memzero(key.data(), key.size());
  return made;
}

Result<BackupKey> BackupKey::make(const fs::path& file) {
  RETURN_IF_ERROR(ready());
  std::array<std::uint8_t, kBytes> key{};
  randombytes_buf(key.data(), key.size());
  std::string text = hexDigitsOf(textOf(key)) + "\n";
  const WipeAtEnd wipe_text(text);
  BackupKey made(key);
  sodium_memzero(key.data(), key.size());
  {
    // never replace an existing file: losing a key loses its backups
    const OpenFile out(::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    if (!out.isOpen()) {
      if (errno == EEXIST)
        return Error{ErrorCode::kAlreadyExists,
                     file.string() + ": is there already; a key is never overwritten, its backups need it"};
      const bool no_folder = errno == ENOENT || errno == ENOTDIR;
      const Error error = systemError(file, "make");
      return Error{no_folder ? ErrorCode::kInvalidInput : error.code, error.message};
    }
    auto status = writeFully(out, file, viewOf(text));
    if (status.ok() && ::fsync(out.fd()) != 0) status = systemError(file, "fsync");
    if (!status) {
      ::unlink(file.c_str());
      return status.error();
    }
  }
  RETURN_IF_ERROR(syncFolder(file.has_parent_path() ? file.parent_path() : fs::path(".")));
  return made;
}

fs::path backupKeyFile(const fs::path& given) {
  if (!given.empty()) return given;
  const char* const folder = std::getenv("CREDENTIALS_DIRECTORY");
  if (folder == nullptr) return {};
  std::error_code error;
  const fs::path file = fs::path(folder) / "backup.key";
  return fs::exists(file, error) ? file : fs::path();
}

bool isEncryptedBackup(const fs::path& file) {
  const OpenFile in(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (!in.isOpen()) return false;
  std::array<std::uint8_t, kMagic.size()> start{};
  const auto got = readFully(in, file, start.data(), start.size());
  return got.ok() && *got == start.size() && textOf(start) == kMagic;
}

Result<PlainHash> encryptFile(const fs::path& plain, const fs::path& encrypted, const BackupKey& key,
                              const std::atomic<bool>* cancelled) {
  RETURN_IF_ERROR(ready());
  const OpenFile in(::open(plain.c_str(), O_RDONLY | O_CLOEXEC));
  if (!in.isOpen()) return systemError(plain, "read");
  const OpenFile out(::open(encrypted.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!out.isOpen()) return systemError(encrypted, "make");

  Stream stream;
  Bytes header = preambleOf(key);
  const Bytes preamble = header;
  header.resize(kHeaderBytes);
  crypto_secretstream_xchacha20poly1305_init_push(&stream.state, header.data() + kPreambleBytes,
                                                  key.streamKey().data());
  RETURN_IF_ERROR(writeFully(out, encrypted, header));

  Hash hash;
  // read one piece ahead, because the last one is marked as such
  Bytes piece(kPieceBytes), next(kPieceBytes), sealed(kPieceBytes + kTagBytes);
  ASSIGN_OR_RETURN(std::size_t count, readFully(in, plain, piece.data(), piece.size()));
  for (bool last = false; !last;) {
    RETURN_IF_ERROR(checkNotCancelled(cancelled));
    std::size_t following = 0;
    if (count == kPieceBytes) {
      ASSIGN_OR_RETURN(following, readFully(in, plain, next.data(), next.size()));
    }
    last = following == 0;
    hash.add(ByteView(piece).first(count));
    crypto_secretstream_xchacha20poly1305_push(&stream.state, sealed.data(), nullptr, piece.data(), count,
                                               preamble.data(), preamble.size(),
                                               last ? crypto_secretstream_xchacha20poly1305_TAG_FINAL
                                                    : crypto_secretstream_xchacha20poly1305_TAG_MESSAGE);
    RETURN_IF_ERROR(writeFully(out, encrypted, ByteView(sealed).first(count + kTagBytes)));
    piece.swap(next);
    count = following;
  }
  if (::fsync(out.fd()) != 0) return systemError(encrypted, "fsync");
  return hash.result();
}

Result<PlainHash> decryptFile(const fs::path& encrypted, const BackupKey& key,
                              const std::function<Status(ByteView)>& take,
                              const std::atomic<bool>* cancelled) {
  RETURN_IF_ERROR(ready());
  // O_NONBLOCK: there could be a pipe in the backup folder
  const OpenFile in(::open(encrypted.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (!in.isOpen()) return Error{ErrorCode::kInvalidInput, systemError(encrypted, "read").message};
  // read what was just written from the disk, not from the page cache
  ::posix_fadvise(in.fd(), 0, 0, POSIX_FADV_DONTNEED);

  Bytes header(kHeaderBytes);
  ASSIGN_OR_RETURN(const auto header_bytes, readFully(in, encrypted, header.data(), header.size()));
  header.resize(header_bytes);
  ASSIGN_OR_RETURN(const auto preamble, checkPreamble(header, encrypted, key));
  std::uint64_t at = kHeaderBytes;
  const auto refused = [&](const std::string& what) {
    return Error{ErrorCode::kCorrupt,
                 encrypted.string() + ": " + what + ": nothing of it is used, take another backup"};
  };
  Stream stream;
  if (crypto_secretstream_xchacha20poly1305_init_pull(&stream.state, header.data() + kPreambleBytes,
                                                      key.streamKey().data()) != 0)
    return refused("its header is damaged");

  Hash hash;
  Bytes sealed(preamble.piece_bytes + kTagBytes), piece(preamble.piece_bytes);
  for (bool last = false; !last;) {
    RETURN_IF_ERROR(checkNotCancelled(cancelled));
    ASSIGN_OR_RETURN(const auto got, readFully(in, encrypted, sealed.data(), sealed.size()));
    if (got < kTagBytes) return refused(fmt::format("is cut off after {} bytes", at + got));
    unsigned char tag = 0;
    if (crypto_secretstream_xchacha20poly1305_pull(&stream.state, piece.data(), nullptr, &tag, sealed.data(),
                                                   got, preamble.bytes.data(), preamble.bytes.size()) != 0)
      return refused(
          fmt::format("bytes {} to {} were changed or damaged, cut off, added to, or put in another order",
                      at, at + got - 1));
    at += got;
    last = tag == crypto_secretstream_xchacha20poly1305_TAG_FINAL;
    if (!last && (tag != crypto_secretstream_xchacha20poly1305_TAG_MESSAGE || got < sealed.size()))
      return refused(fmt::format("the piece that ends at byte {} was not written by needlelab", at));
    const ByteView plain = ByteView(piece).first(got - kTagBytes);
    hash.add(plain);
    RETURN_IF_ERROR(take(plain));
  }
  std::uint8_t more = 0;
  ASSIGN_OR_RETURN(const auto beyond, readFully(in, encrypted, &more, 1));
  if (beyond > 0) return refused(fmt::format("has bytes after its end, at byte {}", at));
  return hash.result();
}

}  // namespace needlelab
