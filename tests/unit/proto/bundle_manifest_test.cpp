#include "proto/messages/bundle_manifest.h"

#include <gtest/gtest.h>

#include <string>

#include "proto/limits.h"

namespace voxeld {
namespace {

const std::string kId = "sha256-" + std::string(64, 'a');

std::string file(const std::string& name, const std::string& asset = kId) {
  return R"({"name":")" + name + R"(","asset":")" + asset + R"("})";
}
std::string bundle(const std::string& files) {
  return R"({"files":[)" + files + "]}";
}
std::string manifest_refusal(const std::string& text) {
  const auto files = parse_bundle_manifest(text);
  EXPECT_FALSE(files) << text.substr(0, 200);
  if (files) return "";
  EXPECT_EQ(files.error().code, ErrorCode::kMalformedBundle) << text.substr(0, 200);
  return files.error().message();
}

TEST(BundleManifest, names_its_files_in_their_order) {
  const auto files =
      parse_bundle_manifest(bundle(file("b/bob.md5mesh") + "," + file("a walk.md5anim")));
  ASSERT_TRUE(files) << files.error().message();
  ASSERT_EQ(files->size(), 2u);
  EXPECT_EQ((*files)[0].name, "b/bob.md5mesh");
  EXPECT_EQ((*files)[0].asset, kId);
  EXPECT_EQ((*files)[1].name, "a walk.md5anim");
}

TEST(BundleManifest, members_are_checked_by_name_and_type) {
  EXPECT_EQ(manifest_refusal("[]"), "bundle: expected an object, got array");
  EXPECT_EQ(manifest_refusal("{}"), "bundle.files: expected a value, got nothing");
  EXPECT_EQ(manifest_refusal(R"({"files":{}})"), "bundle.files: expected a list, got object");
  EXPECT_EQ(manifest_refusal(R"({"files":[],"size":5})"),
            "bundle.files: expected 1 to 1000 files, got 0");
  EXPECT_EQ(manifest_refusal(R"({"size":5,)" + bundle(file("a")).substr(1)),
            "bundle: no such member: expected files, got \"size\"");
  EXPECT_EQ(manifest_refusal(bundle("5")), "bundle.files[0]: expected an object, got number");
  EXPECT_EQ(manifest_refusal(bundle(R"({"asset":"x"})")),
            "bundle.files[0].name: expected a value, got nothing");
  EXPECT_EQ(manifest_refusal(bundle(R"({"name":"a"})")),
            "bundle.files[0].asset: expected a value, got nothing");
  EXPECT_EQ(manifest_refusal(bundle(file("a") + R"(,{"name":5,"asset":"x"})")),
            "bundle.files[1].name: expected a text, got number");
  EXPECT_EQ(manifest_refusal(bundle(R"({"bytes":5,)" + file("a").substr(1))),
            "bundle.files[0]: no such member: expected name, asset, got \"bytes\"");
  EXPECT_EQ(manifest_refusal(bundle(file("a", "sha256-5"))),
            "bundle.files[0].asset: expected the id of an uploaded asset, got \"sha256-5\"");
  EXPECT_EQ(manifest_refusal("{").substr(0, 26), "JSON: syntax error at byte");
}

TEST(BundleManifest, names_that_leave_the_bundle_are_refused) {
  for (const std::string name : {"", "/a", "../a", "a/../b", "a/..", "./a", "a//b", "a/", "c:/a",
                                 "a\\\\b", "a\\nb", "a\\u0000b"}) {
    EXPECT_EQ(manifest_refusal(bundle(file(name))).substr(0, 44),
              "bundle.files[0].name: expected a relative pa")
        << name;
  }
  EXPECT_TRUE(parse_bundle_manifest(bundle(file(std::string(255, 'n')))));
  manifest_refusal(bundle(file(std::string(256, 'n'))));
  EXPECT_TRUE(parse_bundle_manifest(bundle(file("...a/b..c/.hidden"))));
}

TEST(BundleManifest, two_of_one_name_are_refused) {
  EXPECT_EQ(manifest_refusal(bundle(file("a/B.tga") + "," + file("a/B.tga"))),
            "bundle.files[1].name: expected distinct names, got \"a/B.tga\" again");
  EXPECT_TRUE(parse_bundle_manifest(bundle(file("a/B.tga") + "," + file("A/b.TGA"))));
}

TEST(BundleManifest, the_number_of_files_has_a_limit) {
  EXPECT_EQ(manifest_refusal(bundle("")), "bundle.files: expected 1 to 1000 files, got 0");
  std::string files = file("0");
  for (int i = 1; i < limits::kBundleEntriesMax; ++i) files += "," + file(std::to_string(i));
  EXPECT_EQ(parse_bundle_manifest(bundle(files))->size(), 1000u);
  EXPECT_EQ(manifest_refusal(bundle(files + "," + file("last"))),
            "bundle.files: expected 1 to 1000 files, got 1001");
}

TEST(BundleManifest, a_text_over_the_limit_of_json_bodies_is_too_large) {
  const auto files = parse_bundle_manifest(std::string(limits::kJsonBodyBytesMax + 1, ' '));
  ASSERT_FALSE(files);
  EXPECT_EQ(files.error().code, ErrorCode::kPayloadTooLarge);
}

}  // namespace
}  // namespace voxeld
