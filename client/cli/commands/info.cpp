#include "client/cli/commands/info.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "client/cli/bundle.h"
#include "client/cli/commands/job_result.h"
#include "client/cli/output_name.h"
#include "client/cli/terminal/human.h"
#include "client/cli/terminal/progress_bar.h"
#include "client/cli/terminal/report.h"
#include "client/include/voxeld/client.h"
#include "proto/container/sequence_format.h"
#include "proto/output_format.h"

namespace voxeld::cli {
namespace {

using client::Client;
using client::Error;
using client::JobInfo;
using Json = nlohmann::json;

constexpr size_t kNamesShown = 8;  // of materials and animations; --json has all

std::vector<std::byte> read_whole(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<std::byte> bytes;
  std::vector<char> buffer(1 << 20);
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    const auto piece = std::as_bytes(std::span(buffer).first(static_cast<size_t>(file.gcount())));
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  }
  if (!file.is_open() || file.bad()) throw Error("file", 0, path + ": " + std::strerror(errno));
  return bytes;
}

std::string number_text(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

// "a, b, c"; at most kNamesShown of them, then how many more there are.
std::string joined(const std::vector<std::string>& names, std::int64_t total) {
  std::string text;
  const size_t shown = std::min(names.size(), kNamesShown);
  for (size_t i = 0; i < shown; ++i) text += (i == 0 ? "" : ", ") + names[i];
  const std::int64_t more = total - static_cast<std::int64_t>(shown);
  return more > 0 ? text + " and " + count_text(more) + " more" : text;
}

// --- grids and sequences

// What `decode` returns. Its errors lack the name of the file, which is no response of a daemon.
template <typename Decode>
auto decoded(const std::string& path, Decode&& decode) {
  try {
    return decode();
  } catch (const Error& error) {
    throw Error("malformed-mesh", 0, path + ": " + error.what());
  }
}

// The unit of lengths, that the request gave (`units`); empty: not given.
std::string unit_of(const std::string& meta_json) {
  const Json meta = parsed(meta_json);
  const Json units = meta.is_object() ? meta.value("units", Json()) : Json();
  return units.is_string() ? " " + units.get<std::string>() : "";
}

// Adds the placement of a grid or a sequence.
template <typename Voxels>
void add_place(const Voxels& voxels, Table& table) {
  const auto dims = voxels.dims();
  const auto origin = voxels.origin(), edge = voxels.voxel_size();
  const std::string unit = unit_of(voxels.meta_json());
  const bool is_cube = edge[0] == edge[1] && edge[1] == edge[2];
  std::string holds = "occupancy";
  for (const std::string_view channel : voxels.channels()) holds += ", " + std::string(channel);
  table.add({"size", count_text(dims[0]) + " x " + count_text(dims[1]) + " x " +
                         count_text(dims[2]) + " cells"});
  std::string edges = number_text(edge[0]);
  if (!is_cube) edges += " x " + number_text(edge[1]) + " x " + number_text(edge[2]);
  table.add({"voxel size", edges + unit});
  table.add({"origin", number_text(origin[0]) + ", " + number_text(origin[1]) + ", " +
                           number_text(origin[2]) + unit});
  table.add({"channels", holds});
}

void info_of_grid(const Arguments& arguments) {
  const std::vector<std::byte> bytes = read_whole(arguments.input);
  const client::Grid grid = decoded(arguments.input, [&] { return client::Grid::decode(bytes); });
  if (arguments.json) {
    print_json({{"dims", grid.dims()},
                {"origin", grid.origin()},
                {"voxel_size", grid.voxel_size()},
                {"voxel_count", grid.voxel_count()},
                {"color", grid.has_color()},
                {"normal", grid.has_normal()},
                {"channels", grid.channels()},
                {"bytes", bytes.size()},
                {"meta", parsed(grid.meta_json())}});
    return;
  }
  Table table("ll");
  add_place(grid, table);
  table.add({"voxels", count_text(static_cast<std::int64_t>(grid.voxel_count()))});
  table.add({"file", bytes_text(static_cast<std::int64_t>(bytes.size()))});
  std::fputs(table.text().c_str(), stdout);
}

void info_of_sequence(const Arguments& arguments) {
  std::vector<std::byte> container = read_whole(arguments.input);
  const size_t bytes = container.size();
  const auto sequence =
      decoded(arguments.input, [&] { return client::Sequence::decode(std::move(container)); });
  const size_t count = sequence.frame_count();
  if (arguments.json) {
    Json frames = Json::array();
    for (size_t i = 0; i < count; ++i) {
      frames.push_back({{"time_s", sequence.time_s(i)}, {"voxel_count", sequence.voxel_count(i)}});
    }
    print_json({{"dims", sequence.dims()},
                {"origin", sequence.origin()},
                {"voxel_size", sequence.voxel_size()},
                {"channels", sequence.channels()},
                {"fps", sequence.fps()},
                {"frames", frames},
                {"bytes", bytes},
                {"meta", parsed(sequence.meta_json())}});
    return;
  }
  Table table("ll");
  add_place(sequence, table);
  table.add({"frames", count_text(static_cast<std::int64_t>(count)) + ", " +
                           number_text(sequence.time_s(0)) + " s to " +
                           number_text(sequence.time_s(count - 1)) + " s"});
  table.add({"file", bytes_text(static_cast<std::int64_t>(bytes))});
  std::fputs(table.text().c_str(), stdout);
}

// --- meshes

std::string bounds_text(const Json& bounds) {
  std::string from, to, size;
  for (size_t i = 0; i < 3; ++i) {
    const double low = bounds["min"][i].get<double>(), high = bounds["max"][i].get<double>();
    const char* comma = i == 0 ? "" : ", ";
    from += comma + number_text(low);
    to += comma + number_text(high);
    size += (i == 0 ? "" : " x ") + number_text(high - low);
  }
  return size + ", from " + from + " to " + to;
}

std::vector<std::string> names_of(const Json& list) {
  std::vector<std::string> names;
  for (const Json& item : list) {
    const std::string name = item.value("name", "");
    names.push_back(name.empty() ? "(no name)" : name);
  }
  return names;
}

std::string animation_text(const Json& animation) {
  std::string text = animation.value("name", "");
  const Json frames = animation.value("frames", Json());
  text += " (";
  if (frames.is_number_integer()) text += count_text(frames.get<std::int64_t>()) + " frames, ";
  text += number_text(animation.value("duration_s", 0.0)) + " s";
  return text + (animation.value("unusable", Json()).is_null() ? ")" : ", cannot be used)");
}

// Whether the mesh closes, and what is wrong with it otherwise.
std::string surface_text(const Json& mesh) {
  const Json watertight = mesh.value("watertight", Json());
  if (!watertight.is_boolean()) return "too large to be examined";
  std::string text = watertight.get<bool>() ? "watertight" : "not watertight";
  for (const auto& [name, words] : {std::pair("open_edges", " open edges"),
                                    std::pair("non_manifold_edges", " non-manifold edges"),
                                    std::pair("flipped_edges", " flipped edges"),
                                    std::pair("degenerate_triangles", " degenerate triangles")}) {
    const Json count = mesh.value(name, Json());
    if (count.is_number_integer() && count != 0) {
      text += ", " + count_text(count.get<std::int64_t>()) + words;
    }
  }
  return text;
}

void print_mesh(const Json& mesh, const std::string& asset) {
  const auto count = [&](const char* name) {
    const Json value = mesh.value(name, Json());
    return value.is_number_integer() ? value.get<std::int64_t>() : std::int64_t{0};
  };
  Table table("ll");
  table.add({"format", mesh.value("format", "")});
  const Json voxels = mesh.value("voxels", Json());
  if (voxels.is_object()) {
    std::string dims;
    for (const Json& side : voxels["dims"]) {
      dims += (dims.empty() ? "" : " x ") + count_text(side.get<std::int64_t>());
    }
    table.add({"cells", dims});
    table.add({"voxels", count_text(voxels.value("voxel_count", std::int64_t{0}))});
  } else {
    table.add({"triangles", count_text(count("triangles"))});
  }
  if (count("vertices") > 0) table.add({"vertices", count_text(count("vertices"))});
  if (const Json bounds = mesh.value("bounds", Json()); bounds.is_object()) {
    table.add({"bounds", bounds_text(bounds)});
  }
  if (!voxels.is_object()) table.add({"surface", surface_text(mesh)});
  if (count("components") > 0) table.add({"components", count_text(count("components"))});
  table.add({"colours", mesh.value("has_colors", false) ? "yes" : "no"});
  if (count("material_count") > 0) {
    table.add({"materials", joined(names_of(mesh["materials"]), count("material_count"))});
  }
  if (count("joint_count") > 0) table.add({"joints", count_text(count("joint_count"))});
  if (count("animation_count") > 0) {
    std::vector<std::string> animations;
    for (const Json& animation : mesh["animations"])
      animations.push_back(animation_text(animation));
    table.add({"animations", joined(animations, count("animation_count"))});
  }
  if (const Json missing = mesh.value("missing_files", Json::array()); !missing.empty()) {
    table.add({"missing", joined(names_of(missing), static_cast<std::int64_t>(missing.size()))});
  }
  table.add({"asset", asset});
  std::fputs(table.text().c_str(), stdout);
}

void info_of_mesh(const Arguments& arguments, const std::stop_token& stop) {
  Client daemon(settings_of(arguments));
  const MeshSource mesh = MeshSource::open(arguments.input, arguments.beside, stop, arguments.pipe);
  ProgressBar bar(arguments.quiet);
  const std::string asset = daemon.upload(
      mesh.source(),
      [&](const client::Progress& progress) {
        bar.show(progress);
        return true;
      },
      stop);
  client::Options options;
  if (!mesh.source().filename().empty()) options.set("filename", mesh.source().filename());
  JobInfo job = daemon.submit("inspect", client::Input::of_asset(asset), options, stop);
  job = wait_or_cancel(daemon, job.id, {}, stop);
  bar.clear();
  Json meta = parsed(job.meta_json);
  if (arguments.json) {
    meta["id"] = asset;
    print_json(meta);
    return;
  }
  tell_warnings(arguments, job);
  if (!meta.is_object()) throw Error("bad-response", 0, "the response describes no mesh");
  print_mesh(meta, asset);
}

std::string extension_of(const std::string& path) {
  return lower_case(std::filesystem::path(path).extension().string());
}

}  // namespace

bool is_container(const std::string& path) {
  const std::string extension = extension_of(path);
  return extension == format_extension(Format::kNative) ||
         extension == sequence_extension(Format::kNative);
}

void run_info(const Arguments& arguments, const std::stop_token& stop) {
  const std::string extension = extension_of(arguments.input);
  if (extension == format_extension(Format::kNative)) return info_of_grid(arguments);
  if (extension == sequence_extension(Format::kNative)) return info_of_sequence(arguments);
  info_of_mesh(arguments, stop);
}

}  // namespace voxeld::cli
