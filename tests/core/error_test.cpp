// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

#include <gtest/gtest.h>

namespace virga {
namespace {

SourcePosition place(std::string text, size_t offset, size_t length) {
  return {std::make_shared<SourceFile>(SourceFile{"fog.xml", std::move(text)}), offset, length};
}

std::string shown(std::string text, size_t offset, size_t length, std::string hint = "") {
  return Error("bad", {.position = place(std::move(text), offset, length), .hint = std::move(hint), .notes = {}})
      .what();
}

TEST(Error, PointsAtTheWord) {
  const std::string text = "<scene>\n    <medium type=\"homogenous\">\n</scene>\n";
  const Error error("unknown medium type \"homogenous\"", {.position = place(text, text.find("homog"), 10),
                                                           .hint = "did you mean \"homogeneous\"?",
                                                           .notes = {"available: heterogeneous, homogeneous", "more"}});
  EXPECT_STREQ(error.what(),
               "fog.xml:2:19: error: unknown medium type \"homogenous\"\n"
               "    2 |     <medium type=\"homogenous\">\n"
               "      |                   ^~~~~~~~~~ did you mean \"homogeneous\"?\n"
               "  note: available: heterogeneous, homogeneous\n"
               "  note: more");
  EXPECT_EQ(error.message(), "unknown medium type \"homogenous\"");
}

TEST(Error, FirstByteAndWidthOne) {
  EXPECT_EQ(shown("abc\ndef", 0, 1), "fog.xml:1:1: error: bad\n    1 | abc\n      | ^");
  EXPECT_EQ(shown("abc\ndef", 4, 0), "fog.xml:2:1: error: bad\n    2 | def\n      | ^") << "no length is one column";
}

TEST(Error, TabsBecomeBlanksSoThatTheCaretFits) {
  EXPECT_EQ(shown("\t\t<a>", 2, 3), "fog.xml:1:3: error: bad\n    1 |   <a>\n      |   ^~~");
}

TEST(Error, CarriageReturnsAreNotPrinted) { EXPECT_EQ(shown("ab\r\ncd\r\n", 4, 2).find('\r'), std::string::npos); }

TEST(Error, MarkEndsWithItsLine) {
  EXPECT_EQ(shown("abc\ndef\nghi", 5, 100), "fog.xml:2:2: error: bad\n    2 | def\n      |  ^~");
}

TEST(Error, EndOfTheFile) {
  EXPECT_EQ(shown("abc", 3, 1), "fog.xml:1:4: error: bad\n    1 | abc\n      |    ^");
  EXPECT_EQ(shown("abc\n", 4, 5), "fog.xml:2:1: error: bad\n    2 | \n      | ^");
  EXPECT_EQ(shown("abc", 99, 1), "fog.xml:1:4: error: bad\n    1 | abc\n      |    ^") << "behind the end";
  EXPECT_EQ(shown("abc\ndef", 3, 1), "fog.xml:1:4: error: bad\n    1 | abc\n      |    ^") << "on the line's end";
}

TEST(Error, LongLinesAreCutAroundTheWord) {
  const std::string text = std::string(500, 'a') + "WORD" + std::string(500, 'b');
  const std::string out = shown(text, 500, 4, "here");
  EXPECT_EQ(out.find("fog.xml:1:501:"), 0u);
  const size_t first = out.find('\n') + 1, second = out.find('\n', first) + 1;
  EXPECT_LT(second - first, 120u);
  const std::string line = out.substr(first, second - first - 1), mark = out.substr(second);
  EXPECT_EQ(line.substr(mark.find('^'), 4), "WORD");
  EXPECT_EQ(mark.substr(mark.find('^')), "^~~~ here");
}

TEST(Error, WithoutAnExcerpt) {
  EXPECT_STREQ(Error("bad").what(), "error: bad");
  EXPECT_STREQ(Error("bad", {.position = {}, .hint = "try again", .notes = {"n"}}).what(),
               "error: bad; try again\n  note: n");
  EXPECT_EQ(shown("", 7, 2, "too short"), "fog.xml: error: bad; too short") << "binary files";
}

TEST(Error, AtPlacesWhatHasNoPlace) {
  const SourcePosition here = place("<a/>", 0, 4);
  Error::Details details;
  details.hint = "h";
  details.notes = {"n"};
  EXPECT_STREQ(Error("bad", details).at(here).what(),
               "fog.xml:1:1: error: bad\n    1 | <a/>\n      | ^~~~ h\n  note: n");
  details.position.file = std::make_shared<SourceFile>(SourceFile{"cloud.vol", ""});
  EXPECT_EQ(Error("bad", details).at(here).message(), "cloud.vol: bad");
  details.position = place("other", 2, 1);
  EXPECT_STREQ(Error("bad", details).at(here).what(), Error("bad", details).what());
}

TEST(SourcePosition, CountsLinesAndColumnsFromOne) {
  const std::string text = "a\n\nbc\n";
  const int lines[] = {1, 1, 2, 3, 3, 3, 4}, columns[] = {1, 2, 1, 1, 2, 3, 1};
  for (size_t i = 0; i <= text.size(); ++i) {
    EXPECT_EQ(place(text, i, 1).line(), lines[i]) << i;
    EXPECT_EQ(place(text, i, 1).column(), columns[i]) << i;
  }
}

TEST(Nearest, FindsWhatWasMeant) {
  const std::vector<std::string> known = {"heterogeneous", "homogeneous", "diffuse", "phong", "obj"};
  EXPECT_EQ(nearest("homogenous", known), "homogeneous");
  EXPECT_EQ(nearest("hetrogenous", known), "heterogeneous");
  EXPECT_EQ(nearest("Phong", known), "phong");
  EXPECT_EQ(nearest("diffuse", known), "diffuse");
  EXPECT_EQ(nearest("ojb", known), "obj");
  EXPECT_EQ(didYouMean("phnog", known), "did you mean \"phong\"?");
}

TEST(Nearest, IsSilentWhereNothingIsNear) {
  const std::vector<std::string> known = {"diffuse", "phong", "to", "g"};
  EXPECT_EQ(nearest("conductor", known), "");
  EXPECT_EQ(nearest("x", known), "") << "every letter would be replaced";
  EXPECT_EQ(nearest("ab", known), "") << "every letter would be replaced";
  EXPECT_EQ(nearest("", known), "");
  EXPECT_EQ(nearest("phong", {}), "");
  EXPECT_EQ(didYouMean("conductor", known), "");
}

TEST(Joined, SeparatesWords) {
  EXPECT_EQ(joined({}), "");
  EXPECT_EQ(joined({"a"}), "a");
  EXPECT_EQ(joined({"a", "b", "c"}), "a, b, c");
  EXPECT_EQ(joined({"a", "b"}, " | "), "a | b");
}

TEST(AssertDeathTest, NamesTheExpression) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_DEATH(VIRGA_ASSERT(1 + 1 == 3), "assertion failed: 1 \\+ 1 == 3");
}

}  // namespace
}  // namespace virga
