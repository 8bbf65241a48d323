#include "server/http/exchange.h"

#include <exception>
#include <string_view>
#include <utility>

#include "proto/text/client_texts.h"
#include "server/base/log.h"
#include "server/base/random.h"
#include "server/http/client_address.h"

namespace voxeld::http {
namespace {

// Bytes of a path in the log.
constexpr size_t kDescribedBytesMax = 200;

std::string new_request_id() {
  return "r-" + id_hex(16);
}

bool is_plain_id(std::string_view id) {
  return !id.empty() && id.size() <= client_texts::kRequestId.bytes_max &&
         id.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyz"
             "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
             "0123456789-_.") == id.npos;
}

// Gathers a body as text.
class TextSink final : public BodySink {
 public:
  explicit TextSink(TextBody body) : body_(std::move(body)) {}
  Status take(std::span<const uint8_t> piece) override {
    text_.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    return {};
  }
  Reply finish(Request& request) override { return body_.then(request, std::move(text_)); }

 private:
  const TextBody body_;
  std::string text_;
};

}  // namespace

Exchange::Exchange(const Context& context, Connection& connection, Result<Head> head,
                   bool is_refused, std::shared_ptr<Waker> waker, void* owner)
    : context_(context), connection_(connection), owner_(owner), is_refused_(is_refused) {
  peer_ = connection.peer();
  if (!head) {
    bad_head_ = std::move(head).error();
    request_.request_id = new_request_id();
    return;
  }
  request_.head = *std::move(head);
  request_.waker = std::move(waker);
  peer_ = take_client_address(request_.head, peer_, context.trusted_proxies);
  const std::string_view given = request_.head.header("X-Request-Id");
  request_.request_id = is_plain_id(given) ? std::string(given) : new_request_id();
  const auto parent = parse_traceparent(request_.head.header("traceparent"));
  request_.trace = parent ? child_span(*parent) : new_trace();
  is_body_whole_ = !request_.head.has_body();
}

Exchange::Step Exchange::advance() {
  while (true) {
    switch (stage_) {
      case Stage::kHandler:
        use(handle());
        break;
      case Stage::kBody:
        if (const auto step = advance_body()) return *step;
        break;
      case Stage::kWait: {
        std::optional<Response> response = look();
        if (!response) return Step::kWait;
        wait_.reset();
        respond(*std::move(response));
        break;
      }
      case Stage::kSend:
        return send();
    }
  }
}

Reply Exchange::handle() {
  if (bad_head_) {
    Response response = Response::problem(*bad_head_, "");
    // A head gets 415 for its coding alone. Other reasons forbid the header (RFC 9110, 12.5.3).
    if (response.status == 415) response.headers["Accept-Encoding"] = "gzip, zstd";
    return response;
  }
  if (is_refused_) {
    return Response::problem(
        {ErrorCode::kShuttingDown, "the daemon is shutting down; try again", "", ""},
        request_.head.path, request_.trace.trace_id);
  }
  return guarded([this] { return context_.handler(request_); });
}

// Out of memory and the like: one response fails, the daemon goes on. The text of the exception may
// contain data of other tenants, so it goes to the log alone.
Response Exchange::unexpected(const std::exception& failure) const {
  log::error("a handler failed", {{"id", request_.request_id}, {"error", failure.what()}});
  return Response::problem(
      {ErrorCode::kInternal, "unexpected failure; the daemon's log has it by this request's id", "",
       ""},
      request_.head.path, request_.trace.trace_id);
}

Reply Exchange::guarded(const std::function<Reply()>& call) const {
  try {
    return call();
  } catch (const std::exception& failure) {
    return unexpected(failure);
  }
}

std::optional<Response> Exchange::look() {
  try {
    return wait_->look(request_);
  } catch (const std::exception& failure) {
    return unexpected(failure);
  }
}

void Exchange::use(Reply reply) {
  if (auto* response = std::get_if<Response>(&reply.next)) return respond(std::move(*response));
  if (auto* wait = std::get_if<std::unique_ptr<Wait>>(&reply.next)) {
    wait_ = std::move(*wait);
    stage_ = Stage::kWait;
    return;
  }
  if (auto* body = std::get_if<StreamedBody>(&reply.next)) {
    return begin_body(body->bytes_max, std::move(body->sink), 0);
  }
  auto& text = std::get<TextBody>(reply.next);
  const int64_t bytes_max = text.bytes_max;
  const Head& head = request_.head;
  const bool is_plain = !head.chunked && head.coding == ContentCoding::kNone;
  const int64_t length = is_plain ? head.content_length.value_or(0) : bytes_max;
  begin_body(bytes_max, std::make_unique<TextSink>(std::move(text)), length);
}

