// A job's status as JSON text, written without a tree of values: options and meta may take
// megabytes.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "proto/messages/job.h"

namespace voxeld {

namespace limits {
// Bytes of each text of a job in a list or an event. GET /v1/jobs/{id} has longer texts in full.
inline constexpr size_t kRowTextBytesMax = 4096;
}  // namespace limits

// A warning in place of all warnings, if a brief reading left them out because they are too long.
inline constexpr std::string_view kWarningsLeftOut = "left-out";  // its code
Warning warnings_left_out();

// The status as JSON.
std::string job_status_text(const JobStatus& status);
// The status as a row of a list or as an event: a few KB. Options and meta that are longer than
// kRowTextBytesMax, or empty after a brief reading, are omitted and named in "left_out". Longer
// warnings become kWarningsLeftOut, and other texts are cut.
std::string job_row_text(const JobStatus& status);
// The same in two parts, so that a stored event needs no copy of what its job's row has already:
// the members that change as the job goes on, as an object; and the others (options, result,
// left_out), which with_fixed_members() adds when the event is read. An event of a job before it
// was done has no result.
std::string job_event_text(const JobStatus& status);
std::string with_fixed_members(std::string event_text, const JobStatus& status);
// Whether a brief reading omitted something.
bool is_brief(const JobStatus& status);

}  // namespace voxeld
