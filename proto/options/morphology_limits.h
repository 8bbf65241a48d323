// Limits of the options that change the voxels of a grid. Larger values are invalid-option.
#pragma once

namespace voxeld::limits {

inline constexpr int kMorphologyStepsMax = 64;  // of dilate, erode and hollow, in cells
inline constexpr int kComponentsMax = 1000000;  // that keep=N names
inline constexpr int kLabelChangesMax =
    64;  // of remap; each has up to 12 of the 1024 bytes of a value

}  // namespace voxeld::limits
