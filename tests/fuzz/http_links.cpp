// Signed links and traceparent. The input is the head of a request: nobody can guess a signature,
// a link that was made for what it asks for opens exactly that, and one changed byte closes it.
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>

#include "server/api/access/signed_link.h"
#include "server/base/check.h"
#include "server/base/disk/directory.h"
#include "server/http/message/head_parser.h"
#include "server/http/message/trace_context.h"

namespace {

using namespace voxeld;
using namespace voxeld::api;
using namespace voxeld::http;

constexpr int kSampled = 1;
constexpr int64_t kFarAway = int64_t{1} << 40;

// The secrets of this run, in a folder that is removed with it.
class Secrets {
 public:
  Secrets() {
    VOXELD_CHECK(::mkdtemp(directory_.data()) != nullptr, "a folder");
    auto opened = UrlSecrets::open(directory_);
    VOXELD_CHECK(opened.ok(), opened.error().message().c_str());
    all_ = *std::move(opened);
  }
  ~Secrets() { remove_tree(directory_); }
  const UrlSecrets& all() const { return *all_; }

 private:
  std::string directory_ = "/tmp/voxeld-fuzz-links-XXXXXX";
  std::unique_ptr<UrlSecrets> all_;
};

const UrlSecrets& secrets() {
  static const Secrets one;
  return one.all();
}

std::string head_of(const std::string& target) {
  return "GET " + target + " HTTP/1.1\r\nHost: h\r\n\r\n";
}

void check_trace(const Head& head) {
  const auto trace = parse_traceparent(head.header("traceparent"));
  if (!trace) return;
  const auto again = parse_traceparent(traceparent_text(*trace));
  VOXELD_CHECK(again && again->trace_id == trace->trace_id && again->span_id == trace->span_id &&
                   (again->flags & kSampled) == (trace->flags & kSampled),
               "what is passed on reads the same");
  VOXELD_CHECK(child_span(*trace).trace_id == trace->trace_id, "a child is of the trace");
}

// As every route's: nothing in it needs a percent sign.
bool is_plain_path(std::string_view path) {
  return path.starts_with('/') &&
         path.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/-._~") ==
             std::string_view::npos;
}

void check_link(const Head& head, size_t at, char put) {
  OptionPairs query;
  for (const auto& [name, value] : head.query) {
    if (!is_link_parameter(name)) query.emplace_back(name, value);
  }
  const SignedLinks links(secrets());
  const auto made = links.make(head.path, query, "k3v7qz2m", kFarAway);
  VOXELD_CHECK(made.ok(), "a link");
  const auto asked = parse_head(head_of(*made));
  if (!asked) return;  // longer than a target may be
  const auto key = links.verify(*asked);
  VOXELD_CHECK(key.ok() && *key == "k3v7qz2m", "a link opens what it was made for");
  VOXELD_CHECK(asked->path == head.path, "the path that was signed");

  std::string changed = *made;
  changed[at % changed.size()] = put;
  const auto other = parse_head(head_of(changed));
  if (!other || (other->path == asked->path && other->query == asked->query)) return;
  VOXELD_CHECK(!is_signed_link(*other) || !links.verify(*other), "a changed link is none");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 3) return 0;
  const size_t at = static_cast<size_t>(data[0]) * 256 + data[1];
  const char put = static_cast<char>(data[2]);
  const auto head = parse_head({reinterpret_cast<const char*>(data) + 3, size - 3});
  if (!head) return 0;
  check_trace(*head);
  if (is_signed_link(*head)) {
    VOXELD_CHECK(!SignedLinks(secrets()).verify(*head), "a signature that was guessed");
  }
  if (is_plain_path(head->path)) check_link(*head, at, put);
  return 0;
}
