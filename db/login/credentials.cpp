#include "db/login/credentials.h"

#include <fmt/core.h>
#include <sodium.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <iterator>
#include <system_error>

#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "db/people/look_alikes.h"

namespace needlelab {
namespace {

/// Initialises libsodium once, on the first caller's thread.
void initialise() {
  static const int rc = sodium_init();
  (void)rc;  // fails only without a random source; then the calls below fail
}

static_assert(kPasswordCost.operations == crypto_pwhash_OPSLIMIT_INTERACTIVE &&
              kPasswordCost.memory_bytes == crypto_pwhash_MEMLIMIT_INTERACTIVE);

/// Zero-padded; empty if out of memory.
std::string hashOf(std::string_view secret) {
  const PasswordCost cost = passwordCost();
  std::string text(crypto_pwhash_STRBYTES, '\0');
  if (crypto_pwhash_str(text.data(), secret.data(), secret.size(), cost.operations, cost.memory_bytes) != 0)
    return {};
  return text;
}

/// kFailed: out of memory.
Result<std::string> hashedText(std::string_view secret) {
  std::string hash = hashOf(secret);
  if (hash.empty())
    return Error{ErrorCode::kFailed, "cannot hash a password or code: not enough memory (64 MiB are needed)"};
  hash.resize(std::strlen(hash.c_str()));
  return hash;
}

Error noMemory(std::uint64_t bytes) {
  return {ErrorCode::kFailed,
          fmt::format("cannot check a password or code: not enough memory ({} MiB are needed)", bytes >> 20)};
}

/// libsodium's text form: "$argon2id$v=19$m=KIB,t=OPERATIONS,p=1$SALT$HASH", the last two in Base64.
struct ReadHash {
  std::uint64_t operations = 0, memory_bytes = 0;
  std::array<unsigned char, crypto_pwhash_argon2id_SALTBYTES> salt{};
  std::array<unsigned char, 32> hash{};
};

/// Removes `mark` and the integer after it (up to 2⁴⁰) from the front.
bool takeNumber(std::string_view& text, std::string_view mark, std::uint64_t& number) {
  if (!text.starts_with(mark)) return false;
  text.remove_prefix(mark.size());
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (fault != std::errc() || number > 1ull << 40) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

template <std::size_t kSize>
bool takeBytes(std::string_view text, std::array<unsigned char, kSize>& bytes) {
  std::size_t size = 0;
  const char* end = nullptr;
  return sodium_base642bin(bytes.data(), bytes.size(), text.data(), text.size(), nullptr, &size, &end,
                           sodium_base64_VARIANT_ORIGINAL_NO_PADDING) == 0 &&
         size == bytes.size() && end == text.data() + text.size();
}

std::optional<ReadHash> readHash(std::string_view text) {
  ReadHash read;
  std::uint64_t kib = 0, lanes = 0;
  if (!takeNumber(text, "$argon2id$v=19$m=", kib) || !takeNumber(text, ",t=", read.operations) ||
      !takeNumber(text, ",p=", lanes) || lanes != 1 || !text.starts_with('$'))
    return std::nullopt;
  text.remove_prefix(1);
  const std::size_t dollar = text.find('$');
  if (dollar == std::string_view::npos || !takeBytes(text.substr(0, dollar), read.salt) ||
      !takeBytes(text.substr(dollar + 1), read.hash))
    return std::nullopt;
  read.memory_bytes = kib << 10;
  if (read.operations < crypto_pwhash_argon2id_OPSLIMIT_MIN ||
      read.memory_bytes < crypto_pwhash_argon2id_MEMLIMIT_MIN)
    return std::nullopt;
  return read;
}

/// The most common passwords whose stem has at least six letters, or that have no letters to strip; shorter
/// ones are too short anyway, unless followed by many digits.
constexpr std::array<std::string_view, 84> kCommonPasswords = {
    "password",     "passwort", "motdepasse",   "contraseña", "parola",     "senha",      "passw0rd",
    "p@ssw0rd",     "p@ssword", "password1234", "letmein",    "welcome",    "willkommen", "bienvenue",
    "qwerty",       "qwertz",   "azerty",       "qwertyuiop", "qwertzuiop", "azertyuiop", "asdfgh",
    "asdfghjkl",    "yxcvbnm",  "zxcvbnm",      "1q2w3e4r",   "1q2w3e4r5t", "1qaz2wsx",   "1qaz2wsx3edc",
    "q1w2e3r4t5",   "1234qwer", "qwer1234",     "abc123",     "abcd1234",   "a1b2c3d4e5", "iloveyou",
    "ichliebedich", "jetaime",  "sunshine",     "princess",   "football",   "baseball",   "superman",
    "batman",       "starwars", "master",       "dragon",     "monkey",     "shadow",     "michael",
    "jennifer",     "charlie",  "jordan",       "trustno1",   "whatever",   "freedom",    "computer",
    "internet",     "secret",   "geheim",       "changeme",   "change_me",  "default",    "administrator",
    "adminadmin",   "admin",    "root",         "manager",    "instructor", "teacher",    "student",
    "trainee",      "guest",    "university",   "hospital",   "medicine",   "needle",     "needlelab",
    "injection",    "summer",   "winter",       "sommer",     "spring",     "test",       "testtest"};

constexpr std::string_view kSelectStations = "SELECT name, key_hash, revoked, created_unix_ns FROM stations ";

Station stationOf(const Statement& row) {
  Station station;
  station.name = row.text(0);
  const ByteView hash = row.bytes(1);
  std::copy_n(hash.begin(), std::min(hash.size(), station.key_hash.size()), station.key_hash.begin());
  station.revoked = row.integer(2) != 0;
  station.created_unix_ns = row.integer(3);
  return station;
}

}  // namespace

Result<std::string> hashPassword(std::string_view password) {
  initialise();
  if (password.size() < kMinPasswordBytes || password.size() > kMaxPasswordBytes) {
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("password: has {} bytes, allowed are {} to {}", password.size(),
                             kMinPasswordBytes, kMaxPasswordBytes)};
  }
  return hashedText(password);
}

Status checkStaffPassword(std::string_view password, std::string_view name) {
  if (password.size() < kMinStaffPasswordBytes || password.size() > kMaxPasswordBytes)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("password: has {} bytes, allowed are {} to {} for people who can see others' data",
                    password.size(), kMinStaffPasswordBytes, kMaxPasswordBytes)};
  const std::string small = lowerCase(password);
  // "Password2026!" is "password"
  const std::size_t letters = small.find_last_not_of("0123456789!?.,-_*#+$@&% ");
  const std::string_view stem =
      letters == std::string::npos ? std::string_view() : std::string_view(small).substr(0, letters + 1);
  const auto is_common = [](std::string_view text) {
    return std::find(kCommonPasswords.begin(), kCommonPasswords.end(), text) != kCommonPasswords.end();
  };
  if (is_common(small) || is_common(stem))
    return Error{
        ErrorCode::kInvalidInput,
        "password: is one of the most common ones, which guessers try first: take another, e.g. some "
        "words that do not belong together"};
  int steps[3] = {0, 0, 0};  // down, repeated, up
  for (std::size_t i = 1; i < small.size(); ++i) {
    const int step = small[i] - small[i - 1];
    if (step >= -1 && step <= 1) ++steps[step + 1];
  }
  if (*std::max_element(std::begin(steps), std::end(steps)) + 2 >= static_cast<int>(small.size()))
    return Error{ErrorCode::kInvalidInput,
                 "password: is one character again and again, or a row of neighbours: take another"};
  if (const std::string own = lowerCase(name); small == own || stem == own)
    return Error{ErrorCode::kInvalidInput, "password: is the person's own name: take another"};
  return {};
}

