#include "db/pseudonyms.h"

#include <fmt/core.h>
#include <sodium.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <mutex>
#include <optional>

#include "common/base/bytes.h"
#include "common/base/files.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::string_view kFullNameWords = "full name: '";

/// Actions whose subject is always a person. For "assign" the detail decides.
constexpr std::array<std::string_view, 12> kAboutPeople = {
    "user add",      "user passwd",  "user disable", "user change",        "user import", "consent",
    "person export", "person erase", "access ended", "access valid again", "user code",   "code locked"};

bool sameLetter(char a, char b) {
  return lowerCase(a) == lowerCase(b);
}

struct Letters {
  std::uint32_t first, last;
};
/// Letters, digits and combining marks of the scripts that part words by spaces and that write small letters:
/// Latin, Greek, Cyrillic and Armenian. All else ends such a word: punctuation, and the letters of other
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

/// The character that begins at `at`; 0 when the bytes there are no UTF-8.
std::uint32_t pointAt(std::string_view text, std::size_t at) {
  std::size_t end = at + 1;
  while (end < text.size() && end < at + 4 && isContinuation(text[end])) ++end;
  if (!isUtf8(text.substr(at, end - at))) return 0;
  const auto lead = static_cast<unsigned char>(text[at]);
  std::uint32_t point = end - at == 1 ? lead : lead & (0x7fu >> (end - at));
  for (++at; at < end; ++at) point = point << 6 | (static_cast<unsigned char>(text[at]) & 0x3fu);
  return point;
}

/// The last character of a text that is not empty; 0 as above.
std::uint32_t lastPoint(std::string_view text) {
  std::size_t at = text.size() - 1;
  while (at > 0 && text.size() - at < 4 && isContinuation(text[at])) --at;
  return pointAt(text, at);
}

bool isWord(std::uint32_t point) {
  return std::any_of(std::begin(kWordLetters), std::end(kWordLetters),
                     [&](const Letters& row) { return point >= row.first && point <= row.last; });
}

/// True when no word goes on from `inside`, a name's first or last character, to its neighbour. A name in a
/// script that is not in the table needs no border: Chinese has no spaces, and Arabic writes "and" onto the
/// name.
bool isBorder(std::uint32_t inside, std::uint32_t neighbour) {
  return !isWord(neighbour) || (inside >= 0x80 && !isWord(inside));
}

bool standsAlone(std::string_view text, std::size_t begin, std::size_t end) {
  return (begin == 0 || isBorder(pointAt(text, begin), lastPoint(text.substr(0, begin)))) &&
         (end == text.size() || isBorder(lastPoint(text.substr(begin, end - begin)), pointAt(text, end)));
}

enum class Case : bool { kEither, kOwn };

/// The position of `word` at or after `from`; npos when it is absent.
std::size_t findWord(std::string_view text, std::string_view word, std::size_t from, Case letters) {
  while (from < text.size()) {
    const auto begin = text.begin() + static_cast<std::ptrdiff_t>(from);
    const auto found = letters == Case::kOwn
                           ? std::search(begin, text.end(), word.begin(), word.end())
                           : std::search(begin, text.end(), word.begin(), word.end(), sameLetter);
    if (found == text.end()) break;
    const auto at = static_cast<std::size_t>(found - text.begin());
    if (standsAlone(text, at, at + word.size())) return at;
    from = at + 1;
  }
  return std::string_view::npos;
}

void replaceWord(std::string& text, std::string_view word, std::string_view in_its_place, Case letters,
                 const OtherNames& others) {
  if (word.empty()) return;
  std::optional<OtherNames::Places> places;  // most texts have no name
  std::string without;
  std::size_t done = 0;
  for (std::size_t from = 0;;) {
    const std::size_t at = findWord(text, word, from, letters);
    if (at == std::string::npos) break;
    if (!places) places = others.placesIn(text, standsAlone);
    from = at + 1;
    if (places->cover(at, at + word.size())) continue;
    without.append(text, done, at - done).append(in_its_place);
    done = from = at + word.size();
  }
  if (done == 0) return;
  text = without.append(text, done);
}

