#include "client/cli/bundle.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <sstream>
#include <string_view>

#include "client/cli/output_name.h"
#include "proto/file_names/file_names.h"
#include "proto/file_names/text_encodings.h"
#include "proto/messages/bundle_manifest.h"
#include "proto/text/text_file.h"

namespace voxeld::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// Files that are listed below the mesh's folder, near ones first, to find one under another name.
// Further ones are not found.
constexpr size_t kListedFilesMax = 20'000;
// The header of a PLY or GLB is read up to here.
constexpr size_t kHeaderBytesMax = size_t{1} << 20;
// A stop is noticed after it while a stream is silent.
constexpr int kStreamLookMs = 50;

// The path as the daemon takes it, read in the encoding if it is not UTF-8. nullopt if it is not
// valid there, or if nothing that a manifest may hold is left of it.
std::optional<std::string> bundle_name(const std::string& path, size_t encoding) {
  const auto text = is_utf8(path) ? std::optional(path) : utf8_from(encoding, path);
  auto name = text ? normalized_name(*text) : std::nullopt;
  if (name && is_bundle_file_name(*name)) return name;
  return std::nullopt;
}

// Collects distinct names of existing files inside the mesh's folder. A mesh file may come from
// anyone, and the files it names are sent away. Therefore no name and no symbolic link may lead out
// of the folder.
class Names {
 public:
  explicit Names(fs::path folder) : folder_(folder.empty() ? fs::path(".") : std::move(folder)) {
    std::error_code error;
    real_folder_ = fs::canonical(folder_, error);
  }
  // Adds a name as it is and returns its path as listed; empty if it is refused.
  std::string add(const std::string& name) {
    std::string path = name;
    std::ranges::replace(path, '\\', '/');
    return add_path(fs::path(path).lexically_normal());
  }
  // Adds the file that the daemon will take for the reference: in another case, in another folder
  // below, or in a legacy encoding.
  std::string add_similar(const std::string& reference) {
    if (!is_listed_) list_files();
    const auto found = files_.resolve(reference, "");
    if (!found) return "";
    note_reading(file_names_[found->index], reference);
    return add_path(file_names_[found->index]);
  }
  // Whether it is a file that can be read and has bytes, inside the folder after all links are
  // followed. The daemon takes no empty file.
  bool is_file_inside(const fs::path& path) const {
    std::error_code error;
    const fs::path real = fs::canonical(folder_ / path, error);
    if (error || !fs::is_regular_file(real, error)) return false;
    if (::access(real.c_str(), R_OK) != 0 || fs::file_size(real, error) == 0) return false;
    const fs::path relative = real.lexically_relative(real_folder_);
    return !real_folder_.empty() && !relative.empty() && *relative.begin() != "..";
  }
  std::vector<ReferencedFile> take() const {
    std::vector<ReferencedFile> files;
    for (const std::string& path : list_) {
      const auto reading = readings_.find(path);
      if (reading != readings_.end()) {
        files.push_back({path, reading->second});
      } else if (const auto name = bundle_name(path, kCp437)) {
        files.push_back({path, *name});
      }
    }
    return files;
  }

 private:
  std::string add_path(const fs::path& path) {
    if (path.empty() || path.is_absolute() || *path.begin() == "..") return "";
    if (!is_file_inside(path)) return "";
    if (seen_.insert(path.string()).second) list_.push_back(path.string());
    return path.string();
  }
  // Keeps the first reading of a path by which the daemon finds it for the reference. CP437 need
  // not be kept: references with the same bytes are found by it, as the daemon reads them in it.
  void note_reading(const std::string& path, const std::string& reference) {
    if (is_utf8(path)) return;
    const auto reading = [&](size_t encoding) {
      auto name = bundle_name(path, encoding);
      return name && FileNames({*name}).resolve(reference, "") ? name : std::nullopt;
    };
    if (reading(kCp437)) return;
    for (size_t encoding = 0; encoding < kTextEncodingCount; ++encoding) {
      const auto name = reading(encoding);
      if (name && readings_.try_emplace(path, *name).second) return;
    }
  }
  // Lists by breadth. Hidden folders and links to folders are not entered.
  void list_files() {
    is_listed_ = true;
    std::vector<fs::path> folders = {""};
    for (size_t i = 0; i < folders.size() && file_names_.size() < kListedFilesMax; ++i) {
      std::error_code error;
      std::vector<fs::path> here;
      for (fs::directory_iterator at(folder_ / folders[i], error), end; !error && at != end;
           at.increment(error)) {
        here.push_back(at->path().filename());
        if (here.size() == kListedFilesMax) break;
      }
      std::ranges::sort(here);
      for (const fs::path& name : here) {
        const fs::path path = folders[i] / name;
        const auto status = fs::symlink_status(folder_ / path, error);
        if (!fs::is_directory(status)) file_names_.push_back(path.string());
        if (fs::is_directory(status) && name.native()[0] != '.') folders.push_back(path);
      }
    }
    files_ = FileNames(file_names_);
  }

