// PNG slices and atlases read by what the specifications say, against the arrays of npy.
#include "server/formats/images/slices.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/formats/formats.h"
#include "tests/unit/formats/images/image_samples.h"
#include "tests/unit/formats/zip/zip_members.h"

namespace voxeld {
namespace {

using PngBytes = std::vector<uint8_t>;

struct Image {
  uint32_t width = 0, height = 0;
  size_t pixel_bytes = 0;
  int bits = 0, color = 0;
  PngBytes pixels;
  std::vector<std::string> chunks;  // their types, one after another only once
  std::array<uint32_t, 2> per_metre{};
};

uint32_t png_u32(std::span<const uint8_t> bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | bytes[at + i];
  return value;
}

PngBytes inflated_rows(const PngBytes& stream, size_t bytes) {
  PngBytes out(bytes + 1);
  uLongf length = out.size();
  EXPECT_EQ(uncompress(out.data(), &length, stream.data(), stream.size()), Z_OK);
  EXPECT_EQ(length, bytes);
  out.resize(bytes);
  return out;
}

// Undoes the filters 0 (none) and 2 (up), which are all that voxeld writes.
PngBytes unfiltered(const PngBytes& rows, size_t row_bytes) {
  PngBytes pixels;
  for (size_t at = 0; at < rows.size(); at += row_bytes + 1) {
    const size_t above = pixels.size() - row_bytes;
    EXPECT_TRUE(rows[at] == 0 || (rows[at] == 2 && !pixels.empty()));
    for (size_t i = 0; i < row_bytes; ++i) {
      const uint8_t base = rows[at] == 2 ? pixels[above + i] : uint8_t{0};
      pixels.push_back(static_cast<uint8_t>(rows[at + 1 + i] + base));
    }
  }
  return pixels;
}

void read_png_header(std::span<const uint8_t> data, Image& image) {
  image.width = png_u32(data, 0);
  image.height = png_u32(data, 4);
  image.bits = data[8];
  image.color = data[9];
  EXPECT_EQ(data[10] + data[11] + data[12], 0);
  const size_t samples = image.color == 6 ? 4 : image.color == 2 ? 3 : 1;
  image.pixel_bytes = samples * static_cast<size_t>(image.bits) / 8;
}

Image read_png(const PngBytes& file) {
  Image image;
  PngBytes stream;
  EXPECT_EQ(std::memcmp(file.data(), "\x89PNG\r\n\x1a\n", 8), 0);
  for (size_t at = 8; at + 12 <= file.size();) {
    const size_t length = png_u32(file, at);
    const std::string type(file.begin() + static_cast<ptrdiff_t>(at + 4),
                           file.begin() + static_cast<ptrdiff_t>(at + 8));
    const auto data = std::span(file).subspan(at + 8, length);
    EXPECT_EQ(png_u32(file, at + 8 + length),
              crc32(0, file.data() + at + 4, static_cast<uInt>(length + 4)))
        << type;
    if (type == "IHDR") read_png_header(data, image);
    if (type == "IDAT") stream.insert(stream.end(), data.begin(), data.end());
    if (type == "pHYs") {
      image.per_metre = {png_u32(data, 0), png_u32(data, 4)};
      EXPECT_EQ(data[8], 1);
    }
    if (image.chunks.empty() || image.chunks.back() != type) image.chunks.push_back(type);
    at += 12 + length;
    EXPECT_EQ(type == "IEND", at == file.size());
  }
  const size_t row_bytes = image.width * image.pixel_bytes;
  image.pixels = unfiltered(inflated_rows(stream, image.height * (row_bytes + 1)), row_bytes);
  return image;
}

test::ZipMembers slice_members(const Grid& grid, std::optional<Channel> channel,
                               ArrayLayout layout = ArrayLayout::kDense) {
  OutputOptions options;
  options.channel = channel;
  options.layout = layout;
  options.dtype = DType::kFloat32;  // has no effect
  const auto bytes = test::encode_as(Format::kSlices, grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return test::ZipMembers(*bytes);
}

// The pixels that the samples of npy become, by floating point.
PngBytes wanted_pixels(const Grid& grid, std::optional<Channel> channel) {
  const PngBytes samples = test::npy_samples_of(grid, channel);
  PngBytes pixels;
  const auto put_16 = [&](long value) {
    pixels.push_back(static_cast<uint8_t>(value / 256));
    pixels.push_back(static_cast<uint8_t>(value % 256));
  };
  if (channel == Channel::kDistance) {
    for (size_t at = 0; at < samples.size(); at += 4) {
      float voxels = 0;
      std::memcpy(&voxels, &samples[at], 4);
      put_16(std::clamp(std::lround(voxels * 128 + 32768), 0L, 65535L));
    }
  } else if (channel == Channel::kLabel || channel == Channel::kMaterial) {
    for (size_t at = 0; at < samples.size(); at += 2) put_16(samples[at] + 256L * samples[at + 1]);
  } else if (channel == Channel::kNormal) {
    for (size_t at = 0; at < samples.size(); at += 3) {
      const bool is_empty = samples[at] == 0 && samples[at + 1] == 0 && samples[at + 2] == 0;
      for (size_t c = 0; c < 3; ++c) {
        const double n = static_cast<int8_t>(samples[at + c]) / 127.0;
        const double pixel = std::clamp(std::floor((n + 1) * 127.5 + 0.5 + 1e-9), 0.0, 255.0);
        pixels.push_back(is_empty ? uint8_t{0} : static_cast<uint8_t>(pixel));
      }
    }
  } else {
    for (const uint8_t sample : samples) {
      pixels.push_back(channel ? sample : static_cast<uint8_t>(255 * sample));
    }
  }
  return pixels;
}

std::string dense_slice_name(size_t z) {
  std::string digits = std::to_string(z);
  return "slice-" + std::string(4 - digits.size(), '0') + digits + ".png";
}

void check_slices(const Grid& grid, std::optional<Channel> channel, const std::string& chunks) {
  const test::ZipMembers members = slice_members(grid, channel);
  const auto slices = static_cast<size_t>(grid.spec.dims.z);
  ASSERT_EQ(members.all().size(), slices + 1);
  PngBytes pixels;
  for (size_t z = 0; z < slices; ++z) {
    const test::ZipMember& member = members.all()[z + 1];
    EXPECT_EQ(member.name, dense_slice_name(z));
    EXPECT_TRUE(member.is_stored);
    const Image image = read_png(member.bytes);
    EXPECT_EQ(image.width, static_cast<uint32_t>(grid.spec.dims.x));
    EXPECT_EQ(image.height, static_cast<uint32_t>(grid.spec.dims.y));
    std::string joined;
    for (const std::string& type : image.chunks) joined += type + " ";
    EXPECT_EQ(joined, chunks);
    pixels.insert(pixels.end(), image.pixels.begin(), image.pixels.end());
  }
  EXPECT_TRUE(pixels == wanted_pixels(grid, channel))
      << (channel ? channel_info(*channel).name : "occupancy");
}

TEST(Slices, images_of_each_channel_have_the_samples_of_npy) {
  for (const glm::dvec3 size : {glm::dvec3(0.25), glm::dvec3(0.5, 0.25, 0.125)}) {
    const Grid grid = test::grid_of_every_channel(size);
    for (const std::optional<Channel> channel : test::arrays_of_grid(grid)) {
      check_slices(
          grid, channel,
          channel == Channel::kColor ? "IHDR sRGB pHYs IDAT IEND " : "IHDR pHYs IDAT IEND ");
    }
  }
}

TEST(Slices, a_slice_of_many_pieces_is_one_image) {
  Grid grid = test::random_grid(5, {700, 500, 5}, 9000, true, false);  // 1.4 MB a slice
  grid.meta = GridMeta();
  check_slices(grid, Channel::kColor, "IHDR sRGB IDAT IEND ");
  check_slices(grid, std::nullopt, "IHDR IDAT IEND ");
}

TEST(Slices, a_band_is_smooth_beyond_its_voxels) {
  Grid grid =
      test::grid_of({40, 30, 20}, {{.cell = {3, 4, 5}, .distance = -64}}, {.distance = true});
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  check_slices(grid, Channel::kDistance, "IHDR IDAT IEND ");
}

TEST(Slices, a_cell_beside_a_band_that_does_not_tell_its_side_is_0) {
  Grid grid = test::grid_of({4, 3, 1}, {{.cell = {1, 2, 0}, .distance = -64}}, {.distance = true});
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band","thickness":3}})").with_band_voxels(0.5);
  const Image image = read_png(slice_members(grid, Channel::kDistance).at("slice-0000.png"));
  PngBytes expected(size_t{2} * 4 * 3);
  expected[18] = 0x7f;  // 32768 - 64
  expected[19] = 0xc0;
  EXPECT_EQ(image.pixels, expected);
}

TEST(Slices, an_empty_grid_has_empty_images) {
  const Grid grid = test::grid_of({3, 4, 5}, {}, true, false);
  check_slices(grid, Channel::kColor, "IHDR sRGB pHYs IDAT IEND ");
}

TEST(Slices, pixels_per_metre_follow_units_and_voxel_size) {
  const auto per_metre = [](const char* meta, const glm::dvec3& size) {
    Grid grid = test::grid_of({3, 4, 1}, {}, false, false);
    grid.meta = GridMeta::parse(meta);
    grid.spec.voxel_size = size;
    return read_png(slice_members(grid, std::nullopt).at("slice-0000.png")).per_metre;
  };
  using Pixels = std::array<uint32_t, 2>;
  EXPECT_EQ(per_metre(R"({"units":"mm"})", {0.5, 0.25, 1}), (Pixels{2000, 4000}));
  EXPECT_EQ(per_metre(R"({"units":"in"})", {1, 1, 1}), (Pixels{39, 39}));
  EXPECT_EQ(per_metre(R"({"units":"m"})", {3, 3, 3}), (Pixels{0, 0}));
  EXPECT_EQ(per_metre(R"({"units":"m"})", {1e-12, 1, 1}), (Pixels{0, 0}));
  EXPECT_EQ(per_metre("{}", {1, 1, 1}), (Pixels{0, 0}));
}

TEST(Slices, json_places_the_images) {
  const Grid grid = test::grid_of_every_channel({0.5, 0.25, 0.125});
  const auto facts =
      nlohmann::json::parse(slice_members(grid, Channel::kDistance).text("slices.json"));
  EXPECT_EQ(facts, nlohmann::json::parse(R"({
      "format": "voxeld slices", "version": 1, "dims": [70, 40, 33],
      "origin": [-1.5, 0.25, 1e10], "voxel_size": [0.5, 0.25, 0.125], "units": "mm",
      "transform": [[0.5, 0, 0, -1.25], [0, 0.25, 0, 0.375], [0, 0, 0.125, 10000000000.0625],
                    [0, 0, 0, 1]],
      "axes": {"column": "x", "row": "y", "slice": "z"}, "channel": "distance",
      "sample_bits": 16, "scale": 0.0078125, "offset": -256.0, "distance_unit": "voxel",
      "meta": {"units": "mm", "labels": [{"id": 1, "name": "a \"roof\""}]}})"));
  const auto scale = [](std::optional<Channel> channel) {
    const Grid cubic = test::grid_of_every_channel(glm::dvec3(0.5));
    const auto json = nlohmann::json::parse(slice_members(cubic, channel).text("slices.json"));
    return std::pair(json.value("scale", 0.0), json.value("offset", 0.0));
  };
  EXPECT_EQ(scale(std::nullopt), std::pair(1 / 255.0, 0.0));
  EXPECT_EQ(scale(Channel::kCoverage), std::pair(1 / 255.0, 0.0));
  EXPECT_EQ(scale(Channel::kNormal), std::pair(2 / 255.0, -1.0));
  EXPECT_EQ(scale(Channel::kLabel), std::pair(1.0, 0.0));
  EXPECT_EQ(scale(Channel::kDistance), std::pair(0.5 / 128, -128.0));
  EXPECT_EQ(scale(Channel::kColor), std::pair(0.0, 0.0));
}

TEST(Slices, above_ten_thousand_names_have_five_digits) {
  const test::ZipMembers members = slice_members(test::grid_of({1, 1, 10001}, {}, {}), {});
  EXPECT_EQ(members.all()[1].name, "slice-00000.png");
  EXPECT_EQ(members.all()[10001].name, "slice-10000.png");
}

void check_atlas_image(const Grid& grid, std::optional<Channel> channel, int columns, int rows) {
  const test::ZipMembers members = slice_members(grid, channel, ArrayLayout::kAtlas);
  ASSERT_EQ(members.all().size(), 2U);
  const auto facts = nlohmann::json::parse(members.text("slices.json"));
  EXPECT_EQ(facts["columns"], columns);
  EXPECT_EQ(facts["rows"], rows);
  const Image image = read_png(members.at("atlas.png"));
  const glm::ivec3 dims = grid.spec.dims;
  EXPECT_EQ(image.width, static_cast<uint32_t>(columns * dims.x));
  EXPECT_EQ(image.height, static_cast<uint32_t>(rows * dims.y));
  const PngBytes slices = wanted_pixels(grid, channel);
  PngBytes wanted(image.pixels.size());
  const size_t row = static_cast<size_t>(dims.x) * image.pixel_bytes;
  for (int z = 0; z < dims.z; ++z) {
    for (int y = 0; y < dims.y; ++y) {
      const auto to = static_cast<size_t>((z / columns * dims.y + y) * columns + z % columns) * row;
      const auto from = static_cast<size_t>(z * dims.y + y) * row;
      std::copy_n(&slices[from], row, &wanted[to]);
    }
  }
  EXPECT_TRUE(image.pixels == wanted);
}

TEST(Slices, an_atlas_has_the_slices_left_to_right_and_top_to_bottom) {
  const Grid grid = test::grid_of_every_channel(glm::dvec3(1));
  for (const std::optional<Channel> channel : test::arrays_of_grid(grid)) {
    check_atlas_image(grid, channel, 5, 7);
  }
  check_atlas_image(test::random_grid(5, {700, 500, 5}, 9000, true, false), Channel::kColor, 2, 3);
  check_atlas_image(test::random_grid(6, {9, 300, 1}, 90, false, false), std::nullopt, 1, 1);
}

TEST(Slices, an_atlas_is_as_square_as_it_can_be) {
  const auto layout = [](const glm::ivec3& dims) {
    GridSpec spec;
    spec.dims = dims;
    const images::AtlasLayout made = images::atlas_layout(spec);
    return std::array<int64_t, 4>{made.columns, made.rows, made.width, made.height};
  };
  using Layout = std::array<int64_t, 4>;
  EXPECT_EQ(layout({64, 64, 64}), (Layout{8, 8, 512, 512}));
  EXPECT_EQ(layout({1024, 1015, 794}), (Layout{28, 29, 28672, 29435}));
  EXPECT_EQ(layout({1, 16384, 3}), (Layout{3, 1, 3, 16384}));
  EXPECT_EQ(layout({10, 10, 1}), (Layout{1, 1, 10, 10}));
}

TEST(Slices, an_atlas_of_too_many_pixels_a_side_is_refused) {
  GridSpec spec;
  spec.dims = {16384, 16384, 1};
  EXPECT_TRUE(images::check_atlas(spec));
  spec.dims = {16384, 16384, 2};
  const Status status = images::check_atlas(spec);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(status.error().message(),
            "slices: the atlas is too large (layout=dense writes an image for each slice): "
            "expected sides of at most 32767 pixels, got 16384 x 32768");
}

TEST(Slices, equal_grids_give_equal_bytes) {
  const Grid grid = test::random_grid(5, {300, 90, 53}, 5000, true, false);
  for (const ArrayLayout layout : {ArrayLayout::kDense, ArrayLayout::kAtlas}) {
    OutputOptions options;
    options.channel = Channel::kColor;
    options.layout = layout;
    EXPECT_TRUE(*test::encode_as(Format::kSlices, grid, options) ==
                *test::encode_as(Format::kSlices, grid, options));
  }
}

}  // namespace
}  // namespace voxeld
