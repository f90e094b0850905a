#include "common/wire/endpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(Endpoint, namesAndAddressesWithAndWithoutPort) {
  struct Case {
    const char* text;
    const char* host;
    std::uint16_t port;
  };
  for (const Case& c : {Case{"127.0.0.1:7750", "127.0.0.1", 7750}, Case{"lab.example", "lab.example", 7750},
                        Case{"[::1]:80", "::1", 80}, Case{"[fe80::1]", "fe80::1", 7750}, Case{"h:0", "h", 0},
                        Case{"h:65535", "h", 65535}}) {
    const auto endpoint = parseEndpoint(c.text);
    ASSERT_TRUE(endpoint.ok()) << c.text;
    EXPECT_EQ(endpoint->host, c.host);
    EXPECT_EQ(endpoint->port, c.port);
    EXPECT_EQ(parseEndpoint(endpointText(*endpoint))->host, c.host);
  }
}

TEST(Endpoint, whatIsNoneIsRefusedByName) {
  for (const char* text : {"", ":7750", "h:", "h:65536", "h:-1", "h:x", "h:7750x", "::1", "[::1", "[::1]7750",
                           "[::1]:", "[[::1]:80", "[host]:80", "a b:80", "h\n:80", "caf\xc3\xa9:80"}) {
    const auto endpoint = parseEndpoint(text);
    ASSERT_FALSE(endpoint.ok()) << text;
    EXPECT_EQ(endpoint.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(endpoint.error().message, testing::HasSubstr(std::string("'") + text + "'"));
  }
}

}  // namespace
}  // namespace needlelab
