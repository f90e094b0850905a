#include "db/people/pseudonyms.h"

#include <fmt/core.h>
#include <sodium.h>

#include <algorithm>
#include <iterator>
#include <mutex>

#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

bool sameLetter(char a, char b) {
  return lowerCase(a) == lowerCase(b);
}

struct Letters {
  std::uint32_t first, last;
};
/// Letters, digits and combining marks of the scripts that separate words by spaces and have lower case:
/// Latin, Greek, Cyrillic and Armenian. Everything else ends such a word: punctuation, and letters of other
/// scripts.
constexpr Letters kWordLetters[] = {
    {'0', '9'},       {'A', 'Z'},       {'_', '_'},       {'a', 'z'},       {0x00aa, 0x00aa},
    {0x00b5, 0x00b5}, {0x00ba, 0x00ba}, {0x00c0, 0x00d6}, {0x00d8, 0x00f6}, {0x00f8, 0x02b8},
    {0x0300, 0x0374}, {0x0376, 0x037d}, {0x037f, 0x0386}, {0x0388, 0x0481}, {0x0483, 0x0559},
    {0x0560, 0x0588}, {0x1c80, 0x1c8f}, {0x1d00, 0x1fff}, {0x2c60, 0x2c7f}, {0x2de0, 0x2dff},
    {0xa640, 0xa69f}, {0xa722, 0xa7ff}, {0xab30, 0xab6f}, {0xfb00, 0xfb17}, {0xff10, 0xff19},
    {0xff21, 0xff3a}, {0xff41, 0xff5a},
};

bool isContinuation(char c) {
  return (static_cast<unsigned char>(c) & 0xc0) == 0x80;
}

/// The character that begins at `at`; 0 if the bytes there are not UTF-8.
std::uint32_t pointAt(std::string_view text, std::size_t at) {
  std::size_t end = at + 1;
  while (end < text.size() && end < at + 4 && isContinuation(text[end])) ++end;
  if (!isUtf8(text.substr(at, end - at))) return 0;
  const auto lead = static_cast<unsigned char>(text[at]);
  std::uint32_t point = end - at == 1 ? lead : lead & (0x7fu >> (end - at));
  for (++at; at < end; ++at) point = point << 6 | (static_cast<unsigned char>(text[at]) & 0x3fu);
  return point;
}

/// The last character of a non-empty text; 0 as above.
std::uint32_t lastPoint(std::string_view text) {
  std::size_t at = text.size() - 1;
  while (at > 0 && text.size() - at < 4 && isContinuation(text[at])) --at;
  return pointAt(text, at);
}

bool isWord(std::uint32_t point) {
  return std::any_of(std::begin(kWordLetters), std::end(kWordLetters),
                     [&](const Letters& row) { return point >= row.first && point <= row.last; });
}

/// Whether no word continues from `inside`, a name's first or last character, to its neighbour. A name in a
/// script that is not in the table needs no border: Chinese has no spaces, and Arabic attaches "and" to the
/// name.
bool isBorder(std::uint32_t inside, std::uint32_t neighbour) {
  return !isWord(neighbour) || (inside >= 0x80 && !isWord(inside));
}

bool isWholeWord(std::string_view text, std::size_t begin, std::size_t end) {
  return (begin == 0 || isBorder(pointAt(text, begin), lastPoint(text.substr(0, begin)))) &&
         (end == text.size() || isBorder(lastPoint(text.substr(begin, end - begin)), pointAt(text, end)));
}

/// The position of `word` at or after `from`, ignoring case; npos if absent.
std::size_t findWord(std::string_view text, std::string_view word, std::size_t from) {
  while (from < text.size()) {
    const auto begin = text.begin() + static_cast<std::ptrdiff_t>(from);
    const auto found = std::search(begin, text.end(), word.begin(), word.end(), sameLetter);
    if (found == text.end()) break;
    const auto at = static_cast<std::size_t>(found - text.begin());
    if (isWholeWord(text, at, at + word.size())) return at;
    from = at + 1;
  }
  return std::string_view::npos;
}

void replaceWord(std::string& text, std::string_view word, std::string_view in_its_place) {
  if (word.empty()) return;
  std::string without;
  std::size_t done = 0;
  for (;;) {
    const std::size_t at = findWord(text, word, done);
    if (at == std::string::npos) break;
    without.append(text, done, at - done).append(in_its_place);
    done = at + word.size();
  }
  if (done == 0) return;
  text = without.append(text, done);
}

/// Calls `take` for each word of a full name that is longer than two bytes and than one character.
template <typename Take>
void eachPart(std::string_view full_name, const Take& take) {
  constexpr std::string_view between = " ,";
  for (std::size_t at = 0; at < full_name.size();) {
    const std::size_t end = std::min(full_name.find_first_of(between, at), full_name.size());
    const std::string_view part = full_name.substr(at, end - at);
    const auto rest = std::count_if(part.begin(), part.end(), isContinuation);
    if (part.size() > 2 && part.size() - static_cast<std::size_t>(rest) > 1) take(part);
    at = end + 1;
  }
}

/// BLAKE2b-256 over labelled parts, each preceded by its length, so that different lists of parts give
/// different bytes.
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

std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place) {
  std::string without = text;
  replaceWord(without, full_name, in_its_place);
  replaceWord(without, name, in_its_place);
  eachPart(full_name, [&](std::string_view part) { replaceWord(without, part, in_its_place); });
  return without;
}

Result<PseudonymKey> PseudonymKey::ofFolder(const std::filesystem::path& folder) {
  static std::mutex one_at_a_time;
  const std::scoped_lock lock(one_at_a_time);
  const auto path = folder / "pseudonym.key";
  Hash key{};
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    if (sodium_init() < 0) return Error{ErrorCode::kFailed, "the system has no source of random numbers"};
    randombytes_buf(key.data(), key.size());
    RETURN_IF_ERROR(writeFileAtomically(path, key, 0600));
    return PseudonymKey(key);
  }
  ASSIGN_OR_RETURN(const auto bytes, readWholeFile(path, 1000));
  if (bytes.size() != key.size())
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("{}: has {} bytes, a key has 32: put back the right file; a new key gives new pseudonyms",
                    path.string(), bytes.size())};
  std::copy(bytes.begin(), bytes.end(), key.begin());
  return PseudonymKey(key);
}

PseudonymKey::Hash PseudonymKey::nameHash(std::string_view name) const {
  return keyedHash(key_, "needlelab erased person", name);
}

std::string PseudonymKey::id() const {
  return hexStart(keyedHash(key_, "needlelab pseudonym key"), 8);
}

PseudonymKey::Hash PseudonymKey::derived(std::string_view purpose) const {
  return keyedHash(key_, "needlelab derived key", purpose);
}

std::string PseudonymKey::ofPerson(std::string_view study, std::string_view outer_ref) const {
  return "p-" + hexStart(keyedHash(key_, "needlelab study person", study, outer_ref), 8);
}

std::string PseudonymKey::ofSession(std::string_view study, const Uuid& session) const {
  return "s-" + hexStart(keyedHash(key_, "needlelab study session", study, textOf(session)), 16);
}

}  // namespace needlelab
