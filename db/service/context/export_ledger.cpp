#include "db/service/context/export_ledger.h"

#include <sodium.h>

#include "common/base/bytes.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

constexpr std::size_t kSealDigits = 32;
constexpr std::int64_t kNotedAgainAfter_ns = 3'600LL * 1'000'000'000;
constexpr std::size_t kMaxNoted = 10'000;
constexpr std::int64_t kSealDay_ns = 24 * kNotedAgainAfter_ns;

}  // namespace

ExportLedger::ExportLedger() {
  randombytes_buf(key_.data(), key_.size());
}

ExportLedger::ExportLedger(const SharedLogins& shared)
    : shared_(&shared), key_(shared.key().of("pages", "")) {}

std::string ExportLedger::seal16(const Principal& who, std::string_view what, std::string_view place,
                                 std::int64_t day) const {
  Bytes text;
  ByteWriter writer(text);
  const std::string role = std::to_string(who.role), of_day = std::to_string(day);
  for (const std::string_view part :
       {std::string_view(who.name), std::string_view(role), what, place, std::string_view(of_day)}) {
    writer.put(static_cast<std::uint64_t>(part.size()));
    writer.put(viewOf(part));
  }
  std::array<std::uint8_t, kSealDigits / 2> hash{};
  crypto_generichash(hash.data(), hash.size(), text.data(), text.size(), key_.data(), key_.size());
  return hexDigitsOf(textOf(hash));
}

std::string ExportLedger::seal(const Principal& who, std::string_view what, std::string_view place) const {
  return seal16(who, what, place, today()) + std::string(place);
}

std::int64_t ExportLedger::today() const {
  return shared_ != nullptr ? wallNowNs() / kSealDay_ns : 0;
}

Result<std::string> ExportLedger::open(const Principal& who, std::string_view what,
                                       std::string_view page) const {
  if (page.empty()) return std::string();
  const std::string_view seal = page.substr(0, std::min(page.size(), kSealDigits));
  const std::string_view place = page.substr(seal.size());
  // servers' clocks may be hours apart, and an export may continue past midnight
  const std::int64_t day = today(), around = shared_ != nullptr ? 1 : 0;
  for (std::int64_t of_day = day - around; of_day <= day + around; ++of_day) {
    const std::string right = seal16(who, what, place, of_day);
    if (seal.size() == right.size() && sodium_memcmp(seal.data(), right.data(), right.size()) == 0)
      return std::string(place);
  }
  return Error{ErrorCode::kInvalidInput,
               "page: give back the next_page of the reply before, to the same request (the server was "
               "restarted? begin again)"};
}

bool ExportLedger::isNew(const Principal& who, std::string_view what, std::int64_t now_unix_ns) {
  const auto isOld = [now_unix_ns](std::int64_t noted_unix_ns) {
    return now_unix_ns - noted_unix_ns > kNotedAgainAfter_ns || noted_unix_ns > now_unix_ns;
  };
  const std::lock_guard lock(mutex_);
  while (!in_order_.empty() && isOld(in_order_.front().second)) dropFirst();
  const std::string key = keyOf(who, what);
  const auto note = noted_.find(key);
  // if the clock was set back, an old note may follow one that looks young
  if (note != noted_.end() && !isOld(note->second)) return false;
  // an additional line in the audit log is better than an unbounded table
  if (in_order_.size() >= kMaxNoted) dropFirst();
  noted_[key] = now_unix_ns;
  in_order_.emplace_back(key, now_unix_ns);
  return true;
}

Result<bool> ExportLedger::isNewOnAllServers(Connection& writer, const Principal& who,
                                             std::string_view what) const {
  if (shared_ == nullptr) return true;
  return LoginStore(writer, shared_->key())
      .noteRead(keyOf(who, what), std::chrono::nanoseconds(kNotedAgainAfter_ns));
}

void ExportLedger::revoke(const Principal& who, std::string_view what) {
  const std::lock_guard lock(mutex_);
  noted_.erase(keyOf(who, what));
}

std::string ExportLedger::keyOf(const Principal& who, std::string_view what) {
  return who.name + "\n" + std::string(what);
}

void ExportLedger::dropFirst() {
  const auto& [key, noted_unix_ns] = in_order_.front();
  const auto note = noted_.find(key);
  // the same read may have been noted again since
  if (note != noted_.end() && note->second == noted_unix_ns) noted_.erase(note);
  in_order_.pop_front();
}

}  // namespace needlelab
