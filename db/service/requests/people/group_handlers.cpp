// Groups of people, and descriptions of changes to them.
#include <fmt/core.h>
#include <algorithm>
#include <iterator>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "db/people/look_alikes.h"
#include "db/people/people.h"
#include "db/service/requests/handlers.h"
#include "db/store/connection.h"

namespace needlelab::handlers {

std::string someNames(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 5;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) text += (i == 0 ? "" : ", ") + names[i];
  if (names.size() > kMost) text += fmt::format(" and {} more", names.size() - kMost);
  return text;
}

namespace {

pb::Reply groupReply(pb::Group group) {
  pb::Reply reply;
  *reply.mutable_group() = std::move(group);
  return reply;
}

}  // namespace

std::string groupChange(const pb::Group& before, const pb::Group& after) {
  std::vector<std::string> joined, left;
  std::set_difference(after.members().begin(), after.members().end(), before.members().begin(),
                      before.members().end(), std::back_inserter(joined));
  std::set_difference(before.members().begin(), before.members().end(), after.members().begin(),
                      after.members().end(), std::back_inserter(left));
  std::string text = fmt::format("revision {}", after.revision());
  if (before.name() != after.name()) text += "; name: '" + after.name() + "'";
  if (!joined.empty()) text += "; joined: " + someNames(joined);
  if (!left.empty()) text += "; left: " + someNames(left);
  return text;
}

Result<pb::Reply> putGroup(const Context& context, const pb::PutGroup& call) {
  pb::Group stored;
  std::string detail;
  RETURN_IF_ERROR(edit(context, call.group().id(), detail, [&](Connection& writer) -> Status {
    GroupStore groups(writer);
    ASSIGN_OR_RETURN(const auto before, groups.find(call.group().id()));
    if (!before || before->name() != call.group().name())
      RETURN_IF_ERROR(checkNewNames(writer, Thing::kGroup, call.group().id(), call.group().name()));
    auto put = groups.put(call.group(), call.base_revision(), context.who.name, context.now_unix_ns);
    if (!put) return put.error();
    stored = std::move(*put);
    detail = groupChange(before ? *before : pb::Group(), stored);
    return {};
  }));
  return groupReply(std::move(stored));
}

Result<pb::Reply> getGroup(const Context& context, const pb::GetGroup& call) {
  ASSIGN_OR_RETURN(auto group, GroupStore(context.reader).get(call.id()));
  return groupReply(std::move(group));
}

namespace {

/// Groups from `begin` on whose members are few enough in total for a single read.
std::span<pb::Group> fewMembers(std::vector<pb::Group>& groups, std::size_t begin) {
  constexpr std::uint64_t kMembersAtOnce = 2 * kMaxGroupMembers;
  std::size_t end = begin;
  for (std::uint64_t members = 0; end < groups.size() && (end == begin || members < kMembersAtOnce); ++end)
    members += groups[end].member_count();
  return std::span(groups).subspan(begin, end - begin);
}

}  // namespace

Result<pb::Reply> listGroups(const Context& context, const pb::ListGroups& call) {
  constexpr std::uint64_t kMost = 500, kReadAtOnce = 100;
  if (!call.search().empty()) RETURN_IF_ERROR(checkText("search", call.search(), 1, kMaxNameBytes));
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  GroupStore store(context.reader);
  const std::uint64_t most = call.limit() == 0 ? UINT32_MAX : std::min<std::uint64_t>(call.limit(), kMost);
  pb::Reply reply;
  auto* list = reply.mutable_groups();
  PageRoom room;
  std::string after = call.page();
  for (;;) {
    // one more than fits on the page shows whether there is a next one
    const auto left = most - static_cast<std::uint64_t>(list->groups_size());
    const std::uint64_t wanted = std::min(left + 1, kReadAtOnce);
    ASSIGN_OR_RETURN(auto groups, store.page(call.search(), after, wanted));
    for (std::size_t begin = 0; begin < groups.size();) {
      const auto some = call.brief() ? std::span(groups) : fewMembers(groups, begin);
      if (!call.brief()) RETURN_IF_ERROR(store.addMembers(some));
      for (pb::Group& group : some) {
        const bool is_full = static_cast<std::uint64_t>(list->groups_size()) == most;
        if (is_full || !room.take(group)) {
          list->set_next_page(after);
          return reply;
        }
        after = group.id();
        *list->add_groups() = std::move(group);
      }
      begin += some.size();
    }
    if (groups.size() < wanted) return reply;
  }
}

Result<pb::Reply> removeGroup(const Context& context, const pb::RemoveGroup& call) {
  RETURN_IF_ERROR(edit(context, call.id(), "with its assignments", [&](Connection& writer) {
    return GroupStore(writer).remove(call.id(), call.base_revision(), context.who.name, context.now_unix_ns);
  }));
  return doneReply();
}

}  // namespace needlelab::handlers