void Exchange::begin_body(int64_t bytes_max, std::unique_ptr<BodySink> sink, int64_t memory_bytes) {
  const Head& head = request_.head;
  auto decoder = BodyDecoder::open(head, bytes_max);
  if (!decoder) {
    return respond(Response::problem(decoder.error(), head.path, request_.trace.trace_id));
  }
  decoder_.emplace(*std::move(decoder));
  sink_ = std::move(sink);
  if (memory_bytes > kSmallBodyBytesMax) {
    body_memory_bytes_ = memory_bytes;
    body_share_ = std::make_unique<MemoryShare>(context_.body_budget, tenant(), owner_);
  }
  // A client that sent some of the body with the head does not wait for this. One that has not read
  // its earlier responses has no room for it.
  constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";
  const bool expects = !is_body_whole_ && !head.header("Expect").empty() && head.minor == 1;
  if (expects && connection_.buffer().empty() &&
      connection_.send_some(kContinue) != std::ssize(kContinue)) {
    keep_ = false;
    return respond(Response::problem(short_body_error(), head.path, request_.trace.trace_id));
  }
  body_started_ = Clock::now();
  stage_ = Stage::kBody;
}

std::optional<Exchange::Step> Exchange::advance_body() {
  if (body_memory_bytes_ > 0) {
    if (!body_share_->reserve(body_memory_bytes_)) return Step::kNeedMemory;
    body_memory_bytes_ = 0;
    body_started_ = Clock::now();  // bytes that wait in the socket are not late
  }
  bool needs_more = false;
  Reply reply = guarded([&]() -> Reply {
    const auto whole = decoder_->feed(connection_.buffer(), [this](std::span<const uint8_t> piece) {
      return sink_->take(piece);
    });
    if (!whole) {
      return Response::problem(whole.error(), request_.head.path, request_.trace.trace_id);
    }
    needs_more = !*whole;
    if (needs_more) return Response();
    is_body_whole_ = true;
    return sink_->finish(request_);
  });
  if (needs_more) return Step::kReadBody;
  end_body();
  use(std::move(reply));
  return std::nullopt;
}

void Exchange::end_body() {
  sink_.reset();
  body_share_.reset();
  bytes_in_ = decoder_->bytes_read();
  decoder_.reset();  // the window of zstd alone has up to 8 MiB
}

void Exchange::fail_body(const Error& error) {
  end_body();
  respond(Response::problem(error, request_.head.path, request_.trace.trace_id));
}

void Exchange::abandon() {
  if (wait_) wait_->abandon(request_);
}

Clock::time_point Exchange::wait_until() const {
  return output_ ? output_->wait_until() : wait_->until();
}

bool Exchange::is_body_too_slow() const {
  const auto elapsed =
      std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - body_started_);
  const int64_t late = elapsed.count() - kBodyGraceSeconds;
  return late > 0 && decoder_->bytes_read() < late * kBodyRateMin;
}

void Exchange::respond(Response response) {
  const Head& head = request_.head;
  if (!bad_head_ && context_.add_headers) context_.add_headers(request_, response);
  if (!bad_head_) response.headers["traceresponse"] = traceparent_text(request_.trace);
  response.headers["X-Request-Id"] = request_.request_id;
  response.headers["X-Content-Type-Options"] = "nosniff";
  // For HTTP/1.0 the end of the connection is that of a body of unknown length.
  const bool ends_by_close = head.minor == 0 && std::holds_alternative<PieceBody>(response.body);
  keep_ = !bad_head_ && is_body_whole_ && head.keep_alive() && !response.close && !ends_by_close &&
          !context_.is_draining;
  Output::Context context;
  if (!bad_head_) {
    context.method = head.method;
    context.path = head.path;
    context.minor = head.minor;
  }
  context.request_id = request_.request_id;
  context.trace_id = request_.trace.trace_id;
  context.keep = keep_;
  output_ =
      std::make_unique<Output>(std::move(context), std::move(response), context_.response_budget,
                               tenant(), owner_, context_.held_files);
  responded_ = Clock::now();
  stage_ = Stage::kSend;
}

Exchange::Step Exchange::send() {
  switch (output_->advance(connection_)) {
    case Output::State::kBlocked:
      return Step::kSend;
    case Output::State::kHeld:
      return Step::kNeedMemory;
    case Output::State::kWaiting:
      return Step::kWait;
    case Output::State::kDone:
      return connection_.broken() ? Step::kBroken : Step::kDone;
    case Output::State::kBroken:
      return Step::kBroken;
  }
  return Step::kBroken;
}

std::string Exchange::tenant() const {
  return request_.key_id.empty() ? "" : request_.caller.tenant();
}

ExchangeRecord Exchange::record() const {
  ExchangeRecord record;
  record.head = &request_.head;
  record.request_id = request_.request_id;
  record.trace_id = request_.trace.trace_id;
  record.peer = peer_;
  record.key_id = request_.key_id;
  record.tenant = tenant();
  record.route = request_.route;
  record.status = output_ ? output_->status() : kClientClosedStatus;
  record.bytes_in = decoder_ ? decoder_->bytes_read() : bytes_in_;
  record.bytes_out = output_ ? output_->body_sent() : 0;
  return record;
}

std::string Exchange::description() const {
  if (bad_head_) return "a broken head";
  return request_.head.method + " " + request_.head.path.substr(0, kDescribedBytesMax);
}

}  // namespace voxeld::http
