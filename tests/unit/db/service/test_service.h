/// A store in a fresh folder with the samples, and requests from any user.
#pragma once

#include <memory>
#include <string>

#include "db/people/people.h"
#include "db/people/person_refs.h"
#include "db/service/start/bootstrap.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {

inline std::unique_ptr<Store> openStore(const std::filesystem::path& folder,
                                        TimeSource& time = machineTime()) {
  Store::Options options;
  options.time = &time;
  if (onPostgres()) options.store_url = postgresUrlOf(folder);
  options.writer.window = std::chrono::milliseconds(1);
  auto store = Store::open(folder, options);
  if (!store) throw std::runtime_error(store.error().message);
  return std::move(*store);
}

class ServiceTest : public testing::Test {
 protected:
  /// `who` by name, as a logged-in user if there is such an account.
  Outcome ask(const Principal& who, const pb::Request& request) {
    return store->service().execute(loggedIn(who), request);
  }
  Principal loggedIn(Principal who) {
    if (who.role == pb::STATION) return who;
    auto reader = store->readers().borrow();
    const auto ref = findPerson(**reader, who.name, Named::kAccountOrTyped);
    if (ref && *ref) who.name = **ref;
    return who;
  }
  /// The ref of an account.
  std::string refOf(const std::string& name) {
    const auto account = store->service().logins().principalOf(name);
    return account && *account ? (*account)->name : "no account " + name;
  }
  /// Returns the reply. Fails the test if the request is refused.
  pb::Reply get(const Principal& who, const pb::Request& request) {
    const Outcome outcome = ask(who, request);
    EXPECT_FALSE(outcome.error.has_value()) << outcome.error->message;
    return outcome.reply;
  }
  /// Returns the code of the refusal. Fails the test if the request is accepted.
  ErrorCode refusal(const Principal& who, const pb::Request& request) {
    const Outcome outcome = ask(who, request);
    EXPECT_TRUE(outcome.error.has_value());
    EXPECT_EQ(outcome.reply.result_case(), pb::Reply::RESULT_NOT_SET);
    return outcome.error ? outcome.error->code : ErrorCode::kFailed;
  }
  Status change(const DbWriter::Work& work) { return store->writer().run(work); }
  /// Adds a person without the cost of hashing a password.
  void addPerson(const std::string& name, pb::Role role) {
    ASSERT_OK(change([&](Connection& c) { return PeopleStore(c).add({name, role, "", false, 1}); }));
  }
  void addStation() {
    ASSERT_OK(change([](Connection& c) { return StationStore(c).add("station-1", StationKeyBytes{}, 1); }));
  }
  /// Adds an open session with chunks 0 … chunks−1.
  Uuid addSession(const std::string& of_trainee, std::uint64_t chunks, std::size_t samples_each = 20,
                  const std::string& profile_json = "") {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = describe(id);
      d.set_trainee(of_trainee);
      if (!profile_json.empty()) d.set_profile_json(profile_json);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      for (std::uint64_t seq = 0; seq < chunks; ++seq) {
        auto appended = SessionStore(c).append(id, seq, chunkOf(seq, samples_each));
        if (!appended) return appended.error();
      }
      return {};
    }));
    return id;
  }

  TempFolder folder;
  PostgresBelow dropped_at_end{folder.path()};
  std::unique_ptr<Store> store = openStore(folder.path() / "data");
  const Principal admin{"ada", pb::ADMINISTRATOR};
  const Principal manager{"mia", pb::CURRICULUM_MANAGER};
  const Principal instructor{"ina", pb::INSTRUCTOR};
  const Principal trainee{"anna", pb::TRAINEE};
  const Principal station{"station-1", pb::STATION};
};

}  // namespace needlelab::test
