#include "db/login/login_store.h"

#include <fmt/core.h>
#include <sodium.h>

#include <algorithm>

#include "common/base/time/clock.h"
#include "db/login/access_numbers.h"

namespace needlelab {
namespace {

constexpr std::size_t kHalf = 16;  // bytes of a key from the name; the rest are from the address

/// The account of token `t` is unchanged since the log-in.
constexpr std::string_view kAccountIsValid =
    " JOIN people p ON p.ref = t.name AND p.role = t.role"
    " AND p.disabled = 0 AND coalesce((SELECT n.number FROM access_numbers n WHERE n.what = 1"
    " AND n.name = t.name), 0) = t.access_number ";

LoginRow loginRowOf(const Statement& row) {
  return {row.real(0), row.integer(1), row.integer(2)};
}

bool hasName(LoginRow::Kind kind) {
  return kind != LoginRow::Kind::kAddress && kind != LoginRow::Kind::kKnownAddress;
}
bool hasAddress(LoginRow::Kind kind) {
  return kind != LoginRow::Kind::kName && kind != LoginRow::Kind::kCode;
}

Bytes halfOf(const LoginKey& key, std::string_view purpose, std::string_view text) {
  const auto hash = key.of(purpose, text);
  return {hash.begin(), hash.begin() + kHalf};
}

/// Appended to the SELECT of keys for a DELETE: skips rows that another transaction has locked, so that two
/// mass deletions never deadlock.
std::string_view notLocked(Connection& connection) {
  return connection.sqlite() == nullptr ? " FOR UPDATE SKIP LOCKED" : "";
}

}  // namespace

Result<std::int64_t> LoginStore::nowNs() {
  if (connection_.sqlite() != nullptr) return wallNowNs();
  ASSIGN_OR_RETURN(const auto micros,
                   connection_.prepare("SELECT (extract(epoch FROM clock_timestamp()) * 1000000)::bigint")
                       .first([](const Statement& row) { return row.integer(0); }));
  return micros.value_or(0) * 1000;
}

Status LoginStore::lockAttempts() {
  if (connection_.sqlite() != nullptr) return {};  // no one else writes
  return connection_.script("LOCK TABLE needlelab.login_attempts IN SHARE ROW EXCLUSIVE MODE");
}

Bytes LoginStore::keyOf(LoginRow::Kind kind, std::string_view name, std::string_view address) const {
  Bytes key = hasName(kind) ? halfOf(key_, "name", name) : Bytes(kHalf, 0);
  const Bytes of_address = hasAddress(kind) ? halfOf(key_, "address", address) : Bytes(kHalf, 0);
  key.insert(key.end(), of_address.begin(), of_address.end());
  return key;
}

Result<std::optional<LoginRow>> LoginStore::attempt(LoginRow::Kind kind, std::string_view name,
                                                    std::string_view address) {
  const Bytes key = keyOf(kind, name, address);
  return connection_
      .query("SELECT failures, at_ns, wait_until_ns FROM login_attempts WHERE kind = ? AND key = ?",
             static_cast<int>(kind), ByteView(key))
      .first(loginRowOf);
}

Result<std::map<LoginRow::Kind, LoginRow>> LoginStore::attempts(std::string_view name,
                                                                std::string_view address) {
  using Kind = LoginRow::Kind;
  const auto number = [](Kind kind) { return static_cast<int>(kind); };
  const Bytes of_pair = keyOf(Kind::kPair, name, address), of_address = keyOf(Kind::kAddress, name, address),
              of_name = keyOf(Kind::kName, name, address);
  auto rows =
      connection_.query(fmt::format("SELECT failures, at_ns, wait_until_ns, kind FROM login_attempts"
                                    " WHERE (kind IN ({}, {}) AND key = ?) OR (kind IN ({}, {}) AND key = ?)"
                                    " OR (kind = {} AND key = ?)",
                                    number(Kind::kPair), number(Kind::kKnown), number(Kind::kAddress),
                                    number(Kind::kKnownAddress), number(Kind::kName)),
                        ByteView(of_pair), ByteView(of_address), ByteView(of_name));
  std::map<Kind, LoginRow> all;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return all;
    all.emplace(static_cast<Kind>(rows.integer(3)), loginRowOf(rows));
  }
}

