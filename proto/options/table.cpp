#include "proto/options/table.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "proto/limits.h"
#include "proto/minecraft_blocks.h"
#include "proto/options/codecs.h"
#include "proto/options/image_options.h"
#include "proto/options/morphology_limits.h"
#include "proto/options/words.h"
#include "proto/palette.h"
#include "proto/text/number_text.h"

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
bool has_threshold(const RequestOptions& options) {
  return options.voxelize.threshold != VoxelizeOptions{}.threshold;
}
bool has_labels(const RequestOptions& options) {
  return options.voxelize.names(Channel::kLabel);
}
bool has_world_distances(const RequestOptions& options) {
  return options.voxelize.distance == DistanceUnit::kWorld;
}
bool moves(const RequestOptions& options) {
  return options.animation.moves();
}
bool has_layout(const RequestOptions& options) {
  return options.output.layout != ArrayLayout::kDense;
}
bool is_mesh(const RequestOptions& options) {
  return options.output.file_layout().is_mesh();
}
bool is_compressed(const RequestOptions& options) {
  return options.output.compress != MeshCompression::kNone;
}
bool is_dithered(const RequestOptions& options) {
  return options.output.dither != Dither::kNone;
}
bool is_schem(const RequestOptions& options) {
  return options.output.format == Format::kSchem;
}
bool is_zarr(const RequestOptions& options) {
  return options.output.format == Format::kZarr;
}
bool is_dilated(const RequestOptions& options) {
  return options.output.dilate > 0;
}
bool is_eroded(const RequestOptions& options) {
  return options.output.erode > 0;
}
bool is_hollow(const RequestOptions& options) {
  return options.output.hollow > 0;
}
bool uses_neighbors(const RequestOptions& options) {
  return options.output.keep > 0 || is_dilated(options) || is_eroded(options) || is_hollow(options);
}
bool gives_alpha(const RequestOptions& options) {
  return options.output.alpha != AlphaRule::kAuto;
}
bool is_cropped(const RequestOptions& options) {
  return options.output.crop;
}
bool is_coarse(const RequestOptions& options) {
  return options.output.level > 0;
}
// An image may be of a level that its grid's size asks for, so a rule that is given is kept.
bool has_levels(const RequestOptions& options) {
  return is_coarse(options) || is_zarr(options) || options.output.level_rule != LevelRule::kAny;
}

// "Groups: `concrete`, …".
std::string block_groups() {
  std::string text;
  for (const std::string_view group : minecraft_block_groups()) {
    text += (text.empty() ? "Groups: `" : ", `") + std::string(group) + "`";
  }
  return text;
}

std::string palette_details() {
  std::string names;
  for (const NamedPalette& palette : named_palettes()) {
    names += (names.empty() ? "`" : ", `") + std::string(palette.name) + "` (" +
             std::string(palette.origin) + ")";
  }
  return "Colours or a name: each voxel gets the colour of the palette that is nearest in OKLab, "
         "in "
         "every format that holds colours; voxels inside of solids, which have no colour, get the "
         "mean as always. A .vox has the palette in its order. Names: " +
         names + ".";
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
       .codec = transform(),
       .help = "row-major 4x4 matrix that is applied to the mesh first; its last row is 0,0,0,1"},
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
                  "holes. `none`: no surface, if `fill` is not `surface`; voxels inside that "
                  "triangles touch have their colours."},
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
      {.name = "distance",
       .codec = word(&V::distance, words::kDistance),
       .help = "unit of channel distance: voxels along each axis, or the mesh's own unit",
       .details = "`world`: the Euclidean distance, also where the edges of a voxel differ, up to "
                  "256 shortest edges. The voxels of a band are the same with both.",
       .is_written = has_world_distances},
      {.name = "variant",
       .form = "NAME | N",
       .codec = variant_name(),
       .help = "materials of a glTF file, by name or number of one of its variants",
       .details = "A file without KHR_materials_variants is refused.",
       .default_words = "the file's own",
       .bytes_max = client_texts::kVariant.bytes_max},
      {.name = "threshold",
       .form = "F",
       .codec = number(&V::threshold, -limits::kThresholdMax, limits::kThresholdMax),
       .help = "least sample that makes a voxel, of a file of samples (npy, nrrd)",
       .is_written = has_threshold},
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
       .details = "Frame k of an animation is at time k / `fps`. One grid has none: requests for a "
                  "stored grid refuse it.",
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
      {.name = "layout",
       .codec = word(&O::layout, words::kLayout),
       .help = "arrays of npy and npz: of all cells, or with a row for each voxel; slices: in one "
               "image",
       .details = "`sparse`: `coords` with columns x, y, z, in Morton order, and a row of each "
                  "channel in the same order; `npy` has the coords alone. `atlas`, of format "
                  "slices: one image with all slices beside and below each other.",
       .is_written = has_layout},
      {.name = "axes",
       .codec = word(&O::axes, words::kAxes),
       .help = "axis order of npy and npz in layout dense"},
      {.name = "dtype",
       .codec = word(&O::dtype, words::kDType),
       .help = "sample type of npy, npz, vti, nrrd, mha, nii, raw and zarr"},
      {.name = "palette",
       .form = "N | NAME | #RRGGBB,...",
       .codec = palette(),
       .help = "colours: how many of its own a .vox has at most, or those of a palette",
       .details = palette_details(),
       .bytes_max = client_texts::kPalette.bytes_max},
      {.name = "mesh",
       .codec = word(&O::mesh, words::kMesh),
       .help =
           "surface of glb, ply and obj: squares, rectangles merged by colour, smooth, or cubes",
       .details = "`faces`: a square for each face between a voxel and an empty cell. `greedy`: "
                  "squares of one plane and colour are merged. `smooth`: surface nets on distance "
                  "or coverage of solids and distance of bands, otherwise on occupancy. "
                  "`instances`: of glb alone, a cube that the viewer draws for each voxel.",
       .is_written = is_mesh},
      {.name = "channel",
       .codec = one_channel(),
       .help = "channel whose array a nrrd, mha, nii, ktx2, raw or slices holds",
       .default_words = "occupancy"},
      {.name = "compress",
       .codec = word(&O::compress, words::kCompress),
       .help = "compression of a glb; readers need EXT_meshopt_compression",
       .is_written = is_compressed},
      {.name = "blocks",
       .form = "NAME,NAME,...",
       .codec = blocks(),
       .help = "blocks of schem, litematic and nbt: names of groups and of blocks",
       .details = block_groups() + ". A name with `minecraft:` is a block's: some groups are named "
                                   "like a block.",
       .default_words = "all"},
      {.name = "dither",
       .codec = word(&O::dither, words::kDither),
       .help = "colours that the palette lacks, of a palette, vox, schem, litematic or nbt: the "
               "nearest one, or a mixture by a pattern or by error diffusion",
       .is_written = is_dithered},
      {.name = "schem_version",
       .codec = integer(&O::schem_version, 2, 3),
       .help = "version of the Sponge schematic format of a schem",
       .is_written = is_schem},
      {.name = "zarr_version",
       .codec = integer(&O::zarr_version, 2, 3),
       .help = "version of the Zarr format of a zarr",
       .is_written = is_zarr},
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
       .is_written = has_levels},
      {.name = "region",
       .form = "X0,Y0,Z0,X1,Y1,Z1",
       .codec = region(),
       .help = "cells of the grid: the first ones, and those after the last",
       .default_words = "all"},
      {.name = "alpha",
       .codec = word(&O::alpha, words::kAlpha),
       .help = "whether voxels whose colour has alpha 0 are kept or left out",
       .details = "`auto`: left out of images and of formats whose colours have no alpha (`vox`, "
                  "`xyz`, `obj`, `pcd`, `qb`, `schem`, `litematic`, `nbt`, `ldr`, `glb` with "
                  "`mesh=instances`). After `level`, before `keep` and `hollow`. Alpha is 0 where "
                  "all texels that the voxel holds are transparent: below the `alphaCutoff` of a "
                  "glTF material in `MASK` mode.",
       .is_written = gives_alpha},
  };
}

