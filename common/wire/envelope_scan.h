/// Looks at an Envelope's bytes before they become a message: what it is, and what it would cost. A small
/// message can make a large object (an empty text of a list takes 2 bytes on the wire and 64 in memory), so a
/// server decides by this whether to parse at all, on which thread, and against which budget.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// What an Envelope is, from the tags of the Envelope and the Request alone. The views are into its bytes.
struct EnvelopeHead {
  pb::Envelope::BodyCase body = pb::Envelope::BODY_NOT_SET;  ///< BODY_NOT_SET: of a newer minor
  std::string_view payload;                                  ///< the body's bytes
  std::uint64_t request_id = 0;                              ///< of a Request
  pb::Request::CallCase call = pb::Request::CALL_NOT_SET;    ///< of a Request; CALL_NOT_SET: of a newer minor
  std::string_view session_id;                               ///< of an OpenSession or a CloseSession
  std::size_t beside_bytes = 0;  ///< memory of what stands beside the body, of a newer minor
};

/// At most this many tags are read of each message that scanEnvelope opens.
inline constexpr std::size_t kMostHeadFields = 64;

/// Reads a few tags, however long the Envelope is. Errors: kCorrupt: the bytes are no Envelope, or one with
/// more than one body, or a Request with more than one call (Protobuf would merge them; only droppedSuffix's
/// second live_frame is taken), or one with more than kMostHeadFields fields.
Result<EnvelopeHead> scanEnvelope(ByteView envelope);

/// What parsing a body takes.
struct PayloadCost {
  std::size_t fields = 0;         ///< at all depths
  std::size_t decoded_bytes = 0;  ///< memory of the parsed message: an estimate, rather too high
  std::size_t parsed_bytes =
      0;  ///< read one by one: all but the contents of `bytes` fields, which are copied
};

/// Fields of a body at all depths, known or not; it bounds the time of measurePayload to a millisecond.
inline constexpr std::size_t kMostPayloadFields = 65'536;

/// Counts a body's fields in its bytes; nothing is parsed. Errors: kCorrupt: the bytes are not in the wire
/// format. kInvalidInput, with the field's path and the bound: a list has more items than its `max_items`
/// (options.proto), or the body has more than kMostPayloadFields fields.
Result<PayloadCost> measurePayload(const EnvelopeHead& head);

}  // namespace needlelab