Result<std::string> hashCode(std::string_view typed) {
  initialise();
  std::string code = asciiDigits(typed);
  const Status valid = checkCode(code);
  auto hash = valid.ok() ? hashedText(code) : valid.error();
  wipe(code);
  return hash;
}

std::string makePin() {
  initialise();
  return fmt::format("{:06}", randombytes_uniform(1'000'000));
}

// Not crypto_pwhash_str_verify, which reports a lack of memory as a wrong password.
Result<bool> verifyPassword(std::string_view hash, std::string_view password) {
  initialise();
  const auto read = password.size() <= kMaxPasswordBytes ? readHash(hash) : std::nullopt;
  ReadHash wanted;
  if (read) {
    wanted = *read;
  } else {
    // the same amount of work, with a salt of its own, for a result that matches nothing
    const PasswordCost cost = passwordCost();
    wanted.operations = cost.operations;
    wanted.memory_bytes = cost.memory_bytes;
    randombytes_buf(wanted.salt.data(), wanted.salt.size());
  }
  const std::string_view tried = password.substr(0, kMaxPasswordBytes);
  std::array<unsigned char, sizeof wanted.hash> got{};
  if (crypto_pwhash(got.data(), got.size(), tried.data(), tried.size(), wanted.salt.data(), wanted.operations,
                    wanted.memory_bytes, crypto_pwhash_ALG_ARGON2ID13) != 0)
    return noMemory(wanted.memory_bytes);
  const bool same = sodium_memcmp(got.data(), wanted.hash.data(), got.size()) == 0;
  sodium_memzero(got.data(), got.size());
  return same && read.has_value();
}

