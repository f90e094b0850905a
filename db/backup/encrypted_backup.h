/// Encrypted backups: FILE.nlbk, made from a plain copy and read back, with a key that is kept elsewhere.
/// Format: db/README.md ("Encrypted backups").
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

/// Extension of encrypted backups.
inline constexpr std::string_view kEncryptedEnding = ".nlbk";

/// A backup key: 32 random bytes, stored as one line of 64 hexadecimal digits. Wiped on destruction. Thread:
/// immutable.
class BackupKey {
 public:
  static constexpr std::size_t kBytes = 32;
  using Id = std::array<std::uint8_t, 16>;

  /// Reads a key file. Errors (kInvalidInput): missing, not a key, or readable by other users (not checked in
  /// $CREDENTIALS_DIRECTORY, which systemd protects).
  static Result<BackupKey> read(const std::filesystem::path& file);
  /// Creates a random key and its file (0600), and syncs it. Errors: kAlreadyExists (a key file is never
  /// overwritten: its backups would be lost), kInvalidInput (no such folder), kFailed.
  static Result<BackupKey> make(const std::filesystem::path& file);

  BackupKey(const BackupKey&) = default;
  BackupKey& operator=(const BackupKey&) = default;
  ~BackupKey();

  /// Distinguishes keys without revealing anything else; each backup names its key's id.
  [[nodiscard]] const Id& id() const { return id_; }
  [[nodiscard]] std::string idText() const;
  /// The stream key, derived from the file's key.
  [[nodiscard]] const std::array<std::uint8_t, kBytes>& streamKey() const { return stream_key_; }

 private:
  explicit BackupKey(const std::array<std::uint8_t, kBytes>& key);
  std::array<std::uint8_t, kBytes> stream_key_{};
  Id id_{};
};

/// The key file to use: `given`, or $CREDENTIALS_DIRECTORY/backup.key if that exists (systemd:
/// LoadCredential=backup.key:FILE). Empty: backups are not encrypted.
std::filesystem::path backupKeyFile(const std::filesystem::path& given);

/// BLAKE2b-256 of a plain copy.
using PlainHash = std::array<std::uint8_t, 32>;

/// Whether the file starts like an encrypted backup.
bool isEncryptedBackup(const std::filesystem::path& file);

/// Encrypts a file to a new one (0600) and syncs it. Errors: kFailed, kUnavailable (`cancelled`, which may be
/// null, became true). After an error the new file may be incomplete; the caller removes it.
Result<PlainHash> encryptFile(const std::filesystem::path& plain, const std::filesystem::path& encrypted,
                              const BackupKey& key, const std::atomic<bool>* cancelled = nullptr);

/// Decrypts a file piece by piece; each piece (at most 1 MiB) is authenticated before `take` gets it. The
/// data must not be trusted until the call succeeds, because the end may be missing. Errors: kInvalidInput
/// (wrong key, or not readable), kVersion (newer format), kCorrupt (not an encrypted backup; changed,
/// damaged, reordered, truncated or with trailing bytes), kUnavailable (cancelled), and errors of `take`.
Result<PlainHash> decryptFile(const std::filesystem::path& encrypted, const BackupKey& key,
                              const std::function<Status(ByteView)>& take,
                              const std::atomic<bool>* cancelled = nullptr);

}  // namespace needlelab
