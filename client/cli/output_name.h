// The format that an output's name asks for. A file gets only bytes of the kind that its extension
// names.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "proto/output_format.h"

namespace voxeld::cli {

struct OutputName {
  enum class Kind {
    kStdout,   // "-", or no name
    kGrid,     // of a format of grids or sequences
    kImage,    // .png, .gif or .apng
    kForeign,  // of a kind that voxel knows and does not write: .jpg, .stl
    kOther
  } kind = Kind::kStdout;
  std::string extension;            // ".vox", in lower case; may be empty
  Format format = Format::kNative;  // of kGrid: the first one with the extension

  static OutputName of(const std::string& path);
};

// Changes the letters of ASCII to lower case.
std::string lower_case(std::string text);

// Each throws CLI::ValidationError, which names the extensions that there are.

// The format for `voxel MESH -o path`: that of the extension, and `given` ("" or a name) must have
// it too; several formats write the frames of an animation as .zip. Without a name it is `given`.
std::string format_for(const std::string& path, const std::string& given);
// Checks the extension of a sequence's or a single grid's file: some formats have two.
void check_extension(const std::string& path, Format format, bool is_sequence);
// The kind of image for `voxel render -o path`: "" for a PNG without `given`.
std::string image_for(const std::string& path, const std::string& given);

}  // namespace voxeld::cli
