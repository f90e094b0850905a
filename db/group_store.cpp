#include "db/group_store.h"

#include <algorithm>

#include "common/base/text.h"
#include "db/people_store.h"
#include "db/revision.h"

namespace needlelab {
namespace {

constexpr std::string_view kGroup = "SELECT id, name, revision, changed_by, changed_unix_ns FROM groups ";

pb::Group groupOf(const Statement& row) {
  pb::Group group;
  group.set_id(row.text(0));
  group.set_name(row.text(1));
  group.set_revision(static_cast<std::uint32_t>(row.natural(2)));
  group.set_changed_by(row.text(3));
  group.set_changed_unix_ns(row.integer(4));
  return group;
}

Error noGroup(std::string_view id) {
  return {ErrorCode::kNotFound, "there is no group '" + std::string(id) + "'"};
}

/// Sorted, each once. kInvalidInput.
Result<std::vector<std::string>> membersOf(const pb::Group& group) {
  if (group.members_size() > kMaxGroupMembers)
    return Error{ErrorCode::kInvalidInput, "group '" + group.id() + "', members: has " +
                                               std::to_string(group.members_size()) +
                                               ", allowed are at most " + std::to_string(kMaxGroupMembers)};
  std::vector<std::string> members(group.members().begin(), group.members().end());
  std::sort(members.begin(), members.end());
  const auto twice = std::adjacent_find(members.begin(), members.end());
  if (twice != members.end())
    return Error{ErrorCode::kInvalidInput,
                 "group '" + group.id() + "', members: '" + printable(*twice) + "' is named twice"};
  return members;
}

}  // namespace

Result<pb::Group> GroupStore::put(const pb::Group& group, std::optional<std::uint32_t> base,
                                  const std::string& by, std::int64_t now_unix_ns) {
  if (auto valid = checkName("group id", group.id()); !valid) return valid.error();
  if (auto valid = checkText("group '" + group.id() + "', name", group.name(), 1, 200); !valid)
    return valid.error();
  const auto wanted = membersOf(group);
  if (!wanted) return wanted.error();

  // a removed group's revisions go on, but for an edit there is none
  std::uint32_t last = 0;
  {
    auto row = connection_.query("SELECT revision, removed FROM groups WHERE id = ?", group.id());
    const auto found = row.step();
    if (!found) return found.error();
    if (*found) last = static_cast<std::uint32_t>(row.natural(0));
  }
  const auto before = get(group.id());
  if (!before && before.error().code != ErrorCode::kNotFound) return before.error();
  const NewestRevision newest =
      before ? NewestRevision{before->revision(), before->changed_by(), before->changed_unix_ns()}
             : NewestRevision{};
  if (auto same = checkBase("group '" + group.id() + "'", base, newest); !same) return same.error();
  if (last == 0) {
    if (auto valid = checkNewName("group id", group.id()); !valid) return valid.error();
  }
  if (before && before->name() == group.name() &&
      std::equal(wanted->begin(), wanted->end(), before->members().begin(), before->members().end()))
    return *before;

  if (auto done = connection_.run(
          "INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns) VALUES (?,?,?,?,?) ON "
          "CONFLICT (id) DO UPDATE"
          " SET name = excluded.name, revision = excluded.revision, changed_by = excluded.changed_by,"
          " changed_unix_ns = excluded.changed_unix_ns, removed = 0",
          group.id(), group.name(), last + 1, by, now_unix_ns);
      !done)
    return done.error();
  if (auto done = connection_.run("DELETE FROM group_members WHERE group_id = ?", group.id()); !done)
    return done.error();
  for (const std::string& member : *wanted) {
    const auto person = PeopleStore(connection_).find(member);
    if (!person) return person.error();
    if (!*person)
      return Error{ErrorCode::kNotFound, "group '" + group.id() + "', members: there is no person named '" +
                                             printable(member) + "'"};
    if (auto done =
            connection_.run("INSERT INTO group_members (group_id, person) VALUES (?,?)", group.id(), member);
        !done)
      return done.error();
  }
  return get(group.id());
}

Status GroupStore::remove(const std::string& id, std::optional<std::uint32_t> base, const std::string& by,
                          std::int64_t now_unix_ns) {
  const auto group = get(id);
  if (!group) return group.error();
  if (auto same = checkBase("group '" + id + "'", base,
                            {group->revision(), group->changed_by(), group->changed_unix_ns()});
      !same)
    return same;
  if (auto done = connection_.run("DELETE FROM assignments WHERE group_id = ?", id); !done) return done;
  if (auto done = connection_.run("DELETE FROM group_members WHERE group_id = ?", id); !done) return done;
  return connection_.run(
      "UPDATE groups SET removed = 1, revision = revision + 1, changed_by = ?, changed_unix_ns = ? WHERE id "
      "= ?",
      by, now_unix_ns, id);
}

Result<pb::Group> GroupStore::get(std::string_view id) {
  std::optional<pb::Group> group;
  {
    auto row = connection_.query(std::string(kGroup) + "WHERE id = ? AND removed = 0", id);
    const auto found = row.step();
    if (!found) return found.error();
    if (!*found) return noGroup(id);
    group = groupOf(row);
  }
  const auto names = members(id);
  if (!names) return names.error();
  for (const std::string& name : *names) group->add_members(name);
  return *group;
}

Result<std::vector<pb::Group>> GroupStore::list() {
  std::vector<pb::Group> groups;
  auto rows = connection_.query(std::string(kGroup) + "WHERE removed = 0 ORDER BY id");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return groups;
    auto& group = groups.emplace_back(groupOf(rows));
    const auto names = members(group.id());
    if (!names) return names.error();
    for (const std::string& name : *names) group.add_members(name);
  }
}

Result<std::vector<std::string>> GroupStore::groupsOf(std::string_view person) {
  std::vector<std::string> ids;
  auto rows =
      connection_.query("SELECT group_id FROM group_members WHERE person = ? ORDER BY group_id", person);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return ids;
    ids.push_back(rows.text(0));
  }
}

Result<std::vector<std::string>> GroupStore::members(std::string_view id) {
  std::vector<std::string> names;
  auto rows = connection_.query("SELECT person FROM group_members WHERE group_id = ? ORDER BY person", id);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return names;
    names.push_back(rows.text(0));
  }
}

}  // namespace needlelab