  fs::path folder_, real_folder_;
  std::set<std::string> seen_;
  std::vector<std::string> list_;
  std::map<std::string, std::string> readings_;  // of paths that are not UTF-8
  bool is_listed_ = false;
  std::vector<std::string> file_names_;  // all below the folder
  FileNames files_;
};

struct Statement {
  std::string key, rest;
};

// A file in memory, with its text as the daemon would read it. Empty if it cannot be read.
class FileText {
 public:
  explicit FileText(const fs::path& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return;
    struct stat info {};
    if (::fstat(descriptor, &info) == 0 && info.st_size > 0) {
      size_ = static_cast<size_t>(info.st_size);
      data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
    }
    ::close(descriptor);
    if (data_ != MAP_FAILED) text_ = plain_text({static_cast<uint8_t*>(data_), size_}, storage_);
  }
  ~FileText() {
    if (data_ != MAP_FAILED) ::munmap(data_, size_);
  }
  FileText(const FileText&) = delete;
  FileText& operator=(const FileText&) = delete;

  // Visits each line, without its end.
  template <typename Visit>
  void for_each_line(Visit&& visit) const {
    for (std::string_view left = text_; !left.empty();) {
      const size_t end = std::min(left.find('\n'), left.size());
      visit(left.substr(0, end));
      left.remove_prefix(std::min(end + 1, left.size()));
    }
  }

 private:
  void* data_ = MAP_FAILED;
  size_t size_ = 0;
  std::string storage_;
  std::string_view text_;
};

// Visits lines "key rest", without comment lines and outer blanks.
template <typename Visit>
void for_each_statement(const fs::path& path, Visit&& visit) {
  FileText(path).for_each_line([&](std::string_view line) {
    const size_t begin = line.find_first_not_of(" \t");
    if (begin == line.npos || line[begin] == '#') return;
    const size_t key_end = std::min(line.find_first_of(" \t\r", begin), line.size());
    const size_t rest = line.find_first_not_of(" \t", key_end);
    const size_t end = line.find_last_not_of(" \t\r") + 1;
    visit(Statement{std::string(line.substr(begin, key_end - begin)),
                    rest < end ? std::string(line.substr(rest, end - rest)) : std::string()});
  });
}

// The offsets of a line's words.
std::vector<size_t> word_starts(const std::string& text) {
  std::vector<size_t> starts;
  for (size_t at = text.find_first_not_of(" \t"); at != std::string::npos;) {
    starts.push_back(at);
    at = text.find_first_not_of(" \t", text.find_first_of(" \t", at));
  }
  return starts;
}

std::string word_at(const std::string& text, size_t start) {
  return text.substr(start, text.find_first_of(" \t", start) - start);
}

// The rest of a line in two versions: unchanged, because a name may contain '#', and without a
// trailing comment.
std::vector<std::string> with_and_without_comment(const std::string& rest) {
  std::vector<std::string> both = {rest};
  for (const size_t start : word_starts(rest)) {
    if (start == 0 || rest[start] != '#') continue;
    both.push_back(rest.substr(0, rest.find_last_not_of(" \t", start - 1) + 1));
    break;
  }
  return both;
}

// Adds a texture. Its name may contain blanks and follows options, some with an unknown number of
// values. It is therefore the longest end of the line that is a file.
void add_texture(const std::string& line, Names& names) {
  const std::vector<std::string> both = with_and_without_comment(line);
  for (const auto add : {&Names::add, &Names::add_similar}) {
    for (const std::string& rest : both) {
      for (const size_t start : word_starts(rest)) {
        if (!(names.*add)(rest.substr(start)).empty()) return;
      }
    }
  }
}

// The names of a mtllib line. Each may contain blanks and ends with ".mtl" or with the line.
std::vector<std::string> library_names(const std::string& line) {
  std::vector<std::string> names;
  size_t begin = 0;
  for (const size_t start : word_starts(line)) {
    const std::string word = word_at(line, start);
    if (begin == start && !names.empty() && word[0] == '#') return names;
    if (!lower_case(word).ends_with(".mtl")) continue;
    names.push_back(line.substr(begin, start + word.size() - begin));
    begin = std::min(line.find_first_not_of(" \t", start + word.size()), line.size());
  }
  if (begin < line.size()) names.push_back(line.substr(begin));
  return names;
}

