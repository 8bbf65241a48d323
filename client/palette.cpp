#include "client/include/voxeld/palette.h"

#include <algorithm>
#include <exception>

#include "client/c_error.h"
#include "proto/palette_files/palette_files.h"

static_assert(VOXELD_PALETTE_COLORS == voxeld::kPaletteColorsMax);

int voxeld_palette_read(const void* bytes, size_t size, const char* filename, uint8_t* colors,
                        char* error, size_t error_size) {
  try {
    const auto read = voxeld::read_palette({static_cast<const uint8_t*>(bytes), size}, filename);
    if (read) {
      for (const voxeld::PaletteColor& color : *read) colors = std::ranges::copy(color, colors).out;
      return static_cast<int>(read->size());
    }
    voxeld::set_error(read.error().message(), error, error_size);
  } catch (const std::exception& exception) {  // no memory; C knows no exceptions
    voxeld::set_error(exception.what(), error, error_size);
  }
  return 0;
}
