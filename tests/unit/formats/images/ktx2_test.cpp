// KTX 2.0 textures read by what the specification says, against the arrays of npy.
#include <gtest/gtest.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "tests/unit/formats/images/image_samples.h"

namespace voxeld {
namespace {

using Texels = std::vector<uint8_t>;

template <typename T>
T ktx2_number(const Texels& bytes, size_t at) {
  T value{};
  EXPECT_LE(at + sizeof value, bytes.size());
  if (at + sizeof value <= bytes.size()) std::memcpy(&value, &bytes[at], sizeof value);
  return value;
}

struct Texture {
  uint32_t vk_format = 0, type_size = 0;
  std::array<uint32_t, 3> sides{};
  Texels descriptor, texels;
  std::map<std::string, std::string> values;
  std::vector<std::string> keys;  // in their order
};

// Checks what the specification asks of offsets, lengths and padding.
void read_ktx2_level(const Texels& file, uint32_t values_end, Texture& texture) {
  const auto at = ktx2_number<uint64_t>(file, 80), length = ktx2_number<uint64_t>(file, 88);
  texture.texels.resize(ktx2_number<uint64_t>(file, 96));
  EXPECT_EQ(at, values_end);  // levels of a compressed texture have no padding
  ASSERT_EQ(at + length, file.size());
  EXPECT_EQ(ZSTD_findFrameCompressedSize(&file[at], length), length) << "one frame";
  EXPECT_EQ(ZSTD_getFrameContentSize(&file[at], length), texture.texels.size());
  EXPECT_EQ(ZSTD_decompress(texture.texels.data(), texture.texels.size(), &file[at], length),
            texture.texels.size());
}

void read_ktx2_values(const Texels& file, size_t at, size_t end, Texture& texture) {
  while (at < end) {
    const auto length = ktx2_number<uint32_t>(file, at);
    const std::string pair(file.begin() + static_cast<ptrdiff_t>(at + 4),
                           file.begin() + static_cast<ptrdiff_t>(at + 4 + length));
    const size_t zero = pair.find('\0');
    ASSERT_NE(zero, std::string::npos);
    EXPECT_EQ(pair.back(), '\0');
    texture.keys.push_back(pair.substr(0, zero));
    texture.values[texture.keys.back()] = pair.substr(zero + 1, length - zero - 2);
    at += 4 + length;
    for (; at % 4 != 0; ++at) EXPECT_EQ(file.at(at), 0);
  }
  EXPECT_EQ(at, end);
  EXPECT_TRUE(std::ranges::is_sorted(texture.keys));
}

Texture read_ktx2(const Texels& file) {
  Texture texture;
  EXPECT_EQ(std::memcmp(file.data(), "\xabKTX 20\xbb\r\n\x1a\n", 12), 0);
  texture.vk_format = ktx2_number<uint32_t>(file, 12);
  texture.type_size = ktx2_number<uint32_t>(file, 16);
  for (size_t i = 0; i < 3; ++i) texture.sides[i] = ktx2_number<uint32_t>(file, 20 + 4 * i);
  EXPECT_EQ(ktx2_number<uint32_t>(file, 32), 0U);  // no array
  EXPECT_EQ(ktx2_number<uint32_t>(file, 36), 1U);  // faces
  EXPECT_EQ(ktx2_number<uint32_t>(file, 40), 1U);  // levels
  EXPECT_EQ(ktx2_number<uint32_t>(file, 44), 2U);  // Zstandard
  const auto descriptor = ktx2_number<uint32_t>(file, 48);
  const auto descriptor_bytes = ktx2_number<uint32_t>(file, 52);
  const auto values = ktx2_number<uint32_t>(file, 56), bytes = ktx2_number<uint32_t>(file, 60);
  EXPECT_EQ(descriptor, 80U + 24U);
  EXPECT_EQ(values, descriptor + descriptor_bytes);
  EXPECT_EQ(ktx2_number<uint64_t>(file, 64), 0U);
  EXPECT_EQ(ktx2_number<uint64_t>(file, 72), 0U);
  EXPECT_EQ(ktx2_number<uint32_t>(file, descriptor), descriptor_bytes);
  texture.descriptor.assign(file.begin() + descriptor + 4,
                            file.begin() + descriptor + descriptor_bytes);
  read_ktx2_values(file, values, values + bytes, texture);
  read_ktx2_level(file, values + bytes, texture);
  return texture;
}

Texture texture_of(const Grid& grid, std::optional<Channel> channel) {
  OutputOptions options;
  options.channel = channel;
  options.dtype = DType::kFloat32;  // has no effect
  const auto bytes = test::encode_as(Format::kKtx2, grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return read_ktx2(*bytes);
}

Texels wanted_texels(const Grid& grid, std::optional<Channel> channel) {
  Texels texels = test::world_samples_of(grid, channel);
  if (!channel) {
    for (uint8_t& cell : texels) cell = cell == 1 ? 255 : 0;
  }
  if (channel != Channel::kNormal) return texels;
  Texels with_alpha;
  for (size_t i = 0; i < texels.size(); i += 3) {
    const bool is_empty = texels[i] == 0 && texels[i + 1] == 0 && texels[i + 2] == 0;
    for (size_t c = 0; c < 3; ++c) with_alpha.push_back(texels[i + c]);
    with_alpha.push_back(is_empty ? 0 : 127);
  }
  return with_alpha;
}

TEST(Ktx2, texels_of_each_channel_are_the_samples_of_npy) {
  for (const glm::dvec3 size : {glm::dvec3(0.25), glm::dvec3(0.5, 0.25, 0.125)}) {
    const Grid grid = test::grid_of_every_channel(size);
    for (const std::optional<Channel> channel : test::arrays_of_grid(grid)) {
      const Texture texture = texture_of(grid, channel);
      EXPECT_EQ(texture.sides, (std::array<uint32_t, 3>{70, 40, 33}));
      EXPECT_TRUE(texture.texels == wanted_texels(grid, channel))
          << (channel ? channel_info(*channel).name : "occupancy");
    }
  }
}

struct SampleFields {
  uint16_t bit_offset;
  uint8_t bits_less_one, type;
  uint32_t lower, upper;
};

TEST(Ktx2, descriptors_say_what_a_texel_is) {
  struct Case {
    std::optional<Channel> channel;
    uint32_t vk_format, type_size, texel_bytes;
    uint8_t transfer;
    std::vector<SampleFields> samples;
  };
  const SampleFields grey = {0, 7, 0, 0, 255}, id = {0, 15, 0, 0, 1};
  constexpr uint32_t kMinus127 = 0xffffff81;
  const Grid grid = test::grid_of_every_channel(glm::dvec3(1));
  for (const Case& one : std::vector<Case>{
           {std::nullopt, 9, 1, 1, 1, {grey}},
           {Channel::kCoverage, 9, 1, 1, 1, {grey}},
           {Channel::kColor,
            43,
            1,
            4,
            2,
            {grey, {8, 7, 1, 0, 255}, {16, 7, 2, 0, 255}, {24, 7, 0x1f, 0, 255}}},
           {Channel::kNormal,
            38,
            1,
            4,
            1,
            {{0, 7, 0x40, kMinus127, 127},
             {8, 7, 0x41, kMinus127, 127},
             {16, 7, 0x42, kMinus127, 127},
             {24, 7, 0x4f, kMinus127, 127}}},
           {Channel::kLabel, 74, 2, 2, 1, {id}},
           {Channel::kMaterial, 74, 2, 2, 1, {id}},
           {Channel::kDistance, 100, 4, 4, 1, {{0, 31, 0xc0, 0xbf800000, 0x3f800000}}}}) {
    const Texture texture = texture_of(grid, one.channel);
    EXPECT_EQ(texture.vk_format, one.vk_format);
    EXPECT_EQ(texture.type_size, one.type_size);
    const Texels& block = texture.descriptor;
    EXPECT_EQ(ktx2_number<uint32_t>(block, 0), 0U);  // a basic block of Khronos
    EXPECT_EQ(ktx2_number<uint16_t>(block, 4), 2U);
    EXPECT_EQ(ktx2_number<uint16_t>(block, 6), 24 + 16 * one.samples.size());
    EXPECT_EQ(block.size(), 24 + 16 * one.samples.size());
    const Texels model = {1, 1, one.transfer, 0, 0, 0, 0, 0};
    EXPECT_TRUE(std::equal(model.begin(), model.end(), block.begin() + 8));
    EXPECT_EQ(ktx2_number<uint64_t>(block, 16), one.texel_bytes);
    for (size_t i = 0; i < one.samples.size(); ++i) {
      const size_t at = 24 + 16 * i;
      EXPECT_EQ(ktx2_number<uint16_t>(block, at), one.samples[i].bit_offset);
      EXPECT_EQ(block[at + 2], one.samples[i].bits_less_one);
      EXPECT_EQ(block[at + 3], one.samples[i].type);
      EXPECT_EQ(ktx2_number<uint32_t>(block, at + 4), 0U);
      EXPECT_EQ(ktx2_number<uint32_t>(block, at + 8), one.samples[i].lower);
      EXPECT_EQ(ktx2_number<uint32_t>(block, at + 12), one.samples[i].upper);
    }
  }
}

TEST(Ktx2, keys_have_the_place_the_units_and_meta) {
  Grid grid = test::grid_of_every_channel({0.5, 0.25, 0.125});
  EXPECT_EQ(texture_of(grid, Channel::kLabel).values,
            (std::map<std::string, std::string>{{"KTXorientation", "ruo"},
                                                {"KTXwriter", "voxeld"},
                                                {"voxeld.channel", "label"},
                                                {"voxeld.meta", grid.meta.text()},
                                                {"voxeld.origin", "-1.5 0.25 1e+10"},
                                                {"voxeld.units", "mm"},
                                                {"voxeld.voxel_size", "0.5 0.25 0.125"}}));
  grid.meta = GridMeta();
  const Texture texture = texture_of(grid, std::nullopt);
  EXPECT_EQ(texture.values.count("voxeld.units"), 0U);
  EXPECT_EQ(texture.values.at("voxeld.meta"), "{}");
  EXPECT_EQ(texture.values.at("voxeld.channel"), "occupancy");
}

TEST(Ktx2, an_empty_grid_is_zeros) {
  const Grid grid = test::grid_of({3, 4, 5}, {}, true, false);
  EXPECT_EQ(texture_of(grid, Channel::kColor).texels, Texels(3 * 4 * 5 * 4));
  EXPECT_EQ(texture_of(grid, std::nullopt).texels, Texels(3 * 4 * 5));
}

TEST(Ktx2, many_pieces_are_one_frame_and_equal_grids_give_equal_bytes) {
  // 11 MB of colour.
  const Grid grid = test::random_grid(5, {300, 90, 105}, 50000, true, false);
  EXPECT_TRUE(texture_of(grid, Channel::kColor).texels == wanted_texels(grid, Channel::kColor));
  OutputOptions options;
  options.channel = Channel::kColor;
  EXPECT_TRUE(*test::encode_as(Format::kKtx2, grid, options) ==
              *test::encode_as(Format::kKtx2, grid, options));
}

}  // namespace
}  // namespace voxeld
