// A client as bare as a socket, so that tests decide about every byte. Nothing waits for ever: what
// does not happen within kPatienceSeconds is taken as never.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "server/base/disk/file.h"
#include "tests/unit/base/comes_true.h"

namespace voxeld::testing {

inline constexpr int kPatienceSeconds = static_cast<int>(kPatience.count());

struct HttpResponse {
  int status = 0;
  std::map<std::string, std::string> headers;  // names in small letters
  std::string body;

  // Empty where it is absent.
  std::string header(const std::string& name) const;
  // The member "code" of a problem document.
  std::string code() const;
  std::string detail() const;
};

// Not thread-safe.
class HttpClient {
 public:
  // Connects to 127.0.0.1. A refused connection is_open() == false.
  explicit HttpClient(int port);
  bool is_open() const { return fd_.valid(); }

  bool send(std::string_view text);
  // "GET target" with a Host, and `lines` (each with its CRLF).
  bool send_get(std::string_view target, std::string_view lines = "");
  // A whole response, with its chunks joined; interim 1xx responses are skipped.
  // nullopt when the connection ends before. `has_body` is false for responses to HEAD.
  std::optional<HttpResponse> receive(bool has_body = true);
  // The head of a response; receive_some() returns its body.
  std::optional<HttpResponse> receive_head();
  // At least one more byte of what goes on; empty at the end.
  std::string receive_some();
  // Everything until the server closes; nullopt when it does not.
  std::optional<std::string> receive_to_end();
  // Whether something can be read (also the end) within `seconds`.
  bool readable(double seconds) const;
  void finish_sending();
  void close() { fd_.reset(); }

 private:
  bool fill();
  bool receive_chunks(std::string& body);

  UniqueFd fd_;
  std::string buffer_;
};

}  // namespace voxeld::testing
