// Readers of palette files. The result is what the option `palette` takes (proto/palette.h).
//
//   format                    extension   told by
//   GIMP                      .gpl        "GIMP Palette"
//   Paint Shop Pro            .pal        "JASC-PAL"
//   Microsoft RIFF            .pal        "RIFF"
//   Adobe color table         .act        the extension
//   Adobe color swatches      .aco        the extension
//   Adobe Swatch Exchange     .ase        "ASEF"
//   digits, a colour a line   .hex        the extension
//   image                     .png        the signature
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/palette.h"
#include "proto/result.h"

namespace voxeld {

// A larger file is no palette; it is refused before it is read.
inline constexpr size_t kPaletteFileBytesMax = size_t{4} << 20;

// Reads the colours of a file in its order, without repeated ones: at least one, at most
// kPaletteColorsMax. Of an image with a palette these are its entries, of another image its colours
// by rows from the top. Entries and pixels with alpha 0 are skipped. `filename` chooses formats
// without a signature and begins the errors.
// Errors: invalid-option with the file, the line or byte, the expected and the given.
Result<std::vector<PaletteColor>> read_palette(std::span<const uint8_t> bytes,
                                               std::string_view filename);

}  // namespace voxeld
