#include "db/store/store_address.h"

#include <thread>

#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

TEST(ReaderPool, lendsAConnectionAgain) {
  test::TestDb db;
  ReaderPool pool(db.path);
  const sqlite3* first = nullptr;
  {
    auto lease = pool.borrow();
    ASSERT_OK(lease);
    first = (*lease)->handle();
    auto second = pool.borrow();
    ASSERT_OK(second);
    EXPECT_NE((*second)->handle(), first);
  }
  bool again = false;
  auto a = pool.borrow(), b = pool.borrow();
  again = (*a)->handle() == first || (*b)->handle() == first;
  EXPECT_TRUE(again);
}

TEST(ReaderPool, servesManyThreadsWhileTheWriterWrites) {
  test::TestDb db;
  ReaderPool pool(db.path, 2);
  std::vector<std::thread> threads;
  std::atomic<int> failures = 0;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 50; ++i) {
        auto lease = pool.borrow();
        if (!lease || !StationStore(**lease).list().ok()) ++failures;
      }
    });
  }
  for (int i = 0; i < 50; ++i)
    ASSERT_OK(StationStore(db.writer).add("s" + std::to_string(i), StationKeyBytes{}, 1));
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(failures, 0);
}

TEST(ReaderPool, aMissingDatabaseIsAnError) {
  const test::TempFolder folder;
  ReaderPool pool(folder.path() / "none.db");
  EXPECT_EQ(pool.borrow().error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace needlelab
