#include <gmock/gmock.h>

#include <utility>

#include "proto/limits.h"
#include "tests/unit/scene/scene_test_util.h"
#include "tests/unit/scene/zip_maker.h"

namespace voxeld {
namespace {

using test::bytes_of;
using test::message_of;
using test::ZipMaker;

std::string open_message(const std::string& zip) {
  return message_of(zip_bundle(bytes_of(zip)));
}

std::string find_text(const Bundle& bundle, std::string_view reference,
                      std::string_view from = "") {
  const auto bytes = bundle.find(reference, from);
  if (!bytes) return bytes.error().message();
  if (!*bytes) return "none";
  return {(*bytes)->begin(), (*bytes)->end()};
}

TEST(ZipBundle, holds_stored_and_deflated_files_but_no_folders) {
  const std::string zip = ZipMaker()
                              .add({.name = "models/", .data = "", .unix_mode = 0040755})
                              .add("models/a.obj", "v 0 0 0")
                              .add({.name = "b.mtl", .data = "newmtl x", .deflated = true})
                              .add("empty.txt", "")
                              .bytes();
  const auto bundle = zip_bundle(bytes_of(zip));
  ASSERT_TRUE(bundle) << bundle.error().message();
  ASSERT_EQ((*bundle)->entries().size(), 3u);
  EXPECT_EQ((*bundle)->entries()[0].name, "models/a.obj");
  EXPECT_EQ((*bundle)->entries()[0].bytes, 7);
  EXPECT_EQ(find_text(**bundle, "A.OBJ", "models/x.obj"), "v 0 0 0");
  EXPECT_EQ(find_text(**bundle, "b.mtl", "models/a.obj"), "newmtl x");
  EXPECT_EQ(find_text(**bundle, "empty.txt"), "");
  EXPECT_EQ(find_text(**bundle, "nothing"), "none");
}

TEST(ZipBundle, names_with_backslashes_are_paths) {
  const std::string zip = ZipMaker().add("tex\\skin.png", "x").bytes();
  const auto bundle = zip_bundle(bytes_of(zip));
  ASSERT_TRUE(bundle) << bundle.error().message();
  EXPECT_EQ((*bundle)->entries()[0].name, "tex/skin.png");
}

// Zips of Chinese and Japanese Windows have names in its encoding, and so have the meshes in them.
TEST(ZipBundle, names_in_a_legacy_encoding_are_found_by_bytes_and_by_characters) {
  const std::string gbk = "\xcc\xf9\xcd\xbc", sjis = "\x83\x5c\x95\x5c";
  for (const auto& [bytes, text] : {std::pair(gbk, "贴图"), std::pair(sjis, "ソ表")}) {
    const std::string zip = ZipMaker()
                                .add(bytes + "/a.obj", "mesh")
                                .add(bytes + "/" + bytes + ".png", "inside")
                                .add(bytes + ".png", "outside")
                                .bytes();
    const auto bundle = zip_bundle(bytes_of(zip));
    ASSERT_TRUE(bundle) << bundle.error().message();
    // Names for people are the reading of zips without a mark, code page 437.
    const std::string mesh = (*bundle)->entries()[0].name;
    EXPECT_EQ(find_text(**bundle, mesh), "mesh");
    EXPECT_EQ(find_text(**bundle, (*bundle)->entries()[2].name), "outside");
    EXPECT_EQ(find_text(**bundle, bytes + ".png", mesh), "inside");
    EXPECT_EQ(find_text(**bundle, std::string(text) + ".png", mesh), "inside");
    EXPECT_EQ(find_text(**bundle, std::string("../") + text + ".png", mesh), "outside");
  }
}

TEST(ZipBundle, hostile_names_are_refused) {
  const std::pair<std::string, std::string> cases[] = {
      {"../up.obj", "zip: entry \"../up.obj\" leaves the bundle by \"..\""},
      {"a/../b.obj", "zip: entry \"a/../b.obj\" leaves the bundle by \"..\""},
      {"a\\..\\b.obj", "zip: entry \"a\\..\\b.obj\" leaves the bundle by \"..\""},
      {"/etc/passwd", "zip: entry \"/etc/passwd\" has an absolute or empty path"},
      {"C:\\x.obj", "zip: entry \"C:\\x.obj\" has an absolute or empty path"},
      {"./", "zip: entry \"./\" has an absolute or empty path"},
      {"", "zip: an entry without a name"}};
  for (const auto& [name, message] : cases) {
    EXPECT_EQ(open_message(ZipMaker().add(name, "x").bytes()), message);
  }
  EXPECT_EQ(open_message(ZipMaker().add(std::string("a\0b.obj", 7), "x").bytes()),
            "zip: entry \"a\\x00b.obj\" has a NUL in its name");
}

TEST(ZipBundle, links_and_devices_are_refused) {
  EXPECT_EQ(open_message(
                ZipMaker().add({.name = "l", .data = "/etc/passwd", .unix_mode = 0120777}).bytes()),
            "zip: entry \"l\" is a link or device, not a file");
}

TEST(ZipBundle, encrypted_entries_are_refused) {
  EXPECT_EQ(open_message(
                ZipMaker().add({.name = "s.obj", .data = "0123456789abcdef", .flags = 1}).bytes()),
            "zip: entry \"s.obj\" is encrypted");
}

TEST(ZipBundle, too_many_entries_are_refused_before_they_are_read) {
  ZipMaker at_limit;
  for (int i = 0; i < limits::kBundleEntriesMax; ++i) at_limit.add(std::to_string(i), "");
  EXPECT_EQ(open_message(at_limit.bytes()), "ok");
  EXPECT_EQ(open_message(at_limit.add("one more", "").bytes()),
            "zip: too many entries: expected at most 1000, got 1001");
}

TEST(ZipBundle, a_ratio_of_more_than_200_is_refused_but_for_256_mebibytes_of_images) {
  const auto zip_declaring = [](int64_t bytes, const char* name) {
    return ZipMaker()
        .add({.name = name,
              .data = std::string(10'000, 'x'),
              .deflated = true,
              .declared_bytes = bytes})
        .bytes();
  };
  EXPECT_EQ(open_message(zip_declaring(2'000'000, "a")), "ok");
  EXPECT_EQ(open_message(zip_declaring(3'000'000, "a")),
            "zip: entry \"a\": inflates too much: expected at most 200 times, got 10005 bytes to "
            "3000000");
  EXPECT_EQ(open_message(zip_declaring(limits::kBundleFlatBytesMax, "a.TGA")), "ok");
  EXPECT_EQ(open_message(zip_declaring(limits::kBundleFlatBytesMax + 1, "a.TGA")),
            "zip: entry \"a.TGA\": inflates too much: expected at most 200 times, got 10005 bytes "
            "to 268435457");
}

TEST(ZipBundle, entries_that_claim_more_than_the_zip_are_refused) {
  const std::string zip =
      ZipMaker()
          .add({.name = "a", .data = "xyz", .declared_bytes = 9999, .declared_stored = 9999})
          .bytes();
  EXPECT_EQ(open_message(zip), "zip: entry \"a\": larger than the zip itself: expected at most " +
                                   std::to_string(zip.size()) + " bytes, got 9999");
}

TEST(ZipBundle, entries_that_overlap_are_refused) {
  ZipMaker maker;
  for (int i = 0; i < 20; ++i) {
    maker.add(
        {.name = std::to_string(i), .data = "xyz", .declared_bytes = 500, .declared_stored = 500});
  }
  EXPECT_THAT(open_message(maker.bytes()),
              testing::StartsWith("zip: entries overlap: together larger than the zip itself"));
}

TEST(ZipBundle, the_sum_of_all_files_is_capped) {
  // The headers claim 3 GiB each; the ratio of each is honest, for the stored sizes lie as well.
  EXPECT_GT(int64_t{3} << 30, limits::kBundleInflatedBytesMax / 3);
  const std::string big(17 << 20, 'x');
  ZipMaker maker;
  for (int i = 0; i < 3; ++i) {
    maker.add({.name = std::to_string(i), .data = big, .declared_bytes = int64_t{3} << 30});
  }
  EXPECT_EQ(open_message(maker.bytes()),
            "zip: inflates too much: expected at most 8589934592 bytes, got 9663676416");
}

// A mesh names one file under a thousand names.
TEST(ZipBundle, files_that_are_asked_for_again_and_again_are_refused_at_last) {
  ZipMaker maker;
  maker.add({.name = "a.png", .data = std::string(4 << 20, 'x'), .deflated = true});
  const std::string zip = maker.bytes();
  const auto bundle = zip_bundle(bytes_of(zip));
  ASSERT_TRUE(bundle) << bundle.error().message();
  int found = 0;
  Error refused;
  for (; found < 100; ++found) {
    const auto bytes = (*bundle)->find("A.PNG", "");
    if (!bytes) {
      refused = bytes.error();
      break;
    }
  }
  EXPECT_EQ(found, 20);
  EXPECT_EQ(refused.code, ErrorCode::kMalformedBundle);
  EXPECT_EQ(refused.message(),
            "zip: entry \"a.png\": the bundle's files are read too often: expected at most "
            "83886080 bytes to inflate in all, got 88080384");
}

TEST(ZipBundle, headers_that_lie_about_the_size_are_caught_while_inflating) {
  const std::pair<int64_t, const char*> cases[] = {
      {5, "zip: entry \"a\": wrong size: expected 5 bytes, got more"},
      {50, "zip: entry \"a\": wrong size: expected 50 bytes, got 10"}};
  for (const auto& [declared, message] : cases) {
    const std::string zip =
        ZipMaker()
            .add({.name = "a", .data = "0123456789", .deflated = true, .declared_bytes = declared})
            .bytes();
    const auto bundle = zip_bundle(bytes_of(zip));
    ASSERT_TRUE(bundle) << bundle.error().message();
    EXPECT_EQ(find_text(**bundle, "a"), message);
  }
}

TEST(ZipBundle, wrong_checksums_are_caught) {
  const std::string zip =
      ZipMaker().add({.name = "a", .data = "0123456789", .wrong_checksum = true}).bytes();
  const auto bundle = zip_bundle(bytes_of(zip));
  ASSERT_TRUE(bundle) << bundle.error().message();
  EXPECT_EQ(find_text(**bundle, "a"), "zip: entry \"a\": CRC error");
}

TEST(ZipBundle, broken_zips_are_refused) {
  EXPECT_EQ(open_message(""), "zip: truncated: expected at least 22 bytes, got 0");
  EXPECT_EQ(open_message(std::string(100, 'x')), "zip: no end record: truncated, or not a zip");
  // The end record says 65,535: a zip64 record must follow, and there is none.
  std::string lying = ZipMaker().add("a", "x").bytes();
  lying.replace(lying.size() - 12, 2, "\xff\xff");
  EXPECT_EQ(open_message(lying), "zip: too many entries: expected at most 1000, got 65535");
}

TEST(ZipBundle, every_truncation_is_refused_or_harmless) {
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  test::expect_truncations_survive(
      "a.zip", ZipMaker().add({.name = "a.obj", .data = obj, .deflated = true}).bytes());
}

TEST(ZipBundle, every_flipped_byte_is_refused_or_harmless) {
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const std::string zip =
      ZipMaker().add({.name = "a.obj", .data = obj, .deflated = true}).add("b.txt", "x").bytes();
  for (size_t i = 0; i < zip.size(); ++i) {
    for (const int flip : {0x01, 0x80, 0xff}) {
      std::string broken = zip;
      broken[i] = static_cast<char>(broken[i] ^ flip);
      const auto scene = test::load_text("a.zip", broken);
      if (scene) test::expect_consistent(*scene);
    }
  }
}

}  // namespace
}  // namespace voxeld
