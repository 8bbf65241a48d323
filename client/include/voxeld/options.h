// The options of requests, by type or by name. Part of client.h. Their meaning, ranges and defaults
// are those of docs/options.md.
//
//   Options().size(256).fill(Fill::kSolid).channels({Channel::kColor, Channel::kNormal})
//   Options().set("size", "256").set("fill", "solid").set("channels", "color,normal")
//
// The parts between "options: WHAT" and "options: end" are written from the daemon's table of
// options by VOXELD_RENEW=1 unit_client --gtest_filter='OptionsHeader.*'.
#pragma once

#include <array>
#include <chrono>
#include <concepts>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#define VOXELD_CLIENT_API __attribute__((visibility("default")))

namespace voxeld::client {

// The words of options, and their names in the API.
// clang-format off
// options: words
enum class UpAxis { kY, kZ };
constexpr std::string_view name_of(UpAxis value) {
  constexpr std::string_view kNames[] = {"y", "z"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Units { kM, kCm, kMm, kIn, kFt };
constexpr std::string_view name_of(Units value) {
  constexpr std::string_view kNames[] = {"m", "cm", "mm", "in", "ft"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Rule { kTouch, kThin, kCenter, kNone };
constexpr std::string_view name_of(Rule value) {
  constexpr std::string_view kNames[] = {"touch", "thin", "center", "none"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Fill { kSurface, kSolid, kShell, kBand };
constexpr std::string_view name_of(Fill value) {
  constexpr std::string_view kNames[] = {"surface", "solid", "shell", "band"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Sign { kAuto, kParity, kNonzero, kMajority, kFlood, kWinding };
constexpr std::string_view name_of(Sign value) {
  constexpr std::string_view kNames[] = {"auto", "parity", "nonzero", "majority", "flood",
      "winding"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Interior { kNone, kNearest };
constexpr std::string_view name_of(Interior value) {
  constexpr std::string_view kNames[] = {"none", "nearest"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class ColorMode { kAverage, kNearest, kDominant, kShaded, kAxis, kNone };
constexpr std::string_view name_of(ColorMode value) {
  constexpr std::string_view kNames[] = {"average", "nearest", "dominant", "shaded", "axis",
      "none"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Channel { kOccupancy, kColor, kNormal, kMaterial, kLabel, kDistance, kCoverage };
constexpr std::string_view name_of(Channel value) {
  constexpr std::string_view kNames[] = {"occupancy", "color", "normal", "material", "label",
      "distance", "coverage"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class LabelKind { kMesh, kNode, kMaterial, kGroup };
constexpr std::string_view name_of(LabelKind value) {
  constexpr std::string_view kNames[] = {"mesh", "node", "material", "group"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Distance { kVoxels, kWorld };
constexpr std::string_view name_of(Distance value) {
  constexpr std::string_view kNames[] = {"voxels", "world"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Pipeline { kAuto, kRaster, kCompute, kCpu };
constexpr std::string_view name_of(Pipeline value) {
  constexpr std::string_view kNames[] = {"auto", "raster", "compute", "cpu"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class RootMotion { kKeep, kStrip };
constexpr std::string_view name_of(RootMotion value) {
  constexpr std::string_view kNames[] = {"keep", "strip"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Format { kNative, kNpy, kNpz, kVox, kXyz, kGlb, kPly, kObj, kVti, kNrrd, kMha, kNii,
    kBinvox, kCsv, kPcd, kQb, kSchem, kLitematic, kNbt, kZarr, kVdb, kNvdb, kBt, kLdr, kVtu, kInp,
    kKtx2, kRaw, kSlices };
constexpr std::string_view name_of(Format value) {
  constexpr std::string_view kNames[] = {"native", "npy", "npz", "vox", "xyz", "glb", "ply", "obj",
      "vti", "nrrd", "mha", "nii", "binvox", "csv", "pcd", "qb", "schem", "litematic", "nbt",
      "zarr", "vdb", "nvdb", "bt", "ldr", "vtu", "inp", "ktx2", "raw", "slices"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Codec { kFast, kSmall };
constexpr std::string_view name_of(Codec value) {
  constexpr std::string_view kNames[] = {"fast", "small"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class ArrayLayout { kDense, kSparse, kAtlas };
constexpr std::string_view name_of(ArrayLayout value) {
  constexpr std::string_view kNames[] = {"dense", "sparse", "atlas"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class AxisOrder { kZyx, kXyz };
constexpr std::string_view name_of(AxisOrder value) {
  constexpr std::string_view kNames[] = {"zyx", "xyz"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class DType { kUint8, kBool, kFloat32 };
constexpr std::string_view name_of(DType value) {
  constexpr std::string_view kNames[] = {"uint8", "bool", "float32"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class MeshSurface { kFaces, kGreedy, kSmooth, kInstances };
constexpr std::string_view name_of(MeshSurface value) {
  constexpr std::string_view kNames[] = {"faces", "greedy", "smooth", "instances"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class MeshCompression { kNone, kMeshopt };
constexpr std::string_view name_of(MeshCompression value) {
  constexpr std::string_view kNames[] = {"none", "meshopt"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Dither { kNone, kBayer, kError };
constexpr std::string_view name_of(Dither value) {
  constexpr std::string_view kNames[] = {"none", "bayer", "error"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class LevelRule { kAny, kMajority };
constexpr std::string_view name_of(LevelRule value) {
  constexpr std::string_view kNames[] = {"any", "majority"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Alpha { kAuto, kKeep, kCut };
constexpr std::string_view name_of(Alpha value) {
  constexpr std::string_view kNames[] = {"auto", "keep", "cut"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Neighbors { k6, k18, k26 };
constexpr std::string_view name_of(Neighbors value) {
  constexpr std::string_view kNames[] = {"6", "18", "26"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Axis { kX, kY, kZ };
constexpr std::string_view name_of(Axis value) {
  constexpr std::string_view kNames[] = {"x", "y", "z"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Style { kVoxel, kSmooth, kClay, kIso, kBlueprint };
constexpr std::string_view name_of(Style value) {
  constexpr std::string_view kNames[] = {"voxel", "smooth", "clay", "iso", "blueprint"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Projection { kPerspective, kOrthographic };
constexpr std::string_view name_of(Projection value) {
  constexpr std::string_view kNames[] = {"perspective", "orthographic"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Samples { kAuto, k1, k2, k3, k4 };
constexpr std::string_view name_of(Samples value) {
  constexpr std::string_view kNames[] = {"auto", "1", "2", "3", "4"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class Renderer { kAuto, kGl, kCpu };
constexpr std::string_view name_of(Renderer value) {
  constexpr std::string_view kNames[] = {"auto", "gl", "cpu"};
  return kNames[static_cast<std::size_t>(value)];
}
enum class ImageKind { kPng, kGif, kApng, kSheet };
constexpr std::string_view name_of(ImageKind value) {
  constexpr std::string_view kNames[] = {"png", "gif", "apng", "sheet"};
  return kNames[static_cast<std::size_t>(value)];
}
// options: end
// clang-format on

// The options of a request. Each has a setter of its own; set() takes any by its name in the API,
// also one that a newer daemon has. The daemon checks the values. The last value of a name counts.
class VOXELD_CLIENT_API Options {
 public:
  Options& set(std::string name, std::string value);
  bool has(std::string_view name) const;
  const std::vector<std::pair<std::string, std::string>>& pairs() const { return pairs_; }

  // --- job
  // place among the waiting jobs of the key's holder: higher ones are first (-100 to 100)
  Options& priority(int value) { return set("priority", text(value)); }
  // time after the submission at which an unfinished job fails
  Options& deadline(std::chrono::milliseconds value) {
    return set("deadline_ms", std::to_string(value.count()));
  }

  // clang-format off
  // options: setters
  // --- placement
  // voxels on the longest side (1 to 16384; default: 128)
  Options& size(int value) { return set("size", text(value)); }
  // NX,NY,NZ: cells in x, y and z, instead of size
  Options& dims(const std::array<int, 3>& values) {
    return set("dims", text(std::span<const int>(values)));
  }
  // S | X,Y,Z: edge of a voxel in world units, instead of size
  Options& voxel_size(const std::array<double, 3>& values) {
    return set("voxel_size", text(std::span<const double>(values)));
  }
  Options& voxel_size(double value) { return set("voxel_size", text(value)); }
  // empty voxels on each side, part of the size (0 to 512; default: 0)
  Options& padding(int value) { return set("padding", text(value)); }
  // X0,Y0,Z0,X1,Y1,Z1: box of the world to voxelize (default: the mesh's box)
  Options& bounds(const std::array<double, 6>& values) {
    return set("bounds", text(std::span<const double>(values)));
  }
  // axis of the mesh that points up; z is turned to y (default: y)
  Options& up(UpAxis value) { return set("up", std::string(name_of(value))); }
  // unit of the mesh's coordinates, a label of the result
  Options& units(Units value) { return set("units", std::string(name_of(value))); }
  // 16 numbers: row-major 4x4 matrix that is applied to the mesh first; its last row is 0,0,0,1
  Options& transform(const std::array<double, 16>& values) {
    return set("transform", text(std::span<const double>(values)));
  }

  // --- voxelization
  // voxels of a surface: all touched ones, a thin layer, centres of columns alone, or none
  // (default: touch)
  Options& rule(Rule value) { return set("rule", std::string(name_of(value))); }
  // surface alone, with all its inside, with the inside near it, or all cells near it (default:
  // surface)
  Options& fill(Fill value) { return set("fill", std::string(name_of(value))); }
  // how the inside is found, for fill solid and shell and for distances (default: auto)
  Options& sign(Sign value) { return set("sign", std::string(name_of(value))); }
  // thickness of a shell, or of a band to each side, in voxels (1 to 256; default: 1, of a band 3)
  Options& thickness(double value) { return set("thickness", text(value)); }
  // colour and normal of voxels inside, for fill solid and shell (default: none)
  Options& interior(Interior value) { return set("interior", std::string(name_of(value))); }
  // colour of a voxel: area average, at the nearest point, average of the largest material, Phong
  // light baked in, by dominant axis, or none (default: average)
  Options& color(ColorMode value) { return set("color", std::string(name_of(value))); }
  // list of what the grid holds for a voxel (default: occupancy, color if the mesh has it, distance
  // of a band)
  Options& channels(const std::vector<Channel>& values) { return set("channels", text(values)); }
  // what channel label numbers: the one with the largest part of a voxel (default: mesh)
  Options& labels(LabelKind value) { return set("labels", std::string(name_of(value))); }
  // unit of channel distance: voxels along each axis, or the mesh's own unit (default: voxels)
  Options& distance(Distance value) { return set("distance", std::string(name_of(value))); }
  // NAME | N: materials of a glTF file, by name or number of one of its variants (default: the
  // file's own)
  Options& variant(std::string value) { return set("variant", std::move(value)); }
  Options& variant(int value) { return set("variant", text(value)); }
  // least sample that makes a voxel, of a file of samples (npy, nrrd) (-1e+30 to 1e+30; default:
  // 0.5)
  Options& threshold(double value) { return set("threshold", text(value)); }
  // how the grid is computed; its bytes are always the same (default: auto)
  Options& pipeline(Pipeline value) { return set("pipeline", std::string(name_of(value))); }

  // --- animation
  // NAME | N: animation of the mesh by name or number: its frames become a sequence of grids
  // (default: none; the first, if another option of animations is given)
  Options& animation(std::string value) { return set("animation", std::move(value)); }
  Options& animation(int value) { return set("animation", text(value)); }
  // seconds into the animation: one grid instead of a sequence (0 to 86400)
  Options& time(double value) { return set("time", text(value)); }
  // A..B | N: frames of the animation or sequence, from 0, the last included (default: all)
  Options& frames(std::string value) { return set("frames", std::move(value)); }
  Options& frames(int value) { return set("frames", text(value)); }
  // frames per second (0.01 to 1000; default: the animation's own, or 24)
  Options& fps(double value) { return set("fps", text(value)); }
  // T0,T1,...: ascending seconds of the frames, instead of frames and fps
  Options& times(const std::vector<double>& values) {
    return set("times", text(std::span<const double>(values)));
  }
  // whether a walking model leaves the place where it began (default: keep)
  Options& root_motion(RootMotion value) { return set("root_motion", std::string(name_of(value))); }

  // --- output
  // output format of the grid (default: native)
  Options& format(Format value) { return set("format", std::string(name_of(value))); }
  // compression of format native: quick, or a third of the bytes and slow (default: fast)
  Options& codec(Codec value) { return set("codec", std::string(name_of(value))); }
  // arrays of npy and npz: of all cells, or with a row for each voxel; slices: in one image
  // (default: dense)
  Options& layout(ArrayLayout value) { return set("layout", std::string(name_of(value))); }
  // axis order of npy and npz in layout dense (default: zyx)
  Options& axes(AxisOrder value) { return set("axes", std::string(name_of(value))); }
  // sample type of npy, npz, vti, nrrd, mha, nii, raw and zarr (default: uint8)
  Options& dtype(DType value) { return set("dtype", std::string(name_of(value))); }
  // N | NAME | #RRGGBB,...: colours: how many of its own a .vox has at most, or those of a palette
  // (default: 255)
  Options& palette(std::string value) { return set("palette", std::move(value)); }
  Options& palette(int value) { return set("palette", text(value)); }
  // surface of glb, ply and obj: squares, rectangles merged by colour, smooth, or cubes (default:
  // greedy)
  Options& mesh(MeshSurface value) { return set("mesh", std::string(name_of(value))); }
  // channel whose array a nrrd, mha, nii, ktx2, raw or slices holds (default: occupancy)
  Options& channel(Channel value) { return set("channel", std::string(name_of(value))); }
  // compression of a glb; readers need EXT_meshopt_compression (default: none)
  Options& compress(MeshCompression value) { return set("compress", std::string(name_of(value))); }
  // blocks of schem, litematic and nbt: names of groups and of blocks (default: all)
  Options& blocks(const std::vector<std::string>& values) { return set("blocks", text(values)); }
  // colours that the palette lacks, of a palette, vox, schem, litematic or nbt: the nearest one, or
  // a mixture by a pattern or by error diffusion (default: none)
  Options& dither(Dither value) { return set("dither", std::string(name_of(value))); }
  // version of the Sponge schematic format of a schem (2 to 3; default: 2)
  Options& schem_version(int value) { return set("schem_version", text(value)); }
  // version of the Zarr format of a zarr (2 to 3; default: 3)
  Options& zarr_version(int value) { return set("zarr_version", text(value)); }

  // --- selection
  // level of detail: one voxel stands for 2^N on a side; of an image, the finest one drawn (0 to
  // 14; default: 0)
  Options& level(int value) { return set("level", text(value)); }
  // occupied cells that a voxel of a level needs: any, or at least half of them (default: any)
  Options& level_rule(LevelRule value) { return set("level_rule", std::string(name_of(value))); }
  // X0,Y0,Z0,X1,Y1,Z1: cells of the grid: the first ones, and those after the last (default: all)
  Options& region(const std::array<int, 6>& values) {
    return set("region", text(std::span<const int>(values)));
  }
  // whether voxels whose colour has alpha 0 are kept or left out (default: auto)
  Options& alpha(Alpha value) { return set("alpha", std::string(name_of(value))); }
  // largest | N: number of the largest components of voxels that remain; 0: all (default: all)
  Options& keep(std::string value) { return set("keep", std::move(value)); }
  Options& keep(int value) { return set("keep", text(value)); }
  // steps by which the voxels grow (0 to 64; default: 0)
  Options& dilate(int value) { return set("dilate", text(value)); }
  // steps by which the voxels shrink (0 to 64; default: 0)
  Options& erode(int value) { return set("erode", text(value)); }
  // thickness of the shell that remains of the voxels, in steps; 0: all remain (0 to 64; default:
  // 0)
  Options& hollow(int value) { return set("hollow", text(value)); }
  // cells around a cell that keep, dilate, erode and hollow count as its neighbours (default: 6)
  Options& neighbors(Neighbors value) { return set("neighbors", std::string(name_of(value))); }
  // FROM:TO,...: changes of the numbers of labels, 1 to 65535 (default: none)
  Options& remap(const std::vector<std::pair<int, int>>& values) {
    return set("remap", text(values));
  }
  // whether the grid becomes the box of its occupied cells (default: no)
  Options& crop(std::same_as<bool> auto value) { return set("crop", text(value)); }
  // axes along which the cells are in reverse order (default: none)
  Options& mirror(const std::vector<Axis>& values) { return set("mirror", text(values)); }

  // --- image
  // width of an image in pixels (1 to 4096; default: 512, in a sheet 160)
  Options& width(int value) { return set("width", text(value)); }
  // height of an image in pixels (1 to 4096; default: 512, in a sheet 160)
  Options& height(int value) { return set("height", text(value)); }
  // cubes with edges, smooth surface, shape alone, fixed light from above, or outlines (default:
  // voxel)
  Options& style(Style value) { return set("style", std::string(name_of(value))); }
  // projection of the camera (default: perspective; orthographic in style iso and blueprint)
  Options& projection(Projection value) { return set("projection", std::string(name_of(value))); }
  // camera's angle around +y; 0 looks from +z (-3600 to 3600; default: 30; 45 in style iso)
  Options& azimuth(double value) { return set("azimuth", text(value)); }
  // camera's angle above the horizon (-90 to 90; default: 20; 35.26 in style iso)
  Options& elevation(double value) { return set("elevation", text(value)); }
  // magnification: 1 fits the voxels into the image, more is closer (0.01 to 1000; default: 1)
  Options& zoom(double value) { return set("zoom", text(value)); }
  // 16 numbers: row-major clip_from_world matrix, instead of projection, azimuth, elevation and
  // zoom
  Options& matrix(const std::array<double, 16>& values) {
    return set("matrix", text(std::span<const double>(values)));
  }
  // #RRGGBB[AA] | transparent: sRGB colour behind the grid (default: a light gradient; white in
  // style smooth and in a GIF, grey in style iso, blue in style blueprint)
  Options& background(std::string value) { return set("background", std::move(value)); }
  // ambient occlusion: corners are darker (default: yes in style voxel, clay and iso)
  Options& occlusion(std::same_as<bool> auto value) { return set("occlusion", text(value)); }
  // soft shadow of the key light (default: yes in style voxel and clay)
  Options& shadow(std::same_as<bool> auto value) { return set("shadow", text(value)); }
  // floor under the grid, which shows its shadow alone and fades out (default: yes in style voxel
  // and clay)
  Options& ground(std::same_as<bool> auto value) { return set("ground", text(value)); }
  // factor by which dark colours are brighter; white stays white (1 to 16; default: by the median
  // of the colours; 1 in style iso)
  Options& exposure(double value) { return set("exposure", text(value)); }
  // rays along each side of a pixel; 1 is quick (default: auto)
  Options& samples(Samples value) { return set("samples", std::string(name_of(value))); }
  // what draws the image; auto: the GPU, or the CPU if GL is a software driver (default: auto)
  Options& renderer(Renderer value) { return set("renderer", std::string(name_of(value))); }
  // A,B,C,D: plane that cuts away the cells where A x + B y + C z + D > 0
  Options& section(const std::array<double, 4>& values) {
    return set("section", text(std::span<const double>(values)));
  }

  // --- several images
  // one image, or all frames or views as an animation or side by side (default: png)
  Options& image(ImageKind value) { return set("image", std::string(name_of(value))); }
  // image png: number of the frame among the requested ones, from 0 (0 to 4095; default: 0)
  Options& frame(int value) { return set("frame", text(value)); }
  // image gif, apng and sheet: number of views around one grid (2 to 360)
  Options& turntable(int value) { return set("turntable", text(value)); }
  // image gif and apng: images per second (0.1 to 100; default: the sequence's own times; 24 for a
  // turntable)
  Options& rate(double value) { return set("rate", text(value)); }
  // image sheet: images in a row (1 to 4096; default: as many as rows)
  Options& columns(int value) { return set("columns", text(value)); }

  // --- request
  // whether an equal result that is stored may be used; no computes it again (default: yes)
  Options& cache(std::same_as<bool> auto value) { return set("cache", text(value)); }
  // NAME: name of the input file, which tells its format (default: by Content-Type and the first
  // bytes)
  Options& filename(std::string value) { return set("filename", std::move(value)); }
  // options: end
  // clang-format on

  // the first and the last frame
  Options& frames(int first, int last) { return set("frames", text(first) + ".." + text(last)); }

 private:
  static std::string text(bool value) { return value ? "yes" : "no"; }
  static std::string text(int value) { return std::to_string(value); }
  static std::string text(double value);
  static std::string text(std::span<const int> values);
  static std::string text(std::span<const double> values);
  static std::string text(const std::vector<std::string>& values);
  static std::string text(const std::vector<std::pair<int, int>>& values);
  template <typename Word>
  static std::string text(const std::vector<Word>& words) {
    std::vector<std::string> names;
    names.reserve(words.size());
    for (const Word word : words) names.emplace_back(name_of(word));
    return text(names);
  }

  std::vector<std::pair<std::string, std::string>> pairs_;
};

}  // namespace voxeld::client
