#include "proto/options/table.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "proto/limits.h"
#include "proto/number_text.h"
#include "proto/options/codecs.h"
#include "proto/options/words.h"

namespace voxeld {
namespace {

using namespace option_codecs;
namespace words = option_words;

// The highest level of detail: 2^14 cells are the longest side of a grid.
constexpr int kLevelMax = std::countr_zero(unsigned{limits::kGridSideMax});

constexpr OptionScope kMesh[] = {OptionScope::kVoxelize, OptionScope::kRenderMesh};
constexpr OptionScope kGridOut[] = {OptionScope::kVoxelize, OptionScope::kExport};
constexpr OptionScope kImageOut[] = {OptionScope::kRenderMesh, OptionScope::kRenderGrid};
constexpr OptionScope kAll[] = {OptionScope::kVoxelize, OptionScope::kRenderMesh,
                                OptionScope::kRenderGrid, OptionScope::kExport};

// When canonical JSON has an option that is not always there. Members that only some requests need
// are omitted from the others, whose names must not depend on them.
bool never(const RequestOptions&) {
  return false;
}
bool is_sized(const RequestOptions& options) {
  return !options.voxelize.placement.dims && !options.voxelize.placement.voxel_size;
}
bool has_inside(const RequestOptions& options) {
  return options.voxelize.has_inside();
}
bool has_sign(const RequestOptions& options) {
  return options.voxelize.has_inside() || options.voxelize.measures();
}
bool has_thickness(const RequestOptions& options) {
  return options.voxelize.fill == Fill::kShell || options.voxelize.fill == Fill::kBand;
}
bool has_labels(const RequestOptions& options) {
  return options.voxelize.names(Channel::kLabel);
}
bool moves(const RequestOptions& options) {
  return options.animation.moves();
}
bool is_coarse(const RequestOptions& options) {
  return options.output.level > 0;
}
bool is_several_images(const RequestOptions& options) {
  return options.render.image != ImageKind::kPng;
}
bool is_later_frame(const RequestOptions& options) {
  return options.render.frame > 0;
}

std::vector<Option> placement_options() {
  using P = PlacementOptions;
  return {
      {.name = "size",
       .codec = integer(&P::size, 1, limits::kGridSideMax, kDefaultSize),
       .help = "voxels on the longest side",
       .is_written = is_sized},
      {.name = "dims",
       .form = "NX,NY,NZ",
       .codec = dims(),
       .help = "cells in x, y and z, instead of size",
       .details = "Voxels are cubes and as large as fits; with `bounds`, the grid is that box."},
      {.name = "voxel_size",
       .form = "S | X,Y,Z",
       .codec = voxel_size(),
       .help = "edge of a voxel in world units, instead of size"},
      {.name = "padding",
       .codec = integer(&P::padding, 0, limits::kPaddingMax),
       .help = "empty voxels on each side, part of the size"},
      {.name = "bounds",
       .form = "X0,Y0,Z0,X1,Y1,Z1",
       .codec = bounds(),
       .help = "box of the world to voxelize",
       .default_words = "the mesh's box"},
      {.name = "up",
       .codec = word(&P::up, words::kUp),
       .help = "axis of the mesh that points up; z is turned to y"},
      {.name = "units",
       .codec = units(),
       .help = "unit of the mesh's coordinates, a label of the result"},
      {.name = "transform",
       .form = "16 numbers",
       .codec = numbers(&P::transform),
       .help = "row-major 4x4 matrix that is applied to the mesh first"},
  };
}

std::vector<Option> voxelization_options() {
  using V = VoxelizeOptions;
  return {
      {.name = "rule",
       .codec = word(&V::rule, words::kRule),
       .help =
           "voxels of a surface: all touched ones, a thin layer, centres of columns alone, or none",
       .details = "`touch`: every voxel that a triangle touches (26-separating). `thin`: about 6 "
                  "in 10 of them, without holes for paths over faces (6-separating). `center`: "
                  "where the surface passes the centres of columns along its dominant axis, with "
                  "holes. `none`: no surface, if `fill` is not `surface`."},
      {.name = "fill",
       .codec = word(&V::fill, words::kFill),
       .help = "surface alone, with all its inside, with the inside near it, or all cells near it",
       .details = "`band` has voxels on both sides of the surface."},
      {.name = "sign",
       .codec = word(&V::sign, words::kSign),
       .help = "how the inside is found, for fill solid and shell and for distances",
       .details =
           "`majority`: two of the parities along x, y and z. `auto` chooses by the mesh; the "
           "response names its choice.",
       .is_written = has_sign},
      {.name = "thickness",
       .form = "T",
       .codec = number(&V::thickness, 1, limits::kShellThicknessMax),
       .help = "thickness of a shell, or of a band to each side, in voxels",
       .default_words = "1, of a band 3",
       .is_written = has_thickness},
      {.name = "interior",
       .codec = word(&V::interior, words::kInterior),
       .help = "colour and normal of voxels inside, for fill solid and shell",
       .details = "`nearest`: those of the nearest surface voxel, for solids that are cut open.",
       .is_written = has_inside},
      {.name = "color",
       .codec = word(&V::color, words::kColor),
       .help = "colour of a voxel: area average, at the nearest point, average of the largest "
               "material, Phong light baked in, by dominant axis, or none",
       .details = "`average`: area average in linear light. `nearest`: at the surface's point "
                  "nearest to the voxel's centre. `dominant`: area average of the material with "
                  "the largest part alone. `shaded`: Phong light baked in. `axis`: red, green or "
                  "blue by dominant axis."},
      {.name = "channels",
       .form = channel_names(),
       .codec = channels(),
       .help = "list of what the grid holds for a voxel",
       .details = "`material`: id of the material with the largest part. `label`: id of what "
                  "`labels` names. `distance`: to the mesh, negative inside by `sign`. `coverage`: "
                  "area of the surface, or with `fill=solid` the part of a voxel that is inside.",
       .default_words = "occupancy, color if the mesh has it, distance of a band"},
      {.name = "labels",
       .codec = word(&V::labels, words::kLabels),
       .help = "what channel label numbers: the one with the largest part of a voxel",
       .details = "`meta` of the response names each id.",
       .is_written = has_labels},
      {.name = "pipeline",
       .codec = word(&V::pipeline, words::kPipeline),
       .help = "how the grid is computed; its bytes are always the same"},
  };
}

std::vector<Option> animation_options() {
  using A = AnimationOptions;
  return {
      {.name = "animation",
       .form = "NAME | N",
       .codec = animation_name(),
       .help = "animation of the mesh by name or number: its frames become a sequence of grids",
       .default_words = "none; the first, if another option of animations is given",
       .bytes_max = client_texts::kAnimation.bytes_max},
      {.name = "time",
       .form = "S",
       .codec = number(&A::time_s, 0, limits::kAnimationSecondsMax),
       .help = "seconds into the animation: one grid instead of a sequence"},
      {.name = "frames",
       .form = "A..B | N",
       .codec = frames(),
       .help = "frames of the animation or sequence, from 0, the last included",
       .details = "Frame k of an animation is at time k / `fps`.",
       .default_words = "all",
       .scopes = kAll},
      {.name = "fps",
       .form = "F",
       .codec = number(&A::fps, limits::kFpsMin, limits::kFpsMax),
       .help = "frames per second",
       .default_words = "the animation's own, or 24"},
      {.name = "times",
       .form = "T0,T1,...",
       .codec = times(),
       .help = "ascending seconds of the frames, instead of frames and fps",
       .details = "At most " + std::to_string(limits::kFramesMax) + ".",
       .bytes_max = client_texts::kTimes.bytes_max},
      {.name = "root_motion",
       .codec = word(&A::root_motion, words::kRootMotion),
       .help = "whether a walking model leaves the place where it began",
       .is_written = moves},
  };
}

std::vector<Option> output_options() {
  using O = OutputOptions;
  return {
      {.name = "format", .codec = format(), .help = "output format of the grid"},
      {.name = "codec",
       .codec = word(&O::codec, words::kCodec),
       .help = "compression of format native: quick, or a third of the bytes and slow"},
      {.name = "axes", .codec = word(&O::axes, words::kAxes), .help = "axis order of npy and npz"},
      {.name = "dtype",
       .codec = word(&O::dtype, words::kDType),
       .help = "sample type of npy and npz"},
      {.name = "palette",
       .codec = integer(&O::palette_max, 1, 255),
       .help = "most colours of a .vox"},
  };
}

std::vector<Option> selection_options() {
  using O = OutputOptions;
  return {
      {.name = "level",
       .codec = integer(&O::level, 0, kLevelMax),
       .help =
           "level of detail: one voxel stands for 2^N on a side; of an image, the finest one drawn",
       .is_written = is_coarse},
      {.name = "level_rule",
       .codec = word(&O::level_rule, words::kLevelRule),
       .help = "occupied cells that a voxel of a level needs: any, or at least half of them",
       .is_written = is_coarse},
      {.name = "region",
       .form = "X0,Y0,Z0,X1,Y1,Z1",
       .codec = region(),
       .help = "cells of the grid: the first ones, and those after the last",
       .default_words = "all"},
  };
}

std::vector<Option> image_options() {
  using R = RenderOptions;
  return {
      {.name = "width",
       .codec = integer(&R::width, 1, limits::kRenderSideMax),
       .help = "width of an image in pixels",
       .default_words = "512, in a sheet 160"},
      {.name = "height",
       .codec = integer(&R::height, 1, limits::kRenderSideMax),
       .help = "height of an image in pixels",
       .default_words = "512, in a sheet 160"},
      {.name = "style",
       .codec = word(&R::style, words::kStyle),
       .help = "cubes with edges, smooth surface, shape alone, fixed light from above, or outlines",
       .details = "`iso` looks from 45 and 35.26 degrees and lights tops by 1, sides by 0.78 and "
                  "0.64 and bottoms by 0.5 of their colour, so that colours compare between "
                  "images. `clay` leaves colours away."},
      {.name = "projection",
       .codec = word(&R::projection, words::kProjection),
       .help = "projection of the camera",
       .default_words = "perspective; orthographic in style iso and blueprint"},
      {.name = "azimuth",
       .form = "DEGREES",
       .codec = number(&R::azimuth_deg, -3600, 3600),
       .help = "camera's angle around +y; 0 looks from +z",
       .default_words = "30; 45 in style iso"},
      {.name = "elevation",
       .form = "DEGREES",
       .codec = number(&R::elevation_deg, -90, 90),
       .help = "camera's angle above the horizon",
       .default_words = "20; 35.26 in style iso"},
      {.name = "zoom",
       .form = "F",
       .codec = number(&R::zoom, 0.01, 1000),
       .help = "magnification: 1 fits the voxels into the image, more is closer"},
      {.name = "matrix",
       .form = "16 numbers",
       .codec = numbers(&R::matrix),
       .help =
           "row-major clip_from_world matrix, instead of projection, azimuth, elevation and zoom"},
      {.name = "background",
       .form = "#RRGGBB[AA] | transparent",
       .codec = background(),
       .help = "sRGB colour behind the grid",
       .default_words = "a light gradient; white in style smooth and in a GIF, grey in style iso, "
                        "blue in style blueprint"},
      {.name = "occlusion",
       .codec = word(&R::occlusion, words::kYesNo),
       .help = "ambient occlusion: corners are darker",
       .default_words = "yes in style voxel, clay and iso"},
      {.name = "shadow",
       .codec = word(&R::shadow, words::kYesNo),
       .help = "soft shadow of the key light",
       .default_words = "yes in style voxel and clay"},
      {.name = "ground",
       .codec = word(&R::ground, words::kYesNo),
       .help = "floor under the grid, which shows its shadow alone and fades out",
       .default_words = "yes in style voxel and clay"},
      {.name = "exposure",
       .form = "F",
       .codec = number(&R::exposure, 1, limits::kExposureMax),
       .help = "factor by which dark colours are brighter; white stays white",
       .default_words = "by the median of the colours; 1 in style iso"},
      {.name = "samples",
       .codec = samples(),
       .help = "rays along each side of a pixel; 1 is quick",
       .details = "`auto`: 2, and 1 above a million pixels."},
      {.name = "renderer",
       .codec = word(&R::renderer, words::kRenderer),
       .help = "what draws the image; auto: the GPU, or the CPU if GL is a software driver"},
      {.name = "section",
       .form = "A,B,C,D",
       .codec = section(),
       .help = "plane that cuts away the cells where A x + B y + C z + D > 0"},
  };
}

std::vector<Option> several_images_options() {
  using R = RenderOptions;
  return {
      {.name = "image",
       .codec = word(&R::image, words::kImage),
       .help = "one image, or all frames or views as an animation or side by side",
       .is_written = is_several_images},
      {.name = "frame",
       .form = "K",
       .codec = integer(&R::frame, 0, limits::kFramesMax - 1),
       .help = "image png: number of the frame among the requested ones, from 0",
       .is_written = is_later_frame},
      {.name = "turntable",
       .codec = integer(&R::turntable, limits::kTurntableViewsMin, limits::kTurntableViewsMax),
       .help = "image gif, apng and sheet: number of views around one grid"},
      {.name = "rate",
       .form = "F",
       .codec = number(&R::rate, limits::kImageRateMin, limits::kImageRateMax),
       .help = "image gif and apng: images per second",
       .default_words = "the sequence's own times; 24 for a turntable"},
      {.name = "columns",
       .codec = integer(&R::columns, 1, limits::kFramesMax),
       .help = "image sheet: images in a row",
       .default_words = "as many as rows"},
  };
}

std::vector<Option> request_options() {
  return {
      {.name = "cache",
       .codec = word(&RequestOptions::use_cache, words::kYesNo),
       .help = "whether an equal result that is stored may be used; no computes it again",
       .is_written = never},
      {.name = "filename",
       .form = "NAME",
       .codec = filename(),
       .help = "name of the input file, which tells its format",
       .default_words = "by Content-Type and the first bytes",
       .is_written = never,
       .bytes_max = client_texts::kFilename.bytes_max},
  };
}

std::vector<Option> all_options() {
  std::vector<Option> all;
  const auto add = [&](OptionGroup group, std::span<const OptionScope> scopes,
                       std::vector<Option> options) {
    for (Option& option : options) {
      option.group = group;
      if (option.scopes.empty()) option.scopes = scopes;
      all.push_back(std::move(option));
    }
  };
  add(OptionGroup::kPlacement, kMesh, placement_options());
  add(OptionGroup::kVoxelization, kMesh, voxelization_options());
  add(OptionGroup::kAnimation, kMesh, animation_options());
  add(OptionGroup::kOutput, kGridOut, output_options());
  add(OptionGroup::kSelection, kAll, selection_options());
  add(OptionGroup::kImage, kImageOut, image_options());
  add(OptionGroup::kSeveralImages, kImageOut, several_images_options());
  add(OptionGroup::kRequest, kAll, request_options());
  return all;
}

}  // namespace

bool Option::applies_to(OptionScope scope) const {
  return std::ranges::find(scopes, scope) != scopes.end();
}

std::span<const Option> option_table() {
  static const std::vector<Option> table = all_options();
  return table;
}

const Option* find_option(std::string_view name) {
  const auto found = std::ranges::find(option_table(), name, &Option::name);
  return found == option_table().end() ? nullptr : &*found;
}

Error option_does_not_apply(const Option& option) {
  return {ErrorCode::kUnknownOption,
          "option '" + std::string(option.name) + "' does not apply to this request", "", ""};
}

std::string form_text(const Option& option) {
  if (!option.form.empty()) return option.form;
  const auto* values = std::get_if<WordValues>(&option.codec.values);
  if (values == nullptr) return "N";
  std::string text;
  for (const std::string_view word : values->words) {
    text += (text.empty() ? "" : " | ") + std::string(word);
  }
  return text;
}

std::string range_text(const Option& option) {
  if (const auto* integers = std::get_if<IntegerValues>(&option.codec.values)) {
    return range_text(integers->min, integers->max);
  }
  if (const auto* numbers = std::get_if<NumberValues>(&option.codec.values)) {
    return option_values::to_text(numbers->min) + " to " + option_values::to_text(numbers->max);
  }
  return "";
}

std::string default_text(const Option& option) {
  if (!option.default_words.empty()) return option.default_words;
  const OptionText value = option.codec.write(RequestOptions{});
  if (const int* integer = std::get_if<int>(&value)) return std::to_string(*integer);
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  return "";
}

std::string flag_help(const Option& option) {
  std::string notes = range_text(option);
  if (const std::string value = default_text(option); !value.empty()) {
    notes += (notes.empty() ? "" : "; ") + std::string("default: ") + value;
  }
  return option.help + (notes.empty() ? "" : " (" + notes + ")");
}

}  // namespace voxeld