Status LoginStore::putAttempt(LoginRow::Kind kind, std::string_view name, std::string_view address,
                              const std::optional<LoginRow>& row) {
  const Bytes key = keyOf(kind, name, address);
  if (!row)
    return connection_.run("DELETE FROM login_attempts WHERE kind = ? AND key = ?", static_cast<int>(kind),
                           ByteView(key));
  return connection_.run(
      "INSERT INTO login_attempts (kind, key, failures, at_ns, wait_until_ns) VALUES (?,?,?,?,?)"
      " ON CONFLICT (kind, key) DO UPDATE SET failures = excluded.failures, at_ns = excluded.at_ns,"
      " wait_until_ns = excluded.wait_until_ns",
      static_cast<int>(kind), ByteView(key), row->failures, row->at_ns, row->wait_until_ns);
}

Status LoginStore::forgetNames(std::span<const std::string> names) {
  RETURN_IF_ERROR(lockAttempts());
  for (const std::string& name : names) {
    const Bytes half = halfOf(key_, "name", name);
    RETURN_IF_ERROR(connection_.run(
        fmt::format("DELETE FROM login_attempts WHERE substr(key, 1, {}) = ?", kHalf), ByteView(half)));
  }
  return {};
}

Result<bool> LoginStore::addToken(std::string_view token, const TokenRow& row, std::uint64_t max_of_person) {
  ASSIGN_OR_RETURN(const auto theirs,
                   connection_.query("SELECT count(*) FROM login_tokens WHERE name = ?", row.name)
                       .first([](const Statement& counted) { return counted.natural(0); }));
  if (theirs.value_or(0) >= max_of_person)
    RETURN_IF_ERROR(
        connection_.run("DELETE FROM login_tokens WHERE hash = (SELECT hash FROM login_tokens WHERE name = ?"
                        " ORDER BY expires_ns, hash LIMIT 1)",
                        row.name));
  const LoginKey::Hash hash = LoginKey::hashOfToken(token);
  // a concurrent change is not seen here: token() and isTokenValid() compare the number again
  RETURN_IF_ERROR(connection_.run(
      "INSERT INTO login_tokens (hash, name, role, access_number, password_ns, expires_ns)"
      " SELECT ?1, p.ref, p.role, ?2, ?3, ?4 FROM people p WHERE p.ref = ?5 AND p.role = ?6 AND p.disabled = "
      "0"
      " AND coalesce((SELECT n.number FROM access_numbers n WHERE n.what = 1 AND n.name = p.ref), 0) = ?2",
      ByteView(hash), row.access_number, row.password_ns, row.expires_ns, row.name, row.role));
  return connection_.changes() > 0;
}

Result<std::optional<TokenRow>> LoginStore::token(std::string_view token, std::int64_t now_ns) {
  const LoginKey::Hash hash = LoginKey::hashOfToken(token);
  return connection_
      .query(fmt::format("SELECT t.name, t.role, t.access_number, t.password_ns,"
                         " t.expires_ns, (SELECT c.name FROM called c WHERE c.ref = t.name)"
                         " FROM login_tokens t{}WHERE t.hash = ? AND t.expires_ns > ?",
                         kAccountIsValid),
             ByteView(hash), now_ns)
      .first([](const Statement& row) {
        return TokenRow{row.text(0),    static_cast<int>(row.integer(1)),
                        row.integer(2), row.integer(3),
                        row.integer(4), row.text(5)};
      });
}

Result<bool> LoginStore::isTokenValid(std::string_view token) {
  const LoginKey::Hash hash = LoginKey::hashOfToken(token);
  auto row = connection_.query(fmt::format("SELECT 1 FROM login_tokens t{}WHERE t.hash = ?", kAccountIsValid),
                               ByteView(hash));
  return row.step();
}

Result<std::optional<std::int64_t>> LoginStore::renewToken(std::string_view token, std::int64_t now_ns,
                                                           std::chrono::nanoseconds lifetime,
                                                           std::chrono::nanoseconds longest) {
  const LoginKey::Hash hash = LoginKey::hashOfToken(token);
  return connection_
      .query(
          "UPDATE login_tokens SET expires_ns = min(?, password_ns + ?) WHERE hash = ? AND expires_ns > ?"
          " RETURNING expires_ns",
          now_ns + lifetime.count(), static_cast<std::int64_t>(longest.count()), ByteView(hash), now_ns)
      .first([](const Statement& row) { return row.integer(0); });
}

