// The options of requests: their members, parsing and canonical JSON. Their names, ranges, defaults
// and help are in one table (table.h), which query strings, JSON of jobs, flags and documents use.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/channels.h"
#include "proto/output_format.h"
#include "proto/palette.h"
#include "proto/result.h"

namespace voxeld {

enum class UpAxis { kY, kZ };  // which axis of the input points up
// Words explained in server/voxel/README.md.
enum class Rule { kTouch, kThin, kCenter, kNone };
enum class Fill { kSurface, kSolid, kShell, kBand };
enum class Sign { kAuto, kParity, kNonzero, kMajority, kFlood, kWinding };
enum class ColorMode { kAverage, kNearest, kDominant, kShaded, kAxis, kNone };
enum class LabelKind { kMesh, kNode, kMaterial, kGroup };
enum class Interior { kNone, kNearest };
enum class LevelRule { kAny, kMajority };
// The unit of channel distance: voxels along each axis, or the units of the mesh.
enum class DistanceUnit { kVoxels, kWorld };
enum class PipelineChoice { kAuto, kRaster, kCompute, kCpu };
enum class Codec { kFast, kSmall };
// What the arrays of a NumPy file are: of all cells, or with a row for each voxel.
enum class ArrayLayout { kDense, kSparse, kAtlas };
enum class AxisOrder { kZyx, kXyz };
// The mesh of a grid is made of: a square for each outer face of a voxel; rectangles of faces
// in one plane and colour; a smooth surface between the voxels and the empty cells; or a cube for
// each voxel that has an outer face, drawn by the viewer.
enum class MeshSurface { kFaces, kGreedy, kSmooth, kInstances };
enum class MeshCompression { kNone, kMeshopt };
// How colours become those of a palette: the nearest; or so that the mean of neighbours stays, by
// an ordered (Bayer) threshold or by error diffusion.
enum class Dither { kNone, kBayer, kError };
// The sample type of arrays. uint8: occupancy 0/1, colour 0..255 (sRGB), normal as int8.
// float32: occupancy 0/1, colour 0..1 (linear light), normal -1..1.
enum class DType { kUint8, kBool, kFloat32 };
enum class Projection { kPerspective, kOrthographic };
// How an image is shaded. Each style has defaults of its own for the options after it:
// style_defaults().
//   voxel      faces of cubes with finer, darker edges; on the ground, in soft light
//   smooth     Phong light on stored or estimated normals
//   clay       the shape alone, in the neutral colour
//   iso        each direction of faces has a fixed brightness, so colours compare between images
//   blueprint  the outlines of the subject and of its parts
enum class Style { kVoxel, kSmooth, kClay, kIso, kBlueprint };
enum class RendererChoice { kAuto, kGl, kCpu };
// The kind of image that a render returns: one image; all frames or views as an animated GIF or
// PNG; or all of them side by side on a sheet.
enum class ImageKind { kPng, kGif, kApng, kSheet };
// Whether a walking model leaves the place where it began.
enum class RootMotionChoice { kKeep, kStrip };

// The placement of the grid. At most one of size, dims and voxel_size is set; none means size =
// 128.
struct PlacementOptions {
  std::optional<int> size;                          // voxels on the longest side, 1..16384
  std::optional<std::array<int, 3>> dims;           // cells in x, y, z
  std::optional<std::array<double, 3>> voxel_size;  // world units; one number on the wire = cubic
  int padding = 0;                                  // empty voxels on each side, part of dims
  std::optional<std::array<double, 6>> bounds;      // x0,y0,z0,x1,y1,z1 in world units
  UpAxis up = UpAxis::kY;                           // kZ: the input is turned so that +z becomes +y
  std::string units;                                // m cm mm in ft or empty; a label of the result
  std::optional<std::array<double, 16>> transform;  // row-major 4x4, applied to the input first
};

inline constexpr int kDefaultSize = 128;  // if a request names neither size, dims nor voxel_size

struct VoxelizeOptions {
  PlacementOptions placement;
  Rule rule = Rule::kTouch;
  Fill fill = Fill::kSurface;
  Sign sign = Sign::kAuto;  // decides what is inside, if fill is solid or shell
  double thickness = 1.0;   // of a shell or band, in voxels, 1..256
  // Attributes of interior voxels, which lie on no surface.
  Interior interior = Interior::kNone;
  ColorMode color = ColorMode::kAverage;
  // Unset: occupancy, colour if the mesh has colours, and the distance of a band.
  std::optional<ChannelSet> channels;
  LabelKind labels = LabelKind::kMesh;            // what channel label numbers
  DistanceUnit distance = DistanceUnit::kVoxels;  // of channel distance
  // Name or number of a material variant (KHR_materials_variants); unset: the file's materials.
  std::optional<std::string> variant;
  double threshold = 0.5;  // least sample of a voxel, of a file of samples
  PipelineChoice pipeline = PipelineChoice::kAuto;

