#include "server/base/pieces.h"

#include <gtest/gtest.h>

#include <functional>
#include <numeric>

namespace voxeld {
namespace {

constexpr size_t kCount = 20'000'000;  // 80 MB: its pages are released before it is freed

TEST(Pieces, make_the_arrays_that_the_functions_of_a_vector_make) {
  std::vector<uint32_t> numbers(kCount);
  std::iota(numbers.begin(), numbers.end(), 0u);
  EXPECT_EQ(numbers_in_pieces(kCount), numbers);
  EXPECT_EQ(copied_in_pieces(numbers.data(), numbers.size()), numbers);

  std::vector<uint32_t> pushed;
  for (const uint32_t number : numbers) push_in_pieces(pushed, number);
  EXPECT_EQ(pushed, numbers);

  std::vector<uint32_t> joined{0, 1};
  append_in_pieces(joined, std::span(numbers).subspan(2));
  EXPECT_EQ(joined, numbers);

  resize_in_pieces(pushed, kCount + 3, 7u);
  numbers.resize(kCount + 3, 7u);
  EXPECT_EQ(pushed, numbers);
  resize_in_pieces(pushed, 2);
  EXPECT_EQ(pushed, (std::vector<uint32_t>{0, 1}));

  free_in_pieces(numbers);
  EXPECT_EQ(numbers.capacity(), 0u);

  std::vector<uint32_t> sorted{3, 1, 2};
  cancellable_sort(sorted.begin(), sorted.end(), std::less<>());
  EXPECT_EQ(sorted, (std::vector<uint32_t>{1, 2, 3}));
}

TEST(Pieces, room_doubles_where_an_array_grows_step_by_step) {
  std::vector<uint32_t> values{1, 2};
  make_room_in_pieces(values, 100);
  EXPECT_EQ(values.capacity(), 102u);
  values.resize(90);
  make_room_in_pieces(values, 12);
  EXPECT_EQ(values.capacity(), 102u);
  make_room_in_pieces(values, 13);
  EXPECT_EQ(values.capacity(), 180u);
  EXPECT_EQ(values[1], 2u);
}

TEST(Pieces, pushes_an_element_of_the_array_itself) {
  std::vector<uint32_t> values{1, 2};
  for (int i = 0; i < 100; ++i) push_in_pieces(values, values.front());
  EXPECT_EQ(values.back(), 1u);
}

TEST(Pieces, end_when_they_are_cancelled) {
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  std::vector<uint32_t> values{3, 1, 2};
  EXPECT_THROW(reserve_in_pieces(values, kCount), Cancelled);
  EXPECT_EQ(values, (std::vector<uint32_t>{3, 1, 2}));
  EXPECT_THROW(append_in_pieces(values, std::vector<uint32_t>{4}), Cancelled);
  EXPECT_THROW(resize_in_pieces(values, kCount), Cancelled);
  EXPECT_THROW(copied_in_pieces(values.data(), values.size()), Cancelled);
  EXPECT_THROW(numbers_in_pieces(kCount), Cancelled);
  EXPECT_THROW(cancellable_sort(values.begin(), values.end(), std::less<>()), Cancelled);
}

}  // namespace
}  // namespace voxeld
