// Palette files: the first byte chooses a name, whose extension tells formats without a signature.
// Colours that are read must be taken by the option and come back from its text.
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "proto/options/options.h"
#include "proto/palette_files/palette_files.h"
#include "server/base/check.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr std::array<const char*, 4> kNames = {"a.act", "a.aco", "a.hex", "a"};
  if (size == 0) return 0;
  const char* const name = kNames.at(data[0] % kNames.size());
  const auto colors = voxeld::read_palette({data + 1, size - 1}, name);
  if (!colors) {
    const voxeld::Error& error = colors.error();
    VOXELD_CHECK(error.code == voxeld::ErrorCode::kInvalidOption && !error.expected.empty() &&
                     error.detail.starts_with(name),
                 "an error says where and what is expected");
    return 0;
  }
  VOXELD_CHECK(!colors->empty() && colors->size() <= voxeld::kPaletteColorsMax &&
                   *colors == voxeld::without_repeats(*colors),
               "a palette has some colours, each once");
  const auto options =
      voxeld::parse_options({{"format", "npz"}, {"palette", voxeld::palette_text(*colors)}},
                            voxeld::OptionScope::kExport);
  VOXELD_CHECK(options.ok() && options->output.palette == *colors, "the option takes the colours");
  return 0;
}
