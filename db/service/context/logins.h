/// Log-ins of people and stations, and whether they are still valid.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/login/access_numbers.h"
#include "db/service/context/principal.h"
#include "db/store/store_address.h"

namespace needlelab {

/// Thread: any; blocks: a password takes about 0.1 s of argon2id and 64 MiB. The readers must outlive it.
class Logins {
 public:
  /// `numbered`: several servers work together, so each log-in gets an access number.
  Logins(ReaderPool& readers, bool numbered) : readers_(readers), is_numbered_(numbered) {}

  /// Checks a password. kDenied, with the same text and in about the same time, for unknown, wrong and
  /// disabled. kFailed: out of memory, not checked.
  Result<Principal> loginPerson(const std::string& user, const std::string& password);
  /// Checks a station's key. kDenied as above.
  Result<Principal> loginStation(const std::string& station, const std::string& key);
  /// A principal for the person with this account name, as after a log-in with the password. Nothing: no such
  /// person.
  Result<std::optional<Principal>> principalOf(const std::string& name);
  /// Any other text typed as a station's name may be a password and is not logged.
  Result<bool> isKnownStation(const std::string& name);
  /// For tokens: false if, since log-in, the person was disabled or got another role, or the station was
  /// revoked.
  Result<bool> stillAllowed(const Principal& principal);
  /// Same for several; results in input order.
  Result<std::vector<bool>> stillAllowed(const std::vector<Principal>& all);

 private:
  /// Principal::access_number for a log-in now.
  Result<std::optional<std::int64_t>> numberNow(Connection& reader, AccessKind what,
                                                const std::string& name) const;
  ReaderPool& readers_;
  const bool is_numbered_;
};

}  // namespace needlelab
