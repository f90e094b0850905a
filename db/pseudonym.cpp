#include "db/pseudonym.h"

#include <sodium.h>

#include <algorithm>
#include <mutex>

#include "common/base/bytes.h"
#include "common/base/files.h"

namespace needlelab {
namespace {

/// BLAKE2b-256 over labelled parts, each with its length before it, so that no two lists of parts are the
/// same bytes.
template <typename... Parts>
PseudonymKey::Hash keyedHash(const PseudonymKey::Hash& key, const Parts&... parts) {
  Bytes text;
  ByteWriter writer(text);
  const auto add = [&](std::string_view part) {
    writer.put(static_cast<std::uint64_t>(part.size()));
    writer.put(viewOf(part));
  };
  (add(parts), ...);
  PseudonymKey::Hash hash{};
  crypto_generichash(hash.data(), hash.size(), text.data(), text.size(), key.data(), key.size());
  return hash;
}

std::string hexStart(const PseudonymKey::Hash& hash, std::size_t bytes) {
  return hexDigitsOf(textOf(ByteView(hash).first(bytes)));
}

}  // namespace

Result<PseudonymKey> PseudonymKey::ofFolder(const std::filesystem::path& folder) {
  static std::mutex one_at_a_time;
  const std::scoped_lock lock(one_at_a_time);
  const auto path = folder / "pseudonym.key";
  Hash key{};
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    if (sodium_init() < 0) return Error{ErrorCode::kFailed, "there is no source of random numbers"};
    randombytes_buf(key.data(), key.size());
    if (auto done = writeFileAtomically(path, key, 0600); !done) return done.error();
    return PseudonymKey(key);
  }
  const auto bytes = readWholeFile(path, 1000);
  if (!bytes) return bytes.error();
  if (bytes->size() != key.size())
    return Error{ErrorCode::kCorrupt,
                 path.string() + ": has " + std::to_string(bytes->size()) +
                     " bytes, a key has 32: put back the right file; a new key gives new pseudonyms"};
  std::copy(bytes->begin(), bytes->end(), key.begin());
  return PseudonymKey(key);
}

PseudonymKey::Hash PseudonymKey::nameHash(std::string_view name) const {
  return keyedHash(key_, "needlelab erased person", name);
}

std::string PseudonymKey::ofPerson(std::string_view study, std::string_view name,
                                   std::int64_t created_unix_ns) const {
  return "p-" +
         hexStart(keyedHash(key_, "needlelab study person", study, name, std::to_string(created_unix_ns)), 8);
}

std::string PseudonymKey::ofSession(std::string_view study, const Uuid& session) const {
  return "s-" + hexStart(keyedHash(key_, "needlelab study session", study, textOf(session)), 16);
}

std::string hexDigitsOf(std::string_view bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

Result<std::string> bytesOfHex(std::string_view hex) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
  };
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    const int high = digit(hex[i]), low = digit(hex[i + 1]);
    if (high < 0 || low < 0) break;
    bytes += static_cast<char>(high * 16 + low);
  }
  if (2 * bytes.size() == hex.size()) return bytes;
  return Error{ErrorCode::kInvalidInput, "is not an even number of digits 0-9, a-f"};
}

}  // namespace needlelab
