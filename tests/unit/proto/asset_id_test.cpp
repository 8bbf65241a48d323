#include "proto/asset_id.h"

#include <gtest/gtest.h>

namespace voxeld {
namespace {

const std::string kBlob = "sha256-" + std::string(64, 'a');

TEST(AssetId, the_extension_decides_how_a_file_is_read) {
  EXPECT_EQ(reading_of("models/bunny.PLY"), ".ply");
  EXPECT_EQ(reading_of("a.zip!models/B.obj"), ".zip!models/B.obj");
  EXPECT_EQ(reading_of("bunny"), "");
  EXPECT_EQ(reading_of(""), "");
}

TEST(AssetId, an_id_says_its_reading_in_characters_of_urls) {
  EXPECT_EQ(AssetId({kBlob, std::nullopt}).text(), kBlob);
  EXPECT_EQ(AssetId({kBlob, ".obj"}).text(), kBlob + ".obj");
  EXPECT_EQ(AssetId({kBlob, ""}).text(), kBlob + ".bytes");
  EXPECT_EQ(AssetId({kBlob, ".zip!a b/c.obj"}).text(), kBlob + ".zip~21a~20b~2fc.obj");
}

TEST(AssetId, every_reading_comes_back) {
  for (const std::string reading : {".obj", ".zip!a b/c.obj", ".bytes", ".~21", ".zip!\xff~"}) {
    const AssetId id = AssetId::parse(AssetId({kBlob, reading}).text());
    EXPECT_EQ(id.blob, kBlob);
    EXPECT_EQ(id.reading, reading);
  }
}

TEST(AssetId, any_text_is_taken) {
  for (const std::string& text : {std::string(), std::string("x.obj"), kBlob, kBlob + "x"}) {
    EXPECT_EQ(AssetId::parse(text).blob, text);
    EXPECT_EQ(AssetId::parse(text).reading, std::nullopt);
  }
  EXPECT_EQ(AssetId::parse(kBlob + ".").reading, ".");
  EXPECT_EQ(AssetId::parse(kBlob + ".~2").reading, ".~2");
}

TEST(AssetId, a_name_is_told_with_another_extension) {
  EXPECT_EQ(filename_read_as("models/truck.off", ".obj"), "truck.obj");
  EXPECT_EQ(filename_read_as("", ".obj"), "asset.obj");
  EXPECT_EQ(filename_read_as("a.zip!b.obj", ".zip!c.obj"), "a.zip!c.obj");
}

}  // namespace
}  // namespace voxeld
