// Writes a mesh as an input deck of Abaqus and CalculiX, lines of text:
//
//   *HEADING                             one line
//   ** dims, origin, voxel_size, ...     comments
//   *NODE                                number,x,y,z: the corners of voxels in world units
//   *ELEMENT, TYPE=C3D8, ELSET=voxels    number and 8 nodes; voxels in the order of sparse arrays
//   ** label 1: name                     comment
//   *ELSET, ELSET=name                   numbers of elements, 16 a line; one set for each label, or
//                                        for each material if the grid has no labels
//
// Numbers begin at 1. Voxels without an id, as those of full nodes, are in set `voxels` alone. The
// other channels are not written. Sources: Abaqus Analysis User's Guide, "Input Syntax Rules";
// CalculiX CrunchiX User's Manual, "Input deck format" (http://www.dhondt.de/ccx_2.20.pdf).
#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/options/values.h"
#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/cells/hexahedra.h"
#include "server/formats/formats.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::cells {
namespace {

// Characters of a number: CalculiX ignores those behind them, even if they are the exponent.
constexpr size_t kInpNumberMax = 20;
constexpr size_t kInpNameMax = 80;      // characters of the name of a set
constexpr size_t kInpSetLine = 16;      // elements in a line of a set
constexpr size_t kInpCommentMax = 200;  // bytes of a comment; lines have at most 256
constexpr std::string_view kInpAllVoxels = "voxels";

// Appends make(0), make(1), ... which are made on all threads.
template <typename Make>
Status append_texts(OutputFile& file, size_t count, Make&& make) {
  const size_t batch = ThreadPool::shared().threads();
  for (size_t begin = 0; begin < count; begin += batch) {
    std::vector<std::string> texts(std::min(batch, count - begin));
    ThreadPool::shared().for_each(texts.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      texts[i] = make(begin + i);
    });
    for (const std::string& text : texts) VOXELD_TRY(file.append(volume::text_bytes(text)));
  }
  return {};
}

// Writes a number and the character behind it. Returns the end.
char* put_number(char* at, uint64_t number, char behind) {
  constexpr size_t kDigitsMax = 20;
  at = std::to_chars(at, at + kDigitsMax, number).ptr;
  *at++ = behind;
  return at;
}

// The shortest text that reads back as the same double, or if it is too long, with fewer digits.
std::string inp_number(double value) {
  std::string text = option_values::to_text(value);
  for (int digits = 16; text.size() > kInpNumberMax; --digits) {
    std::array<char, 32> buffer{};
    const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                   std::chars_format::general, digits)
                         .ptr;
    text.assign(buffer.data(), end);
  }
  return text;
}

// A line of comment for each kInpCommentMax bytes of a text, cut between characters of UTF-8.
std::string inp_comment(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  }
  std::string lines;
  while (!text.empty()) {
    size_t length = std::min(text.size(), kInpCommentMax);
    const auto is_inside = [&](size_t at) {
      return at < text.size() && (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80;
    };
    for (size_t back = 0; back < 3 && is_inside(length); ++back) --length;
    lines += "** " + text.substr(0, length) + "\n";
    text.erase(0, length);
  }
  return lines;
}

std::string inp_heading(const Grid& grid, const Hexahedra& mesh) {
  std::string text = "*HEADING\nvoxeld: " + std::to_string(mesh.voxels().voxel_count()) +
                     " voxels, " + std::to_string(mesh.node_count()) + " nodes\n";
  for (const std::string& line : mesh::placement_lines(grid)) text += inp_comment(line);
  return text;
}

Status append_nodes(OutputFile& file, const Hexahedra& mesh) {
  // A coordinate is one of a few thousand, so their texts are made once.
  std::array<std::vector<std::string>, 3> coordinates;
  const GridSpec& spec = mesh.grid().spec;
  for (int axis = 0; axis < 3; ++axis) {
    for (int p = 0; p <= spec.dims[axis]; ++p) {
      const double world = spec.world_from_grid(glm::dvec3(p))[axis];
      coordinates[static_cast<size_t>(axis)].push_back("," + inp_number(world));
    }
  }
  VOXELD_TRY(file.append(volume::text_bytes("*NODE\n")));
  return append_texts(file, mesh.node_piece_count(), [&](size_t piece) {
    constexpr size_t kNodeBytes = 48;  // about
    std::string text;
    uint32_t node = mesh.node_begin(piece);
    text.reserve(kNodeBytes * (mesh.node_begin(piece + 1) - node));
    mesh.for_each_node(piece, [&](const std::array<int32_t, 3>& p) {
      std::array<char, 24> digits{};
      text.append(digits.data(), std::to_chars(digits.begin(), digits.end(), ++node).ptr);
      for (size_t axis = 0; axis < 3; ++axis) {
        text += coordinates[axis][static_cast<size_t>(p[axis])];
      }
      text += '\n';
    });
    return text;
  });
}

Status append_elements(OutputFile& file, const Hexahedra& mesh) {
  VOXELD_TRY(file.append(
      volume::text_bytes("*ELEMENT, TYPE=C3D8, ELSET=" + std::string(kInpAllVoxels) + "\n")));
  return append_texts(file, mesh.voxels().count(), [&](size_t piece) {
    constexpr size_t kElementBytes = 80;  // about
    std::string text;
    uint64_t element = mesh.voxels().begin(piece);
    text.reserve(kElementBytes * (mesh.voxels().begin(piece + 1) - element));
    mesh.for_each_cell(piece, [&](const Corners& corners) {
      std::array<char, 11 * (kCorners + 1)> line{};
      char* end = put_number(line.data(), ++element, ',');
      for (const uint32_t corner : corners) end = put_number(end, uint64_t{corner} + 1, ',');
      end[-1] = '\n';
      text.append(line.data(), end);
    });
    return text;
  });
}

