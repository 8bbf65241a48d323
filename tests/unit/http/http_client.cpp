#include "tests/unit/http/http_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <utility>

namespace voxeld::testing {
namespace {

std::string json_member(const std::string& body, const char* name) {
  const auto json = nlohmann::json::parse(body, nullptr, false);
  return json.is_object() ? json.value(name, std::string()) : std::string();
}

}  // namespace

std::string HttpResponse::header(const std::string& name) const {
  const auto it = headers.find(name);
  return it == headers.end() ? std::string() : it->second;
}
std::string HttpResponse::code() const {
  return json_member(body, "code");
}
std::string HttpResponse::detail() const {
  return json_member(body, "detail");
}

HttpClient::HttpClient(int port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(fd_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    fd_.reset();
    return;
  }
  // Pieces that a test sends one by one must leave one by one, at once.
  const int on = 1;
  ::setsockopt(fd_.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

bool HttpClient::send(std::string_view text) {
  while (!text.empty()) {
    const ssize_t sent = ::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno != EINTR) return false;
    if (sent > 0) text.remove_prefix(static_cast<size_t>(sent));
  }
  return true;
}

bool HttpClient::send_get(std::string_view target, std::string_view lines) {
  return send("GET " + std::string(target) + " HTTP/1.1\r\nHost: h\r\n" + std::string(lines) +
              "\r\n");
}

bool HttpClient::readable(double seconds) const {
  pollfd entry{fd_.get(), POLLIN, 0};
  return ::poll(&entry, 1, static_cast<int>(seconds * 1000)) > 0;
}

// Appends what arrives next; false at the end of the stream or of the patience.
bool HttpClient::fill() {
  if (!readable(kPatienceSeconds)) return false;
  std::array<char, 65536> bytes;
  const ssize_t got = ::recv(fd_.get(), bytes.data(), bytes.size(), 0);
  if (got <= 0) return false;
  buffer_.append(bytes.data(), static_cast<size_t>(got));
  return true;
}

std::optional<HttpResponse> HttpClient::receive_head() {
  size_t end = 0;
  while ((end = buffer_.find("\r\n\r\n")) == std::string::npos) {
    if (!fill()) return std::nullopt;
  }
  HttpResponse response;
  std::string_view head = std::string_view(buffer_).substr(0, end + 2);
  if (!head.starts_with("HTTP/1.1 ")) return std::nullopt;
  response.status = std::atoi(head.data() + 9);
  while (!head.empty()) {
    const std::string_view line = head.substr(0, head.find("\r\n"));
    head.remove_prefix(line.size() + 2);
    const size_t colon = line.find(": ");
    if (colon == std::string_view::npos) continue;  // the status line
    std::string name(line.substr(0, colon));
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
    response.headers[name] = line.substr(colon + 2);
  }
  buffer_.erase(0, end + 4);
  if (response.status / 100 == 1) return receive_head();
  return response;
}

std::optional<HttpResponse> HttpClient::receive(bool has_body) {
  auto response = receive_head();
  if (!response || !has_body) return response;
  if (response->header("transfer-encoding") == "chunked") {
    if (!receive_chunks(response->body)) return std::nullopt;
    return response;
  }
  const auto bytes = std::strtoull(response->header("content-length").c_str(), nullptr, 10);
  while (buffer_.size() < bytes) {
    if (!fill()) return std::nullopt;
  }
  response->body = buffer_.substr(0, bytes);
  buffer_.erase(0, bytes);
  return response;
}

// Up to the last chunk; what sizes and ends do not fit is none.
bool HttpClient::receive_chunks(std::string& body) {
  while (true) {
    size_t line = 0;
    while ((line = buffer_.find("\r\n")) == std::string::npos) {
      if (!fill()) return false;
    }
    size_t bytes = 0;
    const auto [stopped, error] = std::from_chars(buffer_.data(), buffer_.data() + line, bytes, 16);
    if (error != std::errc() || stopped != buffer_.data() + line) return false;
    while (buffer_.size() < line + bytes + 4) {
      if (!fill()) return false;
    }
    if (buffer_.compare(line + 2 + bytes, 2, "\r\n") != 0) return false;
    body.append(buffer_, line + 2, bytes);
    buffer_.erase(0, line + bytes + 4);
    if (bytes == 0) return true;
  }
}

std::string HttpClient::receive_some() {
  if (buffer_.empty()) fill();
  return std::exchange(buffer_, "");
}

std::optional<std::string> HttpClient::receive_to_end() {
  while (readable(kPatienceSeconds)) {
    if (!fill()) return std::exchange(buffer_, "");
  }
  return std::nullopt;
}

void HttpClient::finish_sending() {
  ::shutdown(fd_.get(), SHUT_WR);
}

}  // namespace voxeld::testing
