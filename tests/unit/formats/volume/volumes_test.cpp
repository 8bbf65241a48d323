// Volumes against the arrays of npy, read by what their specifications say, and pinned headers.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "proto/limits.h"
#include "server/formats/formats.h"
#include "server/formats/volume/vtk_blocks.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using test::to;
using Bytes = std::vector<uint8_t>;

constexpr int kGzipWindow = 15 + 16, kZlibWindow = 15;

Bytes encoded(const Grid& grid, const OutputOptions& options) {
  auto bytes = encode(grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  return bytes ? *std::move(bytes) : Bytes();
}

// The contents of exactly one stream; zlib checks its sum.
Bytes inflated_stream(std::span<const uint8_t> stream, int window) {
  z_stream z{};
  EXPECT_EQ(inflateInit2(&z, window), Z_OK);
  z.next_in = const_cast<uint8_t*>(stream.data());
  z.avail_in = static_cast<uInt>(stream.size());
  Bytes out;
  int code = Z_OK;
  while (code == Z_OK) {
    const size_t used = out.size();
    out.resize(used + (size_t{1} << 16));
    z.next_out = out.data() + used;
    z.avail_out = static_cast<uInt>(out.size() - used);
    code = inflate(&z, Z_NO_FLUSH);
    out.resize(out.size() - z.avail_out);
  }
  EXPECT_EQ(code, Z_STREAM_END) << (z.msg != nullptr ? z.msg : "");
  EXPECT_EQ(z.avail_in, 0U);
  inflateEnd(&z);
  return out;
}

std::string text_until(const Bytes& bytes, std::string_view end) {
  const auto found = std::search(bytes.begin(), bytes.end(), end.begin(), end.end());
  EXPECT_NE(found, bytes.end()) << end;
  return {bytes.begin(), found + (found == bytes.end() ? 0 : static_cast<ptrdiff_t>(end.size()))};
}

std::span<const uint8_t> after(const Bytes& bytes, const std::string& text) {
  return std::span(bytes).subspan(std::min(bytes.size(), text.size()));
}

template <typename T>
T number_at(std::span<const uint8_t> bytes, size_t at) {
  T value{};
  EXPECT_LE(at + sizeof value, bytes.size());
  if (at + sizeof value <= bytes.size()) std::memcpy(&value, &bytes[at], sizeof value);
  return value;
}

// The samples of npy, whose distances become world units.
Bytes samples(const Grid& grid, std::optional<Channel> channel, OutputOptions options,
              AxisOrder axes = AxisOrder::kZyx) {
  options.axes = axes;
  Bytes bytes = test::read_npy(test::npy_of(grid, channel, options)).data;
  const glm::dvec3 size = grid.spec.voxel_size;
  if (channel != Channel::kDistance || size.x != size.y || size.x != size.z) return bytes;
  for (size_t at = 0; at < bytes.size(); at += 4) {
    const auto value = static_cast<float>(number_at<float>(bytes, at) * size.x);
    std::memcpy(&bytes[at], &value, sizeof value);
  }
  return bytes;
}

Grid every_channel(const glm::dvec3& voxel_size) {
  std::mt19937 random(11);
  ChannelSet channels = channels_of_bits(~uint32_t{0});
  Grid grid = test::grid_of({70, 40, 33}, test::random_voxels(random, {56, 40, 33}, 900), channels);
  for_each_channel(grid.tiles[0], [&](Channel, auto& values) {
    for (auto& value : values) value = static_cast<std::decay_t<decltype(value)>>(random());
  });
  grid.tiles[0].full = {{morton_encode(7, 1, 1), 0}};
  grid.spec.voxel_size = voxel_size;
  grid.spec.origin_world = {-1.5, 0.25, 3};
  grid.meta = GridMeta::parse(
      R"({"units":"mm","labels":[{"id":1,"name":"a \"roof\""},{"id":3,"name":"c"}]})");
  return grid;
}

