/// People: name, role, password hash. Never deleted, only disabled: sessions and the audit log name them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "db/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

struct Person {
  std::string name;
  pb::Role role = pb::ROLE_UNSPECIFIED;
  std::string password_hash;  ///< empty: cannot log in
  bool disabled = false;
  std::int64_t created_unix_ns = 0;
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class PeopleStore {
 public:
  explicit PeopleStore(Connection& connection) : connection_(connection) {}

  /// Errors: kInvalidInput (name, role), kAlreadyExists.
  Status add(const Person& person);
  /// kNotFound.
  Status setPasswordHash(std::string_view name, std::string_view hash);
  /// kNotFound. kDenied: the last administrator who can log in is not disabled.
  Status setDisabled(std::string_view name, bool disabled);
  /// Nothing when there is no such person.
  Result<std::optional<Person>> find(std::string_view name);
  /// By name.
  Result<std::vector<Person>> list();

 private:
  Connection& connection_;
};

}  // namespace needlelab
