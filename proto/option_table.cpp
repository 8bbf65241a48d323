// The table of all options: names, value texts and help. Order is the order of help texts.
#include "proto/options.h"

namespace voxeld {
namespace {

constexpr bool kYes = true;

constexpr OptionInfo kTable[] = {
    {"size", "N", "voxels on the longest side, 1 to 16384 (default 128)", kYes},
    {"dims", "NX,NY,NZ", "cells in x, y and z: cubic voxels that fit; with bounds, that box", kYes},
    {"voxel_size", "S | X,Y,Z", "edge of a voxel in world units", kYes},
    {"padding", "N", "empty voxels on each side, part of the size (default 0)", kYes},
    {"bounds", "X0,Y0,Z0,X1,Y1,Z1", "box of the world to voxelize (default: the mesh's)", kYes},
    {"up", "y | z", "axis of the input that points up (default y)", kYes},
    {"units", "m | cm | mm | in | ft", "unit of the mesh's coordinates, a label of the result",
     kYes},
    {"transform", "16 numbers", "row-major 4x4 matrix that is applied to the mesh first", kYes},
    {"rule", "touch | thin | center | none",
     "every voxel that a triangle touches (default); 6-separating; centres alone; no surface",
     kYes},
    {"fill", "surface | solid | shell | band",
     "the surface alone (default), with its inside, with what of that is near, or all that is near",
     kYes},
    {"sign", "auto | parity | nonzero | majority | flood | winding",
     "what is inside, for fills and distances (default auto)", kYes},
    {"thickness", "T", "of a shell, or to each side of a band, in voxels, 1 to 256 (default 1, 3)",
     kYes},
    {"interior", "none | nearest",
     "attributes inside, for fill solid and shell: none (default), or of the nearest surface",
     kYes},
    {"color", "average | nearest | dominant | shaded | axis | none",
     "area average in linear light, at the point nearest to the voxel's centre, of the material "
     "with the largest part alone, Phong baked in, or red/green/blue by dominant axis",
     kYes},
    {"channels", "occupancy,color,normal,material,label,distance,coverage",
     "what a grid holds (default: occupancy and color; of a band also distance)", kYes},
    {"labels", "mesh | node | material | group",
     "what channel label numbers: the largest in a voxel of these (default mesh)", kYes},
    {"pipeline", "auto | raster | compute | cpu", "how it is computed; the same bytes from each",
     kYes},
    {"format", "native | npy | npz | vox", "how the grid is written (default native)", false, kYes},
    {"codec", "fast | small", "native: quick, or a third of the bytes and slow (default fast)",
     false, kYes},
    {"axes", "zyx | xyz", "axis order of npy and npz (default zyx)", false, kYes},
    {"dtype", "uint8 | bool | float32", "type of npy and npz samples (default uint8)", false, kYes},
    {"palette", "N", "colours of a .vox, 1 to 255 (default 255)", false, kYes},
    {"level", "N",
     "of detail, 0 to 14: one voxel for 2^N to a side; of pictures, the finest (default 0)", false,
     kYes, kYes},
    {"level_rule", "any | majority",
     "what a voxel of a level needs: any of its cells (default), or at least half of them", false,
     kYes, kYes},
    {"region", "X0,Y0,Z0,X1,Y1,Z1", "cells of the grid: first ones, and those after the last",
     false, kYes, kYes},
    {"width", "N", "pixels, 1 to 4096 (default 512)", false, false, kYes},
    {"height", "N", "pixels, 1 to 4096 (default 512)", false, false, kYes},
    {"projection", "perspective | orthographic", "of the camera (default perspective)", false,
     false, kYes},
    {"azimuth", "DEGREES", "around +y, 0 looks from +z (default 30)", false, false, kYes},
    {"elevation", "DEGREES", "above the horizon, -90 to 90 (default 20)", false, false, kYes},
    {"zoom", "F", "1 fits the picture, more is closer (default 1)", false, false, kYes},
    {"matrix", "16 numbers", "row-major clip_from_world, instead of the three above", false, false,
     kYes},
    {"background", "#RRGGBB[AA] | transparent", "colour behind the grid (default #ffffff)", false,
     false, kYes},
    {"light", "flat | phong", "by face, or by stored normals (default phong)", false, false, kYes},
    {"occlusion", "yes | no", "ambient occlusion: corners are darker (default no)", false, false,
     kYes},
    {"shadow", "yes | no", "soft shadow of the key light (default no)", false, false, kYes},
    {"samples", "auto | N", "rays along each side of a pixel, 1 to 4 (default auto)", false, false,
     kYes},
    {"renderer", "auto | gl | cpu", "what draws; auto: the CPU on software drivers", false, false,
     kYes},
    {"section", "A,B,C,D", "cuts away where A x + B y + C z + D > 0", false, false, kYes},
    {"cache", "yes | no", "whether a result that is there already may answer (default yes)", kYes,
     kYes, kYes},
    {"filename", "NAME", "names the input's format (default: told from its first bytes)", kYes,
     kYes, kYes},
};

}  // namespace

std::span<const OptionInfo> option_table() {
  return kTable;
}

}  // namespace voxeld
