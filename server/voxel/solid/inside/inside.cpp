#include "server/voxel/solid/inside/inside.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <iterator>
#include <memory>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/inside/column_maker.h"

namespace voxeld {
namespace {

// If there are fewer columns than this for each thread, a column is shared among threads by rows.
constexpr size_t kColumnsPerThread = 2;

}  // namespace

// The tiles of one column while they are made. Empty between columns.
class ColumnTiles {
 public:
  // lanes: of each tile.
  explicit ColumnTiles(size_t lanes) : lanes_(lanes) {}

  // For columns of so many tiles.
  void resize(size_t tiles) {
    while (bits_.size() < tiles) bits_.emplace_back(lanes_);
    whole_.assign(tiles, 0);
  }
  size_t lanes() const { return lanes_; }
  std::span<TileBits> bits() { return std::span(bits_).first(whole_.size()); }
  std::vector<int>& whole() { return whole_; }

  void move_to(const TriangleColumns& columns, size_t column, std::vector<SparseTile>& out) {
    const ColumnWindow window = columns.window(column);
    for (size_t z = 0; z < whole_.size(); ++z) {
      cancel_point();
      SparseTile tile;
      tile.coord = {window.u_first / limits::kTileSide, window.v_first / limits::kTileSide,
                    static_cast<int32_t>(z)};
      bits_[z].move_to(tile);
      if (whole_[z] != 0) tile.full.push_back({0, kTileLevels});
      whole_[z] = 0;
      if (!tile.empty()) out.push_back(std::move(tile));
    }
  }

 private:
  size_t lanes_;
  std::vector<TileBits> bits_;
  std::vector<int> whole_;  // 1: entirely inside
};

struct InsideFinder::Memory {
  struct OfThread {
    ColumnMaker maker;
    ColumnTiles column{1};
    std::vector<SparseTile> tiles;
  };
  explicit Memory(size_t threads) : workers(threads), shared(threads) {}

  std::vector<OfThread> workers;
  ColumnTiles shared;  // of a column that all threads work at
};

class InsideFinder::Run {
 public:
  Run(const InsideJob& job, ThreadTeam& team, Memory& memory)
      : plan_(job, team),
        team_(team),
        workers_(memory.workers),
        shared_(memory.shared),
        votes_(workers_.size()) {}

  Status run(const ColumnProgress& progress, const Take& take) {
    const size_t columns = plan_.triangles.count();
    const auto tiles_z = static_cast<size_t>(plan_.tiles_z());
    const bool alone = columns >= kColumnsPerThread * workers_.size();
    if (!alone) shared_.resize(tiles_z);
    for (auto& worker : workers_) worker.column.resize(alone ? tiles_z : 0);
    const size_t step = alone ? kColumnsPerThread * workers_.size() : 1;
    for (size_t first = 0; first < columns; first += step) {
      if (alone) {
        run_columns(first, std::min(first + step, columns));
      } else {
        run_shared(first);
      }
      for (auto& worker : workers_) take(std::exchange(worker.tiles, {}));
      if (progress) VOXELD_TRY(progress(std::min(first + step, columns)));
    }
    return {};
  }

  void add_votes(AxisVotes& votes) {
    for (AxisVotes& of_thread : votes_) {
      votes.inside += of_thread.inside;
      votes.disagree += of_thread.disagree;
      std::ranges::move(of_thread.doubtful, std::back_inserter(votes.doubtful));
    }
  }

 private:
  void run_columns(size_t first, size_t last) {
    std::atomic<size_t> next = first;
    team_.run(team_.threads(), [&](int index) {
      const auto thread = static_cast<size_t>(index);
      auto& worker = workers_[thread];
      ColumnTiles& column = worker.column;
      for (size_t i = next++; i < last; i = next++) {
        worker.maker.run(plan_, i, {}, column.bits(), column.whole(), votes_[thread]);
        column.move_to(plan_.triangles, i, worker.tiles);
      }
    });
  }

  void run_shared(size_t column) {
    // The sweeps of the axes carry state from row to row along y, so they cannot share a column.
    const size_t parts = plan_.needs_axes() ? 1 : workers_.size();
    team_.run(static_cast<int>(parts), [&](int index) {
      const auto thread = static_cast<size_t>(index);
      const ColumnShare share = {thread, parts};
      workers_[thread].maker.run(plan_, column, share, shared_.bits(), shared_.whole(),
                                 votes_[thread]);
    });
    shared_.move_to(plan_.triangles, column, workers_.front().tiles);
  }

  InsidePlan plan_;
  ThreadTeam& team_;
  std::vector<Memory::OfThread>& workers_;
  ColumnTiles& shared_;
  std::vector<AxisVotes> votes_;  // by thread
};

const SparseTile* SurfaceTiles::find(const glm::ivec3& coord) const {
  for (const SparseTile& tile : tiles) {
    if (tile.coord[0] == coord.x && tile.coord[1] == coord.y && tile.coord[2] == coord.z) {
      return &tile;
    }
  }
  return nullptr;
}

int64_t count_beside(const BrickMask& cells, const SparseTile* surface, uint32_t morton) {
  BrickMask taken;
  if (surface != nullptr) {
    const auto brick = std::ranges::lower_bound(surface->brick_morton, morton);
    if (brick != surface->brick_morton.end() && *brick == morton) {
      taken = surface->masks[static_cast<size_t>(brick - surface->brick_morton.begin())];
    }
    for (const FullNode& node : surface->full) {
      if (morton - node.brick_morton < node.brick_count()) return 0;
    }
  }
  int64_t count = 0;
  for (size_t w = 0; w < 8; ++w) count += std::popcount(cells.words[w] & ~taken.words[w]);
  return count;
}

size_t tile_column_count(const glm::ivec3& dims) {
  const auto tiles = [](int cells) {
    return static_cast<size_t>((cells + limits::kTileSide - 1) / limits::kTileSide);
  };
  return tiles(dims.x) * tiles(dims.y);
}

InsideFinder::InsideFinder(ThreadTeam& team) : team_(team) {}

InsideFinder::~InsideFinder() = default;

Status InsideFinder::find(const InsideJob& job, const ColumnProgress& progress,
                          std::vector<SparseTile>& tiles, AxisVotes& votes) {
  const auto append = [&](std::vector<SparseTile> made) {
    std::ranges::move(made, std::back_inserter(tiles));
  };
  return find(job, progress, append, votes);
}

Status InsideFinder::find(const InsideJob& job, const ColumnProgress& progress, const Take& take,
                          AxisVotes& votes) {
  // An exception in the middle of a column drops the memory: it is not clean then.
  std::unique_ptr<Memory> memory = std::exchange(memory_, nullptr);
  if (!memory) memory = std::make_unique<Memory>(static_cast<size_t>(team_.threads()));
  Run run(job, team_, *memory);
  const Status done = run.run(progress, take);
  memory_ = std::move(memory);
  VOXELD_TRY(done);
  run.add_votes(votes);
  return {};
}

}  // namespace voxeld