Status LoginStore::endToken(std::string_view token, std::string_view server) {
  const LoginKey::Hash hash = LoginKey::hashOfToken(token);
  ASSIGN_OR_RETURN(
      const auto name,
      connection_.query("SELECT name FROM login_tokens WHERE hash = ?", ByteView(hash)).first(firstText));
  if (!name) return {};  // another request was faster
  // in the order of the triggers: the number, then the tokens
  RETURN_IF_ERROR(AccessNumberStore(connection_).raise(AccessKind::kLogOut, *name, "log-out", server));
  return connection_.run("DELETE FROM login_tokens WHERE hash = ?", ByteView(hash));
}

Status LoginStore::tidy(std::int64_t now_ns, const Bounds& bounds) {
  const std::string_view free = notLocked(connection_);
  RETURN_IF_ERROR(
      connection_.run(fmt::format("DELETE FROM login_tokens WHERE hash IN (SELECT hash FROM login_tokens"
                                  " WHERE expires_ns <= ?{})",
                                  free),
                      now_ns));
  RETURN_IF_ERROR(connection_.run(
      fmt::format("DELETE FROM login_tokens WHERE hash IN (SELECT hash FROM login_tokens"
                  " ORDER BY expires_ns LIMIT max((SELECT count(*) FROM login_tokens) - ?, 0){})",
                  free),
      bounds.tokens));
  RETURN_IF_ERROR(lockAttempts());
  for (const auto kind : {LoginRow::Kind::kPair, LoginRow::Kind::kKnown, LoginRow::Kind::kKnownAddress,
                          LoginRow::Kind::kName, LoginRow::Kind::kAddress, LoginRow::Kind::kCode}) {
    const bool is_known = kind == LoginRow::Kind::kKnown || kind == LoginRow::Kind::kKnownAddress;
    const auto kept = is_known                        ? bounds.known_kept
                      : kind == LoginRow::Kind::kCode ? bounds.codes_kept
                                                      : bounds.failures_kept;
    RETURN_IF_ERROR(
        connection_.run("DELETE FROM login_attempts WHERE kind = ? AND at_ns < ? AND wait_until_ns <= ?",
                        static_cast<int>(kind), now_ns - kept.count(), now_ns));
    RETURN_IF_ERROR(connection_.run(
        "DELETE FROM login_attempts WHERE kind = ?1 AND key IN (SELECT key FROM login_attempts"
        " WHERE kind = ?1 ORDER BY at_ns"
        " LIMIT max((SELECT count(*) FROM login_attempts WHERE kind = ?1) - ?2, 0))",
        static_cast<int>(kind), bounds.attempts));
  }
  return {};
}

Result<bool> LoginStore::noteRead(std::string_view what, std::chrono::nanoseconds again_after) {
  ASSIGN_OR_RETURN(const std::int64_t now_ns, nowNs());
  const std::int64_t before_ns = now_ns - again_after.count();
  RETURN_IF_ERROR(connection_.run("DELETE FROM noted_reads WHERE at_ns < ? OR at_ns > ?", before_ns, now_ns));
  const LoginKey::Hash key = key_.of("read", what);
  RETURN_IF_ERROR(
      connection_.run("INSERT INTO noted_reads (key, at_ns) VALUES (?,?) ON CONFLICT (key) DO NOTHING",
                      ByteView(key), now_ns));
  return connection_.changes() > 0;
}

namespace {

constexpr std::size_t kRandomBytes = 16, kTokenBytes = 32;

std::string sealOf(const LoginKey& key, std::string_view random) {
  const auto hash = key.of("token", random);
  return std::string(textOf(ByteView(hash).first(kTokenBytes - kRandomBytes)));
}

}  // namespace

LoginKey::Hash LoginKey::of(std::string_view purpose, std::string_view text) const {
  Bytes bytes;
  ByteWriter writer(bytes);
  writer.put(static_cast<std::uint64_t>(purpose.size()));
  writer.put(viewOf(purpose));
  writer.put(viewOf(text));
  Hash hash{};
  crypto_generichash(hash.data(), hash.size(), bytes.data(), bytes.size(), key_.data(), key_.size());
  return hash;
}

std::string LoginKey::makeToken() const {
  std::string token(kRandomBytes, '\0');
  randombytes_buf(token.data(), token.size());
  return token + sealOf(*this, token);
}

bool LoginKey::madeToken(std::string_view token) const {
  if (token.size() != kTokenBytes) return false;
  const std::string seal = sealOf(*this, token.substr(0, kRandomBytes));
  return sodium_memcmp(seal.data(), token.data() + kRandomBytes, seal.size()) == 0;
}

LoginKey::Hash LoginKey::hashOfToken(std::string_view token) {
  Hash hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(token.data()),
                     token.size(), nullptr, 0);
  return hash;
}

}  // namespace needlelab
