// The files of the web page, embedded by client/web/build_page.py. A build without
// VOXELD_WITH_WEB has none.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace voxeld::api {

// The document; all other files have a hash of their bytes in their name.
inline constexpr std::string_view kPageName = "index.html";

struct WebFile {
  std::string_view name;        // "app.0123456789abcdef.js"
  std::string_view media_type;  // "text/javascript; charset=utf-8"
  std::string_view hash;        // SHA-256 of the plain bytes, in hex
  std::span<const unsigned char> gzip;
  int64_t plain_bytes = 0;  // once inflated
};

// Sorted by name.
std::span<const WebFile> web_files();

}  // namespace voxeld::api
