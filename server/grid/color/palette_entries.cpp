#include "server/grid/color/palette_entries.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "proto/codec/tile_runs.h"
#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/base/parallel.h"
#include "server/grid/color/oklab.h"

namespace voxeld {
namespace {

using FloatLab = std::array<float, 3>;

constexpr size_t kCancelVoxels = 4096;  // between cancellation points; each may need 32 searches

constexpr size_t kThresholds = 16;
using Mixture = std::array<uint8_t, kThresholds>;  // entries, dark ones first

// The error that a voxel takes over, at most, in distances of its own colour to the nearest entry.
// Without a limit small errors of a large surface gather until a colour far away is the nearest:
// a white wall would get yellow specks.
constexpr float kErrorsMax = 3;

float distance_of(const FloatLab& a, const FloatLab& b) {
  float sum = 0;
  for (size_t c = 0; c < a.size(); ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return std::sqrt(sum);
}

// The error, made shorter where it is longer than the limit.
FloatLab limited(FloatLab error, float limit) {
  const float length = distance_of(error, {});
  if (length <= limit) return error;
  for (float& component : error) component *= limit / length;
  return error;
}

FloatLab lab_of(const Rgb& color) {
  const Lab lab = oklab(color);
  return {static_cast<float>(lab[0]), static_cast<float>(lab[1]), static_cast<float>(lab[2])};
}

class NearestEntries {
 public:
  explicit NearestEntries(std::span<const Rgb> colors) : count_(colors.size()) {
    VOXELD_CHECK(count_ > 0 && count_ <= kEntriesMax, "palette: too few or too many colours");
    for (size_t i = 0; i < count_; ++i) {
      const FloatLab lab = lab_of(colors[i]);
      for (size_t c = 0; c < lab.size(); ++c) {
        components_[c][i] = lab[c];
        least_[c] = i == 0 ? lab[c] : std::min(least_[c], lab[c]);
        greatest_[c] = i == 0 ? lab[c] : std::max(greatest_[c], lab[c]);
      }
    }
  }

  uint8_t of(const FloatLab& lab) const {
    std::array<float, kEntriesMax> distances;  // NOLINT(*-member-init): of count_ entries
    for (size_t i = 0; i < count_; ++i) {
      const float l = components_[0][i] - lab[0], a = components_[1][i] - lab[1],
                  b = components_[2][i] - lab[2];
      distances[i] = l * l + a * a + b * b;
    }
    const auto found = std::ranges::min_element(std::span(distances).first(count_));
    return static_cast<uint8_t>(&*found - distances.data());
  }

  FloatLab lab(size_t entry) const {
    return {components_[0][entry], components_[1][entry], components_[2][entry]};
  }
  float lightness(size_t entry) const { return components_[0][entry]; }

  float distance(const FloatLab& lab) const { return distance_of(lab, this->lab(of(lab))); }

  // The colour that a voxel asks for: its own and the error, in the palette's box, so that the
  // errors of colours that no mixture has stay small. distance: of its own colour.
  FloatLab wanted(FloatLab lab, float distance, const FloatLab& error) const {
    const FloatLab more = limited(error, kErrorsMax * distance);
    for (size_t c = 0; c < lab.size(); ++c) {
      lab[c] = std::clamp(lab[c] + more[c], least_[c], greatest_[c]);
    }
    return lab;
  }

  Mixture mixture(const FloatLab& lab) const {
    Mixture entries{};
    FloatLab error{};
    const float own_distance = distance(lab);
    for (uint8_t& entry : entries) {
      const FloatLab asked = wanted(lab, own_distance, error);
      entry = of(asked);
      const FloatLab got = this->lab(entry);
      for (size_t c = 0; c < got.size(); ++c) error[c] = asked[c] - got[c];
    }
    std::ranges::stable_sort(entries, {}, [&](uint8_t entry) { return lightness(entry); });
    return entries;
  }

 private:
  static constexpr size_t kEntriesMax = 256;
  size_t count_;
  std::array<std::array<float, kEntriesMax>, 3> components_{};
  FloatLab least_{}, greatest_{};
};

// A cache of results by colour, since neighbours often have the same: one place for each hash. Keys
// have 24 bits.
template <typename Value>
class KeyCache {
 public:
  template <typename Find>
  const Value& of(uint32_t key, Find&& find) {
    Place& place = places_[key * 2654435761u >> (32 - kPlaceBits)];  // 2^32 / golden ratio
    if (place.key_plus_1 != key + 1) place = {key + 1, find(key)};
    return place.value;
  }

 private:
  static constexpr unsigned kPlaceBits = 13;
  struct Place {
    uint32_t key_plus_1 = 0;
    Value value{};
  };
  std::vector<Place> places_ = std::vector<Place>(size_t{1} << kPlaceBits);
};

// 0..15; palette_entries.h describes the pattern.
size_t threshold(int x, int y, int z) {
  const auto level = [&](int bit) {
    return 2 * static_cast<size_t>((x ^ y) >> bit & 1) + static_cast<size_t>((y ^ z) >> bit & 1);
  };
  return 4 * level(0) + level(1);
}

// The error diffusion of one tile.
class Diffusion {
 public:
  Diffusion(const SparseTile& tile, const NearestEntries& nearest, const KeyOfVoxel& key_of)
      : tile_(tile), nearest_(nearest), key_of_(key_of) {
    constexpr auto kMask = static_cast<int32_t>(kSide - 1);
    order_.reserve(tile.attribute_count());
    for_each_mask_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t voxel) {
      if (key_of(tile, voxel) == kNoColorKey) return;
      const auto cell = static_cast<uint32_t>((z & kMask) << 16 | (y & kMask) << 8 | (x & kMask));
      order_.push_back({cell, static_cast<uint32_t>(voxel)});
    });
    std::ranges::sort(order_, {}, &Voxel::cell);
    errors_.resize(order_.size());
    for (auto& plane : planes_) plane.resize(kRow * kRow);
  }

