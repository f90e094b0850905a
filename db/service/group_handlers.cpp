#include <algorithm>
#include <iterator>
#include <vector>

#include "db/people.h"
#include "db/service/handlers.h"
#include "db/service/page.h"

namespace needlelab::handlers {
namespace {

/// "a, b and 3 more"
std::string someNames(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 5;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) text += (i == 0 ? "" : ", ") + names[i];
  if (names.size() > kMost) text += " and " + std::to_string(names.size() - kMost) + " more";
  return text;
}

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
  std::string text = "revision " + std::to_string(after.revision());
  if (before.name() != after.name()) text += "; name: '" + after.name() + "'";
  if (!joined.empty()) text += "; joined: " + someNames(joined);
  if (!left.empty()) text += "; left: " + someNames(left);
  return text;
}

Result<pb::Reply> putGroup(const Context& context, const pb::PutGroup& call) {
  pb::Group stored;
  std::string detail;
  const auto status = edit(context, call.group().id(), detail, [&](Connection& writer) {
    GroupStore groups(writer);
    const auto before = groups.get(call.group().id());
    if (!before && before.error().code != ErrorCode::kNotFound) return Status(before.error());
    auto put = groups.put(call.group(), call.base_revision(), context.who.name, context.now_unix_ns);
    if (!put) return Status(put.error());
    stored = std::move(*put);
    detail = groupChange(before ? *before : pb::Group(), stored);
    return Status();
  });
  if (!status) return status.error();
  return groupReply(std::move(stored));
}

Result<pb::Reply> getGroup(const Context& context, const pb::GetGroup& call) {
  auto group = GroupStore(context.reader).get(call.id());
  if (!group) return group.error();
  return groupReply(std::move(*group));
}

Result<pb::Reply> listGroups(const Context& context, const pb::ListGroups& call) {
  auto groups = GroupStore(context.reader).list();
  if (!groups) return groups.error();
  pb::Reply reply;
  auto* list = reply.mutable_groups();
  PageRoom room;
  for (pb::Group& group : *groups) {
    if (group.id() <= call.page()) continue;
    if (!room.take(group.ByteSizeLong())) {
      list->set_next_page(list->groups().rbegin()->id());
      break;
    }
    *list->add_groups() = std::move(group);
  }
  return reply;
}

Result<pb::Reply> removeGroup(const Context& context, const pb::RemoveGroup& call) {
  const auto status = edit(context, call.id(), "with its assignments", [&](Connection& writer) {
    return GroupStore(writer).remove(call.id(), call.base_revision(), context.who.name, context.now_unix_ns);
  });
  if (!status) return status.error();
  return doneReply();
}

}  // namespace needlelab::handlers
