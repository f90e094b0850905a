#include "common/wire/message_table.h"

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "needlelab/envelope.pb.h"

namespace needlelab {
namespace {

using Names = std::map<int, std::string>;

template <std::size_t N>
Names tableOf(const NumberedName (&table)[N]) {
  Names names;
  for (const auto& entry : table)
    EXPECT_TRUE(names.emplace(entry.number, entry.name).second) << entry.number << " comes twice";
  return names;
}

Names fieldsOf(const google::protobuf::OneofDescriptor* oneof) {
  Names names;
  for (int i = 0; i < oneof->field_count(); ++i)
    names.emplace(oneof->field(i)->number(), oneof->field(i)->name());
  return names;
}

// a failure here means that a number got another meaning, or that the table was not extended
TEST(MessageTable, envelopeNumbersAreAsPublished) {
  EXPECT_EQ(fieldsOf(pb::Envelope::descriptor()->FindOneofByName("body")), tableOf(kEnvelopeMessages));
}
TEST(MessageTable, requestNumbersAreAsPublished) {
  EXPECT_EQ(fieldsOf(pb::Request::descriptor()->FindOneofByName("call")), tableOf(kRequestCalls));
}
TEST(MessageTable, replyNumbersAreAsPublished) {
  EXPECT_EQ(fieldsOf(pb::Reply::descriptor()->FindOneofByName("result")), tableOf(kReplyResults));
}
TEST(MessageTable, refusalReasonsAreAsPublished) {
  Names reasons;
  const auto* descriptor = pb::Refusal::Reason_descriptor();
  for (int i = 0; i < descriptor->value_count(); ++i)
    reasons.emplace(descriptor->value(i)->number(), descriptor->value(i)->name());
  EXPECT_EQ(reasons, tableOf(kRefusalReasons));
}

}  // namespace
}  // namespace needlelab
