// Writes VTK's .vtu, an XML file of a mesh whose arrays follow the text as bytes:
//
//   FieldData  origin and voxel_size (Float64), dims (Int32), and texts in UTF-8: units, up ("y"),
//              labels, materials (the names by id, each ended by a zero byte) and meta as JSON
//   Points     the corners of voxels in world units, each once: Float32, or Float64 where floats
//              are too coarse
//   Cells      connectivity and offsets (Int32), types: 12, VTK_HEXAHEDRON
//   CellData   cell: x, y, z of the voxel (Int32), and each channel, as a .vti has them
//   AppendedData, raw
//
// Voxels have the order of sparse arrays (Morton). Voxels of full nodes have what these arrays have
// for them: zeros, coverage 1 and the largest distance inside. Texts are arrays of UInt8, since
// meshio fails at VTK's arrays of strings. Source:
// https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/formats/cells/hexahedra.h"
#include "server/formats/cells/vtk_document.h"
#include "server/formats/formats.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/npy/sample_writers.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::cells {
namespace {

constexpr uint8_t kVtkHexahedron = 12;

// Bytes in memory as one piece.
class FieldBytes : public ArrayPieces {
 public:
  explicit FieldBytes(std::vector<uint8_t> bytes) : bytes_(std::move(bytes)) {}
  size_t piece_count() const override { return 1; }
  uint64_t piece_begin(size_t piece) const override { return piece == 0 ? 0 : bytes_.size(); }
  void fill(size_t /*piece*/, std::span<uint8_t> bytes) const override {
    std::ranges::copy(bytes_, bytes.begin());
  }
  Repeats repeats() const override { return Repeats::anywhere(); }

 private:
  std::vector<uint8_t> bytes_;
};

template <typename Number>
class NodePoints : public ArrayPieces {
 public:
  explicit NodePoints(const Hexahedra& mesh) : mesh_(mesh) {}
  size_t piece_count() const override { return mesh_.node_piece_count(); }
  uint64_t piece_begin(size_t piece) const override {
    return uint64_t{mesh_.node_begin(piece)} * kPointBytes;
  }
  void fill(size_t piece, std::span<uint8_t> bytes) const override {
    uint8_t* out = bytes.data();
    mesh_.for_each_node(piece, [&](const std::array<int32_t, 3>& p) {
      const glm::dvec3 world = mesh_.grid().spec.world_from_grid(glm::dvec3(p[0], p[1], p[2]));
      const std::array<Number, 3> point = {
          static_cast<Number>(world.x), static_cast<Number>(world.y), static_cast<Number>(world.z)};
      std::memcpy(out, point.data(), kPointBytes);
      out += kPointBytes;
    });
  }
  Repeats repeats() const override { return Repeats::anywhere(); }

 private:
  static constexpr size_t kPointBytes = 3 * sizeof(Number);
  const Hexahedra& mesh_;
};

class CellCorners : public ArrayPieces {
 public:
  explicit CellCorners(const Hexahedra& mesh) : mesh_(mesh) {}
  size_t piece_count() const override { return mesh_.voxels().count(); }
  uint64_t piece_begin(size_t piece) const override {
    return mesh_.voxels().begin(piece) * sizeof(Corners);
  }
  void fill(size_t piece, std::span<uint8_t> bytes) const override {
    uint8_t* out = bytes.data();
    mesh_.for_each_cell(piece, [&](const Corners& corners) {
      std::memcpy(out, corners.data(), sizeof corners);
      out += sizeof corners;
    });
  }
  Repeats repeats() const override { return Repeats::rows(sizeof(uint32_t)); }

 private:
  const Hexahedra& mesh_;
};

// Numbers of voxels that follow from the voxel's number alone.
template <typename Number, typename Of>
class CellNumbers : public ArrayPieces {
 public:
  CellNumbers(const VoxelPieces& voxels, const Repeats& repeats, Of of)
      : voxels_(voxels), repeats_(repeats), of_(of) {}
  size_t piece_count() const override { return voxels_.count(); }
  uint64_t piece_begin(size_t piece) const override {
    return voxels_.begin(piece) * sizeof(Number);
  }
  void fill(size_t piece, std::span<uint8_t> bytes) const override {
    uint64_t voxel = voxels_.begin(piece);
    for (size_t at = 0; at < bytes.size(); at += sizeof(Number)) put(&bytes[at], of_(voxel++));
  }
  Repeats repeats() const override { return repeats_; }

 private:
  const VoxelPieces& voxels_;
  Repeats repeats_;
  Of of_;
};

template <typename Number, typename Of>
std::unique_ptr<ArrayPieces> cell_numbers(const VoxelPieces& voxels, const Repeats& repeats,
                                          Of of) {
  return std::make_unique<CellNumbers<Number, Of>>(voxels, repeats, of);
}

// Distances in world units, as those of VolumeArray.
class CellDistances : public ArrayPieces {
 public:
  CellDistances(SparseArray rows, double scale) : rows_(std::move(rows)), scale_(scale) {}
  size_t piece_count() const override { return rows_.piece_count(); }
  uint64_t piece_begin(size_t piece) const override { return rows_.piece_begin(piece); }
  void fill(size_t piece, std::span<uint8_t> bytes) const override {
    rows_.fill(piece, bytes);
    for (size_t at = 0; at < bytes.size(); at += sizeof(float)) {
      float distance = 0;
      std::memcpy(&distance, &bytes[at], sizeof distance);
      put(&bytes[at], static_cast<float>(distance * scale_));
    }
  }
  Repeats repeats() const override { return rows_.repeats(); }

