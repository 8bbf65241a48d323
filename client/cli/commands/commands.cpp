#include "client/cli/commands/commands.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "client/cli/commands/batch.h"
#include "client/cli/commands/dry_run.h"
#include "client/cli/commands/info.h"
#include "client/cli/commands/job_result.h"
#include "client/cli/commands/stored.h"
#include "client/cli/commands/top.h"
#include "client/cli/terminal/report.h"
#include "proto/output_format.h"

namespace voxeld::cli {
namespace {

using Json = nlohmann::json;

void run_top(const Arguments& arguments, const std::stop_token& stop) {
  client::Client daemon(settings_of(arguments));
  watch_queue(arguments, daemon, stop);
}

void run_formats(const Arguments& arguments) {
  Json written = Json::array();
  for (const FormatInfo& format : output_formats()) {
    written.push_back(std::string(format.extension));
    if (format.extension != format.sequence_extension) {
      written.push_back(std::string(format.sequence_extension));
    }
  }
  const Json object = {{"read",
                        {"obj", "ply", "stl", "off", "gltf", "glb", "md5mesh", "3mf", "zip", "voxg",
                         "vox", "binvox", "npy", "nrrd"}},
                       {"write", written},
                       {"image", {".png", ".gif", ".apng"}}};
  if (arguments.json) {
    print_json(object);
    return;
  }
  std::printf(
      "reads   .obj with .mtl and textures, .ply, .stl, .off, .gltf, .glb, .md5mesh, .3mf, .zip of "
      "one;\n"
      "        animations of .gltf, .glb and, with .md5anim, .md5mesh;\n"
      "        voxels of .voxg, .vox, .binvox, .npy, .nrrd\n"
      "writes  .npy  dense array; of an animation with a frame axis\n"
      "        .npz  dense arrays with origin and voxel size; likewise\n"
      "        .vox  MagicaVoxel; of an animation animated\n"
      "        .xyz  points as text; of an animation a .zip of one file each\n"
      "        .glb, .ply, .obj  meshes of the voxels' faces; likewise\n"
      "        .vti, .nrrd, .mha, .nii.gz  volumes with origin and voxel size; likewise\n"
      "        .binvox  dense occupancy in a cube; likewise\n"
      "        .csv, .pcd  points with all channels; likewise\n"
      "        .qb   Qubicle; likewise\n"
      "        .schem, .litematic, .nbt  blocks of Minecraft; likewise\n"
      "        .zarr.zip  Zarr store with levels of detail; of an animation with a frame axis\n"
      "        .vdb, .nvdb  OpenVDB, NanoVDB; of an animation a .zip of one file each\n"
      "        .bt, .ldr  OctoMap, LDraw bricks; likewise\n"
      "        .vtu, .inp  a hexahedron for each voxel, for VTK, Abaqus and CalculiX; likewise\n"
      "        .ktx2, .raw.zip, .slices.zip  3D texture, bare array, images of slices; likewise\n"
      "        .voxg voxeld's sparse container\n"
      "        .voxs the same of an animation's frames\n"
      "        .png  image (voxel render); .gif, .apng of an animation or a turntable\n");
}

}  // namespace

bool needs_server(const Arguments& arguments) {
  if (arguments.command == Arguments::Command::kFormats) return false;
  return arguments.command != Arguments::Command::kInfo || !is_container(arguments.input);
}

bool heeds_stop(const Arguments& arguments) {
  switch (arguments.command) {
    case Arguments::Command::kVoxelize:
    case Arguments::Command::kRender:
      return true;
    case Arguments::Command::kInfo:
      return needs_server(arguments);
    case Arguments::Command::kJobs:
      return !arguments.output.empty();
    case Arguments::Command::kTop:
      return !arguments.once && !arguments.json;
    default:
      return false;
  }
}

void run_command(const Arguments& arguments, const std::stop_token& stop) {
  if (arguments.dry_run) return run_dry_run(arguments, stop);
  if (!arguments.batch.empty()) return run_batch(arguments, stop);
  switch (arguments.command) {
    case Arguments::Command::kVoxelize:
      return run_voxelize(arguments, stop);
    case Arguments::Command::kRender:
      return run_render(arguments, stop);
    case Arguments::Command::kJobs:
      return run_jobs(arguments, stop);
    case Arguments::Command::kTop:
      return run_top(arguments, stop);
    case Arguments::Command::kList:
      return run_list(arguments);
    case Arguments::Command::kRemove:
      return run_remove(arguments);
    case Arguments::Command::kShare:
      return run_share(arguments);
    case Arguments::Command::kWhoami:
      return run_whoami(arguments);
    case Arguments::Command::kInfo:
      return run_info(arguments, stop);
    case Arguments::Command::kFormats:
      return run_formats(arguments);
    case Arguments::Command::kGenerate:
      return;  // done by parse_arguments(), which has the command line
  }
}

}  // namespace voxeld::cli
