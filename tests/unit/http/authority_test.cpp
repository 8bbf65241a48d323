#include "server/http/message/authority.h"

#include <gtest/gtest.h>

#include <string>

namespace voxeld {
namespace {

TEST(ParseAuthority, takes_names_and_addresses_with_and_without_a_port) {
  EXPECT_EQ(parse_authority("localhost"), (Authority{"localhost", 0}));
  EXPECT_EQ(parse_authority("Voxel.Example.ORG:8443"), (Authority{"voxel.example.org", 8443}));
  EXPECT_EQ(parse_authority("127.0.0.1:80"), (Authority{"127.0.0.1", 80}));
  EXPECT_EQ(parse_authority("[::1]"), (Authority{"[::1]", 0}));
  EXPECT_EQ(parse_authority("[FE80::1]:65535"), (Authority{"[fe80::1]", 65535}));
  EXPECT_EQ(parse_authority("h:"), (Authority{"h", 0}));
  EXPECT_EQ(parse_authority(""), (Authority{"", 0}));
  EXPECT_EQ(parse_authority(std::string(kHostBytesMax, 'a'))->host.size(), kHostBytesMax);
}

TEST(ParseAuthority, refuses_texts_that_are_no_host) {
  for (const char* text : {"a b",
                           "a,b",
                           "a/b",
                           "a@b",
                           "a%20b",
                           "a?b",
                           "a\\b",
                           "a\"b",
                           "<a>",
                           "h:80:80",
                           "h:-1",
                           "h:+1",
                           "h:65536",
                           "h:99999999999",
                           "h:8o",
                           "h: 80",
                           "::1",
                           "[::1",
                           "[::1]x",
                           "[::g]",
                           "[]",
                           "[127.0.0.1]",
                           "[fe80::1%25eth0]",
                           "\xc3\xa4.example"}) {
    EXPECT_FALSE(parse_authority(text)) << text;
  }
  EXPECT_FALSE(parse_authority(std::string(kHostBytesMax + 1, 'a')));
}

TEST(ParseOrigin, accepts_only_the_form_that_browsers_send) {
  EXPECT_EQ(parse_origin("http://localhost:3000"), (Origin{"http", {"localhost", 3000}}));
  EXPECT_EQ(parse_origin("https://App.example.org"), (Origin{"https", {"app.example.org", 0}}));
  EXPECT_EQ(parse_origin("http://h")->port(), 80);
  EXPECT_EQ(parse_origin("https://h")->port(), 443);
  EXPECT_EQ(parse_origin("https://h:81")->port(), 81);
  for (const char* text :
       {"", "*", "null", "localhost", "http://", "http://h/", "http://h/a", "file://", "http://h h",
        "http://u@h", "ftp://h", "http://*.example.org", "HTTP://h", "http://a, http://b"}) {
    EXPECT_FALSE(parse_origin(text)) << text;
  }
}

TEST(Hosts, loopback_is_told_by_address_or_by_the_name_that_no_dns_gives_away) {
  for (const char* host :
       {"localhost", "localhost.", "127.0.0.1", "127.9.8.7", "[::1]", "[::ffff:127.0.0.1]"}) {
    EXPECT_TRUE(is_loopback_host(host)) << host;
  }
  for (const char* host : {"", "127.evil.example", "127.0.0.1.evil.example",
                           "localhost.evil.example", "evil.localhost.example", "0.0.0.0", "[::]",
                           "::1", "10.0.0.1", "[::2]", "127.1", "2130706433"}) {
    EXPECT_FALSE(is_loopback_host(host)) << host;
  }
  EXPECT_TRUE(is_address("10.0.0.1") && is_address("[fe80::1]"));
  EXPECT_FALSE(is_address("10.0.0.1.example") || is_address("fe80::1") || is_address("h"));
  EXPECT_TRUE(is_unspecified_host("0.0.0.0") && is_unspecified_host("[::]"));
  EXPECT_FALSE(is_unspecified_host("127.0.0.1") || is_unspecified_host("h"));
}

}  // namespace
}  // namespace voxeld
