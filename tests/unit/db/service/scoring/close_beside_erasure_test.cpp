// A close while its trainee's data are erased, on SQLite; for PostgreSQL: tests/postgres/isolation.
#include <gmock/gmock.h>
#include <sqlite3.h>

#include <functional>
#include <string>

#include "db/erasure/erasure.h"
#include "db/people/person_refs.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class CloseBesideErasure : public test::ServiceTest {
 protected:
  void SetUp() override { addStation(); }
  std::string kneeProfile() {
    pb::Request request;
    request.mutable_get_profile()->set_id("knee-adult");
    return get(admin, request).profile().json();
  }
  pb::SessionInfo info(const Uuid& id) {
    pb::Request request;
    request.mutable_get_session()->set_session_id(test::bytesOfId(id));
    return get(instructor, request).session();
  }
  void erase(const std::string& name) {
    constexpr std::int64_t kLater_unix_ns = 4'000'000'000'000'000'000;
    ASSERT_OK(change([&](Connection& c) -> Status {
      const auto ref = findPerson(c, name, Named::kAccountOrTyped);
      const auto done = ErasureStore(c).erase(ref->value(), {"ada", "", kLater_unix_ns});
      return done ? Status() : Status(done.error());
    }));
  }

  struct BeforeStatement {
    int left = 0;  ///< remaining statements until it runs
    std::function<void()> work;
  };
  /// Closes the session; runs `before.work` before a statement of its reader, the one returned last.
  Result<CloseOutcome> close(const Uuid& id, std::uint64_t chunks, BeforeStatement& before) {
    const auto trace = [&](unsigned what) {
      auto reader = store->readers().borrow();
      ASSERT_OK(reader);
      sqlite3_trace_v2((*reader)->handle(), what,
                       [](unsigned, void* context, void*, void*) {
                         auto& one = *static_cast<BeforeStatement*>(context);
                         if (one.left-- == 0) one.work();
                         return 0;
                       },
                       &before);
    };
    trace(SQLITE_TRACE_STMT);
    auto outcome =
        store->service().scoring().closeSession(test::closeOf(id, chunks, kSamplesOfEach), "station-1");
    trace(0);
    return outcome;
  }

  static constexpr std::size_t kSamplesOfEach = 60;
};

TEST_F(CloseBesideErasure, succeedsBeforeAnyStatementOfTheErasure) {
  constexpr std::uint64_t kChunks = 2;
  const std::string profile = kneeProfile();
  int statements = 0, closed_before = 0, closed_by_it = 0;
  for (bool within = true; within; ++statements) {
    const std::string name = "carl-" + std::to_string(statements);
    addPerson(name, pb::TRAINEE);
    const Uuid id = addSession(name, kChunks, kSamplesOfEach, profile);
    within = false;
    BeforeStatement erasure{statements, [&] {
                              within = true;
                              erase(name);
                            }};
    const auto outcome = close(id, kChunks, erasure);
    ASSERT_TRUE(outcome.ok()) << "before statement " << statements << ": " << outcome.error().message;
    EXPECT_TRUE(outcome->closed.taken()) << "before statement " << statements << ": " << outcome->closed.text;
    if (!within) break;
    ++(outcome->closed.kind == Closed::Kind::kClosed ? closed_before : closed_by_it);

    EXPECT_EQ(info(id).score_json(), "") << "before statement " << statements;
    // the station forgets its data
    BeforeStatement nothing{-1, {}};
    const auto again = close(id, kChunks, nothing);
    ASSERT_OK(again);
    EXPECT_EQ(again->closed.kind, Closed::Kind::kRepeated);
  }
  // before it reads the session, and between that and the hash; afterwards: before the score is stored
  EXPECT_GT(closed_by_it, 1);
  EXPECT_GT(closed_before, 3);
}

}  // namespace
}  // namespace needlelab
