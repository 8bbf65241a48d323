// libvoxeld_client: talks to a voxeld daemon. C++20; no HTTP or JSON library shows in this header.
//
//   voxeld::client::Client client("http://127.0.0.1:8080");
//   voxeld::client::Options options;
//   options.set("size", "256");
//   auto grid = client.voxelize(voxeld::client::Source::file("bunny.ply"), options);
//   grid.for_each([](const voxeld::client::Voxel& voxel) { ... });
//
// Every failure is a voxeld::client::Error. A Client may be used by one thread at a time; several
// Clients are independent. Jobs keep working when the Client that made them is gone.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#define VOXELD_CLIENT_API __attribute__((visibility("default")))

namespace voxeld::client {

// What went wrong. code() is the stable name of the API ("invalid-option", "grid-too-large", …), or
// one of the client's own: "unreachable" (no connection), "timeout", "interrupted" (stopped by the
// caller), "bad-answer" (not a voxeld daemon), "content-mismatch" (a download whose bytes are not
// those that its content id names), "file" (a local file).
class VOXELD_CLIENT_API Error : public std::runtime_error {
 public:
  Error(std::string code, int http_status, const std::string& message, std::string expected = "",
        std::string got = "", std::string request_id = "");
  ~Error() override;
  const std::string& code() const { return code_; }
  int http_status() const { return http_status_; }  // 0: no answer
  const std::string& expected() const { return expected_; }
  const std::string& got() const { return got_; }
  const std::string& request_id() const { return request_id_; }

 private:
  std::string code_, expected_, got_, request_id_;
  int http_status_;
};

struct Settings {
  std::string url = "http://127.0.0.1:8080";
  // API key ("vxk_…"), empty for a daemon that needs none. Sent to `url` alone, with every request.
  std::string key;
  std::chrono::seconds connect_timeout{10};
  // For one exchange with the daemon (the upload, one look at the job, the download); zero: none.
  std::chrono::seconds timeout{0};
  // Further tries after 429, 503 or a refused connection, with a pause that doubles from 200 ms (or
  // what Retry-After says). An interrupted download is resumed where it stopped.
  int retries = 3;
};

// Names and values as in the API: set("size", "256"), and of a job set("priority", "20") and
// set("deadline_ms", "60000"). They are checked by the daemon.
class VOXELD_CLIENT_API Options {
 public:
  Options& set(std::string name, std::string value);
  bool has(std::string_view name) const;
  const std::vector<std::pair<std::string, std::string>>& pairs() const { return pairs_; }

 private:
  std::vector<std::pair<std::string, std::string>> pairs_;
};

// Where the bytes of a mesh come from. Files and streams are sent piece by piece.
class VOXELD_CLIENT_API Source {
 public:
  // `filename` names the format ("a.ply"); empty: the path's own name.
  static Source file(std::filesystem::path path, std::string filename = "");
  // Here an empty `filename` leaves the format to the first bytes.
  static Source memory(std::vector<std::byte> bytes, std::string filename);
  // Fills the buffer and returns how many bytes; 0 at the end. Called until then, once.
  static Source stream(std::function<size_t(std::span<std::byte>)> read, std::string filename);

  const std::string& filename() const { return filename_; }

 private:
  friend class ClientImpl;
  std::filesystem::path path_;
  std::vector<std::byte> bytes_;
  std::function<size_t(std::span<std::byte>)> read_;
  std::string filename_;
};

using Color = std::array<std::uint8_t, 4>;  // sRGB R, G, B and linear A
using Normal = std::array<std::int8_t, 3>;  // unit normal times 127

// One voxel of a grid, with what its channels say: 0 for channels that the grid does not have.
struct Voxel {
  int x = 0, y = 0, z = 0;
  bool has_attributes = false;  // false for the inside of a solid: channels are 0, coverage 255
  Color color{};
  Normal normal{};
  std::uint16_t material = 0, label = 0;  // ids; meta_json() names them
  float distance = 0;                     // signed, in voxels
  std::uint8_t coverage = 0;              // 255: all of it
};

// A sparse grid, decoded. Cell (x,y,z) covers origin + voxel_size * [x,x+1) x [y,y+1) x [z,z+1).
class VOXELD_CLIENT_API Grid {
 public:
  // Decodes a native container (.voxg). Throws Error "bad-answer".
  static Grid decode(std::span<const std::byte> container);
  Grid(Grid&&) noexcept;
  Grid& operator=(Grid&&) noexcept;
  ~Grid();