std::vector<std::optional<Channel>> arrays_of(const Grid& grid) {
  std::vector<std::optional<Channel>> arrays = {std::nullopt};
  for (const ChannelInfo& info : kChannels) {
    if (grid.channels.has(info.channel)) arrays.emplace_back(info.channel);
  }
  return arrays;
}

constexpr Format kOneArray[] = {Format::kNrrd, Format::kMha, Format::kNii};

// The samples of a file of one array.
Bytes read_one_array(Format format, const Bytes& bytes) {
  if (format == Format::kNrrd) {
    return inflated_stream(after(bytes, text_until(bytes, "\n\n")), kGzipWindow);
  }
  if (format == Format::kMha) {
    return inflated_stream(after(bytes, text_until(bytes, "ElementDataFile = LOCAL\n")),
                           kZlibWindow);
  }
  Bytes all = inflated_stream(bytes, kGzipWindow);
  all.erase(all.begin(), all.begin() + static_cast<ptrdiff_t>(number_at<float>(all, 108)));
  return all;
}

TEST(Volumes, files_of_one_array_have_the_samples_of_npy) {
  for (const glm::dvec3 size : {glm::dvec3(0.25), glm::dvec3(0.5, 0.25, 0.125)}) {
    const Grid grid = every_channel(size);
    for (const Format format : kOneArray) {
      for (const DType dtype : {DType::kUint8, DType::kBool, DType::kFloat32}) {
        for (const std::optional<Channel> channel : arrays_of(grid)) {
          OutputOptions options = to(format);
          options.dtype = dtype;
          options.channel = channel;
          const bool is_rgba = channel == Channel::kColor && dtype != DType::kFloat32;
          const AxisOrder axes =
              format == Format::kNii && !is_rgba ? AxisOrder::kXyz : AxisOrder::kZyx;
          EXPECT_TRUE(read_one_array(format, encoded(grid, options)) ==
                      samples(grid, channel, options, axes))
              << format_name(format) << (channel ? channel_info(*channel).name : "");
        }
      }
    }
  }
}

TEST(Volumes, a_band_is_a_signed_distance_in_world_units) {
  Grid grid = every_channel(glm::dvec3(2));
  grid.meta = GridMeta::parse(R"({"options":{"fill":"band"}})");
  for (const Format format : kOneArray) {
    OutputOptions options = to(format);
    options.channel = Channel::kDistance;
    const Bytes bytes = read_one_array(format, encoded(grid, options));
    EXPECT_TRUE(bytes == samples(grid, Channel::kDistance, options)) << format_name(format);
    EXPECT_GT(number_at<float>(bytes, 0), 0);
  }
}

TEST(Volumes, distances_in_world_units_are_those_of_npy_whatever_the_voxels) {
  for (const glm::dvec3& size : {glm::dvec3(2), glm::dvec3(0.5, 0.25, 0.125)}) {
    Grid grid = every_channel(size);
    grid.meta = GridMeta::parse(R"({"options":{"distance":"world"}})");
    for (const Format format : kOneArray) {
      OutputOptions options = to(format);
      options.channel = Channel::kDistance;
      const Bytes bytes = read_one_array(format, encoded(grid, options));
      options.axes = AxisOrder::kZyx;
      EXPECT_TRUE(bytes == test::read_npy(test::npy_of(grid, Channel::kDistance, options)).data)
          << format_name(format);
    }
  }
}

TEST(Volumes, a_channel_that_the_grid_lacks_is_refused_with_those_it_has) {
  const Grid grid = test::random_grid(1, {9, 8, 7}, 20, true, true);
  for (const Format format : kOneArray) {
    OutputOptions options = to(format);
    options.channel = Channel::kLabel;
    const auto refused = encode(grid, options);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidOption);
    EXPECT_EQ(refused.error().message(),
              "channel: expected occupancy | color | normal, which the grid has, got \"label\"");
    EXPECT_FALSE(check_channels(grid.channels, options));
    options.channel = Channel::kNormal;
    EXPECT_TRUE(check_channels(grid.channels, options));
  }
}

