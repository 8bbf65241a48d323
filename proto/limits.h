// Every limit that a user can hit, with its unit and the error that follows.
#pragma once

#include <cstdint>

namespace voxeld::limits {

// Cells on one side of a grid. Larger: grid-too-large.
inline constexpr int kGridSideMax = 16384;
// Cells of a dense output (npy, npz). Larger: grid-too-large, "use native or vox". 2048^3 would be
// 8.6e9 bytes for occupancy alone; 2^31 cells are 2 GiB.
inline constexpr int64_t kDenseCellsMax = int64_t{1} << 31;
// Voxels of arrays in layout sparse, in all frames: their coords take 3 GiB. More: grid-too-large.
inline constexpr uint64_t kSparseVoxelsMax = uint64_t{1} << 28;
// Cells of a sequence's dense output, all frames: 512 frames of 256^3. Larger: grid-too-large.
inline constexpr int64_t kSequenceDenseCellsMax = int64_t{1} << 33;
inline constexpr int kPaddingMax = 512;  // voxels on each side: invalid-option

// Bytes of one upload: payload-too-large. `--upload-bytes-max` lowers or raises it.
inline constexpr int64_t kUploadBytesMax = int64_t{4} << 30;
inline constexpr int64_t kJsonBodyBytesMax = int64_t{1} << 20;  // payload-too-large
inline constexpr int kJsonDepthMax = 64;                        // bad-request

// Meshes. Larger: malformed-mesh with the number and the limit.
inline constexpr int64_t kVerticesMax = 200'000'000;
inline constexpr int64_t kTrianglesMax = 200'000'000;
inline constexpr int kPolygonCornersMax = 65'536;
inline constexpr int kGltfJsonDepthMax = 128;
inline constexpr int kGltfNodeDepthMax = 512;

// Bundles. Larger: malformed-bundle.
inline constexpr int kBundleEntriesMax = 1'000;
inline constexpr int64_t kBundleInflatedBytesMax = int64_t{8} << 30;
// Inflated over stored, of an entry above 1 MiB. Images of a greater ratio, which are uncompressed
// and of one colour, may have kBundleFlatBytesMax in all.
inline constexpr int kBundleRatioMax = 200;
inline constexpr int64_t kBundleFlatBytesMax = int64_t{256} << 20;

// Textures. Larger ones are omitted, with a warning that names them.
inline constexpr int64_t kImagePixelsMax = int64_t{16384} * 16384 / 4;  // 67 Mpx, 268 MB as RGBA8
inline constexpr int kImageSideMax = 32'768;

// Frames of one request. More: invalid-option.
inline constexpr int kFramesMax = 4096;
inline constexpr double kAnimationSecondsMax = 86'400;   // a day: invalid-option
inline constexpr double kFpsMin = 0.01, kFpsMax = 1000;  // of an animation: invalid-option
inline constexpr double kImageRateMin = 0.1, kImageRateMax = 100;  // images per s: invalid-option
inline constexpr int kTurntableViewsMin = 2, kTurntableViewsMax = 360;  // invalid-option

inline constexpr double kThresholdMax = 1e30;   // of samples, of either sign: invalid-option
inline constexpr int kShellThicknessMax = 256;  // voxels: invalid-option
// With distance=world, the longest edge of a voxel divided by the shortest: invalid-option. Beyond
// it a step along the longest edge exceeds what 16 bits hold.
inline constexpr int kDistanceAspectMax = 256;

// Images. Larger: invalid-option.
inline constexpr int kRenderSideMax = 4096;
inline constexpr double kExposureMax = 16;  // of dark colours: invalid-option
inline constexpr int kSamplesPerSideMax = 4;
inline constexpr int kSheetSideMax = 16'384;  // pixels, of a contact sheet

// Jobs.
inline constexpr int kJobAttemptsMax = 3;         // then worker-crashed
inline constexpr int kQueuedJobsMax = 10'000;     // queue-full
inline constexpr int kPreferWaitSecondsMax = 60;  // longer waits are clamped

// Voxels on a side of a tile, the unit of work, progress and cancellation; a power of two.
inline constexpr int kTileSide = 256;
inline constexpr int kBrickSide = 8;  // voxels on a side of a brick: 512 bits, one mask
inline constexpr int kSubVoxelBits = 8;

}  // namespace voxeld::limits
