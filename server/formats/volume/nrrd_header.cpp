#include "server/formats/volume/nrrd_header.h"

#include "proto/options/values.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::volume {
namespace {

std::string_view nrrd_type(SampleType type) {
  switch (type) {
    case SampleType::kUint8:
      return "uint8";
    case SampleType::kInt8:
      return "int8";
    case SampleType::kUint16:
      return "uint16";
    case SampleType::kFloat32:
      return "float";
  }
  return {};
}

// A value of a key: backslashes and line ends are escaped.
std::string nrrd_value(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\') {
      escaped += "\\\\";
    } else if (c == '\n') {
      escaped += "\\n";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

// The words that each axis has, with those of the components before them.
struct NrrdAxes {
  std::string sizes, directions, kinds, centers;
};

NrrdAxes axes_of(const GridSpec& spec, std::optional<Channel> channel, size_t components) {
  NrrdAxes axes;
  if (components > 1) {
    axes.sizes = std::to_string(components) + " ";
    axes.directions = "none ";
    axes.kinds = channel == Channel::kColor ? "RGBA-color " : "3-normal ";
    axes.centers = "??? ";
  }
  const auto number = [](double value) { return option_values::to_text(value); };
  const glm::dvec3 size = spec.voxel_size;
  axes.sizes += std::to_string(spec.dims.x) + " " + std::to_string(spec.dims.y) + " " +
                std::to_string(spec.dims.z);
  axes.directions +=
      "(" + number(size.x) + ",0,0) (0," + number(size.y) + ",0) (0,0," + number(size.z) + ")";
  axes.kinds += "domain domain domain";
  axes.centers += "cell cell cell";
  return axes;
}

}  // namespace

std::string nrrd_header(const Grid& grid, std::optional<Channel> channel, const ArrayType& type,
                        const NrrdData& data) {
  const NrrdAxes axes = axes_of(grid.spec, channel, type.components);
  std::string text = "NRRD0004\n# voxeld\n";
  text += "type: " + std::string(nrrd_type(type.sample)) + "\n";
  text += std::string("dimension: ") + (type.components > 1 ? "4" : "3") + "\n";
  text += "space: 3D-right-handed\n";
  text += "sizes: " + axes.sizes + "\n";
  text += "space directions: " + axes.directions + "\n";
  text += "centers: " + axes.centers + "\n";
  text += "kinds: " + axes.kinds + "\n";
  if (type.sample_bytes > 1) text += "endian: little\n";
  text += "encoding: " + std::string(data.encoding) + "\n";
  if (!data.file.empty()) text += "data file: " + std::string(data.file) + "\n";
  const std::string units = units_of(grid);
  if (!units.empty()) {
    const std::string quoted = "\"" + units + "\"";
    text += "space units: " + quoted + " " + quoted + " " + quoted + "\n";
  }
  text += "space origin: (" + vector_text(first_center(grid.spec), ",") + ")\n";
  text += "content: " + std::string(array_name(channel)) + "\n";
  if (!units.empty()) text += "units:=" + nrrd_value(units) + "\n";
  text += "meta:=" + nrrd_value(grid.meta.text()) + "\n";
  return data.file.empty() ? text + "\n" : text;
}

}  // namespace voxeld::volume