  // Whether the request names the channel.
  bool names(Channel channel) const { return channels && channels->has(channel); }
  // Whether voxels get distances, which need a sign.
  bool measures() const { return channels ? channels->distance : fill == Fill::kBand; }
  bool has_inside() const { return fill == Fill::kSolid || fill == Fill::kShell; }
  // Whether no tile is final before the whole surface is there: for fills and signs of distances.
  bool needs_whole_surface() const { return fill != Fill::kSurface || measures(); }
};

// The animation and its times. All unset: the pose in which the file leaves the mesh.
struct AnimationOptions {
  // Name or number of the animation. If it is unset and another option is set: the first one.
  std::optional<std::string> animation;
  std::optional<double> time_s;  // one grid, placed by the mesh at that time
  // Frame k is at time k / fps. fps unset: the animation's own rate, 24 if it has none. frames:
  // first and last; unset: all up to the animation's end. times_s excludes both. In a request on a
  // sequence, `frames` selects among its frames and the other options are refused.
  std::optional<std::array<int, 2>> frames;
  std::optional<double> fps;
  std::vector<double> times_s;  // at most limits::kFramesMax, ascending
  RootMotionChoice root_motion = RootMotionChoice::kKeep;

  bool moves() const { return animation || time_s || frames || fps || !times_s.empty(); }
  // Whether the result is several grids in one placement.
  bool is_sequence() const { return moves() && !time_s; }
  bool operator==(const AnimationOptions&) const = default;
};

// The cells around a cell that touch it in a face; in a face or an edge; or at all.
enum class Neighbors { kFaces, kEdges, kCorners };

// Whether voxels whose colour has alpha 0 are left out; kAuto: where the format has no alpha, and
// in images.
enum class AlphaRule { kAuto, kKeep, kCut };

struct LabelChange {
  uint16_t from = 0;
  uint16_t to = 0;
  bool operator==(const LabelChange&) const = default;
};

// The output format of a grid and its details.
struct OutputOptions {
  Format format = Format::kNative;
  Codec codec = Codec::kFast;
  ArrayLayout layout = ArrayLayout::kDense;
  AxisOrder axes = AxisOrder::kZyx;
  DType dtype = DType::kUint8;
  int palette_max = 255;  // .vox: colours, 1..255, which are chosen from the grid's
  // The colours to map those of voxels to, 1..256, in the order of the palette; empty: palette_max.
  std::vector<PaletteColor> palette;
  MeshSurface mesh = MeshSurface::kGreedy;
  MeshCompression compress = MeshCompression::kNone;  // .glb
  // Formats with one array: the channel that it holds; unset: occupancy.
  std::optional<Channel> channel;
  // Minecraft formats: the blocks to choose from, by names of blocks and groups; empty: all that
  // are full cubes.
  std::vector<std::string> blocks;
  Dither dither = Dither::kNone;  // .vox and Minecraft formats
  int schem_version = 2;          // of the Sponge schematic format: 2 or 3
  int zarr_version = 3;           // of the Zarr format: 2 or 3
  int level = 0;                  // of detail: one voxel stands for 2^level on a side
  LevelRule level_rule = LevelRule::kAny;
  // The first cell and the one after the last, at level 0: x0,y0,z0,x1,y1,z1.
  std::optional<std::array<int, 6>> region;
  AlphaRule alpha = AlphaRule::kAuto;
  int keep = 0;    // the number of the largest components of voxels that remain; 0: all
  int dilate = 0;  // steps by which the voxels grow
  int erode = 0;   // steps by which they shrink, after dilate
  int hollow = 0;  // voxels within so many steps of an empty cell remain; 0: all
  Neighbors neighbors = Neighbors::kFaces;  // of a cell in a component, and of a step
  std::vector<LabelChange> remap;           // of channel label, ascending by `from`
  bool crop = false;                        // to the box of the selected cells that are occupied
  std::array<bool, 3> mirror{};             // axes along which the selected cells are reversed