// The names of sets. Letter case does not distinguish them.
class InpSetNames {
 public:
  InpSetNames(const Grid& grid, Channel channel)
      : kind_(channel_info(channel).name),
        names_(volume::names_of_ids(grid, channel)),
        used_({std::string(kInpAllVoxels)}) {}

  std::string name_of(uint16_t id) const { return id < names_.size() ? names_[id] : ""; }
  // The name as one of a set, which no other set has: at most kInpNameMax letters, digits and `_`,
  // a letter first.
  std::string take(uint16_t id) {
    const std::string number = "_" + std::to_string(id);
    const std::string base = legal(name_of(id));
    std::string name = base.empty() ? kind_ + number : base.substr(0, kInpNameMax);
    for (std::string suffix = number; !used_.insert(lower_case(name)).second; suffix += number) {
      name = (base.empty() ? kind_ : base).substr(0, kInpNameMax - suffix.size()) + suffix;
    }
    return name;
  }

 private:
  static bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
  static bool is_digit(char c) { return c >= '0' && c <= '9'; }
  static std::string lower_case(std::string text) {
    for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return text;
  }
  // Empty: no letter and no digit is left.
  std::string legal(const std::string& name) const {
    std::string text;
    for (const char c : name) {
      if ((static_cast<unsigned char>(c) & 0xc0) == 0x80) continue;  // of a character before it
      text += is_letter(c) || is_digit(c) ? c : '_';
    }
    if (text.find_first_not_of('_') == std::string::npos) return {};
    return is_letter(text.front()) ? text : kind_ + '_' + text;
  }

  std::string kind_;  // "label" or "material"
  std::vector<std::string> names_;
  std::set<std::string> used_;  // in lower case
};

// Numbers of elements from 1, by id.
std::vector<std::vector<uint32_t>> elements_by_id(const VoxelPieces& voxels, Channel channel) {
  std::vector<std::vector<uint32_t>> elements;
  uint32_t element = 0;
  for (size_t piece = 0; piece < voxels.count(); ++piece) {
    cancel_point();
    voxels.for_each_brick(
        piece, [&](const SparseTile& tile, uint32_t, const BrickMask& mask, size_t attribute) {
          uint32_t count = 0;
          for (const uint64_t word : mask.words)
            count += static_cast<uint32_t>(std::popcount(word));
          const uint32_t first = element + 1;
          element += count;
          if (attribute == kNoAttributes) return;
          const std::vector<uint16_t>& ids = id_samples(tile, channel);
          for (uint32_t i = 0; i < count; ++i) {
            const uint16_t id = ids[attribute + i];
            if (id == 0) continue;
            if (id >= elements.size()) elements.resize(size_t{id} + 1);
            elements[id].push_back(first + i);
          }
        });
  }
  return elements;
}

std::string set_lines(std::span<const uint32_t> elements) {
  std::string text;
  std::array<char, 11 * kInpSetLine> line{};
  for (size_t begin = 0; begin < elements.size(); begin += kInpSetLine) {
    char* end = line.data();
    const size_t last = std::min(begin + kInpSetLine, elements.size()) - 1;
    for (size_t i = begin; i < last; ++i) end = put_number(end, elements[i], ',');
    end = put_number(end, elements[last], '\n');
    text.append(line.data(), end);
  }
  return text;
}

Status append_sets(OutputFile& file, const VoxelPieces& voxels, Channel channel) {
  constexpr size_t kPartElements = kInpSetLine << 12;
  const std::vector<std::vector<uint32_t>> elements = elements_by_id(voxels, channel);
  InpSetNames names(voxels.grid(), channel);
  for (size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].empty()) continue;
    const auto id = static_cast<uint16_t>(i);
    std::string comment = std::string(channel_info(channel).name) + " " + std::to_string(id);
    if (const std::string name = names.name_of(id); !name.empty()) comment += ": " + name;
    VOXELD_TRY(file.append(
        volume::text_bytes(inp_comment(comment) + "*ELSET, ELSET=" + names.take(id) + "\n")));
    const std::span all(elements[i]);
    const size_t parts = (all.size() + kPartElements - 1) / kPartElements;
    VOXELD_TRY(append_texts(file, parts, [&](size_t part) {
      const size_t begin = part * kPartElements;
      return set_lines(all.subspan(begin, std::min(kPartElements, all.size() - begin)));
    }));
  }
  return {};
}

}  // namespace
}  // namespace voxeld::cells

namespace voxeld {

Status encode_inp(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  using namespace cells;
  const VoxelPieces voxels(grid);
  if (voxels.voxel_count() > kXyzPointsMax) {
    return Error{ErrorCode::kGridTooLarge, "inp: too many voxels for lines",
                 "at most " + std::to_string(kXyzPointsMax), std::to_string(voxels.voxel_count())};
  }
  const Hexahedra mesh(voxels);
  VOXELD_TRY(file.append(volume::text_bytes(inp_heading(grid, mesh))));
  VOXELD_TRY(append_nodes(file, mesh));
  VOXELD_TRY(append_elements(file, mesh));
  for (const Channel channel : {Channel::kLabel, Channel::kMaterial}) {
    if (grid.channels.has(channel)) return append_sets(file, voxels, channel);
  }
  return {};
}

}  // namespace voxeld
