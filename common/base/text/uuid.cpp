#include "common/base/text/uuid.h"

#include <sys/random.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>

#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {

Uuid makeUuidV7() {
  Uuid id{};
  if (getrandom(id.data(), id.size(), 0) != static_cast<ssize_t>(id.size())) std::abort();
  // 48 bits of milliseconds, 12 random ones; never below this process's last UUID: if the clock goes back,
  // they continue from there (RFC 9562, 6.2)
  const auto ms = static_cast<std::uint64_t>(wallNowNs() / 1'000'000) & 0xFFFF'FFFF'FFFFu;
  const std::uint64_t wanted = ms << 12 | (static_cast<std::uint64_t>(id[6] & 0x0Fu) << 8 | id[7]);
  static std::atomic<std::uint64_t> last = 0;
  std::uint64_t before = last.load(), next = 0;
  do {
    next = std::max(wanted, before + 1);
  } while (!last.compare_exchange_weak(before, next));
  for (int i = 0; i < 6; ++i)
    id[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(next >> (8 * (5 - i) + 12));
  id[6] = static_cast<std::uint8_t>(0x70u | (next >> 8 & 0x0Fu));
  id[7] = static_cast<std::uint8_t>(next);
  id[8] = static_cast<std::uint8_t>(0x80u | (id[8] & 0x3Fu));
  return id;
}

std::string uuidText(const Uuid& id) {
  static constexpr char kHex[] = "0123456789abcdef";
  std::string text;
  text.reserve(36);
  for (std::size_t i = 0; i < id.size(); ++i) {
    if (i == 4 || i == 6 || i == 8 || i == 10) text.push_back('-');
    text.push_back(kHex[id[i] >> 4]);
    text.push_back(kHex[id[i] & 0xFu]);
  }
  return text;
}

Result<Uuid> parseUuid(std::string_view text) {
  const auto bad = [&] {
    return Error{
        ErrorCode::kInvalidInput,
        "'" + std::string(text.substr(0, 60)) +
            "' is not a session id: 36 characters such as 019aa0c3-7c1e-7b3a-9d5e-0123456789ab are expected"};
  };
  if (text.size() != 36) return bad();
  Uuid id{};
  std::size_t at = 0;
  for (std::size_t i = 0; i < id.size(); ++i) {
    if (i == 4 || i == 6 || i == 8 || i == 10)
      if (text[at++] != '-') return bad();
    const int high = hexDigit(text[at]), low = hexDigit(text[at + 1]);
    if (high < 0 || low < 0) return bad();
    id[i] = static_cast<std::uint8_t>(high * 16 + low);
    at += 2;
  }
  return id;
}

std::optional<Uuid> uuidOf(std::string_view bytes) {
  if (bytes.size() != std::tuple_size_v<Uuid>) return std::nullopt;
  Uuid id;
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return id;
}

Error unknownSession(const Uuid& session) {
  return {ErrorCode::kNotFound, "there is no session " + uuidText(session)};
}

}  // namespace needlelab
