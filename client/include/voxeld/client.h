// libvoxeld_client: a client of the voxeld daemon. C++20; this header needs no HTTP or JSON
// library.
//
//   using namespace voxeld::client;
//   Client client("http://127.0.0.1:8080");
//   Grid grid = client.voxelize(Source::file("bunny.ply"), Options().size(256).fill(Fill::kSolid));
//   grid.for_each([](const Voxel& voxel) { ... });
//   grid.save("bunny.vox", Options().palette(16));
//
// Every failure is an Error. A Client may be used by one thread at a time; several Clients are
// independent. The daemon goes on with a job when the Client that submitted it is gone.
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
#include <variant>
#include <vector>

#include "options.h"

namespace voxeld::client {

// A failure. code() is the stable name of the API ("invalid-option", "grid-too-large", …), or one
// of the client's own: "unreachable" (no connection), "timeout", "interrupted" (stopped by the
// caller), "bad-response" (not a voxeld daemon), "content-mismatch" (the bytes of a download do not
// match its content id), "file" (a local file, or arrays that are no mesh). what() is the whole
// text, "size: expected an integer from 1 to 16384, got 0": it needs neither code() nor expected()
// and got() beside it.
class VOXELD_CLIENT_API Error : public std::runtime_error {
 public:
  Error(std::string code, int http_status, const std::string& message, std::string expected = "",
        std::string got = "", std::string request_id = "");
  ~Error() override;
  const std::string& code() const { return code_; }
  int http_status() const { return http_status_; }  // 0: no response
  const std::string& expected() const { return expected_; }
  const std::string& got() const { return got_; }
  const std::string& request_id() const { return request_id_; }

 private:
  std::string code_, expected_, got_, request_id_;
  int http_status_;
};

struct Settings {
  std::string url = "http://127.0.0.1:8080";
  // API key ("vxk_…"), empty for a daemon that needs none. Sent with every request, only to `url`.
  std::string key;
  std::chrono::seconds connect_timeout{10};
  // For one exchange with the daemon (the upload, one poll of the job, the download); zero: no
  // limit.
  std::chrono::seconds timeout{0};
  // Further tries after 429, 503 or a refused connection, and after a broken one where the request
  // may be repeated, with a pause that doubles from 200 ms, or as long as Retry-After says, at most
  // 10 s. A wait for a job takes at least 8 of them, some 30 s, unless this is 0. An interrupted
  // download goes on where it stopped.
  int retries = 3;
};

class ClientImpl;

// Arrays of Source::mesh(): of std::vector, std::array, std::span and the like.
using MeshVertices = std::variant<std::span<const float>, std::span<const double>>;
using MeshIndices = std::variant<std::span<const std::uint32_t>, std::span<const std::int32_t>>;
using MeshColors = std::variant<std::span<const std::uint8_t>, std::span<const float>>;

// A source of a mesh's bytes. Files and streams are sent piece by piece.
class VOXELD_CLIENT_API Source {
 public:
  // `filename` decides the format ("a.ply"); empty: the path's own name.
  static Source file(std::filesystem::path path, std::string filename = "");
  // If `filename` is empty here, the first bytes decide the format.
  static Source memory(std::vector<std::byte> bytes, std::string filename);
  // `read` fills the buffer and returns the number of bytes; 0 at the end. A stream can be read
  // only once.
  static Source stream(std::function<size_t(std::span<std::byte>)> read, std::string filename);
  // A mesh in arrays, which are copied into a binary PLY.
  //   vertices  x, y, z of each
  //   triangles three vertices of each, counted from 0
  //   colors    empty, or sRGB R, G, B or R, G, B, A of each vertex: bytes, or floats from 0 to 1
  //   normals   empty, or x, y, z of each vertex
  // Throws Error "file" for an array that has another length, and for a vertex or a colour out of
  // range.
  static Source mesh(const MeshVertices& vertices, const MeshIndices& triangles,
                     const MeshColors& colors = {}, std::span<const float> normals = {});
  // A mesh and files that it names: each `filename` is a relative path, in UTF-8 and with slashes,
  // of at most 255 bytes. None may be empty. They are uploaded one by one, with progress of each,
  // and those that the daemon has are not sent again. Throws Error "file" without files.
  static Source bundle(std::vector<Source> files);

