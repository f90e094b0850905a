/// People, their groups, and their consent to studies.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/teaching.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Name, role, hashes of password and code. A person is disabled, not deleted; to delete their data, erase
/// them (erasure.h).
struct Person {
  std::string name;
  pb::Role role = pb::ROLE_UNSPECIFIED;
  std::string password_hash;  ///< empty: cannot log in
  bool disabled = false;
  std::int64_t created_unix_ns = 0;
  std::string full_name = {};
  std::uint32_t revision = 1;        ///< of role, disabled and full_name; set by the store
  std::int64_t changed_unix_ns = 0;  ///< set by the store
  std::string changed_by = {};       ///< empty: never changed
  std::string code_hash = {};        ///< of a trainee's code; empty: no code
  std::string ref = {};              ///< "@17", used by other rows to refer to the person; set by the store
};

/// The fields to change; absent ones stay.
struct PersonChange {
  std::optional<pb::Role> role = {};
  std::optional<bool> disabled = {};
  std::optional<std::string> full_name = {};
  std::optional<std::string> name = {};  ///< errors as PeopleStore::add()
};

/// Does not own the connection. `who` is always a ref or a name. Thread: as its Connection; changes need the
/// writer's.
class PeopleStore {
 public:
  explicit PeopleStore(Connection& connection) : connection_(connection) {}

  /// `ref` (may be null) receives the new person's ref. Errors: kInvalidInput (name, by checkNewPersonName();
  /// role; full name), kAlreadyExists (a name with the same nameKey()).
  Status add(const Person& person, std::string* ref = nullptr);
  /// kNotFound.
  Status setPasswordHash(std::string_view who, std::string_view hash);
  /// The hash of the code that a station asks for (credentials.h); empty: no code. kNotFound.
  Status setCodeHash(std::string_view who, std::string_view hash);
  /// Returns the changed person. `base`: the revision that the change is based on; nothing: any. kNotFound;
  /// kConflict; kInvalidInput; kDenied: it would disable, or change the role of, the last administrator who
  /// can log in.
  Result<Person> change(std::string_view who, std::optional<std::uint32_t> base, const PersonChange& change,
                        std::string_view by, std::int64_t now_unix_ns);
  /// kDenied: `person` is the last administrator who can log in.
  Status checkNotLast(const Person& person);
  Status setDisabled(std::string_view who, bool disabled, std::string_view by = {},
                     std::int64_t now_unix_ns = 0);
  /// Nothing if there is no such account.
  Result<std::optional<Person>> find(std::string_view who);
  /// The account whose name has the same nameKey().
  Result<std::optional<Person>> findNamed(std::string_view name);
  /// Those of the refs that exist, by ref; one statement.
  Result<std::map<std::string, Person>> findAll(std::span<const std::string> refs);
  /// Sorted by name.
  Result<std::vector<Person>> list();
  /// Empty or absent fields do not filter.
  struct Filter {
    std::string
        search;  ///< part of the name, the full name or a group's id; ignores the case of ASCII letters
    std::optional<pb::Role> role;
  };
  /// Those after `after`, by name; at most `most`.
  Result<std::vector<Person>> page(const Filter& filter, std::string_view after, std::uint64_t most);
  /// How many there are on all pages.
  Result<std::uint32_t> count(const Filter& filter);

 private:
  /// The ref of `who`; `who` itself if there is no such account.
  Result<std::string> refOf(std::string_view who);
  Connection& connection_;
};

/// Limits a group's size so that the group fits into a message.
inline constexpr int kMaxGroupMembers = 5000;
/// Limits the cost of listing one person's groups. A person who was already in more groups stays in them but
/// cannot join another.
inline constexpr std::size_t kMaxGroupsOfPerson = 100;

/// Does not own the connection. Thread: as its Connection; changes need the writer's and a transaction.
class GroupStore {
 public:
  explicit GroupStore(Connection& connection) : connection_(connection) {}

  /// Replaces name and members. Returns the group with its revision, which is unchanged if nothing differs.
  /// `base`: the revision that the change is based on (0: the group must be new), else kConflict; absent:
  /// any. kInvalidInput: id, name, a member twice, too many, or a new member is already in kMaxGroupsOfPerson
  /// groups; kNotFound: a member does not exist.
  Result<pb::Group> put(const pb::Group& group, std::optional<std::uint32_t> base, const std::string& by,
                        std::int64_t now_unix_ns);
  /// Removes the group with its members and assignments. A new group with the same id continues its revision
  /// numbers. kNotFound, kConflict.
  Status remove(const std::string& id, std::optional<std::uint32_t> base, const std::string& by,
                std::int64_t now_unix_ns);
  /// kNotFound, by requireThing(); kConflict: it was made meanwhile.
  Result<pb::Group> get(std::string_view id);
  /// Nothing if there is no such group.
  Result<std::optional<pb::Group>> find(std::string_view id);
  /// Those after `after`, by id, at most `most`; with the number of members instead of the members. `search`:
  /// part of the id or the name (ignores the case of ASCII letters); empty: all.
  Result<std::vector<pb::Group>> page(const std::string& search, std::string_view after, std::uint64_t most);
  /// Replaces the members' number with the members, by name; one statement.
  Status addMembers(std::span<pb::Group> groups);
  /// Ids of a person's groups, sorted.
  Result<std::vector<std::string>> groupsOf(std::string_view person);
  /// Same for several people, by ref; one statement. People without groups are omitted.
  Result<std::map<std::string, std::vector<std::string>>> groupsOfMany(std::span<const std::string> people);

 private:
  Result<pb::Group> withMembers(pb::Group group);
  Result<std::vector<std::string>> members(std::string_view id);
  /// kInvalidInput: the person is already in kMaxGroupsOfPerson other groups.
  Status checkMayJoin(const std::string& id, const std::string& person);
  /// Adds all of `wanted` (sorted) with the checks of put(), in three statements: PostgreSQL only.
  Status addMembersInBulk(const std::string& id, const std::vector<std::string>& wanted,
                          const std::vector<std::string>& present);
  Connection& connection_;
};

/// People's statements of consent to studies. All are kept; the latest one counts. Does not own the
/// connection. Thread: as its Connection; changes need the writer's.
class ConsentStore {
 public:
  explicit ConsentStore(Connection& connection) : connection_(connection) {}

  /// kNotFound: no such person; kInvalidInput: the note.
  Status add(const std::string& person, const pb::Consent& consent);
  /// The newest ones, newest first, while `take` returns true. The first one that it refuses is the last one
  /// read, so the cost does not grow with a person's history.
  Result<std::vector<pb::Consent>> newestOnes(std::string_view person,
                                              const std::function<bool(const pb::Consent&)>& take);
  /// Nothing: the person has made no statement.
  Result<std::optional<pb::Consent>> newest(std::string_view person);
  /// Same for several people, by person; one statement, and one index entry per person.
  Result<std::map<std::string, pb::Consent>> newestConsents(std::span<const std::string> people);
  /// Refs of people whose latest statement is consent, by name.
  Result<std::vector<std::string>> consenting();

 private:
  Connection& connection_;
};

}  // namespace needlelab
