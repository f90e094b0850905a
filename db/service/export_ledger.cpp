#include "db/service/export_ledger.h"

#include <sodium.h>

#include "common/base/bytes.h"
#include "db/pseudonyms.h"

namespace needlelab {
namespace {

constexpr std::size_t kSealDigits = 32;
constexpr std::int64_t kNotedAgainAfter_ns = 3'600LL * 1'000'000'000;
constexpr std::size_t kMostNoted = 10'000;

}  // namespace

ExportLedger::ExportLedger() {
  randombytes_buf(key_.data(), key_.size());
}

std::string ExportLedger::seal16(const Principal& who, std::string_view what, std::string_view place) const {
  Bytes text;
  ByteWriter writer(text);
  const std::string role = std::to_string(who.role);
  for (const std::string_view part : {std::string_view(who.name), std::string_view(role), what, place}) {
    writer.put(static_cast<std::uint64_t>(part.size()));
    writer.put(viewOf(part));
  }
  std::array<std::uint8_t, kSealDigits / 2> hash{};
  crypto_generichash(hash.data(), hash.size(), text.data(), text.size(), key_.data(), key_.size());
  return hexDigitsOf(textOf(hash));
}

std::string ExportLedger::seal(const Principal& who, std::string_view what, std::string_view place) const {
  return seal16(who, what, place) + std::string(place);
}

Result<std::string> ExportLedger::open(const Principal& who, std::string_view what,
                                       std::string_view page) const {
  if (page.empty()) return std::string();
  const std::string_view seal = page.substr(0, std::min(page.size(), kSealDigits));
  const std::string_view place = page.substr(seal.size());
  const std::string right = seal16(who, what, place);
  if (seal.size() == right.size() && sodium_memcmp(seal.data(), right.data(), right.size()) == 0)
    return std::string(place);
  return Error{ErrorCode::kInvalidInput,
               "page: give back the next_page of the reply before, to the same request (the server was "
               "restarted? begin again)"};
}

bool ExportLedger::isNew(const Principal& who, std::string_view what, std::int64_t now_unix_ns) {
  const std::lock_guard lock(mutex_);
  std::erase_if(noted_, [&](const auto& entry) {
    return now_unix_ns - entry.second > kNotedAgainAfter_ns || entry.second > now_unix_ns;
  });
  // an additional line in the audit log is better than an unbounded table
  if (noted_.size() >= kMostNoted) noted_.clear();
  return noted_.emplace(who.name + "\n" + std::string(what), now_unix_ns).second;
}

}  // namespace needlelab
