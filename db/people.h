/// People, the groups they are in, and what they said to studies.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/teaching.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Name, role, password hash. A person is disabled, not deleted, because sessions and the audit log name it;
/// a person who must be forgotten is erased (erasure.h).
struct Person {
  std::string name;
  pb::Role role = pb::ROLE_UNSPECIFIED;
  std::string password_hash;  ///< empty: cannot log in
  bool disabled = false;
  std::int64_t created_unix_ns = 0;
  std::string full_name = {};
  std::uint32_t revision = 1;        ///< of role, disabled and full_name; filled by the store
  std::int64_t changed_unix_ns = 0;  ///< filled by the store
  std::string changed_by = {};       ///< empty: as it was made
};

/// What a change sets; the rest stays.
struct PersonChange {
  std::optional<pb::Role> role = {};
  std::optional<bool> disabled = {};
  std::optional<std::string> full_name = {};
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class PeopleStore {
 public:
  explicit PeopleStore(Connection& connection) : connection_(connection) {}

  /// Errors: kInvalidInput (name, role, full name), kAlreadyExists.
  Status add(const Person& person);
  /// kNotFound.
  Status setPasswordHash(std::string_view name, std::string_view hash);
  /// Gives the person after the change. `base`: the revision that the change was made from, or none: any.
  /// kNotFound; kConflict; kInvalidInput; kDenied: it would disable, or give another role to, the last
  /// administrator who can log in.
  Result<Person> change(std::string_view name, std::optional<std::uint32_t> base, const PersonChange& change,
                        std::string_view by, std::int64_t now_unix_ns);
  Status setDisabled(std::string_view name, bool disabled, std::string_view by = {},
                     std::int64_t now_unix_ns = 0);
  /// Nothing when there is no such person.
  Result<std::optional<Person>> find(std::string_view name);
  /// By name.
  Result<std::vector<Person>> list();

 private:
  Connection& connection_;
};

/// Most members of a group: a group must fit into a message.
inline constexpr int kMaxGroupMembers = 5000;

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's and
/// a transaction.
class GroupStore {
 public:
  explicit GroupStore(Connection& connection) : connection_(connection) {}

  /// Name and members as given, in place of those before; gives it with its revision, which is the same when
  /// nothing differs. `base`: the revision that the change was made from (0: it must be new), else kConflict;
  /// absent: any. kInvalidInput: id, name, a member twice, too many; kNotFound: a member does not exist.
  Result<pb::Group> put(const pb::Group& group, std::optional<std::uint32_t> base, const std::string& by,
                        std::int64_t now_unix_ns);
  /// Its members and its assignments go with it; a group of this id that is made again goes on with its
  /// revisions. kNotFound, kConflict.
  Status remove(const std::string& id, std::optional<std::uint32_t> base, const std::string& by,
                std::int64_t now_unix_ns);
  /// kNotFound.
  Result<pb::Group> get(std::string_view id);
  /// By id, with their members.
  Result<std::vector<pb::Group>> list();
  /// Ids of the groups that a person is in, in order.
  Result<std::vector<std::string>> groupsOf(std::string_view person);

 private:
  Result<pb::Group> withMembers(pb::Group group);
  Result<std::vector<std::string>> members(std::string_view id);
  Connection& connection_;
};

/// People's statements on studies. Each is kept; the latest one counts.
/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class ConsentStore {
 public:
  explicit ConsentStore(Connection& connection) : connection_(connection) {}

  /// kNotFound: no such person; kInvalidInput: the note.
  Status add(const std::string& person, const pb::Consent& consent);
  /// Oldest first.
  Result<std::vector<pb::Consent>> list(std::string_view person);
  /// Nothing: the person was never asked.
  Result<std::optional<pb::Consent>> newest(std::string_view person);
  /// Names of the people in the database who consent now, in order.
  Result<std::vector<std::string>> consenting();

 private:
  Connection& connection_;
};

}  // namespace needlelab
