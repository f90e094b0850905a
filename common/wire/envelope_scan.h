/// Inspects an Envelope's bytes before parsing: what it is, and what parsing it would cost. A small message
/// can make a large object (an empty string in a list takes 2 bytes on the wire and 64 in memory), so a
/// server uses this to decide whether to parse at all, on which thread, and with which budget.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// What an Envelope is, derived only from the tags of the Envelope and the Request. The views point into its
/// bytes.
struct EnvelopeHead {
  pb::Envelope::BodyCase body = pb::Envelope::BODY_NOT_SET;  ///< BODY_NOT_SET: from a newer minor version
  std::string_view payload;                                  ///< the body's bytes
  std::uint64_t request_id = 0;                              ///< of a Request
  pb::Request::CallCase call = pb::Request::CALL_NOT_SET;    ///< of a Request; CALL_NOT_SET: from a newer
                                                             ///< minor version
  std::string_view session_id;                               ///< of an OpenSession or a CloseSession
  std::size_t beside_bytes = 0;  ///< memory for fields beside the body, from a newer minor version
};

/// scanEnvelope reads at most this many tags of each message.
inline constexpr std::size_t kMaxHeadFields = 64;

/// Reads only a few tags, even of a long Envelope. Errors: kCorrupt if the bytes are not an Envelope, or it
/// has more than one body, or a Request has more than one call (Protobuf would merge them; only
/// droppedSuffix's second live_frame is accepted), or more than kMaxHeadFields fields.
Result<EnvelopeHead> scanEnvelope(ByteView envelope);

/// The cost of parsing a body.
struct PayloadCost {
  std::size_t fields = 0;         ///< at all depths
  std::size_t decoded_bytes = 0;  ///< memory of the parsed message: an estimate, on the high side
  std::size_t parsed_bytes =
      0;  ///< bytes that are read one by one: all but the contents of `bytes` fields, which are copied
};

/// Maximum number of fields in a body at all depths, known or not; limits measurePayload to about a
/// millisecond.
inline constexpr std::size_t kMaxPayloadFields = 65'536;

/// Counts a body's fields without parsing. Errors: kCorrupt if the bytes are not in the wire format;
/// kInvalidInput, with the field's path and the limit, if a list has more items than its `max_items`
/// (options.proto), or the body has more than kMaxPayloadFields fields.
Result<PayloadCost> measurePayload(const EnvelopeHead& head);

}  // namespace needlelab