/// Calls `take` for each word of a full name that is longer than two bytes and than one character.
template <typename Take>
void eachPart(std::string_view full_name, const Take& take, std::string_view between = " ,") {
  for (std::size_t at = 0; at < full_name.size();) {
    const std::size_t end = std::min(full_name.find_first_of(between, at), full_name.size());
    const std::string_view part = full_name.substr(at, end - at);
    const auto rest = std::count_if(part.begin(), part.end(), isContinuation);
    if (part.size() > 2 && part.size() - static_cast<std::size_t>(rest) > 1) take(part);
    at = end + 1;
  }
}

/// In "…joined: a, b and 3 more; left: c", removes only whole entries.
std::string withoutListed(std::string text, const std::string& name, const std::string& in_its_place) {
  for (std::size_t at = text.find(name); at != std::string::npos;) {
    const std::string_view before = std::string_view(text).substr(0, at);
    const std::string_view after = std::string_view(text).substr(at + name.size());
    const bool begins = before.ends_with(": ") || before.ends_with(", ");
    const bool ends =
        after.empty() || after.starts_with(", ") || after.starts_with("; ") || after.starts_with(" and ");
    if (begins && ends) text.replace(at, name.size(), in_its_place);
    at = text.find(name, at + (begins && ends ? in_its_place.size() : 1));
  }
  return text;
}

/// Around the name in a line that says whose samples somebody read (db/service/session_handlers.cpp).
constexpr std::string_view kSamplesOf = "samples of '", kSamplesEnd = "'";

std::string samplesOf(std::string_view name) {
  return std::string(kSamplesOf).append(name).append(kSamplesEnd);
}

/// The detail of a line that says that a session was given to somebody else: "from Mona to anna: reason".
std::string withoutFormerOwner(const std::string& detail, const ErasedNames& names) {
  const std::string from = "from " + names.name + " to ";
  if (names.name == kGuestName || !detail.starts_with(from)) return detail;
  return "from " + names.in_its_place + " to " + detail.substr(from.size());
}

/// In a group's line "…; name: 'The class'; joined: …", replaces names in the group's name.
std::string withoutInGroupName(std::string text, const ErasedNames& names) {
  constexpr std::string_view kName = "; name: '";
  const std::size_t at = text.find(kName);
  if (at == std::string::npos) return text;
  const std::size_t begin = at + kName.size();
  const std::size_t end =
      std::min({text.find("'; joined: ", begin), text.find("'; left: ", begin), text.size()});
  return text.replace(begin, end - begin, withoutNames(text.substr(begin, end - begin), names, false));
}

bool isPersonSubject(const AuditRow& line, const std::string& name) {
  if (line.action == "log-in locked") return line.subject == name || line.subject == "person " + name;
  if (line.subject != name) return false;
  // the word may also name a group or a station
  if (line.action == "assign" || line.action == "assign remove")
    return line.detail.find(" for group " + name) == std::string::npos;
  if (line.action == "access ended" && line.detail.starts_with("the station's key")) return false;
  if (line.action == "access valid again" && line.detail.starts_with("station ")) return false;
  return std::find(kAboutPeople.begin(), kAboutPeople.end(), line.action) != kAboutPeople.end();
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

constexpr std::string_view kErasedStart = "erased-";
constexpr std::size_t kErasedBytes = 6;

}  // namespace

std::string newErasurePseudonym() {
  std::array<unsigned char, kErasedBytes> random{};
  randombytes_buf(random.data(), random.size());
  return std::string(kErasedStart) + hexDigitsOf(textOf(random));
}

bool isErasurePseudonym(std::string_view name) {
  return name.starts_with(kErasedStart) && name.size() == kErasedStart.size() + 2 * kErasedBytes &&
         name.find_first_not_of("0123456789abcdef", kErasedStart.size()) == std::string_view::npos;
}

