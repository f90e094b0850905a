#include "server/live/work/offload.h"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "server/base/log.h"

namespace needlelab {

Error thrownByWork(const std::exception& thrown) {
  logEvent(LogLevel::kError, "work_threw", {{"text", thrown.what()}});
  return {ErrorCode::kFailed, std::string("the work failed inside: ") + thrown.what() +
                                  ": please report this as a fault of the program"};
}

void postLogged(asio::thread_pool& pool, std::string event, std::function<Status()> work) {
  asio::post(pool, [event = std::move(event), work = std::move(work)] {
    // an exception leaving the pool's thread would end the server
    try {
      if (const Status done = work(); !done.ok())
        logEvent(LogLevel::kError, event, {{"text", done.error().message}});
    } catch (const std::exception& thrown) {
      logEvent(LogLevel::kError, event, {{"text", thrown.what()}});
    }
  });
}

void yieldThread() {
  if (::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), 10) != 0)
    logEvent(LogLevel::kWarning, "retention_priority_not_lowered", {});
}

Task<Status> commit(DbWriter& writer, DbWriter::Work work) {
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  auto later = std::make_shared<Later<Status>>(executor);
  auto posted = writer.post(std::move(work), [later, executor](const Status& status) mutable {
    asio::post(executor, [later = std::move(later), status] { later->set(status); });
  });
  if (!posted.ok()) co_return posted;
  co_return co_await Later<Status>::wait(std::move(later));
}

}  // namespace needlelab
