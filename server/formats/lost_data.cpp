#include "server/formats/lost_data.h"

#include <algorithm>

#include "server/base/cancel_point.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/volume/volume_facts.h"
#include "server/grid/morphology/cut_tiles.h"

namespace voxeld {
namespace {

ChannelSet all_channels() {
  return channels_of_bits(~uint32_t{0});
}

// The data that files of a format hold.
struct Held {
  ChannelSet channels = all_channels();
  bool alpha = true;
  bool names = true;      // of ids
  bool units = true;      // those of the grid
  bool placement = true;  // origin and voxel size
  bool any_voxel_size = true;
  bool doubles = true;  // for the origin
};

Held held_by(const Grid& grid, const OutputOptions& options, const std::string& units) {
  Held held;
  held.alpha = colors_have_alpha(options);
  if (options.file_layout().kind == FileLayout::kDenseChannel) {
    held.channels = {};
    if (options.channel) held.channels.set(*options.channel);
  }
  switch (options.format) {
    case Format::kMha:
      held.names = false;
      held.units = has_mha_units(units);
      break;
    case Format::kNii:
      held.units = has_nii_units(units);
      held.doubles = false;
      break;
    case Format::kBinvox:
      held.channels = {};
      held.units = held.any_voxel_size = false;
      break;
    case Format::kCsv:
    case Format::kNvdb:
      held.names = held.units = false;
      break;
    case Format::kPcd:
      held.names = false;
      break;
    case Format::kVox:
      held.channels = {.color = true, .label = true};
      if (const auto ids = coloring_ids(grid)) held.channels.set(*ids);
      break;
    case Format::kQb:
      held.channels = {.color = true};
      held.units = held.placement = false;
      break;
    case Format::kInp:
      held.channels =
          grid.channels.label ? ChannelSet{.label = true} : ChannelSet{.material = true};
      break;
    case Format::kBt:
      held.channels = {};
      held.any_voxel_size = false;
      break;
    case Format::kLdr:
      held.channels = {.color = true};
      if (const auto ids = coloring_ids(grid)) held.channels.set(*ids);
      held.names = false;
      break;
    default:
      break;
  }
  return held;
}

bool has_transparent_voxel(const SparseTile& tile) {
  cancel_point();
  for (size_t voxel = 0; 4 * voxel < tile.color.size(); ++voxel) {
    if (tile.color[4 * voxel + 3] != UINT8_MAX && has_own_color(tile, voxel)) return true;
  }
  return false;
}

// Formats whose losses are not told elsewhere, nor known to whoever asks for them.
bool tells_losses(Format format) {
  return format != Format::kNative && format != Format::kNpy && format != Format::kNpz &&
         format != Format::kXyz;
}

// Collects the warnings of one file.
class LostData {
 public:
  LostData(const Grid& grid, const OutputOptions& options)
      : grid_(grid),
        options_(options),
        units_(volume::units_of(grid)),
        held_(held_by(grid, options, units_)) {}

  std::vector<Warning> take() {
    add_channels();
    const ChannelSet written =
        channels_of_bits(channel_bits(grid_.channels) & channel_bits(held_.channels));
    if (written.color && !held_.alpha && has_alpha(grid_))
      add("lost-alpha", "colours have no alpha");
    if (!held_.names && (written.label || written.material)) {
      add("lost-names", "ids have no names");
    }
    if (!held_.units && !units_.empty()) {
      add("lost-units", "no place for the units, which are " + units_);
    }
    add_placement();
    if (written.distance && !volume::has_world_distances(grid_)) {
      add("distance-in-voxels",
          "voxels are no cubes, so distances are in voxels; distance=world avoids it");
    }
    return std::move(warnings_);
  }

 private:
  void add(std::string code, const std::string& text) {
    warnings_.push_back({std::move(code), std::string(format_name(options_.format)) + ": " + text});
  }

  void add_channels() {
    const ChannelSet lost =
        channels_of_bits(channel_bits(grid_.channels) & ~channel_bits(held_.channels));
    if (!lost.any()) return;
    const bool is_choice = options_.file_layout().kind == FileLayout::kDenseChannel;
    add("lost-channels",
        is_choice ? "one array, without " + joined_names(lost) + " (option channel chooses it)"
                  : "no place for " + joined_names(lost));
  }

  void add_placement() {
    if (!held_.placement) add("lost-placement", "no place for origin and voxel size");
    if (!held_.doubles && !mesh::fits_float(grid_.spec)) {
      add("lost-precision", "32-bit floats are too coarse for the origin " +
                                volume::vector_text(grid_.spec.origin_world));
    }
    if (!held_.any_voxel_size && !volume::is_cubic(grid_.spec)) {
      add("not-cubes", "one size for x, y and z, which is that of x, of voxels of " +
                           volume::vector_text(grid_.spec.voxel_size));
    }
  }

  const Grid& grid_;
  const OutputOptions& options_;
  std::string units_;
  Held held_;
  std::vector<Warning> warnings_;
};

}  // namespace

std::vector<Warning> lost_data_warnings(const Grid& grid, const OutputOptions& options) {
  if (!tells_losses(options.format)) return {};
  return LostData(grid, options).take();
}

std::string joined_names(const ChannelSet& channels) {
  std::string names;
  for (const ChannelInfo& info : kChannels) {
    if (channels.has(info.channel)) names += (names.empty() ? "" : ", ") + std::string(info.name);
  }
  return names;
}

bool has_alpha(const Grid& grid) {
  return std::ranges::any_of(grid.tiles, has_transparent_voxel);
}

}  // namespace voxeld
