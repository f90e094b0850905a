#include "server/live/work/offload.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <new>
#include <stdexcept>
#include <thread>

#include "server/base/log.h"

namespace needlelab {
namespace {

TEST(Offload, workRunsElsewhereAndItsResultComesBack) {
  asio::io_context io{1};
  asio::thread_pool pool{2};
  int sum = 0;
  const auto here = std::this_thread::get_id();
  const auto job = [](asio::thread_pool& on, int* out, std::thread::id home) -> Task<> {
    for (int i = 1; i <= 100; ++i) {
      std::function<Result<int>()> work = [i, home]() -> Result<int> {
        EXPECT_NE(std::this_thread::get_id(), home);
        return i;
      };
      auto got = co_await offload(on, std::move(work));
      EXPECT_EQ(std::this_thread::get_id(), home);
      *out += *got;
    }
  };
  asio::co_spawn(io, job(pool, &sum, here), rethrow);
  io.run();
  EXPECT_EQ(sum, 5050);
}

TEST(Offload, anExceptionComesOutWhereTheResultWould) {
  asio::io_context io{1};
  asio::thread_pool pool{1};
  std::string caught;
  const auto job = [](asio::thread_pool& on, std::string* out) -> Task<> {
    std::function<int()> work = []() -> int { throw std::runtime_error("no memory"); };
    try {
      (void)co_await offload(on, std::move(work));
    } catch (const std::runtime_error& error) {
      *out = error.what();
    }
  };
  asio::co_spawn(io, job(pool, &caught), rethrow);
  io.run();
  EXPECT_EQ(caught, "no memory");
}

TEST(Offload, anExceptionBecomesAnErrorWherePossible) {
  setLogLevel(LogLevel::kOff);
  asio::io_context io{1};
  asio::thread_pool pool{1};
  std::vector<Error> errors;
  const auto job = [](asio::thread_pool& on, std::vector<Error>* out) -> Task<> {
    std::function<Result<int>()> number = []() -> Result<int> { throw std::bad_alloc(); };
    const auto none = co_await offload(on, std::move(number));
    out->push_back(none.error());
    std::function<Status()> deed = []() -> Status { throw std::length_error("vector::reserve"); };
    const auto undone = co_await offload(on, std::move(deed));
    out->push_back(undone.error());
  };
  bool threw = false;
  asio::co_spawn(io, job(pool, &errors), [&](const std::exception_ptr& error) { threw = error != nullptr; });
  io.run();
  EXPECT_FALSE(threw);
  ASSERT_EQ(errors.size(), 2u);
  for (const Error& error : errors) EXPECT_EQ(error.code, ErrorCode::kFailed);
  EXPECT_NE(errors[0].message.find("bad_alloc"), std::string::npos) << errors[0].message;
  EXPECT_NE(errors[1].message.find("vector::reserve"), std::string::npos) << errors[1].message;
}

TEST(Offload, detachedWorkThatThrowsDoesNotEndTheProgram) {
  setLogLevel(LogLevel::kOff);
  asio::thread_pool pool{1};
  bool next_done = false;
  postLogged(pool, "audit_failed", []() -> Status { throw std::bad_alloc(); });
  postLogged(pool, "audit_failed", [&]() -> Status {
    next_done = true;
    return Error{ErrorCode::kFailed, "no line"};
  });
  pool.join();
  EXPECT_TRUE(next_done);
}

TEST(Inbox, simultaneousItemsAreTakenTogetherInOrder) {
  asio::io_context io{1};
  Inbox inbox(io.get_executor());
  std::vector<int> taken;
  std::thread writer([&] {
    for (int i = 0; i < 1000; ++i) inbox.put([&taken, i] { taken.push_back(i); });
  });
  writer.join();
  EXPECT_EQ(io.poll_one(), 1u) << "one turn";
  ASSERT_EQ(taken.size(), 1000u);
  EXPECT_TRUE(std::is_sorted(taken.begin(), taken.end()));
  EXPECT_EQ(io.poll(), 0u);
}

TEST(Inbox, nothingIsLostWithARunningLoop) {
  asio::io_context io{1};
  Inbox inbox(io.get_executor());
  auto alive = asio::make_work_guard(io);
  int taken = 0;
  constexpr int kItems = 20'000;
  std::thread writer([&] {
    for (int i = 0; i < kItems; ++i)
      inbox.put([&] {
        if (++taken == kItems) alive.reset();
      });
  });
  io.run();
  writer.join();
  EXPECT_EQ(taken, kItems);
}

TEST(Signal, wakesAllWhoWaitAndTheyDoNotWakeEachOther) {
  asio::io_context io{1};
  Signal signal(io.get_executor());
  int woken = 0;
  const auto waiter = [](Signal& on, int* count) -> Task<> {
    co_await on.wait();
    ++*count;
  };
  for (int i = 0; i < 3; ++i) asio::co_spawn(io, waiter(signal, &woken), rethrow);
  io.poll();
  EXPECT_EQ(woken, 0);
  signal.notify();
  io.restart();
  io.poll();
  EXPECT_EQ(woken, 3);
}

}  // namespace
}  // namespace needlelab
