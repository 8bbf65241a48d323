#include "client/transport.h"

#include <curl/curl.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <mutex>
#include <string_view>
#include <utility>

namespace voxeld::client {
namespace {

// State that the callbacks of one exchange share. Exceptions of the caller's functions must not
// pass through libcurl: they are stored and rethrown afterwards.
struct Exchange {
  const HttpRequest& request;
  HttpResponse& response;
  CURL* curl;
  std::exception_ptr thrown;
};

template <typename Action>
size_t guarded(Exchange& exchange, size_t on_failure, Action&& action) {
  try {
    return action();
  } catch (...) {
    exchange.thrown = std::current_exception();
    return on_failure;
  }
}

size_t on_read(char* buffer, size_t size, size_t count, void* user) {
  auto& exchange = *static_cast<Exchange*>(user);
  return guarded(exchange, CURL_READFUNC_ABORT, [&] {
    return exchange.request.body(std::as_writable_bytes(std::span(buffer, size * count)));
  });
}

size_t on_write(char* data, size_t size, size_t count, void* user) {
  auto& exchange = *static_cast<Exchange*>(user);
  const size_t bytes = size * count;
  long status = 0;
  curl_easy_getinfo(exchange.curl, CURLINFO_RESPONSE_CODE, &status);
  return guarded(exchange, 0, [&] {
    if (exchange.request.sink && status / 100 == 2) {
      exchange.request.sink(std::as_bytes(std::span(data, bytes)));
      exchange.response.sunk_bytes += static_cast<long long>(bytes);
    } else {
      exchange.response.body.append(data, bytes);
    }
    return bytes;
  });
}

// Called at the empty line after each head. Heads of 1xx responses come before the final one.
size_t on_head_end(Exchange& exchange, size_t bytes) {
  long status = 0;
  curl_easy_getinfo(exchange.curl, CURLINFO_RESPONSE_CODE, &status);
  if (!exchange.request.on_head || status < 200) return bytes;
  exchange.response.status = static_cast<int>(status);
  return guarded(exchange, 0, [&] {
    exchange.request.on_head(exchange.response);
    return bytes;
  });
}

size_t on_header(char* data, size_t size, size_t count, void* user) {
  auto& exchange = *static_cast<Exchange*>(user);
  const std::string_view line(data, size * count);
  if (line == "\r\n" || line == "\n") return on_head_end(exchange, line.size());
  if (line.starts_with("HTTP/")) exchange.response.headers.clear();
  const size_t colon = line.find(':');
  if (colon != std::string_view::npos) {
    std::string name(line.substr(0, colon));
    std::ranges::transform(name, name.begin(), [](char c) {
      return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    });
    std::string_view value = line.substr(colon + 1);
    while (!value.empty() && value.front() == ' ') value.remove_prefix(1);
    while (!value.empty() && (value.back() == '\r' || value.back() == '\n')) value.remove_suffix(1);
    exchange.response.headers[name] = value;
  }
  return line.size();
}

int on_progress(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  auto& exchange = *static_cast<Exchange*>(user);
  if (!exchange.request.keep_going) return 0;
  return guarded(exchange, 0, [&] { return exchange.request.keep_going() ? size_t{1} : size_t{0}; })
             ? 0
             : 1;
}

// libcurl has one code for a URL of another protocol and for a server that does not speak HTTP.
bool is_other_server(CURL* curl, CURLcode code) {
  long connections = 0;
  curl_easy_getinfo(curl, CURLINFO_NUM_CONNECTS, &connections);
  return code == CURLE_UNSUPPORTED_PROTOCOL && connections > 0;
}

HttpResponse::Failure failure_of(CURL* curl, CURLcode code) {
  if (is_other_server(curl, code)) return HttpResponse::Failure::kBroken;
  switch (code) {
    case CURLE_OK:
      return HttpResponse::Failure::kNone;
    case CURLE_COULDNT_CONNECT:
    case CURLE_COULDNT_RESOLVE_HOST:
    case CURLE_UNSUPPORTED_PROTOCOL:
    case CURLE_URL_MALFORMAT:
      return HttpResponse::Failure::kUnreachable;
    case CURLE_OPERATION_TIMEDOUT:
      return HttpResponse::Failure::kTimeout;
    case CURLE_ABORTED_BY_CALLBACK:
      return HttpResponse::Failure::kInterrupted;
    default:
      return HttpResponse::Failure::kBroken;
  }
}

// The reason of a failure, without the URL, which the caller names. libcurl's own text of a
// refused connection has the address, and "connect" twice. It stays for a proxy, whose address is
// another.
std::string failure_text(CURL* curl, CURLcode code, std::string_view own, const std::string& url) {
  constexpr std::string_view kConnect = "Failed to connect to ";
  if (is_other_server(curl, code)) return "the server does not speak HTTP";
  if (code == CURLE_UNSUPPORTED_PROTOCOL) return "the URL begins with neither http:// nor https://";
  if (code == CURLE_COULDNT_RESOLVE_HOST) return "the name of the host is not known";
  if (own.empty()) return curl_easy_strerror(code);
  if (!own.starts_with(kConnect)) return std::string(own);
  const std::string_view host = own.substr(kConnect.size(), own.find(" port ") - kConnect.size());
  if (url.find(host) == std::string::npos) return std::string(own);
  long error = 0;
  curl_easy_getinfo(curl, CURLINFO_OS_ERRNO, &error);
  if (code == CURLE_COULDNT_CONNECT && error != 0) return std::strerror(static_cast<int>(error));
  const size_t after = own.find(" after "), end = own.find(':', after);
  if (after == std::string_view::npos) return "no connection";
  return "no connection" + std::string(own.substr(after, end - after));
}

// Hosts that are asked without a proxy: this machine, and those of the user's variable, which
// libcurl reads only where the option is not set.
std::string hosts_without_proxy() {
  std::string hosts = "localhost,127.0.0.1,::1";
  for (const char* name : {"no_proxy", "NO_PROXY"}) {
    const char* value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    const std::string_view given = value;
    return given == "*" ? "*" : hosts.append(",").append(given);
  }
  return hosts;
}

template <typename Value>
void set(CURL* curl, CURLoption option, Value value) {
  curl_easy_setopt(curl, option, value);
}

}  // namespace

struct Transport::Impl {
  CURL* curl = nullptr;
  std::chrono::seconds connect_timeout, timeout;
  std::string authorization;  // a header line; empty: none
  std::string without_proxy = hosts_without_proxy();
};

Transport::Transport(std::chrono::seconds connect_timeout, std::chrono::seconds timeout,
                     std::string key)
    : impl_(std::make_unique<Impl>()) {
  static std::once_flag once;
  std::call_once(once, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
  impl_->curl = curl_easy_init();
  impl_->connect_timeout = connect_timeout;
  impl_->timeout = timeout;
  if (!key.empty()) impl_->authorization = "Authorization: Bearer " + std::move(key);
}

Transport::~Transport() {
  curl_easy_cleanup(impl_->curl);
}

HttpResponse Transport::exchange(const HttpRequest& request) {
  CURL* curl = impl_->curl;
  curl_easy_reset(curl);
  HttpResponse response;
  Exchange exchange{request, response, curl, nullptr};
  char error_text[CURL_ERROR_SIZE] = "";
  set(curl, CURLOPT_URL, request.url.c_str());
  set(curl, CURLOPT_PROTOCOLS_STR, "http,https");
  set(curl, CURLOPT_NOPROXY, impl_->without_proxy.c_str());
  set(curl, CURLOPT_NOSIGNAL, 1L);
  set(curl, CURLOPT_ERRORBUFFER, error_text);
  set(curl, CURLOPT_CONNECTTIMEOUT, static_cast<long>(impl_->connect_timeout.count()));
  if (impl_->timeout.count() > 0) {
    set(curl, CURLOPT_TIMEOUT, static_cast<long>((impl_->timeout + request.held).count()));
  }
  // A machine that is gone without a word is known to be after some three minutes.
  set(curl, CURLOPT_TCP_KEEPALIVE, 1L);
  set(curl, CURLOPT_TCP_KEEPINTVL, 15L);
  set(curl, CURLOPT_WRITEFUNCTION, on_write);
  set(curl, CURLOPT_WRITEDATA, &exchange);
  set(curl, CURLOPT_HEADERFUNCTION, on_header);
  set(curl, CURLOPT_HEADERDATA, &exchange);
  set(curl, CURLOPT_XFERINFOFUNCTION, on_progress);
  set(curl, CURLOPT_XFERINFODATA, &exchange);
  set(curl, CURLOPT_NOPROGRESS, 0L);

  curl_slist* headers = nullptr;
  if (!impl_->authorization.empty()) {
    headers = curl_slist_append(headers, impl_->authorization.c_str());
  }
  for (const std::string& header : request.headers) {
    headers = curl_slist_append(headers, header.c_str());
  }
  if (request.body) {
    set(curl, CURLOPT_POST, 1L);
    set(curl, CURLOPT_READFUNCTION, on_read);
    set(curl, CURLOPT_READDATA, &exchange);
    if (request.body_bytes) {
      set(curl, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(*request.body_bytes));
    } else {
      headers = curl_slist_append(headers, "Transfer-Encoding: chunked");
    }
  } else if (request.method == "POST") {
    set(curl, CURLOPT_POST, 1L);
    set(curl, CURLOPT_POSTFIELDSIZE, 0L);
  } else if (request.method != "GET") {
    set(curl, CURLOPT_CUSTOMREQUEST, request.method.c_str());
  }
  set(curl, CURLOPT_HTTPHEADER, headers);
  const CURLcode code = curl_easy_perform(curl);
  curl_slist_free_all(headers);
  if (exchange.thrown) std::rethrow_exception(exchange.thrown);

  long status = 0;
  curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &status);
  response.failure = failure_of(curl, code);
  response.status = static_cast<int>(status);
  // A response that arrives before the whole body was sent (413, say) is still valid.
  if (response.failure == HttpResponse::Failure::kBroken && status >= 400 &&
      !response.body.empty()) {
    response.failure = HttpResponse::Failure::kNone;
  }
  if (response.failure != HttpResponse::Failure::kNone) {
    response.failure_text = failure_text(curl, code, error_text, request.url);
  }
  return response;
}

}  // namespace voxeld::client
