// Uploads and jobs with compressed bodies.
#include <algorithm>
#include <string>
#include <vector>

#include "server/api/resources/api.h"
#include "tests/unit/api/api_server_fixture.h"
#include "tests/unit/http/coding.h"

namespace voxeld::api {
namespace {

using testing::gzip;
using testing::zstd;

class CodedBodies : public ServerTest {
 protected:
  static constexpr const char* kGzippedJson =
      "Content-Encoding: gzip\r\nContent-Type: application/json\r\n";
};

TEST_F(CodedBodies, an_upload_is_stored_as_it_inflates) {
  const std::string plain = json(request("POST", "/v1/assets", "", "a mesh")).value("id", "");
  for (const std::string& name : {std::string("gzip"), std::string("zstd")}) {
    const HttpResponse response =
        request("POST", "/v1/assets", "Content-Encoding: " + name + "\r\n",
                name == "gzip" ? gzip("a mesh") : zstd("a mesh"));
    EXPECT_EQ(response.status, 200) << name << response.body;
    EXPECT_EQ(json(response).value("id", ""), plain);
  }
  const std::string job = R"({"kind":"voxelize","asset":")" + plain + R"("})";
  EXPECT_EQ(request("POST", "/v1/jobs", kGzippedJson, gzip(job)).status, 202);
}

TEST_F(CodedBodies, an_invalid_coded_body_is_refused_with_the_reason) {
  const HttpResponse other = request("POST", "/v1/assets", "Content-Encoding: br\r\n", "x");
  EXPECT_EQ(other.status, 415);
  EXPECT_EQ(other.header("accept-encoding"), "gzip, zstd");
  const HttpResponse text = request("POST", "/v1/jobs", "Content-Type: text/plain\r\n", "x");
  EXPECT_EQ(text.status, 415);
  EXPECT_EQ(text.header("accept-encoding"), "");
  EXPECT_EQ(request("POST", "/v1/assets", "Content-Encoding: gzip, zstd\r\n", "x").status, 415);
  EXPECT_EQ(request("POST", "/v1/assets", "Content-Encoding: gzip\r\n", "x").status, 400);
  const std::string bomb = gzip(std::string(size_t{2} << 20, ' '));
  EXPECT_EQ(request("POST", "/v1/jobs", kGzippedJson, bomb).status, 413);
}

TEST_F(CodedBodies, uploads_in_zstd_are_few_at_a_time) {
  const auto has_response = [](const HttpClient& client) { return client.readable(0); };
  std::vector<HttpClient> clients;
  for (int i = 0; i <= kZstdUploadsMax / 2; ++i) {
    ASSERT_TRUE(clients.emplace_back(server_->port())
                    .send("POST /v1/assets HTTP/1.1\r\nHost: h\r\nContent-Encoding: zstd\r\n"
                          "Content-Length: 100\r\n\r\n"));
  }
  ASSERT_TRUE(comes_true([&] { return std::ranges::any_of(clients, has_response); }));
  const HttpResponse refused =
      std::ranges::find_if(clients, has_response)->receive().value_or(HttpResponse{});
  EXPECT_EQ(refused.status, 429);
  EXPECT_EQ(refused.detail(), "too many requests of this tenant upload zstd at a time");
  EXPECT_EQ(request("POST", "/v1/assets", "", "a mesh").status, 201);
  clients.clear();
  EXPECT_TRUE(comes_true([&] {
    return request("POST", "/v1/assets", "Content-Encoding: zstd\r\n", zstd("a mesh")).status ==
           200;
  }));
}

}  // namespace
}  // namespace voxeld::api