StationKeyBytes makeStationKey() {
  initialise();
  StationKeyBytes key;
  randombytes_buf(key.data(), key.size());
  return key;
}

StationKeyBytes hashStationKey(const StationKeyBytes& key) {
  initialise();
  StationKeyBytes hash;
  crypto_generichash(hash.data(), hash.size(), key.data(), key.size(), nullptr, 0);
  return hash;
}

bool sameHash(const StationKeyBytes& a, const StationKeyBytes& b) {
  return sodium_memcmp(a.data(), b.data(), a.size()) == 0;
}

Status StationStore::add(std::string_view name, const StationKeyBytes& key_hash, std::int64_t now_unix_ns) {
  RETURN_IF_ERROR(checkName("station name", name));
  ASSIGN_OR_RETURN(const auto known, find(name));
  if (!known) {
    RETURN_IF_ERROR(checkNewName("station name", name));
    RETURN_IF_ERROR(checkNewNames(connection_, Thing::kStation, name, name));
  }
  if (known && !known->revoked) {
    return Error{ErrorCode::kAlreadyExists, "there is already a station named '" + std::string(name) +
                                                "': revoke it first to give it a new key"};
  }
  if (known) {
    return connection_.run("UPDATE stations SET key_hash = ?, revoked = 0 WHERE name = ?", ByteView(key_hash),
                           name);
  }
  return connection_.run("INSERT INTO stations (name, key_hash, created_unix_ns) VALUES (?,?,?)", name,
                         ByteView(key_hash), now_unix_ns);
}

Status StationStore::revoke(std::string_view name) {
  RETURN_IF_ERROR(connection_.run("UPDATE stations SET revoked = 1 WHERE name = ?", name));
  if (connection_.changes() == 0) {
    return requireThing(connection_, Thing::kStation, name);
  }
  return {};
}

Result<std::optional<Station>> StationStore::find(std::string_view name) {
  return connection_.query(std::string(kSelectStations) + "WHERE name = ?", name).first(stationOf);
}

Result<bool> StationStore::checkKey(std::string_view name, std::string_view key) {
  ASSIGN_OR_RETURN(const auto station, find(name));
  StationKeyBytes given{};
  if (key.size() != given.size()) return false;
  std::copy(key.begin(), key.end(), given.begin());
  // hash and compare for unknown names as well, so that the time is the same
  const StationKeyBytes stored = station ? station->key_hash : StationKeyBytes{};
  const bool same = sameHash(hashStationKey(given), stored);
  return same && station && !station->revoked;
}

Result<std::vector<Station>> StationStore::list() {
  return connection_.prepare(std::string(kSelectStations) + "ORDER BY name").all(stationOf);
}

}  // namespace needlelab
