// Writes a zip of PNG images, one for each z, or of one image with all of them (layout=atlas):
//
//   slices.json     place, units, meaning of the pixels, meta
//   slice-0000.png  z = 0, the lowest slice; more digits above 10,000 slices
//   slice-0001.png  ...
//   atlas.png       instead of these: slices left to right, then top to bottom; the rest is 0
//
// Column c of an image is x = c and row r is y = r, so that the images on top of each other are an
// array [z, y, x], as for a stack of ImageJ or NumPy. Image viewers show y downwards.
//
//   channel          pixels                       values
//   occupancy        grey of 8 bits               0; 255
//   color            RGBA of 8 bits, sRGB         alpha 0: no voxel, or one without a colour
//   normal           RGB of 8 bits                round((n + 1) * 127.5); 0, 0, 0: none
//   material, label  grey of 16 bits              the id; 0: none
//   distance         grey of 16 bits              32768 + stored steps: none is lost
//   coverage         grey of 8 bits               255: all of the voxel
//
// `scale` and `offset` of slices.json make values of pixels: value = pixel * scale + offset.
#include "server/formats/images/slices.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/images/png_stream.h"
#include "server/formats/images/sample_words.h"
#include "server/formats/npy/dense_array.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"
#include "server/formats/zip/zip_writer.h"

namespace voxeld::images {
namespace {

using nlohmann::json;

constexpr size_t kBatchPieces = 32;                   // deflated together
constexpr size_t kStripBytesMax = size_t{128} << 20;  // of an atlas in memory
constexpr size_t kPartBytes = size_t{1} << 20;        // of a strip, deflated at once
constexpr int kZeroDistance = 32768;                  // the pixel of distance 0
constexpr double kLargestPhysicalPixels = double{1u << 31} - 1;

ChannelKind kind_of(Channel channel) {
  return channel_info(channel).kind;
}

PngPixel slice_pixel(std::optional<Channel> channel) {
  if (!channel) return {PngColor::kGrey, 8, 1};
  switch (kind_of(*channel)) {
    case ChannelKind::kColor:
      return {PngColor::kRgba, 8, 4};
    case ChannelKind::kVector:
      return {PngColor::kRgb, 8, 3};
    case ChannelKind::kId:
    case ChannelKind::kDistance:
      return {PngColor::kGrey, 16, 2};
    case ChannelKind::kFraction:
      break;
  }
  return {PngColor::kGrey, 8, 1};
}

void put_big_endian(uint8_t* at, int value) {
  at[0] = static_cast<uint8_t>(value >> 8);
  at[1] = static_cast<uint8_t>(value);
}

// (n + 1) * 127.5 of n = stored / 127, rounded: exact in integers.
uint8_t normal_pixel(uint8_t stored) {
  const auto value = static_cast<int8_t>(stored);
  return static_cast<uint8_t>(std::max<int>(value, -INT8_MAX) + (value < 0 ? 127 : 128));
}

void to_normal_pixels(std::span<const uint8_t> samples, uint8_t* out) {
  for (size_t at = 0; at < samples.size();) {
    if (samples.size() - at >= 3 * kVectorGroup && all_zero_vectors(&samples[at])) {
      std::memset(out + at, 0, 3 * kVectorGroup);
      at += 3 * kVectorGroup;
      continue;
    }
    const bool is_none = (samples[at] | samples[at + 1] | samples[at + 2]) == 0;
    for (const size_t end = at + 3; at < end; ++at) {
      out[at] = is_none ? uint8_t{0} : normal_pixel(samples[at]);
    }
  }
}

// Distances are whole steps. In world units floats round them by less than half a step. 0, which no
// distance is: a cell beside a band that does not tell its side.
void to_distance_pixels(std::span<const uint8_t> samples, double unit, uint8_t* out) {
  for (size_t at = 0; at < samples.size(); at += sizeof(float), out += 2) {
    float distance = 0;
    std::memcpy(&distance, &samples[at], sizeof distance);
    if (std::isnan(distance)) {
      put_big_endian(out, 0);
      continue;
    }
    const auto steps = static_cast<int>(std::lround(distance / unit * kDistanceSteps));
    put_big_endian(out, std::clamp(kZeroDistance + steps, 0, int{UINT16_MAX}));
  }
}

// Makes pixels of a channel's samples as DenseArray has them, of dtype uint8. unit: that of
// distances, distance_unit().
void to_pixels(std::optional<Channel> channel, double unit, std::span<const uint8_t> samples,
               uint8_t* out) {
  if (!channel) return to_full_range(samples, out);
  switch (kind_of(*channel)) {
    case ChannelKind::kVector:
      return to_normal_pixels(samples, out);
    case ChannelKind::kId:
      return swap_bytes_16(samples, out);
    case ChannelKind::kDistance:
      return to_distance_pixels(samples, unit, out);
    case ChannelKind::kColor:
    case ChannelKind::kFraction:
      std::memcpy(out, samples.data(), samples.size());
  }
}

std::array<uint32_t, 2> pixels_per_metre(const Grid& grid) {
  static constexpr std::array<std::pair<std::string_view, double>, 5> kMetres = {
      {{"m", 1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}}};
  const std::string units = volume::units_of(grid);
  const auto found = std::ranges::find(kMetres, units, &std::pair<std::string_view, double>::first);
  if (found == kMetres.end()) return {};
  std::array<uint32_t, 2> pixels{};
  for (int axis = 0; axis < 2; ++axis) {
    const double count = std::round(1 / (grid.spec.voxel_size[axis] * found->second));
    if (count >= 1 && count <= kLargestPhysicalPixels) {
      pixels[static_cast<size_t>(axis)] = static_cast<uint32_t>(count);
    }
  }
  return pixels;
}

// The cells of a grid's channel as rows of pixels.
class SliceRows {
 public:
  SliceRows(const Grid& grid, const OutputOptions& options)
      : channel_(options.channel),
        unit_(distance_unit(grid)),
        array_(grid, options.channel, array_options()),
        nx_(static_cast<size_t>(grid.spec.dims.x)),
        ny_(static_cast<size_t>(grid.spec.dims.y)),
        sample_row_bytes_(static_cast<size_t>(
            array_.bytes() / static_cast<uint64_t>(grid.spec.cell_count() / grid.spec.dims.x))) {}