// Adds the files of a mtllib line: of each name, or otherwise of every word of it. Returns what was
// added.
std::vector<std::string> add_libraries(const std::string& line, Names& names) {
  std::vector<std::string> libraries;
  const auto add = [&](const std::string& text) {
    std::string name = names.add(text);
    if (name.empty()) name = names.add_similar(text);
    if (name.empty()) return false;
    libraries.push_back(std::move(name));
    return true;
  };
  for (const std::string& name : library_names(line)) {
    if (add(name)) continue;
    const std::string plain = with_and_without_comment(name).back();
    for (const size_t start : word_starts(plain)) add(word_at(plain, start));
  }
  return libraries;
}

std::vector<ReferencedFile> files_of_obj(const fs::path& mesh) {
  Names names(mesh.parent_path());
  std::vector<std::string> materials;
  for_each_statement(mesh, [&](const Statement& statement) {
    if (statement.key == "mtllib") {
      std::ranges::move(add_libraries(statement.rest, names), std::back_inserter(materials));
    }
  });
  for (const std::string& material : materials) {
    for_each_statement(mesh.parent_path() / material, [&](const Statement& statement) {
      if (lower_case(statement.key).starts_with("map_")) add_texture(statement.rest, names);
    });
  }
  return names.take();
}

// Trims as the daemon does when it reads a URI.
std::string without_outer_blanks(const std::string& uri) {
  const auto is_blank = [](unsigned char c) { return c <= 0x20; };
  const auto begin = std::ranges::find_if_not(uri, is_blank);
  const auto end = std::find_if_not(uri.rbegin(), std::make_reverse_iterator(begin), is_blank);
  return {begin, end.base()};
}

