// The gateway itself reads the directory of a zip archive, for the cost of jobs.
#include <span>

#include "server/base/check.h"
#include "server/jobs/estimates/job_input.h"
#include "tests/unit/store/memory_store.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;
  testing::MemoryStore store;
  auto writer = store.begin(static_cast<int64_t>(size));
  VOXELD_CHECK(writer && writer->append(std::span(data, size)), "memory takes the bytes");
  const JobInput input = file_input(store, writer->finish().value().id);
  VOXELD_CHECK(input.bytes >= static_cast<int64_t>(size), "unpacked bytes are not fewer");
  return 0;
}
