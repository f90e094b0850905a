#include "server/live/login/tokens.h"

#include <algorithm>

#include <sodium.h>

namespace needlelab {
std::int64_t Tokens::expiryOf(const Holder& holder, std::int64_t now_ns) const {
  return std::min(now_ns + std::chrono::nanoseconds(limits_.lifetime).count(),
                  holder.password_ns + std::chrono::nanoseconds(limits_.longest).count());
}

void Tokens::tidy(std::int64_t now_ns) {
  std::erase_if(tokens_, [&](const auto& entry) { return entry.second.expires_ns <= now_ns; });
}

Tokens::Issued Tokens::issue(const Holder& holder, std::int64_t now_ns) {
  Issued issued{std::string(32, '\0'), expiryOf(holder, now_ns)};
  randombytes_buf(issued.token.data(), issued.token.size());
  keep(issued.token, holder, issued.expires_ns, now_ns);
  return issued;
}

void Tokens::keep(std::string_view token, const Holder& holder, std::int64_t expires_ns,
                  std::int64_t now_ns) {
  tidy(now_ns);
  const auto isTheirs = [&](const auto& entry) { return entry.second.holder.who.name == holder.who.name; };
  const bool too_many_of_person = static_cast<std::size_t>(std::count_if(tokens_.begin(), tokens_.end(),
                                                                         isTheirs)) >= limits_.max_of_person;
  if (too_many_of_person || tokens_.size() >= limits_.max_tokens) {
    auto first = tokens_.end();
    for (auto it = tokens_.begin(); it != tokens_.end(); ++it) {
      if ((!too_many_of_person || isTheirs(*it)) &&
          (first == tokens_.end() || it->second.expires_ns < first->second.expires_ns))
        first = it;
    }
    tokens_.erase(first);
  }
  tokens_[LoginKey::hashOfToken(token)] = {holder, expires_ns};
}

const Tokens::Entry* Tokens::entryOf(std::string_view token, std::int64_t now_ns) const {
  const auto found = tokens_.find(LoginKey::hashOfToken(token));
  return found == tokens_.end() || found->second.expires_ns <= now_ns ? nullptr : &found->second;
}

std::optional<Tokens::Holder> Tokens::find(std::string_view token, std::int64_t now_ns) const {
  const Entry* const entry = entryOf(token, now_ns);
  return entry == nullptr ? std::nullopt : std::optional(entry->holder);
}

std::optional<std::int64_t> Tokens::renew(std::string_view token, std::int64_t now_ns) {
  if (entryOf(token, now_ns) == nullptr) return std::nullopt;
  Entry& entry = tokens_.at(LoginKey::hashOfToken(token));
  entry.expires_ns = expiryOf(entry.holder, now_ns);
  return entry.expires_ns;
}

std::optional<std::int64_t> Tokens::endOf(std::string_view token, std::int64_t now_ns) const {
  const Entry* const entry = entryOf(token, now_ns);
  return entry == nullptr ? std::nullopt : std::optional(entry->expires_ns);
}

bool Tokens::end(std::string_view token) {
  return tokens_.erase(LoginKey::hashOfToken(token)) > 0;
}

std::vector<Principal> Tokens::holders() const {
  std::vector<Principal> all;
  for (const auto& [hash, entry] : tokens_) all.push_back(entry.holder.who);
  return all;
}

std::size_t Tokens::forget(const std::string& name) {
  return std::erase_if(tokens_, [&](const auto& entry) { return entry.second.holder.who.name == name; });
}

}  // namespace needlelab
