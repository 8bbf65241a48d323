#include "server/api/health_server.h"

#include <httplib.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <list>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/http/message/authority.h"
#include "server/http/output.h"
#include "server/http/sockets/listener.h"

namespace voxeld::api {
namespace {

using std::chrono::milliseconds;

// Two, so that /livez responds while a handler of /readyz or /metrics takes long.
constexpr int kThreads = 2;
constexpr std::string_view kHeadEnd = "\r\n\r\n";
// For what the client still sends once it has its response.
constexpr std::chrono::seconds kLingerTime{1};
// After a failure that left everything as it was, mostly for want of memory.
constexpr milliseconds kPauseAfterFailure{20};

// A request in memory, and its response.
class MemoryStream final : public httplib::Stream {
 public:
  explicit MemoryStream(std::string_view request) : request_(request) {}
  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }
  ssize_t read(char* to, size_t size) override {
    const size_t count = request_.copy(to, size);
    request_.remove_prefix(count);
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const char* from, size_t size) override {
    response_.append(from, size);
    return static_cast<ssize_t>(size);
  }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return INVALID_SOCKET; }
  std::string take_response() { return std::move(response_); }

 private:
  std::string_view request_;
  std::string response_;
};

std::string_view without_blanks(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  const size_t first = std::min(text.find_first_not_of(kBlanks), text.size());
  return text.substr(first, text.find_last_not_of(kBlanks) + 1 - first);
}

// The header lines of a head. One that stands twice is joined by ", ".
http::Headers headers_of(std::string_view head) {
  http::Headers headers;
  for (size_t begin = head.find("\r\n"); begin < head.size();) {
    begin += 2;
    const size_t end = std::min(head.find("\r\n", begin), head.size());
    const std::string_view line = head.substr(begin, end - begin);
    const size_t colon = line.find(':');
    if (colon != std::string_view::npos) {
      const auto [at, is_first] = headers.emplace(line.substr(0, colon), "");
      if (!is_first) at->second += ", ";
      at->second += without_blanks(line.substr(colon + 1));
    }
    begin = end;
  }
  return headers;
}

// Parses requests and writes responses; it opens no socket.
class Responder final : public httplib::Server {
 public:
  Responder(const HealthServerConfig& config, const HealthHandler& handler)
      : config_(config), handler_(handler) {
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      Head head;
      head.method = request.method;
      head.path = request.path;
      head.headers = headers_;
      fill(respond(std::move(head)), response);
      return HandlerResponse::Handled;
    });
    // Requests that cannot be parsed do not reach the handler above.
    set_error_handler([](const httplib::Request&, httplib::Response& response) {
      if (!response.body.empty()) return;
      fill(Response::problem({ErrorCode::kBadRequest, "the request is not one of HTTP/1.1",
                              "METHOD PATH HTTP/1.1 and headers", ""},
                             ""),
           response);
    });
  }

  // One thread at a time calls it. `head`: without the empty line that ends it.
  std::string respond_to(std::string_view head) {
    headers_ = headers_of(head);
    // cpp-httplib gets the codings that a client takes and no other header: it would leave out
    // those without a value, decode the others, and honour a Range.
    std::string request(head.substr(0, head.find("\r\n")));
    const auto codings = headers_.find("Accept-Encoding");
    if (codings != headers_.end()) request += "\r\nAccept-Encoding: " + codings->second;
    request += kHeadEnd;
    MemoryStream stream(request);
    bool is_closed = true;
    serve(*this, stream, is_closed);
    return stream.take_response();
  }

 private:
  // Debian 12 and 13 have other parameters here.
  template <typename Self>
  static void serve(Self& self, httplib::Stream& stream, bool& is_closed) {
    if constexpr (requires { self.process_request(stream, true, is_closed, nullptr); }) {
      (void)self.process_request(stream, true, is_closed, nullptr);
    } else {
      (void)self.process_request(stream, "", 0, "", 0, true, is_closed, nullptr);
    }
  }

  Response respond(Head head) const {
    Response response;
    const bool is_done = guarded("the admin port", [&] { response = checked_response(head); });
    if (is_done) return response;
    response = {};
    response.status = 500;
    response.body = "it failed\n";  // short enough to need no memory
    return response;
  }

  Response checked_response(Head& head) const {
    const auto authority = parse_authority(head.header("Host"));
    if (!authority) {
      return Response::problem({ErrorCode::kBadRequest, "Host", "HOST[:PORT]", "none, or other"},
                               head.path);
    }
    head.authority = *authority;
    if (std::ranges::count(config_.paths, head.path) == 0) {
      return Response::problem({ErrorCode::kNotFound, "no such path on this port",
                                "/livez, /readyz or /metrics", head.path},
                               head.path);
    }
    if (head.method == "GET" || head.method == "HEAD") return handler_(head);
    Response response;
    if (head.method == "OPTIONS") {
      response.status = 204;
    } else {
      response = Response::problem({ErrorCode::kMethodNotAllowed,
                                    "this path cannot be asked for so", "GET or HEAD", head.method},
                                   head.path);
    }
    response.headers["Allow"] = "GET, HEAD, OPTIONS";
    return response;
  }

  static void fill(const Response& from, httplib::Response& to) {
    to.status = from.status;
    to.set_header("Date", http::http_date(std::time(nullptr)));
    std::string media_type = "text/plain; charset=utf-8";
    for (const auto& [name, value] : from.headers) {
      if (http::LessNoCase less; !less(name, "Content-Type") && !less("Content-Type", name)) {
        media_type = value;
      } else {
        to.set_header(name.c_str(), value);
      }
    }
    const auto& body = std::get<std::string>(from.body);
    if (!body.empty()) to.set_content(body, media_type.c_str());
  }

  const HealthServerConfig& config_;
  const HealthHandler& handler_;
  http::Headers headers_;  // of the current request
};