  size_t piece_count() const { return array_.piece_count(); }
  // The rows before a piece, of all slices.
  size_t piece_begin(size_t piece) const {
    return static_cast<size_t>(array_.piece_begin(piece) / sample_row_bytes_);
  }
  // The piece that holds a row.
  size_t piece_of(size_t row) const {
    size_t begin = 0, end = piece_count();
    while (end - begin > 1) {
      const size_t middle = begin + (end - begin) / 2;
      (piece_begin(middle) <= row ? begin : end) = middle;
    }
    return begin;
  }
  size_t rows_of_slice() const { return ny_; }
  size_t row_bytes() const { return nx_ * pixel().bytes; }  // of pixels
  PngPixel pixel() const { return slice_pixel(channel_); }
  PngFilter filter() const {
    const bool is_smooth = channel_ && kind_of(*channel_) == ChannelKind::kDistance;
    return is_smooth ? PngFilter::kUp : PngFilter::kNone;
  }

  // Calls visit(row, samples) for each row of a piece that wanted(row) accepts. Thread-safe.
  template <typename Wanted, typename Visit>
  void for_rows(size_t piece, const Wanted& wanted, const Visit& visit) const {
    static thread_local std::vector<uint8_t> samples;
    const size_t begin = piece_begin(piece), end = piece_begin(piece + 1);
    size_t row = begin;
    while (row < end && !wanted(row)) ++row;
    if (row == end) return;
    samples.resize(array_.piece_bytes(piece));
    array_.fill(piece, samples);
    for (; row < end; ++row) {
      if (!wanted(row)) continue;
      visit(row, std::span(samples).subspan((row - begin) * sample_row_bytes_, sample_row_bytes_));
    }
  }
  void to_row(std::span<const uint8_t> samples, uint8_t* pixels) const {
    to_pixels(channel_, unit_, samples, pixels);
  }

 private:
  static OutputOptions array_options() {
    OutputOptions options;
    options.axes = AxisOrder::kZyx;
    options.dtype = DType::kUint8;
    return options;
  }

  std::optional<Channel> channel_;
  double unit_;  // of distances
  DenseArray array_;
  size_t nx_, ny_, sample_row_bytes_;
};

// Writes each slice as an image. A piece of the array may hold many slices, or a part of one.
class SliceImages {
 public:
  SliceImages(const Grid& grid, const SliceRows& rows, ZipWriter& zip)
      : rows_(rows),
        zip_(zip),
        header_{static_cast<uint32_t>(grid.spec.dims.x), static_cast<uint32_t>(grid.spec.dims.y),
                rows.pixel(), pixels_per_metre(grid)},
        slices_(grid.spec.dims.z) {}

  Status write() {
    const size_t count = rows_.piece_count();
    for (size_t begin = 0; begin < count; begin += kBatchPieces) {
      std::vector<std::vector<Part>> pieces(std::min(kBatchPieces, count - begin));
      ThreadPool::shared().for_each(pieces.size(), [&](size_t i) {
        cancel_point();  // on the calling thread
        pieces[i] = parts_of(begin + i);
      });
      for (const std::vector<Part>& piece : pieces) {
        for (const Part& part : piece) VOXELD_TRY(add(part));
      }
    }
    return {};
  }

