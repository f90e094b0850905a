#include "server/live/tokens.h"

#include <algorithm>

#include <sodium.h>

namespace needlelab {
namespace {

std::string hashOf(std::string_view token) {
  std::string hash(crypto_generichash_BYTES, '\0');
  crypto_generichash(reinterpret_cast<unsigned char*>(hash.data()), hash.size(),
                     reinterpret_cast<const unsigned char*>(token.data()), token.size(), nullptr, 0);
  return hash;
}

}  // namespace

Tokens::Issued Tokens::issue(const Holder& holder, std::int64_t now_ns) {
  dropExpired(now_ns);
  const auto giveUpFirst = [this](auto counts) {
    auto first = tokens_.end();
    for (auto it = tokens_.begin(); it != tokens_.end(); ++it) {
      if (counts(it->second) && (first == tokens_.end() || it->second.expires_ns < first->second.expires_ns))
        first = it;
    }
    if (first != tokens_.end()) tokens_.erase(first);
  };
  const auto is_theirs = [&](const Entry& entry) { return entry.holder.who.name == holder.who.name; };
  const auto theirs = std::count_if(tokens_.begin(), tokens_.end(),
                                    [&](const auto& entry) { return is_theirs(entry.second); });
  if (static_cast<std::size_t>(theirs) >= kMostOfPerson) {
    giveUpFirst(is_theirs);
  } else if (tokens_.size() >= max_tokens_) {
    giveUpFirst([](const Entry&) { return true; });
  }
  Issued issued;
  issued.token.resize(32);
  randombytes_buf(issued.token.data(), issued.token.size());
  issued.expires_ns = std::min(now_ns + std::chrono::nanoseconds(lifetime_).count(),
                               holder.password_ns + std::chrono::nanoseconds(longest_).count());
  tokens_[hashOf(issued.token)] = {holder, issued.expires_ns};
  return issued;
}

std::optional<Tokens::Holder> Tokens::find(std::string_view token, std::int64_t now_ns) {
  dropExpired(now_ns);
  const auto found = tokens_.find(hashOf(token));
  if (found == tokens_.end()) return std::nullopt;
  return found->second.holder;
}

std::optional<std::int64_t> Tokens::renew(std::string_view token, std::int64_t now_ns) {
  const auto found = tokens_.find(hashOf(token));
  if (found == tokens_.end() || found->second.expires_ns <= now_ns) return std::nullopt;
  Entry& entry = found->second;
  entry.expires_ns = std::min(now_ns + std::chrono::nanoseconds(lifetime_).count(),
                              entry.holder.password_ns + std::chrono::nanoseconds(longest_).count());
  return entry.expires_ns;
}

std::optional<std::int64_t> Tokens::endOf(std::string_view token, std::int64_t now_ns) const {
  const auto found = tokens_.find(hashOf(token));
  if (found == tokens_.end() || found->second.expires_ns <= now_ns) return std::nullopt;
  return found->second.expires_ns;
}

bool Tokens::end(std::string_view token) {
  return tokens_.erase(hashOf(token)) > 0;
}

std::size_t Tokens::forget(const std::string& name) {
  return std::erase_if(tokens_, [&](const auto& entry) { return entry.second.holder.who.name == name; });
}

void Tokens::dropExpired(std::int64_t now_ns) {
  std::erase_if(tokens_, [&](const auto& entry) { return entry.second.expires_ns <= now_ns; });
}

}  // namespace needlelab
