// XML by libexpat, as a stream of elements.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "proto/result.h"

namespace voxeld::threemf {

// The start of an element. Valid during the call that it is passed to.
struct XmlElement {
  std::string_view space, name;  // of the namespace, and in it
  int64_t line = 0;
  const char** attributes = nullptr;  // of libexpat: name, value, …, null

  // The value of an attribute without a namespace, or in `space`.
  std::optional<std::string_view> attribute(std::string_view name,
                                            std::string_view space = {}) const;
};

struct XmlHandlers {
  std::function<Status(const XmlElement&)> start;
  std::function<Status(std::string_view space, std::string_view name)> end;
  // Before the start of the element that declares the prefix; `prefix` may be empty.
  std::function<void(std::string_view prefix, std::string_view space)> prefix;
};

// Reads a document; `name` appears in errors. A document type declaration is refused: no format
// that is read here has one, and its entities can expand without bound. Errors: the handlers';
// malformed-mesh with the line.
Status read_xml(std::string_view name, std::span<const uint8_t> bytes, const XmlHandlers& handlers);

}  // namespace voxeld::threemf
