#include "db/session_row.h"

#include <algorithm>

#include "gesture/chunk.h"

namespace needlelab {

Result<std::optional<SessionRow>> findSession(Connection& connection, const Uuid& session) {
  auto query = connection.query(
      "SELECT number, station, state, chunks, samples, hash FROM sessions WHERE id = ?", ByteView(session));
  const auto found = query.step();
  if (!found) return found.error();
  if (!*found) return std::optional<SessionRow>();
  SessionRow row;
  row.number = query.integer(0);
  row.station = query.text(1);
  row.state = static_cast<pb::SessionState>(query.integer(2));
  row.chunks = query.natural(3);
  row.samples = query.natural(4);
  if (const ByteView hash = query.bytes(5); hash.size() == std::tuple_size_v<Digest>) {
    row.hash.emplace();
    std::copy(hash.begin(), hash.end(), row.hash->begin());
  }
  return std::optional(row);
}

Error unknownSession(const Uuid& session) {
  return {ErrorCode::kNotFound, "there is no session " + uuidText(session)};
}

std::optional<Uuid> uuidOf(std::string_view bytes) {
  if (bytes.size() != std::tuple_size_v<Uuid>) return std::nullopt;
  Uuid id;
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return id;
}

std::string sessionText(std::string_view bytes) {
  const auto id = uuidOf(bytes);
  return id ? uuidText(*id) : "(an id of " + std::to_string(bytes.size()) + " bytes, not 16)";
}

std::int64_t stationCrcOf(ByteView chunk) {
  std::uint32_t crc = 0;
  if (chunk.size() < sizeof(crc)) return 0;
  ByteReader reader(chunk.last(sizeof(crc)));
  return reader.get<std::uint32_t>();
}

Result<std::uint64_t> checkStoredChunk(const std::string& name, std::uint64_t seq, std::uint64_t samples,
                                       std::int64_t crc, ByteView bytes) {
  const auto corrupt = [&](const std::string& why) {
    return Error{ErrorCode::kCorrupt, name + ", chunk " + std::to_string(seq) + ": " + why};
  };
  if (crc != stationCrcOf(bytes))
    return corrupt("the CRC noted when it came in is not the one of the stored bytes");
  const auto info = inspectChunk(bytes);
  if (!info) return corrupt(info.error().message);
  if (info->count != samples) {
    return corrupt("holds " + std::to_string(info->count) + " samples, noted are " + std::to_string(samples));
  }
  return samples;
}

}  // namespace needlelab
