#include "common/wire/envelope_scan.h"

#include <fmt/core.h>
#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/wire/wire_reader.h"
#include "needlelab/options.pb.h"

namespace needlelab {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

// Memory for the parts of a parsed message (64-bit libstdc++, Protobuf 3): a string needs an object of 32
// bytes, its block's header, and its pointer in a list that doubles as it grows; above 15 bytes it has a
// second block.
constexpr std::size_t kTextBytes = 64, kTextInside = 15, kBlockBytes = 16;
constexpr std::size_t kNumberBytes = 16;     // for a number in a list that doubles as it grows
constexpr std::size_t kMessageBytes = 512;   // more than any message from a peer needs without its strings
constexpr std::size_t kUnknownBytes = 64;    // Protobuf keeps unknown fields
constexpr std::size_t kMaxSuffixBytes = 16;  // for droppedSuffix: a tag and a varint
constexpr std::size_t kDeepest = 16;         // nesting depth; our messages have 5

Error noEnvelope(std::size_t size, const char* why) {
  return {ErrorCode::kCorrupt, fmt::format("a frame of {} bytes is not an Envelope: {}", size, why)};
}

/// Calls `act` for each field, at most kMaxHeadFields. Returns false if the bytes are not a message or `act`
/// returned false.
template <typename Act>
bool eachHeadField(std::string_view message, Act act) {
  WireReader reader(message);
  for (std::size_t count = 0; !reader.atEnd(); ++count) {
    WireField field;
    if (count == kMaxHeadFields || !reader.field(field) || !act(field)) return false;
  }
  return true;
}

/// The last field `number` with bytes in a message; empty if it is not among the first fields.
std::string_view bytesField(std::string_view message, int number) {
  std::string_view found;
  (void)eachHeadField(message, [&](const WireField& field) {
    if (field.number == number && field.kind == WireKind::kBytes) found = field.bytes;
    return true;
  });
  return found;
}

/// Whether `number` is a member of the oneof that Protobuf would read from this field.
bool isMember(const google::protobuf::OneofDescriptor& oneof, const WireField& field) {
  if (field.kind != WireKind::kBytes) return false;
  const auto* known = oneof.containing_type()->FindFieldByNumber(field.number);
  return known != nullptr && known->containing_oneof() == &oneof;
}

class Meter {
 public:
  explicit Meter(PayloadCost& cost) : cost_(cost) {}

  Status walk(const FieldDescriptor& message, std::string_view bytes) {
    if (path_.size() == kDeepest) return Error{ErrorCode::kCorrupt, "messages too deep within each other"};
    cost_.decoded_bytes += kMessageBytes;
    path_.push_back(&message);
    WireReader reader(bytes);
    const FieldDescriptor* known = nullptr;
    int known_number = 0;
    while (!reader.atEnd()) {
      WireField field;
      if (!reader.field(field)) return Error{ErrorCode::kCorrupt, pathOf(nullptr) + " is not a message"};
      if (++cost_.fields > kMaxPayloadFields) {
        return Error{ErrorCode::kInvalidInput, fmt::format("{} has more than {} fields: send less at once",
                                                           pathOf(nullptr), kMaxPayloadFields)};
      }
      // items of a list repeat the same number
      if (std::exchange(known_number, field.number) != field.number)
        known = message.message_type()->FindFieldByNumber(field.number);
      RETURN_IF_ERROR(take(known, field));
    }
    path_.pop_back();
    return {};
  }

 private:
  /// `known`: null if this version does not know the number.
  Status take(const FieldDescriptor* known, const WireField& field) {
    const bool bytes = field.kind == WireKind::kBytes;
    const auto type = known == nullptr ? FieldDescriptor::CPPTYPE_INT32 : known->cpp_type();
    if (known != nullptr && bytes && type == FieldDescriptor::CPPTYPE_MESSAGE) {
      if (known->is_repeated()) RETURN_IF_ERROR(count(*known, 1));
      return walk(*known, field.bytes);
    }
    if (known != nullptr && bytes && type == FieldDescriptor::CPPTYPE_STRING) {
      if (known->is_repeated()) RETURN_IF_ERROR(count(*known, 1));
      cost_.decoded_bytes += kTextBytes;
      if (field.bytes.size() > kTextInside) cost_.decoded_bytes += field.bytes.size() + kBlockBytes;
      if (known->type() == FieldDescriptor::TYPE_BYTES) cost_.parsed_bytes -= field.bytes.size();
      return {};
    }
    if (known != nullptr && known->is_repeated() && known->is_packable()) {
      const std::size_t items = bytes ? packedItems(type, field.bytes) : 1;
      cost_.decoded_bytes += items * kNumberBytes;
      return count(*known, items);
    }
    // a number in its message's own memory, or an unknown field
    cost_.decoded_bytes += kUnknownBytes + field.bytes.size();
    return {};
  }