 private:
  // Rows of one slice.
  struct Part {
    size_t end;  // the row after them, of all slices
    DeflatedPiece rows;
  };

  std::vector<Part> parts_of(size_t piece) const {
    static thread_local std::vector<uint8_t> image_rows;  // with their filter bytes
    const size_t begin = rows_.piece_begin(piece), end = rows_.piece_begin(piece + 1);
    const size_t step = rows_.row_bytes() + 1;
    image_rows.resize((end - begin) * step);
    rows_.for_rows(
        piece, [](size_t) { return true; },
        [&](size_t row, std::span<const uint8_t> samples) {
          rows_.to_row(samples, &image_rows[(row - begin) * step + 1]);
        });
    std::vector<Part> parts;
    for (size_t row = begin; row < end;) {
      const size_t slice_end = (row / rows_.rows_of_slice() + 1) * rows_.rows_of_slice();
      const size_t part_end = std::min(end, slice_end);
      const auto part =
          std::span(image_rows).subspan((row - begin) * step, (part_end - row) * step);
      parts.push_back({part_end, png_rows(part, rows_.row_bytes(), rows_.filter())});
      row = part_end;
    }
    return parts;
  }

  Status add(const Part& part) {
    if (!png_) png_.emplace(header_);
    png_->add(part.rows);
    if (part.end % rows_.rows_of_slice() != 0) return {};
    const std::vector<uint8_t> image = png_->finish();
    png_.reset();
    return zip_.store(slice_name(part.end / rows_.rows_of_slice() - 1), image);
  }

  std::string slice_name(size_t slice) const {
    constexpr int kDigitsMin = 4;
    const auto digits = static_cast<int>(std::to_string(slices_ - 1).size());
    std::array<char, 40> name{};
    std::snprintf(name.data(), name.size(), "slice-%0*zu.png", std::max(digits, kDigitsMin), slice);
    return name.data();
  }

  const SliceRows& rows_;
  ZipWriter& zip_;
  PngHeader header_;
  int slices_;
  std::optional<PngStream> png_;
};

// Writes all slices as one image, in strips of its width.
class AtlasImage {
 public:
  AtlasImage(const Grid& grid, const SliceRows& rows, ZipWriter& zip)
      : rows_(rows),
        zip_(zip),
        layout_(atlas_layout(grid.spec)),
        slices_(static_cast<size_t>(grid.spec.dims.z)),
        width_bytes_(static_cast<size_t>(layout_.width) * rows.pixel().bytes),
        png_({static_cast<uint32_t>(layout_.width), static_cast<uint32_t>(layout_.height),
              rows.pixel(), pixels_per_metre(grid)}) {}

  Status write() {
    const size_t ny = rows_.rows_of_slice();
    const size_t strip_rows = std::clamp<size_t>(kStripBytesMax / step(), 1, ny);
    for (int row = 0; row < layout_.rows; ++row) {
      for (size_t y = 0; y < ny; y += strip_rows) {
        fill_strip(static_cast<size_t>(row), y, std::min(ny, y + strip_rows));
        VOXELD_TRY(add_strip());
      }
    }
    return zip_.store("atlas.png", png_.finish());
  }

 private:
  // Bytes of a row with its filter byte.
  size_t step() const { return width_bytes_ + 1; }

  // The rows [y_begin, y_end) of the slices in a row of the atlas.
  void fill_strip(size_t atlas_row, size_t y_begin, size_t y_end) {
    const size_t ny = rows_.rows_of_slice(), columns = static_cast<size_t>(layout_.columns);
    const size_t first = atlas_row * columns, end = std::min(first + columns, slices_);
    strip_.assign((y_end - y_begin) * step(), 0);
    const size_t piece_begin = rows_.piece_of(first * ny + y_begin);
    const size_t piece_end = rows_.piece_of((end - 1) * ny + y_end - 1) + 1;
    const auto is_wanted = [&](size_t row) {
      const size_t z = row / ny, y = row % ny;
      return z >= first && z < end && y >= y_begin && y < y_end;
    };
    ThreadPool::shared().for_each(piece_end - piece_begin, [&](size_t i) {
      cancel_point();  // on the calling thread
      rows_.for_rows(piece_begin + i, is_wanted, [&](size_t row, std::span<const uint8_t> samples) {
        const size_t z = row / ny, y = row % ny;
        rows_.to_row(samples,
                     &strip_[(y - y_begin) * step() + 1 + (z - first) * rows_.row_bytes()]);
      });
    });
  }