  void run(std::vector<uint8_t>& entries) {
    for (size_t begin = 0; begin < order_.size();) {
      cancel_point();
      const uint32_t z = order_[begin].z();
      if (laid_ == begin) lay(z);
      const size_t end = laid_;
      lay(z + 1);
      for (size_t i = begin; i < end; ++i) entries[order_[i].voxel] = choose(i);
      for (size_t i = begin; i < end; ++i) planes_[z & 1][order_[i].place()] = 0;
      begin = end;
    }
  }

 private:
  static constexpr size_t kSide = limits::kTileSide;
  static_assert(kSide == 256);
  static constexpr size_t kRow = kSide + 2;  // with a border without voxels

  struct Voxel {
    uint32_t cell;  // in the tile: z << 16 | y << 8 | x
    uint32_t voxel;
    uint32_t z() const { return cell >> 16; }
    size_t place() const { return ((cell >> 8 & 255) + 1) * kRow + (cell & 255) + 1; }
  };
  // A colour and its distance to the nearest entry.
  struct Own {
    FloatLab lab{};
    float distance = 0;
  };
  struct Step {
    int32_t x, y;
    uint32_t z;
    float parts;
  };
  static constexpr std::array<Step, 13> kSteps = {{{1, 0, 0, 4},
                                                   {-1, 1, 0, 2},
                                                   {0, 1, 0, 4},
                                                   {1, 1, 0, 2},
                                                   {-1, -1, 1, 1},
                                                   {0, -1, 1, 2},
                                                   {1, -1, 1, 1},
                                                   {-1, 0, 1, 2},
                                                   {0, 0, 1, 4},
                                                   {1, 0, 1, 2},
                                                   {-1, 1, 1, 1},
                                                   {0, 1, 1, 2},
                                                   {1, 1, 1, 1}}};

  // Enters the voxels of plane z, which are the next ones in order, if there are any.
  void lay(uint32_t z) {
    for (; laid_ < order_.size() && order_[laid_].z() == z; ++laid_) {
      planes_[z & 1][order_[laid_].place()] = static_cast<uint32_t>(laid_ + 1);
    }
  }

