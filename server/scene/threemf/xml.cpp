#include "server/scene/threemf/xml.h"

#include <expat.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld::threemf {
namespace {

constexpr char kSeparator = '|';                  // between a namespace and a name
constexpr size_t kPieceBytes = size_t{64} << 10;  // between two looks for a cancel

struct Parser {
  std::string_view file;
  const XmlHandlers& handlers;
  XML_Parser expat = nullptr;
  std::optional<Error> error = {};
  std::exception_ptr thrown = {};  // must not cross libexpat, which is C
};

std::pair<std::string_view, std::string_view> split_name(std::string_view text) {
  const size_t at = text.rfind(kSeparator);
  if (at == text.npos) return {{}, text};
  return {text.substr(0, at), text.substr(at + 1)};
}

template <typename Call>
void guarded_call(Parser& parser, const Call& call) {
  if (parser.error || parser.thrown) return;
  try {
    if (Status done = call(); !done) parser.error = std::move(done.error());
  } catch (...) {
    parser.thrown = std::current_exception();
  }
  if (parser.error || parser.thrown) XML_StopParser(parser.expat, XML_FALSE);
}

// The line that is read, from 1.
int64_t line_of(XML_Parser expat) {
#if XML_MAJOR_VERSION * 100 + XML_MINOR_VERSION >= 209  // which deprecates the other
  return static_cast<int64_t>(XML_GetCurrentLineNumber64(expat));
#else
  return static_cast<int64_t>(XML_GetCurrentLineNumber(expat));
#endif
}

void on_start(void* user, const char* name, const char** attributes) {
  Parser& parser = *static_cast<Parser*>(user);
  guarded_call(parser, [&] {
    const auto [space, local] = split_name(name);
    return parser.handlers.start({space, local, line_of(parser.expat), attributes});
  });
}

void on_end(void* user, const char* name) {
  Parser& parser = *static_cast<Parser*>(user);
  guarded_call(parser, [&] {
    const auto [space, local] = split_name(name);
    return parser.handlers.end ? parser.handlers.end(space, local) : Status();
  });
}

void on_prefix(void* user, const char* prefix, const char* space) {
  Parser& parser = *static_cast<Parser*>(user);
  guarded_call(parser, [&] {
    if (parser.handlers.prefix && space != nullptr) {
      parser.handlers.prefix(prefix == nullptr ? "" : prefix, space);
    }
    return Status();
  });
}

void on_doctype(void* user, const char*, const char*, const char*, int) {
  Parser& parser = *static_cast<Parser*>(user);
  guarded_call(parser, [&] {
    return malformed_line(parser.file, line_of(parser.expat), "a document type declaration", "none",
                          "<!DOCTYPE");
  });
}

}  // namespace

std::optional<std::string_view> XmlElement::attribute(std::string_view wanted,
                                                      std::string_view wanted_space) const {
  for (const char** at = attributes; *at != nullptr; at += 2) {
    if (split_name(at[0]) == std::pair(wanted_space, wanted)) return at[1];
  }
  return std::nullopt;
}

Status read_xml(std::string_view name, std::span<const uint8_t> bytes,
                const XmlHandlers& handlers) {
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> expat(
      XML_ParserCreateNS(nullptr, kSeparator), &XML_ParserFree);
  if (!expat) return Error{ErrorCode::kInternal, "no memory for an XML parser", "", ""};
  Parser parser{name, handlers, expat.get()};
  XML_SetUserData(expat.get(), &parser);
  XML_SetElementHandler(expat.get(), on_start, on_end);
  XML_SetStartNamespaceDeclHandler(expat.get(), on_prefix);
  XML_SetStartDoctypeDeclHandler(expat.get(), on_doctype);
  XML_Status status = XML_STATUS_OK;
  for (size_t at = 0; status == XML_STATUS_OK && at <= bytes.size(); at += kPieceBytes) {
    cancel_point();
    const size_t count = std::min(kPieceBytes, bytes.size() - at);
    status = XML_Parse(expat.get(), reinterpret_cast<const char*>(bytes.data()) + at,
                       static_cast<int>(count), at + kPieceBytes > bytes.size());
  }
  if (parser.thrown) std::rethrow_exception(parser.thrown);
  if (parser.error) return *std::move(parser.error);
  if (status == XML_STATUS_OK) return {};
  return malformed_line(name, line_of(expat.get()),
                        std::string("not XML: ") + XML_ErrorString(XML_GetErrorCode(expat.get())));
}

}  // namespace voxeld::threemf
