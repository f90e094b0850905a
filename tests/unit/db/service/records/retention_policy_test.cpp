// Retention policies, a disk without enough space for them, and the pieces in which leftovers are removed.
#include <atomic>
#include <vector>

#include "common/base/time/clock.h"
#include "db/sessions/session_rows.h"
#include "tests/unit/db/service/records/retention_fixture.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

using RetentionPolicyTest = test::RetentionTest;

TEST_F(RetentionPolicyTest, policiesAreShownAndBadOnesRefused) {
  (void)get(manager, policy(30, 100, 365, "knee-recess"));
  (void)get(admin, policy(-1, 0, -1));
  pb::Request show;
  show.mutable_list_retention();
  const auto shown = get(manager, show).retention();
  ASSERT_EQ(shown.policies_size(), 2);
  EXPECT_EQ(shown.policies(0).exercise_id(), "");
  EXPECT_EQ(shown.policies(1).by(), "mia");
  EXPECT_EQ(shown.policies(1).thin_after_days(), 30u);
  EXPECT_GT(shown.policies(1).changed_unix_ns(), 0);
  EXPECT_EQ(refusal(manager, policy(30, 0, -1)), ErrorCode::kInvalidInput);
}

TEST_F(RetentionPolicyTest, aMisspeltExerciseIsRefusedAndThoseThereAreNamed) {
  const Outcome refused = ask(manager, policy(30, 100, 365, "knee-reces"));
  ASSERT_TRUE(refused.error.has_value());
  EXPECT_EQ(refused.error->code, ErrorCode::kInvalidInput);
  EXPECT_NE(refused.error->message.find("'knee-reces'"), std::string::npos) << refused.error->message;
  EXPECT_NE(refused.error->message.find("knee-recess"), std::string::npos) << refused.error->message;
  pb::Request show;
  show.mutable_list_retention();
  EXPECT_EQ(get(manager, show).retention().policies_size(), 0) << "nothing is left of it";
  // This store has no curriculum with the exercise, but its sessions still exist.
  EXPECT_EQ(refusal(manager, policy(30, 100, 365, "knee-1")), ErrorCode::kInvalidInput);
  (void)addClosed(5);
  (void)get(manager, policy(30, 100, 365, "knee-1"));
}

TEST_F(RetentionPolicyTest, deletionsComeFirstAndThinningStopsWithoutRoom) {
  const Uuid thin = addClosed(), remove = addClosed();
  ASSERT_OK(change([&](Connection& c) {
    return c.run("UPDATE sessions SET exercise_id = 'wrist-joint' WHERE id = ?", ByteView(remove));
  }));
  (void)get(manager, policy(0, 100, -1, "knee-1"));
  (void)get(manager, policy(-1, 0, 0, "wrist-joint"));
  const std::atomic<bool> stop = false;
  std::uint64_t room = 0, asked = 0, runs_out_after = UINT64_MAX;
  const RetentionPace pace{.rows = 8, .bytes = 64, .pause = 0ms, .min_free_bytes = 64u << 20};
  const RetentionTools tools{
      store->writer(),
      store->readers(),
      [](const Uuid&) { return Status(); },
      [] { return false; },
      stop,
      pace,
      [&]() -> std::optional<std::uint64_t> { return asked++ < runs_out_after ? room : 0; }};
  const auto run = [&] {
    asked = 0;
    const auto report = runRetention(tools, {"test"}, wallNowNs(), false);
    EXPECT_OK(report);
    return report.ok() ? *report : pb::RetentionReport();
  };
  // no space even for the pages of a deletion
  room = 1u << 20;
  EXPECT_EQ(run().left_alone(), 2u);
  EXPECT_FALSE(info(remove).has_removed_original());
  // an eighth: actions that free space run, and run first, although their exercise comes last
  room = 10u << 20;
  const auto report = run();
  ASSERT_EQ(report.steps_size(), 2);
  EXPECT_EQ(report.steps(0).action(), pb::RetentionStep::DELETE);
  EXPECT_EQ(report.steps(1).action(), pb::RetentionStep::LEFT_ALONE);
  EXPECT_NE(report.steps(1).text().find("no room"), std::string::npos) << report.steps(1).text();
  EXPECT_FALSE(info(thin).has_removed_original());
  // The space runs out in the middle: the written part is removed.
  room = 1u << 30;
  runs_out_after = 1;  // only the check before it began
  EXPECT_EQ(run().left_alone(), 1u);
  EXPECT_GT(asked, 1u);
  EXPECT_FALSE(info(thin).has_removed_original());
  {
    auto reader = store->readers().borrow();
    EXPECT_TRUE(RetentionStore(**reader).leftovers()->empty());
  }
  // Exactly the space that must stay free: the pages freed in the database suffice.
  room = 64u << 20;
  runs_out_after = UINT64_MAX;
  EXPECT_EQ(run().thinned(), 1u);
  EXPECT_TRUE(sound());
}

TEST_F(RetentionPolicyTest, whatIsLeftOfShortRecordingsGoesManySessionsAPiece) {
  (void)addClosed(20);
  std::vector<Uuid> shorts;
  while (shorts.size() < 40) shorts.push_back(addClosed(1));
  ASSERT_OK(change([](Connection& c) {
    return c.script(
        "INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns, reason, by_whom, leftover,"
        " crcs) SELECT number, 1, 1, 'x', 'x', 1, zeroblob(4) FROM sessions;"
        "UPDATE sessions SET recording = 3;"
        "UPDATE chunks SET bytes = zeroblob(length(bytes)) WHERE session = 4");
  }));
  const std::atomic<bool> stop = false;
  const RetentionTools tools{store->writer(),
                             store->readers(),
                             [](const Uuid&) { return Status(); },
                             [] { return false; },
                             stop,
                             {.rows = 16, .pause = std::chrono::milliseconds(0)}};
  LeftoversSoFar so_far;
  struct Left {
    std::int64_t chunks;
    std::size_t sessions;
  };
  // 16 of the long one; its other 4 and 12 short ones, one of them damaged; 16; 12
  for (const Left& left : {Left{44, 41}, Left{29, 29}, Left{13, 13}, Left{1, 1}}) {
    ASSERT_TRUE(so_far.more);
    ASSERT_OK(removeSomeLeftovers(tools, 1, so_far));
    auto reader = store->readers().borrow();
    auto chunks = (*reader)->prepare("SELECT count(*) FROM chunks");
    ASSERT_OK(chunks.step());
    EXPECT_EQ(chunks.integer(0), left.chunks);
    EXPECT_EQ(RetentionStore(**reader).leftovers()->size(), left.sessions);
  }
  EXPECT_FALSE(so_far.more);
  ASSERT_EQ(so_far.damaged.size(), 1u);
  EXPECT_EQ(so_far.damaged.begin()->first, shorts[2]);
}

}  // namespace
}  // namespace needlelab
