#include "server/formats/formats.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <zip.h>

#include <filesystem>
#include <string>
#include <vector>

#include "server/base/disk/file.h"
#include "server/formats/npy/npy_array.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_frames.h"

namespace voxeld {
namespace {

using test::to;

constexpr ChannelSet kColorChannels = {.color = true};

std::vector<Format> all_formats() {
  std::vector<Format> formats;
  for (const FormatInfo& info : output_formats()) formats.push_back(info.format);
  return formats;
}

class SequenceFormats : public testing::Test {
 protected:
  SequenceFormats()
      : path_(std::filesystem::temp_directory_path() /
              ("unit_formats-sequence-" + std::to_string(getpid()))) {}
  ~SequenceFormats() override { std::filesystem::remove(path_); }

  std::vector<uint8_t> written(const FrameSource& source, const OutputOptions& options) const {
    const Status status = write_sequence(source, options, path_);
    EXPECT_TRUE(status.ok()) << status.error().message();
    auto bytes = read_file(path_);
    EXPECT_TRUE(bytes.ok());
    return bytes ? *std::move(bytes) : std::vector<uint8_t>();
  }
  Error refused(const FrameSource& source, Format format) const {
    const Status status = write_sequence(source, to(format), path_);
    EXPECT_FALSE(status.ok());
    return status.ok() ? Error() : status.error();
  }
  std::filesystem::path path_;
};

// Stops at a frame, as the source of a cancelled task does.
class CancelledFrames : public test::FramesInMemory {
 public:
  using FramesInMemory::FramesInMemory;
  Result<Grid> frame(size_t index) const override {
    if (index == 2) return Error{ErrorCode::kCancelled, "cancelled", "", ""};
    return FramesInMemory::frame(index);
  }
};

TEST_F(SequenceFormats, the_same_frames_give_the_same_bytes) {
  const test::FramesInMemory source(test::mostly_static(3, {40, 30, 20}, 300, 4, kColorChannels));
  for (const Format format : all_formats()) {
    const auto bytes = written(source, to(format));
    EXPECT_GT(bytes.size(), 500U);
    EXPECT_EQ(bytes, written(source, to(format))) << format_name(format);
  }
}

TEST_F(SequenceFormats, a_longer_file_of_the_same_name_is_replaced) {
  const test::FramesInMemory longer(test::mostly_static(3, {40, 30, 20}, 300, 4, kColorChannels)),
      shorter({test::random_grid(1, {4, 4, 4}, 5, true, false)});
  for (const Format format : all_formats()) {
    const auto bytes = written(shorter, to(format));
    written(longer, to(format));
    EXPECT_EQ(written(shorter, to(format)), bytes) << format_name(format);
  }
}

TEST_F(SequenceFormats, a_frame_of_an_array_is_the_array_of_its_grid) {
  const auto grids = test::mostly_static(3, {40, 30, 20}, 300, 3, kColorChannels);
  for (const DType dtype : {DType::kUint8, DType::kBool, DType::kFloat32}) {
    for (const AxisOrder axes : {AxisOrder::kZyx, AxisOrder::kXyz}) {
      OutputOptions options = to(Format::kNpy);
      options.dtype = dtype;
      options.axes = axes;
      const auto bytes = written(test::FramesInMemory(grids), options);
      std::vector<uint8_t> expected = npy_frames_header(grids[0].spec, 3, std::nullopt, options);
      for (const Grid& grid : grids) {
        const auto one = test::read_npy(test::npy_of(grid, std::nullopt, options)).data;
        expected.insert(expected.end(), one.begin(), one.end());
      }
      EXPECT_EQ(bytes, expected);
    }
  }
}

TEST_F(SequenceFormats, sparse_arrays_have_the_rows_of_all_frames) {
  auto grids = test::mostly_static(3, {40, 30, 20}, 300, 3, kColorChannels);
  grids[1].tiles.clear();
  OutputOptions options = to(Format::kNpy);
  options.layout = ArrayLayout::kSparse;
  const auto array = test::read_npy(written(test::FramesInMemory(grids), options));
  EXPECT_EQ(array.descr, "<i4");
  const auto first = static_cast<int64_t>(grids[0].voxel_count());
  EXPECT_EQ(array.shape,
            (std::vector<int64_t>{first + static_cast<int64_t>(grids[2].voxel_count()), 4}));
  const auto rows = array.as<int32_t>();
  size_t at = 0;
  for (const size_t frame : {0, 2}) {
    const auto one = encode(grids[frame], options);
    ASSERT_TRUE(one) << one.error().message();
    const auto coords = test::read_npy(*one).as<int32_t>();
    for (size_t i = 0; i < coords.size(); i += 3, at += 4) {
      ASSERT_EQ(std::vector(rows.begin() + static_cast<ptrdiff_t>(at),
                            rows.begin() + static_cast<ptrdiff_t>(at + 4)),
                (std::vector<int32_t>{static_cast<int32_t>(frame), coords[i], coords[i + 1],
                                      coords[i + 2]}));
    }
  }
  EXPECT_EQ(at, rows.size());
}

// libzip compares what the directory says with the members' own headers.
TEST_F(SequenceFormats, an_npz_is_a_consistent_zip) {
  const test::FramesInMemory source(test::mostly_static(3, {200, 100, 90}, 300, 4, kColorChannels));
  written(source, to(Format::kNpz));
  int code = 0;
  zip_t* archive = zip_open(path_.c_str(), ZIP_RDONLY | ZIP_CHECKCONS, &code);
  ASSERT_NE(archive, nullptr) << code;
  std::vector<std::string> names;
  for (zip_int64_t i = 0; i < zip_get_num_entries(archive, 0); ++i) {
    zip_stat_t stat;
    ASSERT_EQ(zip_stat_index(archive, static_cast<zip_uint64_t>(i), 0, &stat), 0);
    names.emplace_back(stat.name);
    std::vector<char> content(stat.size);
    zip_file_t* file = zip_fopen_index(archive, static_cast<zip_uint64_t>(i), 0);
    EXPECT_EQ(zip_fread(file, content.data(), content.size()),
              static_cast<zip_int64_t>(content.size()));
    EXPECT_EQ(zip_fclose(file), 0);  // the checksum is right
    if (names.back() == "color.npy") {
      EXPECT_EQ(content.size(), 128U + size_t{4} * 4 * 200 * 100 * 90);
    }
  }
  zip_discard(archive);
  EXPECT_EQ(names, (std::vector<std::string>{"occupancy.npy", "color.npy", "times.npy",
                                             "origin.npy", "voxel_size.npy", "meta.npy"}));
}

TEST_F(SequenceFormats, dense_ones_have_a_limit_of_cells_in_all_frames) {
  GridSpec spec;
  spec.dims = {256, 256, 256};
  for (const Format format : all_formats()) {
    EXPECT_TRUE(check_sequence_encodable(spec, 512, to(format)));
    const Status status = check_sequence_encodable(spec, 513, to(format));
    const bool dense = format_info(format).layout.is_dense();
    OutputOptions sparse = to(format);
    sparse.layout = ArrayLayout::kSparse;
    const bool may_be_sparse = format_info(format).layout.may_be_sparse;
    EXPECT_EQ(check_sequence_encodable(spec, 513, sparse).ok(), !dense || may_be_sparse);
    ASSERT_EQ(status.ok(), !dense);
    if (!dense) continue;
    EXPECT_EQ(status.error().code, ErrorCode::kGridTooLarge);
    EXPECT_EQ(
        status.error().message(),
        std::string(format_name(format)) + " is dense: too many cells in all frames (" +
            (may_be_sparse ? "layout=sparse is not" : "npy and npz with layout=sparse are not") +
            ", nor are formats " + sparse_format_names() +
            "): expected "
            "at most 8589934592 cells, got 8606711808");
  }
  spec.dims = {1290, 1, 1};  // a binvox is a cube
  EXPECT_TRUE(check_sequence_encodable(spec, 4, to(Format::kBinvox)));
  EXPECT_EQ(check_sequence_encodable(spec, 5, to(Format::kBinvox)).error().got, "10733445000");
  EXPECT_TRUE(check_sequence_encodable(spec, 5, to(Format::kVti)));
  spec.dims = {2048, 1024, 1025};  // one frame is too large
  EXPECT_EQ(check_sequence_encodable(spec, 1, to(Format::kNpz)).error().message(),
            check_encodable(spec, to(Format::kNpz)).error().message());
}

TEST_F(SequenceFormats, a_vox_longer_than_it_can_say_is_refused) {
  Grid grid;
  grid.spec.dims = {2048, 2048, 2048};
  for (uint32_t i = 0; i < 512; ++i) {
    const auto at = morton_decode(i);
    SparseTile& tile = grid.tiles.emplace_back();
    for (size_t c = 0; c < 3; ++c) tile.coord[c] = static_cast<int32_t>(at[c]);
    tile.full = {{0, kTileLevels}};
  }
  const Error error = refused(test::FramesInMemory({grid}), Format::kVox);
  EXPECT_EQ(error.code, ErrorCode::kGridTooLarge);
  EXPECT_EQ(
      error.message(),
      "vox: too many voxels for the file's 32-bit lengths: expected at most 2147483647 bytes, "
      "got 34359738368");
}

TEST_F(SequenceFormats, more_frames_than_the_editor_plays_are_written_with_a_warning) {
  Grid grid;
  grid.spec.dims = {64, 64, 64};
  EXPECT_TRUE(sequence_warnings(grid, 120, to(Format::kVox)).empty());
  EXPECT_TRUE(sequence_warnings(grid, 121, to(Format::kNative)).empty());
  const auto warnings = sequence_warnings(grid, 121, to(Format::kVox));
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].code, "many-frames");
  EXPECT_EQ(warnings[0].detail, "vox: MagicaVoxel plays 120 frames of 121");
  grid.spec.dims = {64, 1001, 64};
  EXPECT_EQ(sequence_warnings(grid, 121, to(Format::kVox)).size(), 2U);
}

TEST_F(SequenceFormats, errors_of_the_source_and_of_the_file_are_returned) {
  const auto grids = test::mostly_static(3, {40, 30, 20}, 300, 4, kColorChannels);
  for (const Format format : all_formats()) {
    EXPECT_EQ(refused(CancelledFrames(grids), format).code, ErrorCode::kCancelled);
    const Status status = write_sequence(test::FramesInMemory(grids), to(format), path_ / "no");
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kInternal);
    EXPECT_TRUE(status.error().detail.starts_with("create ")) << status.error().detail;
  }
}

TEST_F(SequenceFormats, names_and_media_types_are_those_of_grids_but_for_the_native_one) {
  EXPECT_EQ(sequence_extension(Format::kNative), ".voxs");
  EXPECT_EQ(sequence_media_type(Format::kNative), "application/vnd.voxeld.sequence");
  for (const Format format : {Format::kVox, Format::kNpy, Format::kNpz}) {
    EXPECT_EQ(sequence_extension(format), format_extension(format));
    EXPECT_EQ(sequence_media_type(format), format_media_type(format));
  }
}

}  // namespace
}  // namespace voxeld
