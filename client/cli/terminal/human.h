// Numbers, and tables of them, as people read them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace voxeld::cli {

std::string count_text(std::int64_t count);  // "1,234,567"
std::string bytes_text(std::int64_t bytes);  // "812 B", "1.2 MB"; powers of 1000
std::string seconds_text(double seconds);    // "0.042 s", "1.24 s", "3 min 12 s", "2 h 5 min"
std::int64_t unix_now_ms();
std::string age_text(std::int64_t since_ms, std::int64_t now_ms);  // "12 s", "5 min", "3 h", "2 d"

// A text of a file or of other people for a terminal, which control characters could change: they
// become '?'.
std::string printable(std::string_view text);

// Rows whose cells begin in the same columns, two spaces apart.
class Table {
 public:
  // `alignment`: a letter for each column, 'l' or 'r'.
  explicit Table(std::string alignment) : alignment_(std::move(alignment)) {}
  // As many cells as columns, or fewer. They become printable.
  void add(std::vector<std::string> cells);
  // Each row with a line feed, without spaces at its end.
  std::string text() const;

 private:
  std::string alignment_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace voxeld::cli
