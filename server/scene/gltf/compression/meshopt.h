// EXT_meshopt_compression: buffer views as streams of libmeshoptimizer.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/result.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// The bytes of buffer view `index`, which has `compressed`, from the stream `data`. A stream that
// is too short for the elements it declares is refused before memory is allocated for them: an
// element is at most 64 times as large as its code.
//
// Errors: malformed-mesh with the path; unsupported-feature for a mode, filter or version of the
// stream that libmeshoptimizer does not know.
Result<std::vector<uint8_t>> decode_meshopt(const Document& document, int index,
                                            std::span<const uint8_t> data);

}  // namespace voxeld::gltf