  uint8_t choose(size_t number) {
    const Voxel& voxel = order_[number];
    const Own own = own_.of(key_of_(tile_, voxel.voxel), [&](uint32_t key) {
      const FloatLab lab = lab_of(rgb_of(key));
      return Own{lab, nearest_.distance(lab)};
    });
    const FloatLab wanted = nearest_.wanted(own.lab, own.distance, errors_[number]);
    const uint8_t entry = nearest_.of(wanted);
    std::array<uint32_t, kSteps.size()> numbers{};
    float parts = 0;
    for (size_t i = 0; i < kSteps.size(); ++i) {
      const Step& step = kSteps[i];
      const auto place =
          static_cast<ptrdiff_t>(voxel.place()) + step.y * static_cast<ptrdiff_t>(kRow) + step.x;
      numbers[i] = planes_[(voxel.z() + step.z) & 1][static_cast<size_t>(place)];
      if (numbers[i] != 0) parts += step.parts;
    }
    if (parts == 0) return entry;  // the error is lost
    const FloatLab got = nearest_.lab(entry);
    for (size_t i = 0; i < kSteps.size(); ++i) {
      if (numbers[i] == 0) continue;
      FloatLab& error = errors_[numbers[i] - 1];
      for (size_t c = 0; c < got.size(); ++c) {
        error[c] += (wanted[c] - got[c]) * (kSteps[i].parts / parts);
      }
    }
    return entry;
  }

  const SparseTile& tile_;
  const NearestEntries& nearest_;
  const KeyOfVoxel& key_of_;
  KeyCache<Own> own_;
  std::vector<Voxel> order_;
  std::vector<FloatLab> errors_;                 // of the voxels in order
  std::array<std::vector<uint32_t>, 2> planes_;  // numbers + 1 of voxels with even and odd z
  size_t laid_ = 0;                              // voxels that were entered
};

// other: the entry of voxels without a colour.
std::vector<uint8_t> choose_in_tile(const SparseTile& tile, const NearestEntries& nearest,
                                    Dither dither, const KeyOfVoxel& key_of, uint8_t other) {
  std::vector<uint8_t> entries(tile.attribute_count(), other);
  if (entries.empty()) return entries;
  switch (dither) {
    case Dither::kNone: {
      KeyCache<uint8_t> cache;
      for (size_t voxel = 0; voxel < entries.size(); ++voxel) {
        if (voxel % kCancelVoxels == 0) cancel_point();
        const uint32_t own = key_of(tile, voxel);
        if (own == kNoColorKey) continue;
        entries[voxel] =
            cache.of(own, [&](uint32_t key) { return nearest.of(lab_of(rgb_of(key))); });
      }
      break;
    }
    case Dither::kBayer: {
      KeyCache<Mixture> cache;
      for_each_mask_voxel(tile, [&](int32_t x, int32_t y, int32_t z, size_t voxel) {
        if (voxel % kCancelVoxels == 0) cancel_point();
        const uint32_t own = key_of(tile, voxel);
        if (own == kNoColorKey) return;
        const Mixture& mixture =
            cache.of(own, [&](uint32_t key) { return nearest.mixture(lab_of(rgb_of(key))); });
        entries[voxel] = mixture[threshold(x, y, z)];
      });
      break;
    }
    case Dither::kError:
      Diffusion(tile, nearest, key_of).run(entries);
  }
  return entries;
}

}  // namespace

VoxelEntries choose_entries(const Grid& grid, std::span<const Rgb> colors, Dither dither,
                            const KeyOfVoxel& key_of) {
  const NearestEntries nearest(colors);
  VoxelEntries chosen;
  chosen.tiles.resize(grid.tiles.size());
  if (!grid.tiles.empty()) {
    chosen.other = nearest.of(lab_of(rgb_of(key_of(grid.tiles.front(), kNoAttributes))));
  }
  parallel_for(grid.tiles.size(), [&](size_t i) {
    cancel_point();
    chosen.tiles[i] = choose_in_tile(grid.tiles[i], nearest, dither, key_of, chosen.other);
  });
  return chosen;
}

std::vector<uint8_t> choose_tile_entries(const SparseTile& tile, std::span<const Rgb> colors,
                                         Dither dither, const KeyOfVoxel& key_of) {
  return choose_in_tile(tile, NearestEntries(colors), dither, key_of, 0);
}

}  // namespace voxeld
