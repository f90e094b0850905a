// For builds without libnats.
#include "server/nats/nats_carrier.h"

namespace needlelab {

Result<std::unique_ptr<NatsCarrier>> NatsCarrier::make(asio::any_io_executor /*network*/,
                                                       NatsSettings /*settings*/) {
  return Error{ErrorCode::kInvalidInput,
               "--live: this program was built without NATS: install libnats-dev (3.4 or newer), then "
               "build again"};
}

}  // namespace needlelab