  static std::size_t packedItems(FieldDescriptor::CppType type, std::string_view bytes) {
    if (type == FieldDescriptor::CPPTYPE_DOUBLE) return bytes.size() / 8;
    if (type == FieldDescriptor::CPPTYPE_FLOAT) return bytes.size() / 4;
    // varints: each ends with a byte whose highest bit is clear; fixed integers, which we do not use, have at
    // most as many
    return static_cast<std::size_t>(
        std::count_if(bytes.begin(), bytes.end(), [](char c) { return (c & 0x80) == 0; }));
  }

  /// Counts a list's items over the whole body, because Protobuf concatenates lists that come in several
  /// pieces.
  Status count(const FieldDescriptor& list, std::size_t items) {
    auto entry = std::find_if(lists_.begin(), lists_.end(), [&](const List& l) { return l.field == &list; });
    if (entry == lists_.end()) {
      const std::size_t most = list.options().HasExtension(pb::max_items)
                                   ? list.options().GetExtension(pb::max_items)
                                   : kMaxPayloadFields;
      entry = lists_.insert(lists_.end(), List{&list, 0, most});
    }
    entry->items += items;
    if (entry->items <= entry->most) return {};
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{} has more than {} items: send fewer at once", pathOf(&list), entry->most)};
  }

  [[nodiscard]] std::string pathOf(const FieldDescriptor* last) const {
    std::string text;
    for (const FieldDescriptor* field : path_) text += (text.empty() ? "" : ".") + field->name();
    return last == nullptr ? text : text + "." + last->name();
  }

  struct List {
    const FieldDescriptor* field;
    std::size_t items, most;
  };

  PayloadCost& cost_;
  std::vector<const FieldDescriptor*> path_;
  std::vector<List> lists_;
};

}  // namespace

Result<EnvelopeHead> scanEnvelope(ByteView envelope) {
  static const auto& bodies = *pb::Envelope::descriptor()->FindOneofByName("body");
  static const auto& calls = *pb::Request::descriptor()->FindOneofByName("call");
  EnvelopeHead head;
  std::size_t count = 0;
  const bool whole = eachHeadField(textOf(envelope), [&](const WireField& field) {
    if (!isMember(bodies, field)) {
      head.beside_bytes += kUnknownBytes + field.bytes.size();
      return true;
    }
    const auto body = static_cast<pb::Envelope::BodyCase>(field.number);
    const bool more_of_frame = body == pb::Envelope::kLiveFrame && head.body == pb::Envelope::kLiveFrame;
    if (more_of_frame && field.bytes.size() <= kMaxSuffixBytes) {
      head.beside_bytes += field.bytes.size();
      return true;
    }
    head.body = body;
    head.payload = field.bytes;
    return ++count == 1;
  });
  if (count > 1) return noEnvelope(envelope.size(), "it has more than one body");
  if (!whole) return noEnvelope(envelope.size(), "its fields cannot be read");
  if (head.body == pb::Envelope::kRequest) {
    count = 0;
    const bool request = eachHeadField(head.payload, [&](const WireField& field) {
      if (field.number == pb::Request::kIdFieldNumber && field.kind == WireKind::kVarint)
        head.request_id = field.value;
      if (!isMember(calls, field)) return true;
      head.call = static_cast<pb::Request::CallCase>(field.number);
      return ++count == 1;
    });
    if (count > 1) return noEnvelope(envelope.size(), "its request has more than one call");
    if (!request) return noEnvelope(envelope.size(), "the fields of its request cannot be read");
  }
  if (head.body == pb::Envelope::kOpenSession) {
    head.session_id = bytesField(bytesField(head.payload, pb::OpenSession::kDescriptionFieldNumber),
                                 pb::SessionDescription::kSessionIdFieldNumber);
  } else if (head.body == pb::Envelope::kCloseSession) {
    head.session_id = bytesField(head.payload, pb::CloseSession::kSessionIdFieldNumber);
  }
  return head;
}

Result<PayloadCost> measurePayload(const EnvelopeHead& head) {
  PayloadCost cost;
  cost.decoded_bytes = cost.parsed_bytes = head.beside_bytes;
  if (head.body == pb::Envelope::BODY_NOT_SET) return cost;
  cost.parsed_bytes += head.payload.size();
  RETURN_IF_ERROR(Meter(cost).walk(*pb::Envelope::descriptor()->FindFieldByNumber(head.body), head.payload));
  return cost;
}

}  // namespace needlelab
