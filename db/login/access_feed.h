/// Receives changes of access that others commit: LISTEN on its own connection.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/login/access_numbers.h"
#include "db/store/store_address.h"

namespace needlelab {

/// An error of any call but connect() means that the connection is lost: connect again. Thread: a single one;
/// the calls wait for PostgreSQL.
class AccessFeed {
 public:
  virtual ~AccessFeed() = default;
  AccessFeed() = default;
  AccessFeed(const AccessFeed&) = delete;
  AccessFeed& operator=(const AccessFeed&) = delete;

  /// Connects and starts listening.
  virtual Status connect() = 0;
  /// Why changes may not arrive despite a connection, with advice; empty: they arrive.
  virtual Result<std::string> fault() = 0;
  /// Waits at most `patience` for a change. False: none.
  virtual Result<bool> wait(std::chrono::milliseconds patience) = 0;
  /// AccessNumberStore::last() and after().
  virtual Result<std::int64_t> last() = 0;
  virtual Result<std::vector<AccessChange>> after(std::int64_t number) = 0;
};

/// For a PostgreSQL database with the newest schema.
std::unique_ptr<AccessFeed> makeAccessFeed(StoreAddress address);

}  // namespace needlelab
