// Fuzzes the live plane of the server with messages of logged-in stations and viewers.
#include <array>
#include <cstring>
#include <limits>

#include "common/gesture/chunk.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/cut_snapshot.h"
#include "common/wire/live_frames.h"
#include "server/live/hub/hub.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

/// Receives the hub's output and checks that each part is a message.
class Peer : public HubPeer {
 public:
  void sendControl(const pb::Envelope& envelope) override {
    require(envelope.body_case() != pb::Envelope::BODY_NOT_SET, "a control message has a body");
  }
  void sendLive(Frame frame, bool counted) override {
    const auto decoded = decodeFrame(viewOf(*frame));
    require(decoded.ok() && frame->size() <= kMaxFrameBytes, "a live frame is an envelope");
    if (!counted) return;
    require(decoded->has_live_frame(), "what is counted is a live frame");
    if (kPlanted) {
      // The planted fault: assumes that frame numbers grow by small steps.
      static std::int32_t last = 0;
      const auto now = static_cast<std::int32_t>(decoded->live_frame().frame_seq());
      last = now - last;
    }
  }
};

constexpr std::size_t kMostOperations = 200;

/// An operation: a part of the input with kind, actor, number, data.
template <typename Byte>
struct Operation {
  explicit Operation(std::span<Byte> part)
      : kind(part[0] % 10u), who(part[1] % 3u), number(part[2]), data(part.subspan(3)) {}
  unsigned kind, who, number;
  std::span<Byte> data;
};

}  // namespace

void repairLive(std::span<std::uint8_t> data, unsigned how) {
  for (const auto part : partsOf(data, kMostOperations)) {
    if (part.size() < 3) continue;
    const Operation op(part);
    if (op.kind == 3) repairChunk(op.data, how);
  }
}

void live(ByteView data) {
  std::array<Peer, 3> stations, viewers;
  const std::array<std::string, 3> names = {"bench-1", "bench-2", ""};
  const std::array<std::string, 3> sessions = {std::string(16, 'a'), std::string(16, 'b'), ""};
  Hub hub;
  std::int64_t now_ns = 1'000'000'000;
  for (const ByteView part : partsOf(data, kMostOperations)) {
    if (part.size() < 3) continue;
    const Operation op(part);
    const ByteView rest = op.data;
    const std::string& name = names[op.who];
    now_ns += 20'000'000;
    switch (op.kind) {
      case 0:
        (void)hub.attachStation(name, stations[op.who]);
        break;
      case 1:
        hub.detachStation(name, stations[op.who]);
        break;
      case 2: {
        pb::StationStatus status;
        if (status.ParseFromArray(rest.data(), static_cast<int>(rest.size())))
          (void)hub.onStatus(name, status, now_ns);
        break;
      }
      case 3: {
        pb::LiveFrame frame;
        frame.set_session_id(sessions[op.number % 3]);
        frame.set_frame_seq(op.number > 250 ? std::numeric_limits<std::uint64_t>::max() - op.number
                                            : op.number);
        frame.set_data(rest.data(), rest.size());
        if (op.number % 7 == 0) frame.set_cut_memory(rest.data(), rest.size());
        if (op.number % 11 == 0) frame.set_paths(rest.data(), rest.size());
        // As in the server: bytes that are exactly a live frame are forwarded, all others are decoded.
        pb::Envelope envelope;
        *envelope.mutable_live_frame() = frame;
        const std::string bytes = envelope.SerializeAsString();
        if (const auto view = viewLiveFrame(needlelab::viewOf(std::string_view(bytes))))
          (void)hub.onLiveFrame(name, *view, now_ns);
        else
          (void)hub.onLiveFrame(name, frame, now_ns);
        break;
      }
      case 9: {
        // For any bytes, the fast path and Protobuf agree on the content.
        const auto view = viewLiveFrame(rest);
        if (!view) break;
        // what a viewer takes as memory of the cut is a ring of lines, and no other bytes say the same
        if (const auto cuts = decodeCuts(needlelab::viewOf(view->cut_memory)); cuts.ok()) {
          const Bytes again = encodeCuts(*cuts);
          require(textOf(again) == view->cut_memory, "the memory of the cut reads and writes the same");
        }
        // a path that a viewer takes is written with the same bytes
        for (const PathSnapshot& path : pathsIn(needlelab::viewOf(view->paths))) {
          const auto same_path = decodePath(encodePath(path));
          require(same_path.ok() && encodePath(*same_path) == encodePath(path),
                  "paths read and write the same");
        }
        const auto whole = decodeFrame(rest);
        require(whole.ok() && whole->has_live_frame(), "what is passed on is a live frame to Protobuf, too");
        const pb::LiveFrame& same = whole->live_frame();
        require(same.session_id() == view->session_id && same.data() == view->data &&
                    same.frame_seq() == view->frame_seq && same.due_steady_ns() == view->due_steady_ns &&
                    same.capture_unix_ns() == view->capture_unix_ns &&
                    same.cut_memory() == view->cut_memory && same.paths() == view->paths,
                "both ways read the same");
        (void)hub.onLiveFrame(name, *view, now_ns);
        break;
      }
      case 4: {
        pb::Subscribe wanted;
        if (!wanted.ParseFromArray(rest.data(), static_cast<int>(rest.size()))) break;
        if ((op.number & 1) != 0) wanted.set_station(names[op.number / 2 % 3]);
        if ((op.number & 128) != 0) wanted.set_session_id(sessions[op.number / 2 % 3]);
        (void)hub.subscribe(viewers[op.who], wanted, now_ns);
        break;
      }
      case 5:
        (void)hub.unsubscribe(viewers[op.who], op.number);
        break;
      case 6:
        hub.detachViewer(viewers[op.who]);
        break;
      case 7:
        hub.onSession(name, sessions[op.number % 3]);
        break;
      default: {
        pb::Stations list;
        for (const auto& known : names) list.add_stations()->set_name(known);
        hub.fillStations(list);
        (void)hub.isWatched(name);
      }
    }
    require(hub.stationsOnline() <= 3, "no more stations than there are");
  }
  for (std::size_t i = 0; i < 3; ++i) {
    hub.detachStation(names[i], stations[i]);
    hub.detachViewer(viewers[i]);
  }
  require(hub.stationsOnline() == 0, "no one is left behind");
}

}  // namespace needlelab::fuzz
