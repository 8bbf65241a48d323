// The name of a computation: equal names give equal bytes.
#pragma once

#include <string>

#include "proto/messages/job.h"

namespace voxeld {

// SHA-256 of kind, input (asset, grid or sequence), what of the file name decides how the input is
// read (its extension and the path inside a bundle), canonical options and kAlgorithmVersion.
// Results are cached by it.
std::string request_hash(const JobRequest& request);

// A hash of everything that a client sent, without kAlgorithmVersion: an idempotency key must come
// back with the same one, also after an upgrade.
std::string idempotency_hash(const JobRequest& request);

}  // namespace voxeld
