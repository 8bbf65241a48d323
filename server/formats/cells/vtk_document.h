// An XML file of VTK whose arrays follow the text as bytes: `_`, then each array in blocks of zlib
// streams (vtk_blocks.h).
//
// Offsets of arrays are known once they are written, so the text before them has room for the
// longest number. The room is behind the attribute and arrays have no gaps between them, as meshio
// needs it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/formats/npy/array_pieces.h"
#include "server/formats/output_file.h"

namespace voxeld::cells {

class VtkDocument {
 public:
  // type: of the data set, "UnstructuredGrid".
  explicit VtkDocument(std::string_view type);

  void add_text(std::string_view text) { texts_.back() += text; }
  // Adds the element of an array. attributes: `Name="..."` and so on.
  void add_array(std::string_view attributes, std::unique_ptr<ArrayPieces> array);
  // Errors: those of OutputFile.
  Status write(OutputFile& file) const;

 private:
  std::string text(const std::vector<uint64_t>& offsets) const;

  std::vector<std::string> texts_;  // before each array, and after the last
  std::vector<std::unique_ptr<ArrayPieces>> arrays_;
};

}  // namespace voxeld::cells
