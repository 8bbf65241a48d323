#include "client/cli/exit_status.h"

#include <algorithm>
#include <iterator>

namespace voxeld::cli {
namespace {

struct Row {
  std::string_view code;
  ExitStatus status;
};

constexpr Row kRows[] = {
    {"unknown-option", kUsage},
    {"invalid-option", kUsage},
    {"unauthorized", kUsage},
    {"forbidden", kUsage},
    {"not-found", kUsage},
    {"gone", kUsage},
    {"malformed-mesh", kBadInput},
    {"empty-mesh", kBadInput},
    {"unsupported-feature", kBadInput},
    {"malformed-image", kBadInput},
    {"malformed-bundle", kBadInput},
    {"unsupported-media-type", kBadInput},
    {"grid-too-large", kTooLarge},
    {"payload-too-large", kTooLarge},
    {"quota-exceeded", kTooLarge},
    {"storage-full", kTooLarge},
    {"unreachable", kUnreachable},
    {"timeout", kUnreachable},
    {"bad-response", kUnreachable},
    {"content-mismatch", kUnreachable},
    {"too-many-requests", kUnreachable},
    {"device-unavailable", kUnreachable},
    {"shutting-down", kUnreachable},
    {"queue-full", kUnreachable},
    {"cancelled", kJobFailed},
    {"worker-crashed", kJobFailed},
    {"deadline-exceeded", kJobFailed},
    {"some-failed", kSomeFailed},
    {"interrupted", kInterrupted},
};

}  // namespace

ExitStatus exit_status_of(const client::Error& error) {
  const auto* row = std::ranges::find(kRows, error.code(), &Row::code);
  return row == std::end(kRows) ? kFailure : row->status;
}

}  // namespace voxeld::cli
