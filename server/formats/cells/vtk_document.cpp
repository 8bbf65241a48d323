#include "server/formats/cells/vtk_document.h"

#include <utility>

#include "server/formats/volume/volume_facts.h"
#include "server/formats/volume/vtk_blocks.h"

namespace voxeld::cells {
namespace {

constexpr size_t kVtkOffsetDigits = 20;  // of the longest u64

}  // namespace

VtkDocument::VtkDocument(std::string_view type)
    : texts_({"<?xml version=\"1.0\"?>\n<VTKFile type=\"" + std::string(type) +
              "\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\""
              " compressor=\"vtkZLibDataCompressor\">\n"}) {}

void VtkDocument::add_array(std::string_view attributes, std::unique_ptr<ArrayPieces> array) {
  texts_.back() += "<DataArray " + std::string(attributes) + " format=\"appended\" offset=\"";
  texts_.emplace_back("/>\n");
  arrays_.push_back(std::move(array));
}

std::string VtkDocument::text(const std::vector<uint64_t>& offsets) const {
  std::string text = texts_.front();
  for (size_t i = 0; i < offsets.size(); ++i) {
    const std::string digits = std::to_string(offsets[i]);
    text += digits + '"' + std::string(kVtkOffsetDigits - digits.size(), ' ') + texts_[i + 1];
  }
  return text + "<AppendedData encoding=\"raw\">\n_";
}

Status VtkDocument::write(OutputFile& file) const {
  std::vector<uint64_t> offsets(arrays_.size());
  const uint64_t begin = text(offsets).size();
  VOXELD_TRY(file.extend(begin));
  for (size_t i = 0; i < arrays_.size(); ++i) {
    offsets[i] = file.size() - begin;
    VOXELD_TRY(volume::append_vtk_array(file, *arrays_[i]));
  }
  VOXELD_TRY(file.append(volume::text_bytes("\n</AppendedData>\n</VTKFile>\n")));
  return file.replace(0, volume::text_bytes(text(offsets)));
}

}  // namespace voxeld::cells