TEST(Nrrd, headers_of_samples_and_of_vectors) {
  Grid grid = every_channel({0.5, 0.25, 0.125});
  EXPECT_EQ(text_until(encoded(grid, to(Format::kNrrd)), "\n\n"),
            "NRRD0004\n# voxeld\ntype: uint8\ndimension: 3\nspace: 3D-right-handed\n"
            "sizes: 70 40 33\nspace directions: (0.5,0,0) (0,0.25,0) (0,0,0.125)\n"
            "centers: cell cell cell\nkinds: domain domain domain\nencoding: gzip\n"
            "space units: \"mm\" \"mm\" \"mm\"\nspace origin: (-1.25,0.375,3.0625)\n"
            "content: occupancy\nunits:=mm\n"
            R"(meta:={"labels":[{"id":1,"name":"a \\"roof\\""},{"id":3,"name":"c"}],"units":"mm"})"
            "\n\n");
  grid.meta = GridMeta();
  OutputOptions options = to(Format::kNrrd);
  options.channel = Channel::kNormal;
  options.dtype = DType::kFloat32;
  EXPECT_EQ(text_until(encoded(grid, options), "\n\n"),
            "NRRD0004\n# voxeld\ntype: float\ndimension: 4\nspace: 3D-right-handed\n"
            "sizes: 3 70 40 33\nspace directions: none (0.5,0,0) (0,0.25,0) (0,0,0.125)\n"
            "centers: ??? cell cell cell\nkinds: 3-normal domain domain domain\nendian: little\n"
            "encoding: gzip\nspace origin: (-1.25,0.375,3.0625)\ncontent: normal\nmeta:={}\n\n");
}

TEST(Mha, header_has_the_length_of_the_data) {
  OutputOptions options = to(Format::kMha);
  options.channel = Channel::kColor;
  const Bytes bytes = encoded(every_channel({0.5, 0.25, 0.125}), options);
  const std::string text = text_until(bytes, "ElementDataFile = LOCAL\n");
  std::string size = std::to_string(bytes.size() - text.size());
  size.resize(20, ' ');
  EXPECT_EQ(text,
            "ObjectType = Image\nNDims = 3\nComment = voxeld color in mm\nBinaryData = True\n"
            "BinaryDataByteOrderMSB = False\nCompressedData = True\nCompressedDataSize = " +
                size +
                "\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -1.25 0.375 3.0625\n"
                "CenterOfRotation = 0 0 0\nDistanceUnits = mm\nElementSpacing = 0.5 0.25 0.125\n"
                "DimSize = 70 40 33\nElementNumberOfChannels = 4\nElementType = MET_UCHAR\n"
                "ElementDataFile = LOCAL\n");
}

