/// Paged exports: binds each page to its user and request, and decides when to log a read. Private to
/// db/service.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"
#include "db/login/shared_logins.h"
#include "db/service/context/principal.h"
#include "db/store/connection.h"

namespace needlelab {

/// A page token is valid only for the user who began the export, for the same request, in this process or,
/// among servers that work together, for a day or two. So each export begins with its first page, which is
/// recorded in the audit log. Thread: any.
class ExportLedger {
 public:
  /// Creates its own key: page tokens are valid until the program ends.
  ExportLedger();
  /// For one of several servers on a database: tokens and notes of one are known to the others. `shared` must
  /// outlive this object.
  explicit ExportLedger(const SharedLogins& shared);

  /// `what`: the request, with everything that determines its result. `place`: the position to continue from.
  [[nodiscard]] std::string seal(const Principal& who, std::string_view what, std::string_view place) const;
  /// Returns the position; empty for an empty page token (the first page). kInvalidInput: the token was not
  /// made by seal() for the same person and request.
  [[nodiscard]] Result<std::string> open(const Principal& who, std::string_view what,
                                         std::string_view page) const;

  /// Whether the audit log should record that `who` reads `what` now: once an hour, for data that takes many
  /// requests to read. Takes logarithmic time in the number of notes, amortised over their expiry.
  bool isNew(const Principal& who, std::string_view what, std::int64_t now_unix_ns);
  /// Call within the transaction that adds the line: false if another server has noted it within the hour.
  /// Always true with a single server.
  [[nodiscard]] Result<bool> isNewOnAllServers(Connection& writer, const Principal& who,
                                               std::string_view what) const;
  /// Reverts isNew() because the line was not stored: the next read is new again.
  void revoke(const Principal& who, std::string_view what);

 private:
  [[nodiscard]] std::string seal16(const Principal& who, std::string_view what, std::string_view place,
                                   std::int64_t day) const;
  [[nodiscard]] std::int64_t today() const;
  static std::string keyOf(const Principal& who, std::string_view what);
  void dropFirst();
  const SharedLogins* const shared_ = nullptr;  // null: this is the only server
  std::array<unsigned char, 32> key_{};
  std::mutex mutex_;
  // guarded by mutex_: the time of each note, and the notes in order of creation
  std::map<std::string, std::int64_t> noted_;
  std::deque<std::pair<std::string, std::int64_t>> in_order_;
};

}  // namespace needlelab
