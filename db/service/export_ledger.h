/// Paged exports: binds each page to its user and request, and decides when to log a read. Private to this
/// folder.
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
#include "db/connection.h"
#include "db/service/requests.h"
#include "db/shared_logins.h"

namespace needlelab {

/// A page token is valid only for the user who began the export, for the same request, in this process, or
/// among servers that work together for a day or two. So each export begins with its first page, and the
/// audit log records that. Thread: any.
class ExportLedger {
 public:
  /// Creates its own key: page tokens are valid until the program ends.
  ExportLedger();
  /// Of a server of several on one database: what one of them seals or notes, the others know. `shared` must
  /// outlive it.
  explicit ExportLedger(const SharedLogins& shared);

  /// `what`: the request, with everything that determines its result. `place`: the position to continue from.
  [[nodiscard]] std::string seal(const Principal& who, std::string_view what, std::string_view place) const;
  /// Returns the position; empty for an empty page token (the first page). kInvalidInput: seal() did not make
  /// this token for the same request of the same person.
  [[nodiscard]] Result<std::string> open(const Principal& who, std::string_view what,
                                         std::string_view page) const;

  /// True when the audit log should record that `who` reads `what` now: once an hour, for data that takes
  /// many requests to read. Logarithmic in the number of notes, also on average when old ones end.
  bool isNew(const Principal& who, std::string_view what, std::int64_t now_unix_ns);
  /// Within the transaction that adds the line: false when another server has had one within the hour. Always
  /// true with one server.
  [[nodiscard]] Result<bool> isNewElsewhere(Connection& writer, const Principal& who,
                                            std::string_view what) const;
  /// Takes back what isNew() noted, because its line was not stored: the next read is new again.
  void takeBack(const Principal& who, std::string_view what);

 private:
  [[nodiscard]] std::string seal16(const Principal& who, std::string_view what, std::string_view place,
                                   std::int64_t day) const;
  [[nodiscard]] std::int64_t today() const;
  static std::string keyOf(const Principal& who, std::string_view what);
  void dropFirst();
  const SharedLogins* const shared_ = nullptr;  // null: this server is alone
  std::array<unsigned char, 32> key_{};
  std::mutex mutex_;
  // guarded by mutex_: the time of each note, and the notes in the order in which they were made
  std::map<std::string, std::int64_t> noted_;
  std::deque<std::pair<std::string, std::int64_t>> in_order_;
};

}  // namespace needlelab