 private:
  SparseArray rows_;
  double scale_;
};

// Scalars have no NumberOfComponents: meshio reads them as columns otherwise.
std::string array_attributes(std::string_view type, std::string_view name, size_t components) {
  std::string text = "type=\"" + std::string(type) + "\" Name=\"" + std::string(name) + "\"";
  if (components > 1) text += " NumberOfComponents=\"" + std::to_string(components) + "\"";
  return text;
}

template <typename Number>
void add_field_vector(VtkDocument& document, std::string_view type, std::string_view name,
                      const std::array<Number, 3>& values) {
  std::vector<uint8_t> bytes(sizeof values);
  std::memcpy(bytes.data(), values.data(), bytes.size());
  document.add_array(array_attributes(type, name, values.size()) + " NumberOfTuples=\"1\"",
                     std::make_unique<FieldBytes>(std::move(bytes)));
}

void add_field_text(VtkDocument& document, std::string_view name, std::string_view text) {
  document.add_array(array_attributes("UInt8", name, 1) + " NumberOfTuples=\"" +
                         std::to_string(text.size()) + "\"",
                     std::make_unique<FieldBytes>(std::vector<uint8_t>(text.begin(), text.end())));
}

void add_fields(VtkDocument& document, const Grid& grid) {
  const GridHeader header = container_header(grid);
  document.add_text("<FieldData>\n");
  add_field_vector(document, "Float64", "origin", header.origin);
  add_field_vector(document, "Float64", "voxel_size", header.voxel_size);
  add_field_vector(document, "Int32", "dims", header.dims);
  if (const std::string units = volume::units_of(grid); !units.empty()) {
    add_field_text(document, "units", units);
  }
  add_field_text(document, "up", "y");
  for (const auto& [name, channel] :
       {std::pair{"labels", Channel::kLabel}, {"materials", Channel::kMaterial}}) {
    std::string joined;
    for (const std::string& of_id : volume::names_of_ids(grid, channel)) {
      joined += of_id.substr(0, of_id.find('\0')) + '\0';
    }
    if (!joined.empty()) add_field_text(document, name, joined);
  }
  add_field_text(document, "meta", grid.meta.text());
  document.add_text("</FieldData>\n");
}

void add_mesh(VtkDocument& document, const Hexahedra& mesh) {
  document.add_text("<Points>\n");
  if (mesh::fits_float(mesh.grid().spec)) {
    document.add_array(array_attributes("Float32", "Points", 3),
                       std::make_unique<NodePoints<float>>(mesh));
  } else {
    document.add_array(array_attributes("Float64", "Points", 3),
                       std::make_unique<NodePoints<double>>(mesh));
  }
  document.add_text("</Points>\n<Cells>\n");
  document.add_array(array_attributes("Int32", "connectivity", 1),
                     std::make_unique<CellCorners>(mesh));
  document.add_array(
      array_attributes("Int32", "offsets", 1),
      cell_numbers<int32_t>(mesh.voxels(), Repeats::rows(sizeof(int32_t)), [](uint64_t voxel) {
        return static_cast<int32_t>((voxel + 1) * kCorners);
      }));
  document.add_array(array_attributes("UInt8", "types", 1),
                     cell_numbers<uint8_t>(mesh.voxels(), Repeats::runs(),
                                           [](uint64_t) { return kVtkHexahedron; }));
  document.add_text("</Cells>\n");
}

std::string_view vtu_type(volume::SampleType type) {
  switch (type) {
    case volume::SampleType::kUint8:
      return "UInt8";
    case volume::SampleType::kInt8:
      return "Int8";
    case volume::SampleType::kUint16:
      return "UInt16";
    case volume::SampleType::kFloat32:
      return "Float32";
  }
  return {};
}

void add_cell_data(VtkDocument& document, const VoxelPieces& voxels, const OutputOptions& options) {
  document.add_text("<PointData/>\n<CellData>\n");
  document.add_array(array_attributes("Int32", "cell", 3),
                     std::make_unique<SparseArray>(SparseArray::coords(voxels, std::nullopt)));
  for (const ChannelInfo& info : kChannels) {
    if (!voxels.grid().channels.has(info.channel)) continue;
    const volume::ArrayType type = volume::array_type(info.channel, options);
    const std::string attributes =
        array_attributes(vtu_type(type.sample), info.name, type.components);
    SparseArray rows(voxels, info.channel, options);
    if (info.kind == ChannelKind::kDistance) {
      document.add_array(attributes, std::make_unique<CellDistances>(
                                         std::move(rows), volume::distance_scale(voxels.grid())));
    } else {
      document.add_array(attributes, std::make_unique<SparseArray>(std::move(rows)));
    }
  }
  document.add_text("</CellData>\n");
}

}  // namespace
}  // namespace voxeld::cells

namespace voxeld {

Status encode_vtu(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace cells;
  const VoxelPieces voxels(grid);
  VOXELD_TRY(check_hexahedra(voxels.voxel_count(), Format::kVtu));
  const Hexahedra mesh(voxels);
  VtkDocument document("UnstructuredGrid");
  document.add_text("<UnstructuredGrid>\n");
  add_fields(document, grid);
  document.add_text("<Piece NumberOfPoints=\"" + std::to_string(mesh.node_count()) +
                    "\" NumberOfCells=\"" + std::to_string(voxels.voxel_count()) + "\">\n");
  add_mesh(document, mesh);
  add_cell_data(document, voxels, options);
  document.add_text("</Piece>\n</UnstructuredGrid>\n");
  return document.write(file);
}

}  // namespace voxeld
