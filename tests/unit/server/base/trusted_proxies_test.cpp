#include "server/base/trusted_proxies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace needlelab {
namespace {

using testing::HasSubstr;

TrustedProxies proxies(const std::vector<std::string>& networks,
                       const std::string& header = "X-Forwarded-For") {
  auto parsed = TrustedProxies::parse(networks, header);
  if (!parsed.ok()) throw std::runtime_error(parsed.error().message);
  return *parsed;
}

TEST(TrustedProxies, areAddressesAndNetworks) {
  const auto some = proxies({"192.0.2.7", "10.1.0.0/16", "2001:db8::/33", "::ffff:198.51.100.1"});
  for (const char* host :
       {"192.0.2.7", "::ffff:192.0.2.7", "10.1.0.0", "10.1.255.255", "2001:db8:7fff::1", "198.51.100.1"})
    EXPECT_TRUE(some.trusts(host)) << host;
  for (const char* host : {"192.0.2.6", "10.0.255.255", "10.2.0.0", "2001:db8:8000::1", "198.51.100.0", "",
                           "proxy", "192.0.2.7:80"})
    EXPECT_FALSE(some.trusts(host)) << host;
  EXPECT_TRUE(proxies({"0.0.0.0/0"}).trusts("203.0.113.9"));
  EXPECT_FALSE(proxies({"0.0.0.0/0"}).trusts("2001:db8::1"));
  EXPECT_FALSE(TrustedProxies().trusts("127.0.0.1"));
}

TEST(TrustedProxies, sayWhichOptionIsWrong) {
  for (const char* text :
       {"", "proxy.example", "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1", "::/129", "10.0.0/8"}) {
    const auto parsed = TrustedProxies::parse({text}, "X-Forwarded-For");
    ASSERT_FALSE(parsed.ok()) << text;
    EXPECT_THAT(parsed.error().message, HasSubstr("--web-proxy '" + std::string(text) + "'"));
  }
  EXPECT_THAT(TrustedProxies::parse({}, "X-Real-IP").error().message,
              HasSubstr("--web-proxy-header 'X-Real-IP'"));
}

TEST(TrustedProxies, anUntrustedPeersForwardingHeaderIsIgnored) {
  EXPECT_EQ(proxies({"192.0.2.7"}).clientOf("203.0.113.5:4711", "10.0.0.1"), "203.0.113.5:4711");
  EXPECT_EQ(TrustedProxies().clientOf("127.0.0.1:80", "10.0.0.1"), "127.0.0.1:80");
}

TEST(TrustedProxies, theLastAddressThatIsNoProxyIsTheClient) {
  const auto some = proxies({"192.0.2.0/24", "2001:db8::7"});
  const auto client = [&](const char* value) { return some.clientOf("192.0.2.7:443", value); };
  EXPECT_EQ(client("203.0.113.5"), "203.0.113.5:0");
  EXPECT_EQ(client("10.9.9.9, 203.0.113.5"), "203.0.113.5:0") << "what the client said itself counts nothing";
  EXPECT_EQ(client("10.9.9.9, 203.0.113.5,192.0.2.9 , 2001:db8::7"), "203.0.113.5:0");
  EXPECT_EQ(client("203.0.113.5:51000"), "203.0.113.5:0");
  EXPECT_EQ(client("2001:db8::99"), "[2001:db8::99]:0");
  EXPECT_EQ(client("[2001:db8::99]:51000"), "[2001:db8::99]:0");
  EXPECT_EQ(client("192.0.2.9"), "192.0.2.9:0") << "no one but proxies: the first of them";
  EXPECT_EQ(some.clientOf("[2001:db8::7]:443", "203.0.113.5"), "203.0.113.5:0");
}

TEST(TrustedProxies, whatCannotBeReadLeavesTheProxy) {
  const auto some = proxies({"192.0.2.7"});
  for (const char* value : {"", " ", "unknown", "203.0.113.5,", "203.0.113.5, x", "203.0.113.5:x",
                            "[203.0.113.5", "203.0.113.256", "1.2.3.4;for=5.6.7.8"})
    EXPECT_EQ(some.clientOf("192.0.2.7:443", value), "192.0.2.7:443") << value;
  EXPECT_EQ(some.clientOf("192.0.2.7:443", std::string(5000, '9')), "192.0.2.7:443");
}

TEST(TrustedProxies, forwardedIsReadLikeRfc7239) {
  const auto some = proxies({"192.0.2.7"}, "Forwarded");
  EXPECT_EQ(some.header(), TrustedProxies::Header::kForwarded);
  const auto client = [&](const char* value) { return some.clientOf("192.0.2.7:443", value); };
  EXPECT_EQ(client("for=203.0.113.5;proto=https;by=192.0.2.7"), "203.0.113.5:0");
  EXPECT_EQ(client("proto=https; For=\"203.0.113.5:4711\""), "203.0.113.5:0");
  EXPECT_EQ(client("for=\"[2001:db8::99]:4711\""), "[2001:db8::99]:0");
  EXPECT_EQ(client("for=10.9.9.9, for=203.0.113.5, for=192.0.2.7"), "203.0.113.5:0");
  for (const char* value :
       {"for=_hidden", "for=unknown", "by=203.0.113.5", "203.0.113.5", "for=203.0.113.5, proto=http"})
    EXPECT_EQ(client(value), "192.0.2.7:443") << value;
}

}  // namespace
}  // namespace needlelab