Status checkNoPseudonym(std::string_view field, std::string_view name) {
  if (!isErasurePseudonym(lowerCase(name))) return {};
  return Error{ErrorCode::kInvalidInput,
               std::string(field) + ": '" + std::string(name) +
                   "' has the form of the names that erased people have: take another one"};
}

std::string withoutName(const std::string& text, std::string_view name, std::string_view full_name,
                        std::string_view in_its_place) {
  std::string without = text;
  replaceWord(without, full_name, in_its_place, Case::kEither, {});
  replaceWord(without, name, in_its_place, Case::kEither, {});
  eachPart(full_name,
           [&](std::string_view part) { replaceWord(without, part, in_its_place, Case::kEither, {}); });
  return without;
}

std::string withoutNames(const std::string& text, const ErasedNames& names, bool own) {
  std::string without = text;
  for (const std::string& full_name : names.full_names)
    replaceWord(without, full_name, names.in_its_place, Case::kEither, names.others);
  // before the name, which may be a word of one
  if (own)
    for (const std::string& given : names.given)
      replaceWord(without, given, names.in_its_place, Case::kEither, names.others);
  if (own || !names.typed) replaceWord(without, names.name, names.in_its_place, Case::kEither, names.others);
  if (!own) return without;
  for (const std::string& full_name : names.full_names) {
    eachPart(full_name, [&](std::string_view part) {
      replaceWord(without, part, names.in_its_place, Case::kOwn, names.others);
    });
  }
  return without;
}

NameSearch::NameSearch(const ErasedNames& names) {
  const auto add = [this](std::string_view word) {
    if (!word.empty()) words_.push_back(foldCase(word));
  };
  add(names.name);
  for (const std::string& given : names.given) add(given);
  for (const std::string& full_name : names.full_names) {
    add(full_name);
    eachPart(full_name, add, " ,-");
  }
  std::vector<std::string> others;
  for (const std::string& other : names.others.list()) others.push_back(foldCase(other));
  others_ = OtherNames(std::move(others));
}

bool NameSearch::finds(std::string_view text) const {
  const std::string folded = foldCase(text);
  std::optional<OtherNames::Places> places;  // most texts have no name
  return std::any_of(words_.begin(), words_.end(), [&](const std::string& word) {
    for (std::size_t at = folded.find(word); at != std::string::npos; at = folded.find(word, at + 1)) {
      if (!places) places = others_.placesIn(folded, standsAlone);
      if (!places->cover(at, at + word.size())) return true;
    }
    return false;
  });
}

Result<std::vector<std::string>> loggedFullNames(Connection& connection, std::string_view name,
                                                 std::int64_t after) {
  std::vector<std::string> all;
  const auto add = [&](const std::string& full_name) {
    if (!full_name.empty() && std::find(all.begin(), all.end(), full_name) == all.end())
      all.push_back(full_name);
  };
  auto rows = connection.query(
      "SELECT detail FROM audit WHERE id > ? AND subject = ?"
      " AND action IN ('user change', 'user import') ORDER BY id",
      after, name);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return all;
    const std::string detail = rows.text(0);
    const std::size_t at = detail.find(kFullNameWords);
    if (at == std::string::npos) continue;
    std::string both = detail.substr(at + kFullNameWords.size());
    if (both.ends_with("'")) both.pop_back();
    const std::size_t to = both.find("' to '");
    if (to != std::string::npos) add(both.substr(0, to));
    add(to == std::string::npos ? both : both.substr(to + 6));
  }
}

