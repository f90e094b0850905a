/// People: name, role, password hash. Disabled, not deleted: sessions and the audit log name them. Who must
/// be forgotten is erased (erasure_store.h).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

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

/// What shall be other than it is.
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
  /// As it is then. `base`: the revision that the change was made from, or whichever. kNotFound; kConflict;
  /// kInvalidInput; kDenied: the last administrator who can log in is neither disabled nor made something
  /// else.
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

}  // namespace needlelab
