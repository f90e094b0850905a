// The samples of a session that never reached its disk: the file `lost`, written in place and sealed.

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>

#include "client/net/spool/spool.h"
#include "client/net/spool/spool_json.h"

namespace needlelab {
namespace {

// samples and first tick, at a fixed length
std::string lossText(const SpoolLoss& loss) {
  return fmt::format("{:020} {:020}\n", loss.samples, loss.from_tick);
}

}  // namespace

Status SpoolSession::setLoss(const SpoolLoss& loss) {
  {
    const std::scoped_lock lock(mutex_);
    loss_ = loss;
  }
  const auto path = folder_ / "lost";
  const auto failed = [&] {
    return Error{ErrorCode::kUnavailable, "cannot write " + path.string() + ": " + std::strerror(errno)};
  };
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
  if (fd < 0) return failed();
  const std::string text = sealed(lossText(loss));
  const ssize_t wrote = ::pwrite(fd, text.data(), text.size(), 0);
  Status status;
  if (wrote != static_cast<ssize_t>(text.size())) status = failed();
  ::close(fd);
  return status;
}

Status SpoolSession::syncLoss() const {
  const auto path = folder_ / "lost";
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  Status status;
  if (fd < 0 || ::fdatasync(fd) != 0)
    status = Error{ErrorCode::kUnavailable, "cannot sync " + path.string() + ": " + std::strerror(errno)};
  if (fd >= 0) ::close(fd);
  return status;
}

// if the file is unreadable, the number of lost samples is unknown
void SpoolSession::loadLoss() {
  loss_read_ = false;
  const auto text = readSpoolText(folder_ / "lost", 1000);
  unsigned long long samples = 0, from_tick = 0;
  if (!text.ok() || std::sscanf(text->c_str(), "%20llu %20llu", &samples, &from_tick) != 2) return;
  const SpoolLoss loss{samples, from_tick};
  if (*text != sealed(lossText(loss))) return;
  if (static_cast<double>(samples) > kLongestSession_s * description_.rate_hz()) return;
  loss_read_ = true;
  loss_ = loss;
}

std::string SpoolSession::lossNote() const {
  // a power cut during creation may leave no file, but then no chunk exists either
  if (loss_read_ || contents().chunks == 0 || receipt().closed) return {};
  return fmt::format(
      "session {}: {} is missing or damaged, so it is unknown how many of its samples never reached the "
      "disk; it is closed as interrupted. See whether that disk fails",
      idText(), (folder_ / "lost").string());
}

}  // namespace needlelab
