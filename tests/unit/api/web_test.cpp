// The page for browsers: who gets it, with which headers, and the files that it names.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "server/api/accept.h"
#include "server/api/web_files.h"
#include "server/base/disk/file.h"
#include "tests/unit/api/api_server_fixture.h"

namespace voxeld::api {
namespace {

const std::string kBrowser =
    "Accept: text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,*/*;q=0.8\r\n";

// The names after "/web/" in the document.
std::vector<std::string> names_in(const std::string& document) {
  std::vector<std::string> names;
  const std::regex name("\"/web/([^\"]+)\"");
  for (std::sregex_iterator at(document.begin(), document.end(), name), end; at != end; ++at) {
    names.push_back((*at)[1]);
  }
  return names;
}

class WebTest : public ServerTest {
 protected:
  void SetUp() override {
    if (web_files().empty()) GTEST_SKIP() << "built without the page (VOXELD_WITH_WEB=OFF)";
    ServerTest::SetUp();
  }
};

TEST_F(WebTest, the_start_is_a_page_for_browsers_and_a_text_for_others) {
  const HttpResponse page = get("/", kBrowser);
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.header("content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(page.header("vary"), "Accept-Encoding, Accept");
  EXPECT_EQ(page.header("cache-control"), "no-cache");
  EXPECT_TRUE(page.body.starts_with("<!doctype html>")) << page.body.substr(0, 80);
  for (const char* lines : {"", "Accept: */*\r\n", "Accept: text/plain\r\n",
                            "Accept: application/json\r\n", "Accept: text/html;q=0.5, */*\r\n"}) {
    const HttpResponse text = get("/", lines);
    EXPECT_EQ(text.status, 200) << lines;
    EXPECT_EQ(text.header("content-type"), "text/plain; charset=utf-8") << lines;
    EXPECT_EQ(text.header("vary"), "Accept") << lines;
    EXPECT_NE(text.body.find("curl --data-binary"), std::string::npos) << lines;
  }
}

TEST_F(WebTest, the_page_may_load_nothing_from_elsewhere) {
  for (const char* path : {"/", "/admin"}) {
    const HttpResponse page = get(path, kBrowser);
    EXPECT_EQ(page.status, 200) << path;
    EXPECT_EQ(page.header("content-security-policy"),
              "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: "
              "data:; connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; "
              "frame-ancestors 'none'");
    EXPECT_EQ(page.header("referrer-policy"), "no-referrer");
    EXPECT_EQ(page.header("cross-origin-opener-policy"), "same-origin");
    EXPECT_EQ(page.header("x-content-type-options"), "nosniff");
    EXPECT_EQ(page.body.find("://"), std::string::npos) << "another origin is named";
  }
}

TEST_F(WebTest, files_have_a_hash_in_their_name_and_are_kept_for_ever) {
  const std::vector<std::string> names = names_in(get("/", kBrowser).body);
  EXPECT_EQ(names.size(), 3U);
  for (const std::string& name : names) {
    EXPECT_TRUE(std::regex_match(name, std::regex("[a-z]+\\.[0-9a-f]{16}\\.(js|css)"))) << name;
    const HttpResponse file = get("/web/" + name);
    EXPECT_EQ(file.status, 200) << name;
    EXPECT_EQ(file.header("cache-control"), "public, max-age=31536000, immutable");
    EXPECT_EQ(file.header("content-type"), name.ends_with(".css")
                                               ? "text/css; charset=utf-8"
                                               : "text/javascript; charset=utf-8");
  }
}

TEST_F(WebTest, bytes_are_compressed_for_clients_that_take_gzip) {
  for (const WebFile& file : web_files()) {
    if (file.name == kPageName) continue;
    const std::string path = "/web/" + std::string(file.name);
    const HttpResponse packed = get(path, "Accept-Encoding: br, gzip\r\n");
    EXPECT_EQ(packed.header("content-encoding"), "gzip") << path;
    EXPECT_EQ(packed.body, std::string(file.gzip.begin(), file.gzip.end()));
    const HttpResponse plain = get(path, "Accept-Encoding: gzip;q=0, *;q=0.1\r\n");
    EXPECT_EQ(plain.header("content-encoding"), "") << path;
    EXPECT_EQ(static_cast<int64_t>(plain.body.size()), file.plain_bytes);
    EXPECT_NE(plain.header("etag"), packed.header("etag"));
    EXPECT_EQ(packed.header("vary"), "Accept-Encoding");
  }
}

TEST_F(WebTest, a_browser_that_has_the_page_gets_no_bytes) {
  const std::string tag = get("/", kBrowser).header("etag");
  EXPECT_EQ(tag.size(), 66U);
  const HttpResponse known = get("/", kBrowser + "If-None-Match: \"x\", W/" + tag + "\r\n");
  EXPECT_EQ(known.status, 304);
  EXPECT_EQ(known.body, "");
  EXPECT_EQ(known.header("etag"), tag);
  EXPECT_EQ(get("/", kBrowser + "If-None-Match: \"x\"\r\n").status, 200);
}

TEST_F(WebTest, an_unknown_file_is_not_found) {
  for (const char* name : {"nothing.js", "..%2fopenapi.json", "app.js"}) {
    const HttpResponse response = get(std::string("/web/") + name);
    EXPECT_EQ(response.status, 404) << name;
    EXPECT_EQ(response.code(), "not-found") << name;
  }
}

TEST_F(WebTest, the_page_needs_no_key_and_what_it_calls_does) {
  (void)add_key("lab");
  EXPECT_EQ(get("/", kBrowser).status, 200);
  EXPECT_EQ(get("/admin", kBrowser).status, 200);
  for (const std::string& name : names_in(get("/", kBrowser).body)) {
    EXPECT_EQ(get("/web/" + name).status, 200);
  }
  EXPECT_EQ(get("/v1/me").status, 401);
}

TEST_F(WebTest, links_of_other_pages_lead_to_the_page_and_no_further) {
  const std::string cross = "Sec-Fetch-Site: cross-site\r\n";
  EXPECT_EQ(get("/", kBrowser + cross).status, 200);
  EXPECT_EQ(get("/admin", kBrowser + cross).status, 200);
  EXPECT_EQ(get("/v1/jobs", cross).status, 403);
}

TEST_F(WebTest, a_folder_replaces_the_embedded_files_while_developing) {
  const std::filesystem::path folder = dir_.path() / "page";
  std::filesystem::create_directories(folder);
  const auto write = [&](const char* name, const std::string& text) {
    const std::vector<uint8_t> bytes(text.begin(), text.end());
    ASSERT_TRUE(write_file(folder / name, bytes));
  };
  write("index.html", "<p>draft");
  write("app.js", "1;");
  write(".hidden.js", "2;");
  ApiServerConfig config;
  config.web_dir = folder;
  start(config);
  EXPECT_EQ(get("/", kBrowser).body, "<p>draft");
  EXPECT_EQ(get("/web/app.js").body, "1;");
  EXPECT_EQ(get("/web/app.js").header("cache-control"), "no-cache");
  write("app.js", "3;");
  EXPECT_EQ(get("/web/app.js").body, "3;");
  for (const char* name : {".hidden.js", "..", "%2e%2e", "a%2fb", "nothing.js"}) {
    EXPECT_EQ(get(std::string("/web/") + name).status, 404) << name;
  }
}

TEST(AcceptsGzip, follows_weights_and_the_most_specific_name) {
  for (const char* header : {"gzip", "deflate, GZIP", "x-gzip", "*", "br;q=1, gzip;q=0.2"}) {
    EXPECT_TRUE(accepts_gzip(header)) << header;
  }
  for (const char* header : {"", "identity", "br", "gzip;q=0", "*, gzip;q=0", "*;q=0"}) {
    EXPECT_FALSE(accepts_gzip(header)) << header;
  }
}

// --- names of downloads

class DownloadNames : public ServerTest {
 protected:
  std::string disposition(const std::string& target) {
    return get(target).header("content-disposition");
  }
};

TEST_F(DownloadNames, a_result_is_named_as_the_request_says) {
  const std::string result = finished_job("bytes") + "/result";
  EXPECT_EQ(disposition(result), "inline; filename=\"result.npy\"");
  EXPECT_EQ(disposition(result + "?filename=bunny"), "inline; filename=\"bunny.npy\"");
  EXPECT_EQ(disposition(result + "?filename=bunny.npy"), "inline; filename=\"bunny.npy\"");
  EXPECT_EQ(disposition(result + "?filename=a/b/my.bunny.ply"),
            "inline; filename=\"my.bunny.npy\"");
  EXPECT_EQ(disposition(result + "?filename=Hello!.ply"), "inline; filename=\"Hello!.npy\"");
  EXPECT_EQ(disposition(result + "?filename=all.zip!b/c.ply"), "inline; filename=\"c.npy\"");
  EXPECT_EQ(get(result + "?filename=bunny").body, "bytes");
  const HttpResponse refused = get(result + "?filename=" + std::string(256, 'a'));
  EXPECT_EQ(refused.status, 400);
  EXPECT_EQ(refused.code(), "invalid-option");
}

TEST_F(DownloadNames, a_link_keeps_the_name_and_only_that_one) {
  const std::string job = finished_job("bytes");
  const auto link = json(request("POST", job + "/share?filename=bunny.vox"));
  const std::string url = link.value("url", "");
  EXPECT_EQ(disposition(url), "inline; filename=\"bunny.npy\"");
  std::string changed = url;
  changed.replace(changed.find("bunny"), 5, "other");
  EXPECT_EQ(get(changed).status, 404);
}

}  // namespace
}  // namespace voxeld::api
