// The decoded grid of the client library, over proto's container reader.
#include <algorithm>
#include <bit>
#include <iterator>

#include "client/grid_impl.h"
#include "proto/codec/tile_runs.h"
#include "proto/container/distance_unit.h"

namespace voxeld::client {

namespace {

uint32_t tile_code(const SparseTile& tile) {
  return morton_encode(static_cast<uint32_t>(tile.coord[0]), static_cast<uint32_t>(tile.coord[1]),
                       static_cast<uint32_t>(tile.coord[2]));
}

bool in_full_node(const SparseTile& tile, uint32_t brick_code) {
  const auto after = std::ranges::upper_bound(tile.full, brick_code, {}, &FullNode::brick_morton);
  if (after == tile.full.begin()) return false;
  const FullNode& node = *std::prev(after);
  return brick_code - node.brick_morton < node.brick_count();
}

}  // namespace

Voxel Grid::Impl::read(const SparseTile& tile, int x, int y, int z, size_t number) const {
  Voxel voxel{.x = x, .y = y, .z = z};
  voxel.has_attributes = header.channels.any() && number != kNoAttributes;
  if (!voxel.has_attributes) {
    if (header.channels.coverage) voxel.coverage = 255;  // inside a solid
    return voxel;
  }
  const ChannelSet& has = header.channels;
  if (has.color) std::copy_n(&tile.color[4 * number], 4, voxel.color.begin());
  if (has.normal) std::copy_n(&tile.normal[3 * number], 3, voxel.normal.begin());
  if (has.material) voxel.material = tile.material[number];
  if (has.label) voxel.label = tile.label[number];
  if (has.distance) {
    voxel.distance = static_cast<float>(tile.distance[number] * distance_unit / kDistanceSteps);
  }
  if (has.coverage) voxel.coverage = tile.coverage[number];
  return voxel;
}

std::optional<Grid::Impl::Place> Grid::Impl::find(int x, int y, int z) const {
  const std::array<int, 3> p = {x, y, z};
  std::array<uint32_t, 3> tile_at{}, brick_at{}, cell_at{};
  for (size_t c = 0; c < 3; ++c) {
    if (p[c] < 0 || p[c] >= header.dims[c]) return std::nullopt;
    const auto v = static_cast<uint32_t>(p[c]);
    tile_at[c] = v / limits::kTileSide;
    brick_at[c] = v % limits::kTileSide / limits::kBrickSide;
    cell_at[c] = v % limits::kBrickSide;
  }
  const uint32_t code = morton_encode(tile_at[0], tile_at[1], tile_at[2]);
  const auto tile = std::ranges::lower_bound(tiles, code, {}, tile_code);
  if (tile == tiles.end() || tile_code(*tile) != code) return std::nullopt;
  return find_in_brick(*tile, morton_encode(brick_at[0], brick_at[1], brick_at[2]),
                       morton_encode(cell_at[0], cell_at[1], cell_at[2]));
}

std::optional<Grid::Impl::Place> Grid::Impl::find_in_brick(const SparseTile& tile,
                                                           uint32_t brick_code,
                                                           uint32_t bit) const {
  if (in_full_node(tile, brick_code)) return Place{&tile, kNoAttributes};
  const auto brick = std::ranges::lower_bound(tile.brick_morton, brick_code);
  if (brick == tile.brick_morton.end() || *brick != brick_code) return std::nullopt;
  const auto b = static_cast<size_t>(brick - tile.brick_morton.begin());
  const BrickMask& mask = tile.masks[b];
  if ((mask.words[bit / 64] >> (bit % 64) & 1) == 0) return std::nullopt;
  size_t voxel = brick_offsets[static_cast<size_t>(&tile - tiles.data())][b];
  for (size_t w = 0; w < bit / 64; ++w) voxel += static_cast<size_t>(std::popcount(mask.words[w]));
  voxel +=
      static_cast<size_t>(std::popcount(mask.words[bit / 64] & ((uint64_t{1} << (bit % 64)) - 1)));
  return Place{&tile, voxel};
}

std::unique_ptr<Grid::Impl> Grid::Impl::of(GridHeader header, std::vector<SparseTile> tiles,
                                           uint64_t voxels) {
  auto impl = std::make_unique<Impl>();
  impl->header = std::move(header);
  impl->distance_unit = voxeld::distance_unit(impl->header);
  impl->tiles = std::move(tiles);
  impl->voxels = voxels;
  for (const SparseTile& tile : impl->tiles) {
    std::vector<uint32_t> offsets;
    uint32_t before = 0;
    for (const BrickMask& mask : tile.masks) {
      offsets.push_back(before);
      for (const uint64_t word : mask.words) before += static_cast<uint32_t>(std::popcount(word));
    }
    impl->brick_offsets.push_back(std::move(offsets));
  }
  return impl;
}

Grid::Grid(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Grid::Grid(Grid&&) noexcept = default;
Grid& Grid::operator=(Grid&&) noexcept = default;
Grid::~Grid() = default;

Grid Grid::decode(std::span<const std::byte> container) {
  const auto reader = checked(GridReader::open(
      std::span(reinterpret_cast<const uint8_t*>(container.data()), container.size())));
  return Grid(Impl::of(reader.header(), checked(reader.decode_tiles()), reader.voxel_count()));
}

std::array<int, 3> Grid::dims() const {
  return impl_->header.dims;
}
std::array<double, 3> Grid::origin() const {
  return impl_->header.origin;
}
std::array<double, 3> Grid::voxel_size() const {
  return impl_->header.voxel_size;
}
std::uint64_t Grid::voxel_count() const {
  return impl_->voxels;
}
bool Grid::has_color() const {
  return impl_->header.channels.color;
}
bool Grid::has_normal() const {
  return impl_->header.channels.normal;
}
const std::string& Grid::meta_json() const {
  return impl_->header.meta_json;
}

const std::string& Grid::id() const {
  return impl_->id;
}

bool Grid::occupied(int x, int y, int z) const {
  return impl_->find(x, y, z).has_value();
}

std::optional<Color> Grid::color(int x, int y, int z) const {
  const auto place = impl_->find(x, y, z);
  if (!place || !has_color() || place->voxel == kNoAttributes) return std::nullopt;
  const uint8_t* c = &place->tile->color[4 * place->voxel];
  return Color{c[0], c[1], c[2], c[3]};
}

std::vector<std::string_view> Grid::channels() const {
  std::vector<std::string_view> names;
  for (const ChannelInfo& info : kChannels) {
    if (impl_->header.channels.has(info.channel)) names.push_back(info.name);
  }
  return names;
}

std::optional<Voxel> Grid::voxel(int x, int y, int z) const {
  const auto place = impl_->find(x, y, z);
  if (!place) return std::nullopt;
  return impl_->read(*place->tile, x, y, z, place->voxel);
}

void Grid::for_each(const std::function<void(const Voxel&)>& visit) const {
  for (const SparseTile& tile : impl_->tiles) {
    for_each_voxel(
        tile, [&](int x, int y, int z, size_t voxel) { visit(impl_->read(tile, x, y, z, voxel)); });
  }
}

void Grid::for_each(
    const std::function<void(int, int, int, const Color*, const Normal*)>& visit) const {
  for (const SparseTile& tile : impl_->tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      Color color{};
      Normal normal{};
      const bool colored = has_color() && voxel != kNoAttributes;
      const bool directed = has_normal() && voxel != kNoAttributes;
      if (colored) std::copy_n(&tile.color[4 * voxel], 4, color.begin());
      if (directed) std::copy_n(&tile.normal[3 * voxel], 3, normal.begin());
      visit(x, y, z, colored ? &color : nullptr, directed ? &normal : nullptr);
    });
  }
}

std::vector<std::uint8_t> Grid::dense() const {
  const auto nx = static_cast<size_t>(impl_->header.dims[0]);
  const auto ny = static_cast<size_t>(impl_->header.dims[1]);
  std::vector<std::uint8_t> cells(nx * ny * static_cast<size_t>(impl_->header.dims[2]));
  const auto index = [&](int x, int y, int z) {
    return static_cast<size_t>(x) + nx * (static_cast<size_t>(y) + ny * static_cast<size_t>(z));
  };
  for (const SparseTile& tile : impl_->tiles) {
    for_each_mask_voxel(tile, [&](int x, int y, int z, size_t) { cells[index(x, y, z)] = 1; });
    for_each_full_run(tile, [&](int x, int y, int z, int length) {
      std::fill_n(cells.begin() + static_cast<std::ptrdiff_t>(index(x, y, z)), length, uint8_t{1});
    });
  }
  return cells;
}

}  // namespace voxeld::client