// The JSON of a .gltf, or of a .glb, whose buffers and images may be files, too.
std::string gltf_json(const fs::path& mesh) {
  std::ifstream file(mesh, std::ios::binary);
  std::array<unsigned char, 20> head{};  // file header of GLB, and header of its first chunk
  file.read(reinterpret_cast<char*>(head.data()), head.size());
  const std::string_view magic(reinterpret_cast<const char*>(head.data()), 4);
  if (magic != "glTF") {
    file.clear();
    file.seekg(0);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  size_t bytes = 0;
  for (size_t i = 16; i-- > 12;) bytes = bytes << 8 | head[i];
  std::error_code error;
  const auto file_bytes = fs::file_size(mesh, error);
  if (error || bytes > file_bytes) return "";
  std::string json(bytes, '\0');
  file.read(json.data(), static_cast<std::streamsize>(bytes));
  return json;
}

std::vector<ReferencedFile> files_of_gltf(const fs::path& mesh) {
  Names names(mesh.parent_path());
  // A broken document is sent unchanged, so the daemon reports the error.
  const Json document = Json::parse(gltf_json(mesh), nullptr, false);
  for (const char* list : {"buffers", "images"}) {
    if (!document.is_object() || !document.contains(list) || !document[list].is_array()) continue;
    for (const Json& item : document[list]) {
      if (!item.is_object() || !item.contains("uri") || !item["uri"].is_string()) continue;
      const std::string uri = without_outer_blanks(item["uri"].get<std::string>());
      if (uri.starts_with("data:")) continue;
      if (names.add(percent_decoded(uri)).empty() && names.add(uri).empty()) names.add_similar(uri);
    }
  }
  return names.take();
}

// The textures of "comment TextureFile NAME", where "<this>" is the stem of the mesh's own name.
std::vector<ReferencedFile> files_of_ply(const fs::path& mesh) {
  Names names(mesh.parent_path());
  std::ifstream file(mesh, std::ios::binary);
  std::string header(kHeaderBytesMax, '\0');
  file.read(header.data(), static_cast<std::streamsize>(header.size()));
  header.resize(static_cast<size_t>(file.gcount()));
  header.resize(std::min(header.find("end_header"), header.size()));
  std::ranges::replace(header, '\r', '\n');
  constexpr std::string_view kKey = "TextureFile", kThis = "<this>";
  std::istringstream lines(header);
  for (std::string line; std::getline(lines, line);) {
    const std::vector<size_t> words = word_starts(line);
    if (words.size() < 3 || word_at(line, words[0]) != "comment") continue;
    if (!equals_ignoring_case(word_at(line, words[1]), kKey)) continue;
    std::string name = line.substr(words[2], line.find_last_not_of(" \t") + 1 - words[2]);
    for (size_t at = 0; (at = lower_case(name).find(kThis, at)) != name.npos;) {
      const std::string stem = mesh.stem().string();
      name.replace(at, kThis.size(), stem);
      at += stem.size();
    }
    if (names.add(name).empty()) names.add_similar(name);
  }
  return names.take();
}

bool is_image(const fs::path& path) {
  static const std::set<std::string> extensions = {".tga", ".png", ".jpg", ".jpeg", ".dds", ".bmp"};
  return extensions.contains(lower_case(path.extension().string()));
}

// The name in lower case, without folders and extension. Shaders, materials and files are matched
// by it.
std::string stem_of(std::string name) {
  std::ranges::replace(name, '\\', '/');
  return lower_case(fs::path(name).stem().string());
}

// Names of joints: the first quoted text in each line of the block `name`.
std::set<std::string> md5_joints(const fs::path& path, std::string_view block) {
  std::set<std::string> joints;
  enum { kBefore, kInside, kBehind } place = kBefore;
  FileText(path).for_each_line([&](std::string_view line) {
    const size_t begin = line.find_first_not_of(" \t\r");
    if (begin == line.npos || place == kBehind) return;
    if (place == kBefore) {
      if (line.substr(begin).starts_with(block)) place = kInside;
      return;
    }
    if (line[begin] == '}') {
      place = kBehind;
      return;
    }
    const size_t quote = line.find('"');
    const size_t end = quote == line.npos ? quote : line.find('"', quote + 1);
    if (end != line.npos) joints.emplace(line.substr(quote + 1, end - quote - 1));
  });
  return joints;
}

// Adds the animations in `files` that have the joints of the mesh.
void add_animations(const fs::path& mesh, const std::vector<fs::path>& files, Names& names) {
  std::set<std::string> joints;
  for (const fs::path& file : files) {
    if (lower_case(file.extension().string()) != ".md5anim") continue;
    if (joints.empty()) joints = md5_joints(mesh, "joints");
    if (md5_joints(file, "hierarchy") == joints) names.add(file.filename().string());
  }
}

// The folder's animations and material files, and its images named like a shader of the mesh or a
// material. The daemon decides which of them apply.
std::vector<ReferencedFile> files_of_md5(const fs::path& mesh) {
  std::set<std::string> wanted;
  for_each_statement(mesh, [&](const Statement& statement) {
    if (statement.key != "shader") return;
    const size_t begin = statement.rest.find_first_not_of('"');
    if (begin == std::string::npos) return;
    const size_t end = std::min(statement.rest.find('"', begin), statement.rest.size());
    const std::string stem = stem_of(statement.rest.substr(begin, end - begin));
    wanted.insert({stem, stem + "_d"});
  });
  const fs::path folder = mesh.has_parent_path() ? mesh.parent_path() : fs::path(".");
  Names names(folder);
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (names.is_file_inside(entry.path().filename())) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    if (lower_case(file.extension().string()) != ".mtr") continue;
    names.add(file.filename().string());
    std::ifstream text(file);
    for (std::string word; text >> word;) wanted.insert(stem_of(word));
  }
  for (const fs::path& file : files) {
    if (is_image(file) && wanted.contains(stem_of(file.filename().string()))) {
      names.add(file.filename().string());
    }
  }
  add_animations(mesh, files, names);
  return names.take();
}

// A file and its name in the bundle.
struct Entry {
  fs::path path;
  std::string name;
};

// The mesh first, then the files it names, then the files beside it under their own names.
std::vector<Entry> entries_of(const fs::path& mesh, std::span<const std::string> beside) {
  // The extension of a mesh tells its format.
  const auto name_of_mesh = bundle_name(mesh.filename().string(), kCp437);
  std::vector<Entry> entries = {{mesh, name_of_mesh.value_or("mesh" + mesh.extension().string())}};
  std::vector<Entry> given;
  std::set<std::string> taken = {entries[0].name};
  for (const std::string& path : beside) {
    std::error_code error;
    if (!fs::is_regular_file(path, error)) {
      throw client::Error("file", 0, path + ": is no file that can be read");
    }
    if (fs::file_size(path, error) == 0) throw client::Error("file", 0, path + ": is empty");
    const auto name = bundle_name(fs::path(path).filename().string(), kCp437);
    if (!name) throw client::Error("file", 0, path + ": no file of a bundle may have this name");
    if (!taken.insert(*name).second) {
      throw client::Error("file", 0, path + ": another file of the command line has this name");
    }
    given.push_back({path, *name});
  }
  for (const ReferencedFile& file : referenced_files(mesh)) {
    if (!taken.insert(file.name).second) continue;
    entries.push_back({mesh.parent_path() / file.path, file.name});
  }
  std::ranges::move(given, std::back_inserter(entries));
  return entries;
}

