#include "server/scene/md5/lexer.h"

#include <algorithm>
#include <utility>

#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

constexpr int64_t kVersion = 10;

bool is_punctuation(char c) {
  return c == '{' || c == '}' || c == '(' || c == ')';
}

}  // namespace

Error Md5Lexer::wrong(std::string_view what, std::string expected, const Md5Token& got) const {
  return malformed_line(
      name_, got.line, what, std::move(expected),
      got.kind == Md5Token::kString && got.text.empty() ? "\"\"" : shown(got.text));
}

Status Md5Lexer::skip_blanks() {
  cancel_point();
  while (at_ < text_.size()) {
    const char c = text_[at_];
    const std::string_view two = text_.substr(at_, 2);
    if (c == '\n' || is_blank(c)) {
      line_ += c == '\n' ? 1 : 0;
      cancel_point_at(++at_);
    } else if (two == "//") {
      const char* const begin = text_.data();
      at_ = static_cast<size_t>(find_newline(begin + at_, begin + text_.size()) - begin);
    } else if (two == "/*") {
      VOXELD_TRY(skip_comment());
    } else {
      return {};
    }
  }
  return {};
}

Status Md5Lexer::skip_comment() {
  cancel_point();
  const int64_t first_line = line_;
  for (at_ += 2; at_ < text_.size(); ++at_) {
    cancel_point_at(at_);
    line_ += text_[at_] == '\n' ? 1 : 0;
    if (text_.substr(at_, 2) != "*/") continue;
    at_ += 2;
    return {};
  }
  return malformed_line(name_, first_line, "a comment without an end", "*/", "the end of the file");
}

Result<Md5Token> Md5Lexer::read_string() {
  const size_t begin = ++at_;
  size_t end = begin;
  while (end < text_.size() && text_[end] != '"' && text_[end] != '\n') cancel_point_at(++end);
  if (end == text_.size() || text_[end] == '\n') {
    return malformed_line(name_, line_, "a string without an end", "\"",
                          shown(text_.substr(begin, end - begin)));
  }
  at_ = end + 1;
  return Md5Token{Md5Token::kString, text_.substr(begin, end - begin), line_};
}

Result<Md5Token> Md5Lexer::read() {
  VOXELD_TRY(skip_blanks());
  if (at_ == text_.size()) return Md5Token{Md5Token::kEnd, {}, line_};
  const size_t begin = at_;
  if (text_[at_] == '"') return read_string();
  if (is_punctuation(text_[at_])) {
    return Md5Token{Md5Token::kPunctuation, text_.substr(at_++, 1), line_};
  }
  const auto ends = [&](char c) {
    return c == '\n' || is_blank(c) || is_punctuation(c) || c == '"';
  };
  while (at_ < text_.size() && !ends(text_[at_])) {
    const std::string_view two = text_.substr(at_, 2);
    if (two == "//" || two == "/*") break;
    cancel_point_at(++at_);
  }
  return Md5Token{Md5Token::kWord, text_.substr(begin, at_ - begin), line_};
}

Result<Md5Token> Md5Lexer::peek() {
  if (!ahead_) {
    VOXELD_ASSIGN(ahead_, read());
  }
  return *ahead_;
}

Result<Md5Token> Md5Lexer::next() {
  VOXELD_ASSIGN(const Md5Token token, peek());
  ahead_.reset();
  return token;
}

Status Md5Lexer::expect(char punctuation, std::string_view what) {
  VOXELD_ASSIGN(const Md5Token token, next());
  if (token.is(punctuation)) return {};
  return wrong(what, std::string(1, punctuation), token);
}

Status Md5Lexer::expect_word(std::string_view word) {
  VOXELD_ASSIGN(const Md5Token token, next());
  if (token.is(word)) return {};
  return wrong("wrong keyword", std::string(word), token);
}

Result<bool> Md5Lexer::accept_word(std::string_view word) {
  VOXELD_ASSIGN(const Md5Token token, peek());
  if (!token.is(word)) return false;
  ahead_.reset();
  return true;
}

Result<double> Md5Lexer::number(std::string_view what) {
  VOXELD_ASSIGN(const Md5Token token, next());
  const auto value = token.kind == Md5Token::kWord ? parse_number(token.text) : std::nullopt;
  if (!value || !is_coordinate(*value)) return wrong(what, "a finite number", token);
  return *value;
}

Result<int64_t> Md5Lexer::integer(std::string_view what, int64_t low, int64_t high,
                                  std::string expected) {
  VOXELD_ASSIGN(const Md5Token token, next());
  const auto value = token.kind == Md5Token::kWord ? parse_integer(token.text) : std::nullopt;
  if (!value || *value < low || *value > high) {
    if (expected.empty()) {
      expected = (low == high ? "" : "a whole number from ") + range_text(low, high);
    }
    return wrong(what, std::move(expected), token);
  }
  return *value;
}

Result<std::string> Md5Lexer::string(std::string_view what) {
  VOXELD_ASSIGN(const Md5Token token, next());
  if (token.kind != Md5Token::kString && token.kind != Md5Token::kWord) {
    return wrong(what, "a string in quotes", token);
  }
  return std::string(token.text);
}

Status Md5Lexer::numbers(std::string_view what, double* out, int count) {
  VOXELD_TRY(expect('(', what));
  for (int i = 0; i < count; ++i) {
    VOXELD_ASSIGN(out[i], number(what));
  }
  return expect(')', what);
}

Status read_md5_head(Md5Lexer& lexer) {
  VOXELD_TRY(lexer.expect_word("MD5Version"));
  VOXELD_ASSIGN(const Md5Token version, lexer.next());
  const auto number = parse_integer(version.text);
  if (!number) return lexer.wrong("MD5Version", "10", version);
  if (*number != kVersion) {
    return Error{ErrorCode::kUnsupportedFeature,
                 lexer.name() + " line " + std::to_string(version.line) + ": MD5Version " +
                     std::to_string(*number),
                 "MD5Version " + std::to_string(kVersion), std::to_string(*number)};
  }
  VOXELD_ASSIGN(const bool has_command_line, lexer.accept_word("commandline"));
  if (has_command_line) VOXELD_TRY(lexer.string("commandline"));
  return {};
}

}  // namespace voxeld
