// The configuration file of voxel, TOML:
//
//   url = "https://voxels.example.org"
//   key_file = "/home/me/.config/voxeld/key"
#pragma once

#include <filesystem>
#include <string>

namespace voxeld::cli {

struct ConfigFile {
  std::string url;
  std::filesystem::path key_file;  // of that URL, or of the default one; "~/" is $HOME
};

// $XDG_CONFIG_HOME/voxeld/config.toml, else ~/.config/voxeld/config.toml; empty without either
// variable.
std::filesystem::path config_file_path();

// All empty without a file. Throws client::Error "invalid-option" for an unknown name or a line
// that is no TOML, "file" if it cannot be read.
ConfigFile read_config_file(const std::filesystem::path& path);

}  // namespace voxeld::cli
