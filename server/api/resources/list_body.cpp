#include "server/api/resources/list_body.h"

#include <limits>
#include <memory>
#include <utility>

#include "proto/messages/json_writer.h"
#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"

namespace voxeld::api {

// Makes the pieces of one list.
class ListReader {
 public:
  ListReader(std::string open, ListPage page, ListSource source)
      : open_(std::move(open)), page_(std::move(page)), source_(std::move(source)) {}

  Result<Piece> next() {
    Piece piece;
    const bool is_begin = !open_.empty();
    piece.text = std::exchange(open_, {});
    ListRows rows(page_, piece.text, is_begin);
    // A copy: page_.after goes on with each row.
    VOXELD_TRY(source_(std::string(page_.after), rows));
    piece.is_last = !rows.is_full_ || rows.has_more_;
    if (!piece.is_last) return piece;
    piece.text += ']';
    JsonWriter json(piece.text);
    if (rows.has_more_) json.member("next", page_.after);
    json.end_object();
    return piece;
  }

 private:
  std::string open_;
  ListPage page_;
  const ListSource source_;
};

bool ListRows::add(std::string_view json, std::string_view cursor) {
  has_more_ = page_.limit == 0;
  // A row that is longer than a piece has one of its own.
  const bool has_room =
      count_ == 0 || piece_.size() + json.size() < static_cast<size_t>(kPieceBytesMax);
  is_full_ = has_more_ || !has_room;
  if (is_full_) return false;
  if (count_ > 0 || !is_begin_) piece_ += ',';
  piece_ += json;
  page_.after = cursor;
  --page_.limit;
  ++count_;
  return true;
}

Error bad_cursor(std::string_view after) {
  return {ErrorCode::kInvalidOption, "after", "the `next` of an earlier page of this list",
          echoed(after)};
}

Result<int64_t> cursor_number(std::string_view after) {
  if (after.empty()) return int64_t{-1};
  // Far beyond each list, so that sums with it do not overflow.
  constexpr int64_t kCursorMax = std::numeric_limits<int64_t>::max() / 2;
  const auto number = parse_number<int64_t>(after, 0, kCursorMax);
  if (!number) return bad_cursor(after);
  return *number;
}

Result<ListPage> requested_page(const Request& request, ListLimits limits) {
  ListPage page{limits.by_default, ""};
  for (const auto& [name, value] : request.head.query) {
    if (name == "after") {
      VOXELD_TRY(check_length(client_texts::kCursor, value));
      page.after = value;
    } else if (name == "limit") {
      const auto limit = parse_number<int64_t>(value, 1, limits.at_most);
      if (!limit) {
        return Error{ErrorCode::kInvalidOption, "limit",
                     "an integer from 1 to " + std::to_string(limits.at_most), echoed(value)};
      }
      page.limit = *limit;
    }
  }
  return page;
}

Response list_response(std::string head, std::string_view name, ListPage page, ListSource source) {
  std::string open = std::move(head);
  open.insert(open.begin(), '{');
  JsonWriter(open).key(name);
  open += '[';
  auto reader = std::make_shared<ListReader>(std::move(open), std::move(page), std::move(source));
  Response response = Response::json(200, "");
  response.body = PieceBody{[reader] { return reader->next(); }};
  return response;
}

}  // namespace voxeld::api
