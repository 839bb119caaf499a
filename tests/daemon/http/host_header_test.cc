#include "daemon/http/host_header.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

TEST(HostHeader, AllowsLoopbackAndNamedHostsAlone) {
  const std::vector<std::string> names = {"Plate.example.org", "192.0.2.7", "2001:db8::7"};
  for (const char* host :
       {"localhost", "LOCALHOST:9890", "127.0.0.1", "127.0.0.1:80", "[::1]", "[::1]:9890",
        "plate.example.org", "plate.EXAMPLE.org:9890", "192.0.2.7:1", "[2001:db8::7]:9890"})
    EXPECT_TRUE(IsAllowedHost(host, names)) << host;
  for (const char* host :
       {"", ":9890", "evil.example", "evil.example:9890", "localhost.evil.example", "127.0.0.1.x",
        "xlocalhost", "localhost:80@evil.example", "[::1", "[::1]x", "[::1]:x", "::1",
        "plate.example.org.", "0.0.0.0", "127.0.0.2", "local host", "[]", "[]:80"})
    EXPECT_FALSE(IsAllowedHost(host, names)) << host;
  EXPECT_FALSE(IsAllowedHost("plate.example.org", {}));
  EXPECT_FALSE(IsAllowedHost("", {""}));
}

}  // namespace
}  // namespace focalfleet
