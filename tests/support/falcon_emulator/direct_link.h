/// A Falcon without USB: its own bus and link, straight to the board, in any time. Answers are available at
/// once unless their fate says otherwise, in reads of at most 64 bytes that begin with two modem bytes.
#pragma once

#include <deque>
#include <memory>

#include "client/device/falcon/falcon_link.h"
#include "tests/support/falcon_emulator/falcon_board.h"

namespace needlelab::test {

struct Look {
  std::int64_t at_ns;
  bool is_found;
};

class DirectLink;

/// Shared by all its links and by the test.
class DirectFalcon : public FalconBoard {
 public:
  bool plugged = true;
  std::int64_t write_ns = 0;  ///< duration of a write to the stream

  // for an observer; called under the mutex, may be empty
  std::function<void()> on_stream;                                           ///< a stream begins
  std::function<void()> on_write;                                            ///< outside a stream
  std::function<void(const falcon::Command&, std::int64_t now_ns)> on_send;  ///< the host sends, heard or not
  /// The host is about to read an answer of the stream; nothing: an unreadable one.
  std::function<void(const std::optional<falcon::Report>&, std::int64_t now_ns)> on_reply;

  // recorded
  int opened = 0, open_links = 0;
  int refused = 0;                ///< commands that arrived while another one was being written
  std::vector<Look> looks;        ///< when the bus was asked to open it
  DirectLink* streams = nullptr;  ///< the link with a stream

  void unplug();
  void plugIn();
  /// Opens it, as the bus does.
  static std::unique_ptr<falcon::FalconBus> bus(std::shared_ptr<DirectFalcon> falcon, TimeSource& time);
  /// When the next event for the host's USB thread is due; the greatest int64: none.
  [[nodiscard]] std::int64_t nextEventNs();

 private:
  friend class DirectLink;
  friend class DirectBus;
  bool arrived_ = false;     // plugged in since the host last waited for it
  int times_unplugged_ = 0;  // an earlier link is lost, however soon it is plugged in again
};

class DirectLink final : public falcon::FalconLink {
 public:
  DirectLink(std::shared_ptr<DirectFalcon> falcon, TimeSource& time);
  ~DirectLink() override;
  DirectLink(const DirectLink&) = delete;
  DirectLink& operator=(const DirectLink&) = delete;

  Status control(std::uint8_t request, std::uint16_t value, std::uint16_t index) override;
  Status write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds timeout) override;
  Result<std::size_t> read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) override;
  Status startStream(falcon::LinkListener& listener) override;
  bool send(const falcon::Packet& packet) noexcept override;
  void wait(std::int64_t until_ns) noexcept override;
  [[nodiscard]] bool lost() const noexcept override { return lost_; }
  void stopStream() noexcept override;
  /// The caller holds the mutex.
  [[nodiscard]] std::int64_t nextEventNs() const;

 private:
  [[nodiscard]] bool isGone() const;
  std::size_t take(std::span<std::uint8_t> buffer, std::int64_t now_ns);
  void observe(std::uint8_t byte, std::int64_t now_ns);

  struct Said {
    std::int64_t at_ns;
    std::uint8_t byte;
  };
  std::shared_ptr<DirectFalcon> falcon_;
  TimeSource& time_;
  std::deque<Said> out_;
  Bytes answer_;  // so far
  bool sending_ = false, lost_ = false;
  std::int64_t sent_ns_ = 0;
  int times_unplugged_ = 0;
  falcon::LinkListener* listener_ = nullptr;
};

}  // namespace needlelab::test