TEST(Nifti, header_has_its_fields_at_their_bytes) {
  const Grid grid = every_channel({0.5, 0.25, 0.125});
  struct Case {
    std::optional<Channel> channel;
    DType dtype;
    int16_t axes, vector, intent, type, bits;
    float slope;
  };
  for (const Case& one : {Case{std::nullopt, DType::kUint8, 3, 1, 0, 2, 8, 0},
                          Case{Channel::kColor, DType::kUint8, 3, 1, 0, 2304, 32, 0},
                          Case{Channel::kColor, DType::kFloat32, 5, 4, 2004, 16, 32, 0},
                          Case{Channel::kNormal, DType::kUint8, 5, 3, 1007, 256, 8, 1.0F / 127},
                          Case{Channel::kLabel, DType::kUint8, 3, 1, 1002, 512, 16, 0},
                          Case{Channel::kCoverage, DType::kUint8, 3, 1, 0, 2, 8, 1.0F / 255},
                          Case{Channel::kDistance, DType::kUint8, 3, 1, 0, 16, 32, 0}}) {
    OutputOptions options = to(Format::kNii);
    options.channel = one.channel;
    options.dtype = one.dtype;
    const Bytes file = inflated_stream(encoded(grid, options), kGzipWindow);
    EXPECT_EQ(number_at<int32_t>(file, 0), 348);
    const int16_t dim[] = {one.axes, 70, 40, 33, 1, one.vector, 1, 1};
    for (size_t i = 0; i < 8; ++i) EXPECT_EQ(number_at<int16_t>(file, 40 + 2 * i), dim[i]) << i;
    EXPECT_EQ(number_at<int16_t>(file, 68), one.intent);
    EXPECT_EQ(number_at<int16_t>(file, 70), one.type);
    EXPECT_EQ(number_at<int16_t>(file, 72), one.bits);
    EXPECT_EQ(number_at<float>(file, 112), one.slope);
    const float pixdim[] = {1, 0.5, 0.25, 0.125};
    for (size_t i = 0; i < 4; ++i) EXPECT_EQ(number_at<float>(file, 76 + 4 * i), pixdim[i]);
    const float rows[] = {0.5, 0, 0, -1.25, 0, 0.25, 0, 0.375, 0, 0, 0.125, 3.0625};
    for (size_t i = 0; i < 12; ++i) EXPECT_EQ(number_at<float>(file, 280 + 4 * i), rows[i]) << i;
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(number_at<float>(file, 268 + 4 * i), rows[4 * i + 3]);
    }
    EXPECT_EQ(number_at<int16_t>(file, 252), 2);
    EXPECT_EQ(number_at<int16_t>(file, 254), 2);
    EXPECT_EQ(file[123], 2);  // mm
    EXPECT_EQ(std::memcmp(&file[344], "n+1\0\1\0\0\0", 8), 0);
    const std::string meta = grid.meta.text();
    EXPECT_EQ(number_at<int32_t>(file, 352) % 16, 0);
    EXPECT_EQ(number_at<int32_t>(file, 356), 6);
    EXPECT_EQ(std::string(file.begin() + 360, file.begin() + 360 + ptrdiff_t(meta.size())), meta);
    EXPECT_EQ(number_at<float>(file, 108), static_cast<float>(352 + number_at<int32_t>(file, 352)));
  }
}

// An array of a .vti from its place in the appended data.
Bytes vti_array(const Bytes& bytes, const std::string& text, const std::string& name) {
  const size_t at = text.find("Name=\"" + name + "\"");
  EXPECT_NE(at, std::string::npos) << name;
  const size_t digits = text.find("offset=\"", at) + 8;
  const auto data = after(bytes, text).subspan(std::stoull(text.substr(digits, 20)));
  const auto blocks = number_at<uint64_t>(data, 0), block = number_at<uint64_t>(data, 8);
  const auto last = number_at<uint64_t>(data, 16);
  Bytes out;
  size_t begin = 8 * (3 + blocks);
  for (size_t i = 0; i < blocks; ++i) {
    const auto length = number_at<uint64_t>(data, 8 * (3 + i));
    const Bytes raw = inflated_stream(data.subspan(begin, length), kZlibWindow);
    EXPECT_EQ(raw.size(), i + 1 == blocks && last > 0 ? last : block);
    out.insert(out.end(), raw.begin(), raw.end());
    begin += length;
  }
  return out;
}

TEST(Vti, has_each_array_in_blocks) {
  for (const DType dtype : {DType::kUint8, DType::kFloat32}) {
    const Grid grid = every_channel({0.5, 0.25, 0.125});
    OutputOptions options = to(Format::kVti);
    options.dtype = dtype;
    const Bytes bytes = encoded(grid, options);
    const std::string text = text_until(bytes, "<AppendedData encoding=\"raw\">\n_");
    for (const std::optional<Channel> channel : arrays_of(grid)) {
      const std::string name(channel ? channel_info(*channel).name : "occupancy");
      EXPECT_TRUE(vti_array(bytes, text, name) == samples(grid, channel, options)) << name;
    }
    const auto field = [&](const char* name) {
      const Bytes raw = vti_array(bytes, text, name);
      return std::string(raw.begin(), raw.end());
    };
    EXPECT_EQ(field("units"), std::string("mm\0", 3));
    EXPECT_EQ(field("up"), std::string("y\0", 2));
    EXPECT_EQ(field("labels"), std::string("\0a \"roof\"\0\0c\0", 13));
    EXPECT_EQ(field("meta"), grid.meta.text() + '\0');
  }
}

