#include "server/formats/minecraft/nbt_writer.h"

#include <bit>
#include <limits>

#include "server/base/check.h"

namespace voxeld::minecraft {

void NbtWriter::text(std::string_view value) {
  VOXELD_CHECK(value.size() <= std::numeric_limits<uint16_t>::max(), "nbt: a text is too long");
  number(static_cast<uint16_t>(value.size()));
  bytes_.insert(bytes_.end(), value.begin(), value.end());
}

void NbtWriter::tag(NbtTag id, std::string_view name) {
  number(static_cast<uint8_t>(id));
  text(name);
}

void NbtWriter::add_short(std::string_view name, uint16_t value) {
  tag(NbtTag::kShort, name);
  number(value);
}

void NbtWriter::add_int(std::string_view name, int32_t value) {
  tag(NbtTag::kInt, name);
  number(static_cast<uint32_t>(value));
}

void NbtWriter::add_long(std::string_view name, int64_t value) {
  tag(NbtTag::kLong, name);
  number(static_cast<uint64_t>(value));
}

void NbtWriter::add_text(std::string_view name, std::string_view value) {
  tag(NbtTag::kString, name);
  text(value);
}

void NbtWriter::add_ints(std::string_view name, std::span<const int32_t> values) {
  begin_array(NbtTag::kIntArray, name, static_cast<int32_t>(values.size()));
  for (const int32_t value : values) number(static_cast<uint32_t>(value));
}

void NbtWriter::add_int_list(std::string_view name, std::span<const int32_t> values) {
  begin_list(name, NbtTag::kInt, static_cast<int32_t>(values.size()));
  for (const int32_t value : values) number(static_cast<uint32_t>(value));
}

void NbtWriter::add_double_list(std::string_view name, std::span<const double> values) {
  begin_list(name, NbtTag::kDouble, static_cast<int32_t>(values.size()));
  for (const double value : values) number(std::bit_cast<uint64_t>(value));
}

void NbtWriter::begin_list(std::string_view name, NbtTag items, int32_t count) {
  tag(NbtTag::kList, name);
  number(static_cast<uint8_t>(items));
  number(static_cast<uint32_t>(count));
}

void NbtWriter::begin_array(NbtTag array, std::string_view name, int32_t count) {
  tag(array, name);
  number(static_cast<uint32_t>(count));
}

}  // namespace voxeld::minecraft
