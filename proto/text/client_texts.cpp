#include "proto/text/client_texts.h"

namespace voxeld {

Status check_length(const ClientText& limit, std::string_view text) {
  return check_length(limit, limit.name, text);
}

Status check_length(const ClientText& limit, std::string_view name, std::string_view text) {
  if (text.size() <= limit.bytes_max) return {};
  return Error{limit.code, std::string(name),
               "at most " + std::to_string(limit.bytes_max) + " bytes",
               std::to_string(text.size())};
}

Status check_filename(std::string_view filename) {
  VOXELD_TRY(check_length(client_texts::kFilename, filename));
  if (filename.find('\0') == std::string_view::npos) return {};
  return Error{ErrorCode::kInvalidOption, "filename", "a name without NUL", echoed(filename)};
}

std::string echoed(std::string_view text) {
  std::string quoted = "\"";
  quoted += text.substr(0, kEchoBytesMax);
  quoted += '"';
  return quoted;
}

}  // namespace voxeld
