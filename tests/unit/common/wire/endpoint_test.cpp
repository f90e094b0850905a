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
                        Case{"h:65535", "h", 65535},
                        Case{" lab.example :\x20"
                             "7751 ",
                             "lab.example", 7751},
                        Case{"//lab:7751/", "lab", 7751}, Case{"lab/", "lab", 7750}}) {
    const auto endpoint = parseEndpoint(c.text);
    ASSERT_TRUE(endpoint.ok()) << c.text;
    EXPECT_EQ(endpoint->host, c.host);
    EXPECT_EQ(endpoint->port, c.port);
    EXPECT_EQ(parseEndpoint(endpointText(*endpoint))->host, c.host);
  }
}

TEST(Endpoint, anAddressFromABrowserIsExplainedWithTheRightOne) {
  for (const auto& [text, right] : {std::pair{"https://lab.example", "lab.example:7750"},
                                    {"https://lab.example:8443/#/people", "lab.example:7750"},
                                    {"lab.example/#/people", "lab.example:7750"},
                                    {"https://[::1]:8443/", "[::1]:7750"},
                                    {"https://", "lab.example:7750"}}) {
    const auto endpoint = parseEndpoint(text);
    ASSERT_FALSE(endpoint.ok()) << text;
    EXPECT_THAT(endpoint.error().message,
                testing::StartsWith("'" + std::string(text) + "' is the address of a page"));
    EXPECT_THAT(endpoint.error().message, testing::EndsWith("e.g. " + std::string(right)));
  }
}

TEST(Endpoint, anInvalidEndpointIsRefusedByName) {
  for (const char* text : {"", ":7750", "h:", "h:65536", "h:-1", "h:x", "h:7750x", "::1", "[::1", "[::1]7750",
                           "[::1]:", "[[::1]:80", "[host]:80", "a b:80", "h\n:80", "caf\xc3\xa9:80"}) {
    const auto endpoint = parseEndpoint(text);
    ASSERT_FALSE(endpoint.ok()) << text;
    EXPECT_EQ(endpoint.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(endpoint.error().message, testing::HasSubstr(std::string("'") + text + "'"));
  }
}

// --- several

TEST(Endpoints, aSingleEndpointIsReadAsBefore) {
  const auto one = parseEndpoints("lab.example:7751");
  ASSERT_TRUE(one.ok()) << one.error().message;
  ASSERT_EQ(one->size(), 1u);
  EXPECT_EQ(endpointsText(*one), "lab.example:7751");
  for (const char* text : {"", "h:x", "a b:80"})
    EXPECT_EQ(parseEndpoints(text).error().message, parseEndpoint(text).error().message) << text;
}

TEST(Endpoints, severalKeepTheirOrderAndComeBack) {
  const auto all = parseEndpoints("b.example, [::1]:7760 ,127.0.0.1:7750,b.example:7751");
  ASSERT_TRUE(all.ok()) << all.error().message;
  EXPECT_EQ(endpointsText(*all), "b.example:7750,[::1]:7760,127.0.0.1:7750,b.example:7751");
  EXPECT_EQ(endpointsText(*parseEndpoints(endpointsText(*all))), endpointsText(*all));
}

TEST(Endpoints, anEmptyADoubleOrABadEntryIsNamed) {
  const auto why = [](const std::string& text) {
    const auto all = parseEndpoints(text);
    EXPECT_FALSE(all.ok()) << text;
    if (all.ok()) return std::string();
    EXPECT_EQ(all.error().code, ErrorCode::kInvalidInput);
    return all.error().message;
  };
  for (const char* text : {",", "a:1,", ",a:1", "a:1,,b:1", "a:1, ,b:1"})
    EXPECT_THAT(why(text), testing::HasSubstr("an entry is empty")) << text;
  EXPECT_THAT(why("a,b,A:7750"), testing::HasSubstr("A:7750 stands there twice"));
  EXPECT_THAT(why("a:1,b:x"), testing::HasSubstr("'b:x' is no HOST:PORT"));
  EXPECT_THAT(why("a:1;b:2"), testing::HasSubstr("'a:1;b:2' is no HOST:PORT"));
  std::string many = "h0";
  for (std::size_t i = 1; i < kMaxEndpoints; ++i) many += ",h" + std::to_string(i);
  EXPECT_EQ(parseEndpoints(many)->size(), kMaxEndpoints);
  EXPECT_THAT(why(many + ",one-more"), testing::HasSubstr("more than 16"));
}

}  // namespace
}  // namespace needlelab
