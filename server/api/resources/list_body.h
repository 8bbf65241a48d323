// Lists as responses: pages by `limit` and `after`. Rows are read from their source while the list
// is sent, so a list of any length needs the memory of one piece.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/api/http_types.h"

namespace voxeld::api {

// Rows of a page: by default, and at most (invalid-option).
struct ListLimits {
  int64_t by_default = 100;
  int64_t at_most = 1000;
};

// The page that a client asks for.
struct ListPage {
  int64_t limit = 0;  // rows
  std::string after;  // `next` of the page before; empty: from the first row on
};

// Reads `limit` and `after` of the query. Errors: invalid-option.
Result<ListPage> requested_page(const Request& request, ListLimits limits = {});
// The number that a cursor holds; -1 for an empty one. Errors: invalid-option.
Result<int64_t> cursor_number(std::string_view after);
// A cursor that is none of this list's.
Error bad_cursor(std::string_view after);

// Receives the rows of a list from its source.
class ListRows {
 public:
  // `json` is an object, `cursor` what names its place. False: no more is taken, stop reading.
  bool add(std::string_view json, std::string_view cursor);

 private:
  friend class ListReader;
  ListRows(ListPage& page, std::string& piece, bool is_begin)
      : page_(page), piece_(piece), is_begin_(is_begin) {}
  ListPage& page_;  // what is left of it
  std::string& piece_;
  const bool is_begin_;  // of the list
  int64_t count_ = 0;    // of the piece
  bool is_full_ = false, has_more_ = false;
};

// Adds the rows that come after the one that `after` names (empty: all) until ListRows::add() says
// no. Called once for each piece, on any thread; it must not hold anything between calls.
using ListSource = std::function<Status(const std::string& after, ListRows& rows)>;

// {<head>,"<name>":[row, …],"next":"…"}: `head` is members that come first, or empty; `next` is
// there when rows are left.
Response list_response(std::string head, std::string_view name, ListPage page, ListSource source);

}  // namespace voxeld::api
