/// Encrypted backups: FILE.nlbk, made from a plain copy and read back, by a key that is kept apart from them.
/// The format is in db/README.md ("Encrypted backups").
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

/// The end of an encrypted backup's name.
inline constexpr std::string_view kEncryptedEnding = ".nlbk";

/// A backup key: 32 random bytes, in its file as one line of 64 hexadecimal digits. Wiped on destruction.
/// Thread: a key is not changed after it was made.
class BackupKey {
 public:
  static constexpr std::size_t kBytes = 32;
  using Id = std::array<std::uint8_t, 16>;

  /// Reads a key's file. Errors (kInvalidInput): missing, readable by others than its owner (but systemd
  /// itself guards what lies in $CREDENTIALS_DIRECTORY), or no key.
  static Result<BackupKey> read(const std::filesystem::path& file);
  /// Makes a random key and its file (0600), and syncs it. Errors: kAlreadyExists (a file is never
  /// overwritten: backups would be lost with its key), kInvalidInput (no such folder), kFailed.
  static Result<BackupKey> make(const std::filesystem::path& file);

  BackupKey(const BackupKey&) = default;
  BackupKey& operator=(const BackupKey&) = default;
  ~BackupKey();

  /// Tells keys apart and tells nothing else about them; each backup names its key's.
  [[nodiscard]] const Id& id() const { return id_; }
  [[nodiscard]] std::string idText() const;
  /// The key of the stream, derived from the file's.
  [[nodiscard]] const std::array<std::uint8_t, kBytes>& streamKey() const { return stream_key_; }

 private:
  explicit BackupKey(const std::array<std::uint8_t, kBytes>& key);
  std::array<std::uint8_t, kBytes> stream_key_{};
  Id id_{};
};

/// The file of the key to use: `given`, or $CREDENTIALS_DIRECTORY/backup.key when that exists (systemd:
/// LoadCredential=backup.key:FILE). Empty: backups are not encrypted.
std::filesystem::path backupKeyFile(const std::filesystem::path& given);

/// BLAKE2b-256 of a plain copy.
using PlainHash = std::array<std::uint8_t, 32>;

/// Returns whether the file begins as an encrypted backup does.
bool isEncryptedBackup(const std::filesystem::path& file);

/// Encrypts a file to a new one (0600), and syncs it. Errors: kFailed, kUnavailable (`cancelled`, which may
/// be null, became true). After an error the new file is there in part: the caller removes it.
Result<PlainHash> encryptFile(const std::filesystem::path& plain, const std::filesystem::path& encrypted,
                              const BackupKey& key, const std::atomic<bool>* cancelled = nullptr);

/// Decrypts a file piece by piece, each checked before `take` gets it (at most 1 MiB). What `take` got is to
/// be believed only after success: until then the end may be missing. Errors: kInvalidInput (another key, or
/// not readable), kVersion (a newer format), kCorrupt (no encrypted backup; changed, damaged, in another
/// order, cut off, or with bytes after its end), kUnavailable (cancelled), and those of `take`.
Result<PlainHash> decryptFile(const std::filesystem::path& encrypted, const BackupKey& key,
                              const std::function<Status(ByteView)>& take,
                              const std::atomic<bool>* cancelled = nullptr);

}  // namespace needlelab
