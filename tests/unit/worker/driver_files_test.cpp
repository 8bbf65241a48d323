// The rules for files of drivers, by manifests in made-up folders.
#include "server/worker/driver_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::Not;

class DriverFiles : public ::testing::Test {
 protected:
  ~DriverFiles() override { ::unsetenv("VK_DRIVER_FILES"); }
  fs::path write(const std::string& name, const std::string& text = "x") const {
    const fs::path path = fs::canonical(dir_.path()) / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path) << text;
    return path;
  }
  fs::path write_manifest(const std::string& name, const std::string& library) const {
    return write(name, R"({"file_format_version": "1.0.0", "ICD": {"library_path": ")" + library +
                           R"(", "api_version": "1.3.0"}})");
  }
  static std::vector<fs::path> readable() {
    std::vector<fs::path> paths;
    for (const FileRule& rule : driver_rules()) {
      if (rule.access == FileRule::Access::kRead) paths.push_back(rule.path);
    }
    return paths;
  }

  testing::TemporaryDir dir_;
};

TEST_F(DriverFiles, a_manifest_names_its_library_by_a_path_or_leaves_it_to_the_loader) {
  const fs::path folder = fs::canonical(dir_.path());
  EXPECT_EQ(manifest_library(write_manifest("a.json", "/opt/gpu/libgpu.so")), "/opt/gpu/libgpu.so");
  EXPECT_EQ(manifest_library(write_manifest("d/b.json", "../lib/libgpu.so.1")),
            folder / "lib/libgpu.so.1");
  EXPECT_EQ(manifest_library(write_manifest("c.json", "libgpu.so")), "");
}

TEST_F(DriverFiles, what_is_no_manifest_names_no_library) {
  for (const char* text : {"", "[]", "{}", "{\"ICD\": 1}", "{\"ICD\": {\"library_path\": 1}}",
                           "{\"ICD\": {\"library_path\": \"/lib/x.so\""}) {
    EXPECT_EQ(manifest_library(write("a.json", text)), "") << text;
  }
  EXPECT_EQ(manifest_library(dir_.path() / "none.json"), "");
  EXPECT_EQ(manifest_library(write("long.json", "{\"ICD\": {\"library_path\": \"/x/y.so\"}}" +
                                                    std::string(64 << 10, ' '))),
            "");
}

TEST_F(DriverFiles, the_library_of_a_named_manifest_and_those_beside_it_can_be_read) {
  const fs::path manifest = write_manifest("icd/gpu.json", "../driver/libgpu.so");
  const fs::path target = write("real/libgpu.so.2");
  const fs::path beside = write("real/libcompiler.so");
  const fs::path secret = write("real/secret.txt");
  fs::create_directories(dir_.path() / "driver");
  fs::create_symlink(target, dir_.path() / "driver/libgpu.so");
  EXPECT_THAT(readable(), Not(Contains(target)));
  for (const fs::path& named : {manifest, manifest.parent_path()}) {  // a file or a folder
    ::setenv("VK_DRIVER_FILES", named.c_str(), 1);
    const std::vector<fs::path> paths = readable();
    for (const fs::path& path : {manifest, target, beside}) EXPECT_THAT(paths, Contains(path));
    EXPECT_THAT(paths, Not(Contains(secret)));
    EXPECT_THAT(paths, Not(Contains(target.parent_path())));
  }
}

TEST_F(DriverFiles, folders_of_vendors_beside_usr_lib_can_be_read) {
  for (const char* path : {"/opt/amdgpu", "/run/opengl-driver", "/nix/store"}) {
    EXPECT_THAT(readable(), Contains(fs::path(path)));
  }
}

}  // namespace
}  // namespace voxeld