// Images have none of these options: they are made from a grid of their own.
std::vector<Option> grid_selection_options() {
  using O = OutputOptions;
  return {
      {.name = "keep",
       .form = "largest | N",
       .codec = keep(),
       .help = "number of the largest components of voxels that remain; 0: all",
       .details = "A component is connected by `neighbors`; of equally large ones that comes first "
                  "whose first cell does, by z, y, x. `keep`, `dilate`, `erode` and `hollow` are "
                  "applied in this order, after `level` and `region` and before `crop` and "
                  "`mirror`; cells outside the selection are empty.",
       .default_words = "all"},
      {.name = "dilate",
       .codec = integer(&O::dilate, 0, limits::kMorphologyStepsMax),
       .help = "steps by which the voxels grow",
       .details = "Within the grid: `padding` gives room. An added voxel has the values of its "
                  "first neighbour of the step before, one at a face before one at an edge before "
                  "one at a corner, then by lowest z, y, x; its coverage is full. Grids with "
                  "distances are refused.",
       .is_written = is_dilated},
      {.name = "erode",
       .codec = integer(&O::erode, 0, limits::kMorphologyStepsMax),
       .help = "steps by which the voxels shrink",
       .details = "Channels distance and coverage stay those of the mesh.",
       .is_written = is_eroded},
      {.name = "hollow",
       .codec = integer(&O::hollow, 0, limits::kMorphologyStepsMax),
       .help = "thickness of the shell that remains of the voxels, in steps; 0: all remain",
       .details = "The voxels that remain are those that `erode` by as many steps would remove.",
       .is_written = is_hollow},
      {.name = "neighbors",
       .codec = word(&O::neighbors, words::kNeighbors),
       .help = "cells around a cell that keep, dilate, erode and hollow count as its neighbours",
       .details = "`6`: those at its faces. `18`: at edges, too. `26`: at corners, too.",
       .is_written = uses_neighbors},
      {.name = "remap",
       .form = "FROM:TO,...",
       .codec = remap(),
       .help = "changes of the numbers of labels, 1 to 65535",
       .details = "All at once: `1:2,2:1` exchanges two. Names of labels in the meta move, too; of "
                  "labels that become one, the name of TO stays, or else that of the lowest FROM.",
       .default_words = "none"},
      {.name = "crop",
       .codec = word(&O::crop, words::kYesNo),
       .help = "whether the grid becomes the box of its occupied cells",
       .details = "After `level`, `region` and `hollow`; voxels keep their place in the world. The "
                  "frames of "
                  "a sequence have the box of all frames. A grid without voxels stays as it is.",
       .is_written = is_cropped},
      {.name = "mirror",
       .form = "x,y,z",
       .codec = mirror(),
       .help = "axes along which the cells are in reverse order",
       .details = "After `level`, `region` and `crop`; the grid keeps its place in the world. "
                  "Normals are mirrored, too.",
       .default_words = "none"},
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
  add(OptionGroup::kSelection, kGridOut, grid_selection_options());
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
