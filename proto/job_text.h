// A job's status as JSON text, written without a tree of values: its options and meta may take
// megabytes.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "proto/job.h"

namespace voxeld {

namespace limits {
// Of a job in a list or an event: what is longer is left to GET /v1/jobs/{id}.
inline constexpr size_t kRowTextBytesMax = 4096;
}  // namespace limits

// What stands for the warnings of a status that was read in brief, if they are too long for it.
inline constexpr std::string_view kWarningsLeftOut = "left-out";  // its code
Warning warnings_left_out();

// The status as JSON.
std::string job_status_text(const JobStatus& status);
// The same as a row of a list or as an event: a few KB. Options and meta that are longer than
// kRowTextBytesMax (or empty, as a brief reading leaves them) are absent, and named in "left_out";
// of longer warnings kWarningsLeftOut is told, and other texts are cut.
std::string job_row_text(const JobStatus& status);
// Whether a brief reading left something out.
bool is_brief(const JobStatus& status);

}  // namespace voxeld