TEST(Vti, a_name_ends_at_a_zero_byte_so_that_those_after_it_keep_their_ids) {
  Grid grid = every_channel({1, 1, 1});
  grid.meta = GridMeta::parse(R"({"labels":[{"id":1,"name":"a\u0000b"},{"id":2,"name":"c"}]})");
  const Bytes bytes = encoded(grid, to(Format::kVti));
  const std::string text = text_until(bytes, "<AppendedData encoding=\"raw\">\n_");
  const Bytes labels = vti_array(bytes, text, "labels");
  EXPECT_EQ(std::string(labels.begin(), labels.end()), std::string("\0a\0c\0", 5));
}

TEST(Vti, blocks_are_whole_but_for_the_last_of_an_array_of_many_pieces) {
  // Rows of bricks do not divide a block, and 5 MB of colour are several batches of neither.
  Grid grid = test::random_grid(5, {300, 90, 53}, 5000, true, false);
  const Bytes bytes = encoded(grid, to(Format::kVti));
  const std::string text = text_until(bytes, "<AppendedData encoding=\"raw\">\n_");
  EXPECT_TRUE(vti_array(bytes, text, "color") == samples(grid, Channel::kColor, {}));
  EXPECT_TRUE(vti_array(bytes, text, "occupancy") == samples(grid, std::nullopt, {}));
  EXPECT_GT(samples(grid, Channel::kColor, {}).size(), 5 * volume::kVtkBlockBytes);
}

TEST(Vti, text_has_dims_corner_and_size) {
  Grid grid = every_channel({0.5, 0.25, 0.125});
  grid.channels = {.normal = true};
  grid.meta = GridMeta();
  const std::string text = text_until(encoded(grid, to(Format::kVti)), "\">\n_");
  const std::string place = " format=\"appended\" offset=\"";
  std::string shown;
  for (size_t at = 0; at < text.size();) {  // without offsets
    const size_t found = std::min(text.find(place, at), text.size());
    shown += text.substr(at, found - at);
    at = found == text.size() ? found : text.find("/>", found);
  }
  EXPECT_EQ(shown,
            "<?xml version=\"1.0\"?>\n"
            "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\""
            " header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n"
            "  <ImageData WholeExtent=\"0 70 0 40 0 33\" Origin=\"-1.5 0.25 3\""
            " Spacing=\"0.5 0.25 0.125\">\n    <FieldData>\n"
            "      <Array type=\"String\" Name=\"up\" NumberOfTuples=\"1\"/>\n"
            "      <Array type=\"String\" Name=\"meta\" NumberOfTuples=\"1\"/>\n"
            "    </FieldData>\n    <Piece Extent=\"0 70 0 40 0 33\">\n      <PointData/>\n"
            "      <CellData Scalars=\"occupancy\">\n"
            "        <DataArray type=\"UInt8\" Name=\"occupancy\" NumberOfComponents=\"1\"/>\n"
            "        <DataArray type=\"Int8\" Name=\"normal\" NumberOfComponents=\"3\"/>\n"
            "      </CellData>\n    </Piece>\n  </ImageData>\n"
            "  <AppendedData encoding=\"raw\">\n_");
}

