#include "server/http/message/content_coding.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/unit/http/coding.h"

namespace voxeld::http {
namespace {

using testing::gzip;
using testing::zstd;

constexpr int64_t kMost = 1 << 20;

std::string coded(ContentCoding coding, const std::string& text) {
  return coding == ContentCoding::kGzip ? gzip(text) : zstd(text);
}

// Decodes in pieces of `step` bytes.
Result<std::string> decoded(ContentCoding coding, const std::string& bytes, size_t step,
                            int64_t bytes_max = kMost) {
  const auto decoder = make_content_decoder(coding, bytes_max);
  std::string text;
  const auto sink = [&](std::span<const uint8_t> piece) -> Status {
    text.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    return {};
  };
  for (size_t at = 0; at < bytes.size(); at += step) {
    const std::string piece = bytes.substr(at, step);
    VOXELD_TRY(decoder->feed({reinterpret_cast<const uint8_t*>(piece.data()), piece.size()}, sink));
  }
  VOXELD_TRY(decoder->finish());
  return text;
}

// Does not compress well.
std::string noise(size_t bytes) {
  std::string text;
  uint32_t state = 1;
  while (text.size() < bytes) {
    state = state * 1664525 + 1013904223;
    text += static_cast<char>('a' + (state >> 24) % 26);
  }
  return text;
}

class ContentCodings : public ::testing::TestWithParam<ContentCoding> {};
INSTANTIATE_TEST_SUITE_P(All, ContentCodings,
                         ::testing::Values(ContentCoding::kGzip, ContentCoding::kZstd));

TEST_P(ContentCodings, give_the_body_however_it_arrives) {
  for (const std::string& text : {std::string(), std::string("x"), noise(300'000)}) {
    const std::string bytes = coded(GetParam(), text);
    for (const size_t step : {size_t{1}, size_t{7}, size_t{65536}, bytes.size()}) {
      const auto out = decoded(GetParam(), bytes, step);
      ASSERT_TRUE(out) << out.error().message();
      EXPECT_TRUE(*out == text) << step;
    }
  }
}

TEST_P(ContentCodings, several_streams_are_one_body) {
  const std::string bytes = coded(GetParam(), "one ") + coded(GetParam(), "two");
  for (const size_t step : {size_t{1}, bytes.size()}) {
    EXPECT_EQ(decoded(GetParam(), bytes, step).value(), "one two");
  }
}

TEST_P(ContentCodings, every_truncation_is_refused) {
  const std::string bytes = coded(GetParam(), "some text that is long enough");
  for (size_t length = 0; length < bytes.size(); ++length) {
    const auto out = decoded(GetParam(), bytes.substr(0, length), bytes.size());
    ASSERT_FALSE(out) << length;
    EXPECT_EQ(out.error().code, ErrorCode::kBadRequest);
  }
}

TEST_P(ContentCodings, garbage_is_refused_before_and_after) {
  const std::string bytes = coded(GetParam(), "text");
  EXPECT_EQ(decoded(GetParam(), "garbage!", 100).error().code, ErrorCode::kBadRequest);
  EXPECT_EQ(decoded(GetParam(), bytes + "garbage!", 100).error().code, ErrorCode::kBadRequest);
}

TEST_P(ContentCodings, the_limit_is_on_the_inflated_size) {
  const std::string text = noise(1000);
  EXPECT_TRUE(decoded(GetParam(), coded(GetParam(), text), 100, 1000));
  const auto out = decoded(GetParam(), coded(GetParam(), text), 100, 999);
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().code, ErrorCode::kPayloadTooLarge);
  EXPECT_NE(out.error().message().find("999"), std::string::npos);
}

TEST_P(ContentCodings, a_bomb_is_refused_by_its_ratio) {
  const std::string zeros(size_t{64} << 20, '\0');
  const auto out = decoded(GetParam(), coded(GetParam(), zeros), 65536, int64_t{1} << 40);
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().code, ErrorCode::kPayloadTooLarge);
  EXPECT_NE(out.error().message().find("200 times"), std::string::npos);
}

TEST(ContentCodingZstd, a_window_over_the_limit_is_refused) {
  // A frame (RFC 8878 section 3.1.1): magic, no flags, a window, an empty last raw block.
  const auto with_window = [](char window) {
    const std::string frame =
        std::string("\x28\xb5\x2f\xfd\x00", 5) + window + std::string("\x01\x00\x00", 3);
    return decoded(ContentCoding::kZstd, frame, 100);
  };
  const auto fits = with_window('\x68');  // 2^23
  ASSERT_TRUE(fits) << fits.error().message();
  EXPECT_EQ(*fits, "");
  const auto out = with_window('\x88');  // 2^27
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().code, ErrorCode::kBadRequest);
}

TEST(ContentCodingName, one_coding_or_none) {
  EXPECT_EQ(parse_content_coding("").value(), ContentCoding::kNone);
  EXPECT_EQ(parse_content_coding("identity").value(), ContentCoding::kNone);
  EXPECT_EQ(parse_content_coding("GZip").value(), ContentCoding::kGzip);
  EXPECT_EQ(parse_content_coding("x-gzip").value(), ContentCoding::kGzip);
  EXPECT_EQ(parse_content_coding("zstd").value(), ContentCoding::kZstd);
  for (const char* name : {"br", "deflate", "gzip, zstd", "gzip,gzip", "gzip;q=1", "none"}) {
    const auto coding = parse_content_coding(name);
    ASSERT_FALSE(coding) << name;
    EXPECT_EQ(coding.error().code, ErrorCode::kUnsupportedMedia);
  }
}

}  // namespace
}  // namespace voxeld::http