  std::array<int, 3> dims() const;
  std::array<double, 3> origin() const;
  std::array<double, 3> voxel_size() const;
  std::uint64_t voxel_count() const;
  bool has_color() const;
  bool has_normal() const;
  // "color", "normal", "material", "label", "distance", "coverage": those that the grid has.
  std::vector<std::string_view> channels() const;
  const std::string& meta_json() const;

  bool occupied(int x, int y, int z) const;
  // nullopt where the cell is empty, or the grid or this voxel (the inside of a solid) has no
  // colour.
  std::optional<Color> color(int x, int y, int z) const;
  // nullopt where the cell is empty.
  std::optional<Voxel> voxel(int x, int y, int z) const;
  // Every voxel, in Morton order within each tile.
  void for_each(const std::function<void(const Voxel&)>& visit) const;
  // The same; `color` and `normal` are null where the
  // grid or the voxel (the inside of a solid) has none.
  void for_each(const std::function<void(int x, int y, int z, const Color* color,
                                         const Normal* normal)>& visit) const;
  // One byte per cell, x fastest, 1 = occupied: dims[0]*dims[1]*dims[2] bytes.
  std::vector<std::uint8_t> dense() const;

 private:
  friend class Sequence;
  struct Impl;
  explicit Grid(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// The grids of an animation's frames, all in one place of the world. Frames are decoded when they
// are asked for; in their order it is fastest, as each is told by what changed. One thread at a
// time.
class VOXELD_CLIENT_API Sequence {
 public:
  // Takes a native container (.voxs) over. Throws Error "bad-answer".
  static Sequence decode(std::vector<std::byte> container);
  Sequence(Sequence&&) noexcept;
  Sequence& operator=(Sequence&&) noexcept;
  ~Sequence();

  std::array<int, 3> dims() const;
  std::array<double, 3> origin() const;
  std::array<double, 3> voxel_size() const;
  std::vector<std::string_view> channels() const;  // as Grid's
  const std::string& meta_json() const;
  double fps() const;  // 0 where frames are at times of their own
  std::size_t frame_count() const;
  // Of frame `index`. Throw Error "not-found" where there is no such frame, frame() also
  // "bad-answer".
  double time_s(std::size_t index) const;
  std::uint64_t voxel_count(std::size_t index) const;
  Grid frame(std::size_t index);

 private:
  struct Impl;
  explicit Sequence(std::unique_ptr<Impl> impl);
  void check_frame(std::size_t index) const;
  std::unique_ptr<Impl> impl_;
};

struct Progress {
  std::string stage;                 // "upload", "queued", "parse", "voxelize", "download", …
  std::int64_t done = 0, total = 0;  // total 0: unknown
  std::string unit = "bytes";        // what is counted: "bytes", "tiles" or "frames"
};
// Return false to stop: the job is cancelled and Error "interrupted" thrown.
using ProgressCallback = std::function<bool(const Progress&)>;

struct JobInfo {
  std::string id, kind, state;  // state: queued, running, done, failed, cancelled
  std::string stage;
  std::int64_t tiles_done = 0, tiles_total = 0, queue_position = 0, bytes = 0;
  std::int64_t frames_done = 0, frames_total = 0;  // 0, 0: one grid, no sequence
  std::string grid, sequence, media_type;
  std::vector<std::string> warnings;  // "missing-texture: skin.png"
  std::string meta_json;              // of the result
  std::string json;                   // the whole status
  bool ended() const { return state == "done" || state == "failed" || state == "cancelled"; }
};

// Who works and who waits, as far as the key's holder may know.
struct QueueDevice {
  std::string device, renderer;
  std::int64_t workers = 0;  // that are connected
  std::int64_t workers_busy = 0;
  std::vector<std::string> jobs;  // ids of those on it that are the holder's
};
struct QueuedJob {
  JobInfo job;
  std::string tenant, device;                   // device: that runs it, or empty
  std::int64_t created_ms = 0, started_ms = 0;  // Unix time
};
struct Queue {
  std::vector<QueueDevice> devices;
  std::vector<QueuedJob> jobs;                         // running ones, then by position
  std::int64_t queued = 0, running = 0;                // of all tenants
  std::int64_t others_queued = 0, others_running = 0;  // of other tenants
  std::string json;                                    // the whole answer
};

// A frame that a job has finished.
struct FrameInfo {
  std::int64_t index = 0;
  double time_s = 0;
  std::string grid;  // its id; equal frames have the same
  std::uint64_t voxel_count = 0;
  std::string content_hash;
};

// What there is of a job's sequence by now.
struct JobFrames {
  std::string sequence;  // its id; empty until all frames are done
  std::int64_t total = 0;
  std::vector<FrameInfo> frames;
};

// What a job works on: one of the three is set.
struct Input {
  std::string asset;     // what upload() or bundle() returned
  std::string grid;      // JobInfo::grid
  std::string sequence;  // JobInfo::sequence
  static Input of_asset(std::string id) { return {std::move(id), "", ""}; }
  static Input of_grid(std::string id) { return {"", std::move(id), ""}; }
  static Input of_sequence(std::string id) { return {"", "", std::move(id)}; }
};

// A file of a bundle, by the name that the others refer to it with, and the id of its upload.
struct BundleFile {
  std::string name, asset;
};

// Gets pieces of a result in order.
using Sink = std::function<void(std::span<const std::byte>)>;

// Whoever has the URL may fetch what it names, without a key, until it expires.
struct Link {
  std::string url;
  std::int64_t expires_ms = 0;  // Unix time
};

class ClientImpl;

// One daemon. Progress callbacks run on the calling thread.
class VOXELD_CLIENT_API Client {
 public:
  explicit Client(Settings settings);
  explicit Client(std::string url);
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;
  ~Client();

  // --- the whole way in one call. `stop` and the callback cancel the job.
  Grid voxelize(const Source& source, const Options& options, const ProgressCallback& progress = {},
                const std::stop_token& stop = {});
  // The same for an animation: options name it ("animation", "fps", "frames", …).
  Sequence voxelize_sequence(const Source& source, const Options& options,
                             const ProgressCallback& progress = {},
                             const std::stop_token& stop = {});
  // Any format: what options name with "format".
  JobInfo voxelize_to(const Source& source, const Options& options, const Sink& sink,
                      const ProgressCallback& progress = {}, const std::stop_token& stop = {});
  // A picture: what options name with "picture", else a PNG.
  JobInfo render_to(const Source& source, const Options& options, const Sink& sink,
                    const ProgressCallback& progress = {}, const std::stop_token& stop = {});

  // --- step by step
  // The asset's id.
  std::string upload(const Source& source, const ProgressCallback& progress = {},
                     const std::stop_token& stop = {});
  // Ties uploads together as one asset, whose id is returned: a new animation for an old mesh costs
  // only itself.
  std::string bundle(std::span<const BundleFile> files);
  std::string asset_json(std::string_view asset);
  // kind: voxelize, inspect (of an asset), render (of any), export (of a grid or sequence).
  JobInfo submit(std::string_view kind, const Input& input, const Options& options);
  JobInfo job(std::string_view id);
  // Until the job has ended. Throws the job's own error when it failed.
  JobInfo wait(std::string_view id, const ProgressCallback& progress = {},
               const std::stop_token& stop = {});
  JobInfo cancel(std::string_view id);
  // The frames that are done, also while the job runs, and after it was cancelled.
  JobFrames frames(std::string_view job);
  // One of them. Throws Error "not-found" where it is not done yet.
  Grid frame(std::string_view job, std::int64_t index);
  std::vector<JobInfo> jobs(int limit = 100);
  // At most `limit` jobs that wait; an admin's key shows those of all tenants.
  Queue queue(int limit = 100);
  // Resumes by itself when the connection breaks. Throws "bad-answer" when the result is then
  // another one; the sink has the beginning of the old one. Throws "content-mismatch" at the end
  // when the bytes do not have the hash that the daemon names; the sink has all of them.
  void download(std::string_view job, const Sink& sink, const ProgressCallback& progress = {},
                const std::stop_token& stop = {});
  // Deletes what the id names, so that it counts no more: of a job its result, else the asset, grid
  // or sequence of that id. Says which: "result", "asset", "grid" or "sequence". Throws
  // "not-found"; "gone" where it was deleted already; "conflict" for a job that has not ended, and
  // for a frame.
  std::string remove(std::string_view id);
  // A page of what is kept, as the JSON object of GET /v1/assets, /v1/results, /v1/grids or
  // /v1/sequences. what: "assets", …; after: "next" of the page before.
  std::string list_json(std::string_view what, int limit = 100, std::string_view after = {});
  // A link to a job's result. options: of the result ("format", …). Throws Error "invalid-option"
  // for more than 30 days.
  Link share(std::string_view job, std::chrono::seconds lifetime, const Options& options = {});
  // Whose key this is, its tenant's limits and what it uses of them: the JSON object of GET /v1/me.
  std::string whoami_json();

 private:
  std::unique_ptr<ClientImpl> impl_;
};

}  // namespace voxeld::client
