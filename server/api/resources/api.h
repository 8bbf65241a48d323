// The services that the resources call, and helpers that they share.
#pragma once

#include <atomic>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>

#include "proto/messages/job.h"
#include "server/api/access/access.h"
#include "server/api/access/upload_bytes.h"
#include "server/api/access/wait_limit.h"
#include "server/api/http_types.h"
#include "server/jobs/auth/key_ring.h"
#include "server/jobs/service/job_service.h"

namespace voxeld::api {

// Uploads in zstd of all tenants at a time: inflating one takes up to 8 MiB of memory
// (http::kZstdWindowLogMax).
inline constexpr int kZstdUploadsMax = 32;

struct Api {
  JobService& jobs;
  const Access& access;
  const KeyRing& keys;
  WaitLimit waits;
  WaitLimit zstd_uploads{kZstdUploadsMax, "upload zstd"};
  UploadBytes upload_bytes{};
  std::atomic<int> event_streams{0};
  // The server drains: event streams end, and long polls return at once.
  std::atomic<bool> stopping{false};
  // Files of the page instead of those embedded; empty: those.
  std::filesystem::path web_dir{};
};

// The problem of `error` for this request.
Response problem(const Request& request, const Error& error);
// Whether the body is declared as application/json: a web page may send other types without asking
// first. Errors: unsupported-media-type.
Status check_json_type(const Request& request);
// The value of a query parameter, which is one of `words`; empty if it is absent. Errors:
// invalid-option.
Result<std::string> query_word(const Request& request, std::string_view name,
                               std::initializer_list<std::string_view> words);

}  // namespace voxeld::api
