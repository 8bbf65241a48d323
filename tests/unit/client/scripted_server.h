// An HTTP server that follows a script: one canned response per request, in order. It can
// be slow, refuse connections at first, leave a body unread and cut its own body in the middle.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

namespace voxeld::test {

// Longer than any test lasts: the delay of a response that its client must not wait for.
inline constexpr std::chrono::minutes kTooLate{2};

struct CannedResponse {
  int status = 200;
  std::string body{};
  std::vector<std::string> headers{};  // "Name: value"
  std::optional<size_t> cut_after{};   // closes the connection after so many bytes of the body
  std::chrono::milliseconds delay{0};  // before the response; ends early when the client is gone
  bool reads_body = true;              // false: responds after the head of the request
};

// A request that the server received.
struct Asked {
  std::string method, target;
  std::map<std::string, std::string> headers;  // lower-case names
  std::string body;                            // without the chunks' frames
  std::string header(const std::string& name) const;
  std::string line() const { return method + " " + target; }
};

// Serves on loopback until destroyed, one connection at a time, each for one request. Requests
// after the last response get status 500.
class ScriptedServer {
 public:
  // Connections are refused until `refuse_for` has passed.
  explicit ScriptedServer(std::vector<CannedResponse> script,
                          std::chrono::milliseconds refuse_for = std::chrono::milliseconds(0));
  ~ScriptedServer();
  ScriptedServer(const ScriptedServer&) = delete;
  ScriptedServer& operator=(const ScriptedServer&) = delete;

  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_); }
  std::vector<Asked> asked() const;
  // Polls until so many requests have come; false after a minute.
  bool is_asked(size_t count) const;
  std::vector<std::string> lines() const;  // "GET /v1/jobs/j-1" of each request

 private:
  void serve(std::chrono::milliseconds refuse_for);
  void serve_one(int connection);
  std::optional<Asked> read_head(int connection, std::string& buffer) const;
  bool read_body(int connection, std::string& buffer, Asked& asked) const;
  bool read_chunks(int connection, std::string& buffer, Asked& asked) const;
  bool fill(int connection, std::string& buffer) const;
  void hold(int connection, std::chrono::milliseconds delay) const;
  void drain(int connection) const;

  const std::vector<CannedResponse> script_;
  int listener_ = -1;
  int port_ = 0;
  int wake_[2] = {-1, -1};  // a pipe: its writing end is closed to end the thread
  mutable std::mutex mutex_;
  std::vector<Asked> asked_;  // guarded by mutex_
  std::thread thread_;
};

// A port on which nothing listens.
std::string url_of_nobody();

CannedResponse json_response(std::string body, std::vector<std::string> headers = {});
// application/problem+json.
CannedResponse problem_response(int status, std::string_view code, std::string_view detail,
                                std::vector<std::string> headers = {});
// A job's status document with the members that the client reads.
CannedResponse job_response(std::string_view state, std::string_view more = "",
                            std::vector<std::string> headers = {});

}  // namespace voxeld::test