Status addOthers(Connection& connection, ErasedNames& names, bool of_groups,
                 const std::set<std::string>& besides) {
  std::set<std::string> others;
  ASSIGN_OR_RETURN(
      const auto all,
      connection
          .query(
              "SELECT name FROM people UNION SELECT full_name FROM people"
              " UNION SELECT trainee FROM sessions UNION SELECT name FROM stations"
              " UNION SELECT id FROM groups WHERE ?1 = 1 UNION SELECT name FROM groups WHERE ?1 = 1"
              " UNION SELECT id FROM profiles UNION SELECT id FROM curricula UNION SELECT id FROM exercises",
              of_groups)
          .all(firstText));
  std::vector<std::string_view> own(names.full_names.begin(), names.full_names.end());
  own.push_back(names.name);
  own.insert(own.end(), names.given.begin(), names.given.end());
  for (const std::string& full_name : names.full_names)
    eachPart(full_name, [&](std::string_view part) { own.push_back(part); });
  for (const std::string& other : all) {
    const bool mine = other == names.name || std::find(names.full_names.begin(), names.full_names.end(),
                                                       other) != names.full_names.end();
    const bool holds = std::any_of(own.begin(), own.end(), [&](std::string_view word) {
      return word.size() < other.size() && findWord(other, word, 0, Case::kEither) != std::string::npos;
    });
    if (!mine && holds && !besides.contains(other)) others.insert(other);
  }
  names.others = OtherNames(std::vector<std::string>(others.begin(), others.end()));
  return {};
}

std::vector<std::string> namesIn(const AuditRow& line) {
  constexpr std::string_view kPerson = "person ";
  std::vector<std::string> names{line.who};
  const auto addSubject = [&](const std::string& name) {
    if (isPersonSubject(line, name)) names.push_back(name);
  };
  addSubject(line.subject);
  if (line.subject.starts_with(kPerson)) addSubject(line.subject.substr(kPerson.size()));
  const std::string_view detail = line.detail;
  if (line.action == "session export" && detail.starts_with(kSamplesOf) && detail.ends_with(kSamplesEnd) &&
      detail.size() > kSamplesOf.size())
    names.emplace_back(
        detail.substr(kSamplesOf.size(), detail.size() - kSamplesOf.size() - kSamplesEnd.size()));
  return names;
}

AuditRow withoutNames(const AuditRow& line, const ErasedNames& names,
                      const std::set<std::string>& own_sessions) {
  AuditRow without = line;
  // in those lines it is a station's name
  const bool by = !names.typed && line.who == names.name && line.action != "chunk contradicts";
  const bool about = isPersonSubject(line, names.name);
  if (by) without.who = names.in_its_place;
  if (about) {
    without.subject = line.subject == names.name ? names.in_its_place : "person " + names.in_its_place;
    if (const std::size_t at = line.detail.find(kFullNameWords); at != std::string::npos)
      without.detail = line.detail.substr(0, at) + "full name changed";
  }
  if (line.action == "group set") {
    if (!names.typed)
      without.detail = withoutInGroupName(withoutListed(line.detail, names.name, names.in_its_place), names);
  } else if (about || own_sessions.contains(line.subject)) {
    without.detail = withoutNames(without.detail, names, true);
  } else if (line.action == "session export" && line.detail == samplesOf(names.name)) {
    without.detail = samplesOf(names.in_its_place);  // the session was given to somebody else afterwards
  } else if (names.typed && line.action == "session assign") {
    without.detail = withoutFormerOwner(line.detail, names);
  } else if (by || line.action == "attempt excuse" || line.action == "session assign") {
    without.detail = withoutNames(without.detail, names, false);
  }
  return without;
}

Result<PseudonymKey> PseudonymKey::ofFolder(const std::filesystem::path& folder) {
  static std::mutex one_at_a_time;
  const std::scoped_lock lock(one_at_a_time);
  const auto path = folder / "pseudonym.key";
  Hash key{};
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    if (sodium_init() < 0) return Error{ErrorCode::kFailed, "there is no source of random numbers"};
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

std::string PseudonymKey::macOf(std::string_view line) const {
  return hexStart(keyedHash(key_, "needlelab list of erasures", line), 16);
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
