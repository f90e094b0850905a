/// What a server is processing: parsed messages, unread replies, uncommitted chunks.
#pragma once

#include <memory>

#include "common/wire/asio.h"
#include "server/live/limits/byte_budget.h"
#include "server/live/limits/limits.h"
#include "server/live/work/offload.h"

namespace needlelab {

/// `bounds` must outlive it.
struct InFlight {
  asio::io_context& io;
  const ConnectionBounds& bounds;
  /// A message was completed; there may be room for another.
  std::shared_ptr<Signal> decoded_room = std::make_shared<Signal>(io.get_executor());
  ByteBudget decoded{bounds.decoded, [room = decoded_room] { room->notify(); }};
  /// A reply was read, or was shorter than reserved; there may be room for another.
  std::shared_ptr<Signal> reply_room = std::make_shared<Signal>(io.get_executor());
  ByteBudget replies{bounds.replies, [room = reply_room] { room->notify(); }};
  /// Over all connections: the number of chunks and their bytes. While either is full, connections should not
  /// read another chunk. Each may already have read one, so the bytes stay below the limit plus one chunk (1
  /// MiB) per connection.
  ByteBudget chunks{{.server = bounds.all_chunks_in_flight.chunks}};
  ByteBudget chunk_bytes{{.server = bounds.all_chunks_in_flight.bytes}};
  Inbox committed{io.get_executor()};    ///< chunks that the writer has finished
  Signal chunk_room{io.get_executor()};  ///< neither is full any longer

  [[nodiscard]] bool chunksFull() const { return chunks.full() || chunk_bytes.full(); }
};

}  // namespace needlelab