// Occupied cells of a .binvox, z slowest, of the whole cube.
Bytes binvox_cells(const Bytes& bytes, int side) {
  const std::string text = text_until(bytes, "data\n");
  const auto runs = after(bytes, text);
  Bytes in_order;
  for (size_t i = 0; i + 1 < runs.size(); i += 2) {
    EXPECT_GT(runs[i + 1], 0);
    in_order.insert(in_order.end(), runs[i + 1], runs[i]);
  }
  const auto n = static_cast<size_t>(side);
  EXPECT_EQ(in_order.size(), n * n * n);
  Bytes cells(n * n * n);
  for (size_t i = 0; i < std::min(in_order.size(), cells.size()); ++i) {
    const size_t x = i / (n * n), z = i / n % n, y = i % n;
    cells[(z * n + y) * n + x] = in_order[i];
  }
  return cells;
}

TEST(Binvox, has_the_occupied_cells_in_a_cube) {
  for (const std::array<int, 3>& dims : {std::array{70, 40, 33}, std::array{5, 300, 9},
                                         std::array{9, 5, 270}, std::array{1, 1, 1}}) {
    std::mt19937 random(3);
    const int count = std::min(700, dims[0] * dims[1] * dims[2]);
    Grid grid = test::grid_of(dims, test::random_voxels(random, dims, count), ChannelSet{});
    grid.spec.voxel_size = glm::dvec3(0.5);
    if (dims[0] == 70) grid.tiles[0].full = {{morton_encode(7, 1, 1), 0}};
    const int side = std::ranges::max(dims);
    const Bytes bytes = encoded(grid, to(Format::kBinvox));
    const std::string n = std::to_string(side);
    EXPECT_EQ(text_until(bytes, "data\n"),
              "#binvox 1\ndim " + n + " " + n + " " + n + "\ntranslate -1.5 0.25 1e+10\nscale " +
                  std::to_string(side / 2) + (side % 2 == 1 ? ".5" : "") + "\ndata\n");
    const Bytes cells = binvox_cells(bytes, side), dense = samples(grid, std::nullopt, {});
    size_t wrong = 0, at = 0;
    for (int z = 0; z < side; ++z) {
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x, ++at) {
          const bool inside = x < dims[0] && y < dims[1] && z < dims[2];
          const int cell = (z * dims[1] + y) * dims[0] + x;
          wrong += cells[at] != (inside ? dense[static_cast<size_t>(cell)] : 0);
        }
      }
    }
    EXPECT_EQ(wrong, 0U) << side;
  }
}

TEST(Binvox, pinned_bytes_of_two_planes) {
  Grid grid = test::grid_of({2, 1, 2}, {{.cell = {0, 0, 0}}, {.cell = {1, 0, 1}}}, ChannelSet{});
  grid.spec.voxel_size = glm::dvec3(1);
  const Bytes bytes = encoded(grid, to(Format::kBinvox));
  const auto runs = after(bytes, text_until(bytes, "data\n"));
  EXPECT_EQ(Bytes(runs.begin(), runs.end()), (Bytes{1, 1, 0, 3, 0, 2, 1, 1, 0, 1}));
}

TEST(Binvox, a_cube_too_large_is_refused_before_anything_is_computed) {
  GridSpec spec;
  spec.dims = {1290, 8, 8};
  EXPECT_TRUE(check_encodable(spec, to(Format::kBinvox)));
  spec.dims = {1291, 8, 8};
  const Status status = check_encodable(spec, to(Format::kBinvox));
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(status.error().message(),
            "binvox: too many cells in the cube around the grid, of side 1291: expected at most "
            "2147483648, got 2151685171");
}

TEST(Volumes, dense_ones_are_refused_above_the_limit_of_cells) {
  GridSpec spec;
  spec.dims = {2048, 1024, 1025};
  for (const Format format : {Format::kVti, Format::kNrrd, Format::kMha, Format::kNii}) {
    EXPECT_EQ(check_encodable(spec, to(format)).error().message(),
              std::string(format_name(format)) +
                  " is dense: too many cells (npy and npz with layout=sparse are not, nor are "
                  "formats " +
                  sparse_format_names() + "): expected at most 2147483648 cells, got 2149580800");
  }
}