  Status add_strip() {
    const size_t part_bytes = std::max<size_t>(1, kPartBytes / step()) * step();
    return deflate_pieces((strip_.size() + part_bytes - 1) / part_bytes,
                          [&](size_t i) {
                            const size_t begin = i * part_bytes;
                            const auto part = std::span(strip_).subspan(
                                begin, std::min(part_bytes, strip_.size() - begin));
                            return png_rows(part, width_bytes_, rows_.filter());
                          },
                          [&](const DeflatedPiece& part) -> Status {
                            png_.add(part);
                            return {};
                          });
  }

  const SliceRows& rows_;
  ZipWriter& zip_;
  AtlasLayout layout_;
  size_t slices_, width_bytes_;
  PngStream png_;
  std::vector<uint8_t> strip_;
};

// The factor and the offset from pixels to values, for channels whose pixels are numbers.
void add_scale(json& members, std::optional<Channel> channel, const Grid& grid) {
  double scale = 1.0 / UINT8_MAX, offset = 0;
  switch (channel ? kind_of(*channel) : ChannelKind::kFraction) {
    case ChannelKind::kColor:
      return;
    case ChannelKind::kVector:
      scale = 2.0 / UINT8_MAX;
      offset = -1;
      break;
    case ChannelKind::kId:
      scale = 1;
      break;
    case ChannelKind::kDistance:
      scale = volume::stored_distance_scale(grid) / kDistanceSteps;
      offset = -kZeroDistance * scale;
      members["distance_unit"] = volume::has_world_distances(grid) ? "world" : "voxel";
      break;
    case ChannelKind::kFraction:
      break;
  }
  members["scale"] = scale;
  members["offset"] = offset;
}

std::string slices_json(const Grid& grid, const OutputOptions& options) {
  const GridSpec& spec = grid.spec;
  const glm::dvec3 size = spec.voxel_size, center = volume::first_center(spec);
  const PngPixel pixel = slice_pixel(options.channel);
  json members = {{"format", "voxeld slices"},
                  {"version", 1},
                  {"dims", {spec.dims.x, spec.dims.y, spec.dims.z}},
                  {"origin", {spec.origin_world.x, spec.origin_world.y, spec.origin_world.z}},
                  {"voxel_size", {size.x, size.y, size.z}},
                  {"units", volume::units_of(grid)},
                  {"transform",
                   {{size.x, 0, 0, center.x},
                    {0, size.y, 0, center.y},
                    {0, 0, size.z, center.z},
                    {0, 0, 0, 1}}},
                  {"axes", {{"column", "x"}, {"row", "y"}, {"slice", "z"}}},
                  {"channel", volume::array_name(options.channel)},
                  {"sample_bits", pixel.sample_bits},
                  {"meta", grid.meta.members()}};
  add_scale(members, options.channel, grid);
  if (options.layout == ArrayLayout::kAtlas) {
    const AtlasLayout layout = atlas_layout(spec);
    members["columns"] = layout.columns;
    members["rows"] = layout.rows;
  }
  return members.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace

AtlasLayout atlas_layout(const GridSpec& spec) {
  std::optional<AtlasLayout> best;
  const auto cost = [](const AtlasLayout& of) {
    return std::pair(std::max(of.width, of.height), of.width * of.height);
  };
  for (int columns = 1; columns <= spec.dims.z; ++columns) {
    const int rows = (spec.dims.z + columns - 1) / columns;
    const AtlasLayout layout = {columns, rows, int64_t{columns} * spec.dims.x,
                                int64_t{rows} * spec.dims.y};
    if (!best || cost(layout) < cost(*best)) best = layout;
  }
  return *best;
}

Status check_atlas(const GridSpec& spec) {
  const AtlasLayout layout = atlas_layout(spec);
  if (std::max(layout.width, layout.height) <= kAtlasSideMax) return {};
  return Error{ErrorCode::kGridTooLarge,
               "slices: the atlas is too large (layout=dense writes an image for each slice)",
               "sides of at most " + std::to_string(kAtlasSideMax) + " pixels",
               std::to_string(layout.width) + " x " + std::to_string(layout.height)};
}

}  // namespace voxeld::images

namespace voxeld {

Status encode_slices(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace images;
  const bool is_atlas = options.layout == ArrayLayout::kAtlas;
  if (is_atlas) VOXELD_TRY(check_atlas(grid.spec));
  const SliceRows rows(grid, options);
  ZipWriter zip(file);
  VOXELD_TRY(zip.begin("slices.json"));
  VOXELD_TRY(zip.add(volume::text_bytes(slices_json(grid, options))));
  VOXELD_TRY(is_atlas ? AtlasImage(grid, rows, zip).write() : SliceImages(grid, rows, zip).write());
  return zip.finish();
}

}  // namespace voxeld