  // That of the format, in the layout that is asked for.
  FileLayout file_layout() const {
    const FileLayout own = format_info(format).layout;
    return own.may_be_sparse && layout == ArrayLayout::kSparse ? FileLayout::sparse_arrays() : own;
  }
};

// Whether colours become those of a palette. A .vox has the palette itself.
inline bool recolors(const OutputOptions& options) {
  return !options.palette.empty() && options.format != Format::kVox;
}

// Whether voxels are added or removed, so that a crop is known only afterwards.
inline bool changes_voxels(const OutputOptions& options) {
  return options.keep > 0 || options.dilate > 0 || options.erode > 0 || options.hollow > 0;
}

// Whether a request's grid is another than the whole grid at level 0.
inline bool selects(const OutputOptions& options) {
  return options.level > 0 || options.alpha == AlphaRule::kCut || options.region || options.crop ||
         options.mirror != std::array<bool, 3>{} || changes_voxels(options) ||
         !options.remap.empty() || recolors(options);
}

struct RenderOptions {
  int width = 512;  // pixels, 1..4096
  int height = 512;
  Projection projection = Projection::kPerspective;
  double azimuth_deg = 30.0;                     // around +y; 0 looks along -z from +z
  double elevation_deg = 20.0;                   // -90..90
  double zoom = 1.0;                             // > 1 is closer; 1 fits the occupied voxels
  std::optional<std::array<double, 16>> matrix;  // row-major clip_from_world; replaces the above
  // "transparent", or sRGB #rrggbb / #rrggbbaa; unset: the style's.
  std::optional<std::array<uint8_t, 4>> background;
  Style style = Style::kVoxel;
  bool occlusion = true;           // ambient occlusion
  bool shadow = true;              // shadow of a directional light
  bool ground = true;              // a floor that shows the shadow alone and fades out
  std::optional<double> exposure;  // factor of dark colours, 1..16; unset: by the colours' median
  // World y of the floor; unset: the lowest voxel. Not an option of requests: whoever draws several
  // grids with one camera sets it.
  std::optional<double> ground_y_world;
  int samples = 0;  // rays along each side of a pixel, 1..4; 0: as the image's size allows
  RendererChoice renderer = RendererChoice::kAuto;
  // Plane a,b,c,d in world units: cells with a*x+b*y+c*z+d > 0 are cut away.
  std::optional<std::array<double, 4>> section;
  ImageKind image = ImageKind::kPng;
  // The frame of a sequence that a single image shows: its number among the request's frames.
  int frame = 0;
  // The number of views around one grid, from `azimuth` on, instead of frames; 0: none.
  int turntable = 0;
  // Images per second of GIF and APNG. Unset: the sequence's own times, 24 for a turntable.
  std::optional<double> rate;
  int columns = 0;  // of a sheet; 0: as many as rows
};

// A style's defaults of options, for those that the request omits.
struct StyleDefaults {
  Projection projection;
  double azimuth_deg, elevation_deg;
  bool occlusion, shadow, ground;
};
StyleDefaults style_defaults(Style style);

// One request of any kind, as validated from a query string or a job's JSON.
struct RequestOptions {
  VoxelizeOptions voxelize;
  AnimationOptions animation;
  OutputOptions output;
  RenderOptions render;
  bool use_cache = true;  // cache=yes|no
  std::string filename;   // names the input's format; empty: Content-Type, then first bytes
};

// The kinds of request that take options. Each option names its own; others are unknown-option.
enum class OptionScope { kVoxelize, kRenderMesh, kRenderGrid, kExport };

using OptionPairs = std::vector<std::pair<std::string, std::string>>;

// Parses name=value pairs (query string, CLI). Errors: unknown-option with the nearest name;
// invalid-option with the name, the expected and the given value. Duplicates and combinations that
// exclude each other are invalid-option too.
Result<RequestOptions> parse_options(const OptionPairs& pairs, OptionScope scope);
// Parses a JSON object: texts, or JSON's own types, as [1,2,3] for "1,2,3" and true for "yes".
// Errors also: invalid-option with the types that the option takes.
Result<RequestOptions> parse_options(const nlohmann::json& object, OptionScope scope);

// Canonical JSON: fixed key order, defaults spelled out, no filename, no cache, one type for each
// option. Equal requests give equal bytes; parse_options(canonical_json(o)) == o.
std::string canonical_json(const RequestOptions& options, OptionScope scope);

}  // namespace voxeld
