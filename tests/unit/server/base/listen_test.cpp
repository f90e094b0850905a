#include "server/base/listen.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace needlelab {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(Listen, aTakenPortIsSaidPlainly) {
  asio::io_context io;
  const auto first = listenOn(io, *resolveListen("127.0.0.1:0"), "127.0.0.1:0");
  ASSERT_TRUE(first.ok());
  const auto second = listenOn(io, first->local_endpoint(), "127.0.0.1:x");
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().message, testing::HasSubstr("taken"));
}

TEST(Listen, whatIsNoAddressIsInvalid) {
  for (const char* text : {"127.0.0.1:99999", "", "no.such.name.invalid:1"}) {
    EXPECT_EQ(resolveListen(text).error().code, ErrorCode::kInvalidInput) << text;
  }
}

TEST(Listen, theCertificateNamesWhatTheServerIsCalled) {
  const auto names = certificateNames("192.0.2.7:7750", {"lab.example"}, {"example"});
  EXPECT_THAT(names.hosts, ElementsAre("lab.example", "192.0.2.7"));
  for (const char* host : {"localhost", "127.0.0.1", "::1"}) EXPECT_THAT(names.own, Contains(host).Times(1));
  EXPECT_THAT(names.domains, ElementsAre("example"));
  EXPECT_THAT(certificateNames("0.0.0.0:7750", {}, {}).hosts, IsEmpty());
  EXPECT_THAT(certificateNames("[::]:7750", {}, {}).hosts, IsEmpty());
  EXPECT_THAT(certificateNames("localhost:7750", {}, {}).hosts, IsEmpty()) << "its own already";
}

}  // namespace
}  // namespace needlelab
