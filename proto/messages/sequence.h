// A sequence: the grids of an animation's frames, all in one placement. It is stored as a manifest,
// a JSON blob that names the frames' containers. Equal frames are stored once.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/channels.h"
#include "proto/result.h"

namespace voxeld {

struct SequenceFrame {
  double time_s = 0;
  std::string grid;  // id of the container
  uint64_t voxel_count = 0;
  std::string content_hash;
};

struct SequenceManifest {
  std::array<int32_t, 3> dims{};
  std::array<double, 3> origin{}, voxel_size{};
  ChannelSet channels;
  double fps = 0;                     // 0: the frames have times of their own
  std::vector<SequenceFrame> frames;  // times ascend; at most limits::kFramesMax
  std::string meta_json = "{}";       // object: animation, options, source_hash, ...
};

// Equal manifests give equal bytes, because the id is their hash.
std::string sequence_json(const SequenceManifest& manifest);
// Errors: bad-request, naming the member.
Result<SequenceManifest> parse_sequence(std::string_view json);

}  // namespace voxeld
