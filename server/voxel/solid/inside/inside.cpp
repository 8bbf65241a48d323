#include "server/voxel/solid/inside/inside.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <iterator>
#include <memory>
#include <utility>

#include "server/voxel/solid/inside/column_maker.h"

namespace voxeld {
namespace {

// If there are fewer columns than this for each thread, a column is shared among threads by rows.
constexpr size_t kColumnsPerThread = 2;

// The tiles of one column while they are made.
struct ColumnTiles {
  ColumnTiles(size_t tiles, size_t lanes) : whole(tiles) {
    for (size_t i = 0; i < tiles; ++i) bits.emplace_back(lanes);
  }
  std::vector<TileBits> bits;
  std::vector<int> whole;  // 1: entirely inside

  void move_to(const TriangleColumns& columns, size_t column, std::vector<SparseTile>& out) {
    const ColumnWindow window = columns.window(column);
    for (size_t z = 0; z < bits.size(); ++z) {
      SparseTile tile;
      tile.coord = {window.u_first / limits::kTileSide, window.v_first / limits::kTileSide,
                    static_cast<int32_t>(z)};
      bits[z].move_to(tile);
      if (whole[z] != 0) tile.full.push_back({0, kTileLevels});
      whole[z] = 0;
      if (!tile.empty()) out.push_back(std::move(tile));
    }
  }
};

struct Worker {
  ColumnMaker maker;
  std::unique_ptr<ColumnTiles> column;
  std::vector<SparseTile> tiles;
  AxisVotes votes;
};

class InsideRun {
 public:
  InsideRun(const InsideJob& job, ThreadTeam& team)
      : plan_(job, team), team_(team), workers_(static_cast<size_t>(team.threads())) {}

  Status run(const ColumnProgress& progress, const TakeInside& take) {
    const size_t columns = plan_.triangles.count();
    const bool alone = columns >= kColumnsPerThread * workers_.size();
    const size_t step = alone ? kColumnsPerThread * workers_.size() : 1;
    for (size_t first = 0; first < columns; first += step) {
      if (alone) {
        run_columns(first, std::min(first + step, columns));
      } else {
        run_shared(first);
      }
      for (Worker& worker : workers_) take(std::exchange(worker.tiles, {}));
      if (progress) VOXELD_TRY(progress(std::min(first + step, columns)));
    }
    return {};
  }

  void add_votes(AxisVotes& votes) const {
    for (const Worker& worker : workers_) {
      votes.inside += worker.votes.inside;
      votes.disagree += worker.votes.disagree;
    }
  }

 private:
  size_t tiles_z() const { return static_cast<size_t>(plan_.tiles_z()); }

  void run_columns(size_t first, size_t last) {
    std::atomic<size_t> next = first;
    team_.run(team_.threads(), [&](int index) {
      Worker& worker = workers_[static_cast<size_t>(index)];
      if (!worker.column) worker.column = std::make_unique<ColumnTiles>(tiles_z(), 1);
      ColumnTiles& column = *worker.column;
      for (size_t i = next++; i < last; i = next++) {
        worker.maker.run(plan_, i, {}, column.bits, column.whole, worker.votes);
        column.move_to(plan_.triangles, i, worker.tiles);
      }
    });
  }

  void run_shared(size_t column) {
    // The sweeps of the axes carry state from row to row along y, so they cannot share a column.
    const size_t parts = plan_.needs_axes() ? 1 : workers_.size();
    if (!shared_) shared_ = std::make_unique<ColumnTiles>(tiles_z(), parts);
    team_.run(static_cast<int>(parts), [&](int index) {
      Worker& worker = workers_[static_cast<size_t>(index)];
      const ColumnShare share = {static_cast<size_t>(index), parts};
      worker.maker.run(plan_, column, share, shared_->bits, shared_->whole, worker.votes);
    });
    shared_->move_to(plan_.triangles, column, workers_.front().tiles);
  }

  InsidePlan plan_;
  ThreadTeam& team_;
  std::vector<Worker> workers_;
  std::unique_ptr<ColumnTiles> shared_;
};

}  // namespace

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

Status find_inside(const InsideJob& job, ThreadTeam& team, const ColumnProgress& progress,
                   std::vector<SparseTile>& tiles, AxisVotes& votes) {
  const auto append = [&](std::vector<SparseTile> made) {
    std::ranges::move(made, std::back_inserter(tiles));
  };
  return find_inside(job, team, progress, append, votes);
}

Status find_inside(const InsideJob& job, ThreadTeam& team, const ColumnProgress& progress,
                   const TakeInside& take, AxisVotes& votes) {
  InsideRun run(job, team);
  VOXELD_TRY(run.run(progress, take));
  run.add_votes(votes);
  return {};
}

}  // namespace voxeld