  const std::string& filename() const { return filename_; }

 private:
  friend class ClientImpl;
  std::filesystem::path path_;
  std::vector<std::byte> bytes_;
  std::function<size_t(std::span<std::byte>)> read_;
  std::vector<Source> files_;  // of a bundle
  std::string filename_;
};

using Color = std::array<std::uint8_t, 4>;  // sRGB R, G, B and linear A
using Normal = std::array<std::int8_t, 3>;  // unit normal times 127

// One voxel of a grid with its channels; channels that the grid lacks are 0.
struct Voxel {
  int x = 0, y = 0, z = 0;
  bool has_attributes = false;  // false for the inside of a solid: channels are 0, coverage 255
  Color color{};
  Normal normal{};
  std::uint16_t material = 0, label = 0;  // ids; meta_json() names them
  float distance = 0;                     // signed, in voxels; with distance=world in world units
  std::uint8_t coverage = 0;              // 255: the whole voxel is covered
};

struct Progress {
  std::string stage;                 // "hash", "upload", "queued", "parse", "voxelize", …
  std::int64_t done = 0, total = 0;  // total 0: unknown
  std::string unit = "bytes";        // the unit of done and total: "bytes", "tiles" or "frames"
};
// Return false to stop: Error "interrupted" is thrown. A call that submitted the job itself also
// cancels it.
using ProgressCallback = std::function<bool(const Progress&)>;

// A sparse grid, decoded. Cell (x,y,z) covers origin + voxel_size * [x,x+1) x [y,y+1) x [z,z+1).
class VOXELD_CLIENT_API Grid {
 public:
  // Decodes a native container (.voxg). Throws Error "bad-response".
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
  // The grid's channels, of "color", "normal", "material", "label", "distance", "coverage".
  std::vector<std::string_view> channels() const;
  const std::string& meta_json() const;
  // The id of the daemon's grid, for Input::of_grid(); empty if the grid is not from the daemon, or
  // a part of one (Client::tiles).
  const std::string& id() const;

  bool occupied(int x, int y, int z) const;
  // nullopt if the cell is empty, or if the grid or this voxel (the inside of a solid) has no
  // colour.
  std::optional<Color> color(int x, int y, int z) const;
  // nullopt if the cell is empty.
  std::optional<Voxel> voxel(int x, int y, int z) const;
  // Visits every voxel, in Morton order within each tile.
  void for_each(const std::function<void(const Voxel&)>& visit) const;
  // Visits every voxel. `color` and `normal` are null if the grid or the voxel (the inside of a
  // solid) has none.
  void for_each(const std::function<void(int x, int y, int z, const Color* color,
                                         const Normal* normal)>& visit) const;
  // One byte per cell, x fastest, 1 = occupied: dims[0]*dims[1]*dims[2] bytes.
  std::vector<std::uint8_t> dense() const;

  // Writes a file, in the format of options or else of its extension (".vox", ".nii.gz"). A file
  // that exists is replaced when the new one is complete. The native container is written here;
  // for all else the daemon converts the grid of id(), over a connection of its own. Throws Error
  // "file" if there is no such grid or no such extension, and what Client::wait() throws.
  void save(const std::filesystem::path& path, const Options& options = {},
            const ProgressCallback& progress = {}, const std::stop_token& stop = {}) const;
  void save(const std::filesystem::path& path, Format format) const {
    save(path, Options().format(format));
  }

