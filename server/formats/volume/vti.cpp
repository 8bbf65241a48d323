// Writes VTK's .vti, an XML file of an image whose arrays follow the text as bytes:
//
//   ImageData  dims as an extent of cells, the grid's min corner as Origin, voxel size as Spacing;
//              grids are not turned, so there is no Direction
//   FieldData  units, up ("y"), the names of labels and materials by id, and meta as JSON: texts,
//              each ended by a zero byte
//   CellData   occupancy and each channel, x fastest, components beside each other
//   AppendedData, raw: `_`, then each array in blocks of zlib streams (vtk_blocks.h)
//
// Offsets of arrays are known once they are written, so the text before them has room for the
// longest number.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"
#include "server/formats/volume/vtk_blocks.h"

namespace voxeld::volume {
namespace {

constexpr size_t kOffsetDigits = 20;  // of the longest u64

// Texts in memory as one piece.
class TextPiece : public ArrayPieces {
 public:
  // Each text is ended by a zero byte, and cut at one that it has.
  explicit TextPiece(const std::vector<std::string>& texts) {
    for (const std::string& text : texts) {
      bytes_.insert(bytes_.end(), text.begin(), std::ranges::find(text, '\0'));
      bytes_.push_back(0);
    }
  }
  size_t piece_count() const override { return 1; }
  uint64_t piece_begin(size_t piece) const override { return piece == 0 ? 0 : bytes_.size(); }
  void fill(size_t /*piece*/, std::span<uint8_t> bytes) const override {
    std::ranges::copy(bytes_, bytes.begin());
  }
  Repeats repeats() const override { return Repeats::anywhere(); }

 private:
  std::vector<uint8_t> bytes_;
};

struct FieldText {
  std::string name;
  std::vector<std::string> values;
};

std::vector<FieldText> field_texts(const Grid& grid) {
  std::vector<FieldText> fields;
  if (const std::string units = units_of(grid); !units.empty())
    fields.push_back({"units", {units}});
  fields.push_back({"up", {"y"}});
  for (const auto& [name, channel] :
       {std::pair{"labels", Channel::kLabel}, {"materials", Channel::kMaterial}}) {
    if (auto names = names_of_ids(grid, channel); !names.empty()) {
      fields.push_back({name, std::move(names)});
    }
  }
  fields.push_back({"meta", {grid.meta.text()}});
  return fields;
}

std::vector<std::optional<Channel>> cell_arrays(const Grid& grid) {
  std::vector<std::optional<Channel>> arrays = {std::nullopt};
  for (const ChannelInfo& info : kChannels) {
    if (grid.channels.has(info.channel)) arrays.emplace_back(info.channel);
  }
  return arrays;
}

std::string_view vtk_type(SampleType type) {
  switch (type) {
    case SampleType::kUint8:
      return "UInt8";
    case SampleType::kInt8:
      return "Int8";
    case SampleType::kUint16:
      return "UInt16";
    case SampleType::kFloat32:
      return "Float32";
  }
  return {};
}

// format="appended" and the offset, of one length.
std::string place_text(uint64_t offset) {
  const std::string digits = std::to_string(offset);
  return " format=\"appended\" offset=\"" + digits + "\"" +
         std::string(kOffsetDigits - digits.size(), ' ') + "/>\n";
}

// An element of each array, without its place and end.
struct VtiText {
  std::string before_fields, before_cells, after_cells;
  std::vector<std::string> fields, cells;

  // The text up to the first array's bytes. offsets: of the fields, then of the cells' arrays.
  std::string with(const std::vector<uint64_t>& offsets) const {
    std::string text = before_fields;
    size_t next = 0;
    for (const std::string& field : fields) text += field + place_text(offsets[next++]);
    text += before_cells;
    for (const std::string& cell : cells) text += cell + place_text(offsets[next++]);
    return text + after_cells;
  }
};

VtiText text_of(const GridSpec& spec, const std::vector<FieldText>& fields) {
  const std::string extent = "0 " + std::to_string(spec.dims.x) + " 0 " +
                             std::to_string(spec.dims.y) + " 0 " + std::to_string(spec.dims.z);
  VtiText text;
  text.before_fields =
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\""
      " header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n"
      "  <ImageData WholeExtent=\"" +
      extent + "\" Origin=\"" + vector_text(spec.origin_world) + "\" Spacing=\"" +
      vector_text(spec.voxel_size) + "\">\n    <FieldData>\n";
  for (const FieldText& field : fields) {
    text.fields.push_back("      <Array type=\"String\" Name=\"" + field.name +
                          "\" NumberOfTuples=\"" + std::to_string(field.values.size()) + "\"");
  }
  text.before_cells = "    </FieldData>\n    <Piece Extent=\"" + extent +
                      "\">\n      <PointData/>\n      <CellData Scalars=\"occupancy\">\n";
  text.after_cells =
      "      </CellData>\n    </Piece>\n  </ImageData>\n"
      "  <AppendedData encoding=\"raw\">\n_";
  return text;
}

}  // namespace
}  // namespace voxeld::volume

namespace voxeld {

Status encode_vti(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace volume;
  const std::vector<FieldText> fields = field_texts(grid);
  const std::vector<std::optional<Channel>> arrays = cell_arrays(grid);
  VtiText text = text_of(grid.spec, fields);
  for (const std::optional<Channel> channel : arrays) {
    const ArrayType type = array_type(channel, options);
    text.cells.push_back("        <DataArray type=\"" + std::string(vtk_type(type.sample)) +
                         "\" Name=\"" + std::string(array_name(channel)) +
                         "\" NumberOfComponents=\"" + std::to_string(type.components) + "\"");
  }
  std::vector<uint64_t> offsets(fields.size() + arrays.size());
  const size_t begin = text.with(offsets).size();
  VOXELD_TRY(file.extend(begin));
  size_t next = 0;
  for (const FieldText& field : fields) {
    offsets[next++] = file.size() - begin;
    VOXELD_TRY(append_vtk_array(file, TextPiece(field.values)));
  }
  for (const std::optional<Channel> channel : arrays) {
    offsets[next++] = file.size() - begin;
    VOXELD_TRY(append_vtk_array(file, VolumeArray(grid, channel, options)));
  }
  VOXELD_TRY(file.append(text_bytes("\n  </AppendedData>\n</VTKFile>\n")));
  return file.replace(0, text_bytes(text.with(offsets)));
}

}  // namespace voxeld
