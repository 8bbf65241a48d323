// Lists as responses: pages, pieces and cursors.
#include "server/api/resources/list_body.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <tuple>
#include <vector>

namespace voxeld::api {
namespace {

// Follows `next` through a list of `count` rows of `row_bytes` each.
std::vector<int> walk(int count, size_t row_bytes, int64_t limit, int* pages) {
  std::vector<int> seen;
  ListPage page{limit, ""};
  *pages = 0;
  while (true) {
    Response response = list_response(
        "\"head\":1", "rows", page, [&](const std::string& after, ListRows& rows) -> Status {
          VOXELD_ASSIGN(int64_t i, cursor_number(after));
          while (++i < count) {
            const std::string row = "\"" + std::to_string(i) + std::string(row_bytes, ' ') + "\"";
            if (!rows.add(row, std::to_string(i))) break;
          }
          return {};
        });
    auto& pieces = std::get<PieceBody>(response.body);
    std::string text;
    for (bool is_last = false; !is_last;) {
      const auto piece = pieces.next();
      EXPECT_LE(piece->text.size(), static_cast<size_t>(kPieceBytesMax) + 100);
      text += piece->text;
      is_last = piece->is_last;
    }
    ++*pages;
    const auto json = nlohmann::json::parse(text);
    EXPECT_EQ(json["head"], 1);
    for (const auto& row : json["rows"]) seen.push_back(std::stoi(row.get<std::string>()));
    if (!json.contains("next")) return seen;
    page.after = json["next"];
  }
}

TEST(ListBody, pages_give_every_row_once_and_in_order) {
  for (const auto& [count, bytes, limit, pages_expected] : {std::tuple{0, 10, 10, 1},
                                                            {10, 10, 10, 1},
                                                            {11, 10, 10, 2},
                                                            {1000, 1000, 1000, 1},
                                                            {1000, 1000, 333, 4},
                                                            {7, 60'000, 7, 1}}) {
    int pages = 0;
    const std::vector<int> seen = walk(count, static_cast<size_t>(bytes), limit, &pages);
    EXPECT_EQ(pages, pages_expected) << count;
    ASSERT_EQ(seen.size(), static_cast<size_t>(count));
    for (int i = 0; i < count; ++i) EXPECT_EQ(seen[static_cast<size_t>(i)], i);
  }
}

}  // namespace
}  // namespace voxeld::api
