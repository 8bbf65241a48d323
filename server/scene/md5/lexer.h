// The tokens of an MD5 file, for meshes and animations.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "proto/result.h"

namespace voxeld {

// One of { } ( ), a word, or a string without its quotes. A backslash in a string has no special
// meaning.
struct Md5Token {
  enum Kind { kEnd, kWord, kString, kPunctuation };
  Kind kind = kEnd;
  std::string_view text;
  int64_t line = 1;

  bool is(std::string_view word) const { return kind == kWord && text == word; }
  bool is(char punctuation) const { return kind == kPunctuation && text[0] == punctuation; }
};

// Reads tokens one by one, with one of look-ahead. Comments (// to the end of the line, and those
// between slash-star and star-slash) may stand between any two. Blanks around parentheses may be
// missing. All errors are malformed-mesh with file, line, expected and got. `text` must outlive it.
class Md5Lexer {
 public:
  Md5Lexer(std::string_view name, std::string_view text) : name_(name), text_(text) {}

  const std::string& name() const { return name_; }
  // Unread bytes. They bound the tokens that follow, and so the counts that a file may claim.
  size_t bytes_left() const { return text_.size() - at_; }

  // Errors: a comment or string without an end.
  Result<Md5Token> peek();
  Result<Md5Token> next();

  // `what` names the item in an error: "number of joints".
  Status expect(char punctuation, std::string_view what);
  Status expect_word(std::string_view word);
  // Consumes the word if it comes next.
  Result<bool> accept_word(std::string_view word);
  // A finite number of magnitude up to kCoordinateAbsMax.
  Result<double> number(std::string_view what);
  // An integer, low <= it <= high. `expected` describes it in the error; by default it names both
  // bounds.
  Result<int64_t> integer(std::string_view what, int64_t low, int64_t high,
                          std::string expected = {});
  // A string, or a single word if the quotes are missing.
  Result<std::string> string(std::string_view what);
  // Reads `count` numbers in parentheses: "( a b c )".
  Status numbers(std::string_view what, double* out, int count);

  // The error for a token that is not the expected one.
  Error wrong(std::string_view what, std::string expected, const Md5Token& got) const;

 private:
  Result<Md5Token> read();
  Status skip_blanks();
  Status skip_comment();
  Result<Md5Token> read_string();

  std::string name_;
  std::string_view text_;
  size_t at_ = 0;
  int64_t line_ = 1;
  std::optional<Md5Token> ahead_;
};

// Reads "MD5Version 10" and "commandline", the head of both kinds of files. Errors:
// unsupported-feature for other versions, by number.
Status read_md5_head(Md5Lexer& lexer);

}  // namespace voxeld