// One client: sends a head, gets a response, and is waited for until it closes.
struct Connection {
  UniqueFd fd;
  Clock::time_point until;
  std::string head;
  std::string response;  // what is left of it, once the head is there
  bool has_response = false;
  bool is_over = false;

  bool sends() const { return has_response && !response.empty(); }
};

class PollingHealthServer final : public HealthServer {
 public:
  PollingHealthServer(HealthServerConfig config, HealthHandler handler, UniqueFd listener)
      : config_(std::move(config)),
        handler_(std::move(handler)),
        listener_(std::move(listener)),
        end_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    try {
      for (std::thread& thread : threads_) thread = std::thread([this] { run(); });
    } catch (...) {
      stop();
      throw;
    }
  }
  ~PollingHealthServer() override { stop(); }

  int port() const override { return http::port_of(listener_.get()); }

  void stop() override {
    ::eventfd_write(end_.get(), 1);
    for (std::thread& thread : threads_) {
      if (thread.joinable()) thread.join();
    }
  }

 private:
  using Connections = std::list<Connection>;

  void run() noexcept {
    Connections connections;
    std::optional<Responder> responder;
    bool is_ended = false;
    while (!is_ended) {
      const bool went_well = guarded("the admin port", [&] {
        if (!responder) responder.emplace(config_, handler_);
        is_ended = !serve_once(connections, *responder);
      });
      if (!went_well) std::this_thread::sleep_for(kPauseAfterFailure);
    }
  }

  // Waits for events and takes them. False: the server stops.
  bool serve_once(Connections& connections, Responder& responder) {
    std::vector<pollfd> entries{{end_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}};
    auto until = Clock::now() + std::chrono::hours(1);
    for (const Connection& connection : connections) {
      const short events = connection.sends() ? POLLOUT : POLLIN;
      entries.push_back({connection.fd.get(), events, 0});
      until = std::min(until, connection.until);
    }
    const auto left = std::chrono::ceil<milliseconds>(until - Clock::now());
    (void)::poll(entries.data(), entries.size(),
                 static_cast<int>(std::max(left, milliseconds(0)).count()));
    if (entries[0].revents != 0) return false;
    auto entry = entries.begin() + 2;
    for (Connection& connection : connections) {
      if (entry++->revents != 0) advance(connection, responder);
      connection.is_over |= Clock::now() >= connection.until;
    }
    std::erase_if(connections, [](const Connection& connection) { return connection.is_over; });
    if (entries[1].revents != 0) accept(connections);
    return true;
  }

  void accept(Connections& connections) const {
    http::Accepted accepted = http::accept_one(listener_.get());
    if (!accepted.fd.valid()) return;  // the other thread was faster
    const auto places = static_cast<size_t>(std::max(1, config_.connections_max / kThreads));
    if (connections.size() >= places) connections.pop_front();
    Connection& connection = connections.emplace_back();
    connection.fd = std::move(accepted.fd);
    connection.until = Clock::now() + kHealthHeadTime;
  }

  static void advance(Connection& connection, Responder& responder) {
    if (connection.sends()) {
      send(connection);
    } else {
      receive(connection, responder);
    }
  }

  static void receive(Connection& connection, Responder& responder) {
    std::array<char, 4096> bytes;
    const ssize_t count = ::recv(connection.fd.get(), bytes.data(), bytes.size(), 0);
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
    connection.is_over = count <= 0;
    // Behind the head there is nothing of interest.
    if (connection.is_over || connection.has_response) return;
    connection.head.append(bytes.data(), static_cast<size_t>(count));
    const size_t end = connection.head.find(kHeadEnd);
    if (end == std::string::npos && connection.head.size() <= kHealthHeadBytesMax) return;
    connection.response =
        end <= kHealthHeadBytesMax
            ? responder.respond_to(std::string_view(connection.head).substr(0, end))
            : "HTTP/1.1 431 Request Header Fields Too Large\r\n"
              "Content-Length: 0\r\nConnection: close\r\n\r\n";
    connection.has_response = true;
    connection.until = Clock::now() + kHealthSendTime;
    send(connection);
  }

  static void send(Connection& connection) {
    const ssize_t count = ::send(connection.fd.get(), connection.response.data(),
                                 connection.response.size(), MSG_NOSIGNAL);
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
    connection.is_over = count < 0;
    if (connection.is_over) return;
    connection.response.erase(0, static_cast<size_t>(count));
    if (!connection.response.empty()) return;
    // Closing at once would reset the connection where the client has sent more than a head, and
    // with it the response.
    ::shutdown(connection.fd.get(), SHUT_WR);
    connection.until = Clock::now() + kLingerTime;
  }

  const HealthServerConfig config_;
  const HealthHandler handler_;
  const UniqueFd listener_, end_;
  std::array<std::thread, kThreads> threads_;  // last: they use all of the above
};

}  // namespace

Result<std::unique_ptr<HealthServer>> start_health_server(const HealthServerConfig& config,
                                                          HealthHandler handler) {
  VOXELD_ASSIGN(UniqueFd listener, http::listen_tcp(config.listen));
  return std::unique_ptr<HealthServer>(
      std::make_unique<PollingHealthServer>(config, std::move(handler), std::move(listener)));
}

}  // namespace voxeld::api
