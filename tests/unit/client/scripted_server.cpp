#include "tests/unit/client/scripted_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "tests/unit/base/comes_true.h"

namespace voxeld::test {
namespace {

using namespace std::chrono_literals;

// A client that says nothing for so long has a bug; the test then fails instead of hanging.
constexpr auto kPatience = 60s;

std::pair<int, int> bound_socket() {
  const int descriptor = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  if (descriptor < 0 || bind(descriptor, generic, length) != 0 ||
      getsockname(descriptor, generic, &length) != 0) {
    throw std::runtime_error("no loopback socket");
  }
  return {descriptor, ntohs(address.sin_port)};
}

// True when `descriptor` has something before the time is over and nobody wakes the thread.
bool wait_for(int descriptor, short events, int wake, std::chrono::milliseconds time) {
  pollfd polled[2] = {{descriptor, events, 0}, {wake, POLLIN, 0}};
  const int count = poll(polled, 2, static_cast<int>(time.count()));
  return count > 0 && polled[1].revents == 0;
}

void send_all(int connection, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = send(connection, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count <= 0) return;  // the client is gone: what it makes of that is the test's matter
    bytes.remove_prefix(static_cast<size_t>(count));
  }
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// The line at the front of the buffer, without its end.
std::optional<std::string> take_line(std::string& buffer) {
  const size_t end = buffer.find("\r\n");
  if (end == std::string::npos) return std::nullopt;
  std::string line = buffer.substr(0, end);
  buffer.erase(0, end + 2);
  return line;
}

std::string head_of(const CannedResponse& response) {
  std::string head = "HTTP/1.1 " + std::to_string(response.status) + " Canned\r\n";
  for (const std::string& header : response.headers) head += header + "\r\n";
  if (response.status != 304) {
    head += "Content-Length: " + std::to_string(response.body.size()) + "\r\n";
  }
  return head + "Connection: close\r\n\r\n";
}

}  // namespace

std::string Asked::header(const std::string& name) const {
  const auto it = headers.find(name);
  return it == headers.end() ? "" : it->second;
}

ScriptedServer::ScriptedServer(std::vector<CannedResponse> script,
                               std::chrono::milliseconds refuse_for)
    : script_(std::move(script)) {
  std::tie(listener_, port_) = bound_socket();
  if (pipe(wake_) != 0) throw std::runtime_error("no pipe");
  if (refuse_for == 0ms) listen(listener_, 16);
  thread_ = std::thread([this, refuse_for] { serve(refuse_for); });
}

ScriptedServer::~ScriptedServer() {
  close(wake_[1]);
  thread_.join();
  close(wake_[0]);
  close(listener_);
}

std::vector<Asked> ScriptedServer::asked() const {
  const std::lock_guard lock(mutex_);
  return asked_;
}

bool ScriptedServer::is_asked(size_t count) const {
  return testing::comes_true([&] { return asked().size() >= count; });
}

std::vector<std::string> ScriptedServer::lines() const {
  std::vector<std::string> lines;
  for (const Asked& asked : asked()) lines.push_back(asked.line());
  return lines;
}

void ScriptedServer::serve(std::chrono::milliseconds refuse_for) {
  if (refuse_for > 0ms) {
    // A socket that is bound and does not listen refuses, and nobody else gets its port.
    pollfd woken{wake_[0], POLLIN, 0};
    if (poll(&woken, 1, static_cast<int>(refuse_for.count())) > 0) return;
    listen(listener_, 16);
  }
  while (wait_for(listener_, POLLIN, wake_[0], -1ms)) {
    const int connection = accept(listener_, nullptr, nullptr);
    if (connection < 0) continue;
    serve_one(connection);
    close(connection);
  }
}

void ScriptedServer::serve_one(int connection) {
  std::string buffer;
  auto asked = read_head(connection, buffer);
  if (!asked) return;
  const size_t number = this->asked().size();
  const CannedResponse response =
      number < script_.size() ? script_[number] : CannedResponse{.status = 500};
  if (response.reads_body) read_body(connection, buffer, *asked);
  {
    const std::lock_guard lock(mutex_);
    asked_.push_back(*std::move(asked));
  }
  hold(connection, response.delay);
  send_all(connection, head_of(response));
  send_all(connection, std::string_view(response.body).substr(0, response.cut_after.value_or(-1)));
  shutdown(connection, SHUT_WR);
  drain(connection);
}

std::optional<Asked> ScriptedServer::read_head(int connection, std::string& buffer) const {
  while (buffer.find("\r\n\r\n") == std::string::npos) {
    if (!fill(connection, buffer)) return std::nullopt;
  }
  Asked asked;
  const std::string first = *take_line(buffer);
  const size_t blank = first.find(' ');
  asked.method = first.substr(0, blank);
  asked.target = first.substr(blank + 1, first.rfind(' ') - blank - 1);
  for (std::string line = *take_line(buffer); !line.empty(); line = *take_line(buffer)) {
    const size_t colon = line.find(": ");
    asked.headers[lower(line.substr(0, colon))] = line.substr(colon + 2);
  }
  return asked;
}

bool ScriptedServer::read_body(int connection, std::string& buffer, Asked& asked) const {
  if (asked.header("expect") == "100-continue")
    send_all(connection, "HTTP/1.1 100 Continue\r\n\r\n");
  if (asked.header("transfer-encoding") == "chunked") return read_chunks(connection, buffer, asked);
  const size_t bytes = std::strtoul(asked.header("content-length").c_str(), nullptr, 10);
  while (buffer.size() < bytes) {
    if (!fill(connection, buffer)) return false;
  }
  asked.body = buffer.substr(0, bytes);
  return true;
}

bool ScriptedServer::read_chunks(int connection, std::string& buffer, Asked& asked) const {
  for (;;) {
    auto line = take_line(buffer);
    for (; !line; line = take_line(buffer)) {
      if (!fill(connection, buffer)) return false;
    }
    const size_t bytes = std::strtoul(line->c_str(), nullptr, 16);
    while (buffer.size() < bytes + 2) {
      if (!fill(connection, buffer)) return false;
    }
    asked.body += buffer.substr(0, bytes);
    buffer.erase(0, bytes + 2);
    if (bytes == 0) return true;
  }
}

bool ScriptedServer::fill(int connection, std::string& buffer) const {
  if (!wait_for(connection, POLLIN, wake_[0], kPatience)) return false;
  char piece[65536];
  const ssize_t count = recv(connection, piece, sizeof piece, 0);
  if (count <= 0) return false;
  buffer.append(piece, static_cast<size_t>(count));
  return true;
}

void ScriptedServer::hold(int connection, std::chrono::milliseconds delay) const {
  if (delay > 0ms) wait_for(connection, POLLRDHUP, wake_[0], delay);
}

// Closing with bytes unread would reset the connection, and the client might lose the response.
void ScriptedServer::drain(int connection) const {
  std::string ignored;
  while (fill(connection, ignored)) ignored.clear();
}

std::string url_of_nobody() {
  // Never listened on; the socket stays bound, so that no other program gets the port.
  static const int port = bound_socket().second;
  return "http://127.0.0.1:" + std::to_string(port);
}

CannedResponse json_response(std::string body, std::vector<std::string> headers) {
  headers.push_back("Content-Type: application/json");
  return {.body = std::move(body), .headers = std::move(headers)};
}

CannedResponse problem_response(int status, std::string_view code, std::string_view detail,
                                std::vector<std::string> headers) {
  headers.push_back("Content-Type: application/problem+json");
  std::string body = R"({"type":"urn:voxeld:error:)" + std::string(code) + R"(","title":"T",)" +
                     R"("status":)" + std::to_string(status) + R"(,"code":")" + std::string(code) +
                     R"(","detail":")" + std::string(detail) + R"("})";
  return {.status = status, .body = std::move(body), .headers = std::move(headers)};
}

CannedResponse job_response(std::string_view state, std::string_view more,
                            std::vector<std::string> headers) {
  std::string body = R"({"id":"j-1","kind":"voxelize","state":")" + std::string(state) + "\"";
  if (!more.empty()) body += "," + std::string(more);
  return json_response(body + "}", std::move(headers));
}

}  // namespace voxeld::test
