// How much a worker reads of an input, told from a few of its bytes.
#pragma once

#include <cstdint>
#include <string_view>

#include "server/store/object_store.h"

namespace voxeld {

struct JobInput {
  // kGlb: images and animations beside the triangles. kBinary: other files that are not text.
  enum class Form { kGrid, kBinary, kText, kZip, kGlb };
  Form form = Form::kBinary;
  int64_t bytes = 0;   // unpacked, of a zip archive; of one frame of a sequence
  int64_t frames = 1;  // of a stored sequence
};

// The name of a form, "zip".
std::string_view form_name(JobInput::Form form);

// The file of an asset. A file that cannot be read is empty, an archive whose directory cannot be
// read is as large as its file: whoever needs the contents says so.
JobInput file_input(const ObjectStore& blobs, std::string_view blob);

}  // namespace voxeld
