// Fuzzes a peer's bytes: the frames, what their first tags say, the envelopes in them, and the check whether
// an envelope is allowed in this state.
#include <array>

#include "common/wire/envelope_scan.h"
#include "common/wire/protocol.h"
#include "db/service/requests/requests.h"
#include "server/live/port/rules.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

void look(const pb::Envelope& envelope) {
  for (int state = 0; state < kConnectionStates; ++state) {
    for (int role = 0; role <= pb::Role_MAX; ++role) {
      const auto verdict = checkMessage(envelope.body_case(), static_cast<ConnectionState>(state),
                                        static_cast<pb::Role>(role));
      const bool logged_in = state == static_cast<int>(ConnectionState::kAuthenticated) ||
                             state == static_cast<int>(ConnectionState::kInSession);
      if (envelope.has_request() && verdict == Verdict::kAllowed)
        require(logged_in && role != pb::ROLE_UNSPECIFIED, "requests only after log-in");
    }
  }
  if (envelope.has_request()) {
    for (int role = -1; role <= pb::Role_MAX + 1; ++role)
      (void)checkRole({"x", static_cast<pb::Role>(role)}, envelope.request().call_case());
  }
  if (kPlanted && envelope.has_subscribe()) {
    // The planted fault: a number from the network is used as an unchecked index.
    static std::array<int, 16> seen{};
    ++seen.data()[envelope.subscribe().subscription()];
  }
  if (envelope.body_case() == pb::Envelope::BODY_NOT_SET) return;
  // A received envelope can be sent again and is then the same.
  const auto frame = encodeFrame(envelope);
  if (!frame.ok()) return;  // merged fields can exceed the frame limit
  const auto again = decodeFrame(viewOf(**frame));
  require(again.ok(), "an encoded envelope decodes");
  require(again->body_case() == envelope.body_case(), "an encoded envelope keeps its body");
}

}  // namespace

void envelope(ByteView data) {
  if (data.empty()) return;
  // The first byte selects the limit and the sizes of the arriving pieces.
  const std::size_t limit = (data[0] & 1) != 0 ? kMaxFrameBytes : kMaxFrameBytesBeforeLogin;
  const std::size_t piece = 1 + (data[0] >> 1);
  data = data.subspan(1);
  FrameSplitter splitter(limit);
  std::size_t taken = 0;
  while (taken < data.size()) {
    const auto room = splitter.writable();
    require(!room.empty(), "there is always room for a byte");
    const std::size_t count = std::min({room.size(), piece, data.size() - taken});
    std::memcpy(room.data(), data.data() + taken, count);
    splitter.wrote(count);
    taken += count;
    for (;;) {
      const auto frame = splitter.next();
      if (!frame.ok()) return;
      if (!frame->has_value()) break;
      require(!(*frame)->empty() && (*frame)->size() <= limit, "no frame is empty or above the limit");
      const auto decoded = decodeFrame(**frame);
      if (decoded.ok()) look(*decoded);
      const auto head = scanEnvelope(**frame);
      if (!head.ok()) continue;
      const auto cost = measurePayload(*head);
      if (!decoded.ok()) continue;
      require(head->body == decoded->body_case() && head->call == decoded->request().call_case(),
              "the judged bytes are the parsed ones");
      if (cost.ok())
        require(cost->decoded_bytes + sizeof(pb::Envelope) >= decoded->SpaceUsedLong() / 4,
                "no message takes far more than was reckoned");
    }
    require(splitter.capacity() <= 2 * limit + 65536, "memory grows with what arrived");
  }
}

}  // namespace needlelab::fuzz
