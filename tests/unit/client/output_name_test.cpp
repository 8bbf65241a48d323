// Names of outputs: the kind of bytes that each may hold.
#include "client/cli/output_name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

namespace voxeld::cli {
namespace {

using ::testing::HasSubstr;

// The error's text; "" if there is none.
template <typename Action>
std::string refusal(Action&& action) {
  try {
    action();
  } catch (const CLI::ValidationError& error) {
    return error.what();
  }
  return "";
}

// ".voxg, .npy, …" of all formats of grids.
std::string all_extensions() {
  std::string text;
  for (const FormatInfo& info : output_formats()) text += std::string(info.extension) + ", ";
  return text;
}

TEST(OutputName, the_extension_chooses_the_format_of_a_grid) {
  EXPECT_EQ(format_for("a.vox", ""), "vox");
  EXPECT_EQ(format_for("A.VOX", ""), "vox");
  EXPECT_EQ(format_for("a.voxs", ""), "native");
  EXPECT_EQ(format_for("a.vox", "vox"), "vox");
  EXPECT_EQ(format_for("a.glb", ""), "glb");
  EXPECT_EQ(format_for("a.nii.gz", ""), "nii");
  EXPECT_EQ(format_for("scans.v2/A.B.NII.GZ", ""), "nii");
  EXPECT_EQ(format_for("a.zip", ""), "xyz");
  EXPECT_EQ(format_for("a.zip", "ply"), "ply");
  EXPECT_EQ(format_for("a.schem", ""), "schem");
  EXPECT_EQ(format_for("A.Litematic", ""), "litematic");
  EXPECT_EQ(format_for("a.zip", "nbt"), "nbt");
  EXPECT_EQ(format_for("-", "npy"), "npy");
  EXPECT_EQ(format_for("", ""), "");
  EXPECT_EQ(format_for("grid.bin", "native"), "native");
}

TEST(OutputName, a_file_never_gets_bytes_of_another_kind) {
  EXPECT_EQ(refusal([] { format_for("a.vox", "npz"); }),
            "--output: --format npz does not go to a .vox, got \"a.vox\"");
  EXPECT_EQ(refusal([] { format_for("a.zip", "vox"); }),
            "--output: --format vox does not go to a .zip, got \"a.zip\"");
  EXPECT_EQ(refusal([] { format_for("a.jpg", "native"); }),
            "--output: expected a name that ends in " + all_extensions() + ".voxs, got \"a.jpg\"");
  EXPECT_EQ(refusal([] { format_for("a.bin", ""); }), "--output: expected a name that ends in " +
                                                          all_extensions() +
                                                          ".voxs (or --format), got \"a.bin\"");
  // Files of .nii are not compressed.
  EXPECT_THAT(refusal([] { format_for("a.nii", "nii"); }), HasSubstr(".nii.gz"));
  EXPECT_THAT(refusal([] { format_for("a.gz", ""); }), HasSubstr("got \"a.gz\""));
  EXPECT_EQ(refusal([] { format_for("x.png", ""); }),
            "--output: voxel render makes images: voxel render MESH -o x.png");
}

TEST(OutputName, frames_and_single_grids_have_names_of_their_own) {
  EXPECT_EQ(refusal([] { check_extension("a.voxs", Format::kNative, false); }),
            "--output: a .voxs holds an animation's frames: name one with --animation");
  EXPECT_EQ(refusal([] { check_extension("a.voxg", Format::kNative, true); }),
            "--output: an animation's frames go to a .voxs, not a .voxg");
  EXPECT_EQ(refusal([] { check_extension("a.vox", Format::kVox, true); }), "");
}

TEST(OutputName, the_extension_chooses_the_kind_of_image) {
  EXPECT_EQ(image_for("a.png", ""), "");
  EXPECT_EQ(image_for("a.gif", ""), "gif");
  EXPECT_EQ(image_for("a.png", "sheet"), "sheet");
  EXPECT_EQ(image_for("a.png", "apng"), "apng");
  EXPECT_EQ(image_for("-", "gif"), "gif");
  EXPECT_EQ(image_for("/dev/stdout", "png"), "png");
}

TEST(OutputName, an_image_never_gets_bytes_of_another_kind) {
  EXPECT_EQ(refusal([] { image_for("a.png", "gif"); }),
            "--output: --image gif does not go to a .png, got \"a.png\"");
  EXPECT_EQ(refusal([] { image_for("a.gif", "sheet"); }),
            "--output: --image sheet does not go to a .gif, got \"a.gif\"");
  EXPECT_THAT(refusal([] { image_for("a.jpg", "png"); }),
              HasSubstr("expected a name that ends in .png, .gif or .apng, got \"a.jpg\""));
  EXPECT_THAT(refusal([] { image_for("picture", ""); }), HasSubstr("(or --image)"));
  EXPECT_EQ(refusal([] { image_for("a.vox", ""); }),
            "--output: voxel without render makes grids: voxel MESH -o a.vox");
}

}  // namespace
}  // namespace voxeld::cli
