/// Hears of changes of access that others commit: LISTEN on a connection of its own.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/access_numbers.h"
#include "db/store_address.h"

namespace needlelab {

/// An error of any call but connect() means that the connection is lost: connect again. Thread: one; the
/// calls wait for PostgreSQL.
class AccessFeed {
 public:
  virtual ~AccessFeed() = default;
  AccessFeed() = default;
  AccessFeed(const AccessFeed&) = delete;
  AccessFeed& operator=(const AccessFeed&) = delete;

  /// Connects, and listens from then on.
  virtual Status connect() = 0;
  /// Why what is changed may not be heard though there is a connection, with what to do; empty: it is heard.
  virtual Result<std::string> fault() = 0;
  /// Waits until something is heard, at most for `patience`. False: nothing was.
  virtual Result<bool> wait(std::chrono::milliseconds patience) = 0;
  /// AccessNumberStore::last() and after().
  virtual Result<std::int64_t> last() = 0;
  virtual Result<std::vector<AccessChange>> after(std::int64_t number) = 0;
};

/// Of a database on PostgreSQL with the newest schema.
std::unique_ptr<AccessFeed> makeAccessFeed(StoreAddress address);

}  // namespace needlelab
