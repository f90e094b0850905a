/// Groups of people: classes, courses' cohorts. Edited with a revision.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Most members of a group: it must fit into a message.
inline constexpr int kMaxGroupMembers = 5000;

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's and
/// a transaction.
class GroupStore {
 public:
  explicit GroupStore(Connection& connection) : connection_(connection) {}

  /// Name and members as given, in place of those before; gives it with its revision, which is the same when
  /// nothing differs. `base`: the revision that the change was made from (0: it must be new), else kConflict;
  /// absent: whichever. kInvalidInput: id, name, a member twice, too many; kNotFound: a member is nobody.
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
  Result<std::vector<std::string>> members(std::string_view id);
  Connection& connection_;
};

}  // namespace needlelab
