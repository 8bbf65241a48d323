#include "server/scene/gltf/compression/meshopt.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld::gltf {
namespace {

constexpr int kUnknownVersion = -1;  // what the decoders return for the first byte of a stream

struct Kind {
  std::string_view mode;
  uint64_t stride_step, stride_max;
  // First bytes of a stream: its version, from the next one on that of the library.
  int (*decode)(void* to, size_t count, size_t stride, const unsigned char* from, size_t bytes);
};
constexpr Kind kKinds[] = {{"ATTRIBUTES", 4, 256, meshopt_decodeVertexBuffer},
                           {"TRIANGLES", 2, 4, meshopt_decodeIndexBuffer},
                           {"INDICES", 2, 4, meshopt_decodeIndexSequence}};

struct Filter {
  std::string_view name;
  uint64_t stride_step, stride_max;
  void (*apply)(void* data, size_t count, size_t stride);
};
constexpr Filter kFilters[] = {{"NONE", 1, 256, nullptr},
                               {"OCTAHEDRAL", 4, 8, meshopt_decodeFilterOct},
                               {"QUATERNION", 8, 8, meshopt_decodeFilterQuat},
                               {"EXPONENTIAL", 4, 256, meshopt_decodeFilterExp}};

// Bytes that a stream has at least: two bits for 16 bytes of an attribute, a byte for a triangle or
// an index.
uint64_t stream_bytes_min(const Kind& kind, const CompressedView& view) {
  if (kind.mode == "ATTRIBUTES") return view.count / 64 * view.stride_bytes;
  return kind.mode == "TRIANGLES" ? view.count / 3 : view.count;
}

bool is_stride(uint64_t stride, uint64_t step, uint64_t most) {
  return stride > 0 && stride % step == 0 && stride <= most;
}

std::string multiple_text(uint64_t step, uint64_t most) {
  return "a multiple of " + std::to_string(step) + " up to " + std::to_string(most);
}

template <typename Named, size_t kCount>
const Named* find_named(const Named (&all)[kCount], std::string_view Named::*name,
                        const std::string& wanted) {
  const auto* const found =
      std::ranges::find_if(all, [&](const Named& one) { return one.*name == wanted; });
  return found == std::end(all) ? nullptr : found;
}

}  // namespace

Result<std::vector<uint8_t>> decode_meshopt(const Document& document, int index,
                                            std::span<const uint8_t> data) {
  const View& view = document.views[index];
  const CompressedView& from = *view.compressed;
  const std::string path = at_index("bufferViews", index) + ".extensions." + from.extension;
  const auto unread = [&](std::string_view what, std::string expected, std::string got) {
    Error error = document.malformed(path, what, std::move(expected), std::move(got));
    error.code = ErrorCode::kUnsupportedFeature;
    return error;
  };
  const Kind* const kind = find_named(kKinds, &Kind::mode, from.mode);
  if (kind == nullptr) {
    return unread("mode", "ATTRIBUTES, TRIANGLES or INDICES", shown(from.mode));
  }
  const Filter* const filter = find_named(kFilters, &Filter::name, from.filter);
  if (filter == nullptr) {
    return unread("filter", "NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL", shown(from.filter));
  }
  if (filter->apply != nullptr && kind->mode != "ATTRIBUTES") {
    return document.malformed(path, "filter of mode " + from.mode, "NONE", from.filter);
  }
  if (!is_stride(from.stride_bytes, kind->stride_step, kind->stride_max)) {
    return document.malformed(path, "byteStride of mode " + from.mode,
                              multiple_text(kind->stride_step, kind->stride_max),
                              std::to_string(from.stride_bytes));
  }
  if (!is_stride(from.stride_bytes, filter->stride_step, filter->stride_max)) {
    return document.malformed(path, "byteStride of filter " + from.filter,
                              multiple_text(filter->stride_step, filter->stride_max),
                              std::to_string(from.stride_bytes));
  }
  if (kind->mode == "TRIANGLES" && from.count % 3 != 0) {
    return document.malformed(path, "count of mode TRIANGLES", "a multiple of 3",
                              std::to_string(from.count));
  }
  // The product cannot wrap: a count is at most 2^53, a stride 256.
  if (from.count * from.stride_bytes != view.length_bytes) {
    return document.malformed(path, "count times byteStride",
                              std::to_string(view.length_bytes) + " as byteLength of the view",
                              std::to_string(from.count * from.stride_bytes));
  }
  if (view.stride_bytes != 0 && view.stride_bytes != from.stride_bytes) {
    return document.malformed(path, "byteStride",
                              std::to_string(view.stride_bytes) + " as that of the view",
                              std::to_string(from.stride_bytes));
  }
  if (const uint64_t least = stream_bytes_min(*kind, from); data.size() < least) {
    return document.malformed(path, "the stream is too short for its count",
                              "at least " + std::to_string(least) + " bytes",
                              std::to_string(data.size()) + " bytes");
  }
  std::vector<uint8_t> out;
  resize_in_pieces(out, view.length_bytes);
  const int failed =
      kind->decode(out.data(), from.count, from.stride_bytes, data.data(), data.size());
  if (failed == kUnknownVersion) {
    return unread("version of the stream", "one that libmeshoptimizer reads",
                  data.empty() ? "nothing" : "first byte " + std::to_string(data[0]));
  }
  if (failed != 0) return document.malformed(path, "the stream is damaged");
  if (filter->apply != nullptr) filter->apply(out.data(), from.count, from.stride_bytes);
  return out;
}

}  // namespace voxeld::gltf
