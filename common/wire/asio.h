/// Asio in needlelab: C++20 coroutines that receive errors as values. One io_context runs on one thread: no
/// locks, no strands.
#pragma once

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/system/error_code.hpp>

#include <exception>

namespace needlelab {

namespace asio = boost::asio;
using Tcp = asio::ip::tcp;

template <typename T = void>
using Task = asio::awaitable<T>;

/// `auto [ec, n] = co_await stream.async_read_some(buffer, kUseTuple);`
inline constexpr auto kUseTuple = asio::as_tuple(asio::use_awaitable);

/// Rethrows an exception that escaped from a spawned coroutine: a programmer error, which must not be
/// swallowed.
inline void rethrow(std::exception_ptr error) {
  if (error) std::rethrow_exception(error);
}

}  // namespace needlelab
