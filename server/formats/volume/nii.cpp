// Writes NIfTI-1 in gzip (.nii.gz):
//
//     0  header of 348 bytes; the fields that are not 0 are named below
//   348  1 0 0 0: an extension follows
//   352  u32 its length, a multiple of 16; u32 6 (a comment); meta as JSON, zeros
//        the samples, x fastest; components of colours as uint8 beside each other, of others as
//        arrays after each other (the fifth axis)
//
// NIfTI's axes are right, anterior and superior: the file says so of x, y and z, which only the
// user knows. sform and qform place the centre of the first cell. Integers that stand for fractions
// have their factor in scl_slope. The specification: nifti1.h of the NIfTI Data Format Working
// Group.
#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::volume {
namespace {

constexpr size_t kHeaderBytes = 348, kExtenderBytes = 4, kExtensionHeadBytes = 8;
constexpr size_t kExtensionStep = 16;
constexpr int32_t kComment = 6;      // the code of an extension of text
constexpr int16_t kAligned = 2;      // the code of a placement that is no scanner's
constexpr int kSideMax = INT16_MAX;  // dim is of int16
static_assert(limits::kGridSideMax <= kSideMax, "each grid's sides fit into a NIfTI header");

enum DataType : int16_t {
  kNiftiUint8 = 2,
  kNiftiFloat32 = 16,
  kNiftiInt8 = 256,
  kNiftiUint16 = 512,
  kNiftiRgba32 = 2304
};
enum Intent : int16_t {
  kNiftiNone = 0,
  kNiftiLabel = 1002,
  kNiftiVector = 1007,
  kNiftiRgbaVector = 2004
};

// The layout of an array in a NIfTI file.
struct NiftiType {
  DataType data_type;
  Intent intent;
  size_t voxel_bytes;    // of the first three axes
  size_t vector_length;  // of the fifth axis
  float slope;           // 0: samples are not scaled
  Components components;
};

NiftiType nifti_type(std::optional<Channel> channel, const ArrayType& type) {
  if (channel == Channel::kColor && type.sample == SampleType::kUint8) {
    return {kNiftiRgba32, kNiftiNone, 4, 1, 0, Components::kInterleaved};
  }
  NiftiType nifti = {kNiftiUint8,     kNiftiNone, type.sample_bytes,
                     type.components, 0,          Components::kPlanar};
  if (type.sample == SampleType::kFloat32) nifti.data_type = kNiftiFloat32;
  if (type.sample == SampleType::kInt8) nifti.data_type = kNiftiInt8;
  if (type.sample == SampleType::kUint16) nifti.data_type = kNiftiUint16;
  if (!channel) return nifti;
  switch (channel_info(*channel).kind) {
    case ChannelKind::kColor:
      nifti.intent = kNiftiRgbaVector;
      break;
    case ChannelKind::kVector:
      nifti.intent = kNiftiVector;
      if (type.sample == SampleType::kInt8) nifti.slope = 1.0F / INT8_MAX;
      break;
    case ChannelKind::kId:
      nifti.intent = kNiftiLabel;
      break;
    case ChannelKind::kFraction:
      if (type.sample == SampleType::kUint8) nifti.slope = 1.0F / UINT8_MAX;
      break;
    case ChannelKind::kDistance:
      break;
  }
  return nifti;
}

class NiftiHeader {
 public:
  template <typename T>
  void put(size_t at, T value) {
    std::memcpy(&bytes_[at], &value, sizeof value);
  }
  void put_text(size_t at, size_t bytes_max, std::string_view text) {
    std::memcpy(&bytes_[at], text.data(), std::min(bytes_max - 1, text.size()));
  }
  std::span<const uint8_t> bytes() const { return bytes_; }

 private:
  std::array<uint8_t, kHeaderBytes> bytes_{};
};

// sform and qform, which say the same.
void put_placement(NiftiHeader& header, const GridSpec& spec) {
  constexpr size_t kPixdim = 76, kQform = 252, kSform = 254, kQoffset = 268, kRows = 280;
  const glm::dvec3 center = first_center(spec);
  header.put(kPixdim, 1.0F);  // right-handed
  header.put(kQform, kAligned);
  header.put(kSform, kAligned);
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<size_t>(axis);
    const auto size = static_cast<float>(spec.voxel_size[axis]);
    const auto offset = static_cast<float>(center[axis]);
    header.put(kPixdim + 4 * (i + 1), size);
    header.put(kQoffset + 4 * i, offset);
    header.put(kRows + 16 * i + 4 * i, size);
    header.put(kRows + 16 * i + 12, offset);
  }
}

NiftiHeader nifti_header(const Grid& grid, std::optional<Channel> channel, const NiftiType& type,
                         size_t data_begin) {
  constexpr uint8_t kMetres = 1, kMillimetres = 2;
  const GridSpec& spec = grid.spec;
  const std::string units = units_of(grid);
  NiftiHeader header;
  header.put(0, static_cast<int32_t>(kHeaderBytes));
  header.put(38, 'r');
  const bool is_vector = type.vector_length > 1;
  const int sides[] = {is_vector ? 5 : 3,
                       spec.dims.x,
                       spec.dims.y,
                       spec.dims.z,
                       1,
                       static_cast<int>(type.vector_length),
                       1,
                       1};
  for (size_t i = 0; i < std::size(sides); ++i) {
    header.put(40 + 2 * i, static_cast<int16_t>(sides[i]));
  }
  header.put(68, static_cast<int16_t>(type.intent));
  header.put(70, static_cast<int16_t>(type.data_type));
  header.put(72, static_cast<int16_t>(8 * type.voxel_bytes));
  header.put(108, static_cast<float>(data_begin));  // exact: a multiple of 16 below 2^28
  header.put(112, type.slope);
  header.put(123, units == "m" ? kMetres : units == "mm" ? kMillimetres : uint8_t{0});
  header.put_text(148, 80, "voxeld" + (units.empty() ? "" : ", units " + units));
  put_placement(header, spec);
  header.put_text(328, 16, array_name(channel));
  header.put_text(344, 4, "n+1");
  return header;
}

// The extender and an extension with the grid's meta.
std::vector<uint8_t> nifti_extension(const Grid& grid) {
  const std::string meta = grid.meta.text();
  const size_t bytes =
      (kExtensionHeadBytes + meta.size() + kExtensionStep - 1) / kExtensionStep * kExtensionStep;
  std::vector<uint8_t> extension(kExtenderBytes + bytes);
  extension[0] = 1;
  const auto size = static_cast<int32_t>(bytes);
  std::memcpy(&extension[kExtenderBytes], &size, sizeof size);
  std::memcpy(&extension[kExtenderBytes + 4], &kComment, sizeof kComment);
  std::memcpy(&extension[kExtenderBytes + kExtensionHeadBytes], meta.data(), meta.size());
  return extension;
}

}  // namespace
}  // namespace voxeld::volume

namespace voxeld {

Status encode_nii(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace volume;
  const std::optional<Channel> channel = options.channel;
  const NiftiType type = nifti_type(channel, array_type(channel, options));
  const std::vector<uint8_t> extension = nifti_extension(grid);
  const NiftiHeader header = nifti_header(grid, channel, type, kHeaderBytes + extension.size());
  DeflateStream stream(file, DeflateStream::Frame::kGzip);
  VOXELD_TRY(stream.begin());
  VOXELD_TRY(stream.add(header.bytes()));
  VOXELD_TRY(stream.add(extension));
  VOXELD_TRY(append_pieces(stream, VolumeArray(grid, channel, options, type.components)));
  return stream.finish();
}

}  // namespace voxeld
