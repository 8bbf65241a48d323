// Web pages and rebound names at the door; tests/integration/test_web_pages.py has the same over
// sockets.
#include "server/api/access/origin_guard.h"

#include <gtest/gtest.h>

#include <string>

#include "server/http/message/head_parser.h"

namespace voxeld::api {
namespace {

const OriginRules kRules = {{"Voxels.example"}, {"https://App.example", "http://localhost:3000"}};

Head head_of(const std::string& lines, const std::string& line = "GET /v1/jobs HTTP/1.1") {
  return http::parse_head(line + "\r\n" + lines + "\r\n").value();
}

// The message of the refusal, or "taken".
std::string verdict(const std::string& lines, bool is_open = true,
                    const std::string& listen = "127.0.0.1:8080") {
  const Status checked = OriginGuard(kRules, listen).check(head_of(lines), is_open);
  return checked ? "taken" : checked.error().message();
}

TEST(OriginGuard, an_open_daemon_says_which_hosts_it_expects) {
  EXPECT_EQ(verdict("Host: evil.example:8080\r\n"),
            "this daemon needs no API key, so it serves only its own names: expected as Host "
            "localhost, a loopback address or a name of --public-host, got \"evil.example:8080\"");
  EXPECT_EQ(verdict("Host: evil.example:8080\r\n", /*is_open=*/false), "taken");
  EXPECT_EQ(verdict("Host: voxels.EXAMPLE\r\n"), "taken");
}

TEST(OriginGuard, other_addresses_are_names_of_listeners_that_are_not_on_loopback) {
  EXPECT_NE(verdict("Host: 192.0.2.1\r\n"), "taken");
  EXPECT_EQ(verdict("Host: 192.0.2.1\r\n", true, "0.0.0.0:80"), "taken");
  EXPECT_EQ(verdict("Host: [2001:db8::1]\r\n", true, "[::]:80"), "taken");
  EXPECT_NE(verdict("Host: 0.0.0.0\r\n", true, "0.0.0.0:80"), "taken");
  EXPECT_NE(verdict("Host: evil.example\r\n", true, "0.0.0.0:80"), "taken");
}

TEST(OriginGuard, an_absolute_target_counts_for_the_host_and_the_header_does_not) {
  const Head head = head_of("Host: localhost\r\n", "GET http://evil.example/v1/jobs HTTP/1.1");
  EXPECT_FALSE(OriginGuard(kRules, "127.0.0.1:80").check(head, true));
}

TEST(OriginGuard, an_origin_is_the_daemons_own_by_host_and_port) {
  const std::string host = "Host: localhost:8080\r\n";
  EXPECT_EQ(verdict(host + "Origin: http://localhost:8080\r\n"), "taken");
  EXPECT_EQ(verdict(host + "Origin: http://localhost:8081\r\n"),
            "a web page of another origin must not call this daemon: expected the daemon's own "
            "origin, or one of --cors-origin, got Origin: \"http://localhost:8081\"");
  EXPECT_NE(verdict(host + "Origin: http://127.0.0.1:8080\r\n"), "taken");
  EXPECT_EQ(verdict("Host: localhost\r\nOrigin: https://localhost:443\r\n"), "taken");
  EXPECT_NE(verdict("Host: localhost\r\nOrigin: https://localhost:80\r\n"), "taken");
  EXPECT_EQ(verdict(host + "Origin: https://app.example\r\nSec-Fetch-Site: cross-site\r\n"),
            "taken");
  EXPECT_NE(verdict(host + "Origin: https://app.example, https://app.example\r\n"), "taken");
}

TEST(OriginGuard, with_keys_other_origins_are_served_without_cors_headers) {
  const OriginGuard guard(kRules, "127.0.0.1:80");
  const auto respond = [&](const std::string& origin, bool is_preflight) {
    const std::string ask = is_preflight ? "Access-Control-Request-Method: POST\r\n" : "";
    const Head head = head_of("Host: h\r\nOrigin: " + origin + "\r\n" + ask,
                              is_preflight ? "OPTIONS /v1/jobs HTTP/1.1" : "GET /v1/jobs HTTP/1.1");
    Response response = Response::text(200, "");
    if (auto preflight = guard.preflight(head)) response = *preflight;
    if (!guard.check(head, /*is_open=*/false)) response.status = 403;
    guard.add_headers(head, response);
    return response;
  };
  EXPECT_EQ(respond("https://app.example", true).status, 204);
  EXPECT_EQ(respond("https://app.example", true).headers["Access-Control-Allow-Origin"],
            "https://app.example");
  EXPECT_EQ(respond("https://evil.example", true).status, 403);
  for (const bool is_preflight : {false, true}) {
    Response foreign = respond("https://evil.example", is_preflight);
    EXPECT_EQ(foreign.headers.count("Access-Control-Allow-Origin"), 0U);
    EXPECT_EQ(foreign.headers["Vary"], "Origin");
  }
  EXPECT_EQ(respond("http://localhost:3000", false).headers["Access-Control-Allow-Origin"],
            "http://localhost:3000");
  EXPECT_EQ(respond("https://evil.example", false).status, 200);
  EXPECT_EQ(respond("http://app.example", false).headers.count("Access-Control-Allow-Origin"), 0U);
}

}  // namespace
}  // namespace voxeld::api