 private:
  friend class ClientImpl;
  friend class Sequence;
  struct Impl;
  explicit Grid(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// The grids of an animation's frames, all in one placement. A frame is decoded on request; reading
// in order is fastest, because frames are stored as differences. One thread at a time.
class VOXELD_CLIENT_API Sequence {
 public:
  // Takes ownership of a native container (.voxs). Throws Error "bad-response".
  static Sequence decode(std::vector<std::byte> container);
  Sequence(Sequence&&) noexcept;
  Sequence& operator=(Sequence&&) noexcept;
  ~Sequence();

  std::array<int, 3> dims() const;
  std::array<double, 3> origin() const;
  std::array<double, 3> voxel_size() const;
  std::vector<std::string_view> channels() const;  // as Grid's
  const std::string& meta_json() const;
  double fps() const;  // 0 if the frames have times of their own
  std::size_t frame_count() const;
  // Facts and voxels of frame `index`. Throw Error "not-found" if there is no such frame; frame()
  // also throws "bad-response".
  double time_s(std::size_t index) const;
  std::uint64_t voxel_count(std::size_t index) const;
  Grid frame(std::size_t index);

 private:
  struct Impl;
  explicit Sequence(std::unique_ptr<Impl> impl);
  void check_frame(std::size_t index) const;
  std::unique_ptr<Impl> impl_;
};

struct JobInfo {
  std::string id, kind, state;  // state: queued, running, done, failed, cancelled
  std::string stage;
  std::int64_t tiles_done = 0, tiles_total = 0, queue_position = 0, bytes = 0;
  std::int64_t frames_done = 0, frames_total = 0;  // 0, 0: a single grid
  std::string grid, sequence, media_type;
  std::vector<std::string> warnings;  // "missing-texture: skin.png"
  std::string meta_json;              // of the result
  std::string json;                   // the whole status
  bool ended() const { return state == "done" || state == "failed" || state == "cancelled"; }
};

// The queue: busy devices and waiting jobs, as far as the key's holder may see them.
struct QueueDevice {
  std::string device, renderer;
  std::int64_t workers = 0;  // connected ones
  std::int64_t workers_busy = 0;
  std::vector<std::string> jobs;  // ids of the holder's jobs that run on it
};
struct QueuedJob {
  JobInfo job;
  std::string tenant, device;                   // device: the one that runs it, or empty
  std::int64_t created_ms = 0, started_ms = 0;  // Unix time
};
struct Queue {
  std::vector<QueueDevice> devices;
  std::vector<QueuedJob> jobs;                         // running ones, then queued ones by position
  std::int64_t queued = 0, running = 0;                // of all tenants
  std::int64_t others_queued = 0, others_running = 0;  // of other tenants
  std::string json;                                    // the whole response
};

// A frame that a job has finished.
struct FrameInfo {
  std::int64_t index = 0;
  double time_s = 0;
  std::string grid;  // its id; equal frames have equal ids
  std::uint64_t voxel_count = 0;
  std::string content_hash;
};

// The frames of a job's sequence that are finished so far.
struct JobFrames {
  std::string sequence;  // its id; empty until all frames are done
  std::int64_t total = 0;
  std::vector<FrameInfo> frames;
};

// Receives finished tiles of a grid, as a grid of the whole placement in which other tiles are
// empty. Return false to receive no more.
using TilesCallback = std::function<bool(Grid tiles)>;

// The input of a job: exactly one of the three is set.
struct Input {
  std::string asset;     // as returned by upload() or bundle()
  std::string grid;      // JobInfo::grid
  std::string sequence;  // JobInfo::sequence
  static Input of_asset(std::string id) { return {std::move(id), "", ""}; }
  static Input of_grid(std::string id) { return {"", std::move(id), ""}; }
  static Input of_sequence(std::string id) { return {"", "", std::move(id)}; }
};

// A file of a bundle: the name by which other files refer to it, and the id of its upload.
struct BundleFile {
  std::string name, asset;
};

// Receives the pieces of a result in order.
using Sink = std::function<void(std::span<const std::byte>)>;

// A link to a result. Anyone with the URL may fetch it without a key, until it expires.
struct Link {
  std::string url;
  std::int64_t expires_ms = 0;  // Unix time
};

// A job that was submitted. Its calls use the connection of the Client that made it: one thread at
// a time may use that Client and its Jobs. Only calls that wait block, so one thread can follow
// many jobs, by poll() or wait_any(). A Job that is destroyed leaves the job to the daemon.
//
//   std::vector<Job> jobs;
//   for (const auto& path : paths) jobs.push_back(client.start(Source::file(path), options));
//   while (!jobs.empty()) {
//     const auto first = jobs.begin() + static_cast<std::ptrdiff_t>(*wait_any(jobs));
//     use(first->grid());
//     jobs.erase(first);
//   }
class VOXELD_CLIENT_API Job {
 public:
  const std::string& id() const { return info_.id; }
  // The state that the last of the calls below got from the daemon.
  const JobInfo& info() const { return info_; }

  // Gets the state. Returns whether the job has ended: it is done, failed or cancelled.
  bool poll();
  // Waits for at most this time. Returns whether the job has ended.
  bool wait_for(std::chrono::milliseconds time, const std::stop_token& stop = {});
  // Waits until the job has ended. Throws the job's error if it failed, and "cancelled" if it was
  // cancelled. Stopping the wait leaves the job running.
  const JobInfo& wait(const ProgressCallback& progress = {}, const std::stop_token& stop = {});
  // Cancels the job, unless it has ended.
  void cancel();

  // The result. These wait for it and throw as wait() does.
  // If the job wrote another format, grid() and sequence() return that from which it was written.
  // They throw Error "conflict" if the job made none.
  Grid grid(const ProgressCallback& progress = {}, const std::stop_token& stop = {});
  Sequence sequence(const ProgressCallback& progress = {}, const std::stop_token& stop = {});
  // The bytes of the result in the format of the job's options.
  void download(const Sink& sink, const ProgressCallback& progress = {},
                const std::stop_token& stop = {});

 private:
  friend class Client;
  Job(std::shared_ptr<ClientImpl> client, JobInfo info);
  std::shared_ptr<ClientImpl> client_;
  JobInfo info_;
};

// Waits until one of the jobs has ended, for at most `time`; without one, as long as it takes.
// Returns the number of the first that has; nullopt if none has. It asks for the state of each up
// to 20 times a second at first, and every half second later.
VOXELD_CLIENT_API std::optional<std::size_t> wait_any(
    std::span<Job> jobs, std::optional<std::chrono::milliseconds> time = {},
    const std::stop_token& stop = {});

// One daemon. Progress callbacks run on the calling thread.
class VOXELD_CLIENT_API Client {
 public:
  explicit Client(Settings settings);
  explicit Client(std::string url);
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;
  ~Client();

  // --- all steps in one call. `stop` and the callback cancel the job.
  Grid voxelize(const Source& source, const Options& options, const ProgressCallback& progress = {},
                const std::stop_token& stop = {});
  // Voxelizes an animation, which options name ("animation", "fps", "frames", …).
  Sequence voxelize_sequence(const Source& source, const Options& options,
                             const ProgressCallback& progress = {},
                             const std::stop_token& stop = {});
  // Voxelizes to any format, which options name with "format".
  JobInfo voxelize_to(const Source& source, const Options& options, const Sink& sink,
                      const ProgressCallback& progress = {}, const std::stop_token& stop = {});
  // Renders an image, of the kind that options name with "image", else a PNG.
  JobInfo render_to(const Source& source, const Options& options, const Sink& sink,
                    const ProgressCallback& progress = {}, const std::stop_token& stop = {});

  // --- jobs that run while the caller does something else
  // Uploads a mesh and submits its voxelization; does not wait for it.
  Job start(const Source& source, const Options& options, const ProgressCallback& upload = {},
            const std::stop_token& stop = {});
  // The same for any kind of job: see submit().
  Job start(std::string_view kind, const Input& input, const Options& options);
  // A job that was submitted before, perhaps by another program. Throws Error "not-found".
  Job attach(std::string_view id);

  // --- single steps
  // Uploads a mesh; returns the asset's id. A file or memory of 64 KiB and more is hashed first,
  // and not sent if the daemon has it.
  std::string upload(const Source& source, const ProgressCallback& progress = {},
                     const std::stop_token& stop = {});
  // Combines uploads into one asset and returns its id. A new animation for an old mesh then costs
  // one small upload.
  std::string bundle(std::span<const BundleFile> files);
  std::string asset_json(std::string_view asset);
  // kind: voxelize or inspect (an asset), render (any input), export (a grid or sequence). A stop
  // ends the pauses between tries, but no request.
  JobInfo submit(std::string_view kind, const Input& input, const Options& options,
                 const std::stop_token& stop = {});
  // The expected cost, start and end of such a job, without a job: the JSON object of
  // POST /v1/jobs?dry_run=1.
  std::string estimate_json(std::string_view kind, const Input& input, const Options& options,
                            const std::stop_token& stop = {});
  JobInfo job(std::string_view id);
  // Waits until the job has ended. Throws the job's error if it failed.
  JobInfo wait(std::string_view id, const ProgressCallback& progress = {},
               const std::stop_token& stop = {});
  // Cancels a job. One that has ended stays as it is.
  JobInfo cancel(std::string_view id);
  // The finished frames; also while the job runs and after it was cancelled.
  JobFrames frames(std::string_view job);
  // One of these frames. Throws Error "not-found" if it is not finished yet.
  Grid frame(std::string_view job, std::int64_t index);
  // Passes the tiles of a job's grid to `take` as they are finished, until it has all of them or
  // returns false; the job goes on. Solids and short jobs have their tiles at the end. Throws the
  // job's error if it failed, and "conflict" for a job that does not make one grid.
  void tiles(std::string_view job, const TilesCallback& take, const std::stop_token& stop = {});
  std::vector<JobInfo> jobs(int limit = 100);
  // At most `limit` jobs of the queue, running ones first; an admin's key shows all tenants'.
  Queue queue(int limit = 100, const std::stop_token& stop = {});
  // Resumes if the connection breaks. Throws "bad-response" if the result has changed meanwhile;
  // the sink then has the beginning of the old one. Throws "content-mismatch" at the end if the
  // bytes do not match the daemon's hash; the sink then has all of them.
  void download(std::string_view job, const Sink& sink, const ProgressCallback& progress = {},
                const std::stop_token& stop = {});
  // A stored grid. Throws Error "not-found", or "gone" if it was deleted.
  Grid grid(std::string_view id, const ProgressCallback& progress = {},
            const std::stop_token& stop = {});
  // Deletes the item of this id, so its bytes no longer count: the result of a job, otherwise the
  // asset, grid or sequence. Returns which: "result", "asset", "grid" or "sequence". Throws
  // "not-found"; "gone" if it was deleted already; "conflict" for a job that has not ended, and for
  // a frame.
  std::string remove(std::string_view id);
  // A page of stored items, as the JSON object of GET /v1/assets, /v1/results, /v1/grids or
  // /v1/sequences. what: "assets", …; after: "next" of the page before.
  std::string list_json(std::string_view what, int limit = 100, std::string_view after = {});
  // Makes a link to a job's result. options: of the result ("format", …). Throws Error
  // "invalid-option" for more than 30 days.
  Link share(std::string_view job, std::chrono::seconds lifetime, const Options& options = {});
  // The key's tenant, its limits and their use: the JSON object of GET /v1/me.
  std::string whoami_json();

 private:
  std::shared_ptr<ClientImpl> impl_;
};

}  // namespace voxeld::client
