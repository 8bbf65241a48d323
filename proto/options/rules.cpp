#include "proto/options/rules.h"

#include <algorithm>
#include <array>
#include <string>

#include "proto/minecraft_blocks.h"
#include "proto/options/values.h"
#include "proto/options/words.h"

namespace voxeld {
namespace {

using namespace option_values;
namespace words = option_words;

constexpr double kDefaultBandThickness = 3.0;                  // voxels
constexpr size_t kVoxColorsMax = 255;                          // entry 0 is the empty cell
constexpr int kDefaultSheetSide = 160;                         // pixels of one image of a sheet
constexpr double kIsometricElevationDeg = 35.264389682754654;  // atan(1 / sqrt(2))

// A request whose options are parsed one by one.
struct Parsed {
  const RequestOptions& options;
  OptionScope scope;
  const GivenOptions& given;

  bool gives(std::string_view name) const { return given.contains(name); }
  // The first of `names` that the request gives; empty: none.
  std::string_view first_of(std::initializer_list<std::string_view> names) const {
    const auto* found = std::ranges::find_if(names, [&](auto name) { return gives(name); });
    return found == names.end() ? std::string_view() : *found;
  }
  std::string_view fill() const { return word_of<Fill>(options.voxelize.fill, words::kFill); }
  std::string_view image() const { return word_of<ImageKind>(options.render.image, words::kImage); }
};

// Requests for frames of a mesh that name no animation take the first one: a frame of an image, and
// images of several grids that are not a turntable.
void complete_animation(RequestOptions& options, OptionScope scope, const GivenOptions& given) {
  const RenderOptions& render = options.render;
  const bool shows_frames =
      scope == OptionScope::kRenderMesh &&
      (given.contains("frame") || (render.image != ImageKind::kPng && render.turntable == 0));
  const bool is_of_mesh = scope == OptionScope::kRenderMesh || scope == OptionScope::kVoxelize;
  AnimationOptions& animation = options.animation;
  if (!is_of_mesh || animation.animation || !(animation.moves() || shows_frames)) return;
  animation.animation = "0";
}

void complete_style(RenderOptions& render, const GivenOptions& given) {
  const StyleDefaults defaults = style_defaults(render.style);
  const auto complete_one = [&](std::string_view name, auto& member, auto value) {
    if (!given.contains(name)) member = value;
  };
  complete_one("projection", render.projection, defaults.projection);
  complete_one("azimuth", render.azimuth_deg, defaults.azimuth_deg);
  complete_one("elevation", render.elevation_deg, defaults.elevation_deg);
  complete_one("occlusion", render.occlusion, defaults.occlusion);
  complete_one("shadow", render.shadow, defaults.shadow);
  complete_one("ground", render.ground, defaults.ground);
  // A gradient would take most of the 256 colours.
  if (render.image == ImageKind::kGif && render.style != Style::kBlueprint) {
    complete_one("background", render.background, std::array<uint8_t, 4>{255, 255, 255, 255});
  }
}

void complete(RequestOptions& options, OptionScope scope, const GivenOptions& given) {
  complete_style(options.render, given);
  if (options.voxelize.fill == Fill::kBand && !given.contains("thickness")) {
    options.voxelize.thickness = kDefaultBandThickness;
  }
  if (options.render.image == ImageKind::kSheet) {
    if (!given.contains("width")) options.render.width = kDefaultSheetSide;
    if (!given.contains("height")) options.render.height = kDefaultSheetSide;
  }
  complete_animation(options, scope, given);
}

// Options without effect are refused: they are more likely a mistake.

Status sign_needs_inside_or_distance(const Parsed& request) {
  const VoxelizeOptions& v = request.options.voxelize;
  if (!request.gives("sign") || v.has_inside() || v.measures()) return {};
  return invalid("sign", "fill solid or shell or channel distance with it", request.fill());
}

Status coverage_needs_surface_or_solid(const Parsed& request) {
  const VoxelizeOptions& v = request.options.voxelize;
  if (!v.names(Channel::kCoverage) || v.fill == Fill::kSurface || v.fill == Fill::kSolid) return {};
  return invalid("channels", "fill surface or solid with coverage", request.fill());
}

Status coverage_of_solid_excludes_flood(const Parsed& request) {
  const VoxelizeOptions& v = request.options.voxelize;
  if (!v.names(Channel::kCoverage) || v.fill != Fill::kSolid || v.sign != Sign::kFlood) return {};
  return invalid("sign", "parity, nonzero, majority, winding or auto with coverage", "flood");
}

Status thickness_needs_shell_or_band(const Parsed& request) {
  const Fill fill = request.options.voxelize.fill;
  if (!request.gives("thickness") || fill == Fill::kShell || fill == Fill::kBand) return {};
  return invalid("thickness", "fill shell or band with it", request.fill());
}

Status interior_needs_inside(const Parsed& request) {
  if (!request.gives("interior") || request.options.voxelize.has_inside()) return {};
  return invalid("interior", "fill solid or shell with it", request.fill());
}

Status labels_need_channel_label(const Parsed& request) {
  if (!request.gives("labels") || request.options.voxelize.names(Channel::kLabel)) return {};
  return invalid("labels", "channel label with it", "channels without it");
}

Status distance_needs_channel_distance(const Parsed& request) {
  if (!request.gives("distance") || request.options.voxelize.measures()) return {};
  return invalid("distance", "channel distance with it", "channels without it");
}

Status time_excludes_frames(const Parsed& request) {
  const std::string_view other = request.first_of({"frames", "fps", "times"});
  if (!request.gives("time") || other.empty()) return {};
  return invalid("time", "neither frames, fps nor times with it", other);
}

Status times_exclude_frames_and_fps(const Parsed& request) {
  const std::string_view other = request.first_of({"frames", "fps"});
  if (!request.gives("times") || other.empty()) return {};
  return invalid("times", "neither frames nor fps with it", other);
}

Status root_motion_needs_animation(const Parsed& request) {
  if (!request.gives("root_motion") || request.options.animation.moves()) return {};
  return invalid("root_motion", "animation, time, frames, fps or times with it", "none of them");
}

Status blueprint_has_no_light(const Parsed& request) {
  if (request.options.render.style != Style::kBlueprint) return {};
  const RenderOptions& render = request.options.render;
  const std::string_view other = render.occlusion  ? "occlusion"
                                 : render.shadow   ? "shadow"
                                 : render.ground   ? "ground"
                                 : render.exposure ? "exposure"
                                                   : "";
  if (other.empty()) return {};
  return invalid("style", "another style with " + std::string(other), "blueprint");
}

Status exposure_needs_colors(const Parsed& request) {
  if (!request.gives("exposure") || request.options.render.style != Style::kClay) return {};
  return invalid("exposure", "style voxel, smooth or iso with it", "clay");
}

Status rate_needs_gif_or_apng(const Parsed& request) {
  const ImageKind kind = request.options.render.image;
  if (!request.gives("rate") || kind == ImageKind::kGif || kind == ImageKind::kApng) return {};
  return invalid("rate", "image gif or apng with it", request.image());
}

Status columns_need_sheet(const Parsed& request) {
  if (!request.gives("columns") || request.options.render.image == ImageKind::kSheet) return {};
  return invalid("columns", "image sheet with it", request.image());
}

Status sparse_layout_needs_arrays(const Parsed& request) {
  const OutputOptions& output = request.options.output;
  if (output.layout != ArrayLayout::kSparse || format_info(output.format).layout.may_be_sparse) {
    return {};
  }
  return invalid("layout", "format npy or npz with it", format_name(output.format));
}

Status atlas_needs_slices(const Parsed& request) {
  const OutputOptions& output = request.options.output;
  if (output.layout != ArrayLayout::kAtlas || output.format == Format::kSlices) return {};
  return invalid("layout", "format slices with atlas", format_name(output.format));
}

Status sparse_layout_has_no_axes(const Parsed& request) {
  const OutputOptions& output = request.options.output;
  if (output.layout != ArrayLayout::kSparse || output.axes == AxisOrder::kZyx) return {};
  return invalid("axes", "zyx, or layout dense", "xyz");
}

Status mesh_needs_a_format_of_meshes(const Parsed& request) {
  const Format format = request.options.output.format;
  if (!request.gives("mesh") || format_info(format).layout.is_mesh()) return {};
  return invalid("mesh", "format glb, ply or obj with it", format_name(format));
}

Status channel_needs_a_format_of_one_array(const Parsed& request) {
  const Format format = request.options.output.format;
  if (!request.gives("channel") || format_info(format).layout.kind == FileLayout::kDenseChannel) {
    return {};
  }
  return invalid("channel", "format nrrd, mha, nii, ktx2, raw or slices with it",
                 format_name(format));
}

// Channels that the grid cannot have. Only the mesh tells whether it has colours.
Status channel_is_one_of_the_grid(const Parsed& request) {
  const VoxelizeOptions& v = request.options.voxelize;
  const std::optional<Channel> channel = request.options.output.channel;
  if (!channel || request.scope != OptionScope::kVoxelize) return {};
  const bool may_have =
      v.channels ? v.channels->has(*channel)
                 : channel == Channel::kColor || (channel == Channel::kDistance && v.measures());
  if (may_have) return {};
  const std::string_view name = channel_info(*channel).name;
  return invalid("channel", "channels with " + std::string(name), name);
}

Status instances_and_compression_need_glb(const Parsed& request) {
  const OutputOptions& output = request.options.output;
  if (output.format == Format::kGlb) return {};
  if (output.mesh == MeshSurface::kInstances) {
    return invalid("mesh", "format glb with instances", format_name(output.format));
  }
  if (output.compress == MeshCompression::kNone) return {};
  return invalid("compress", "format glb with it", format_name(output.format));
}

Status blocks_need_a_format_of_blocks(const Parsed& request) {
  const Format format = request.options.output.format;
  if (!request.gives("blocks") || holds_blocks(format)) return {};
  return invalid("blocks", "format schem, litematic or nbt with it", format_name(format));
}

// Whether files of the format hold colours and no palette of blocks.
bool takes_palette(const OutputOptions& output) {
  const FileLayout layout = format_info(output.format).layout;
  if (layout.kind == FileLayout::kDenseChannel) return output.channel == Channel::kColor;
  return layout.kind != FileLayout::kDenseOccupancy && output.format != Format::kBt &&
         output.format != Format::kInp && !holds_blocks(output.format);
}

Status palette_needs_a_format_of_colors(const Parsed& request) {
  const OutputOptions& output = request.options.output;
  if (output.palette.empty()) return {};
  if (takes_palette(output)) {
    if (output.format != Format::kVox || output.palette.size() <= kVoxColorsMax) return {};
    return invalid("palette", "at most " + std::to_string(kVoxColorsMax) + " colours of a vox",
                   std::to_string(output.palette.size()));
  }
  if (format_info(output.format).layout.kind == FileLayout::kDenseChannel) {
    return invalid("palette", "channel color with it",
                   output.channel ? channel_info(*output.channel).name : "occupancy");
  }
  return invalid("palette",
                 holds_blocks(output.format) ? "blocks instead in this format"
                                             : "a format that holds colours with it",
                 format_name(output.format));
}

Status dither_needs_a_palette(const Parsed& request) {
  const OutputOptions& output = request.options.output;
  const bool has_palette =
      output.format == Format::kVox || holds_blocks(output.format) || !output.palette.empty();
  if (output.dither == Dither::kNone || has_palette) return {};
  return invalid("dither", "format vox, schem, litematic or nbt, or colours as palette with it",
                 format_name(output.format));
}

Status schem_version_needs_schem(const Parsed& request) {
  const Format format = request.options.output.format;
  if (!request.gives("schem_version") || format == Format::kSchem) return {};
  return invalid("schem_version", "format schem with it", format_name(format));
}

Status zarr_version_needs_zarr(const Parsed& request) {
  const Format format = request.options.output.format;
  if (!request.gives("zarr_version") || format == Format::kZarr) return {};
  return invalid("zarr_version", "format zarr with it", format_name(format));
}

Status neighbors_need_a_use(const Parsed& request) {
  const OutputOptions& output = request.options.output;
  const bool is_used =
      output.keep > 0 || output.dilate > 0 || output.erode > 0 || output.hollow > 0;
  if (!request.gives("neighbors") || is_used) return {};
  return invalid("neighbors", "keep, dilate, erode or hollow with it", "none of them");
}

Status dilate_needs_no_distances(const Parsed& request) {
  if (request.scope != OptionScope::kVoxelize || request.options.output.dilate == 0) return {};
  if (!request.options.voxelize.measures()) return {};
  return invalid("dilate", "channels without distance", "distance");
}

Status remap_needs_labels(const Parsed& request) {
  if (request.scope != OptionScope::kVoxelize || request.options.output.remap.empty()) return {};
  if (request.options.voxelize.names(Channel::kLabel)) return {};
  return invalid("remap", "channels with label", "channels without it");
}

// The number of frames that the request names; 0: as many as the input has.
int frames_named(const AnimationOptions& animation) {
  if (animation.frames) return (*animation.frames)[1] - (*animation.frames)[0] + 1;
  return static_cast<int>(animation.times_s.size());
}

Status frame_is_one_of_sequence(const Parsed& request) {
  if (!request.gives("frame")) return {};
  const RequestOptions& options = request.options;
  const std::string got = std::to_string(options.render.frame);
  if (options.render.image != ImageKind::kPng) {
    return invalid("frame", "image png with it", request.image());
  }
  if (request.scope == OptionScope::kRenderMesh && !options.animation.is_sequence()) {
    return invalid("frame", "frames of an animation, and not its time", got);
  }
  const int named = frames_named(options.animation);
  if (named == 0 || options.render.frame < named) return {};
  return invalid("frame",
                 "less than " + std::to_string(named) + ", the number of frames that are asked for",
                 got);
}

Status turntable_shows_one_grid(const Parsed& request) {
  if (!request.gives("turntable")) return {};
  const RequestOptions& options = request.options;
  if (options.render.image == ImageKind::kPng) {
    return invalid("turntable", "image gif, apng or sheet with it", request.image());
  }
  if (options.render.matrix) return invalid("turntable", "a camera without matrix", "matrix");
  if (!options.animation.is_sequence()) return {};
  return invalid("turntable", "one grid: no animation, or its time", "frames of an animation");
}

Status several_images_need_frames_or_views(const Parsed& request) {
  const RenderOptions& render = request.options.render;
  const bool is_several = request.options.animation.is_sequence() || render.turntable > 0;
  if (request.scope != OptionScope::kRenderMesh || render.image == ImageKind::kPng) return {};
  if (is_several) return {};
  return invalid("image", "frames of an animation, or turntable with it", request.image());
}

Status surface_needs_rule(const Parsed& request) {
  const VoxelizeOptions& v = request.options.voxelize;
  if (v.rule != Rule::kNone || v.fill != Fill::kSurface) return {};
  return invalid("rule", "touch, thin or center where fill is surface", "none");
}

Status one_of_size_dims_and_voxel_size(const Parsed& request) {
  const PlacementOptions& p = request.options.voxelize.placement;
  const int given = (p.size ? 1 : 0) + (p.dims ? 1 : 0) + (p.voxel_size ? 1 : 0);
  if (given <= 1) return {};
  return Error{ErrorCode::kInvalidOption, "size, dims and voxel_size exclude each other",
               "at most one of them", std::to_string(given)};
}

Status padding_leaves_room(const Parsed& request) {
  const PlacementOptions& p = request.options.voxelize.placement;
  if (p.voxel_size) return {};
  const int side = p.dims ? std::ranges::min(*p.dims) : p.size.value_or(kDefaultSize);
  if (2 * p.padding < side) return {};
  return invalid(
      "padding",
      p.dims ? "less than half of each of dims" : "less than half of size " + std::to_string(side),
      std::to_string(p.padding));
}

// In the order in which they are checked: a request that breaks several gets the first one's error.
constexpr std::array kRules = {sign_needs_inside_or_distance,
                               coverage_needs_surface_or_solid,
                               coverage_of_solid_excludes_flood,
                               thickness_needs_shell_or_band,
                               interior_needs_inside,
                               labels_need_channel_label,
                               distance_needs_channel_distance,
                               time_excludes_frames,
                               times_exclude_frames_and_fps,
                               root_motion_needs_animation,
                               blueprint_has_no_light,
                               exposure_needs_colors,
                               rate_needs_gif_or_apng,
                               columns_need_sheet,
                               sparse_layout_needs_arrays,
                               atlas_needs_slices,
                               sparse_layout_has_no_axes,
                               mesh_needs_a_format_of_meshes,
                               channel_needs_a_format_of_one_array,
                               channel_is_one_of_the_grid,
                               instances_and_compression_need_glb,
                               blocks_need_a_format_of_blocks,
                               palette_needs_a_format_of_colors,
                               dither_needs_a_palette,
                               schem_version_needs_schem,
                               zarr_version_needs_zarr,
                               neighbors_need_a_use,
                               dilate_needs_no_distances,
                               remap_needs_labels,
                               frame_is_one_of_sequence,
                               turntable_shows_one_grid,
                               several_images_need_frames_or_views,
                               surface_needs_rule,
                               one_of_size_dims_and_voxel_size,
                               padding_leaves_room};

}  // namespace

StyleDefaults style_defaults(Style style) {
  StyleDefaults defaults{.projection = Projection::kPerspective,
                         .azimuth_deg = 30.0,
                         .elevation_deg = 20.0,
                         .occlusion = false,
                         .shadow = false,
                         .ground = false};
  switch (style) {
    case Style::kVoxel:
    case Style::kClay:
      defaults.occlusion = defaults.shadow = defaults.ground = true;
      break;
    case Style::kSmooth:
      break;
    case Style::kIso:
      defaults.projection = Projection::kOrthographic;
      defaults.azimuth_deg = 45.0;
      defaults.elevation_deg = kIsometricElevationDeg;
      defaults.occlusion = true;
      break;
    case Style::kBlueprint:
      defaults.projection = Projection::kOrthographic;
      break;
  }
  return defaults;
}

Status apply_option_rules(RequestOptions& options, OptionScope scope, const GivenOptions& given) {
  complete(options, scope, given);
  const Parsed request{options, scope, given};
  for (const auto& rule : kRules) VOXELD_TRY(rule(request));
  return {};
}

}  // namespace voxeld
