/// A pool of query-only connections, borrowed for a short time.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"

namespace needlelab {

/// Opens a connection if none is idle, and keeps at most `max_idle`. Thread: borrow() may be called from any
/// thread; a Lease is used by one thread at a time. The pool must outlive its leases.
class ReaderPool {
 public:
  /// A borrowed connection; the destructor returns it.
  class Lease {
   public:
    Lease(Lease&&) noexcept = default;
    Lease& operator=(Lease&&) = delete;
    ~Lease();
    Connection& operator*() { return *connection_; }
    Connection* operator->() { return connection_.get(); }

   private:
    friend class ReaderPool;
    Lease(ReaderPool& pool, std::unique_ptr<Connection> connection)
        : pool_(&pool), connection_(std::move(connection)) {}
    ReaderPool* pool_;
    std::unique_ptr<Connection> connection_;  ///< null after a move
  };

  /// `mode`: kReader, or kFrozen if there is no writer.
  explicit ReaderPool(StoreAddress address, std::size_t max_idle = 8,
                      Connection::Mode mode = Connection::Mode::kReader)
      : address_(std::move(address)), max_idle_(max_idle), mode_(mode) {}

  Result<Lease> borrow();
  [[nodiscard]] const std::filesystem::path& path() const { return address_.path; }

 private:
  const StoreAddress address_;
  const std::size_t max_idle_;
  const Connection::Mode mode_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Connection>> idle_;  ///< guarded by mutex_
};

}  // namespace needlelab