// Waits until there is something to read, or the end. A read that blocks would not notice a stop.
void await_input(int descriptor, const std::stop_token& stop) {
  pollfd input{descriptor, POLLIN, 0};
  while (::poll(&input, 1, kStreamLookMs) <= 0) {
    if (stop.stop_requested()) throw client::Error("interrupted", 0, "stopped by the caller");
  }
}

// Reads stdin, or a pipe that `owner` closes.
client::Source stream_source(int descriptor, std::shared_ptr<const void> owner,
                             const std::string& name, const std::string& filename,
                             const std::stop_token& stop) {
  // The daemon ends an upload that is silent: the connection waits until what writes has begun.
  await_input(descriptor, stop);
  return client::Source::stream(
      [descriptor, owner = std::move(owner), name, stop](std::span<std::byte> buffer) {
        await_input(descriptor, stop);
        const ssize_t count = ::read(descriptor, buffer.data(), buffer.size());
        if (count < 0) {
          throw client::Error("file", 0, name + " cannot be read: " + std::strerror(errno));
        }
        return static_cast<size_t>(count);
      },
      filename);
}

// The descriptor of a pipe, which the last copy closes.
std::shared_ptr<const int> open_pipe(const fs::path& pipe) {
  // Not blocking: an open that waits for who writes would not notice a stop either.
  const int descriptor = ::open(pipe.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) throw client::Error("file", 0, pipe.string() + ": " + std::strerror(errno));
  return {new int(descriptor), [](const int* opened) {
            ::close(*opened);
            delete opened;
          }};
}

}  // namespace

std::shared_ptr<const int> await_stream(const std::string& input, const std::stop_token& stop) {
  std::error_code error;
  if (input == "-") {
    await_input(STDIN_FILENO, stop);
    return nullptr;
  }
  if (!fs::is_fifo(input, error)) return nullptr;
  std::shared_ptr<const int> pipe = open_pipe(input);
  await_input(*pipe, stop);
  return pipe;
}

std::vector<ReferencedFile> referenced_files(const fs::path& mesh) {
  const std::string extension = lower_case(mesh.extension().string());
  if (extension == ".obj") return files_of_obj(mesh);
  if (extension == ".gltf" || extension == ".glb") return files_of_gltf(mesh);
  if (extension == ".ply") return files_of_ply(mesh);
  if (extension == ".md5mesh") return files_of_md5(mesh);
  return {};
}

MeshSource MeshSource::open(const std::string& input, std::span<const std::string> beside,
                            const std::stop_token& stop, std::shared_ptr<const int> pipe) {
  if (input == "-") {
    if (beside.empty()) {
      return MeshSource(stream_source(STDIN_FILENO, nullptr, "stdin", "", stop));
    }
    throw client::Error("file", 0, "stdin cannot be sent together with other files");
  }
  const fs::path mesh(input);
  std::error_code error;
  if (fs::is_directory(mesh, error))
    throw client::Error("file", 0, input + ": is a folder, expected a mesh file");
  if (pipe || fs::is_fifo(mesh, error)) {
    if (!beside.empty()) {
      throw client::Error("file", 0, input + ": a pipe cannot be sent together with other files");
    }
    if (!pipe) pipe = open_pipe(mesh);
    return MeshSource(stream_source(*pipe, pipe, input, mesh.filename().string(), stop));
  }
  const std::vector<Entry> entries = entries_of(mesh, beside);
  if (entries.size() == 1) return MeshSource(client::Source::file(mesh));
  std::vector<client::Source> sources;
  std::vector<fs::path> files;
  for (const Entry& entry : entries) {
    if (::access(entry.path.c_str(), R_OK) != 0) {
      throw client::Error("file", 0, entry.path.string() + ": " + std::strerror(errno));
    }
    sources.push_back(client::Source::file(entry.path, entry.name));
    files.push_back(entry.path);
  }
  MeshSource result(client::Source::bundle(std::move(sources)));
  result.files_ = std::move(files);
  return result;
}

void MeshSource::check_output(const std::string& output) const {
  std::error_code error;
  for (const fs::path& file : files_) {
    if (!fs::equivalent(file, output, error)) continue;
    throw client::Error("invalid-option", 0,
                        output + " belongs to " + files_.front().string() + " and would be lost");
  }
}

}  // namespace voxeld::cli
