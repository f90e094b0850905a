#include "db/store/reader_pool.h"

#include <utility>

#include "common/base/planted_bug.h"

namespace needlelab {

ReaderPool::Lease::~Lease() {
  // not after a disk error, nor if its server lacks memory, which closing the connection frees
  if (connection_ == nullptr || !connection_->mayBeKept()) return;
  const std::lock_guard lock(pool_->mutex_);
  if (pool_->idle_.size() < pool_->max_idle_) pool_->idle_.push_back(std::move(connection_));
}

Result<ReaderPool::Lease> ReaderPool::borrow() {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      auto connection = std::move(idle_.back());
      idle_.pop_back();
      connection->noteShortRead();
      if (planted(PlantedBug::kSecondCheckpointer)) (void)connection->checkpointPassive();
      return Lease(*this, std::move(connection));
    }
  }
  auto connected = openAt(address_, mode_);
  if (!connected) return address_.isPostgres() ? storeAway(connected.error()) : connected.error();
  Connection opened = std::move(connected).value();
  if (planted(PlantedBug::kSecondCheckpointer)) (void)opened.checkpointPassive();
  return Lease(*this, std::make_unique<Connection>(std::move(opened)));
}

}  // namespace needlelab