std::string warned(const Grid& grid, OutputOptions options) {
  std::string codes;
  for (const Warning& warning : encode_warnings(grid, options)) {
    EXPECT_TRUE(warning.detail.starts_with(std::string(format_name(options.format)) + ": "));
    codes += (codes.empty() ? "" : " ") + warning.code;
  }
  return codes;
}

TEST(LostData, voxels_inside_of_a_solid_are_not_transparent) {
  const Grid grid = test::grid_of(
      {16, 16, 16}, {{.cell = {0, 0, 0}, .color = {200, 10, 10, 255}}, {.cell = {1, 0, 0}}},
      ChannelSet{.color = true});
  EXPECT_EQ(warned(grid, to(Format::kVox)), "");
  EXPECT_EQ(warned(grid, to(Format::kObj)), "");
  EXPECT_EQ(warned(grid, to(Format::kSchem)), "not-metres");
}

TEST(LostData, instances_have_no_alpha) {
  Grid grid = test::grid_of({4, 4, 4}, {{.cell = {0, 0, 0}, .color = {200, 10, 10, 128}}},
                            ChannelSet{.color = true});
  OutputOptions options = to(Format::kGlb);
  EXPECT_EQ(warned(grid, options), "not-metres");
  options.mesh = MeshSurface::kInstances;
  EXPECT_EQ(warned(grid, options), "lost-alpha not-metres");
}

TEST(LostData, each_format_warns_of_what_it_does_not_hold) {
  Grid grid = every_channel(glm::dvec3(0.5));
  EXPECT_EQ(warned(grid, to(Format::kVti)), "");
  EXPECT_EQ(warned(grid, to(Format::kNrrd)), "lost-channels");
  EXPECT_EQ(warned(grid, to(Format::kMha)), "lost-channels");
  EXPECT_EQ(warned(grid, to(Format::kNii)), "lost-channels");
  EXPECT_EQ(warned(grid, to(Format::kBinvox)), "lost-channels lost-units");
  EXPECT_EQ(warned(grid, to(Format::kCsv)), "lost-names lost-units");
  EXPECT_EQ(warned(grid, to(Format::kNvdb)), "lost-names lost-units");
  EXPECT_EQ(warned(grid, to(Format::kPcd)), "lost-alpha lost-names");
  EXPECT_EQ(warned(grid, to(Format::kVox)), "lost-channels lost-alpha");
  EXPECT_EQ(warned(grid, to(Format::kQb)), "lost-channels lost-alpha lost-units lost-placement");
  EXPECT_EQ(encode_warnings(grid, to(Format::kNrrd))[0].detail,
            "nrrd: one array, without color, normal, material, label, distance, coverage (option "
            "channel chooses it)");

  grid.spec.voxel_size = {0.5, 0.25, 0.125};
  grid.spec.origin_world.z = 1e10;
  EXPECT_EQ(warned(grid, to(Format::kVti)), "distance-in-voxels");
  Grid in_world = grid;
  in_world.meta = grid.meta.with({{"options", {{"distance", "world"}}}});
  EXPECT_EQ(warned(in_world, to(Format::kVti)), "");
  EXPECT_EQ(warned(grid, to(Format::kNii)), "lost-channels lost-precision");
  EXPECT_EQ(warned(grid, to(Format::kBinvox)), "lost-channels lost-units not-cubes");

  grid.meta = GridMeta::parse(R"({"units":"in"})");
  grid.spec = {.dims = {70, 40, 33}};
  grid.channels = {.label = true};
  OutputOptions options = to(Format::kMha);
  options.channel = Channel::kLabel;
  EXPECT_EQ(warned(grid, options), "lost-names lost-units");
  options.format = Format::kNii;
  EXPECT_EQ(warned(grid, options), "lost-units");
  options.format = Format::kNrrd;
  EXPECT_EQ(warned(grid, options), "");
}

}  // namespace
}  // namespace voxeld
