// Writes ITK's MetaImage with its data in the same file (.mha): lines "key = value", the last one
// ElementDataFile, then one array as a zlib stream, x fastest, components beside each other.
//
//   Offset              the centre of the first cell
//   ElementSpacing      the voxel size
//   DistanceUnits       mm or cm, the units that MetaImage has
//   CompressedDataSize  is known once the data is written, so its line has room for any number
#include <string>

#include "server/formats/formats.h"
#include "server/formats/lost_data.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::volume {
namespace {

constexpr size_t kSizeDigits = 20;  // of the longest u64

std::string_view mha_type(SampleType type) {
  switch (type) {
    case SampleType::kUint8:
      return "MET_UCHAR";
    case SampleType::kInt8:
      return "MET_CHAR";
    case SampleType::kUint16:
      return "MET_USHORT";
    case SampleType::kFloat32:
      return "MET_FLOAT";
  }
  return {};
}

std::string mha_header(const Grid& grid, std::optional<Channel> channel, const ArrayType& type,
                       uint64_t data_bytes) {
  const GridSpec& spec = grid.spec;
  const std::string size = std::to_string(data_bytes);
  const std::string units = units_of(grid);
  std::string text = "ObjectType = Image\nNDims = 3\n";
  text += "Comment = voxeld " + std::string(array_name(channel)) +
          (units.empty() ? "" : " in " + units) + "\n";
  text += "BinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = True\n";
  text += "CompressedDataSize = " + size + std::string(kSizeDigits - size.size(), ' ') + "\n";
  text += "TransformMatrix = 1 0 0 0 1 0 0 0 1\n";
  text += "Offset = " + vector_text(first_center(spec)) + "\n";
  text += "CenterOfRotation = 0 0 0\n";
  if (has_mha_units(units)) text += "DistanceUnits = " + units + "\n";
  text += "ElementSpacing = " + vector_text(spec.voxel_size) + "\n";
  text += "DimSize = " + std::to_string(spec.dims.x) + " " + std::to_string(spec.dims.y) + " " +
          std::to_string(spec.dims.z) + "\n";
  text += "ElementNumberOfChannels = " + std::to_string(type.components) + "\n";
  text += "ElementType = " + std::string(mha_type(type.sample)) + "\n";
  return text + "ElementDataFile = LOCAL\n";
}

}  // namespace
}  // namespace voxeld::volume

namespace voxeld {

Status encode_mha(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace volume;
  const std::optional<Channel> channel = options.channel;
  const ArrayType type = array_type(channel, options);
  VOXELD_TRY(file.append(text_bytes(mha_header(grid, channel, type, 0))));
  const uint64_t begin = file.size();
  DeflateStream stream(file, DeflateStream::Frame::kZlib);
  VOXELD_TRY(stream.begin());
  VOXELD_TRY(append_pieces(stream, VolumeArray(grid, channel, options)));
  VOXELD_TRY(stream.finish());
  return file.replace(0, text_bytes(mha_header(grid, channel, type, file.size() - begin)));
}

}  // namespace voxeld
